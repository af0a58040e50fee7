//! Top-down construction of a kd-tree. Splits each cell at the plane with the lowest expected cost until a
//! leaf costs no more. Large cells use bins; small cells use perfect splits. A triangle that straddles a
//! plane is added to both sides, each time with the bounding box of its clipped part.
//!
//! The tree does not depend on the number of threads.

mod bins;
mod cost;
mod join;
mod partition;
mod subtree;
mod sweep;

use rayon::prelude::*;

use super::node::{self, LeafTriangle, PackedKdNode};
use crate::control::{CancelToken, Canceled};
use crate::geometry::Aabb;
use crate::geometry::mesh::TriangleMesh;
use crate::math::Vec3;
use crate::math::elementary::log2;

use crate::accel::reference::{SimdBounds, TriangleReference};
use cost::SplitPlane;
use join::TreePart;
use partition::PartitionBuffers;
use subtree::KdSubtree;

/// Maximum number of references in a cell built by a single thread. The cancellation token is polled between
/// such cells.
const TASK_SIZE: usize = 4096;

/// Maximum total number of leaves and references. A tree has fewer than two nodes per leaf, and node indices
/// must fit into a [`PackedKdNode`].
const MAX_ROOM: u64 = node::MAX_PAYLOAD as u64 / 2;

/// All triangles must fit into a single leaf.
const _: () = assert!((TriangleMesh::MAX_TRIANGLES as u64) < MAX_ROOM);

/// Maximum total number of leaves and references per triangle. Typical meshes need only a fraction of this.
/// Many triangles around a single vertex could produce far more references.
const MAX_PER_TRIANGLE: u64 = 24;

/// Number added to the triangle count, so that small meshes have enough room.
const FEW: u64 = 64;

/// Marks a triangle without an assigned position.
const UNASSIGNED: u32 = u32::MAX;

/// A finished kd-tree.
pub struct BuiltKdTree {
    pub nodes: Vec<PackedKdNode>,
    /// Indices into `triangles`, leaf by leaf.
    pub references: Vec<u32>,
    pub triangles: Vec<LeafTriangle>,
    pub bounds: Aabb,
}

/// Maximum number of planes above any leaf in a tree over `count` triangles (Havran's 8 + 1.3·log₂ n).
pub fn depth_limit(count: usize) -> u32 {
    8 + (1.3 * log2(count.max(1) as f32)) as u32
}

/// Builds a tree over `count` triangles. Triangles without a finite bounding box are skipped.
///
/// # Errors
/// [`Canceled`] if the build was canceled.
pub fn build(
    count: u32,
    corners: impl Fn(u32) -> [Vec3; 3] + Sync,
    token: &CancelToken,
) -> Result<BuiltKdTree, Canceled> {
    let room = MAX_ROOM.min(MAX_PER_TRIANGLE * (u64::from(count) + FEW));
    build_with_budget(room, count, corners, token)
}

/// [`build`] with at most `room` leaves and references in total.
fn build_with_budget(
    room: u64,
    count: u32,
    corners: impl Fn(u32) -> [Vec3; 3] + Sync,
    token: &CancelToken,
) -> Result<BuiltKdTree, Canceled> {
    let references = TriangleReference::collect_finite(count, &corners, token)?;
    if references.is_empty() {
        let (nodes, references, triangles) = Default::default();
        return Ok(BuiltKdTree { nodes, references, triangles, bounds: Aabb::EMPTY });
    }
    let bounds = SimdBounds::around_references(&references);
    let levels = depth_limit(references.len());
    let part = build_part(&Cell { bounds, levels, room }, references, &corners, token)?;
    let all = part.flatten();
    token.check_pause_and_cancel()?;
    let (references, order) = order_by_first_use(all.ids, count);
    let triangles = order.into_par_iter().map(|id| LeafTriangle { corners: corners(id), id }).collect();
    Ok(BuiltKdTree { nodes: all.nodes, references, triangles, bounds: bounds.aabb() })
}

/// Sorts the triangles by their first use in a leaf and rewrites `ids` as indices into that order.
fn order_by_first_use(mut ids: Vec<u32>, count: u32) -> (Vec<u32>, Vec<u32>) {
    let mut places = vec![UNASSIGNED; count as usize];
    let mut order = Vec::with_capacity(count as usize);
    for id in &mut ids {
        let place = &mut places[*id as usize];
        if *place == UNASSIGNED {
            *place = order.len() as u32;
            order.push(*id);
        }
        *id = *place;
    }
    (ids, order)
}

/// A region of space that a subtree covers.
#[derive(Clone, Copy)]
struct Cell {
    bounds: SimdBounds,
    /// Maximum number of levels in the cell's subtree.
    levels: u32,
    /// Maximum total number of leaves and references in the cell.
    room: u64,
}

impl Cell {
    /// Chooses the splitting plane. Returns `None` if the cell should become a leaf.
    fn choose_split(&self, references: &[TriangleReference]) -> Option<SplitPlane> {
        // In the worst case, every triangle straddles the plane.
        let has_room = 2 * room_needed_by_leaf(references.len()) <= self.room;
        if self.levels == 0 || references.is_empty() || !has_room {
            None
        } else if references.len() <= sweep::MAX_SWEPT_REFERENCES {
            sweep::cheapest_plane(references, &self.bounds)
        } else {
            bins::cheapest_plane(references, &self.bounds)
        }
    }

    /// The two halves of the cell, given the number of references in each.
    fn halves(&self, plane: &SplitPlane, counts: [usize; 2]) -> [Self; 2] {
        let [left, right] = counts.map(room_needed_by_leaf);
        // Divide the room proportionally. If it is enough for the two halves together, it is enough for each
        // of them.
        let room = self.room * left / (left + right);
        let levels = self.levels - 1;
        let [below, above] = self.bounds.split_at_plane(plane.axis, plane.at);
        [Self { bounds: below, levels, room }, Self { bounds: above, levels, room: self.room - room }]
    }
}

/// Room needed by a leaf with `count` references.
fn room_needed_by_leaf(count: usize) -> u64 {
    count as u64 + 1
}

/// Splits cells in parallel until they are small enough for a single thread.
fn build_part(
    cell: &Cell,
    mut references: Vec<TriangleReference>,
    corners: &(impl Fn(u32) -> [Vec3; 3] + Sync),
    token: &CancelToken,
) -> Result<TreePart, Canceled> {
    token.check_pause_and_cancel()?;
    let plane = if references.len() > TASK_SIZE { cell.choose_split(&references) } else { None };
    let Some(plane) = plane else {
        return Ok(TreePart::Built(KdSubtree::build(cell, references, corners, token)?));
    };
    let left = PartitionBuffers::default().partition_references(&mut references, 0, &plane, corners).to_vec();
    references.shrink_to_fit();
    let [left_cell, right_cell] = cell.halves(&plane, [left.len(), references.len()]);
    let (left, right) = rayon::join(
        || build_part(&left_cell, left, corners, token),
        || build_part(&right_cell, references, corners, token),
    );
    Ok(TreePart::from_halves(plane, [left?, right?]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::kd_tree::node::DecodedNode;

    /// A fan of triangles around one vertex.
    fn fan(count: u32) -> impl Fn(u32) -> [Vec3; 3] + Sync {
        move |id| {
            let at = |id: u32| {
                let angle = std::f32::consts::TAU * id as f32 / count as f32;
                Vec3::new(angle.cos(), 0.1 * (7.0 * angle).sin(), angle.sin())
            };
            [Vec3::ZERO, at(id), at(id + 1)]
        }
    }

    #[test]
    fn fans_stay_within_the_size_limit() {
        for count in [500, 5000] {
            let built = build(count, fan(count), &CancelToken::new()).expect("never canceled");
            let size = (built.nodes.len() / 2 + built.references.len()) as u64;
            assert!(size <= MAX_PER_TRIANGLE * (u64::from(count) + FEW), "{size} for {count}");
            assert!(size > 4 * u64::from(count), "{size} for {count}: most of the room was left unused");
        }
    }

    #[test]
    fn size_limit_stops_splitting_early() {
        let fan = |id: u32| {
            let angle = id as f32 * 0.1;
            [Vec3::ZERO, Vec3::new(angle.cos(), angle.sin(), 1.0), Vec3::new(angle.sin(), 1.0, angle.cos())]
        };
        const COUNT: u64 = 2000;
        let size = |room| {
            let built =
                build_with_budget(room, COUNT as u32, fan, &CancelToken::new()).expect("never canceled");
            let leaf = |node: &&PackedKdNode| matches!(node.decode(), DecodedNode::Leaf { .. });
            assert_eq!(built.triangles.len() as u64, COUNT);
            (built.nodes.iter().filter(leaf).count() + built.references.len()) as u64
        };
        let whole = size(MAX_ROOM);
        assert!(whole > 3 * COUNT, "{whole}");
        for room in [COUNT + 1, 2 * COUNT + 1, 2 * COUNT + 2, 2 * COUNT + 700, 3 * COUNT] {
            assert!(size(room) <= room, "{} in {room}", size(room));
        }
        assert_eq!(size(COUNT + 1), COUNT + 1, "one leaf");
        assert!(size(3 * COUNT) > COUNT + 1, "the tree should use the available room");
    }
}
