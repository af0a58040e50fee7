//! Lights: where light comes from, as seen from a point.

pub mod emitter;
pub mod point;
pub mod rectangle;
mod set;
pub mod sphere;
pub mod surface;
pub mod triangles;

pub use emitter::{AreaLight, Part, SeenLight, area_lights};
pub use point::PointLight;
pub use set::Lights;

use crate::math::Vec3;
use crate::math::lanes::{LANES, Lanes, Lanes3};

/// A light of any kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// Without extent.
    Point(PointLight),
    /// A shape that emits.
    Area(AreaLight),
}

/// One way for light to arrive at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Where it comes from, in world coordinates.
    pub target: Vec3,
    /// Unit direction to there.
    pub direction: Vec3,
    /// Radiance over the density of the direction in sr⁻¹: times f and the cosine it is a contribution. For lights
    /// without extent, irradiance at normal incidence.
    pub weight: Vec3,
    /// What the shadow ray need not hit: the light itself.
    pub source: Source,
}

/// Ways for light to arrive at a point, some at a time: [`LightSample`] with a lane for each.
#[derive(Clone, Copy, Debug)]
pub struct LightSamples {
    /// Where it comes from, in world coordinates.
    pub targets: Lanes3,
    /// Unit directions to there.
    pub directions: Lanes3,
    /// Radiance, or of lights without extent irradiance at normal incidence.
    pub radiance: Vec3,
    /// What that is to be multiplied by: one over the densities of the directions, in sr.
    pub factors: Lanes,
    /// What the shadow rays need not hit.
    pub source: Source,
    /// How many lanes count.
    pub count: usize,
}

impl From<LightSample> for LightSamples {
    fn from(sample: LightSample) -> Self {
        Self {
            targets: sample.target.to_array().map(|x| [x; LANES]),
            directions: sample.direction.to_array().map(|x| [x; LANES]),
            radiance: sample.weight,
            factors: [1.0; LANES],
            source: sample.source,
            count: 1,
        }
    }
}

/// The part of the scene that a light is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Nothing that can be hit.
    Nothing,
    /// A convex object: no ray to its near side meets it before.
    Object(u32),
    /// One primitive of an object.
    Primitive(u32, u32),
}

impl Light {
    /// The light as seen from a point; none where it certainly sends nothing there.
    pub fn seen_from(&self, point: Vec3) -> Option<SeenLight<'_>> {
        match self {
            Self::Point(light) => light.sample(point).map(SeenLight::Only),
            Self::Area(light) => light.seen_from(point),
        }
    }

    /// The middle of the light with all that it sends, as if it came from there.
    pub fn middle(&self, point: Vec3) -> Option<LightSample> {
        match self {
            Self::Point(light) => light.sample(point),
            Self::Area(light) => light.middle(point),
        }
    }
}
