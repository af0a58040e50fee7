//! The world: what the stages before made, put together.

use std::sync::Arc;

use super::cache::Memo;
use super::keys;
use super::stages::accel::Built;
use super::stages::textures::Textures;
use super::turntable::Turn;
use crate::assets::OrbiterCamera;
use crate::lights::Lights;
use crate::math::DVec3;
use crate::scene::description::{Camera, CameraChange, Scene, Viewpoint};
use crate::scene::fingerprint::{Key, Referents};
use crate::world::{self, GlassSolids, World, WorldInputs};

/// A world with the key of all that its pictures depend on.
pub(super) type Keyed = (Key, Arc<World>);

/// The camera of a request: the scene's, or what the request makes of it.
#[derive(Clone, Debug)]
pub(super) struct Eye {
    pub(super) camera: Camera,
    /// The orbiter file, if the camera is in one.
    pub(super) orbiter: Option<OrbiterCamera>,
}

impl Eye {
    pub(super) fn new(scene: &Scene, orbiter: Option<OrbiterCamera>, change: &CameraChange) -> Self {
        let own = Self { camera: scene.camera.clone(), orbiter };
        if change.is_any() {
            Self { camera: own.viewpoint().changed(change).into(), orbiter: None }
        } else {
            own
        }
    }

    /// The camera of a turntable's picture, if it is one.
    pub(super) fn turned(self, turn: Option<Turn>) -> Self {
        match turn {
            // The first one is the camera's own, to the bit.
            None | Some(Turn { number: 0, .. }) => self,
            Some(turn) => {
                let view = self.viewpoint();
                let change = CameraChange { pose: Some(turn.pose(&view.pose)), ..CameraChange::default() };
                Self { camera: view.changed(&change).into(), orbiter: None }
            }
        }
    }

    pub(super) fn viewpoint(&self) -> Viewpoint {
        world::Camera::viewpoint(&self.camera, self.orbiter.as_ref())
    }

    /// Origin of the coordinates in which the camera sees most precisely.
    pub(super) fn origin(&self) -> DVec3 {
        world::origin(&self.camera, self.orbiter.as_ref())
    }
}

/// Put it together, unless the last one is of the same parts.
pub(super) fn world(
    scene: &Scene,
    (surfaces, of): (&Key, &Referents<'_>),
    (built, lights, bodies): (Built, Arc<Lights>, Arc<GlassSolids>),
    textures: &Textures,
    eye: &Eye,
    memo: &mut Memo<Arc<World>>,
) -> Keyed {
    let key = keys::world(surfaces, &eye.camera, of);
    let built_key = keys::in_trees(&key, scene.render.accel);
    if let Some(world) = memo.get(built_key) {
        return (key, world.clone());
    }
    let Eye { camera, orbiter } = eye.clone();
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
