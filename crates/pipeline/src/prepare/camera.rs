//! A request's camera, and the coordinate origin near it.

use crate::assets::GkitOrbiterCamera;
use crate::math::DVec3;
use crate::scene::description::{Camera, CameraOverrides, ResolvedCamera, Scene};
use crate::turntable::TurntableFrame;
use crate::world;

/// A request's camera: the scene's camera with the request's changes applied.
#[derive(Clone, Debug)]
pub(crate) struct RequestCamera {
    pub(crate) camera: Camera,
    /// Contents of the orbiter file, if the camera uses one.
    pub(crate) orbiter: Option<GkitOrbiterCamera>,
}

impl RequestCamera {
    pub(crate) fn new(scene: &Scene, orbiter: Option<GkitOrbiterCamera>, change: &CameraOverrides) -> Self {
        let own = Self { camera: scene.camera.clone(), orbiter };
        if change.has_changes() {
            Self { camera: own.resolved_camera().with_change(change).into(), orbiter: None }
        } else {
            own
        }
    }

    /// Rotates the camera for a turntable frame. Without a turntable, returns it unchanged.
    pub(crate) fn rotated_for_turntable(self, turn: Option<TurntableFrame>) -> Self {
        match turn {
            // The first frame uses the scene's camera unchanged.
            None | Some(TurntableFrame { number: 0, .. }) => self,
            Some(turn) => {
                let view = self.resolved_camera();
                let change =
                    CameraOverrides { pose: Some(turn.pose(&view.pose)), ..CameraOverrides::default() };
                Self { camera: view.with_change(&change).into(), orbiter: None }
            }
        }
    }

    pub(crate) fn resolved_camera(&self) -> ResolvedCamera {
        world::Camera::resolve_to_look_at(&self.camera, self.orbiter.as_ref())
    }

    /// Returns the coordinate origin that maximizes precision near the camera.
    pub(crate) fn origin_near_camera(&self) -> DVec3 {
        world::choose_origin_near_camera_target(&self.camera, self.orbiter.as_ref())
    }

    /// Returns the full contents of the orbiter file for use in fingerprints. They are too small to need a
    /// hash.
    pub(crate) fn orbiter_fingerprint_text(&self) -> Option<String> {
        self.orbiter.map(|camera| format!("{camera:?}"))
    }
}
