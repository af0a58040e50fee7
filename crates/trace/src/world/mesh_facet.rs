//! Points of the triangles of an instance: where, how exactly, and by which normals.

use super::placement::Placement;
use crate::geometry::RayF64;
use crate::geometry::surface::double_error;
use crate::math::{DVec3, Vec3};

/// A point of a triangle of an instance.
pub(super) struct Facet {
    /// The triangle's corners, in the mesh's coordinates.
    pub(super) corners: [DVec3; 3],
    /// The point in the mesh's coordinates.
    local: DVec3,
    /// The point in the world.
    pub(super) point: Vec3,
    /// [`SurfacePoint::error`].
    pub(super) error: Vec3,
    /// [`SurfacePoint::normal`].
    pub(super) normal: Vec3,
    /// Weights of the corners.
    pub(super) barycentric: Vec3,
    /// Whether a ray that starts here may be beyond a neighbour, see [`PlacedMesh::drawn_in`].
    pub(super) is_beside_edge: bool,
    /// Whether the weights may be too coarse for the point, see [`PlacedMesh::on_ray`].
    is_coarse: bool,
}

impl Facet {
    /// Whether [`PlacedMesh::corrected`] may change the point.
    #[inline(always)]
    pub(super) fn is_doubtful(&self) -> bool {
        self.is_beside_edge | self.is_coarse
    }
}

/// Corners of a triangle this many times farther away than the point and the start of the ray make the weights of `f32` too coarse:
/// the point is then computed from the ray.
const COARSE: f64 = 1024.0;

/// Errors of a point between it and the edges of its triangle: rounding a point and moving it off the surface takes two of them.
pub(super) const ASIDE: f64 = 4.0;

/// Whether a point with this weight of a corner is near the edge across from it; `bound` is the square of the least distance over
/// that of the cross product of two edges.
#[inline(always)]
fn is_near(weight: f64, edge: DVec3, bound: f64) -> bool {
    (weight < 0.0) | (weight * weight < bound * edge.length_squared())
}

/// Most of a triangle's height between a point and an edge.
const MOST_ASIDE: f64 = 0.125;

/// A placed mesh, as far as its triangles need it.
#[derive(Clone, Copy)]
pub(super) struct PlacedMesh<P> {
    /// The placement.
    pub(super) placement: P,
    /// Factor from errors of points to the least distance from edges, in the mesh's coordinates.
    pub(super) aside: f64,
    /// Whether rays hit triangles whose corners were rounded after they were placed.
    pub(super) has_rounded_corners: bool,
}

impl<P: Placement> PlacedMesh<P> {
    /// Rounding of a point of a triangle, of the next ray's origin in the mesh's coordinates, and of the numbers from which the
    /// point is computed. If all of these are near 0, the rounding of double precision counts, by which the sides of the
    /// triangle are decided. In a tree over several meshes, the rounding of the corners there counts too.
    #[inline(always)]
    pub(super) fn error(&self, point: Vec3, local: DVec3, [a, b, c]: [DVec3; 3]) -> Vec3 {
        let reach = self.placement.reach(local.abs());
        let parts = point.abs() + reach.as_vec3() + self.placement.shift().abs().as_vec3();
        let greatest = self.placement.reach(a.abs().max(b.abs()).max(c.abs()));
        let of_double = double_error(greatest.max_element());
        let error = parts * (2.0 * f32::EPSILON) + Vec3::splat(of_double + f32::MIN_POSITIVE);
        if self.has_rounded_corners {
            error + (greatest + self.placement.shift().abs()).as_vec3() * f32::EPSILON
        } else {
            error
        }
    }

    /// A point of a triangle, by its corners in the mesh's coordinates and the weights of the second and the third.
    #[inline(always)]
    pub(super) fn facet(&self, corners: [Vec3; 3], [u, v]: [f32; 2]) -> Facet {
        let corners = corners.map(|corner| corner.as_dvec3());
        let [a, b, c] = corners;
        let (ab, ac) = (b - a, c - a);
        let local = a + ab * f64::from(u) + ac * f64::from(v);
        let point = self.placement.point(local).as_vec3();
        let error = self.error(point, local, corners);
        let across = ab.cross(ac);
        // Compare the squares of distances from the edges with those of the least distance.
        let least = self.least_aside(error, corners);
        let bound = least * least / across.length_squared();
        let (u, v) = (f64::from(u), f64::from(v));
        let w = 1.0 - u - v;
        let is_beside_edge = is_near(u, ac, bound) | is_near(v, ab, bound) | is_near(w, ac - ab, bound);
        Facet {
            corners,
            local,
            point,
            error,
            normal: self.placement.normal(across).normalize().as_vec3(),
            barycentric: Vec3::new(1.0 - u as f32 - v as f32, u as f32, v as f32),
            is_beside_edge,
            is_coarse: f64::from(point.abs().max_element()) * COARSE < self.greatest(corners),
        }
    }

    /// The greatest coordinate of a triangle in the scene, or more.
    #[inline(always)]
    fn greatest(&self, [a, b, c]: [DVec3; 3]) -> f64 {
        let greatest = self.placement.reach(a.abs().max(b.abs()).max(c.abs()));
        (greatest + self.placement.shift().abs()).max_element()
    }

    /// The point of a doubtful facet and its error: from the ray, or drawn in from an edge.
    #[cold]
    #[inline(never)]
    pub(super) fn corrected(&self, facet: &Facet, ray: &RayF64, weights: [f32; 2]) -> [Vec3; 2] {
        match self.on_ray(facet, ray) {
            Some(corrected) => corrected,
            None if facet.is_beside_edge => self.drawn_in(facet, weights),
            None => [facet.point, facet.error],
        }
    }

    /// Whether the point of a facet is computed from the ray.
    #[inline(always)]
    pub(super) fn is_on_ray(&self, facet: &Facet, ray: &RayF64) -> bool {
        facet.is_coarse && self.on_ray(facet, ray).is_some()
    }

    /// The point where the ray meets the plane of a triangle much larger than the distances from the scene's origin to the point and to
    /// the start of the ray. `None` for other triangles.
    fn on_ray(&self, facet: &Facet, ray: &RayF64) -> Option<[Vec3; 2]> {
        if !facet.is_coarse {
            return None;
        }
        let [a, b, c] = facet.corners;
        let greatest = self.greatest(facet.corners);
        let normal = self.placement.normal((b - a).cross(c - a));
        let t = (self.placement.point(a) - ray.origin).dot(normal) / ray.direction.dot(normal);
        let point = ray.at(t);
        let reach = ray.origin.abs().max(point.abs()).max_element();
        let apart = (point - facet.point.as_dvec3()).abs().max_element();
        let is_better = reach * COARSE < greatest && apart <= greatest * f64::from(32.0 * f32::EPSILON);
        let rounded = point.as_vec3();
        is_better.then(|| [rounded, self.error(rounded, facet.local, facet.corners)])
    }

    /// Least distance, in the mesh's coordinates, of a point from the edges of its triangle: errors of the point, and of the test of
    /// a neighbour as large as the triangle.
    #[inline(always)]
    fn least_aside(&self, error: Vec3, [a, b, c]: [DVec3; 3]) -> f64 {
        let greatest = a.abs().max(b.abs()).max(c.abs()).max_element();
        self.aside * f64::from(error.max_element()) + ASIDE * f64::from(f32::EPSILON) * greatest
    }

    /// A point beside an edge, and its error, drawn into the triangle until the errors are aside. Else a ray could start beyond the
    /// wall that meets this one there, and leave a closed room.
    fn drawn_in(&self, facet: &Facet, [u, v]: [f32; 2]) -> [Vec3; 2] {
        let [a, b, c] = facet.corners;
        let (ab, ac) = (b - a, c - a);
        let least = self.least_aside(facet.error, facet.corners) / ab.cross(ac).length();
        let [of_u, of_v, of_w] = [ac, ab, ac - ab].map(|edge| (least * edge.length()).min(MOST_ASIDE));
        let (u, v) = (f64::from(u).max(of_u), f64::from(v).max(of_v));
        let excess = (u + v - (1.0 - of_w)).max(0.0);
        // Lower the weight that has more to give.
        let (u, v) = if u - of_u > v - of_v { (u - excess, v) } else { (u, v - excess) };
        let local = a + ab * u + ac * v;
        let point = self.placement.point(local).as_vec3();
        if !point.is_finite() {
            return [facet.point, facet.error];
        }
        [point, self.error(point, local, facet.corners)]
    }

    /// Shading normal of a smooth mesh: interpolated between those of the corners, on the side of the geometric normal.
    #[inline(always)]
    pub(super) fn shading_normal(&self, facet: &Facet, [a, b, c]: &[Vec3; 3]) -> Vec3 {
        let Facet { normal, barycentric, .. } = *facet;
        let interpolated = *a * barycentric.x + *b * barycentric.y + *c * barycentric.z;
        let bent = self.placement.normal(interpolated.as_dvec3()).as_vec3();
        let reciprocal = bent.length_recip();
        let is_told = reciprocal.is_finite() & (reciprocal > 0.0);
        let bent = bent * reciprocal;
        let bent = if bent.dot(normal) < 0.0 { -bent } else { bent };
        let choose = |bent: f32, normal: f32| if is_told { bent } else { normal };
        Vec3::new(choose(bent.x, normal.x), choose(bent.y, normal.y), choose(bent.z, normal.z))
    }

    /// Shadow point of a smooth mesh: the point, lifted towards the viewer to the tangent planes of the vertices that are above
    /// it. Thereby the facets of a smooth-shaded surface do not shadow what its normals say is lit (Hanika, *Hacking the Shadow
    /// Terminator*, Ray Tracing Gems II, chapter 4).
    #[inline(always)]
    pub(super) fn shadow_point(&self, facet: &Facet, normals: &[Vec3; 3], direction: DVec3) -> Vec3 {
        let point = self.placement.point(facet.local);
        let normal = facet.normal.as_dvec3();
        let side = if normal.dot(direction) > 0.0 { -1.0 } else { 1.0 };
        let weights = facet.barycentric.to_array();
        let mut lifted = DVec3::ZERO;
        for i in 0..3 {
            let own = self.placement.normal(normals[i].as_dvec3());
            let reciprocal = own.length_recip();
            let is_told = reciprocal.is_finite() & (reciprocal > 0.0);
            let own = own * if is_told { reciprocal } else { 0.0 };
            let own = own * side * if own.dot(normal) < 0.0 { -1.0 } else { 1.0 };
            let height = (self.placement.point(facet.corners[i]) - point).dot(own);
            lifted += own * (f64::from(weights[i]) * if height > 0.0 { height } else { 0.0 });
        }
        (point + lifted).as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::signed as random;
    use crate::math::transform::Transform;
    use crate::world::placement::Unmoved;

    #[test]
    fn a_mesh_that_is_not_moved_is_placed_as_by_the_map_that_changes_nothing() {
        let mut next = random(17);
        for _ in 0..10_000 {
            // Zeros of both signs are common among walls.
            let mut number = || {
                let number = f64::from(next());
                if number.abs() < 0.2 { 0.0 * number } else { number }
            };
            let at = DVec3::new(number(), number(), number());
            let (map, here) = (&Transform::IDENTITY, Unmoved);
            let bits = |numbers: DVec3| numbers.to_array().map(f64::to_bits);
            assert_eq!(bits(Placement::point(map, at)), bits(here.point(at)));
            assert_eq!(Placement::reach(map, at.abs()), here.reach(at.abs()));
            assert_eq!(bits(Placement::normal(map, at)), bits(here.normal(at)));
            assert_eq!(map.shift(), here.shift());
        }
    }
}
