//! BVH construction with the binned surface area heuristic (Wald, *On fast Construction of SAH-based Bounding
//! Volume Hierarchies*, 2007). Both halves of a large node are built in parallel. The tree does not depend on
//! the number of threads.

use super::top_node::WideTopNode;
use super::{BinaryNode, Bvh, ChildRef, LEAF_SIZE, SURFACE_AREA_LEVELS};
use crate::control::{CancelToken, Canceled};
use crate::geometry::Aabb;
use crate::math::Vec3;

const BINS: usize = 16;

/// Primitive count above which a node's halves are built in parallel and the cancellation token is polled.
const PARALLEL_SIZE: usize = 4096;

/// Cost of a traversal step relative to a primitive test.
const TRAVERSAL_COST: f32 = 1.0;

/// Minimum number of primitives for which shells and splits by size are worthwhile.
const NESTED_SIZE: usize = 64;

/// Boxes are tested for nesting only if the best split costs at least this fraction of the cost without a
/// split.
const NESTED_COST: f32 = 0.9;

/// Nested boxes are split by size if that costs less than this fraction of the best plane's cost.
const SIZE_SPLIT_COST: f32 = 0.9;

/// A box and its id during construction.
#[derive(Clone, Copy)]
pub(super) struct PrimitiveReference {
    pub(super) bounds: Aabb,
    id: u32,
}

impl PrimitiveReference {
    /// Twice the center of the box.
    fn doubled_center(&self) -> Vec3 {
        self.bounds.min + self.bounds.max
    }
}

/// A finished subtree.
struct SubtreeSummary {
    root: ChildRef,
    bounds: Aabb,
    /// Number of node levels.
    depth: usize,
    /// Whether any large node was split by the size of its boxes, because large boxes contain small ones.
    is_nested: bool,
}

impl Bvh {
    /// Builds a tree over boxes. Skips empty boxes and boxes with NaN coordinates.
    ///
    /// # Errors
    /// [`Canceled`] if the build was canceled.
    pub fn build(boxes: &[Aabb], token: &CancelToken) -> Result<Self, Canceled> {
        let mut references: Vec<PrimitiveReference> = boxes
            .iter()
            .enumerate()
            .filter(|(_, bounds)| !bounds.is_empty() && bounds.extent().is_finite())
            .map(|(id, &bounds)| PrimitiveReference { bounds, id: id as u32 })
            .collect();
        if references.is_empty() {
            let (nodes, order) = (Vec::new(), Vec::new());
            return Ok(Self {
                nodes,
                order,
                bounds: Aabb::EMPTY,
                depth: 0,
                top: WideTopNode::EMPTY,
                is_nested: false,
                shells: None,
            });
        }
        // A tree over n boxes has fewer than n nodes. Every subtree writes to its own slice.
        let mut nodes = vec![BinaryNode::EMPTY; (references.len() - 1).max(1)];
        let tree = build_subtree(
            &mut references,
            &mut nodes,
            OutputPosition { place: 0, node: 0, depth: 0 },
            token,
        )?;
        if tree.root.count > 0 {
            // Finite rays never visit the empty side. Non-finite rays may, but their traversal ends there.
            nodes[0] = BinaryNode { bounds: [tree.bounds, Aabb::EMPTY], child: [tree.root; 2] };
        }
        let order = references.iter().map(|reference| reference.id).collect();
        let top = WideTopNode::new((tree.bounds, tree.root), &nodes, &references);
        let SubtreeSummary { bounds, depth, is_nested, .. } = tree;
        Ok(Self { nodes, order, bounds, depth: depth.max(1), top, is_nested, shells: None })
    }
}

/// Output position of a subtree.
#[derive(Clone, Copy)]
struct OutputPosition {
    /// Index of the subtree's first reference in leaf order.
    place: usize,
    /// Index of the subtree's first node.
    node: usize,
    /// Number of ancestors of the subtree's root.
    depth: usize,
}

/// Builds a subtree over `references`. The subtree has fewer nodes than references.
fn build_subtree(
    references: &mut [PrimitiveReference],
    nodes: &mut [BinaryNode],
    start: OutputPosition,
    token: &CancelToken,
) -> Result<SubtreeSummary, Canceled> {
    let bounds = references.iter().fold(Aabb::EMPTY, |all, reference| all.union(reference.bounds));
    let Some((middle, by_size)) = partition_unless_leaf_is_cheaper(references, bounds, &start) else {
        let leaf = ChildRef { first: start.place as u32, count: references.len() as u32 };
        return Ok(SubtreeSummary { root: leaf, bounds, depth: 0, is_nested: false });
    };
    let parallel = references.len() > PARALLEL_SIZE;
    let is_nested = by_size && references.len() >= NESTED_SIZE;
    let (left, right) = references.split_at_mut(middle);
    let Some((node, rest)) = nodes.split_first_mut() else {
        return Ok(SubtreeSummary { root: ChildRef::NONE, bounds, depth: 0, is_nested: false });
    };
    let (left_nodes, right_nodes) = rest.split_at_mut(left.len() - 1);
    let depth = start.depth + 1;
    let left_start = OutputPosition { place: start.place, node: start.node + 1, depth };
    let right_start =
        OutputPosition { place: start.place + middle, node: start.node + 1 + left_nodes.len(), depth };
    let (left, right) = if parallel {
        token.check_pause_and_cancel()?;
        rayon::join(
            || build_subtree(left, left_nodes, left_start, token),
            || build_subtree(right, right_nodes, right_start, token),
        )
    } else {
        let left = build_subtree(left, left_nodes, left_start, token);
        (left, build_subtree(right, right_nodes, right_start, token))
    };
    let (left, right) = (left?, right?);
    *node = BinaryNode { bounds: [left.bounds, right.bounds], child: [left.root, right.root] };
    let root = ChildRef { first: start.node as u32, count: 0 };
    let is_nested = is_nested || left.is_nested || right.is_nested;
    Ok(SubtreeSummary { root, bounds, depth: 1 + left.depth.max(right.depth), is_nested })
}

/// Partitions the references into two halves. Returns the size of the first half and whether the split was by
/// size, or `None` if a leaf is cheaper.
fn partition_unless_leaf_is_cheaper(
    references: &mut [PrimitiveReference],
    bounds: Aabb,
    start: &OutputPosition,
) -> Option<(usize, bool)> {
    let count = references.len();
    if count == 1 {
        return None;
    }
    let centroids = Aabb::from_points(references.iter().map(PrimitiveReference::doubled_center));
    let split = (start.depth < SURFACE_AREA_LEVELS).then(|| best_split(references, centroids)).flatten();
    let is_above_median = start.depth < SURFACE_AREA_LEVELS;
    match split {
        None if count > LEAF_SIZE && is_above_median && centroids.extent() == Vec3::ZERO => {
            Some((partition_by_size(references), true))
        }
        Some(split) if count >= NESTED_SIZE && is_box_size_split_cheaper(references, bounds, &split) => {
            Some((partition_by_size(references), true))
        }
        Some(split)
            if count > LEAF_SIZE || split.cost / bounds.half_area() + TRAVERSAL_COST < count as f32 =>
        {
            let middle = partition_by(references, |reference| split.is_left(reference));
            let middle = if middle > 0 && middle < count { middle } else { count / 2 };
            Some((middle, false))
        }
        None if count > LEAF_SIZE => {
            let axis = longest_axis(centroids.extent());
            references.select_nth_unstable_by(count / 2, |a, b| {
                a.doubled_center()[axis].total_cmp(&b.doubled_center()[axis]).then(a.id.cmp(&b.id))
            });
            Some((count / 2, false))
        }
        _ => None,
    }
}

/// Moves the half with the smaller boxes to the front and returns its length.
fn partition_by_size(references: &mut [PrimitiveReference]) -> usize {
    let middle = references.len() / 2;
    references.select_nth_unstable_by(middle, |a, b| {
        a.bounds.half_area().total_cmp(&b.bounds.half_area()).then(a.id.cmp(&b.id))
    });
    middle
}

/// Whether splitting by size is much cheaper than splitting at the best plane. If boxes are nested, every
/// plane leaves nearly full-size boxes on both sides.
fn is_box_size_split_cheaper(references: &mut [PrimitiveReference], bounds: Aabb, split: &Split) -> bool {
    let count = references.len() as f32;
    if split.cost < NESTED_COST * bounds.half_area() * count {
        return false;
    }
    let middle = partition_by_size(references);
    let small = references[..middle].iter().fold(Aabb::EMPTY, |all, reference| all.union(reference.bounds));
    let cost = small.half_area() * middle as f32 + bounds.half_area() * (count - middle as f32);
    cost < SIZE_SPLIT_COST * split.cost
}

/// A plane between two bins on an axis.
struct Split {
    axis: usize,
    start: f32,
    bins_per_length: f32,
    /// The first bin on the right side of the plane.
    bin: usize,
    /// Primitive count times surface area, summed over both sides.
    cost: f32,
}

impl Split {
    fn is_left(&self, reference: &PrimitiveReference) -> bool {
        bin_index(reference.doubled_center()[self.axis], self.start, self.bins_per_length) < self.bin
    }
}

fn bin_index(centroid: f32, start: f32, bins_per_length: f32) -> usize {
    (((centroid - start) * bins_per_length) as usize).min(BINS - 1)
}

/// Finds the cheapest plane between bins, or returns `None` if all centroids coincide.
fn best_split(references: &[PrimitiveReference], centroids: Aabb) -> Option<Split> {
    let extent = centroids.extent();
    let bins_per_length = extent.map(|length| BINS as f32 / length);
    let mut bounds = [[Aabb::EMPTY; BINS]; 3];
    let mut counts = [[0_u32; BINS]; 3];
    for reference in references {
        let centroid = reference.doubled_center();
        for axis in 0..3 {
            let bin = bin_index(centroid[axis], centroids.min[axis], bins_per_length[axis]);
            bounds[axis][bin] = bounds[axis][bin].union(reference.bounds);
            counts[axis][bin] += 1;
        }
    }
    (0..3)
        .filter(|&axis| extent[axis] > 0.0 && bins_per_length[axis].is_finite())
        .filter_map(|axis| {
            let (bin, cost) = cheapest_plane(&bounds[axis], &counts[axis])?;
            Some(Split {
                axis,
                start: centroids.min[axis],
                bins_per_length: bins_per_length[axis],
                bin,
                cost,
            })
        })
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// Finds the cheapest plane by sweeping over the bins on an axis from both ends.
fn cheapest_plane(bounds: &[Aabb; BINS], counts: &[u32; BINS]) -> Option<(usize, f32)> {
    let mut right_cost = [0.0_f32; BINS];
    let (mut box_so_far, mut count) = (Aabb::EMPTY, 0);
    for bin in (1..BINS).rev() {
        box_so_far = box_so_far.union(bounds[bin]);
        count += counts[bin];
        right_cost[bin] = if count == 0 { f32::INFINITY } else { box_so_far.half_area() * count as f32 };
    }
    (box_so_far, count) = (Aabb::EMPTY, 0);
    let mut best: Option<(usize, f32)> = None;
    for bin in 1..BINS {
        box_so_far = box_so_far.union(bounds[bin - 1]);
        count += counts[bin - 1];
        let cost = box_so_far.half_area() * count as f32 + right_cost[bin];
        if count > 0 && cost.is_finite() && best.is_none_or(|(_, least)| cost < least) {
            best = Some((bin, cost));
        }
    }
    best
}

/// Moves the references that satisfy `is_left` to the front and returns how many there are.
fn partition_by(
    references: &mut [PrimitiveReference],
    is_left: impl Fn(&PrimitiveReference) -> bool,
) -> usize {
    let (mut start, mut end) = (0, references.len());
    while start < end {
        if is_left(&references[start]) {
            start += 1;
        } else {
            end -= 1;
            references.swap(start, end);
        }
    }
    start
}

fn longest_axis(extent: Vec3) -> usize {
    if extent.x >= extent.y && extent.x >= extent.z {
        0
    } else if extent.y >= extent.z {
        1
    } else {
        2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn built(boxes: &[Aabb]) -> Bvh {
        let tree = Bvh::build(boxes, &CancelToken::new()).expect("never canceled");
        tree.validate(boxes).expect("a valid tree");
        tree
    }

    fn unit_box(at: Vec3) -> Aabb {
        Aabb { min: at, max: at + Vec3::ONE }
    }

    #[test]
    fn trees_over_degenerate_boxes_are_valid() {
        built(&[]);
        built(&[unit_box(Vec3::ZERO)]);
        built(&vec![unit_box(Vec3::ONE); 1000]);
        built(&[Aabb::EMPTY, unit_box(Vec3::ZERO), Aabb { min: Vec3::NAN, max: Vec3::ONE }]);
        let grid: Vec<_> =
            (0..20_000).map(|i| unit_box(Vec3::new((i % 40) as f32, (i / 40) as f32, 0.0))).collect();
        built(&grid);
        // The distance doubles at every other box, so the surface area heuristic splits off only a few boxes
        // at a time.
        let geometric: Vec<_> = (0..250).map(|i| unit_box(Vec3::X * 2.0_f32.powi(i / 2))).collect();
        built(&geometric);
    }

    #[test]
    fn tree_does_not_depend_on_thread_count() {
        let boxes: Vec<_> = (0..30_000_u32)
            .map(|i| {
                unit_box(Vec3::new(
                    (i.wrapping_mul(2_654_435_761) >> 20) as f32,
                    (i % 97) as f32,
                    (i % 31) as f32,
                ))
            })
            .collect();
        let order = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| built(&boxes).order)
        };
        assert_eq!(order(1), order(7));
    }
}
