//! Light sampling of shapes under an affine transform.

use super::sample_point::SampledLightPoint;
use super::{Emitter, LightHitPoint, ShapeEmitter, normal_if_flat};
use crate::geometry::transformed::TransformedShape;
use crate::math::{DVec3, Vec3};

/// The front of a transformed shape, sampled in the shape's own coordinates.
///
/// M maps a unit direction d to M·d / |M·d| and a small solid angle around d to |det M| / |M·d|³ times the
/// solid angle.
#[derive(Clone, Debug, PartialEq)]
pub struct TransformedEmitter {
    /// The emitter in the shape's own coordinates.
    emitter: Emitter,
    transformed: TransformedShape,
}

impl ShapeEmitter for TransformedEmitter {
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let Some(point) = self.local_point_if_in_front(point) else { return SampledLightPoint::NOTHING };
        let local = self.emitter.sample(point, u);
        let to_world = &self.transformed.to_world;
        let offset = to_world.vector(local.direction.as_dvec3());
        let length = offset.length();
        if !(local.factor > 0.0 && length > 0.0) {
            return SampledLightPoint::NOTHING;
        }
        SampledLightPoint {
            direction: (offset / length).as_vec3(),
            target: to_world.point(local.target.as_dvec3()).as_vec3(),
            factor: (f64::from(local.factor) * self.solid_angle_scale(length)) as f32,
        }
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        let Some(from) = self.local_point_if_in_front(from) else { return 0.0 };
        let to_world = &self.transformed.to_world;
        let direction = to_world.inverse_vector(hit.direction.as_dvec3());
        let length = direction.length();
        let normal = to_world.linear.transpose() * hit.normal.as_dvec3();
        let local = LightHitPoint {
            direction: (direction / length).as_vec3(),
            distance: (f64::from(hit.distance) * length) as f32,
            normal: normal.normalize().as_vec3(),
            primitive: hit.primitive,
        };
        let pdf = f64::from(self.emitter.pdf(from, &local));
        (pdf / self.solid_angle_scale(1.0 / length)) as f32
    }

    fn area_centroid(&self) -> DVec3 {
        self.transformed.to_world.point(self.emitter.area_centroid())
    }
}

impl TransformedEmitter {
    /// Creates an emitter for a transformed shape from an emitter for the untransformed shape.
    pub fn new(emitter: Emitter, transformed: &TransformedShape) -> Self {
        Self { emitter, transformed: transformed.clone() }
    }

    /// Converts a point to the shape's coordinates, or returns `None` if the front is not visible from there.
    /// This is tested before rounding to `f32`, which could move a point from behind the surface to its
    /// front.
    fn local_point_if_in_front(&self, point: Vec3) -> Option<Vec3> {
        let shape = &self.transformed.shape;
        let point = self.transformed.to_world.inverse_point(point.as_dvec3());
        let is_behind = match normal_if_flat(shape) {
            Some(normal) => !(normal.dot(point - shape.centroid()) > 0.0),
            None => shape.encloses_point(point),
        };
        (!is_behind).then(|| point.as_vec3())
    }

    /// Factor from solid angles in the shape's coordinates to solid angles in the world, around a unit
    /// direction that the transform stretches to `length`.
    fn solid_angle_scale(&self, length: f64) -> f64 {
        self.transformed.volume_scale / (length * length * length)
    }
}
