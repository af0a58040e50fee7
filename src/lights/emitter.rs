//! Shapes that emit.

use super::rectangle::{QuadEmitter, SeenQuad};
use super::round::RoundEmitter;
use super::sphere::{SeenSphere, SphereEmitter};
use super::triangles::TriangleEmitter;
use super::{LightSample, LightSamples, Source};
use crate::math::Vec3;
use crate::math::lanes::Lanes;

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
    /// Ways for light to arrive by the first numbers of each lane, which `take` gets in order; none where the part that was
    /// chosen sends nothing.
    pub fn samples(&self, u: [Lanes; 2], count: usize, mut take: impl FnMut(&LightSamples)) {
        let (light, shape) = match self {
            Self::Only(sample) => return (0..count).for_each(|_| take(&LightSamples::from(*sample))),
            Self::Area(light, shape) => (light, shape),
        };
        let (radiance, source) = (light.radiance, Source::Object(light.object));
        let each = (0..count).map(|i| [u[0][i], u[1][i]]);
        let one = |sample: LightSample| take(&LightSamples::from(sample));
        match shape {
            SeenShape::Quad(quad) => take(&LightSamples { count, ..quad.samples(u, radiance, source) }),
            SeenShape::Sphere(sphere) => take(&LightSamples { count, ..sphere.samples(u, radiance, source) }),
            SeenShape::Triangles(triangles, point) => {
                each.filter_map(|u| triangles.sample(*point, u, radiance, light.object)).for_each(one);
            }
            SeenShape::Round(round, point) => {
                each.filter_map(|u| round.sample(*point, u, radiance, light.object)).for_each(one);
            }
        }
    }
}
