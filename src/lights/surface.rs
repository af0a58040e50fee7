//! Shapes that shine from their fronts, sampled by area.

use super::{End, LightSample, Source};
use crate::geometry::ray::offset_origin;
use crate::geometry::{AreaPoint, Shape};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::Discrete;

/// A shape that shines from its front.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceEmitter {
    shape: Shape,
    /// The parts of the shape by their numbers.
    by_area: Discrete,
}

impl SurfaceEmitter {
    /// None where the area is too small or too large for a number, or the shape has no end.
    pub fn new(shape: Shape) -> Option<Self> {
        Some(Self { shape, by_area: Discrete::new(shape.areas())? })
    }

    /// Uniform over the area. A shape that may hide parts of itself is tested by shadow rays too, up to just above their target;
    /// of the others nothing comes before a point that faces the receiver.
    pub fn sample(&self, point: Vec3, u: [f32; 2], radiance: Vec3, object: u32) -> Option<LightSample> {
        let (part, rest) = self.by_area.sample(u[0]);
        let place = self.shape.place(part as u32, Vec2::new(rest, u[1]));
        let offset = place.point - point.as_dvec3();
        let distance_squared = offset.length_squared();
        let direction = offset / distance_squared.sqrt();
        let cosine = -place.normal.dot(direction);
        let (target, source) = match self.shape.concave_error(place.point.as_vec3()) {
            Some(error) => (above(&place, error, offset), Source::Nothing),
            None => (place.point.as_vec3(), Source::Object(object)),
        };
        (cosine > 0.0).then(|| LightSample {
            end: End::At(target),
            direction: direction.as_vec3(),
            weight: radiance * (self.area() * cosine / distance_squared) as f32,
            source,
        })
    }

    /// Of all parts.
    pub fn area(&self) -> f64 {
        self.by_area.total()
    }

    /// Centre of area.
    pub fn middle(&self) -> DVec3 {
        self.shape.middle()
    }
}

/// A point that is certainly above the surface, also for a segment of this length towards it.
fn above(place: &AreaPoint, error: Vec3, offset: DVec3) -> Vec3 {
    let (point, normal) = (place.point.as_vec3(), place.normal.as_vec3());
    offset_origin(point, error + offset.abs().as_vec3() * f32::EPSILON, normal, normal)
}
