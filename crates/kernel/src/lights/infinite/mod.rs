//! Lights at infinity: rays that leave the scene may see them.

mod directional;
mod environment;
mod environment_map;

pub use directional::DirectionalLight;
pub use environment::Environment;
pub use environment_map::EnvironmentMap;

use super::tree::LightBounds;
use crate::math::Vec3;

/// A light at infinity. Sampling for a surface and the radiance along a ray are methods of each type: a [`DirectionalLight`] is
/// the same everywhere, whereas sampling an [`Environment`] depends on the surface normal.
pub trait InfiniteLight {
    /// Samples a unit direction to the light with `u` in [0, 1)², independently of a surface. Returns it with the radiance
    /// divided by the pdf, or with the irradiance for a light without extent.
    fn sample_direction(&self, u: [f32; 2]) -> (Vec3, Vec3);

    /// Power in W through a disk of this area perpendicular to each direction: the mean weight of
    /// [`InfiniteLight::sample_direction`] times the area.
    fn power_through(&self, area: f64) -> Vec3;

    /// Bounds of its directions and irradiance.
    fn bounds(&self) -> LightBounds;

    /// Unit direction to its center. `None` if it surrounds the scene.
    fn middle(&self) -> Option<Vec3>;

    /// Whether the light has no angular extent.
    fn is_sharp(&self) -> bool;
}
