//! Packets of rays against merged meshes. If the rays are incoherent and there are few triangles, all
//! triangles are tested. In other cases, the tree is traversed.

use super::MergedMeshes;
use crate::accel::{F32x16, InstructionSet, PACKET_SIZE, SimdKernel};
use crate::geometry::Ray;
use crate::geometry::packet::{HitPacket, RayPacket, set_bit_lanes};
use crate::geometry::triangle_list::BruteForceTriangles;
use crate::math::Vec3;
use crate::math::lanes::{Simd, TRUE};

impl MergedMeshes {
    /// Finds the nearest hits of the rays in `active`. The hits' primitives are triangle indices into the
    /// tree. Other lanes have negative `ends`.
    #[inline(never)]
    pub fn closest_hit_packet(
        &self,
        by: InstructionSet,
        rows: &RayPacket,
        (active, ends): (u32, &F32x16),
        found: &mut HitPacket,
    ) {
        let Some(facets) = &self.facets else {
            return self.closest_hit_packet_with_tree(rows, active, ends, found);
        };
        let size = self.bounds().extent();
        match by.run(TriangleListClosestHitKernel { facets, size, rows, active, ends, found }) {
            Some(0) => {}
            Some(undecided) => self.closest_hit_per_ray(rows, undecided, ends, found),
            None => self.closest_hit_packet_with_tree(rows, active, ends, found),
        }
    }

    /// Traces the rays in `these` one by one.
    #[cold]
    #[inline(never)]
    fn closest_hit_per_ray(&self, rows: &RayPacket, these: u32, ends: &F32x16, found: &mut HitPacket) {
        for lane in set_bit_lanes(these) {
            if let Some(hit) = self.tree.closest_hit(&Ray { t_max: ends[lane], ..rows.ray(lane) }) {
                found.set(lane, &hit);
            }
        }
    }

    #[inline(never)]
    fn closest_hit_packet_with_tree(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        found: &mut HitPacket,
    ) {
        let mut hits = [None; PACKET_SIZE];
        self.tree.closest_hit_packet(&unpack_rays(rows, active), ends, &mut hits);
        for (lane, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                found.set(lane, hit);
            }
        }
    }

    /// Returns the mask of rays in `active` that hit any triangle other than the lane's entry in `except`,
    /// which may be [`MergedMeshes::NO_TRIANGLE`].
    #[inline(never)]
    pub fn any_hit_packet(
        &self,
        by: InstructionSet,
        rows: &RayPacket,
        (active, ends): (u32, &F32x16),
        except: Option<&[u32; PACKET_SIZE]>,
    ) -> u32 {
        let Some(facets) = &self.facets else {
            return self.any_hit_packet_with_tree(rows, active, ends, except);
        };
        let own = except.unwrap_or(&[Self::NO_TRIANGLE; PACKET_SIZE]);
        let size = self.bounds().extent();
        match by.run(TriangleListAnyHitKernel { facets, size, rows, active, ends, except: own }) {
            Some([hit, 0]) => hit,
            Some([hit, undecided]) => hit | self.any_hit_one_by_one(rows, undecided, ends, own),
            None => self.any_hit_packet_with_tree(rows, active, ends, except),
        }
    }

    /// Traces the rays in `these` one by one. See [`MergedMeshes::any_hit_packet`].
    #[cold]
    #[inline(never)]
    fn any_hit_one_by_one(
        &self,
        rows: &RayPacket,
        these: u32,
        ends: &F32x16,
        except: &[u32; PACKET_SIZE],
    ) -> u32 {
        let is_hit = |&lane: &usize| {
            let own = (except[lane] != Self::NO_TRIANGLE).then_some(except[lane]);
            self.tree.any_hit(&Ray { t_max: ends[lane], ..rows.ray(lane) }, own)
        };
        set_bit_lanes(these).filter(is_hit).fold(0, |bits, lane| bits | 1 << lane)
    }

    #[inline(never)]
    fn any_hit_packet_with_tree(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        except: Option<&[u32; PACKET_SIZE]>,
    ) -> u32 {
        let rays = unpack_rays(rows, active);
        let Some(numbers) = except else { return self.tree.any_hit_packet(&rays, ends, &[]) };
        let own = numbers.map(|number| (number != Self::NO_TRIANGLE).then_some(number));
        self.tree.any_hit_packet(&rays, ends, &own)
    }
}

/// Whether the rays in `active` start close together, relative to `size`, and have similar directions. Such
/// rays are faster with the tree than without it.
#[inline(always)]
fn are_rays_coherent(rows: &RayPacket, active: u32, size: Vec3, simd: impl Simd) -> bool {
    let first = active.trailing_zeros() as usize % PACKET_SIZE;
    let near = size.element_sum() * COHERENCE;
    let along = (0..3).map(|axis| rows.direction[axis][first].abs()).sum::<f32>() * COHERENCE;
    let from = [0, 1, 2].map(|axis| rows.origin[axis][first]);
    let way = [0, 1, 2].map(|axis| rows.direction[axis][first]);
    let ([ox, oy, oz], [dx, dy, dz]) = (&rows.origin, &rows.direction);
    let mut differs = [0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        let apart = (ox[lane] - from[0]).abs() + (oy[lane] - from[1]).abs() + (oz[lane] - from[2]).abs();
        let aside = (dx[lane] - way[0]).abs() + (dy[lane] - way[1]).abs() + (dz[lane] - way[2]).abs();
        differs[lane] = if (apart <= near) & (aside <= along) { 0 } else { TRUE };
    }
    simd.movemask(&differs) & active == 0
}

/// Coherence threshold: maximum difference between ray origins relative to the size of all triangles, and
/// between directions relative to their length.
const COHERENCE: f32 = 0.125;

/// Kernel that calls [`BruteForceTriangles::update_decided_closest_hits`] for incoherent rays and returns the
/// lanes that need an exact test, or returns `None` for coherent rays.
struct TriangleListClosestHitKernel<'a> {
    facets: &'a BruteForceTriangles,
    size: Vec3,
    rows: &'a RayPacket,
    active: u32,
    ends: &'a F32x16,
    found: &'a mut HitPacket,
}

impl SimdKernel for TriangleListClosestHitKernel<'_> {
    type Output = Option<u32>;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> Option<u32> {
        let Self { facets, size, rows, active, ends, found } = self;
        if are_rays_coherent(rows, active, size, simd) {
            return None;
        }
        Some(facets.update_decided_closest_hits(rows, (active, ends), found, simd))
    }
}

/// Kernel that calls [`BruteForceTriangles::any_hit_and_undecided_masks`] for incoherent rays and returns the
/// hit lanes and the lanes that need an exact test, or returns `None` for coherent rays.
struct TriangleListAnyHitKernel<'a> {
    facets: &'a BruteForceTriangles,
    size: Vec3,
    rows: &'a RayPacket,
    active: u32,
    ends: &'a F32x16,
    except: &'a [u32; PACKET_SIZE],
}

impl SimdKernel for TriangleListAnyHitKernel<'_> {
    type Output = Option<[u32; 2]>;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> Option<[u32; 2]> {
        let Self { facets, size, rows, active, ends, except } = self;
        if are_rays_coherent(rows, active, size, simd) {
            return None;
        }
        Some(facets.any_hit_and_undecided_masks(rows, (active, ends), except, simd))
    }
}

/// Returns the rays of a packet. Lanes outside `active` contain a copy of the first ray in `active`, whose
/// direction is likely similar.
#[inline]
fn unpack_rays(rows: &RayPacket, active: u32) -> [Ray; PACKET_SIZE] {
    let mut rays = [rows.ray(active.trailing_zeros() as usize % PACKET_SIZE); PACKET_SIZE];
    for lane in set_bit_lanes(active & active.wrapping_sub(1)) {
        rays[lane] = rows.ray(lane);
    }
    rays
}
