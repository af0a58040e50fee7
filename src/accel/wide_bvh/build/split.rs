//! Where to split: the cheapest plane between bins by surface area (Wald, *On fast Construction of SAH-based Bounding
//! Volume Hierarchies*, 2007).

use rayon::prelude::*;

use super::{Bounds, Reference};
use crate::accel::wide_bvh::node::{MOST_PACKS, PACK};
use crate::math::Vec4;

/// Most bins along an axis.
const BINS: usize = 32;

/// Segments with more references are binned in parallel.
const PARALLEL_SIZE: usize = 1 << 16;

/// What one step of traversal costs, in tests of a pack.
const TRAVERSAL_COST: f32 = 0.5;

/// Levels of halving below which a segment is split in the middle of its references, so that no input makes a deep tree.
const SURFACE_AREA_LEVELS: u32 = 56;

/// Some references that stand together, and how they are to be split.
#[derive(Clone, Debug)]
pub struct Segment {
    pub count: usize,
    pub bounds: Bounds,
    /// Halvings above.
    level: u32,
    /// None where a leaf is as cheap, even if the boxes of its parts had a place in the node that it is in.
    pub split: Option<Split>,
    /// Whether it is worth a node of its own.
    pub is_node: bool,
}

/// How to split.
#[derive(Clone, Copy, Debug)]
pub enum Split {
    /// Those below a bin of an axis to the left.
    Plane { axis: usize, bin: usize, bins: Bins },
    /// Half of them, as they stand.
    Middle,
}

impl Segment {
    /// All of the references.
    pub fn whole(references: &[Reference]) -> Self {
        let chunk = |references: &[Reference]| {
            let (mut bounds, mut centroids) = (Bounds::EMPTY, Bounds::EMPTY);
            for reference in references {
                bounds.grow(reference.min, reference.max);
                centroids.grow(reference.centroid(), reference.centroid());
            }
            (bounds, centroids)
        };
        let (bounds, centroids) = references.par_chunks(PARALLEL_SIZE / 4).map(chunk).reduce(
            || (Bounds::EMPTY, Bounds::EMPTY),
            |mut a, b| {
                a.0.grow(b.0.min, b.0.max);
                a.1.grow(b.1.min, b.1.max);
                a
            },
        );
        Self::new(references, bounds, centroids, 0)
    }

    fn new(references: &[Reference], bounds: Bounds, centroids: Bounds, level: u32) -> Self {
        let count = references.len();
        let (split, is_node) =
            if count <= PACK { (None, false) } else { choose(references, &bounds, &centroids, level) };
        Self { count, bounds, level, split, is_node }
    }
}

/// How a segment is split best, and whether that is worth a node.
fn choose(
    references: &[Reference],
    bounds: &Bounds,
    centroids: &Bounds,
    level: u32,
) -> (Option<Split>, bool) {
    let count = references.len();
    let must = count > PACK * MOST_PACKS as usize;
    let bins = Bins::new(centroids, count);
    let best = if level < SURFACE_AREA_LEVELS { cheapest(references, &bins) } else { None };
    let leaf_cost = blocks(count as u32) as f32 * bounds.half_area();
    match best {
        Some((axis, bin, cost)) if must || cost < leaf_cost => {
            let is_node = must || cost + TRAVERSAL_COST * bounds.half_area() < leaf_cost;
            (Some(Split::Plane { axis, bin, bins }), is_node)
        }
        None if must => (Some(Split::Middle), true),
        _ => (None, false),
    }
}

/// Packs that so many triangles take.
#[inline(always)]
fn blocks(count: u32) -> u32 {
    count.div_ceil(PACK as u32)
}

/// Which bin a centroid is in.
#[derive(Clone, Copy, Debug)]
pub struct Bins {
    start: Vec4,
    per_length: Vec4,
    count: usize,
}

/// Added to a number from −½ to 2²², it leaves the nearest integer in the low bits.
const ROUND: f32 = 12_582_912.0;

impl Bins {
    fn new(centroids: &Bounds, references: usize) -> Self {
        let count = BINS.min(4 + references / 8);
        let extent = centroids.max - centroids.min;
        let scale = |length: f32| {
            let per_length = count as f32 * 0.999_99 / length;
            if length > 0.0 && per_length.is_finite() { per_length } else { 0.0 }
        };
        let per_length = Vec4::new(scale(extent.x), scale(extent.y), scale(extent.z), 0.0);
        Self { start: centroids.min, per_length, count }
    }

    #[inline(always)]
    fn of(&self, reference: &Reference) -> [usize; 3] {
        let place =
            (reference.centroid() - self.start) * self.per_length - Vec4::splat(0.5) + Vec4::splat(ROUND);
        let [x, y, z, _] = place.to_array();
        [x, y, z].map(|place| (place.to_bits() as usize & (BINS - 1)).min(self.count - 1))
    }
}

/// Boxes and counts of the bins of three axes.
#[derive(Clone)]
struct Histogram {
    bounds: [[Bounds; 3]; BINS],
    counts: [[u32; 3]; BINS],
}

impl Histogram {
    fn of(references: &[Reference], bins: &Bins) -> Self {
        let mut own = Self { bounds: [[Bounds::EMPTY; 3]; BINS], counts: [[0; 3]; BINS] };
        for reference in references {
            let [x, y, z] = bins.of(reference);
            for (axis, bin) in [x, y, z].into_iter().enumerate() {
                own.bounds[bin][axis].grow(reference.min, reference.max);
                own.counts[bin][axis] += 1;
            }
        }
        own
    }

    fn add(mut self, other: &Self) -> Self {
        for bin in 0..BINS {
            for axis in 0..3 {
                self.bounds[bin][axis].grow(other.bounds[bin][axis].min, other.bounds[bin][axis].max);
                self.counts[bin][axis] += other.counts[bin][axis];
            }
        }
        self
    }
}

/// Axis, first bin on the right, and area-weighted packs of both sides.
fn cheapest(references: &[Reference], bins: &Bins) -> Option<(usize, usize, f32)> {
    let histogram = if references.len() > PARALLEL_SIZE {
        let histograms: Vec<_> = references
            .par_chunks(references.len().div_ceil(8))
            .map(|references| Histogram::of(references, bins))
            .collect();
        histograms.into_iter().reduce(|all, one| all.add(&one))?
    } else {
        Histogram::of(references, bins)
    };
    let mut best: Option<(usize, usize, f32)> = None;
    for axis in 0..3 {
        if bins.per_length[axis] == 0.0 {
            continue;
        }
        let mut right_cost = [0.0_f32; BINS];
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for bin in (1..bins.count).rev() {
            let own = &histogram.bounds[bin][axis];
            bounds.grow(own.min, own.max);
            count += histogram.counts[bin][axis];
            right_cost[bin] =
                if count == 0 { f32::INFINITY } else { bounds.half_area() * blocks(count) as f32 };
        }
        (bounds, count) = (Bounds::EMPTY, 0);
        for bin in 1..bins.count {
            let own = &histogram.bounds[bin - 1][axis];
            bounds.grow(own.min, own.max);
            count += histogram.counts[bin - 1][axis];
            if count == 0 {
                continue;
            }
            let cost = bounds.half_area() * blocks(count) as f32 + right_cost[bin];
            if cost.is_finite() && best.is_none_or(|(_, _, least)| cost < least) {
                best = Some((axis, bin, cost));
            }
        }
    }
    best
}

/// Reorder the references by the split; the two segments, neither of them empty.
pub fn partition(references: &mut [Reference], segment: &Segment, split: &Split) -> (Segment, Segment) {
    let mut sides = [(Bounds::EMPTY, Bounds::EMPTY); 2];
    let mut note = |side: usize, reference: &Reference| {
        let (bounds, centroids) = &mut sides[side];
        bounds.grow(reference.min, reference.max);
        centroids.grow(reference.centroid(), reference.centroid());
    };
    let middle = match *split {
        Split::Plane { axis, bin, bins } => {
            let (mut start, mut end) = (0, references.len());
            while start < end {
                if bins.of(&references[start])[axis] < bin {
                    note(0, &references[start]);
                    start += 1;
                } else {
                    note(1, &references[start]);
                    end -= 1;
                    references.swap(start, end);
                }
            }
            start
        }
        Split::Middle => {
            let middle = references.len() / 2;
            for (place, reference) in references.iter().enumerate() {
                note(usize::from(place >= middle), reference);
            }
            middle
        }
    };
    let (left, right) = references.split_at(middle);
    let level = segment.level + 1;
    let [(left_bounds, left_centroids), (right_bounds, right_centroids)] = sides;
    let left = Segment::new(left, left_bounds, left_centroids, level);
    (left, Segment::new(right, right_bounds, right_centroids, level))
}
