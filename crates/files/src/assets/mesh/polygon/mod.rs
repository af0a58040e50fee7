//! Triangulates polygons: convex polygons as fans, others by ear clipping.

mod ears;
mod tree;

use crate::math::{DVec2, DVec3, Vec3};

/// Triangulates a polygon with at least 3 finite points. Emits each triangle as three corner indices, with
/// the polygon's orientation. Returns whether the triangles cover the polygon exactly once. Self-intersecting
/// polygons are triangulated as well as possible.
pub(super) fn triangulate(points: &[Vec3], mut emit: impl FnMut([usize; 3])) -> bool {
    let points: Vec<DVec3> = points.iter().map(|point| point.as_dvec3()).collect();
    let normal = newell_normal(&points);
    let turns =
        |a: usize, b: usize, c: usize| (points[b] - points[a]).cross(points[c] - points[a]).dot(normal);
    let count = points.len();
    if count == 4 && turns(0, 1, 2).min(turns(0, 2, 3)) <= 0.0 && turns(0, 1, 3).min(turns(1, 2, 3)) > 0.0 {
        emit([0, 1, 3]);
        emit([1, 2, 3]);
        true
    } else if count <= 4 || normal == DVec3::ZERO || (1..count - 1).all(|i| turns(0, i, i + 1) > 0.0) {
        (1..count - 1).for_each(|i| emit([0, i, i + 1]));
        normal != DVec3::ZERO && (1..count - 1).all(|i| turns(0, i, i + 1) >= 0.0)
    } else {
        ears::clip_ears_and_check_simple(&project_points(&points, normal), emit)
    }
}

/// Projects the points along the axis of the normal's largest component, in counterclockwise order. The
/// projection is exact.
fn project_points(points: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    let axis = normal.abs().max_position();
    let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
    let (x, y) = if normal[axis] > 0.0 { (first, second) } else { (second, first) };
    points.iter().map(|point| DVec2::new(point[x], point[y])).collect()
}

/// Returns the sum of the triangle normals in a fan, which does not depend on the fan's origin (Newell's
/// method).
fn newell_normal(points: &[DVec3]) -> DVec3 {
    let origin = points[0];
    points.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin)).sum()
}

#[cfg(test)]
pub(super) mod tests;
