//! The origin of the coordinates in which a scene is traced.

use super::Camera;
use crate::assets::OrbiterCamera;
use crate::math::DVec3;
use crate::math::origin::origin_near;
use crate::scene::description;

/// Chooses an origin near the camera's target, so that `f32` coordinates are as precise there as near 0. It stays 0 if the target
/// is within about 20 camera distances of 0. It depends, in discrete steps, only on the point that the camera orbits and its
/// distance: orbiting keeps it, and trees are rebuilt only when a step is crossed.
pub fn origin(camera: &description::Camera, orbiter: Option<&OrbiterCamera>) -> DVec3 {
    let (aim, distance) = Camera::aim(camera, orbiter);
    origin_near(aim, distance)
}
