//! A sampled point on an area light.

use crate::math::Vec3;

/// A sampled point on an area light, computed without branches.
#[derive(Clone, Copy, Debug)]
pub struct SampledLightPoint {
    /// Unit direction to the sampled point.
    pub direction: Vec3,
    /// Sampled point.
    pub target: Vec3,
    /// Inverse pdf of the direction, in sr, or 0 if the shading point is behind or inside the light.
    pub factor: f32,
}

impl SampledLightPoint {
    /// No sample, because the light is not visible.
    pub const NOTHING: Self = Self { direction: Vec3::ZERO, target: Vec3::ZERO, factor: 0.0 };
}
