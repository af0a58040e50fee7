//! Cells of the hashed grid, and the ranges of photons in the cells that a kernel overlaps.

use super::{GatherPoint, PhotonMap};
use crate::math::Vec3;
use crate::math::lanes::PACKET_SIZE;

/// Cell size in radii: larger than the bounding box of any kernel, 2·√(1 + MAX_PLANE_DISTANCE²), so that a
/// kernel overlaps at most two cells along each axis.
pub(super) const CELL: f32 = 2.1;

/// Disjoint ranges of photons that together cover a kernel.
pub(super) struct KernelPhotonRanges {
    pub(super) of: [[u32; 2]; 8],
    pub(super) count: usize,
}

impl KernelPhotonRanges {
    /// Adds a range and merges it with any overlapping ranges, because columns of different cells may have
    /// the same hash.
    #[inline(always)]
    fn merge_range(&mut self, mut range: [u32; 2]) {
        if range[0] == range[1] {
            return;
        }
        let mut i = 0;
        while i < self.count {
            let other = self.of[i];
            if range[0] <= other[1] && other[0] <= range[1] {
                range = [range[0].min(other[0]), range[1].max(other[1])];
                self.count -= 1;
                self.of[i] = self.of[self.count];
                i = 0;
            } else {
                i += 1;
            }
        }
        self.of[self.count] = range;
        self.count += 1;
    }
}

impl PhotonMap {
    /// Ranges that may contain photons within a kernel.
    #[inline(always)]
    pub(super) fn candidate_ranges(&self, look: &GatherPoint) -> KernelPhotonRanges {
        let mut ranges = KernelPhotonRanges { of: [[0; 2]; 8], count: 0 };
        if self.count == 0 {
            return ranges;
        }
        let half = look.unit_kernel_half_extents() * self.radius;
        let first = cell_of(look.point - half, self.cells);
        let last = cell_of(look.point + half, self.cells);
        let more = |axis: usize| u32::from(first[axis] != last[axis]);
        let (columns, rows, run) = (more(1) + 1, more(2) + 1, more(0));
        for row in 0..rows {
            for column in 0..columns {
                let (y, z) = (first[1].wrapping_add(column as i32), first[2].wrapping_add(row as i32));
                let begin = bucket_of_cell(first[0], y, z, self.mask);
                let end = begin + run;
                if end <= self.mask {
                    ranges.merge_range([self.starts[begin as usize], self.starts[end as usize + 1]]);
                } else {
                    ranges.merge_range([self.starts[begin as usize], self.starts[begin as usize + 1]]);
                    ranges.merge_range([self.starts[0], self.starts[1]]);
                }
            }
        }
        ranges
    }
}

/// Blocks that contain a nonempty range of photons.
#[inline(always)]
pub(super) fn blocks_covering_photon_range([start, end]: [u32; 2]) -> std::ops::Range<usize> {
    start as usize / PACKET_SIZE..(end as usize).div_ceil(PACKET_SIZE)
}

/// Cell that contains a point.
#[inline(always)]
pub(super) fn cell_of(point: Vec3, cells: f32) -> [i32; 3] {
    // `f32::floor` would be a function call. Coordinates out of range are clamped to the last cell.
    let below = |x: f32| {
        let whole = x as i32;
        whole.wrapping_sub(i32::from(whole as f32 > x))
    };
    [below(point.x * cells), below(point.y * cells), below(point.z * cells)]
}

/// The bucket that contains a cell. Cells in a column have consecutive buckets.
#[inline(always)]
pub(super) fn bucket_of_cell(x: i32, y: i32, z: i32, mask: u32) -> u32 {
    let hash = (y as u32).wrapping_mul(0x9e37_79b1) ^ (z as u32).wrapping_mul(0x85eb_ca77).rotate_left(16);
    (hash ^ hash >> 15).wrapping_mul(0x2c1b_3c6d).rotate_left(13).wrapping_add(x as u32) & mask
}
