//! Where the coordinates start that a scene is traced in.

use super::Camera;
use crate::assets::OrbiterCamera;
use crate::math::DVec3;
use crate::math::origin::origin_near;
use crate::scene::description;

/// Near what the camera looks at, so that single precision holds what is seen as well as it would at 0, where the origin stays
/// for a scene of which that is within some twenty distances of the eye. It depends on the point that the camera turns about
/// and on its distance alone, by steps: orbits change nothing, and trees are built again only where a step is taken.
pub fn origin(camera: &description::Camera, orbiter: Option<&OrbiterCamera>) -> DVec3 {
    let (aim, distance) = Camera::aim(camera, orbiter);
    origin_near(aim, distance)
}
