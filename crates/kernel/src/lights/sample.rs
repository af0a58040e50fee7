//! Samples of the light that arrives at a point, and points of lights that rays hit.

use crate::math::Vec3;

/// A sample of the light that arrives at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// End of the shadow ray.
    pub end: End,
    /// Unit direction to the light.
    pub direction: Vec3,
    /// Radiance over the pdf of the direction in sr⁻¹: times f and the cosine, it is the contribution. For lights
    /// without extent, irradiance at normal incidence.
    pub weight: Vec3,
    /// Objects that the shadow ray ignores: the light itself.
    pub source: Source,
}

/// End of a shadow ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// A point, in world coordinates.
    At(Vec3),
    /// A place beyond everything in the scene.
    Beyond,
}

/// Position of the middle of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Middle {
    /// A point, in world coordinates.
    At(Vec3),
    /// A place beyond everything, in this unit direction.
    Towards(Vec3),
}

/// The part of the scene that a light is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Nothing that can be hit.
    Nothing,
    /// A convex object: no ray to its near side hits it before.
    Object(u32),
    /// A place of an object that light may pass; other parts of the object may weaken a ray to it.
    Sheer(u32),
    /// One primitive of an object.
    Primitive(u32, u32),
}

/// A point of a light that a ray from elsewhere hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHit {
    /// Unit direction of the ray.
    pub direction: Vec3,
    /// Distance to the point.
    pub distance: f32,
    /// Unit normal of the light's front there.
    pub normal: Vec3,
    /// Number of the primitive that was hit.
    pub primitive: u32,
}

impl LightHit {
    /// Pdf in sr⁻¹ of directions to points that are uniform over an area; 0 from behind.
    pub(super) fn pdf_by_area(&self, area: f64) -> f32 {
        let cosine = -self.normal.dot(self.direction);
        if cosine > 0.0 { self.distance * self.distance / (area as f32 * cosine) } else { 0.0 }
    }
}
