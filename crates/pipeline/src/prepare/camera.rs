//! Assembles the world from the results of earlier stages.

use std::sync::Arc;

use super::cache::Memo;
use super::keys;
use super::stages::accel::AccelResult;
use super::stages::textures::Textures;
use super::turntable::TurntableFrame;
use crate::assets::GkitOrbiterCamera;
use crate::lights::Lights;
use crate::math::DVec3;
use crate::scene::description::{Camera, CameraOverrides, ResolvedCamera, Scene};
use crate::scene::fingerprint::{Fingerprint, FingerprintContext};
use crate::world::{self, GlassSolids, World, WorldInputs};

/// A world and its key, which covers everything that affects the world's images.
pub(super) type KeyedWorld = (Fingerprint, Arc<World>);

/// A request's camera: the scene's camera with the request's changes applied.
#[derive(Clone, Debug)]
pub(super) struct RequestCamera {
    pub(super) camera: Camera,
    /// Contents of the orbiter file, if the camera uses one.
    pub(super) orbiter: Option<GkitOrbiterCamera>,
}

impl RequestCamera {
    pub(super) fn new(scene: &Scene, orbiter: Option<GkitOrbiterCamera>, change: &CameraOverrides) -> Self {
        let own = Self { camera: scene.camera.clone(), orbiter };
        if change.has_changes() {
            Self { camera: own.resolved_camera().with_change(change).into(), orbiter: None }
        } else {
            own
        }
    }

    /// Rotates the camera for a turntable frame. Without a turntable, returns it unchanged.
    pub(super) fn rotated_for_turntable(self, turn: Option<TurntableFrame>) -> Self {
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

    pub(super) fn resolved_camera(&self) -> ResolvedCamera {
        world::Camera::look_at_from_description(&self.camera, self.orbiter.as_ref())
    }

    /// Returns the coordinate origin that maximizes precision near the camera.
    pub(super) fn origin_near_camera(&self) -> DVec3 {
        world::choose_origin_near_camera_target(&self.camera, self.orbiter.as_ref())
    }
}

/// Assembles the world, or reuses the previous one if the key is unchanged.
pub(super) fn build_or_reuse_world(
    scene: &Scene,
    (surfaces, of): (&Fingerprint, &FingerprintContext<'_>),
    (built, lights, bodies): (AccelResult, Arc<Lights>, Arc<GlassSolids>),
    textures: &Textures,
    eye: &RequestCamera,
    memo: &mut Memo<Arc<World>>,
) -> KeyedWorld {
    let key = keys::world_key(surfaces, &eye.camera, of);
    let built_key = keys::with_tree_kind(&key, scene.render.accel);
    if let Some(world) = memo.get(built_key) {
        return (key, world.clone());
    }
    let RequestCamera { camera, orbiter } = eye.clone();
    let parts = WorldInputs {
        meshes: built.meshes,
        images: textures.images.clone(),
        orbiter,
        camera: Some(camera),
        glass_solids: Some(bodies),
    };
    let world = Arc::new(World::new(scene, &parts, built.geometry, lights));
    memo.set(built_key, world.clone());
    (key, world)
}
