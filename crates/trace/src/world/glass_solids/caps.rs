//! Open rims that end at opaque surfaces, where light can reach the other side only through the glass.

use super::parts::{GlassParts, GlassTriangleSelection, RimEdge, all_or_some_triangles_are_glass};
use crate::accel::Bvh;
use crate::assets::LoadedMesh;
use crate::control::{CancelToken, Canceled};
use crate::geometry::{Aabb, RayF64, Shape};
use crate::math::DVec3;
use crate::scene::description::{LoweredShape, MeshReference, Scene};

/// Maximum number of edges examined per hole.
const MAX_RIM_EDGES: usize = 64;

/// Search distance beyond a rim, relative to the length of the ray toward the rim.
const SEARCH_DISTANCE: f64 = 1e-3;

/// Queries per edge: two rays and two points.
const QUERIES: usize = 4;

/// A query for opaque surfaces.
#[derive(Clone, Copy)]
enum OpaqueSurfaceQuery {
    /// Whether this ray hits an opaque surface.
    Way(RayF64),
    /// Whether an opaque surface is within this distance of this point.
    Point(DVec3, f64),
}

/// Returns, for each hole, the fraction of its rim (by length) covered by opaque surfaces.
///
/// An edge is covered if a ray toward its midpoint, from its triangle or from the center of the hole, hits an
/// opaque surface at the midpoint or slightly beyond. It is also covered if both endpoints are on opaque
/// surfaces, because the chord between them may miss a curved surface.
pub(super) fn covered_rim_fractions(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    parts: &GlassParts,
    holes: &[&[RimEdge]],
    token: &CancelToken,
) -> Result<Vec<f64>, Canceled> {
    let examined: Vec<Vec<&RimEdge>> = holes.iter().map(|rims| evenly_spaced_rim_edges(rims)).collect();
    let queries: Vec<OpaqueSurfaceQuery> =
        examined.iter().flat_map(|rims| rim_edge_queries(parts, rims)).collect();
    if queries.is_empty() {
        return Ok(vec![0.0; holes.len()]);
    }
    let answers = evaluate_opaque_surface_queries(scene, meshes, parts.origin, &queries, token)?;
    let mut answers = answers.chunks(QUERIES);
    let part = |rims: Vec<&RimEdge>| {
        let (mut covered, mut total) = (0.0, 0.0);
        for (rim, answers) in rims.into_iter().zip(&mut answers) {
            let length = rim.ends[0].distance(rim.ends[1]);
            total += length;
            covered += if answers[0] || answers[1] || answers[2] && answers[3] { length } else { 0.0 };
        }
        covered / total
    };
    Ok(examined.into_iter().map(part).collect())
}

/// Returns evenly spaced edges of a hole, at most `MAX_RIM_EDGES`.
fn evenly_spaced_rim_edges(rims: &[RimEdge]) -> Vec<&RimEdge> {
    let step = rims.len().div_ceil(MAX_RIM_EDGES).max(1);
    rims.iter().step_by(step).collect()
}

/// Returns the queries for a hole's edges, [`QUERIES`] per edge.
fn rim_edge_queries<'a>(
    parts: &'a GlassParts,
    rims: &'a [&RimEdge],
) -> impl Iterator<Item = OpaqueSurfaceQuery> + 'a {
    let middle_of = |rim: &RimEdge| (rim.ends[0] + rim.ends[1]) * 0.5;
    let center = rims.iter().map(|rim| middle_of(rim)).sum::<DVec3>() / rims.len().max(1) as f64;
    rims.iter().flat_map(move |rim| {
        let (end, tolerance) = (middle_of(rim), parts.list[rim.part as usize].tolerance);
        let [inner, middle] = [rim.inner, center].map(|origin| {
            let direction = end - origin;
            OpaqueSurfaceQuery::Way(RayF64 {
                origin,
                direction,
                t_max: 1.0 + SEARCH_DISTANCE + tolerance / direction.length(),
            })
        });
        let [from, to] = rim
            .ends
            .map(|end| OpaqueSurfaceQuery::Point(end, SEARCH_DISTANCE * end.distance(rim.inner) + tolerance));
        [inner, middle, from, to]
    })
}

impl OpaqueSurfaceQuery {
    fn search_box(&self) -> Aabb {
        match *self {
            Self::Way(way) => Aabb::from_points_f64([way.origin, way.at(way.t_max)]),
            Self::Point(point, reach) => Aabb::from_points_f64([point - reach, point + reach]),
        }
    }

    /// Whether a triangle satisfies the query.
    fn is_satisfied_by_triangle(&self, corners: [DVec3; 3]) -> bool {
        match *self {
            Self::Way(way) => ray_hits_triangle(&way, corners),
            Self::Point(point, reach) => squared_distance_to_triangle(point, corners) <= reach * reach,
        }
    }

    /// Whether a shape satisfies the query. At least one of three orthogonal segments is at an angle of at
    /// least 35° to the surface, so it hits a surface at distance d within √3·d.
    fn is_satisfied_by_shape(&self, shape: &Shape) -> bool {
        match *self {
            Self::Way(way) => shape.intersect(&way).is_some(),
            Self::Point(point, reach) => DVec3::AXES.into_iter().any(|axis| {
                let half = axis * (3.0_f64.sqrt() * reach);
                let line = RayF64 { origin: point - half, direction: half, t_max: 2.0 };
                shape.intersect(&line).is_some()
            }),
        }
    }
}

/// Evaluates each query against the scene's opaque surfaces.
fn evaluate_opaque_surface_queries(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    origin: DVec3,
    queries: &[OpaqueSurfaceQuery],
    token: &CancelToken,
) -> Result<Vec<bool>, Canceled> {
    let bounds: Vec<Aabb> = queries.iter().map(OpaqueSurfaceQuery::search_box).collect();
    let all = bounds.iter().fold(Aabb::EMPTY, |all, own| all.union(*own));
    // Use a tree over the queries because there are many queries and many surfaces.
    let tree = Bvh::build(&bounds, token)?;
    let mut answers = vec![false; queries.len()];
    for object in &scene.objects {
        if all_or_some_triangles_are_glass(scene, meshes, object) == Some(GlassTriangleSelection::All) {
            continue;
        }
        token.check_pause_and_cancel()?;
        match object.shape.to_traced_shape_relative_to(origin) {
            LoweredShape::Shape(shape) => {
                let around = shape.bounds().unwrap_or(all);
                tree.visit_overlapping(&around, |id| {
                    let id = id as usize;
                    answers[id] = answers[id] || queries[id].is_satisfied_by_shape(&shape);
                });
            }
            LoweredShape::Mesh(placed) => {
                for corners in triangles_relative_to(placed, meshes[placed.file], origin) {
                    let around = Aabb::from_points_f64(corners);
                    if around.overlaps(&all) {
                        tree.visit_overlapping(&around, |id| {
                            let id = id as usize;
                            answers[id] = answers[id] || queries[id].is_satisfied_by_triangle(corners);
                        });
                    }
                }
            }
        }
    }
    Ok(answers)
}

/// Returns the triangles of a placed mesh, in coordinates relative to `origin`.
pub(super) fn triangles_relative_to<'a>(
    placed: &MeshReference,
    loaded: &'a LoadedMesh,
    origin: DVec3,
) -> impl Iterator<Item = [DVec3; 3]> + 'a {
    let own = &loaded.mesh;
    let place = placed.placed.to_transform().relative_to_origins(own.origin, origin);
    let corners = move |number: u32| own.corners(number).map(|corner| place.point(corner.as_dvec3()));
    (0..own.triangles.len() as u32).map(corners)
}

/// Whether a ray hits a triangle (Möller and Trumbore, *Fast, Minimum Storage Ray/Triangle Intersection*,
/// 1997).
fn ray_hits_triangle(way: &RayF64, [a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac) = (b - a, c - a);
    let p = way.direction.cross(ac);
    let determinant = ab.dot(p);
    let from = way.origin - a;
    let q = from.cross(ab);
    let (u, v) = (from.dot(p) / determinant, way.direction.dot(q) / determinant);
    let t = ac.dot(q) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t <= way.t_max
}

/// Squared distance between a point and a triangle.
fn squared_distance_to_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let sides = [[a, b], [b, c], [c, a]];
    let is_over = |[from, to]: [DVec3; 2]| (to - from).cross(point - from).dot(normal) >= 0.0;
    if normal != DVec3::ZERO && sides.into_iter().all(is_over) {
        let height = (point - a).dot(normal);
        return height * height / normal.length_squared();
    }
    let from_side = |[from, to]: [DVec3; 2]| {
        let along = to - from;
        let part = (point - from).dot(along) / along.length_squared();
        let nearest = if part > 0.0 { from + along * part.min(1.0) } else { from };
        point.distance_squared(nearest)
    };
    sides.map(from_side).into_iter().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::unit_generator;

    #[test]
    fn triangle_distance_uses_the_nearest_point() {
        let mut next = unit_generator(3);
        let mut place = || DVec3::from_array(std::array::from_fn(|_| f64::from(next()) * 2.0 - 1.0));
        for _ in 0..300 {
            let (corners, point) = ([place(), place(), place()], place() * 1.5);
            let [a, b, c] = corners;
            let steps = 200;
            let mut least = f64::INFINITY;
            for i in 0..=steps {
                for j in 0..=steps - i {
                    let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(steps));
                    least = least.min(point.distance(a + (b - a) * u + (c - a) * v));
                }
            }
            let distance = squared_distance_to_triangle(point, corners).sqrt();
            assert!(
                (distance - 1e-9..distance + 0.02).contains(&least),
                "{corners:?} {point}: {distance} {least}"
            );
        }
    }
}
