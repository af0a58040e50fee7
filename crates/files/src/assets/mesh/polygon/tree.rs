//! A k-d tree over a polygon's corners, from which corners can be removed.

use crate::math::DVec2;

/// Maximum number of corners per leaf.
const MAX_LEAF_CORNERS: usize = 8;

/// Polygon corners in the plane, ordered so that each tree node is a contiguous range.
pub(super) struct CornerTree {
    order: Vec<u32>,
    /// Index of each corner in `order`.
    positions: Vec<u32>,
    /// Nodes in binary heap layout.
    nodes: Vec<BoxNode>,
}

#[derive(Clone, Copy)]
struct BoxNode {
    min: DVec2,
    max: DVec2,
    /// Number of corners that have not been removed.
    remaining: u32,
}

impl CornerTree {
    pub(super) fn new(points: &[DVec2]) -> Self {
        let leaves = points.len().div_ceil(MAX_LEAF_CORNERS).next_power_of_two();
        let empty = BoxNode { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY, remaining: 0 };
        let mut tree = Self {
            order: (0..points.len() as u32).collect(),
            positions: vec![0; points.len()],
            nodes: vec![empty; 2 * leaves],
        };
        tree.build_node(points, 0, 0, points.len());
        for (position, corner) in (0..).zip(&tree.order) {
            tree.positions[*corner as usize] = position;
        }
        tree
    }

    /// Computes a node's bounding box and splits its range at the median of the longer axis.
    fn build_node(&mut self, points: &[DVec2], node: usize, start: usize, end: usize) {
        let range = &mut self.order[start..end];
        let at = |corner: &u32| points[*corner as usize];
        let min = range.iter().map(at).fold(DVec2::INFINITY, DVec2::min);
        let max = range.iter().map(at).fold(DVec2::NEG_INFINITY, DVec2::max);
        self.nodes[node] = BoxNode { min, max, remaining: (end - start) as u32 };
        if end - start <= MAX_LEAF_CORNERS {
            return;
        }
        let size = max - min;
        let axis = usize::from(size.y > size.x);
        let middle = (end - start) / 2;
        let key = |corner: &u32| at(corner)[axis];
        range.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
        self.build_node(points, 2 * node + 1, start, start + middle);
        self.build_node(points, 2 * node + 2, start + middle, end);
    }

    /// Removes a corner.
    pub(super) fn remove(&mut self, corner: u32) {
        let position = self.positions[corner as usize] as usize;
        let (mut node, mut start, mut end) = (0, 0, self.order.len());
        loop {
            self.nodes[node].remaining -= 1;
            if end - start <= MAX_LEAF_CORNERS {
                return;
            }
            let middle = start + (end - start) / 2;
            (node, start, end) =
                if position < middle { (2 * node + 1, start, middle) } else { (2 * node + 2, middle, end) };
        }
    }

    /// Searches the nodes that overlap the triangle, and returns a corner that `is_wanted` accepts. Passes
    /// removed corners to `is_wanted` as well. Adds the number of visited nodes and corners to `visits`.
    pub(super) fn search_near_triangle(
        &self,
        triangle: [DVec2; 3],
        visits: &mut u64,
        mut is_wanted: impl FnMut(u32) -> bool,
    ) -> Option<u32> {
        let [a, b, c] = triangle;
        let (min, max) = (a.min(b).min(c), a.max(b).max(c));
        let mut stack = vec![(0, 0, self.order.len())];
        while let Some((node, start, end)) = stack.pop() {
            *visits += 1;
            let BoxNode { min: low, max: high, remaining } = self.nodes[node];
            let is_apart = low.cmpgt(max).any() || high.cmplt(min).any();
            if remaining == 0 || is_apart || is_box_beyond_edge(triangle, low, high) {
                continue;
            }
            if end - start <= MAX_LEAF_CORNERS {
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

/// Whether a box is entirely outside one side of a triangle.
fn is_box_beyond_edge([a, b, c]: [DVec2; 3], low: DVec2, high: DVec2) -> bool {
    [(a, b), (b, c), (c, a)].into_iter().any(|(from, to)| {
        // Test the corner of the box that is farthest inside.
        let x = if to.y > from.y { low.x } else { high.x };
        let y = if to.x > from.x { high.y } else { low.y };
        twice_signed_area(from, to, DVec2::new(x, y)) < 0.0
    })
}

/// Twice the signed area of a triangle, positive if it is counterclockwise. The sign is exact for `f32`
/// points of similar magnitude.
pub(super) fn twice_signed_area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}
