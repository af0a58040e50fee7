//! Lights at infinity, which may be visible to rays that leave the scene.

mod directional;
mod environment;
mod environment_map;
pub mod sky;

pub use directional::DirectionalLight;
pub use environment::{Environment, MapOrientation};
pub use environment_map::{EnvironmentMap, MapRowPlacement};

use super::tree::LightBounds;
use crate::math::Vec3;

/// A light at infinity. Each type has its own methods for sampling at a surface and for evaluating the
/// radiance along a ray, because sampling depends on the surface normal for an [`Environment`] but not for a
/// [`DirectionalLight`].
pub trait InfiniteLight {
    /// Samples a unit direction to the light, independently of a surface. Returns the direction and the
    /// radiance divided by the pdf, or the irradiance if the light has no extent. `u` is in [0, 1)².
    fn sample_direction_and_weight(&self, u: [f32; 2]) -> (Vec3, Vec3);

    /// Power in W through a disk of the given area, summed over all directions, where the disk is always
    /// perpendicular to the direction. Equals the mean weight of
    /// [`InfiniteLight::sample_direction_and_weight`] times the area.
    fn power_through_disk(&self, area: f64) -> Vec3;

    /// Bounds on the light's directions and irradiance.
    fn direction_and_irradiance_bounds(&self) -> LightBounds;

    /// Unit direction to the light's center, or `None` if the light surrounds the scene.
    fn direction_to_center(&self) -> Option<Vec3>;

    /// Whether the light has no angular extent.
    fn has_no_angular_extent(&self) -> bool;
}
