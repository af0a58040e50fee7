//! The origin of the coordinate system in which a scene is traced.

use super::Camera;
use crate::assets::GkitOrbiterCamera;
use crate::math::DVec3;
use crate::math::origin::local_coordinate_origin;
use crate::scene::description;

/// Chooses an origin near the camera's target, so that `f32` coordinates are as precise there as near 0. The
/// origin is 0 if the target is within about 20 camera distances of 0. It depends only on the point that the
/// camera orbits and on the distance to this point, so orbiting does not change it. It changes in discrete
/// steps because every change requires the trees to be rebuilt.
pub fn choose_origin_near_camera_target(
    camera: &description::Camera,
    orbiter: Option<&GkitOrbiterCamera>,
) -> DVec3 {
    let (aim, distance) = Camera::orbit_target_and_distance(camera, orbiter);
    local_coordinate_origin(aim, distance)
}
