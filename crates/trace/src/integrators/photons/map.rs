//! A photon map: photons sorted into the cells of a hashed grid. Because of the hashing, the cells can be as
//! small as the radius requires. Lookups weight sixteen photons at a time.

mod cells;

use super::packed::{self, PackedDirectionPacket};
use super::reservoir::{PhotonPositionAndNormal, ReservoirPacket};
use crate::control::{CancelToken, Canceled};
use crate::geometry::Aabb;
use crate::geometry::packet::set_bit_lanes;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Simd, TRUE, Vec3x16, lane, set_lane};
use cells::{CELL, blocks_covering_photon_range, bucket_of_cell, cell_of};

/// A photon stored on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Position on the surface.
    pub point: Vec3,
    /// Unit direction toward the photon's origin.
    pub direction: Vec3,
    /// Basic flux in W, Φ/n².
    pub flux: Vec3,
    /// Unit geometric normal on the side of the surface that the photon hit.
    pub normal: Vec3,
    /// Number of bounces before the hit.
    pub depth: u32,
}

/// Number of photons sorted between checks of the cancel token.
const POLL_INTERVAL: usize = 1 << 16;

/// Sixteen photons as a struct of arrays, eight cache lines in size.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct PhotonBlock {
    point: Vec3x16,
    normal: PackedDirectionPacket,
    direction: PackedDirectionPacket,
    flux: Vec3x16,
}

/// A block without photons: all positions are at infinity.
const EMPTY: PhotonBlock = PhotonBlock {
    point: [[f32::INFINITY; PACKET_SIZE]; 3],
    normal: [0; PACKET_SIZE],
    direction: [0; PACKET_SIZE],
    flux: [[0.0; PACKET_SIZE]; 3],
};

/// Photons in a hashed grid.
#[derive(Clone, Debug)]
pub struct PhotonMap {
    radius: f32,
    /// Number of cells per unit of length.
    cells: f32,
    /// Number of buckets minus 1. The number of buckets is a power of two.
    mask: u32,
    /// Index of the first photon in each bucket, followed by the number of photons.
    starts: Vec<u32>,
    count: usize,
    blocks: Vec<PhotonBlock>,
    depths: Vec<[u32; PACKET_SIZE]>,
    /// Maximum number of bounces of any stored photon.
    max_depth: u32,
}

/// Minimum cosine between the normals of surfaces within one kernel.
pub(super) const MIN_COSINE: f32 = 0.7;

/// Maximum distance of photons from the tangent plane, in radii.
pub(super) const MAX_PLANE_DISTANCE: f32 = 0.3;

/// A query for photons near a surface point.
#[derive(Clone, Copy, Debug)]
pub struct GatherPoint {
    /// The surface point.
    pub point: Vec3,
    /// Geometric normal on the queried side.
    pub normal: Vec3,
    /// Maximum number of bounces per photon.
    pub max_depth: u32,
}

impl GatherPoint {
    /// The bounding box of a kernel with this radius.
    pub fn kernel_box(&self, radius: f32) -> Aabb {
        let half = self.unit_kernel_half_extents() * radius;
        Aabb { min: self.point - half, max: self.point + half }
    }

    /// Half extents of the bounding box of a unit-radius kernel.
    #[inline(always)]
    fn unit_kernel_half_extents(&self) -> Vec3 {
        let own = self.normal.abs();
        let along = (Vec3::ONE - own * own).max(Vec3::ZERO);
        Vec3::new(along.x.sqrt(), along.y.sqrt(), along.z.sqrt()) + own * MAX_PLANE_DISTANCE
    }
}

impl PhotonMap {
    /// Builds a map for kernels of this radius. Photons in one cell keep their order.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn new(photons: &[Photon], radius: f32, token: &CancelToken) -> Result<Self, Canceled> {
        // Count the photons in each bucket.
        let cells = 1.0 / (CELL * radius);
        let mask = (photons.len().max(1).next_power_of_two() - 1) as u32;
        let mut starts = vec![0_u32; mask as usize + 2];
        let mut buckets = Vec::with_capacity(photons.len());
        for photons in photons.chunks(POLL_INTERVAL) {
            token.check_pause_and_cancel()?;
            for photon in photons {
                let [x, y, z] = cell_of(photon.point, cells);
                let bucket = bucket_of_cell(x, y, z, mask);
                starts[bucket as usize + 1] += 1;
                buckets.push(bucket);
            }
        }
        // Sort the photons by bucket.
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        token.check_pause_and_cancel()?;
        let mut next = starts.clone();
        let mut order = vec![0_u32; photons.len()];
        for (part, buckets) in buckets.chunks(POLL_INTERVAL).enumerate() {
            token.check_pause_and_cancel()?;
            for (number, &bucket) in ((part * POLL_INTERVAL) as u32..).zip(buckets) {
                let place = &mut next[bucket as usize];
                order[*place as usize] = number;
                *place += 1;
            }
        }
        // Store them in blocks.
        let rows = photons.len().div_ceil(PACKET_SIZE);
        let (mut blocks, mut depths) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
        for order in order.chunks(POLL_INTERVAL) {
            token.check_pause_and_cancel()?;
            for order in order.chunks(PACKET_SIZE) {
                let (mut block, mut depth) = (EMPTY, [0; PACKET_SIZE]);
                for (i, &number) in order.iter().enumerate() {
                    depth[i] = block.set_photon_lane(i, &photons[number as usize]);
                }
                blocks.push(block);
                depths.push(depth);
            }
        }
        let max_depth = depths.as_flattened().iter().copied().max().unwrap_or(0);
        Ok(Self { radius, cells, mask, starts, count: photons.len(), blocks, depths, max_depth })
    }

    /// All photons, in bucket order.
    pub fn iter_photons(&self) -> impl Iterator<Item = Photon> + '_ {
        (0..self.count).map(|number| self.photon(number / PACKET_SIZE, number % PACKET_SIZE))
    }

    /// Returns a photon. Its directions are stored with limited precision.
    #[inline(always)]
    fn photon(&self, block: usize, i: usize) -> Photon {
        let PhotonBlock { point, normal, direction, flux } = &self.blocks[block];
        Photon {
            point: lane(point, i),
            direction: packed::unpack_unit_vector(direction[i]),
            flux: lane(flux, i),
            normal: packed::unpack_unit_vector(normal[i]),
            depth: self.depths[block][i],
        }
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether the map is empty.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Kernel radius.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Memory use in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.blocks) + size_of_val(&*self.depths) + size_of_val(&*self.starts)
    }

    /// Irradiance in W·m⁻² from the photons around a point, and one of these photons. The photon is chosen
    /// with two random numbers, in proportion to its contribution.
    #[inline(always)]
    pub fn irradiance_and_chosen_photon(
        &self,
        look: &GatherPoint,
        random: [f32; 2],
        simd: impl Simd,
    ) -> (Vec3, Option<PhotonPositionAndNormal>) {
        let mut sums = [[0.0; PACKET_SIZE]; 3];
        let mut choices = ReservoirPacket::new(random[0]);
        let ranges = self.candidate_ranges(look);
        for range in &ranges.of[..ranges.count] {
            for block in blocks_covering_photon_range(*range) {
                let Some(weights) = self.kernel_weights_in_block(look, *range, block, simd) else { continue };
                let flux = &self.blocks[block].flux;
                let mut brought = [0.0; PACKET_SIZE];
                for axis in 0..3 {
                    for i in 0..PACKET_SIZE {
                        let weighted = flux[axis][i] * weights[i];
                        sums[axis][i] += weighted;
                        brought[i] += weighted;
                    }
                }
                choices.add_item(block as u32, &brought);
            }
        }
        let chosen = choices
            .choose_one_lane_by_weight(random[1])
            .map(|(block, i)| self.position_and_normal(block as usize, i));
        (Vec3::from(sums.map(sum_lanes)) * self.kernel_peak(), chosen)
    }

    /// Position and normal of a photon.
    #[inline(always)]
    fn position_and_normal(&self, block: usize, i: usize) -> PhotonPositionAndNormal {
        let PhotonBlock { point, normal, .. } = &self.blocks[block];
        PhotonPositionAndNormal { point: lane(point, i), normal: packed::unpack_unit_vector(normal[i]) }
    }

    /// Number of photons in the kernel around a point.
    #[inline(always)]
    pub fn count_near(&self, look: &GatherPoint, simd: impl Simd) -> u32 {
        let mut count = 0;
        let ranges = self.candidate_ranges(look);
        for range in &ranges.of[..ranges.count] {
            for block in blocks_covering_photon_range(*range) {
                let Some(weights) = self.kernel_weights_in_block(look, *range, block, simd) else { continue };
                count += positive_lane_mask(&weights, simd).count_ones();
            }
        }
        count
    }

    /// Visits the photons around a point with their weights in m⁻², which are the values of an Epanechnikov
    /// kernel with an integral of 1 over the tangent plane (Silverman, *Density Estimation for Statistics and
    /// Data Analysis*, 1986).
    #[inline(always)]
    pub fn visit_weighted_photons(
        &self,
        look: &GatherPoint,
        simd: impl Simd,
        mut visit: impl FnMut(&Photon, f32),
    ) {
        let peak = self.kernel_peak();
        let ranges = self.candidate_ranges(look);
        for range in &ranges.of[..ranges.count] {
            for block in blocks_covering_photon_range(*range) {
                let Some(weights) = self.kernel_weights_in_block(look, *range, block, simd) else { continue };
                for i in set_bit_lanes(positive_lane_mask(&weights, simd)) {
                    visit(&self.photon(block, i), peak * weights[i]);
                }
            }
        }
    }

    /// Kernel value at the center.
    #[inline(always)]
    fn kernel_peak(&self) -> f32 {
        2.0 / (std::f32::consts::PI * (self.radius * self.radius))
    }

    /// Weights of a block's photons that are in a range and within the kernel, relative to the kernel's value
    /// at the center, or `None` if there are no such photons.
    #[inline(always)]
    fn kernel_weights_in_block(
        &self,
        look: &GatherPoint,
        range: [u32; 2],
        number: usize,
        simd: impl Simd,
    ) -> Option<F32x16> {
        // Weight the photons within the kernel by their distance.
        let GatherPoint { point, normal, max_depth } = *look;
        let block = &self.blocks[number];
        let radius_squared = self.radius * self.radius;
        let (reach, share) = (MAX_PLANE_DISTANCE * self.radius, 1.0 / radius_squared);
        let [xs, ys, zs] = &block.point;
        let (mut near, mut weights) = ([0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        let first = (number * PACKET_SIZE) as u32;
        for i in 0..PACKET_SIZE {
            let (dx, dy, dz) = (xs[i] - point.x, ys[i] - point.y, zs[i] - point.z);
            let above = dx * normal.x + dy * normal.y + dz * normal.z;
            let along = dx * dx + dy * dy + dz * dz - above * above;
            let place = first + i as u32;
            let is_near =
                (along < radius_squared) & (above.abs() < reach) & (place >= range[0]) & (place < range[1]);
            near[i] = if is_near { TRUE } else { 0 };
            let left = 1.0 - along * share;
            weights[i] = if left < 1.0 { left } else { 1.0 };
        }
        if simd.movemask(&near) == 0 {
            return None;
        }
        // Reject photons on other surfaces and photons from behind.
        let (own, from) = (
            packed::unpack_unnormalized_lanes(&block.normal),
            packed::unpack_unnormalized_lanes(&block.direction),
        );
        for i in 0..PACKET_SIZE {
            let cosine = own[0][i] * normal.x + own[1][i] * normal.y + own[2][i] * normal.z;
            let squared = own[0][i] * own[0][i] + own[1][i] * own[1][i] + own[2][i] * own[2][i];
            let arriving = from[0][i] * normal.x + from[1][i] * normal.y + from[2][i] * normal.z;
            let faces =
                (cosine > 0.0) & (cosine * cosine > (MIN_COSINE * MIN_COSINE) * squared) & (arriving > 0.0);
            near[i] &= if faces { TRUE } else { 0 };
            // On a tilted surface, there are more photons per unit area of the tangent plane.
            weights[i] *= cosine / squared.sqrt();
        }
        // Reject photons with too many bounces.
        if max_depth < self.max_depth {
            let depths = &self.depths[number];
            for i in 0..PACKET_SIZE {
                near[i] &= if depths[i] <= max_depth { TRUE } else { 0 };
            }
        }
        for i in 0..PACKET_SIZE {
            weights[i] = f32::from_bits(weights[i].to_bits() & near[i]);
        }
        Some(weights)
    }
}

impl PhotonBlock {
    /// Stores a photon in a lane and returns its depth.
    fn set_photon_lane(&mut self, i: usize, photon: &Photon) -> u32 {
        set_lane(&mut self.point, i, photon.point);
        set_lane(&mut self.flux, i, photon.flux);
        self.normal[i] = packed::pack_direction(photon.normal);
        self.direction[i] = packed::pack_direction(photon.direction);
        photon.depth
    }
}

/// Mask of lanes with values above 0.
#[inline(always)]
fn positive_lane_mask(weights: &F32x16, simd: impl Simd) -> u32 {
    let mut above: Mask = [0; PACKET_SIZE];
    for i in 0..PACKET_SIZE {
        above[i] = if weights[i] > 0.0 { TRUE } else { 0 };
    }
    simd.movemask(&above)
}

/// Sum of all lanes, computed by repeatedly adding the two halves.
#[inline(always)]
fn sum_lanes(mut row: F32x16) -> f32 {
    for i in 0..8 {
        row[i] += row[i + 8];
    }
    for i in 0..4 {
        row[i] += row[i + 4];
    }
    (row[0] + row[2]) + (row[1] + row[3])
}

#[cfg(test)]
mod tests;
