//! Points on the triangles of a mesh instance: position, error bound and normals.

use super::placement::MeshPlacement;
use crate::geometry::RayF64;
use crate::geometry::surface::absolute_f64_error_bound;
use crate::math::{DVec3, Vec3};

/// A point on a triangle in a mesh instance.
pub(super) struct TrianglePoint {
    /// The triangle's corners, in mesh coordinates.
    pub(super) corners: [DVec3; 3],
    /// The point in mesh coordinates.
    local: DVec3,
    /// The point in world coordinates.
    pub(super) point: Vec3,
    /// Error bound for the point; see [`SurfacePoint::error`](crate::geometry::SurfacePoint::error).
    pub(super) error: Vec3,
    /// Geometric normal; see [`SurfacePoint::normal`](crate::geometry::SurfacePoint::normal).
    pub(super) normal: Vec3,
    /// Barycentric coordinates.
    pub(super) barycentric: Vec3,
    /// Whether the point is so close to an edge that a ray from the point could start beyond a neighboring
    /// surface; see [`PlacedMesh::point_pulled_inside_triangle`].
    pub(super) is_near_edge: bool,
    /// Whether the barycentric coordinates may be too imprecise; see
    /// [`PlacedMesh::plane_intersection_if_more_precise`].
    is_coarse: bool,
}

impl TrianglePoint {
    /// Whether [`PlacedMesh::corrected_point_and_error`] may change the point.
    #[inline(always)]
    pub(super) fn may_need_correction(&self) -> bool {
        self.is_near_edge | self.is_coarse
    }
}

/// The point is computed from the ray if the triangle's corners are this many times farther from the scene's
/// origin than the point and the ray origin, because `f32` barycentric coordinates are then too imprecise.
const COARSE: f64 = 1024.0;

/// Minimum distance from the triangle's edges, in point errors. Rounding the point and offsetting it from the
/// surface require two errors.
pub(super) const EDGE_MARGIN: f64 = 4.0;

/// Whether a point with barycentric coordinate `weight` is near the opposite edge. `bound` is the squared
/// minimum distance divided by the squared length of the cross product of two edges.
#[inline(always)]
fn is_within_edge_margin(weight: f64, edge: DVec3, bound: f64) -> bool {
    (weight < 0.0) | (weight * weight < bound * edge.length_squared())
}

/// Maximum distance to move a point away from an edge, as a fraction of the triangle's height.
const MAX_EDGE_MARGIN: f64 = 0.125;

/// A mesh placement and the data needed to compute surface points.
#[derive(Clone, Copy)]
pub(super) struct PlacedMesh<P> {
    /// The mesh-to-world transform.
    pub(super) placement: P,
    /// Minimum distance from triangle edges, as a multiple of the point error, in mesh coordinates.
    pub(super) edge_margin: f64,
    /// Whether rays are traced against triangles whose corners were rounded after the transform.
    pub(super) has_rounded_corners: bool,
}

impl<P: MeshPlacement> PlacedMesh<P> {
    /// Error bound for a point on a triangle. Includes rounding of the point, of the next ray's origin in
    /// mesh coordinates, and of the numbers from which the point is computed. If all of these are near 0, the
    /// remaining error is the rounding of the `f64` arithmetic that determines the side of the triangle on
    /// which a point lies. In a merged tree, the rounding of the transformed corners is added.
    #[inline(always)]
    pub(super) fn point_error_bound(&self, point: Vec3, local: DVec3, [a, b, c]: [DVec3; 3]) -> Vec3 {
        let reach = self.placement.vector_abs_bound_to_world(local.abs());
        let parts = point.abs() + reach.as_vec3() + self.placement.mesh_origin_in_world().abs().as_vec3();
        let largest = self.placement.vector_abs_bound_to_world(a.abs().max(b.abs()).max(c.abs()));
        let of_double = absolute_f64_error_bound(largest.max_element());
        let error = parts * (2.0 * f32::EPSILON) + Vec3::splat(of_double + f32::MIN_POSITIVE);
        if self.has_rounded_corners {
            error + (largest + self.placement.mesh_origin_in_world().abs()).as_vec3() * f32::EPSILON
        } else {
            error
        }
    }

    /// Computes the point with barycentric coordinates `u` and `v` on the triangle with these corners, in
    /// mesh coordinates.
    #[inline(always)]
    pub(super) fn triangle_point(&self, corners: [Vec3; 3], [u, v]: [f32; 2]) -> TrianglePoint {
        let corners = corners.map(|corner| corner.as_dvec3());
        let [a, b, c] = corners;
        let (ab, ac) = (b - a, c - a);
        let local = a + ab * f64::from(u) + ac * f64::from(v);
        let point = self.placement.mesh_point_to_world(local).as_vec3();
        let error = self.point_error_bound(point, local, corners);
        let across = ab.cross(ac);
        // Compare squared distances from the edges with the squared minimum.
        let min_distance = self.required_edge_distance(error, corners);
        let bound = min_distance * min_distance / across.length_squared();
        let (u, v) = (f64::from(u), f64::from(v));
        let w = 1.0 - u - v;
        let is_near_edge = is_within_edge_margin(u, ac, bound)
            | is_within_edge_margin(v, ab, bound)
            | is_within_edge_margin(w, ac - ab, bound);
        TrianglePoint {
            corners,
            local,
            point,
            error,
            normal: self.placement.normal_to_world(across).normalize().as_vec3(),
            barycentric: Vec3::new(1.0 - u as f32 - v as f32, u as f32, v as f32),
            is_near_edge,
            is_coarse: f64::from(point.abs().max_element()) * COARSE
                < self.triangle_world_coordinate_bound(corners),
        }
    }

    /// Upper bound on the world coordinates of a triangle's corners.
    #[inline(always)]
    fn triangle_world_coordinate_bound(&self, [a, b, c]: [DVec3; 3]) -> f64 {
        let largest = self.placement.vector_abs_bound_to_world(a.abs().max(b.abs()).max(c.abs()));
        (largest + self.placement.mesh_origin_in_world().abs()).max_element()
    }

    /// Corrects an imprecise point by computing it from the ray or pulling it inside the triangle. Returns
    /// the point and its error.
    #[cold]
    #[inline(never)]
    pub(super) fn corrected_point_and_error(
        &self,
        facet: &TrianglePoint,
        ray: &RayF64,
        weights: [f32; 2],
    ) -> [Vec3; 2] {
        match self.plane_intersection_if_more_precise(facet, ray) {
            Some(corrected) => corrected,
            None if facet.is_near_edge => self.point_pulled_inside_triangle(facet, weights),
            None => [facet.point, facet.error],
        }
    }

    /// Whether [`PlacedMesh::corrected_point_and_error`] computes the point from the ray.
    #[inline(always)]
    pub(super) fn uses_point_from_ray(&self, facet: &TrianglePoint, ray: &RayF64) -> bool {
        facet.is_coarse && self.plane_intersection_if_more_precise(facet, ray).is_some()
    }

    /// Intersection of the ray with the triangle's plane, and its error. `None` unless the triangle's corners
    /// are much farther from the scene's origin than the point and the ray origin, and the intersection is
    /// close to the facet's point.
    fn plane_intersection_if_more_precise(&self, facet: &TrianglePoint, ray: &RayF64) -> Option<[Vec3; 2]> {
        if !facet.is_coarse {
            return None;
        }
        let [a, b, c] = facet.corners;
        let largest = self.triangle_world_coordinate_bound(facet.corners);
        let normal = self.placement.normal_to_world((b - a).cross(c - a));
        let t = (self.placement.mesh_point_to_world(a) - ray.origin).dot(normal) / ray.direction.dot(normal);
        let point = ray.at(t);
        let reach = ray.origin.abs().max(point.abs()).max_element();
        let apart = (point - facet.point.as_dvec3()).abs().max_element();
        let is_better = reach * COARSE < largest && apart <= largest * f64::from(32.0 * f32::EPSILON);
        let rounded = point.as_vec3();
        is_better.then(|| [rounded, self.point_error_bound(rounded, facet.local, facet.corners)])
    }

    /// Minimum distance from a point to its triangle's edges, in mesh coordinates: the point's error plus the
    /// error of testing a neighbor of the same size.
    #[inline(always)]
    fn required_edge_distance(&self, error: Vec3, [a, b, c]: [DVec3; 3]) -> f64 {
        let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
        self.edge_margin * f64::from(error.max_element()) + EDGE_MARGIN * f64::from(f32::EPSILON) * largest
    }

    /// Moves a point near an edge into the triangle, to at least the minimum distance from the edge. Without
    /// this, a ray could start behind an adjacent wall and escape from a closed room. Returns the point and
    /// its error.
    fn point_pulled_inside_triangle(&self, facet: &TrianglePoint, [u, v]: [f32; 2]) -> [Vec3; 2] {
        let [a, b, c] = facet.corners;
        let (ab, ac) = (b - a, c - a);
        let least = self.required_edge_distance(facet.error, facet.corners) / ab.cross(ac).length();
        let [of_u, of_v, of_w] = [ac, ab, ac - ab].map(|edge| (least * edge.length()).min(MAX_EDGE_MARGIN));
        let (u, v) = (f64::from(u).max(of_u), f64::from(v).max(of_v));
        let excess = (u + v - (1.0 - of_w)).max(0.0);
        // Reduce the coordinate that is farther above its minimum.
        let (u, v) = if u - of_u > v - of_v { (u - excess, v) } else { (u, v - excess) };
        let local = a + ab * u + ac * v;
        let point = self.placement.mesh_point_to_world(local).as_vec3();
        if !point.is_finite() {
            return [facet.point, facet.error];
        }
        [point, self.point_error_bound(point, local, facet.corners)]
    }

    /// Interpolated shading normal of a smooth mesh, flipped to the side of the geometric normal.
    #[inline(always)]
    pub(super) fn shading_normal(&self, facet: &TrianglePoint, [a, b, c]: &[Vec3; 3]) -> Vec3 {
        let TrianglePoint { normal, barycentric, .. } = *facet;
        let interpolated = *a * barycentric.x + *b * barycentric.y + *c * barycentric.z;
        let bent = self.placement.normal_to_world(interpolated.as_dvec3()).as_vec3();
        let reciprocal = bent.length_recip();
        let is_told = reciprocal.is_finite() & (reciprocal > 0.0);
        let bent = bent * reciprocal;
        let bent = if bent.dot(normal) < 0.0 { -bent } else { bent };
        let choose = |bent: f32, normal: f32| if is_told { bent } else { normal };
        Vec3::new(choose(bent.x, normal.x), choose(bent.y, normal.y), choose(bent.z, normal.z))
    }

    /// Shadow-ray origin on a smooth mesh: the point, lifted toward the viewer onto the vertices' tangent
    /// planes above it. This prevents facets from shadowing points that are lit according to the shading
    /// normals (Hanika, *Hacking the Shadow Terminator*, Ray Tracing Gems II, chapter 4).
    #[inline(always)]
    pub(super) fn lifted_shadow_origin(
        &self,
        facet: &TrianglePoint,
        normals: &[Vec3; 3],
        direction: DVec3,
    ) -> Vec3 {
        let point = self.placement.mesh_point_to_world(facet.local);
        let normal = facet.normal.as_dvec3();
        let side = if normal.dot(direction) > 0.0 { -1.0 } else { 1.0 };
        let weights = facet.barycentric.to_array();
        let mut lifted = DVec3::ZERO;
        for i in 0..3 {
            let own = self.placement.normal_to_world(normals[i].as_dvec3());
            let reciprocal = own.length_recip();
            let is_told = reciprocal.is_finite() & (reciprocal > 0.0);
            let own = own * if is_told { reciprocal } else { 0.0 };
            let own = own * side * if own.dot(normal) < 0.0 { -1.0 } else { 1.0 };
            let height = (self.placement.mesh_point_to_world(facet.corners[i]) - point).dot(own);
            lifted += own * (f64::from(weights[i]) * if height > 0.0 { height } else { 0.0 });
        }
        (point + lifted).as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::signed_number_generator as random;
    use crate::math::transform::Transform;
    use crate::world::placement::IdentityPlacement;

    #[test]
    fn untransformed_placement_matches_identity() {
        let mut next = random(17);
        for _ in 0..10_000 {
            // Zeros of both signs are common in architectural models.
            let mut number = || {
                let number = f64::from(next());
                if number.abs() < 0.2 { 0.0 * number } else { number }
            };
            let at = DVec3::new(number(), number(), number());
            let (map, here) = (&Transform::IDENTITY, IdentityPlacement);
            let bits = |numbers: DVec3| numbers.to_array().map(f64::to_bits);
            assert_eq!(bits(MeshPlacement::mesh_point_to_world(map, at)), bits(here.mesh_point_to_world(at)));
            assert_eq!(
                MeshPlacement::vector_abs_bound_to_world(map, at.abs()),
                here.vector_abs_bound_to_world(at.abs())
            );
            assert_eq!(bits(MeshPlacement::normal_to_world(map, at)), bits(here.normal_to_world(at)));
            assert_eq!(map.mesh_origin_in_world(), here.mesh_origin_in_world());
        }
    }
}
