//! Shapes that emit.

use super::rectangle::{QuadEmitter, SeenQuad};
use super::round::RoundEmitter;
use super::sphere::{SeenSphere, SphereEmitter};
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
    /// A disk, cylinder, cone or torus.
    Round(RoundEmitter),
}

impl AreaLight {
    /// The light as seen from a point; none where it certainly sends nothing there.
    pub fn seen_from(&self, point: Vec3) -> Option<SeenLight<'_>> {
        let shape = match &self.shape {
            Emitter::Sphere(sphere) => SeenShape::Sphere(sphere.seen_from(point)?),
            Emitter::Quad(quad) => SeenShape::Quad(quad.seen_from(point)?),
            Emitter::Triangles(triangles) => SeenShape::Triangles(triangles, point),
            Emitter::Round(round) => SeenShape::Round(round, point),
        };
        Some(SeenLight::Area(self, shape))
    }

    /// All of it as if it came from the middle.
    pub fn middle(&self, point: Vec3) -> Option<LightSample> {
        let source = Source::Object(self.object);
        match &self.shape {
            Emitter::Sphere(sphere) => sphere.middle(point, self.radiance, source),
            Emitter::Quad(quad) => quad.middle(point, self.radiance, source),
            Emitter::Triangles(triangles) => triangles.middle(point, self.radiance, self.object),
            Emitter::Round(round) => round.middle(point, self.radiance, self.object),
        }
    }
}

/// A light and a point that it may shine on, ready to be sampled many times.
#[derive(Clone, Copy, Debug)]
pub enum SeenLight<'a> {
    /// There is but one way.
    Only(LightSample),
    /// A shape.
    Area(&'a AreaLight, SeenShape<'a>),
}

/// A shape as seen from a point.
#[derive(Clone, Copy, Debug)]
pub enum SeenShape<'a> {
    /// A sphere.
    Sphere(SeenSphere),
    /// A parallelogram.
    Quad(SeenQuad<'a>),
    /// Triangles, and the point.
    Triangles(&'a TriangleEmitter, Vec3),
    /// A disk, cylinder, cone or torus, and the point.
    Round(&'a RoundEmitter, Vec3),
}

impl SeenLight<'_> {
    /// One way for light to arrive; none where the part that was chosen sends nothing.
    pub fn sample(&self, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Self::Only(sample) => Some(*sample),
            Self::Area(light, shape) => {
                let source = Source::Object(light.object);
                match shape {
                    SeenShape::Sphere(sphere) => Some(sphere.sample(u, light.radiance, source)),
                    SeenShape::Quad(quad) => Some(quad.sample(u, light.radiance, source)),
                    SeenShape::Triangles(triangles, point) => {
                        triangles.sample(*point, u, light.radiance, light.object)
                    }
                    SeenShape::Round(round, point) => round.sample(*point, u, light.radiance, light.object),
                }
            }
        }
    }
}
