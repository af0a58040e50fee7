//! Shapes under an affine transform, such as ellipsoids and sheared boxes.
//!
//! Rays are transformed to the shape's own coordinates in double precision. An affine transform preserves the
//! ray parameter t, so hits are the same in both coordinate systems.

use super::local_geometry::{FlatPolygon, LocalGeometry, NearestSurface, SurfaceExtent};
use super::surface_packet::{SurfaceF64, SurfacePointF64};
use super::{Aabb, AreaPoint, RayF64, Shape, ShapeHit, SurfacePoint};
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
    /// Bound on the factor by which the transform enlarges the greatest coordinate.
    stretch: f64,
    /// Bound on the factor by which the inverse lengthens vectors.
    inverse_stretch: f64,
}

impl TransformedShape {
    /// Transforms a shape.
    pub fn new(shape: Shape, to_world: Transform) -> Self {
        let linear = Transform { translation: DVec3::ZERO, ..to_world };
        // The sums of the magnitudes in the rows of the inverse, and then of their product with the map.
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

    /// Upper bound on the magnitudes of lengths in the world, for lengths in the shape's coordinates. Includes
    /// the rounding errors of the transform and of its inverse: relative to the lengths, they are larger by
    /// up to the condition number.
    pub fn reach_to_world(&self, reach: f64) -> f64 {
        (1.0 + self.condition) * self.stretch * reach + self.to_world.translation.abs().max_element()
    }

    /// Finds the nearest hit.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        self.shape.intersect(&self.ray_to_local(ray))
    }

    /// Surface point at a hit.
    pub fn surface_point(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let local = self.shape.surface_point(&self.ray_to_local(ray), hit);
        let SurfacePointF64 { point, normal, reach } = self.surface_point_f64(ray, hit);
        let [dpdu, dpdv] = [local.dpdu, local.dpdv].map(|edge| self.to_world.vector(edge.as_dvec3()));
        let SurfacePoint { uv, barycentric, .. } = local;
        let surface = SurfacePoint::from_f64(point, normal, uv.as_vec2(), dpdu, dpdv, reach);
        SurfacePoint { uv, barycentric, ..surface }
    }

    /// Bounding box. `None` if the shape is infinite.
    pub fn bounds(&self) -> Option<Aabb> {
        if let Shape::Sphere(sphere) = &self.shape {
            let rows = self.to_world.linear.transpose();
            let extent = DVec3::from_array(std::array::from_fn(|axis| rows.col(axis).length()));
            return Some(self.rounded_bounds(self.to_world.point(sphere.center), extent * sphere.radius));
        }
        let bounds = self.shape.bounds()?;
        let half = bounds.extent().as_dvec3() * 0.5;
        let center = (bounds.min.as_dvec3() + bounds.max.as_dvec3()) * 0.5;
        Some(self.rounded_bounds(self.to_world.point(center), self.to_world.transform_abs_bound(half)))
    }

    /// The box around a center, enlarged by the rounding errors.
    fn rounded_bounds(&self, center: DVec3, extent: DVec3) -> Aabb {
        let size = self.condition * (center - self.to_world.translation).abs() + extent + center.abs();
        let extent = extent + size * (16.0 * f64::EPSILON);
        Aabb::from_points_f64([center - extent, center + extent])
    }

    /// Areas of the parts in the shape's coordinates. Multiply areas by [`TransformedShape::area_scale`].
    pub fn part_areas(&self) -> Vec<f64> {
        self.shape.part_areas()
    }

    /// Samples a point uniformly over the area of a part in the shape's coordinates.
    pub fn sample(&self, part: u32, u: Vec2) -> AreaPoint {
        let AreaPoint { point, normal } = self.shape.sample(part, u);
        AreaPoint { point: self.to_world.point(point), normal: self.to_world.normal(normal).normalize() }
    }

    /// Factor from areas in the shape's coordinates to areas in the world, at a point with this unit normal in
    /// the world: |det M|·|M⁻ᵀn|, where n is the normal in the shape's coordinates.
    pub fn area_scale(&self, normal: DVec3) -> f64 {
        self.volume_scale / (self.to_world.linear.transpose() * normal).length()
    }

    /// Image of the centroid in the shape's coordinates.
    pub fn centroid(&self) -> DVec3 {
        self.to_world.point(self.shape.centroid())
    }

    /// Whether a point is inside.
    pub fn encloses(&self, point: DVec3) -> bool {
        self.shape.encloses(self.to_world.inverse_point(point))
    }

    /// Texture coordinates of a point on the surface.
    pub fn uv_at(&self, point: DVec3) -> DVec2 {
        self.shape.uv_at(self.to_world.inverse_point(point))
    }

    /// Mean curvature at a point on a part. With principal curvatures k₁ and k₂ in the shape's coordinates and
    /// unit tangents t₁ and t₂ in their directions, it is
    /// ½·|det M|·(k₁·|M·t₂|² + k₂·|M·t₁|²) / |M·t₁ × M·t₂|³: the transform multiplies the second fundamental
    /// form by |det M| / |M·t₁ × M·t₂|, and tangents have the lengths |M·tᵢ|.
    pub fn curvature(&self, part: u32, point: DVec3) -> f64 {
        let local = self.to_world.inverse_point(point);
        let mean = self.shape.curvature(part, local);
        let Some((bend, tangents)) = self.shape.meridian(local).filter(|_| mean != 0.0) else {
            return 0.0;
        };
        let [along, around] = tangents.map(|tangent| self.to_world.vector(tangent));
        let forms = bend * around.length_squared() + (2.0 * mean - bend) * along.length_squared();
        0.5 * self.volume_scale * forms / along.cross(around).length().powi(3)
    }

    /// Local geometry of the shape near a point, for density estimation. The distance is a lower bound.
    pub fn local_geometry(&self, point: DVec3) -> LocalGeometry {
        let ground_to_world = |ground: NearestSurface| match ground.extent {
            SurfaceExtent::Flat(extent) => {
                let normal = self.to_world.normal(ground.normal);
                let length = normal.length();
                Some(NearestSurface {
                    normal: normal / length,
                    height: ground.height / length,
                    extent: SurfaceExtent::Flat(extent / self.inverse_stretch),
                })
            }
            SurfaceExtent::Round(_) => None,
        };
        match self.shape.local_geometry(self.to_world.inverse_point(point)) {
            LocalGeometry::Polygons(count) => LocalGeometry::Polygons(count),
            LocalGeometry::Surface { distance, ground } => LocalGeometry::Surface {
                distance: distance / self.inverse_stretch,
                ground: ground.and_then(ground_to_world),
            },
        }
    }

    /// [`Shape::flat_polygon`].
    pub fn flat_polygon(&self, number: u32) -> Option<FlatPolygon> {
        let mut corners: FlatPolygon =
            self.shape.flat_polygon(number)?.iter().map(|corner| self.to_world.point(*corner)).collect();
        if self.to_world.flips_handedness() {
            corners.reverse();
        }
        Some(corners)
    }

    /// [`Shape::is_thicker_than`].
    pub fn is_thicker_than(&self, point: DVec3, distance: f64) -> bool {
        self.shape.is_thicker_than(self.to_world.inverse_point(point), distance * self.inverse_stretch)
    }

    /// Projected area. The transform maps the area vectors A to |det M|·M⁻ᵀ·A.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        let direction = self.to_world.inverse_vector(direction);
        let length = direction.length();
        self.volume_scale * length * self.shape.projected_area(direction / length)
    }
}

impl SurfaceF64 for TransformedShape {
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let SurfacePointF64 { point, normal, reach } =
            self.shape.surface_point_f64(&self.ray_to_local(ray), hit);
        SurfacePointF64 {
            point: self.to_world.point(point),
            normal: self.to_world.normal(normal.normalize()),
            reach: self.reach_to_world(reach),
        }
    }
}
