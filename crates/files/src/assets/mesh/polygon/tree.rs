//! A k-d tree over a polygon's corners, from which corners can be removed.

use crate::math::DVec2;

/// Most corners of a leaf.
const LEAF: usize = 8;

/// Corners in the plane, ordered so that each node is a range of them.
pub(super) struct Tree {
    order: Vec<u32>,
    /// Place of each corner in the order.
    places: Vec<u32>,
    /// Nodes as in a binary heap.
    nodes: Vec<Node>,
}

#[derive(Clone, Copy)]
struct Node {
    least: DVec2,
    greatest: DVec2,
    /// Corners that have not been removed.
    remaining: u32,
}

impl Tree {
    pub(super) fn new(points: &[DVec2]) -> Self {
        let leaves = points.len().div_ceil(LEAF).next_power_of_two();
        let empty = Node { least: DVec2::INFINITY, greatest: DVec2::NEG_INFINITY, remaining: 0 };
        let mut tree = Self {
            order: (0..points.len() as u32).collect(),
            places: vec![0; points.len()],
            nodes: vec![empty; 2 * leaves],
        };
        tree.build(points, 0, 0, points.len());
        for (place, corner) in (0..).zip(&tree.order) {
            tree.places[*corner as usize] = place;
        }
        tree
    }

    /// Bounds the node and splits its range at the median along the longer side.
    fn build(&mut self, points: &[DVec2], node: usize, start: usize, end: usize) {
        let range = &mut self.order[start..end];
        let at = |corner: &u32| points[*corner as usize];
        let least = range.iter().map(at).fold(DVec2::INFINITY, DVec2::min);
        let greatest = range.iter().map(at).fold(DVec2::NEG_INFINITY, DVec2::max);
        self.nodes[node] = Node { least, greatest, remaining: (end - start) as u32 };
        if end - start <= LEAF {
            return;
        }
        let size = greatest - least;
        let axis = usize::from(size.y > size.x);
        let middle = (end - start) / 2;
        let key = |corner: &u32| at(corner)[axis];
        range.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
        self.build(points, 2 * node + 1, start, start + middle);
        self.build(points, 2 * node + 2, start + middle, end);
    }

    /// Removes a corner.
    pub(super) fn remove(&mut self, corner: u32) {
        let place = self.places[corner as usize] as usize;
        let (mut node, mut start, mut end) = (0, 0, self.order.len());
        loop {
            self.nodes[node].remaining -= 1;
            if end - start <= LEAF {
                return;
            }
            let middle = start + (end - start) / 2;
            (node, start, end) =
                if place < middle { (2 * node + 1, start, middle) } else { (2 * node + 2, middle, end) };
        }
    }

    /// The first corner for which `is_wanted` holds in the nodes that touch the triangle; it is also asked for removed corners.
    /// Adds the number of visited nodes and corners to `visits`.
    pub(super) fn find(
        &self,
        triangle: [DVec2; 3],
        visits: &mut u64,
        mut is_wanted: impl FnMut(u32) -> bool,
    ) -> Option<u32> {
        let [a, b, c] = triangle;
        let (least, greatest) = (a.min(b).min(c), a.max(b).max(c));
        let mut stack = vec![(0, 0, self.order.len())];
        while let Some((node, start, end)) = stack.pop() {
            *visits += 1;
            let Node { least: low, greatest: high, remaining } = self.nodes[node];
            let is_apart = low.cmpgt(greatest).any() || high.cmplt(least).any();
            if remaining == 0 || is_apart || is_outside(triangle, low, high) {
                continue;
            }
            if end - start <= LEAF {
                *visits += (end - start) as u64;
                if let Some(found) = self.order[start..end].iter().find(|corner| is_wanted(**corner)) {
                    return Some(*found);
                }
                continue;
            }
            let middle = start + (end - start) / 2;
            stack.push((2 * node + 1, start, middle));
            stack.push((2 * node + 2, middle, end));
        }
        None
    }
}

/// Whether a box is outside of one of the sides of a triangle.
fn is_outside([a, b, c]: [DVec2; 3], low: DVec2, high: DVec2) -> bool {
    [(a, b), (b, c), (c, a)].into_iter().any(|(from, to)| {
        // The corner of the box that is farthest on the inner side.
        let x = if to.y > from.y { low.x } else { high.x };
        let y = if to.x > from.x { high.y } else { low.y };
        turn(from, to, DVec2::new(x, y)) < 0.0
    })
}

/// Twice the area of a triangle, positive if its corners are in counterclockwise order. The sign is exact for points of `f32`
/// that are of similar size.
pub(super) fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}
