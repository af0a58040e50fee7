//! Building from the top: each cell is split by the plane of least expected cost, large cells by bins, small ones by perfect
//! splits, until a leaf is as cheap. Triangles on both sides of a plane go to both, each with the box of its piece.
//!
//! The tree is a function of the triangles alone, not of the threads.

mod bins;
mod cost;
mod join;
mod partition;
mod subtree;
mod sweep;

use rayon::prelude::*;

use super::node::{self, Node, Triangle};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::Aabb;
use crate::geometry::mesh::TriangleMesh;
use crate::math::Vec3;
use crate::math::elementary::log2;

use crate::accel::reference::{Bounds, Reference};
use cost::Plane;
use join::Part;
use partition::Scratch;
use subtree::Subtree;

/// Most references of a cell that one thread builds; the token is polled between such cells.
const TASK_SIZE: usize = 4096;

/// Most leaves and references in all: a tree has less than two nodes for each leaf, and their numbers must fit.
const MOST_ROOM: u64 = node::MOST as u64 / 2;

/// One leaf with all triangles is always possible.
const _: () = assert!((TriangleMesh::MOST_TRIANGLES as u64) < MOST_ROOM);

/// Most leaves and references for each triangle: several times what meshes need, but a small part of what triangles
/// around one vertex could take.
const MOST_PER_TRIANGLE: u64 = 24;

/// Fewest triangles that count for that limit; smaller trees get the room of so many.
const FEW: u64 = 64;

/// Index of a triangle that has no place yet.
const NOWHERE: u32 = u32::MAX;

/// Result of building.
pub struct Built {
    pub nodes: Vec<Node>,
    /// Indices into `triangles`, leaf by leaf.
    pub references: Vec<u32>,
    pub triangles: Vec<Triangle>,
    pub bounds: Aabb,
}

/// Most planes above a leaf, for so many triangles (Havran's 8 + 1.3·log₂ n).
pub fn depth_limit(count: usize) -> u32 {
    8 + (1.3 * log2(count.max(1) as f32)) as u32
}

/// Builds over `count` triangles; triangles whose box has no finite size are in no leaf.
///
/// # Errors
/// [`Cancelled`].
pub fn build(
    count: u32,
    corners: impl Fn(u32) -> [Vec3; 3] + Sync,
    token: &CancelToken,
) -> Result<Built, Cancelled> {
    let room = MOST_ROOM.min(MOST_PER_TRIANGLE * (u64::from(count) + FEW));
    build_within(room, count, corners, token)
}

/// [`build`] with this room for leaves and references together.
fn build_within(
    room: u64,
    count: u32,
    corners: impl Fn(u32) -> [Vec3; 3] + Sync,
    token: &CancelToken,
) -> Result<Built, Cancelled> {
    let references = Reference::usable(count, &corners, token)?;
    if references.is_empty() {
        let (nodes, references, triangles) = Default::default();
        return Ok(Built { nodes, references, triangles, bounds: Aabb::EMPTY });
    }
    let bounds = Bounds::around(&references);
    let levels = depth_limit(references.len());
    let part = part(&Cell { bounds, levels, room }, references, &corners, token)?;
    let all = part.join();
    token.check()?;
    let (references, order) = by_first_use(all.ids, count);
    let triangles = order.into_par_iter().map(|id| Triangle { corners: corners(id), id }).collect();
    Ok(Built { nodes: all.nodes, references, triangles, bounds: bounds.aabb() })
}

/// Triangles in the order in which leaves first name them, and `ids` as indices into that order.
fn by_first_use(mut ids: Vec<u32>, count: u32) -> (Vec<u32>, Vec<u32>) {
    let mut places = vec![NOWHERE; count as usize];
    let mut order = Vec::with_capacity(count as usize);
    for id in &mut ids {
        let place = &mut places[*id as usize];
        if *place == NOWHERE {
            *place = order.len() as u32;
            order.push(*id);
        }
        *id = *place;
    }
    (ids, order)
}

/// A part of space.
#[derive(Clone, Copy)]
struct Cell {
    bounds: Bounds,
    /// Number of planes that may yet follow.
    levels: u32,
    /// Number of leaves and references that may come of the cell.
    room: u64,
}

impl Cell {
    /// The plane to split it by. `None` for a leaf.
    fn plane(&self, references: &[Reference]) -> Option<Plane> {
        // A plane through all triangles doubles them.
        let has_room = 2 * leaf_room(references.len()) <= self.room;
        if self.levels == 0 || references.is_empty() || !has_room {
            None
        } else if references.len() <= sweep::SWEPT {
            sweep::cheapest(references, &self.bounds)
        } else {
            bins::cheapest(references, &self.bounds)
        }
    }

    /// The cell's halves, with so many references in each.
    fn halves(&self, plane: &Plane, counts: [usize; 2]) -> [Self; 2] {
        let [left, right] = counts.map(leaf_room);
        // Share the room in proportion: as the whole suffices for both, each share does.
        let room = self.room * left / (left + right);
        let levels = self.levels - 1;
        let [below, above] = self.bounds.halves(plane.axis, plane.at);
        [Self { bounds: below, levels, room }, Self { bounds: above, levels, room: self.room - room }]
    }
}

/// The room that a leaf of so many references takes.
fn leaf_room(count: usize) -> u64 {
    count as u64 + 1
}

/// Splits until one thread can take over.
fn part(
    cell: &Cell,
    mut references: Vec<Reference>,
    corners: &(impl Fn(u32) -> [Vec3; 3] + Sync),
    token: &CancelToken,
) -> Result<Part, Cancelled> {
    token.check()?;
    let plane = if references.len() > TASK_SIZE { cell.plane(&references) } else { None };
    let Some(plane) = plane else {
        return Ok(Part::Built(Subtree::build(cell, references, corners, token)?));
    };
    let left = Scratch::default().partition(&mut references, 0, &plane, corners).to_vec();
    references.shrink_to_fit();
    let [left_cell, right_cell] = cell.halves(&plane, [left.len(), references.len()]);
    let (left, right) = rayon::join(
        || part(&left_cell, left, corners, token),
        || part(&right_cell, references, corners, token),
    );
    Ok(Part::halves(plane, [left?, right?]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::kd_tree::node::Kind;

    /// A disk of triangles around one vertex.
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
    fn triangles_that_share_a_vertex_get_no_more_room_than_others() {
        for count in [500, 20_000] {
            let built = build(count, fan(count), &CancelToken::new()).expect("nobody cancels");
            let size = (built.nodes.len() / 2 + built.references.len()) as u64;
            assert!(size <= MOST_PER_TRIANGLE * (u64::from(count) + FEW), "{size} for {count}");
            assert!(size > 4 * u64::from(count), "{size} for {count}: what room there is is used");
        }
    }

    #[test]
    fn a_tree_without_room_makes_leaves_early() {
        let fan = |id: u32| {
            let angle = id as f32 * 0.1;
            [Vec3::ZERO, Vec3::new(angle.cos(), angle.sin(), 1.0), Vec3::new(angle.sin(), 1.0, angle.cos())]
        };
        let size = |room| {
            let built = build_within(room, 6000, fan, &CancelToken::new()).expect("nobody cancels");
            let leaf = |node: &&Node| matches!(node.kind(), Kind::Leaf { .. });
            assert_eq!(built.triangles.len(), 6000);
            (built.nodes.iter().filter(leaf).count() + built.references.len()) as u64
        };
        let whole = size(MOST_ROOM);
        assert!(whole > 20_000, "{whole}");
        for room in [6001, 12_001, 12_002, 14_000, 20_000] {
            assert!(size(room) <= room, "{} in {room}", size(room));
        }
        assert_eq!(size(6001), 6001, "one leaf");
        assert!(size(20_000) > 6001, "what room there is is used");
    }
}
