//! Shapes under an affine transform, such as ellipsoids and sheared boxes.
//!
//! Rays are transformed to the shape's own coordinates in double precision. An affine transform preserves the
//! ray parameter t, so hits are the same in both coordinate systems.

use super::local_geometry::{FlatOrRoundExtent, FlatPolygon, NearbyGeometry, NearestSurface};
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64};
use super::{Aabb, RayF64, Shape, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::transform::Transform;
use crate::math::{DVec2, DVec3, Vec2};

/// A shape and the transform from its own coordinates to world coordinates. The front of the shape remains
/// the front, even if the transform mirrors it.
#[derive(Clone, Debug, PartialEq)]
pub struct TransformedShape {
    /// The shape in its own coordinates. Results are most precise if it is close to their origin.
    pub shape: Shape,
    /// Transform to world coordinates.
    pub to_world: Transform,
    /// Factor from the volume in the shape's coordinates to the volume in the world.
    pub volume_scale: f64,
    /// Bound on the condition number of the transform in the maximum norm.
    condition: f64,
    /// Bound on the factor by which the transform enlarges a vector's largest coordinate.
    stretch: f64,
    /// Bound on the factor by which the inverse lengthens vectors.
    inverse_stretch: f64,
}

impl TransformedShape {
    /// Transforms a shape.
    pub fn new(shape: Shape, to_world: Transform) -> Self {
        let linear = Transform { translation: DVec3::ZERO, ..to_world };
        // The absolute row sums of the inverse. Multiplied by |M|, they bound the condition number.
        let inverse = Transform { linear: to_world.inverse_linear, ..linear };
        let sums = inverse.transform_abs_bound(DVec3::ONE);
        Self {
            shape,
            to_world,
            volume_scale: to_world.linear.determinant().abs(),
            condition: linear.transform_abs_bound(sums).max_element(),
            stretch: linear.transform_abs_bound(DVec3::ONE).max_element(),
            inverse_stretch: to_world.max_inverse_stretch(),
        }
    }

    fn ray_to_local(&self, ray: &RayF64) -> RayF64 {
        RayF64 {
            origin: self.to_world.inverse_point(ray.origin),
            direction: self.to_world.inverse_vector(ray.direction),
            ..*ray
        }
    }

    /// Converts an upper bound on lengths in the shape's coordinates to a bound on lengths in the world. The
    /// result also covers the rounding errors of the transform and its inverse, which enlarge relative errors
    /// by up to the condition number.
    pub fn length_bound_to_world(&self, reach: f64) -> f64 {
        (1.0 + self.condition) * self.stretch * reach + self.to_world.translation.abs().max_element()
    }

    /// Finds the nearest hit.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        self.shape.intersect(&self.ray_to_local(ray))
    }

    /// Surface point at a hit.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let local = self.shape.surface_point_at_hit(&self.ray_to_local(ray), hit);
        let SurfacePointF64 { point, normal, reach } = self.surface_point_f64(ray, hit);
        let [dpdu, dpdv] = [local.dpdu, local.dpdv].map(|edge| self.to_world.vector(edge.as_dvec3()));
        let SurfacePoint { uv, barycentric, .. } = local;
        let surface = SurfacePoint::from_f64(point, normal, uv.as_vec2(), dpdu, dpdv, reach);
        SurfacePoint { uv, barycentric, ..surface }
    }

    /// Bounding box, or `None` if the shape is infinite.
    pub fn bounds(&self) -> Option<Aabb> {
        if let Shape::Sphere(sphere) = &self.shape {
            let rows = self.to_world.linear.transpose();
            let extent = DVec3::from_array(std::array::from_fn(|axis| rows.col(axis).length()));
            let center = self.to_world.point(sphere.center);
            return Some(self.box_enlarged_for_rounding(center, extent * sphere.radius));
        }
        let bounds = self.shape.bounds()?;
        let half = bounds.extent().as_dvec3() * 0.5;
        let center = (bounds.min.as_dvec3() + bounds.max.as_dvec3()) * 0.5;
        let extent = self.to_world.transform_abs_bound(half);
        Some(self.box_enlarged_for_rounding(self.to_world.point(center), extent))
    }

    /// The box with this center and half extent, enlarged to account for rounding errors.
    fn box_enlarged_for_rounding(&self, center: DVec3, extent: DVec3) -> Aabb {
        let size = self.condition * (center - self.to_world.translation).abs() + extent + center.abs();
        let extent = extent + size * (16.0 * f64::EPSILON);
        Aabb::from_points_f64([center - extent, center + extent])
    }

    /// Areas of the parts in the shape's coordinates. [`TransformedShape::area_scale_for_world_normal`]
    /// converts areas to the world.
    pub fn local_part_areas(&self) -> Vec<f64> {
        self.shape.local_part_areas()
    }

    /// Samples a point in the world. It is distributed uniformly over a part's area in the shape's
    /// coordinates.
    pub fn sample_point_on_part(&self, part: u32, u: Vec2) -> SurfaceSample {
        let SurfaceSample { point, normal } = self.shape.sample_point_on_part(part, u);
        SurfaceSample { point: self.to_world.point(point), normal: self.to_world.normal(normal).normalize() }
    }

    /// Factor from areas in the shape's coordinates to areas in the world, at a point whose unit normal in
    /// the world is `normal`: |det M|·|M⁻ᵀn|, where n is the normal in the shape's coordinates.
    pub fn area_scale_for_world_normal(&self, normal: DVec3) -> f64 {
        self.volume_scale / (self.to_world.linear.transpose() * normal).length()
    }

    /// The centroid of the original shape, transformed to world space.
    pub fn centroid(&self) -> DVec3 {
        self.to_world.point(self.shape.centroid())
    }

    /// Whether a point is inside.
    pub fn volume_contains(&self, point: DVec3) -> bool {
        self.shape.encloses_point(self.to_world.inverse_point(point))
    }

    /// [`Shape::encloses_points_if_closed`] for the transformed shape.
    pub fn encloses_points_if_closed<const COUNT: usize>(
        &self,
        points: [DVec3; COUNT],
    ) -> Option<[bool; COUNT]> {
        self.shape.encloses_points_if_closed(points.map(|point| self.to_world.inverse_point(point)))
    }

    /// Texture coordinates of a point on the surface.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        self.shape.uv_at_point(self.to_world.inverse_point(point))
    }

    /// Mean curvature at a point on a part. With principal curvatures k₁ and k₂ in the shape's coordinates
    /// and unit tangents t₁ and t₂ in their directions, it is ½·|det M|·(k₁·|M·t₂|² + k₂·|M·t₁|²) / |M·t₁ ×
    /// M·t₂|³: the transform multiplies the second fundamental form by |det M| / |M·t₁ × M·t₂|, and tangents
    /// have the lengths |M·tᵢ|.
    pub fn mean_curvature(&self, part: u32, point: DVec3) -> f64 {
        let local = self.to_world.inverse_point(point);
        let mean = self.shape.mean_curvature(part, local);
        let Some((bend, tangents)) =
            self.shape.meridian_curvature_and_tangents(local).filter(|_| mean != 0.0)
        else {
            return 0.0;
        };
        let [along, around] = tangents.map(|tangent| self.to_world.vector(tangent));
        let forms = bend * around.length_squared() + (2.0 * mean - bend) * along.length_squared();
        let area = along.cross(around).length();
        0.5 * self.volume_scale * forms / (area * area * area)
    }

    /// The polygons or the surface of the shape near a point, for density estimation. The distance is a lower
    /// bound.
    pub fn polygons_or_surface_near(&self, point: DVec3) -> NearbyGeometry {
        let ground_to_world = |ground: NearestSurface| match ground.extent {
            FlatOrRoundExtent::Flat(extent) => {
                let normal = self.to_world.normal(ground.normal);
                let length = normal.length();
                Some(NearestSurface {
                    normal: normal / length,
                    height: ground.height / length,
                    extent: FlatOrRoundExtent::Flat(extent / self.inverse_stretch),
                })
            }
            FlatOrRoundExtent::Round(_) => None,
        };
        match self.shape.polygons_or_surface_near(self.to_world.inverse_point(point)) {
            NearbyGeometry::Polygons(count) => NearbyGeometry::Polygons(count),
            NearbyGeometry::Surface { distance, ground } => NearbyGeometry::Surface {
                distance: distance / self.inverse_stretch,
                ground: ground.and_then(ground_to_world),
            },
        }
    }

    /// [`Shape::nth_polygon_face`] in world coordinates.
    pub fn nth_polygon_face(&self, number: u32) -> Option<FlatPolygon> {
        let mut corners: FlatPolygon =
            self.shape.nth_polygon_face(number)?.iter().map(|corner| self.to_world.point(*corner)).collect();
        if self.to_world.flips_handedness() {
            corners.reverse();
        }
        Some(corners)
    }

    /// [`Shape::is_locally_thicker_than`] in world coordinates.
    pub fn is_locally_thicker_than(&self, point: DVec3, distance: f64) -> bool {
        self.shape
            .is_locally_thicker_than(self.to_world.inverse_point(point), distance * self.inverse_stretch)
    }

    /// Projected area. The transform maps the area vectors A to |det M|·M⁻ᵀ·A.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        let direction = self.to_world.inverse_vector(direction);
        let length = direction.length();
        self.volume_scale * length * self.shape.projected_area(direction / length)
    }
}

impl SurfacePointsInF64 for TransformedShape {
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let SurfacePointF64 { point, normal, reach } =
            self.shape.surface_point_f64(&self.ray_to_local(ray), hit);
        SurfacePointF64 {
            point: self.to_world.point(point),
            normal: self.to_world.normal(normal.normalize()),
            reach: self.length_bound_to_world(reach),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::geometry::cylinder::Cylinder;
    use crate::geometry::sphere::Sphere;
    use crate::geometry::torus::Torus;
    use crate::math::DMat3;
    use crate::math::random::unit_generator;

    /// Scales, shears, and rotates a shape. The transform also mirrors the shape if `mirror` is −1, but not
    /// if it is 1.
    pub(crate) fn sheared(shape: Shape, mirror: f64) -> Shape {
        let [x, y] = [DVec3::new(1.2, 0.1, -0.2), DVec3::new(0.3, 0.8, 0.1)];
        let linear = DMat3::from_cols(x, y, DVec3::new(-0.1, 0.2, 0.9) * mirror);
        let to_world = Transform::from_mat3_translation(linear, DVec3::new(0.1, 0.2, -0.3));
        Shape::Transformed(Box::new(TransformedShape::new(shape, to_world)))
    }

    /// Area of a part, computed with the midpoint rule.
    pub(crate) fn part_area_by_midpoint_rule(shape: &Shape, part: u32) -> f64 {
        let side = 256_u32;
        let at = |i: u32| (Vec2::new((i % side) as f32, (i / side) as f32) + 0.5) / side as f32;
        let scale =
            |i: u32| shape.area_scale_for_world_normal(shape.sample_point_on_part(part, at(i)).normal);
        let mean = (0..side * side).map(scale).sum::<f64>() / f64::from(side * side);
        mean * shape.local_part_areas()[part as usize]
    }

    fn transformed_shape(shape: Shape, scale: DVec3, degrees: DVec3, translation: DVec3) -> Shape {
        let to_world = Transform::scale_rotate_translate(scale, degrees, translation);
        Shape::Transformed(Box::new(TransformedShape::new(shape, to_world)))
    }

    #[test]
    fn hits_are_within_their_error_bounds() {
        // Test ellipsoids with grazing rays, rays from far away, and rays from inside. The distance from an
        // ellipsoid is |f|/|∇f| up to second order, for f = |x|² − 1 in the coordinates of the unit sphere.
        let mut next = unit_generator(11);
        let mut number = || f64::from(next()) * 2.0 - 1.0;
        let mut counts = [0; 3];
        for i in 0..6000 {
            let scale = DVec3::new(1.0, 10.0_f64.powf(number()), 10.0_f64.powf(number()));
            let degrees = DVec3::new(number(), number(), number()) * 180.0;
            let center = DVec3::new(number(), number(), number()) * 100.0;
            let unit = Shape::Sphere(Sphere { center: DVec3::ZERO, radius: 1.0 });
            let shape = transformed_shape(unit, scale, degrees, center);
            let Shape::Transformed(own) = &shape else { unreachable!() };
            let on_unit = || DVec3::new(number(), number(), number()).normalize();
            let [a, b] = {
                let mut on_unit = on_unit;
                [on_unit(), on_unit()]
            };
            let to = own.to_world.point(a);
            let from = match i % 3 {
                // Almost a tangent.
                0 => own.to_world.point(a + a.cross(b).normalize() * 3.0 + a * 1e-6),
                1 => to + (to - center).normalize() * 1e5,
                _ => own.to_world.point(b * 0.7),
            };
            let from = from.as_vec3().as_dvec3();
            let direction = (to - from).as_vec3().as_dvec3();
            let ray = RayF64 { origin: from, direction, t_max: f64::INFINITY };
            let Some(hit) = shape.intersect(&ray) else { continue };
            let surface = shape.surface_point_at_hit(&ray, &hit);
            let local = own.to_world.inverse_point(surface.point.as_dvec3());
            let gradient = own.to_world.normal(local * 2.0);
            let distance = (local.length_squared() - 1.0).abs() / gradient.length();
            let bound = surface.error.as_dvec3().dot((gradient / gradient.length()).abs());
            assert!(distance <= bound, "{shape:?}, {ray:?}: {distance} > {bound}");
            counts[i % 3] += 1;
            // A ray that leaves the surface must not hit it again at its origin.
            let out = surface.normal;
            let origin = crate::geometry::ray::offset_origin(surface.point, surface.error, out, out);
            let leaving = RayF64 { origin: origin.as_dvec3(), direction: out.as_dvec3(), ..ray };
            assert_eq!(shape.intersect(&leaving), None, "{shape:?}, {leaving:?}");
        }
        assert!(counts.iter().all(|count| *count > 800), "{counts:?}");
    }

    #[test]
    fn area_scales_integrate_to_known_areas() {
        // A prolate spheroid with semi-axes a and c: 2π·a²·(1 + c·arcsin(e)/(a·e)), where e² = 1 − a²/c².
        let unit = Shape::Sphere(Sphere { center: DVec3::ZERO, radius: 1.0 });
        let spheroid =
            transformed_shape(unit, DVec3::new(1.0, 3.0, -1.0), DVec3::new(20.0, 50.0, 70.0), DVec3::ONE);
        let e = (1.0 - 1.0 / 9.0_f64).sqrt();
        let expected = std::f64::consts::TAU * (1.0 + 3.0 * e.asin() / e);
        assert!(
            (part_area_by_midpoint_rule(&spheroid, 0) / expected - 1.0).abs() < 1e-4,
            "{} {expected}",
            part_area_by_midpoint_rule(&spheroid, 0)
        );
        // A cylinder stretched across its axis. The midpoint rule gives the circumference of the elliptical
        // cross section.
        let tube = Shape::Cylinder(Cylinder::new(DVec3::ZERO, DVec3::Z * 2.0, 1.0, true));
        let tube = transformed_shape(tube, DVec3::new(4.0, 1.0, 1.0), DVec3::ZERO, DVec3::ZERO);
        let step = |i: u32| {
            let (sin, cos) = (std::f64::consts::TAU * (f64::from(i) + 0.5) / 10_000.0).sin_cos();
            DVec2::new(4.0 * sin, cos).length() * std::f64::consts::TAU / 10_000.0
        };
        let ellipse: f64 = (0..10_000).map(step).sum();
        assert!((part_area_by_midpoint_rule(&tube, 0) / (2.0 * ellipse) - 1.0).abs() < 1e-4);
        assert!((part_area_by_midpoint_rule(&tube, 1) / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn identity_gives_the_same_hits() {
        let mut next = unit_generator(5);
        let mut number = || f64::from(next()) * 2.0 - 1.0;
        let torus = Shape::Torus(Torus::new(DVec3::ZERO, DVec3::new(0.3, 1.0, -0.2), 0.7, 0.25));
        let same = Shape::Transformed(Box::new(TransformedShape::new(torus.clone(), Transform::IDENTITY)));
        let mut count = 0;
        for _ in 0..1000 {
            let origin = DVec3::new(number(), number(), number()) * 3.0;
            let direction = DVec3::new(number(), number(), number()) * 0.5 - origin;
            let ray = RayF64 { origin, direction, t_max: f64::INFINITY };
            let hit = torus.intersect(&ray);
            assert_eq!(hit, same.intersect(&ray));
            if let Some(hit) = hit {
                let [a, b] = [&torus, &same].map(|shape| shape.surface_point_at_hit(&ray, &hit));
                let parts = |at: SurfacePoint| (at.point, at.normal, at.uv, at.dpdu, at.dpdv);
                assert_eq!(parts(a), parts(b));
                count += 1;
            }
        }
        assert!(count > 200, "{count}");
    }
}
