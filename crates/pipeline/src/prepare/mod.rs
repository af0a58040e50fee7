//! Prepares scenes for rendering: from files to the world that rays are traced against.
//!
//! Preparation has three steps. [`SceneCache::parse`] reads the scene file, [`SceneCache::load`] loads meshes
//! and textures, and [`SceneCache::build`] builds trees, lights and the world. Each step is a function of the
//! files and the settings, and reuses earlier results if their keys are unchanged. Between the steps, the
//! session checks whether the image fits in memory and may be written. Preparation itself knows nothing about
//! films, previews, output files and checkpoints.

mod assets;
mod camera;
mod consistent;

use std::sync::Arc;

use rayon::ThreadPool;

pub(crate) use self::assets::SceneAssets;
pub(crate) use self::camera::RequestCamera;
pub(crate) use self::consistent::{FileReader, Reading};
use crate::cache::{CacheOfNamedValues, Memo, RequestCache, oldest_request_to_keep};
use crate::protocol::Stage;
use crate::scene::description::CameraOverrides;
use crate::scene::fingerprint::Fingerprint;
use crate::stages::accel::{AccelCache, AccelResult, build_accel_structures};
use crate::stages::coplanar::warn_about_coplanar_lights;
use crate::stages::glass::find_glass_solids;
use crate::stages::lights::{LightCache, collect_lights};
use crate::stages::meshes::{CachedMesh, MeshPathAndPart, load_meshes};
use crate::stages::parse::{ParsedScene, SceneParseRequest, parse};
use crate::stages::textures::{TextureCache, TextureSelection, find_needed_textures, load_textures};
use crate::stages::{AbortReason, FileReadContext, Findings};
use crate::table::StageRunner;
use crate::world::{CoplanarLight, GlassSolids, TextureRolesNeededByRender, World, WorldInputs};

/// Memory limit for cached files and trees that the current scene does not need.
const MAX_SPARE_BYTES: usize = 256 << 20;

/// Everything read and built for scenes, reused while its keys are unchanged.
#[derive(Default)]
pub(crate) struct SceneCache {
    parsed: Memo<Arc<ParsedScene>>,
    meshes: CacheOfNamedValues<MeshPathAndPart, CachedMesh>,
    glass: Memo<Arc<GlassSolids>>,
    coplanar: Memo<Vec<CoplanarLight>>,
    textures: TextureCache,
    accel: AccelCache,
    lights: LightCache,
    world: Memo<Arc<World>>,
    /// Number of finished requests.
    requests: u64,
}

/// A scene that is ready to be rendered.
pub(crate) struct ReadyScene {
    pub(crate) assets: Arc<SceneAssets>,
    pub(crate) plan: RenderPlan,
    pub(crate) world: Arc<World>,
    /// Key for everything that affects the world's images.
    pub(crate) world_key: Fingerprint,
    /// Key for all surfaces, lights and textures. It does not depend on `origin`.
    pub(crate) surfaces: Fingerprint,
    /// Coordinate origin of the world.
    pub(crate) origin: DVec3,
}

impl SceneCache {
    /// Reads and validates the scene file.
    ///
    /// # Errors
    /// Returns all errors in the scene file.
    pub(crate) fn parse(
        &mut self,
        scene: SceneParseRequest<'_>,
        reading: &mut Reading<'_, '_>,
    ) -> Result<Arc<ParsedScene>, AbortReason> {
        let (Reading { files, table, findings }, memo) = (reading, &mut self.parsed);
        // Reading a model uses all threads.
        table.run(Stage::Parse, || files.pool.install(|| parse(scene, memo, findings, files)))
    }

    /// Loads the meshes and the selected textures of a scene. Tries all files and adds errors to the findings.
    ///
    /// # Errors
    /// The token is canceled, or there is not enough memory.
    pub(crate) fn load(
        &mut self,
        parsed: &Arc<ParsedScene>,
        selection: TextureSelection,
        reading: &mut Reading<'_, '_>,
    ) -> Result<SceneAssets, AbortReason> {
        let (Reading { files, table, findings }, loaded) = (reading, &parsed.loaded);
        let cache = &mut self.meshes;
        let meshes = table.run(Stage::Meshes, || load_meshes(loaded, cache, findings, files))?;
        let needed = find_needed_textures(loaded, &meshes, selection, &self.textures);
        let cache = &mut self.textures;
        let textures =
            table.run(Stage::Textures, || load_textures(loaded, &needed, cache, findings, files))?;
        let glass = find_glass_solids(loaded, &meshes, &mut self.glass, findings, files.token)?;
        warn_about_coplanar_lights(parsed, &meshes, &mut self.coplanar, findings);
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

    /// Builds the trees, lights and world for a scene. `change` contains the request's camera changes.
    ///
    /// # Errors
    /// Returns [`AbortReason::Cancelled`] if the token is canceled.
    pub(crate) fn build(
        &mut self,
        assets: Arc<SceneAssets>,
        plan: RenderPlan,
        change: &CameraOverrides,
        table: &mut StageRunner<'_>,
        pool: &ThreadPool,
    ) -> Result<ReadyScene, AbortReason> {
        let (scene, token) = (&plan.scene, table.token);
        let camera =
            RequestCamera::new(scene, assets.parsed.orbiter, change).rotated_for_turntable(plan.turn);
        let (mesh_keys, orbiter) = (assets.mesh_keys(), camera.orbiter_text());
        let of = keys::scene_references_for_fingerprint(scene, &mesh_keys, orbiter.as_deref());
        let origin = camera.origin_near_camera();
        let (meshes, cache) = (&assets.meshes, &mut self.accel);
        let build = || build_accel_structures(scene, &of, origin, meshes, cache, pool, token);
        let trees = table.run(Stage::Accel, build)?;
        let (geometry, textures, cache) = (&trees.geometry, &assets.textures, &mut self.lights);
        let collect = || Ok(collect_lights(scene, &of, geometry, textures, cache, token)?);
        let lights = table.run(Stage::Lights, collect)?;
        let surfaces = keys::surfaces_and_lights_key(scene, &of, &assets.textures.keys);
        let world_key = keys::world_key(&surfaces, &camera.camera, &of);
        let world = self.world(world_key, &plan, &assets, camera, trees, lights);
        Ok(ReadyScene { assets, plan, world, world_key, surfaces, origin })
    }

    /// Assembles the world, or returns the previous one if the key is unchanged.
    fn world(
        &mut self,
        key: Fingerprint,
        plan: &RenderPlan,
        assets: &SceneAssets,
        camera: RequestCamera,
        trees: AccelResult,
        lights: Arc<Lights>,
    ) -> Arc<World> {
        let key = keys::with_tree_kind(&key, plan.scene.render.accel);
        if let Some(world) = self.world.get(key) {
            return Arc::clone(world);
        }
        let parts = WorldInputs {
            meshes: trees.meshes,
            images: assets.textures.images.clone(),
            orbiter: camera.orbiter,
            camera: Some(camera.camera),
            glass_solids: Some(Arc::clone(&assets.glass)),
        };
        let world = Arc::new(World::new(&plan.scene, &parts, trees.geometry, lights));
        self.world.set(key, Arc::clone(&world));
        world
    }

    /// Ends a request. If it succeeded, values that it did not use become eviction candidates.
    pub(crate) fn end_request(&mut self, success: bool) {
        self.requests += 1;
        let meshes: [&mut dyn RequestCache; 1] = [&mut self.meshes];
        let caches = meshes.into_iter().chain(self.textures.caches()).chain(self.accel.caches());
        let mut caches: Vec<_> = caches.collect();
        caches.iter_mut().for_each(|cache| cache.record_request_usage(success, self.requests));
        let candidates = caches.iter().flat_map(|cache| cache.eviction_candidates());
        let first = oldest_request_to_keep(candidates, MAX_SPARE_BYTES);
        self.meshes.evict_unused_before(first);
        self.textures.evict_unused_before(first);
        self.accel.evict_unused_before(first);
    }
}

#[cfg(test)]
mod tests;
