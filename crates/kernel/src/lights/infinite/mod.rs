//! Lights from beyond the scene: every ray that leaves may see them, and none hits them.

mod directional;
mod environment;
mod sky;

pub use directional::DirectionalLight;
pub use environment::Environment;
pub use sky::SkyMap;

use super::tree::LightBounds;
use crate::math::Vec3;

/// A light from beyond the scene. How a surface samples it, and what a ray sees of it, its own file tells:
/// [`DirectionalLight`] is alike everywhere, an [`Environment`] follows the surface's normal.
pub trait InfiniteLight {
    /// Samples a unit direction to its light by numbers in [0, 1), of all that arrive anywhere; with the radiance over the pdf, or
    /// the irradiance of a light without extent.
    fn arriving_anywhere(&self, u: [f32; 2]) -> (Vec3, Vec3);

    /// Power in W through discs of this area, one across each direction: the mean of [`InfiniteLight::arriving_anywhere`] times
    /// the area.
    fn power_over(&self, area: f64) -> Vec3;

    /// Bounds of its directions and its irradiance.
    fn bounds(&self) -> LightBounds;

    /// Unit direction to its middle. `None` if it comes from all around.
    fn middle(&self) -> Option<Vec3>;

    /// Whether it has no extent.
    fn is_sharp(&self) -> bool;
}
