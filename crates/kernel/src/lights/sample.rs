//! Light samples, and points where rays hit lights.

use crate::math::Vec3;

/// A sample of the light that arrives at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// End of the shadow ray.
    pub end: ShadowRayEnd,
    /// Unit direction to the light.
    pub direction: Vec3,
    /// Radiance divided by the pdf of the direction in sr⁻¹, or for delta lights, the irradiance at normal
    /// incidence. The contribution is the weight times the BSDF and the cosine.
    pub weight: Vec3,
    /// The light's own geometry, which the shadow ray ignores.
    pub source: GeometryOfLight,
}

/// End of a shadow ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShadowRayEnd {
    /// A point in world coordinates.
    At(Vec3),
    /// A point beyond the entire scene.
    Beyond,
}

/// Location of a light's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightCenter {
    /// A point in world coordinates.
    At(Vec3),
    /// At infinity, in this unit direction.
    Towards(Vec3),
}

/// The scene geometry that belongs to a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GeometryOfLight {
    /// No geometry.
    Nothing,
    /// A convex object. It does not block rays to its near side.
    Object(u32),
    /// A surface point on a see-through object. Other parts of the object may attenuate a ray to the point.
    SeeThrough(u32),
    /// A single primitive of an object.
    Primitive(u32, u32),
}

/// A point where a ray hits a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHitPoint {
    /// Unit direction of the ray.
    pub direction: Vec3,
    /// Distance to the point.
    pub distance: f32,
    /// Unit normal on the light's front side.
    pub normal: Vec3,
    /// Index of the hit primitive.
    pub primitive: u32,
}

impl LightHitPoint {
    /// Solid-angle pdf in sr⁻¹ of points sampled uniformly over an area, or 0 if the light is seen from
    /// behind.
    pub(super) fn uniform_area_solid_angle_pdf(&self, area: f64) -> f32 {
        let cosine = -self.normal.dot(self.direction);
        if cosine > 0.0 { self.distance * self.distance / (area as f32 * cosine) } else { 0.0 }
    }
}
