//! Trees: one per mesh file, kept while the file's content is the same, and the one over all objects in a world.

use std::sync::Arc;

use super::super::cache::{Memo, Pool};
use super::super::fingerprint::Key;
use super::meshes::Meshes;
use super::parse::Parsed;
use super::textures::Textures;
use super::{Reading, Staged, Stop, keys};
use crate::scene::Loaded;
use crate::scene::description::Scene;
use crate::world::{MeshTree, Parts, World};

/// What the stage keeps.
#[derive(Debug, Default)]
pub(in crate::pipeline) struct AccelCache {
    trees: Pool<Key, MeshTree>,
    geometry: Memo<()>,
    world: Memo<Arc<World>>,
}

impl AccelCache {
    pub(in crate::pipeline) fn sweep(&mut self, success: bool) {
        self.trees.sweep(success);
    }
}

/// What a world is put together from.
pub(in crate::pipeline) struct Ingredients<'a> {
    /// With the overrides in it.
    pub(in crate::pipeline) scene: &'a Scene,
    pub(in crate::pipeline) parsed: &'a Parsed,
    pub(in crate::pipeline) meshes: &'a Meshes,
    pub(in crate::pipeline) textures: &'a Textures,
}

impl Ingredients<'_> {
    pub(in crate::pipeline) fn mesh_keys(&self) -> Vec<Key> {
        self.meshes.iter().map(|mesh| mesh.key).collect()
    }
}

/// A world with the key of all that its pictures depend on.
pub(in crate::pipeline) type Keyed = (Key, Arc<World>);

/// Build what is missing.
///
/// # Errors
/// Cancelled.
pub(in crate::pipeline) fn accel(
    from: &Ingredients<'_>,
    cache: &mut AccelCache,
    reading: &Reading<'_>,
) -> Result<Staged<Keyed>, Stop> {
    let mesh_keys = from.mesh_keys();
    let geometry = keys::geometry(from.scene, &mesh_keys);
    // The orbiter's numbers are few: their text stands for them.
    let orbiter = from.parsed.orbiter.map(|camera| format!("{camera:?}"));
    let key = keys::world(from.scene, &mesh_keys, &from.textures.keys, orbiter.as_deref());
    let same_trees = cache.geometry.get(geometry).is_some();
    let built_key = keys::in_trees(&key, from.scene.render.accel);
    if let Some(world) = cache.world.get(built_key).cloned() {
        trees(from, cache, reading)?;
        return Ok(Staged::reused((key, world), "no shape changed"));
    }
    let (trees, kept) = trees(from, cache, reading)?;
    let built = trees.len() - kept;
    let parts = Parts { meshes: trees, textures: from.textures.texels.clone(), orbiter: from.parsed.orbiter };
    let last = cache.world.latest().cloned();
    let world =
        reading.pool.install(|| World::assemble(from.scene, &parts, last.as_deref(), reading.token))?;
    let value = (key, Arc::new(world));
    cache.world.set(built_key, value.1.clone());
    cache.geometry.set(geometry, ());
    Ok(match (same_trees, from.scene.objects.is_empty()) {
        (_, true) => Staged::skipped(value, "the scene has no shape"),
        (true, _) => Staged::reused(value, "no shape changed"),
        (false, _) if kept > 0 => {
            Staged::done(value, format!("{built} mesh trees built, {kept} kept, one over all objects"))
        }
        (false, _) => Staged::done(value, ""),
    })
}

/// The trees of all meshes, and how many were kept from before.
fn trees(
    from: &Ingredients<'_>,
    cache: &mut AccelCache,
    reading: &Reading<'_>,
) -> Result<(Vec<Arc<MeshTree>>, usize), Stop> {
    let mut kept = 0;
    let accel = from.scene.render.accel;
    let mut trees = Vec::with_capacity(from.meshes.len());
    for mesh in from.meshes {
        let key = keys::tree(&mesh.key, accel);
        let tree = match cache.trees.get(&key, key) {
            Some(tree) => {
                kept += 1;
                tree
            }
            None => {
                let build = || MeshTree::build(mesh.mesh.clone(), accel, reading.token);
                let tree = Arc::new(reading.pool.install(build)?);
                cache.trees.insert(key, key, tree.clone());
                tree
            }
        };
        trees.push(tree);
    }
    Ok((trees, kept))
}

/// The textures that visible materials of this scene look up.
pub(in crate::pipeline) fn needed(loaded: &Loaded, meshes: &Meshes) -> Vec<crate::world::NeededTexture> {
    let meshes: Vec<_> = meshes.iter().map(|kept| kept.mesh.clone()).collect();
    crate::world::textures_needed(&loaded.scene, &meshes)
}
