//! Large cells: planes at equal distances on all three axes, each box counted where it starts and where it ends
//! (Shevtsov, Soupikov, Kapustin, *Highly Parallel Fast KD-tree Construction for Interactive Ray Tracing of Dynamic
//! Scenes*, 2007), and the two faces of the box around all, beyond which space is empty.

use rayon::prelude::*;

use super::cost::{Plane, Search};
use crate::accel::reference::{Bounds, Reference};
use crate::math::Vec4;

/// Bins along an axis.
const BINS: usize = 32;

/// More references are counted in parallel.
const PARALLEL_SIZE: usize = 1 << 16;

/// How many boxes start and end in each bin of each axis.
struct Histogram {
    starts: [[u32; BINS]; 3],
    ends: [[u32; BINS]; 3],
}

impl Histogram {
    fn of(references: &[Reference], start: Vec4, per_length: Vec4) -> Self {
        let mut own = Self { starts: [[0; BINS]; 3], ends: [[0; BINS]; 3] };
        let bin = |place: f32| (place as i32).clamp(0, BINS as i32 - 1) as usize;
        for reference in references {
            let low = (reference.bounds.min - start) * per_length;
            let high = (reference.bounds.max() - start) * per_length;
            for axis in 0..3 {
                own.starts[axis][bin(low[axis])] += 1;
                own.ends[axis][bin(high[axis])] += 1;
            }
        }
        own
    }

    fn add(mut self, other: &Self) -> Self {
        let own = self.starts.iter_mut().chain(&mut self.ends).flatten();
        for (own, other) in own.zip(other.starts.iter().chain(&other.ends).flatten()) {
            *own += other;
        }
        self
    }
}

/// The cheapest plane; none where a leaf is as cheap. `around` is the box around the references.
pub fn cheapest(references: &[Reference], cell: &Bounds, around: &Bounds) -> Option<Plane> {
    let extent = around.max() - around.min;
    let scale = |length: f32| {
        let per_length = BINS as f32 / length;
        if length > 0.0 && per_length.is_finite() { per_length } else { 0.0 }
    };
    let per_length = Vec4::new(scale(extent.x), scale(extent.y), scale(extent.z), 0.0);
    let histogram = if references.len() > PARALLEL_SIZE {
        let chunks = references.par_chunks(references.len().div_ceil(8));
        let parts: Vec<_> = chunks.map(|chunk| Histogram::of(chunk, around.min, per_length)).collect();
        parts.into_iter().reduce(|all, one| all.add(&one))?
    } else {
        Histogram::of(references, around.min, per_length)
    };
    let mut search = Search::new(cell, references.len());
    let count = references.len();
    for axis in 0..3 {
        search.along(axis, |across| {
            across.offer(around.min[axis], 0, count, 0);
            across.offer(around.max()[axis], count, 0, 0);
            let (mut left, mut right) = (0, count);
            for bin in 1..if per_length[axis] > 0.0 { BINS } else { 1 } {
                left += histogram.starts[axis][bin - 1] as usize;
                right -= histogram.ends[axis][bin - 1] as usize;
                across.offer(around.min[axis] + extent[axis] * (bin as f32 / BINS as f32), left, right, 0);
            }
        });
    }
    // What lies in the plane must not go where space is to be empty.
    search.cheapest().map(|plane| Plane { planar_right: plane.at <= around.min[plane.axis], ..plane })
}
