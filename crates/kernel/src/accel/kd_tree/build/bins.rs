//! Splits large cells. Candidate planes are evenly spaced on all three axes, and each box is counted in the
//! bins where it starts and ends (Shevtsov, Soupikov, Kapustin, *Highly Parallel Fast KD-tree Construction
//! for Interactive Ray Tracing of Dynamic Scenes*, 2007). The faces of the references' bounding box are also
//! candidates, because the space beyond them is empty.

use std::array;

use rayon::prelude::*;

use super::cost::{PlaneSearch, PlanesWithTriangleCounts, SplitPlane};
use crate::accel::reference::{SimdBounds, TriangleReference};
use crate::math::Vec4;

/// Number of bins along an axis.
const BINS: usize = 31;

/// Number of planes: one between each pair of adjacent bins, one before the first, and one after the last.
const PLANES: usize = BINS + 1;

/// Number of references above which counting is parallelized.
const PARALLEL_SIZE: usize = 1 << 16;

/// For each axis and bin, the number of boxes that start and end in it.
struct Histogram {
    starts: [[u32; PLANES]; 3],
    ends: [[u32; PLANES]; 3],
}

/// Adding this to a number between −½ and 2²² puts the nearest integer into the low bits of the sum.
const ROUNDING_OFFSET: f32 = 12_582_912.0;

impl Histogram {
    fn from_references(references: &[TriangleReference], start: Vec4, per_length: Vec4) -> Self {
        let mut own = Self { starts: [[0; PLANES]; 3], ends: [[0; PLANES]; 3] };
        // Subtract ½ to turn rounding to nearest into rounding down.
        let bins = |at: Vec4| {
            let place = (at - start) * per_length - Vec4::splat(0.5);
            place.clamp(Vec4::ZERO, Vec4::splat((BINS - 1) as f32)) + Vec4::splat(ROUNDING_OFFSET)
        };
        for reference in references {
            let low = bins(reference.bounds.min).to_array().map(f32::to_bits);
            let high = bins(reference.bounds.max_corner()).to_array().map(f32::to_bits);
            for axis in 0..3 {
                own.starts[axis][low[axis] as usize % PLANES] += 1;
                own.ends[axis][high[axis] as usize % PLANES] += 1;
            }
        }
        own
    }

    fn merge(mut self, other: &Self) -> Self {
        let own = self.starts.iter_mut().chain(&mut self.ends).flatten();
        for (own, other) in own.zip(other.starts.iter().chain(&other.ends).flatten()) {
            *own += other;
        }
        self
    }
}

/// Finds the cheapest plane. Returns `None` if a leaf is no more expensive.
pub fn cheapest_plane(references: &[TriangleReference], cell: &SimdBounds) -> Option<SplitPlane> {
    let around = SimdBounds::around_references(references);
    let extent = around.extent();
    let scale = |length: f32| {
        let per_length = BINS as f32 / length;
        if length > 0.0 && per_length.is_finite() { per_length } else { 0.0 }
    };
    let per_length = Vec4::new(scale(extent.x), scale(extent.y), scale(extent.z), 0.0);
    let histogram = if references.len() > PARALLEL_SIZE {
        let chunks = references.par_chunks(references.len().div_ceil(8));
        let parts: Vec<_> =
            chunks.map(|chunk| Histogram::from_references(chunk, around.min, per_length)).collect();
        parts.into_iter().reduce(|all, one| all.merge(&one))?
    } else {
        Histogram::from_references(references, around.min, per_length)
    };
    let mut search = PlaneSearch::<{ PLANES / 4 }>::new(cell, references.len());
    for axis in 0..3 {
        let (min, max) = (around.min.to_array()[axis], around.max_corner().to_array()[axis]);
        let (mut at, mut left, mut right) = ([min; PLANES], [0; PLANES], [references.len() as u32; PLANES]);
        for bin in 1..if per_length[axis] > 0.0 { BINS } else { 1 } {
            at[bin] = min + (max - min) * (bin as f32 / BINS as f32);
            left[bin] = left[bin - 1] + histogram.starts[axis][bin - 1];
            right[bin] = right[bin - 1] - histogram.ends[axis][bin - 1];
        }
        (at[BINS], left[BINS], right[BINS]) = (max, references.len() as u32, 0);
        let four = |from: [f32; PLANES]| array::from_fn(|i| Vec4::from_slice(&from[4 * i..]));
        let counts = |counts: [u32; PLANES]| four(counts.map(|count| count as f32));
        search.add_planes(
            axis,
            false,
            &PlanesWithTriangleCounts { at: four(at), left: counts(left), right: counts(right) },
        );
    }
    // At a face of the bounding box, put references that lie in the plane on the nonempty side.
    search.cheapest().map(|plane| SplitPlane { planar_right: plane.at <= around.min[plane.axis], ..plane })
}
