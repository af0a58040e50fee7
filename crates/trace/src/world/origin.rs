//! Origin of the coordinates in which a scene is traced.

use super::Camera;
use crate::assets::OrbiterCamera;
use crate::math::DVec3;
use crate::math::origin::origin_near;
use crate::scene::description;

/// Origin near the camera's target, so that single precision is as good there as near 0. It stays at 0 for a scene whose
/// target is within some twenty distances of the camera. It depends only on the point about which the camera turns and on its
/// distance, by steps: orbits change nothing, and trees are rebuilt only at a step.
pub fn origin(camera: &description::Camera, orbiter: Option<&OrbiterCamera>) -> DVec3 {
    let (aim, distance) = Camera::aim(camera, orbiter);
    origin_near(aim, distance)
}
