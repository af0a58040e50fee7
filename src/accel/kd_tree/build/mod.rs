//! Building: from the top, each cell by the plane of least expected cost; large cells by bins, small ones by perfect splits,
//! until a leaf is as cheap. Triangles on both sides of a plane go to both, each with the box of its piece.
//!
//! The tree is a function of the triangles alone, not of the threads.

mod bins;
mod cost;
mod subtree;
mod sweep;

use rayon::prelude::*;

use super::node::{self, Kind, Node, Triangle};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::Aabb;
use crate::geometry::mesh::TriangleMesh;
use crate::math::Vec3;

use crate::accel::reference::{Bounds, Reference};
use subtree::Subtree;

/// Cells of at most this many references are built by one thread; the token is polled between them.
const TASK_SIZE: usize = 4096;

/// Most leaves and references in all, of a tree whose nodes, less than two for each leaf, have numbers that fit.
const MOST_ROOM: u64 = node::MOST as u64 / 2;

/// One leaf with all triangles is always possible.
const _: () = assert!((TriangleMesh::MOST_TRIANGLES as u64) < MOST_ROOM);

/// No triangle yet.
const NOWHERE: u32 = u32::MAX;

/// What building made.
pub struct Built {
    pub nodes: Vec<Node>,
    /// Places of `triangles`, leaf by leaf.
    pub references: Vec<u32>,
    pub triangles: Vec<Triangle>,
    pub bounds: Aabb,
}

/// Planes above a leaf at most, for so many triangles (Havran's 8 + 1.3·log₂ n).
pub fn depth_limit(count: usize) -> u32 {
    8 + (1.3 * (count.max(1) as f32).log2()) as u32
}

/// Build over `count` triangles; those whose box has no finite size are in no leaf.
///
/// # Errors
/// [`Cancelled`].
pub fn build(
    count: u32,
    corners: impl Fn(u32) -> [Vec3; 3] + Sync,
    token: &CancelToken,
) -> Result<Built, Cancelled> {
    build_within(MOST_ROOM, count, corners, token)
}

/// [`build`] with so much room for leaves and references together.
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
    let mut around = Bounds::EMPTY;
    for reference in &references {
        around.grow(&reference.bounds);
    }
    let levels = depth_limit(references.len());
    let part = part(Cell { references, bounds: around, around, levels, room }, &corners, token)?;
    let mut all = Subtree::default();
    part.append_to(&mut all);
    token.check()?;
    let (references, order) = by_first_use(all.ids, count);
    let triangles = order.into_par_iter().map(|id| Triangle { corners: corners(id), id }).collect();
    Ok(Built { nodes: all.nodes, references, triangles, bounds: around.aabb() })
}

/// Triangles in the order in which leaves first name them, and their places there instead of their numbers.
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

/// A part of space and what is in it.
struct Cell {
    references: Vec<Reference>,
    bounds: Bounds,
    /// The box around the references.
    around: Bounds,
    /// How many planes may yet follow.
    levels: u32,
    /// How many leaves and references together may come of it.
    room: u64,
}

impl Cell {
    /// The room of a leaf.
    fn own_room(&self) -> u64 {
        self.references.len() as u64 + 1
    }

    /// The plane to split it by; none for a leaf.
    fn plane(&self) -> Option<cost::Plane> {
        // A plane through all triangles makes two of each.
        let has_room = 2 * self.own_room() <= self.room;
        if self.levels == 0 || self.references.is_empty() || !has_room {
            None
        } else if self.references.len() <= sweep::SWEPT {
            sweep::cheapest(&self.references, &self.bounds)
        } else {
            bins::cheapest(&self.references, &self.bounds, &self.around)
        }
    }

    /// Its halves. What only touches the plane goes to the side that it is on.
    fn split(self, plane: &cost::Plane, corners: &impl Fn(u32) -> [Vec3; 3]) -> [Self; 2] {
        let Self { mut references, bounds, levels, room, .. } = self;
        let mut right = Vec::with_capacity(references.len() / 2);
        let mut around = [Bounds::EMPTY; 2];
        let (axis, at) = (plane.axis, plane.at);
        references.retain_mut(|reference| {
            let (min, max) = (reference.bounds.min[axis], reference.bounds.max()[axis]);
            let (below, above) = (min < at, max > at);
            if below && above {
                let [own, other] = reference.split(axis, at, corners(reference.id()));
                around[0].grow(&own.bounds);
                around[1].grow(&other.bounds);
                *reference = own;
                right.push(other);
                return true;
            }
            let goes_right = above || (!below && plane.planar_right);
            around[usize::from(goes_right)].grow(&reference.bounds);
            if goes_right {
                right.push(*reference);
            }
            !goes_right
        });
        let [left_bounds, right_bounds] = bounds.halves(axis, at);
        let levels = levels - 1;
        let mut left = Self { references, bounds: left_bounds, around: around[0], levels, room };
        let mut right = Self { references: right, bounds: right_bounds, around: around[1], levels, room };
        // In proportion: as `room` is enough for both, so is the share of each.
        left.room = room * left.own_room() / (left.own_room() + right.own_room());
        right.room = room - left.room;
        [left, right]
    }
}

/// A part of the tree above the subtrees.
enum Part {
    /// Two halves.
    Halves { axis: usize, at: f32, halves: Box<[Part; 2]> },
    /// Built by one thread.
    Built(Subtree),
}

impl Part {
    /// Node before children, left before right.
    fn append_to(self, all: &mut Subtree) {
        match self {
            Self::Built(subtree) => all.append(&subtree),
            Self::Halves { axis, at, halves } => {
                let place = all.nodes.len();
                all.nodes.push(Node::new(Kind::Leaf { first: 0, count: 0 }));
                let [left, right] = *halves;
                left.append_to(all);
                all.nodes[place] = Node::new(Kind::Inner { axis, at, right: all.nodes.len() as u32 });
                right.append_to(all);
            }
        }
    }
}

/// Split until one thread can take over.
fn part(
    cell: Cell,
    corners: &(impl Fn(u32) -> [Vec3; 3] + Sync),
    token: &CancelToken,
) -> Result<Part, Cancelled> {
    token.check()?;
    let plane = if cell.references.len() > TASK_SIZE { cell.plane() } else { None };
    let Some(plane) = plane else { return Ok(Part::Built(Subtree::build(cell, corners))) };
    let [left, right] = cell.split(&plane, corners);
    let (left, right) = rayon::join(|| part(left, corners, token), || part(right, corners, token));
    Ok(Part::Halves { axis: plane.axis, at: plane.at, halves: Box::new([left?, right?]) })
}

#[cfg(test)]
mod tests {
    use super::*;

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
