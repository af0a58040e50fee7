//! The accel stage: builds a tree for each mesh file whose content has changed, and one tree over all
//! objects. Trees from previous scenes are kept while there is room.

use std::sync::Arc;

use rayon::ThreadPool;

use super::super::cache::{CacheOfNamedValues, EvictableCache, Memo};
use super::super::keys;
use super::super::protocol::reasons;
use super::meshes::{CachedMesh, MeshesByFileIndex};
use super::{AbortReason, StageResult};
use crate::assets::LoadedMesh;
use crate::control::CancelToken;
use crate::math::DVec3;
use crate::scene::description::Scene;
use crate::scene::fingerprint::{Fingerprint, FingerprintContext};
use crate::world::{
    Geometry, MeshTree, emissive_override_flags_by_mesh_file, light_lifts, separate_coincident_emitters,
};

/// The key of a mesh whose coincident emitters have been separated, and the mesh.
type KeyedMeshWithDistinctEmitters = (Fingerprint, Arc<LoadedMesh>);

/// Cache of the accel stage.
#[derive(Debug, Default)]
pub(crate) struct AccelCache {
    trees: CacheOfNamedValues<Fingerprint, MeshTree>,
    /// Meshes whose coincident emitters have been separated, or `None` if the mesh in the file can be used as
    /// it is.
    distinct: CacheOfNamedValues<Fingerprint, Option<Arc<LoadedMesh>>>,
    geometry: CacheOfNamedValues<Fingerprint, Geometry>,
    /// Offsets applied to lights that are coplanar with other surfaces.
    lifts: Memo<Vec<DVec3>>,
    /// Key of the current tree over all objects.
    last: Option<Fingerprint>,
}

impl AccelCache {
    pub(crate) fn caches_mut(&mut self) -> [&mut dyn EvictableCache; 3] {
        [&mut self.trees, &mut self.distinct, &mut self.geometry]
    }
}

/// Result of the accel stage.
#[derive(Clone)]
pub(crate) struct AccelResult {
    /// Trees for the scene's mesh files.
    pub(crate) meshes: Vec<Arc<MeshTree>>,
    /// Tree over all objects.
    pub(crate) geometry: Arc<Geometry>,
}

/// Builds all missing trees, using coordinates relative to `origin`. `scene` includes the overrides.
///
/// # Errors
/// Returns [`AbortReason::Canceled`] if the token is canceled.
pub(crate) fn build_accel_structures(
    scene: &Scene,
    of: &FingerprintContext<'_>,
    origin: DVec3,
    meshes: &MeshesByFileIndex,
    cache: &mut AccelCache,
    pool: &ThreadPool,
    token: &CancelToken,
) -> Result<StageResult<AccelResult>, AbortReason> {
    let distinct = make_mesh_emitters_distinct(scene, meshes, cache, token)?;
    let (meshes, kept) = build_mesh_trees(scene, meshes, &distinct, cache, pool, token)?;
    let lights_key = keys::key_with_coordinate_origin(&keys::coplanar_lights_key(scene, of), origin);
    let lifts = cache.lifts.get(lights_key).cloned().unwrap_or_else(|| light_lifts(scene, &meshes, origin));
    cache.lifts.set(lights_key, lifts.clone());
    let changed = distinct.iter().map(|distinct| distinct.as_ref().map(|(key, _)| *key));
    let key = keys::geometry_key(scene, of, origin, &lifts, changed);
    let is_last = cache.last == Some(key);
    if let Some(geometry) = cache.geometry.get(&key, key) {
        cache.last = Some(key);
        let why = if is_last { reasons::UNCHANGED } else { reasons::CACHED };
        return Ok(StageResult::reused(AccelResult { meshes, geometry }, why));
    }
    let build = || Geometry::from_scene_with_light_lifts(scene, &meshes, (origin, lifts), token);
    let geometry = Arc::new(pool.install(build)?);
    cache.geometry.insert(key, key, geometry.clone(), geometry.top_level_memory_bytes());
    cache.last = Some(key);
    let built = meshes.len() - kept;
    let value = AccelResult { meshes, geometry };
    Ok(match (scene.objects.is_empty(), kept) {
        (true, _) => StageResult::skipped(value, reasons::NO_SHAPES),
        (false, 0) => StageResult::done(value, ""),
        (false, _) => {
            StageResult::done(value, format!("{built} mesh trees built, {kept} kept, one over all objects"))
        }
    })
}

/// Returns the meshes with separated emitters, or `None` for meshes that can be used as they are.
fn make_mesh_emitters_distinct(
    scene: &Scene,
    meshes: &MeshesByFileIndex,
    cache: &mut AccelCache,
    token: &CancelToken,
) -> Result<Vec<Option<KeyedMeshWithDistinctEmitters>>, AbortReason> {
    let distinct = |(mesh, is_emissive): (&Arc<CachedMesh>, bool)| {
        let key = keys::separated_emitters_mesh_key(&mesh.key, is_emissive);
        let found = match cache.distinct.get(&key, key) {
            Some(found) => found,
            None => {
                let found =
                    Arc::new(separate_coincident_emitters(&mesh.mesh, is_emissive, token)?.map(Arc::new));
                let bytes = found.as_ref().as_ref().map_or(0, |distinct| distinct.mesh.memory_bytes());
                cache.distinct.insert(key, key, found.clone(), bytes);
                found
            }
        };
        Ok((*found).clone().map(|distinct| (key, distinct)))
    };
    meshes.iter().zip(emissive_override_flags_by_mesh_file(scene)).map(distinct).collect()
}

/// Returns the trees for all meshes, and how many of them were cached.
fn build_mesh_trees(
    scene: &Scene,
    meshes: &MeshesByFileIndex,
    distinct: &[Option<KeyedMeshWithDistinctEmitters>],
    cache: &mut AccelCache,
    pool: &ThreadPool,
    token: &CancelToken,
) -> Result<(Vec<Arc<MeshTree>>, usize), AbortReason> {
    let mut kept = 0;
    let accel = scene.render.accel;
    let mut trees = Vec::with_capacity(meshes.len());
    for (mesh, distinct) in meshes.iter().zip(distinct) {
        let key = keys::mesh_accel_key(&mesh.key, accel, distinct.as_ref().map(|(key, _)| *key));
        let tree = match cache.trees.get(&key, key) {
            Some(tree) => {
                kept += 1;
                tree
            }
            None => {
                let loaded = distinct.as_ref().map_or(&mesh.mesh, |(_, distinct)| distinct).clone();
                let build = || MeshTree::build(loaded, accel, token);
                let tree = Arc::new(pool.install(build)?);
                // The tree keeps its mesh alive even if the file is reloaded.
                let bytes = tree.memory_bytes() + mesh.mesh.mesh.memory_bytes();
                cache.trees.insert(key, key, tree.clone(), bytes);
                tree
            }
        };
        trees.push(tree);
    }
    Ok((trees, kept))
}
