//! Shapes that emit.

use super::rectangle::QuadEmitter;
use super::sphere::SphereEmitter;
use super::triangles::TriangleEmitter;
use super::{LightSample, Source};
use crate::math::Vec3;

/// A shape that sends the same radiance everywhere from its front side.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLight {
    /// Which shape.
    pub shape: Emitter,
    /// Its radiance.
    pub radiance: Vec3,
    /// The object that it is.
    pub object: u32,
}

/// The shapes that can emit.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A sphere.
    Sphere(SphereEmitter),
    /// A parallelogram: a quad, or a face of a box.
    Quad(QuadEmitter),
    /// Triangles.
    Triangles(TriangleEmitter),
}

impl AreaLight {
    /// Sample what arrives at a point; none where that is nothing.
    pub fn sample(&self, point: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let source = Source::Object(self.object);
        match &self.shape {
            Emitter::Sphere(sphere) => sphere.sample(point, u, self.radiance, source),
            Emitter::Quad(quad) => quad.sample(point, u, self.radiance, source),
            Emitter::Triangles(triangles) => triangles.sample(point, u, self.radiance, self.object),
        }
    }

    /// All of it as if it came from the middle.
    pub fn middle(&self, point: Vec3) -> Option<LightSample> {
        let source = Source::Object(self.object);
        match &self.shape {
            Emitter::Sphere(sphere) => sphere.middle(point, self.radiance, source),
            Emitter::Quad(quad) => quad.middle(point, self.radiance, source),
            Emitter::Triangles(triangles) => triangles.middle(point, self.radiance, self.object),
        }
    }
}
