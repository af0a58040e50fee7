//! Prepares scenes for rendering: from files to the world that rays are traced against.
//!
//! Preparation has three steps. [`SceneCache::parse_scene`] reads the scene file, [`SceneCache::load_assets`]
//! loads meshes and textures, and [`SceneCache::build_ready_scene`] builds trees, lights and the world. Each
//! step is a function of the files and the settings, and reuses earlier results if their keys are unchanged.
//! Between the steps, the session checks whether the image fits in memory and may be written. Preparation
//! itself knows nothing about films, previews, output files and checkpoints.

mod assets;
mod build;
mod camera;
mod consistent;

use std::sync::Arc;

pub(crate) use self::assets::SceneAssets;
pub(crate) use self::build::ReadyScene;
pub(crate) use self::camera::RequestCamera;
pub(crate) use self::consistent::{FileReader, SceneReadAttempt};
use crate::cache::{CacheOfNamedValues, EvictableCache, Memo, oldest_request_to_keep};
use crate::protocol::Stage;
use crate::stages::accel::AccelCache;
use crate::stages::coplanar::warn_about_coplanar_lights;
use crate::stages::glass::find_glass_solids;
use crate::stages::lights::LightCache;
use crate::stages::meshes::{CachedMesh, MeshPathAndOptions, load_meshes};
use crate::stages::parse::{ParsedScene, SceneParseRequest, parse_or_reuse_scene};
use crate::stages::textures::{TextureCache, TextureSelection, find_needed_textures, load_textures};
use crate::stages::{AbortReason, FileReadContext, Findings};
use crate::world::{CoplanarLight, GlassSolids, TextureRolesNeededByRender, World};

/// Memory limit for cached files and trees that the current scene does not need.
const MAX_SPARE_BYTES: usize = 256 << 20;

/// Everything read and built for scenes, reused while its keys are unchanged.
#[derive(Default)]
pub(crate) struct SceneCache {
    parsed: Memo<Arc<ParsedScene>>,
    meshes: CacheOfNamedValues<MeshPathAndOptions, CachedMesh>,
    glass: Memo<Arc<GlassSolids>>,
    coplanar: Memo<Vec<CoplanarLight>>,
    textures: TextureCache,
    accel: AccelCache,
    lights: LightCache,
    world: Memo<Arc<World>>,
    /// Number of finished requests.
    requests: u64,
}

impl SceneCache {
    /// Reads and validates the scene file.
    ///
    /// # Errors
    /// Returns all errors in the scene file.
    pub(crate) fn parse_scene(
        &mut self,
        scene: SceneParseRequest<'_>,
        reading: &mut SceneReadAttempt<'_, '_>,
    ) -> Result<Arc<ParsedScene>, AbortReason> {
        let SceneReadAttempt { files, table, findings } = reading;
        let stage = table.start(Stage::Parse);
        // Reading a model uses all threads.
        let parsed = files.pool.install(|| parse_or_reuse_scene(scene, &mut self.parsed, findings, files))?;
        Ok(stage.finish(parsed))
    }

    /// Loads the meshes and the selected textures of a scene. Tries all files and adds errors to the
    /// findings.
    ///
    /// # Errors
    /// The token is canceled, or there is not enough memory.
    pub(crate) fn load_assets(
        &mut self,
        parsed: &Arc<ParsedScene>,
        selection: TextureSelection,
        reading: &mut SceneReadAttempt<'_, '_>,
    ) -> Result<SceneAssets, AbortReason> {
        let (SceneReadAttempt { files, table, findings }, loaded) = (reading, &parsed.loaded);
        let stage = table.start(Stage::Meshes);
        let meshes = stage.finish(load_meshes(loaded, &mut self.meshes, findings, files)?);
        let needed = find_needed_textures(loaded, &meshes, selection, &self.textures);
        let stage = table.start(Stage::Textures);
        let textures = stage.finish(load_textures(loaded, &needed, &mut self.textures, findings, files)?);
        let (glass, coplanar) = (&mut self.glass, &mut self.coplanar);
        let glass = files.pool.install(|| {
            let glass = find_glass_solids(loaded, &meshes, glass, findings, files.token)?;
            warn_about_coplanar_lights(parsed, &meshes, coplanar, findings);
            Ok::<_, AbortReason>(glass)
        })?;
        let (parsed, textures, files) = (Arc::clone(parsed), Arc::new(textures), findings.files.clone());
        Ok(SceneAssets { parsed, meshes, glass, textures, needed, files })
    }

    /// Loads the textures that another image of a scene needs. Returns `None` if any other file has changed
    /// since the scene was loaded, because it may no longer match the data in memory.
    ///
    /// # Errors
    /// The token is canceled, or there is not enough memory.
    pub(crate) fn load_missing_textures(
        &mut self,
        assets: &Arc<SceneAssets>,
        roles: TextureRolesNeededByRender,
        reading: &FileReadContext<'_>,
    ) -> Result<Option<Arc<SceneAssets>>, AbortReason> {
        let loaded = &assets.parsed.loaded;
        let selection = TextureSelection::ForImage(roles);
        let needed = find_needed_textures(loaded, &assets.meshes, selection, &self.textures);
        if needed.textures.iter().all(|one| assets.needed.textures.contains(one)) {
            return Ok(Some(Arc::clone(assets)));
        }
        if assets.have_files_changed(reading)? {
            return Ok(None);
        }
        let mut findings = Findings::default();
        // A texture is missing here if its file has since become invalid.
        let textures = load_textures(loaded, &needed, &mut self.textures, &mut findings, reading)?.value;
        let files = [assets.files.as_slice(), &findings.files].concat();
        let assets =
            SceneAssets { textures: Arc::new(textures), needed, files, ..SceneAssets::clone(assets) };
        Ok(Some(Arc::new(assets)))
    }

    /// Ends a request. If it succeeded, values that it did not use become eviction candidates.
    pub(crate) fn end_request(&mut self, success: bool) {
        self.requests += 1;
        let meshes: [&mut dyn EvictableCache; 1] = [&mut self.meshes];
        let caches = meshes.into_iter().chain(self.textures.caches_mut()).chain(self.accel.caches_mut());
        let mut caches: Vec<_> = caches.collect();
        caches.iter_mut().for_each(|cache| cache.record_request_usage(success, self.requests));
        let candidates = caches.iter().flat_map(|cache| cache.eviction_candidates());
        let first = oldest_request_to_keep(candidates, MAX_SPARE_BYTES);
        caches.iter_mut().for_each(|cache| cache.evict_unused_before(first));
        self.textures.forget_links_of_evicted_images();
    }
}

#[cfg(test)]
mod tests;
