//! Watertight intersection of mesh triangles with packets of rays in arbitrary directions. Performs the
//! operations of [`ShearedRay::intersect`] in the same order, so the results are bit-identical.

use super::packet::{F32x16, HitPacket, PACKET_SIZE, RayPacket, set_bit_lanes};
use super::watertight::{ILL_CONDITIONED, ShearedRay};
use crate::math::Vec3;
use crate::math::float::gamma;
use crate::math::lanes::{Mask, Simd, TRUE, Vec3x16, select, select_u32};

/// A packet of rays, preprocessed for triangle tests.
pub struct ShearedPacket<'a> {
    rays: &'a RayPacket,
    /// Mask of the rays whose longest axis is x, and mask of the rays whose longest axis is y.
    longest: [Mask; 2],
    /// Mask of the rays with a negative direction along their longest axis. The scalar test then swaps the
    /// other two axes, which only negates the edge functions.
    is_down: Mask,
    /// Shears of the two axes that follow the longest axis, and scale of the longest axis.
    shear: Vec3x16,
}

/// Results of testing each ray in a packet against one triangle.
pub(super) struct TriangleTestResults {
    pub(super) hit: Mask,
    /// Lanes that need the scalar test.
    pub(super) doubtful: Mask,
    pub(super) t: F32x16,
    pub(super) u: F32x16,
    pub(super) v: F32x16,
}

/// A triangle corner, shared by all rays or different for each ray.
pub(super) trait Corner: Copy {
    /// Coordinate of the corner for the ray in a lane.
    fn coordinate_in_lane(self, axis: usize, lane: usize) -> f32;
}

impl Corner for Vec3 {
    #[inline(always)]
    fn coordinate_in_lane(self, axis: usize, _: usize) -> f32 {
        self[axis]
    }
}

impl Corner for &Vec3x16 {
    #[inline(always)]
    fn coordinate_in_lane(self, axis: usize, lane: usize) -> f32 {
        self[axis][lane]
    }
}

impl<'a> ShearedPacket<'a> {
    /// Preprocesses a packet.
    #[inline(always)]
    pub fn new(rays: &'a RayPacket) -> Self {
        let (mut longest, mut is_down) = ([[0; PACKET_SIZE]; 2], [0; PACKET_SIZE]);
        let mut shear = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let [x, y, z] = [rays.direction[0][i], rays.direction[1][i], rays.direction[2][i]];
            let [size_x, size_y, size_z] = [x.abs(), y.abs(), z.abs()];
            let is_x = (size_x > size_y) & (size_x > size_z);
            let is_y = !(size_x > size_y) & (size_y > size_z);
            let along = if is_x {
                x
            } else if is_y {
                y
            } else {
                z
            };
            let first = if is_x {
                y
            } else if is_y {
                z
            } else {
                x
            };
            let second = if is_x {
                z
            } else if is_y {
                x
            } else {
                y
            };
            let scale = 1.0 / along;
            longest[0][i] = if is_x { TRUE } else { 0 };
            longest[1][i] = if is_y { TRUE } else { 0 };
            is_down[i] = if along < 0.0 { TRUE } else { 0 };
            shear[0][i] = first * scale;
            shear[1][i] = second * scale;
            shear[2][i] = scale;
        }
        Self { rays, longest, is_down, shear }
    }

    /// Updates `found` with nearer hits on a triangle. Triangles must be tested in order of increasing
    /// indices. `met` is the mask of traced rays. All other rays must have negative ends.
    #[inline(always)]
    pub fn update_closest_hits(
        &self,
        (number, corners): (u32, &[Vec3; 3]),
        (met, ends): (u32, &mut F32x16),
        found: &mut HitPacket,
        simd: impl Simd,
    ) {
        let hits = self.intersect_triangles_per_ray(&[number; PACKET_SIZE], *corners, ends);
        let mut is_nearer = [0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            // A hit at the end of a ray counts, unless the ray hit an earlier triangle at the same t.
            let is_tie = !found.t[i].is_nan() & (hits.t[i] == found.t[i]);
            is_nearer[i] = if is_tie { 0 } else { hits.hit[i] };
        }
        select(&is_nearer, &hits.t, ends);
        select(&is_nearer, &hits.t, &mut found.t);
        select(&is_nearer, &hits.u, &mut found.u);
        select(&is_nearer, &hits.v, &mut found.v);
        select_u32(&is_nearer, &[number; PACKET_SIZE], &mut found.primitive);
        let doubtful = simd.movemask(&hits.doubtful) & met;
        if doubtful != 0 {
            self.update_closest_hits_scalar(doubtful, (number, corners), ends, found);
        }
    }

    /// Mask of the rays in `met` that hit a triangle. All other rays must have negative ends.
    #[inline(always)]
    pub fn hit_mask(
        &self,
        (number, corners): (u32, &[Vec3; 3]),
        met: u32,
        ends: &F32x16,
        simd: impl Simd,
    ) -> u32 {
        let hits = self.intersect_triangles_per_ray(&[number; PACKET_SIZE], *corners, ends);
        let doubtful = simd.movemask(&hits.doubtful) & met;
        let hit = simd.movemask(&hits.hit) & met;
        if doubtful == 0 { hit } else { hit | self.hit_mask_scalar(doubtful, corners, ends) }
    }

    /// [`ShearedPacket::update_closest_hits`] for the given rays, one by one.
    #[cold]
    #[inline(never)]
    fn update_closest_hits_scalar(
        &self,
        these: u32,
        (number, corners): (u32, &[Vec3; 3]),
        ends: &mut F32x16,
        found: &mut HitPacket,
    ) {
        for i in set_bit_lanes(these) {
            let Some(hit) = self.intersect_lane(i, corners, ends[i]) else { continue };
            if found.t[i].is_nan() || hit.t < found.t[i] {
                found.set(i, &super::ShapeHit { primitive: number, ..hit });
                ends[i] = hit.t;
            }
        }
    }

    /// [`ShearedPacket::hit_mask`] for the given rays, one by one.
    #[cold]
    #[inline(never)]
    fn hit_mask_scalar(&self, these: u32, corners: &[Vec3; 3], ends: &F32x16) -> u32 {
        set_bit_lanes(these)
            .filter(|&i| self.intersect_lane(i, corners, ends[i]).is_some())
            .fold(0, |hit, i| hit | 1 << i)
    }

    fn intersect_lane(&self, i: usize, corners: &[Vec3; 3], end: f32) -> Option<super::ShapeHit> {
        let ray = self.rays.ray(i);
        ShearedRay::new(ray.origin, ray.direction).intersect(corners, end)
    }

    /// A corner in each ray's sheared coordinates.
    #[inline(always)]
    fn shear_corner(&self, corner: impl Corner) -> Vec3x16 {
        let mut seen = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let [x, y, z] =
                [0, 1, 2].map(|axis| corner.coordinate_in_lane(axis, i) - self.rays.origin[axis][i]);
            let (is_x, is_y) = (self.longest[0][i] != 0, self.longest[1][i] != 0);
            let along = if is_x {
                x
            } else if is_y {
                y
            } else {
                z
            };
            let first = if is_x {
                y
            } else if is_y {
                z
            } else {
                x
            };
            let second = if is_x {
                z
            } else if is_y {
                x
            } else {
                y
            };
            seen[0][i] = first - self.shear[0][i] * along;
            seen[1][i] = second - self.shear[1][i] * along;
            seen[2][i] = along;
        }
        seen
    }

    /// [`ShearedRay::intersect`] for a packet in which each ray has its own triangle. Rays that start on
    /// their triangle do not hit it.
    #[inline(always)]
    pub(super) fn intersect_triangles_per_ray(
        &self,
        numbers: &[u32; PACKET_SIZE],
        corners: [impl Corner; 3],
        ends: &F32x16,
    ) -> TriangleTestResults {
        let [a, b, c] =
            [self.shear_corner(corners[0]), self.shear_corner(corners[1]), self.shear_corner(corners[2])];
        let mut hits = TriangleTestResults {
            hit: [0; PACKET_SIZE],
            doubtful: [0; PACKET_SIZE],
            t: [0.0; PACKET_SIZE],
            u: [0.0; PACKET_SIZE],
            v: [0.0; PACKET_SIZE],
        };
        for i in 0..PACKET_SIZE {
            let ([ax, ay, az], [bx, by, bz]) = ([a[0][i], a[1][i], a[2][i]], [b[0][i], b[1][i], b[2][i]]);
            let [cx, cy, cz] = [c[0][i], c[1][i], c[2][i]];
            let (wa, wb, wc) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
            let (is_left, is_right) =
                ((wa < 0.0) | (wb < 0.0) | (wc < 0.0), (wa > 0.0) | (wb > 0.0) | (wc > 0.0));
            let is_on_edge = (wa == 0.0) | (wb == 0.0) | (wc == 0.0);
            let inverse = 1.0 / (wa + wb + wc);
            let shear_z = self.shear[2][i];
            let t = (wa * az + wb * bz + wc * cz) * shear_z * inverse;
            // Compute the error bound as in `ShearedRay::distance_error`.
            let first = max_abs_scalar([ax, bx, cx]);
            let second = max_abs_scalar([ay, by, cy]);
            let depth = max_abs_scalar([az, bz, cz]);
            let is_down = self.is_down[i] != 0;
            let (x, y) = (if is_down { second } else { first }, if is_down { first } else { second });
            let z = depth * shear_z.abs();
            let error_z = gamma(3) * z;
            let (error_x, error_y) = (gamma(5) * (x + depth), gamma(5) * (y + depth));
            let error_edge = 2.0 * (gamma(2) * x * y + error_y * x + error_x * y);
            let edge = 2.0 * x * y;
            let error = 3.0 * (gamma(3) * edge * z + error_edge * z + error_z * edge) * inverse.abs();
            let is_doubtful = (error > z * ILL_CONDITIONED) | (t.abs() <= error) | is_on_edge;
            let is_inside = !(is_left & is_right) & (self.rays.start[i] != numbers[i]);
            let is_hit = is_inside & !is_doubtful & (t > 0.0) & (t <= ends[i]);
            hits.doubtful[i] = if is_inside & is_doubtful { TRUE } else { 0 };
            hits.hit[i] = if is_hit { TRUE } else { 0 };
            hits.t[i] = t;
            hits.u[i] = wb * inverse;
            hits.v[i] = wc * inverse;
        }
        hits
    }
}

/// Maximum of the absolute values of three numbers.
#[inline(always)]
fn max_abs_scalar([a, b, c]: [f32; 3]) -> f32 {
    let (a, b, c) = (a.abs(), b.abs(), c.abs());
    let most = if a > b { a } else { b };
    if most > c { most } else { c }
}
