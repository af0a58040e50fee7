//! Validation of a kd-tree, independent of the code that builds it.

use super::build::depth_limit;
use super::node::DecodedNode;
use super::{KdTree, split_box};
use crate::accel::reference::ClippedPolygon;
use crate::geometry::Aabb;
use crate::math::{DVec3, Vec3};

/// A node to be checked.
struct NodeToCheck {
    place: u32,
    cell: Aabb,
    depth: u32,
    /// Triangles that overlap the cell, including those that touch its faces.
    inside: Vec<u32>,
}

impl KdTree {
    /// Checks the tree. Planes must be inside their cells, so that the leaves tile the box. Every node must
    /// be reached exactly once, within the depth limit. A leaf must refer exactly once to every triangle that
    /// extends into it, and to no triangle that does not overlap it. A triangle within a face shared by two
    /// leaves must be in at least one of them.
    ///
    /// # Errors
    /// A description of the first error found.
    pub fn validate(&self, count: u32, corners: impl Fn(u32) -> [Vec3; 3]) -> Result<(), String> {
        let usable = |id: &u32| {
            let bounds = Aabb::from_points(corners(*id));
            corners(*id).iter().all(|corner| corner.is_finite()) && bounds.extent().is_finite()
        };
        let all: Vec<u32> = (0..count).filter(usable).collect();
        if self.nodes.is_empty() {
            return if all.is_empty() {
                Ok(())
            } else {
                Err("the tree has triangles but no nodes".to_owned())
            };
        }
        if Aabb::from_points(all.iter().flat_map(|&id| corners(id))) != self.bounds {
            return Err("the bounding box does not match the triangles".to_owned());
        }
        let limit = depth_limit(all.len());
        let mut named = SamplePointCoverage::new(&all, &corners);
        let mut reached = 0;
        let mut pending = vec![NodeToCheck { place: 0, cell: self.bounds, depth: 0, inside: all }];
        while let Some(NodeToCheck { place, cell, depth, inside }) = pending.pop() {
            if depth > limit {
                return Err(format!("node {place} has depth {depth}, which exceeds the limit"));
            }
            if place != reached {
                return Err(format!("node {place} is out of order"));
            }
            reached += 1;
            match self.nodes[place as usize].decode() {
                DecodedNode::Inner { axis, at, right } => {
                    if !(at > cell.min[axis] && at < cell.max[axis]) {
                        return Err(format!("the plane of node {place} is outside its cell"));
                    }
                    let [below, above] = split_box(cell, axis, at);
                    for (place, cell) in [(right, above), (place + 1, below)] {
                        let touches = |id: &&u32| {
                            !ClippedPolygon::clip_triangle_to_box(corners(**id), &cell).points().is_empty()
                        };
                        let inside = inside.iter().filter(touches).copied().collect();
                        pending.push(NodeToCheck { place, cell, depth: depth + 1, inside });
                    }
                }
                DecodedNode::Leaf { first, count } => {
                    let ids = self.references[first as usize..][..count as usize].iter();
                    let ids: Vec<u32> = ids.map(|&at| self.triangles[at as usize].id).collect();
                    check_leaf(place, &cell, &inside, &ids, &corners)?;
                    named.mark_covered(&cell, &inside, &ids);
                }
            }
        }
        if reached as usize != self.nodes.len() {
            return Err("some nodes are unreachable".to_owned());
        }
        if let Some(triangle) = self.triangles.iter().find(|own| own.corners != corners(own.id)) {
            return Err(format!("triangle {} differs from the triangle in the mesh", triangle.id));
        }
        named.check_complete()
    }
}

/// Checks that a leaf refers to the triangles in its cell.
fn check_leaf(
    place: u32,
    cell: &Aabb,
    inside: &[u32],
    ids: &[u32],
    corners: &impl Fn(u32) -> [Vec3; 3],
) -> Result<(), String> {
    let mut sorted = ids.to_vec();
    sorted.sort_unstable();
    if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(format!("leaf {place} refers to a triangle twice"));
    }
    if let Some(id) = sorted.iter().find(|&&id| !boxes_overlap(cell, &Aabb::from_points(corners(id)))) {
        return Err(format!("leaf {place} refers to triangle {id}, which is outside its cell"));
    }
    let must = |id: &&u32| triangle_enters_cell(cell, corners(**id));
    match inside.iter().filter(must).find(|id| sorted.binary_search(id).is_err()) {
        Some(id) => Err(format!("leaf {place} is missing triangle {id}")),
        None => Ok(()),
    }
}

fn boxes_overlap(a: &Aabb, b: &Aabb) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// Whether a triangle extends into a cell, not counting parts of the triangle that are in a face of the cell.
fn triangle_enters_cell(cell: &Aabb, corners: [Vec3; 3]) -> bool {
    let (min, max) = ClippedPolygon::clip_triangle_to_box(corners, cell).bounds();
    (0..3).all(|axis| {
        let (low, high) = (f64::from(cell.min[axis]), f64::from(cell.max[axis]));
        let rounding = 1e-12 * low.abs().max(high.abs());
        low == high || (max[axis] > low + rounding && min[axis] < high - rounding)
    })
}

/// Sample points on every triangle. Each point's flag is set once a leaf at that point refers to the
/// triangle.
struct SamplePointCoverage {
    points: Vec<(u32, Vec<(DVec3, bool)>)>,
}

impl SamplePointCoverage {
    fn new(ids: &[u32], corners: &impl Fn(u32) -> [Vec3; 3]) -> Self {
        let points = |&id: &u32| {
            let [a, b, c] = corners(id).map(|corner| corner.as_dvec3());
            let weights =
                (0..=4).flat_map(|i| (0..=4 - i).map(move |j| (f64::from(i) / 4.0, f64::from(j) / 4.0)));
            (id, weights.map(|(u, v)| (a + (b - a) * u + (c - a) * v, false)).collect())
        };
        Self { points: ids.iter().map(points).collect() }
    }

    fn mark_covered(&mut self, cell: &Aabb, inside: &[u32], ids: &[u32]) {
        let size = cell.min.abs().max(cell.max.abs()).as_dvec3() * 1e-12;
        let (min, max) = (cell.min.as_dvec3() - size, cell.max.as_dvec3() + size);
        for id in inside.iter().filter(|id| ids.contains(id)) {
            let Ok(place) = self.points.binary_search_by_key(id, |(id, _)| *id) else { continue };
            for (point, named) in &mut self.points[place].1 {
                *named |= min.cmple(*point).all() && point.cmple(max).all();
            }
        }
    }

    fn check_complete(&self) -> Result<(), String> {
        let lost = self.points.iter().find(|(_, points)| points.iter().any(|(_, named)| !named));
        lost.map_or(Ok(()), |(id, _)| Err(format!("part of triangle {id} is not in any leaf")))
    }
}
