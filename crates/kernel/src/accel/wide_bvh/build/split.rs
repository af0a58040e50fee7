//! Split selection with the binned surface area heuristic (Wald, *On fast Construction of SAH-based Bounding
//! Volume Hierarchies*, 2007).

use rayon::prelude::*;

use crate::accel::reference::{SimdBounds, TriangleReference};
use crate::accel::wide_bvh::node::{MAX_PACKS, PACK};
use crate::accel::wide_bvh::simd;
use crate::math::Vec4;

/// Maximum number of bins along an axis.
pub const BINS: usize = 32;

/// Maximum number of bins for segments with up to [`FEW`] references.
const FEW_BINS: usize = 8;

const FEW: usize = 32;

/// Number of references above which a segment is binned in parallel.
const PARALLEL_SIZE: usize = 1 << 16;

/// Cost of a traversal step relative to testing a pack.
const TRAVERSAL_COST: f32 = 1.0;

/// Number of levels split with the surface area heuristic. Deeper segments are split in the middle, which
/// limits the depth for any input.
const SURFACE_AREA_LEVELS: u32 = 56;

/// A range of references and how to split it.
#[derive(Clone, Debug)]
pub struct ReferenceRangeWithSplit {
    pub count: usize,
    pub bounds: SimdBounds,
    /// Number of ancestors of this segment.
    level: u32,
    /// The best split, or `None` if it costs at least as much as a leaf even without the traversal step.
    pub split: Option<Split>,
    /// Whether the segment is worth its own node.
    pub is_node: bool,
}

/// How to split a segment.
#[derive(Clone, Copy, Debug)]
pub enum Split {
    /// At a plane. References below `bin` on `axis` go to the left. `sides` contains the bounding box of each
    /// side.
    Plane { axis: usize, bin: usize, bins: BinMapping, sides: [SimdBounds; 2] },
    /// In the middle of the references in their current order.
    Middle,
}

impl ReferenceRangeWithSplit {
    /// The segment that contains all references.
    pub fn whole(references: &[TriangleReference]) -> Self {
        let chunks = references.par_chunks(PARALLEL_SIZE / 4).map(ReferenceBounds::around_references);
        Self::new(references, chunks.reduce(|| ReferenceBounds::EMPTY, ReferenceBounds::union), 0)
    }

    fn new(references: &[TriangleReference], boxes: ReferenceBounds, level: u32) -> Self {
        let count = references.len();
        let (split, is_node) =
            if count <= PACK { (None, false) } else { choose_split(references, &boxes, level) };
        Self { count, bounds: boxes.bounds, level, split, is_node }
    }
}

/// Bounding boxes of some references and of their centroids.
#[derive(Clone, Copy)]
struct ReferenceBounds {
    bounds: SimdBounds,
    centroids: SimdBounds,
}

impl ReferenceBounds {
    const EMPTY: Self = Self { bounds: SimdBounds::EMPTY, centroids: SimdBounds::EMPTY };

    fn around_references(references: &[TriangleReference]) -> Self {
        let mut own = Self::EMPTY;
        for reference in references {
            own.grow(reference, reference.centroid());
        }
        own
    }

    #[inline(always)]
    fn grow(&mut self, reference: &TriangleReference, centroid: Vec4) {
        self.bounds.grow(&reference.bounds);
        self.centroids.grow(&SimdBounds::new(centroid, centroid));
    }

    fn union(mut self, other: Self) -> Self {
        self.bounds.grow(&other.bounds);
        self.centroids.grow(&other.centroids);
        self
    }
}

/// Chooses the best split of a segment, and decides whether the segment is worth its own node.
fn choose_split(
    references: &[TriangleReference],
    boxes: &ReferenceBounds,
    level: u32,
) -> (Option<Split>, bool) {
    let count = references.len();
    let must = count > PACK * MAX_PACKS as usize;
    let ReferenceBounds { bounds, centroids } = boxes;
    let bins = BinMapping::new(centroids, count);
    let best = if level >= SURFACE_AREA_LEVELS {
        None
    } else if count <= FEW {
        Histogram::<FEW_BINS>::from_references(references, &bins).cheapest_split(&bins)
    } else if count <= PARALLEL_SIZE {
        Histogram::<BINS>::from_references(references, &bins).cheapest_split(&bins)
    } else {
        Histogram::<BINS>::from_references_parallel(references, &bins).cheapest_split(&bins)
    };
    let leaf_cost = triangle_pack_count(count as u32) as f32 * bounds.half_area();
    match best {
        Some(CheapestBinSplit { axis, bin, cost, sides }) if must || cost < leaf_cost => {
            let is_node = must || cost + TRAVERSAL_COST * bounds.half_area() < leaf_cost;
            (Some(Split::Plane { axis, bin, bins, sides }), is_node)
        }
        None if must => (Some(Split::Middle), true),
        _ => (None, false),
    }
}

/// Number of packs for `count` triangles.
#[inline(always)]
fn triangle_pack_count(count: u32) -> u32 {
    count.div_ceil(PACK as u32)
}

/// Maps centroids to bins.
#[derive(Clone, Copy, Debug)]
pub struct BinMapping {
    /// Lower end of the first bin.
    pub start: Vec4,
    /// Bins per unit length; 0 along axes without extent.
    pub per_length: Vec4,
    count: usize,
}

/// Adding this to a number between −½ and 2²² puts the nearest integer into the low bits.
pub const ROUNDING_OFFSET: f32 = 12_582_912.0;

impl BinMapping {
    fn new(centroids: &SimdBounds, references: usize) -> Self {
        let count = BINS.min(4 + references / 8).max(if references > FEW { FEW_BINS } else { 0 });
        let extent = centroids.extent();
        let scale = |length: f32| {
            // Scale down slightly to put the last centroid into the last bin.
            let per_length = count as f32 * 0.999_99 / length;
            if length > 0.0 && per_length.is_finite() { per_length } else { 0.0 }
        };
        let per_length = Vec4::new(scale(extent.x), scale(extent.y), scale(extent.z), 0.0);
        Self { start: centroids.min, per_length, count }
    }

    /// Bin numbers plus [`ROUNDING_OFFSET`].
    #[inline(always)]
    fn bin_numbers_plus_rounding_offset(&self, centroid: Vec4) -> Vec4 {
        (centroid - self.start) * self.per_length - Vec4::splat(0.5) + Vec4::splat(ROUNDING_OFFSET)
    }

    #[inline(always)]
    fn bin_indices(&self, reference: &TriangleReference) -> [usize; 3] {
        let [x, y, z, _] = self.bin_numbers_plus_rounding_offset(reference.centroid()).to_array();
        [x, y, z].map(|place| place.to_bits() as usize & (BINS - 1))
    }
}

/// Bounding box and reference count of each bin, along all three axes.
pub struct Histogram<const N: usize> {
    pub bounds: [[SimdBounds; 3]; N],
    pub counts: [[u32; 3]; N],
}

/// The cheapest split.
struct CheapestBinSplit {
    axis: usize,
    /// First bin on the right.
    bin: usize,
    /// Pack count times surface area, summed over both sides.
    cost: f32,
    sides: [SimdBounds; 2],
}

impl<const N: usize> Histogram<N> {
    const EMPTY: Self = Self { bounds: [[SimdBounds::EMPTY; 3]; N], counts: [[0; 3]; N] };

    fn from_references(references: &[TriangleReference], bins: &BinMapping) -> Self {
        let mut own = Self::EMPTY;
        if !simd::binning::try_add_to_histogram(references, bins, &mut own) {
            own.add_references(references, bins);
        }
        own
    }

    fn add_references(&mut self, references: &[TriangleReference], bins: &BinMapping) {
        for reference in references {
            for (axis, bin) in bins.bin_indices(reference).into_iter().enumerate() {
                self.bounds[bin % N][axis].grow(&reference.bounds);
                self.counts[bin % N][axis] += 1;
            }
        }
    }

    fn from_references_parallel(references: &[TriangleReference], bins: &BinMapping) -> Self {
        let chunks = references
            .par_chunks(PARALLEL_SIZE / 4)
            .map(|references| Self::from_references(references, bins));
        chunks.reduce(|| Self::from_references(&[], bins), |all, one| all.merge(&one))
    }

    fn merge(mut self, other: &Self) -> Self {
        for bin in 0..N {
            for axis in 0..3 {
                self.bounds[bin][axis].grow(&other.bounds[bin][axis]);
                self.counts[bin][axis] += other.counts[bin][axis];
            }
        }
        self
    }

    /// Finds the cheapest plane between bins by sweeping from both ends.
    fn cheapest_split(&self, bins: &BinMapping) -> Option<CheapestBinSplit> {
        let mut best: Option<(usize, usize, f32)> = None;
        let count = bins.count.min(N);
        for axis in (0..3).filter(|&axis| bins.per_length[axis] > 0.0) {
            let mut right_cost = [f32::INFINITY; N];
            let (mut bounds, mut members) = (SimdBounds::EMPTY, 0);
            for bin in (1..count).rev() {
                let own = &self.bounds[bin][axis];
                bounds.grow(own);
                members += self.counts[bin][axis];
                if members > 0 {
                    right_cost[bin] = bounds.half_area() * triangle_pack_count(members) as f32;
                }
            }
            (bounds, members) = (SimdBounds::EMPTY, 0);
            for (bin, right_cost) in right_cost.into_iter().enumerate().take(count).skip(1) {
                let own = &self.bounds[bin - 1][axis];
                bounds.grow(own);
                members += self.counts[bin - 1][axis];
                let cost = bounds.half_area() * triangle_pack_count(members) as f32 + right_cost;
                if members > 0 && cost < best.map_or(f32::INFINITY, |(_, _, least)| least) {
                    best = Some((axis, bin, cost));
                }
            }
        }
        let (axis, bin, cost) = best?;
        let around = |bins: &[[SimdBounds; 3]]| {
            bins.iter().fold(SimdBounds::EMPTY, |mut all, bin| {
                all.grow(&bin[axis]);
                all
            })
        };
        let (left, right) = self.bounds[..count].split_at(bin);
        Some(CheapestBinSplit { axis, bin, cost, sides: [around(left), around(right)] })
    }
}

/// Reorders the references according to the split and returns the two nonempty segments.
pub fn partition(
    references: &mut [TriangleReference],
    segment: &ReferenceRangeWithSplit,
    split: &Split,
) -> (ReferenceRangeWithSplit, ReferenceRangeWithSplit) {
    let (middle, left, right) = match split {
        Split::Plane { axis, bin, bins, sides } => {
            let (middle, [left, right]) = match axis {
                0 => partition_at_bin::<0>(references, *bin, bins),
                1 => partition_at_bin::<1>(references, *bin, bins),
                _ => partition_at_bin::<2>(references, *bin, bins),
            };
            let boxes = |side: usize, centroids| ReferenceBounds { bounds: sides[side], centroids };
            (middle, boxes(0, left), boxes(1, right))
        }
        Split::Middle => {
            let middle = references.len() / 2;
            let (left, right) = references.split_at(middle);
            (middle, ReferenceBounds::around_references(left), ReferenceBounds::around_references(right))
        }
    };
    let level = segment.level + 1;
    let (left_references, right_references) = references.split_at(middle);
    let left = ReferenceRangeWithSplit::new(left_references, left, level);
    (left, ReferenceRangeWithSplit::new(right_references, right, level))
}

fn partition_at_bin<const AXIS: usize>(
    references: &mut [TriangleReference],
    bin: usize,
    bins: &BinMapping,
) -> (usize, [SimdBounds; 2]) {
    match simd::binning::try_partition::<AXIS>(references, bin, bins) {
        Some(done) => done,
        None => partition_at_bin_portable::<AXIS>(references, bin, bins),
    }
}

/// Moves the references below a bin to the front. Returns their number, and the bounding box of the centroids
/// on each side. Branchless, since data-dependent branches would often be mispredicted: every
/// reference is swapped with the first one on the right, and then the length of the left side is incremented
/// by 0 or 1.
#[allow(clippy::manual_swap)] // `swap` goes through memory, so the next iteration stalls, which halves the build speed
fn partition_at_bin_portable<const AXIS: usize>(
    references: &mut [TriangleReference],
    bin: usize,
    bins: &BinMapping,
) -> (usize, [SimdBounds; 2]) {
    let (start, per_length) = (Vec4::splat(bins.start[AXIS]), Vec4::splat(bins.per_length[AXIS]));
    let first_right = Vec4::splat(ROUNDING_OFFSET + bin as f32);
    let (mut left, mut right) = (SimdBounds::EMPTY, SimdBounds::EMPTY);
    let mut middle = 0;
    for i in 0..references.len() {
        let reference = references[i];
        references[i] = references[middle];
        references[middle] = reference;
        let centroid = reference.centroid();
        let place = (Vec4::splat(centroid[AXIS]) - start) * per_length - Vec4::splat(0.5)
            + Vec4::splat(ROUNDING_OFFSET);
        let is_left = place.cmplt(first_right);
        let on = |mask, centroid| Vec4::select(mask, centroid, Vec4::INFINITY);
        left.grow(&SimdBounds { min: on(is_left, centroid), minus_max: on(is_left, -centroid) });
        right.grow(&SimdBounds { min: on(!is_left, centroid), minus_max: on(!is_left, -centroid) });
        middle += usize::from(is_left.test(0));
    }
    (middle, [left, right])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::math::random::signed_number_generator as random;

    fn references(count: u32) -> Vec<TriangleReference> {
        let mut next = random(5);
        let mut point = |size: f32| Vec3::new(next(), next(), next()) * size;
        let corners = |id: u32| {
            let from = if id.is_multiple_of(7) { Vec3::ZERO } else { point(10.0) };
            [from, from + point(0.3), from + point(0.1)]
        };
        (0..count)
            .map(corners)
            .enumerate()
            .map(|(id, corners)| TriangleReference::new(id as u32, corners))
            .collect()
    }

    fn bits(bounds: &SimdBounds) -> [u32; 6] {
        let (min, max) = (bounds.min + Vec4::ZERO, bounds.max_corner() + Vec4::ZERO);
        [min.x, min.y, min.z, max.x, max.y, max.z].map(f32::to_bits)
    }

    type Partition = fn(&mut [TriangleReference], usize, &BinMapping) -> (usize, [SimdBounds; 2]);

    /// SIMD and scalar partition functions for each axis.
    const PARTITIONS: [[Partition; 2]; 3] = [
        [partition_at_bin::<0>, partition_at_bin_portable::<0>],
        [partition_at_bin::<1>, partition_at_bin_portable::<1>],
        [partition_at_bin::<2>, partition_at_bin_portable::<2>],
    ];

    #[test]
    fn simd_histograms_match_scalar_histograms() {
        fn counts<const N: usize>(references: &[TriangleReference], bins: &BinMapping) {
            let mut plain = Histogram::<N>::EMPTY;
            plain.add_references(references, bins);
            let own = Histogram::<N>::from_references(references, bins);
            assert_eq!(own.counts, plain.counts);
            for axis in 0..3 {
                let counted: u32 = own.counts[..bins.count].iter().map(|counts| counts[axis]).sum();
                assert_eq!(counted as usize, references.len(), "the bins should contain all references");
                // Each bin contains exactly the references that map to it.
                for (bin, (bounds, counts)) in own.bounds.iter().zip(&own.counts).enumerate() {
                    let inside = |one: &&TriangleReference| bins.bin_indices(one)[axis] == bin;
                    let inside: Vec<TriangleReference> = references.iter().filter(inside).copied().collect();
                    assert_eq!(counts[axis] as usize, inside.len());
                    assert_eq!(bits(&bounds[axis]), bits(&SimdBounds::around_references(&inside)));
                }
            }
            for (own, plain) in own.bounds.iter().flatten().zip(plain.bounds.iter().flatten()) {
                assert_eq!(bits(own), bits(plain));
            }
        }
        for count in [1, 2, 5, 24, FEW, FEW + 1, 1000] {
            let references = references(count as u32);
            let bins =
                BinMapping::new(&ReferenceBounds::around_references(&references).centroids, references.len());
            if count <= FEW {
                assert!(bins.count <= FEW_BINS, "{} bins", bins.count);
                counts::<FEW_BINS>(&references, &bins);
            }
            counts::<BINS>(&references, &bins);
        }
    }

    #[test]
    fn simd_partitions_match_scalar_partitions() {
        for count in [1, 2, 5, 33, 1000] {
            let references = references(count);
            let bins =
                BinMapping::new(&ReferenceBounds::around_references(&references).centroids, references.len());
            for (axis, [by_vectors, plainly]) in PARTITIONS.into_iter().enumerate() {
                for bin in 1..bins.count {
                    let (mut own, mut plain) = (references.clone(), references.clone());
                    let (middle, sides) = by_vectors(&mut own, bin, &bins);
                    let (plain_middle, plain_sides) = plainly(&mut plain, bin, &bins);
                    assert_eq!(middle, plain_middle);
                    let ids = |references: &[TriangleReference]| {
                        references.iter().map(TriangleReference::id).collect::<Vec<_>>()
                    };
                    assert_eq!(ids(&own), ids(&plain));
                    assert_eq!(sides.each_ref().map(bits), plain_sides.each_ref().map(bits));
                    let is_left = |one: &TriangleReference| bins.bin_indices(one)[axis] < bin;
                    assert!(
                        own[..middle].iter().all(is_left) && !own[middle..].iter().any(is_left),
                        "{axis}"
                    );
                    let around = |side: &[TriangleReference]| {
                        bits(&ReferenceBounds::around_references(side).centroids)
                    };
                    assert_eq!(sides.each_ref().map(bits), [around(&own[..middle]), around(&own[middle..])]);
                }
            }
        }
    }
}
