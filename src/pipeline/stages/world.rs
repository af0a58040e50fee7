//! The world: what the stages before made, put together.

use std::sync::Arc;

use super::super::cache::Memo;
use super::accel::Built;
use super::keys;
use super::textures::Textures;
use crate::assets::OrbiterCamera;
use crate::lights::Lights;
use crate::scene::description::Scene;
use crate::scene::fingerprint::{Key, Referents};
use crate::world::{Parts, World};

/// A world with the key of all that its pictures depend on.
pub(in crate::pipeline) type Keyed = (Key, Arc<World>);

/// Put it together, unless the last one is of the same parts.
pub(in crate::pipeline) fn world(
    scene: &Scene,
    of: &Referents<'_>,
    (built, lights): (Built, Arc<Lights>),
    textures: &Textures,
    orbiter: Option<OrbiterCamera>,
    memo: &mut Memo<Arc<World>>,
) -> Keyed {
    let key = keys::world(scene, of, &textures.keys);
    let built_key = keys::in_trees(&key, scene.render.accel);
    if let Some(world) = memo.get(built_key) {
        return (key, world.clone());
    }
    let parts = Parts { meshes: built.meshes, images: textures.images.clone(), orbiter };
    let world = Arc::new(World::new(scene, &parts, built.geometry, lights));
    memo.set(built_key, world.clone());
    (key, world)
}
