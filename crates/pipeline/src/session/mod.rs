//! The engine runs the stages of a request, from the scene file to images on disk, and keeps state between
//! requests.

mod eviction;
mod orders;
mod outcome;
mod outputs;
mod own;
#[cfg(test)]
mod tests;
mod unfinished;

use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuilder};

pub(super) use self::orders::{Interruption, PendingCommands, RequestContext};
use self::outcome::CompletedRequest;
pub use self::outcome::{RenderFailure, RenderedImage};
use self::outputs::remove_outdated_report;
use self::own::{SavedSceneImage, saved_scene_plan, texture_needs_with_saved_scene};
use self::unfinished::LastValidScene;
use super::assembly::{KeyedWorld, RequestCamera, build_or_reuse_world};
use super::cache::{CacheOfNamedValues, Memo};
use super::formats::model::ModelViewOptions;
use super::inputs::ProtectedInputs;
use super::keys;
use super::memory::MemoryEstimate;
use super::plan::{OutputNameSource, RenderPlan, resolve_plan, thread_count};
use super::protocol::{Event, Failure, MaxPreviewSize, Report, Request, Stage, Status};
use super::queries::{QueryContext, QueryOrEdit};
use super::render::checkpointer::CheckpointLock;
use super::render::film_cache::FilmCache;
use super::render::film_state::FilmState;
use super::render::first_picture::CoarseImageRenderer;
use super::render::preview::PreviewSender;
use super::render::scheduler::RenderStageInputs;
use super::render::share::Shard;
use super::report::finish::{RequestResults, make_report};
use super::settings::{KeyboardOverridableSettings, Overrides, ViewMode};
use super::sink::EventSink;
use super::stages::accel::{AccelCache, build_accel_structures};
use super::stages::containers::GltfContainers;
use super::stages::coplanar::warn_about_coplanar_lights;
use super::stages::glass::find_glass_solids;
use super::stages::lights::{EnvironmentMapMemo, collect_lights};
use super::stages::meshes::{CachedMesh, MeshPathAndPart, MeshesByFileIndex, load_meshes};
use super::stages::parse::{ParsedScene, SceneParseRequest, parse};
use super::stages::photons::{PhotonCache, PhotonContext, PhotonStore, trace_first_photons};
use super::stages::render::render;
use super::stages::textures::{
    NeededTextures, TextureCache, Textures, add_check_only_textures, find_textures_needed_for_view,
    load_textures,
};
use super::stages::write::{
    ImageWriteContext, RenderedTurntableFrames, WrittenImages, check_targets, write_on_request,
};
use super::stages::{AbortReason, FileReadContext, Findings, StageResult};
use super::stopwatch::PausableStopwatch;
use super::table::StageRunner;
use super::targets::output_conflicts;
use super::trace::{TileKernel, Tracer};
use super::warnings::settings_warnings;
use super::watch::content::{FileHashCache, FilePathAndContentId, FilesSeenByRequest};
use crate::control::CancelToken;
use crate::integrators::RayCounters;
use crate::lights::Lights;
use crate::math::DVec3;
use crate::messages::NO_IMAGE;
use crate::scene::description::CameraOverrides;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Fingerprint;
use crate::system::priority;
use crate::system::threads::{check_thread_stack_memory, describe_start_failure, logical_cpu_count};
use crate::world::{CoplanarLight, GlassSolids, TextureRolesNeededByRender, World};

/// Engine configuration, which tests override.
#[derive(Clone, Copy)]
pub(super) struct EngineConfig {
    pub(super) kernel: TileKernel,
    /// Maximum film size in bytes.
    pub(super) most_film_bytes: u64,
    /// Niceness of the render threads relative to the thread that starts them.
    pub(super) nice: u8,
}

impl Default for EngineConfig {
    fn default() -> Self {
        Self { kernel: crate::integrators::render_tile_with_photons, most_film_bytes: u64::MAX, nice: 0 }
    }
}

/// Runs requests and keeps state between them.
pub(super) struct Engine {
    config: EngineConfig,
    contents: Arc<FileHashCache>,
    parsed: Memo<Arc<ParsedScene>>,
    meshes: CacheOfNamedValues<MeshPathAndPart, CachedMesh>,
    bodies: Memo<Arc<GlassSolids>>,
    coplanar: Memo<Vec<CoplanarLight>>,
    textures: TextureCache,
    accel: AccelCache,
    /// Number of finished requests.
    requests: u64,
    lights: Memo<Arc<Lights>>,
    sky: EnvironmentMapMemo,
    world: Memo<Arc<World>>,
    photons: PhotonCache,
    films: FilmCache,
    written: WrittenImages,
    own: Option<SavedSceneImage>,
    /// Save count from the newest request with a valid scene.
    saves: u64,
    /// Whether the film of the scene's own image is kept while other images are rendered.
    pins_own: bool,
    /// Whether the current film belongs to the scene's own image.
    is_own: bool,
    /// Report of the newest request, if it has finished.
    report: Option<Report>,
    /// Finished frames of a turntable.
    frames: RenderedTurntableFrames,
    /// Plan of the current film.
    plan: Option<RenderPlan>,
    query_context: Option<QueryContext>,
    /// The last valid scene, with the files it references.
    good: Option<LastValidScene>,
    /// Speed at which the most recent first image was rendered, in pixels per second.
    coarse_rate: Cell<Option<f64>>,
    pool: Option<Arc<ThreadPool>>,
    /// Assets of the last valid scene, which are watched while the scene file is broken.
    assets: Vec<FilePathAndContentId>,
    /// All files that must not be written: the files of the last valid scene and all files referenced since.
    inputs: ProtectedInputs,
    /// Whether the current scene file is invalid, which means that its referenced files are unknown.
    is_broken: bool,
    /// Lock on the checkpoint file, and the checkpoints already reported.
    checkpoint_lock: RefCell<CheckpointLock>,
}

/// Maximum number of attempts to read one consistent version of the scene's files.
const MAX_READS: usize = 16;

/// A scene that is ready to be rendered.
#[derive(Clone)]
struct ReadyScene {
    parsed: Arc<ParsedScene>,
    plan: RenderPlan,
    world: KeyedWorld,
    /// Key for all surfaces, lights and textures. It does not depend on `origin`.
    surfaces: Fingerprint,
    origin: DVec3,
    /// The film's key.
    film: Fingerprint,
    texels_loaded: u64,
    texture_memory_bytes: u64,
    /// Share of the image that this process renders, or `None` for the whole image.
    share: Option<Shard>,
}

impl Engine {
    pub(super) fn new(config: EngineConfig, contents: Arc<FileHashCache>) -> Self {
        Self {
            config,
            contents,
            parsed: Memo::default(),
            meshes: CacheOfNamedValues::default(),
            bodies: Memo::default(),
            coplanar: Memo::default(),
            textures: TextureCache::default(),
            accel: AccelCache::default(),
            requests: 0,
            lights: Memo::default(),
            sky: EnvironmentMapMemo::default(),
            world: Memo::default(),
            photons: PhotonCache::default(),
            films: FilmCache::default(),
            written: WrittenImages::default(),
            own: None,
            saves: 0,
            pins_own: true,
            is_own: true,
            report: None,
            frames: RenderedTurntableFrames::default(),
            plan: None,
            query_context: None,
            good: None,
            coarse_rate: Cell::new(None),
            pool: None,
            assets: Vec::new(),
            inputs: ProtectedInputs::default(),
            is_broken: false,
            checkpoint_lock: RefCell::default(),
        }
    }

    /// Runs a request and sends its outcome. If the scene is invalid, renders the last valid one.
    pub(super) fn handle_request(
        &mut self,
        request: &Request,
        sink: &EventSink,
        context: &RequestContext<'_>,
    ) {
        let generation = request.generation;
        let outcome = self.run_request(request, sink, context);
        let is_broken = matches!(outcome, Err(AbortReason::Failed(Failure::Scene(_))));
        sink.send(match outcome {
            Ok(CompletedRequest { report, conflicts, warnings, unchanged }) => {
                let warnings = [conflicts, warnings].concat();
                Event::Done { generation, report: Box::new(report), warnings, unchanged }
            }
            Err(AbortReason::Cancelled) => Event::Cancelled { generation },
            Err(AbortReason::Failed(failure)) => Event::Failed { generation, failure },
        });
        if is_broken {
            self.render_and_write_last_valid_scene(request, sink, context);
        }
    }

    /// Runs a request and returns its outcome.
    fn run_request(
        &mut self,
        request: &Request,
        sink: &EventSink,
        context: &RequestContext<'_>,
    ) -> Result<CompletedRequest, AbortReason> {
        let generation = request.generation;
        sink.send(Event::Started { generation });
        let mut findings = Findings::default();
        let before = self.current_image_key_and_view();
        let outcome = self.run_all_request_stages(request, sink, context, &mut findings);
        if let Err(AbortReason::Failed(Failure::Scene(diagnostics))) = &outcome {
            findings.watch_underlined_files(diagnostics, &request.scene, &self.contents, context.token);
        }
        // Watched files must not be written.
        self.inputs.add_read(&findings.files);
        match &outcome {
            Ok(_) => self.is_broken = false,
            Err(AbortReason::Failed(Failure::Scene(_))) => self.is_broken = true,
            Err(AbortReason::Failed(Failure::Work(_)) | AbortReason::Cancelled) => {}
        }
        if let Ok(report) = &outcome {
            self.report = Some(report.clone());
            let is_by_hand = self.written.has_user_written_image_on_disk(&self.contents);
            if request.own.is_none() && findings.conflicts.is_empty() && !is_by_hand {
                self.write_report(report, sink, context.writing);
            }
        }
        self.report_read_files(&findings, sink);
        // Even if the render was stopped, keep completely read files for later requests.
        let is_read = self.good.as_ref().is_some_and(|good| good.generation == generation);
        self.record_request_usage(outcome.is_ok() || is_read);
        let report = outcome?;
        let settled = |stage: Stage| report.stages[stage as usize].status != Status::Done;
        let unchanged =
            self.current_image_key_and_view() == before && settled(Stage::Render) && settled(Stage::Write);
        let Findings { conflicts, warnings, .. } = findings;
        Ok(CompletedRequest { report, conflicts, warnings, unchanged })
    }

    /// Returns the current image's key and view.
    fn current_image_key_and_view(&self) -> (Option<Fingerprint>, Option<ViewMode>) {
        let view = self.plan.as_ref().map(|plan| plan.settings.view);
        (self.films.current().map(|state| state.key), view)
    }

    /// Sends a preview of the current image at another size, outside of a request.
    pub(super) fn send_resized_preview(
        &mut self,
        bounds: Option<MaxPreviewSize>,
        sink: &EventSink,
        token: &CancelToken,
    ) {
        if let (Some(state), Some(plan), Some(pool)) = (self.films.current_mut(), &self.plan, &self.pool) {
            PreviewSender { bounds, plan, sink }.send_film_preview(state, pool, token);
        }
    }

    /// Answers a query about the current image, outside of a request.
    pub(super) fn answer_query(&self, query: &QueryOrEdit, sink: &EventSink) {
        match &self.query_context {
            Some(query_context) => query_context.run(query, self.films.current(), &self.inputs, sink),
            None => query.report_failure(NO_IMAGE, sink),
        }
    }

    fn run_all_request_stages(
        &mut self,
        request: &Request,
        sink: &EventSink,
        context: &RequestContext<'_>,
        findings: &mut Findings,
    ) -> Result<Report, AbortReason> {
        let watch = PausableStopwatch::start(context.token);
        let mut table = StageRunner { sink, token: context.token, stages: Vec::new(), is_silent: false };
        // A turntable never revisits earlier images.
        if request.overrides.turn.is_some() {
            self.films = FilmCache::default();
        }
        let mut ready = self.prepare_consistent_scene(request, &mut table, context.token, findings)?;
        let photons = self.make_current_and_trace_photons(request, &ready, &mut table, sink, context)?;
        let share = self.assigned_shard(&ready.plan, photons);
        // A share may render fewer samples than the whole image.
        if let Some(share) = &share {
            ready.plan.settings.render.samples = share.samples_per_pixel();
        }
        ready.share = share;
        self.record_scene_image_shard(request, &ready);
        self.report_saved_scene_image_state(request, ready.film, sink);
        let rays = table.run(Stage::Render, || self.render(request, &ready, photons, sink, context))?;
        // Symbolic links and files may have changed during the render.
        self.check_conflicts(request, &ready.plan, findings, sink)?;
        let was_own_written = self.is_saved_scene_image_written();
        let written = table.run(Stage::Write, || {
            self.run_write_stage(request, &ready.plan, findings, sink, context.writing)
        });
        let is_written = written.as_ref().is_ok_and(|is_written| *is_written);
        self.report_saved_scene_image_state(request, ready.film, sink);
        let film = own::request_writes_saved_scene_image(request).then_some(ready.film);
        let interruption = || context.orders.cancellation_cause();
        self.with_checkpointer(film, sink, &interruption, |checkpointer, engine| {
            if let (Some(checkpointer), Some(state)) = (checkpointer, engine.films.current()) {
                checkpointer.finish(state, state.traced, is_written || engine.is_saved_scene_image_written());
            }
        });
        let is_written = written?;
        let pool = self.render_thread_pool(ready.plan.threads)?;
        let Some(state) = self.films.current() else {
            return Err(AbortReason::work_failure("the film is missing"));
        };
        let finished = RequestResults {
            scene: &ready.parsed.loaded.path,
            plan: &ready.plan,
            world: &ready.world.1,
            state,
            films: &self.films,
            rays,
            texels_loaded: ready.texels_loaded,
            texture_memory_bytes: ready.texture_memory_bytes,
            photons: photons.and_then(|key| self.photons.get(key)).map(PhotonStore::report),
            is_written,
        };
        let (stages, seconds) = (table.stages, watch.seconds());
        if let Some(own) = self.own.as_ref().filter(|_| request.own.is_some())
            && self.is_saved_scene_image_written()
            && !was_own_written
        {
            let finished = RequestResults { plan: &own.plan, is_written: true, ..finished };
            let report = pool.install(|| make_report(&finished, stages.clone(), seconds));
            self.write_report(&report, sink, context.writing);
        }
        Ok(pool.install(|| make_report(&finished, stages, seconds)))
    }

    /// Traces photons and makes `ready` the current image. Returns the key of its photons.
    fn make_current_and_trace_photons(
        &mut self,
        request: &Request,
        ready: &ReadyScene,
        table: &mut StageRunner<'_>,
        sink: &EventSink,
        context: &RequestContext<'_>,
    ) -> Result<Option<Fingerprint>, AbortReason> {
        let pool = self.render_thread_pool(ready.plan.threads)?;
        let (plan, world) = (&ready.plan, &ready.world.1);
        let sending = PhotonContext { world, plan, pool: &pool, token: context.token, sink };
        let asked = (plan.scene.photons.enabled, request.overrides.photons);
        let key =
            |of_photons| keys::photons_key(&ready.surfaces, ready.origin, &plan.settings.render, of_photons);
        let own = RequestCamera::new(&plan.scene, ready.parsed.orbiter, &CameraOverrides::default())
            .resolved_camera();
        let query_context = QueryContext {
            own,
            parsed: ready.parsed.clone(),
            sets: request.overrides.sets.clone(),
            world: world.clone(),
            settings: plan.settings,
        };
        let (store, inputs) = (&mut self.photons, &self.inputs);
        let hear = || {
            context.report_write_awaiting_samples(sink);
            context.answer_query(&query_context, None, inputs, sink);
        };
        // Show the scene while the first photons are traced.
        let is_new = request.force || self.films.get(ready.film).is_none();
        let coarse = CoarseImageRenderer {
            tracer: make_tracer(self.config.kernel, &pool, ready, context.token),
            plan,
            is_moved: request.overrides.camera.has_changes(),
            rate: &self.coarse_rate,
        };
        let screen = PreviewSender { bounds: request.preview, plan, sink };
        let before = || if is_new { coarse.show_without_photons(screen, hear) } else { Ok(()) };
        table.run(Stage::Photons, || trace_first_photons(asked, key, store, sending, hear, before))?;
        let photons_key = plan
            .settings
            .without_ineffective_settings()
            .photons
            .filter(|_| plan.settings.gathers_photons())
            .map(key);
        self.plan = Some(ready.plan.clone());
        (self.is_own, self.report) = (request.own.is_none(), None);
        self.query_context = Some(query_context);
        Ok(photons_key)
    }

    /// Runs [`Self::run_stages_before_photons`] on one consistent version of all files.
    fn prepare_consistent_scene(
        &mut self,
        request: &Request,
        table: &mut StageRunner<'_>,
        token: &CancelToken,
        findings: &mut Findings,
    ) -> Result<ReadyScene, AbortReason> {
        self.read_consistently(token, findings, |engine, contents, findings| {
            table.stages.clear();
            engine.run_stages_before_photons(request, table, (contents, token), findings)
        })
    }

    /// Calls `read` repeatedly until no file changes in the meantime, so that images and errors never result
    /// from a mix of file versions. `read` must verify the files that it loads.
    fn read_consistently<T>(
        &mut self,
        token: &CancelToken,
        findings: &mut Findings,
        mut read: impl FnMut(&mut Self, &FilesSeenByRequest, &mut Findings) -> Result<T, AbortReason>,
    ) -> Result<T, AbortReason> {
        for _ in 0..MAX_READS {
            let contents = FilesSeenByRequest::new(Arc::clone(&self.contents));
            let result = read(self, &contents, findings);
            if result.is_err() && !token.is_cancelled() {
                contents.recheck_seen_files(token)?;
            }
            if token.is_cancelled() || contents.changed_file().is_none() {
                return result;
            }
            findings.reset();
        }
        Err(AbortReason::work_failure(
            "the scene's files keep changing while they are being read; try again once they are complete",
        ))
    }

    /// Runs all stages up to photon tracing and rendering.
    fn run_stages_before_photons(
        &mut self,
        request: &Request,
        table: &mut StageRunner<'_>,
        (contents, token): (&FilesSeenByRequest, &CancelToken),
        findings: &mut Findings,
    ) -> Result<ReadyScene, AbortReason> {
        let containers = GltfContainers::default();
        let show = ModelViewOptions::from_overrides(&request.overrides);
        // Create the thread pool before parsing, because reading a model uses all threads. The thread count
        // does not depend on the scene.
        let pool = self.render_thread_pool(thread_count(&request.overrides))?;
        let parsed = table.run(Stage::Parse, || {
            let origin = SceneParseRequest { path: &request.scene, sets: &request.overrides.sets, show };
            pool.install(|| parse(origin, (contents, &containers), &mut self.parsed, findings, token))
        })?;
        let text = parsed.loaded.source.file_text_as_arc();
        table.sink.send(Event::Text { generation: request.generation, text });
        let plan = resolve_plan(&parsed.loaded.scene, &request.scene, &request.overrides)
            .map_err(|error| AbortReason::Failed(Failure::Scene(vec![*error])))?;
        let own_image_plan = saved_scene_plan(request, &parsed)?;
        self.check_memory(&MemoryEstimate::for_image(&plan), request, (&plan, own_image_plan.as_ref()))?;
        let settings_warnings =
            settings_warnings(&parsed.loaded, &plan.scene, &plan.settings, &request.overrides);
        findings.warnings.extend(settings_warnings);
        let own = RequestCamera::new(&plan.scene, parsed.orbiter, &CameraOverrides::default());
        let scene = &parsed.loaded.scene;
        table.sink.send(Event::Settings {
            generation: request.generation,
            settings: Box::new(plan.effective.clone()),
            camera: own.resolved_camera(),
            exposure: scene.render.exposure,
            own: KeyboardOverridableSettings {
                integrator: scene.render.integrator,
                shadows: scene.render.shadows,
                photons: scene.photons.enabled,
            },
        });
        let before = std::mem::replace(&mut self.inputs, ProtectedInputs::from_scene(&parsed));
        let looked = self.check_conflicts(request, &plan, findings, table.sink);
        // The current image still shows the previous scene and may still have to be written.
        self.inputs.merge(before);
        looked?;
        if findings.conflicts.is_empty() {
            check_targets(request.write, &plan, table.sink)?;
        }
        let pool = self.render_thread_pool(plan.threads)?;
        let reading =
            FileReadContext { sink: table.sink, token, contents, pool: &pool, containers: &containers };
        // Include textures needed only for the scene's own image, because its film key depends on them.
        let lookups = texture_needs_with_saved_scene(&plan, own_image_plan.as_ref());
        let (meshes, bodies, textures, needed) =
            self.load_assets(&parsed, lookups, findings, table, &reading)?;
        // Otherwise, parts rendered from a half-written file could be merged.
        if plan.shard.is_some() {
            contents.wait_for_writers(token)?;
        }
        verify_files_unchanged(contents, token)?;
        let estimate =
            MemoryEstimate::for_image_and_scene(&plan, &plan.scene, &meshes, textures.memory_bytes);
        self.check_memory(&estimate, request, (&plan, own_image_plan.as_ref()))?;
        self.inputs = collect_protected_inputs(&parsed, &meshes, findings);
        self.check_conflicts(request, &plan, findings, table.sink)?;
        let (generation, textures, files) = (request.generation, Arc::new(textures), findings.files.clone());
        let good = LastValidScene { generation, parsed, meshes, bodies, textures, needed, files };
        let ready = self.build_world(request, &good, (plan, own_image_plan), table, &reading)?;
        self.allow_replacing_after_scene_save(request.saves);
        self.good = Some(good);
        Ok(ready)
    }

    /// Builds the trees, lights and world for a loaded scene.
    fn build_world(
        &mut self,
        request: &Request,
        good: &LastValidScene,
        (plan, own): (RenderPlan, Option<RenderPlan>),
        table: &mut StageRunner<'_>,
        reading: &FileReadContext<'_>,
    ) -> Result<ReadyScene, AbortReason> {
        let LastValidScene { parsed, meshes, bodies, textures, .. } = good;
        let scene = &plan.scene;
        let eye = RequestCamera::new(scene, parsed.orbiter, &request.overrides.camera)
            .rotated_for_turntable(plan.turn);
        let mesh_keys: Vec<Fingerprint> = meshes.iter().map(|mesh| mesh.key).collect();
        // The orbiter camera is small, so include it in the key as text.
        let orbiter = eye.orbiter.map(|camera| format!("{camera:?}"));
        let of = keys::scene_references_for_fingerprint(scene, &mesh_keys, orbiter.as_deref());
        let origin = eye.origin_near_camera();
        let build = || build_accel_structures(scene, (&of, origin), meshes, &mut self.accel, reading);
        let built = table.run(Stage::Accel, build)?;
        let memos = (&mut self.lights, &mut self.sky);
        let gather = || Ok(collect_lights(scene, &of, &built.geometry, textures, memos, reading.token)?);
        let lights = table.run(Stage::Lights, gather)?;
        let surfaces = keys::surfaces_and_lights_key(scene, &of, &textures.keys);
        let parts = (built, lights, Arc::clone(bodies));
        let world = build_or_reuse_world(scene, (&surfaces, &of), parts, textures, &eye, &mut self.world);
        let Textures { texels_loaded, memory_bytes: texture_memory_bytes, .. } = **textures;
        let film = keys::film_sums_key(world.0, &plan.settings, plan.crop);
        let camera = own::saved_scene_overrides(request).camera;
        let own = own.unwrap_or_else(|| plan.clone());
        let own_eye = RequestCamera::new(&own.scene, parsed.orbiter, &camera).rotated_for_turntable(own.turn);
        let own =
            SavedSceneImage::new((parsed, own, &own_eye), (&surfaces, &mesh_keys), (camera, &self.assets));
        self.pin_saved_scene_image(own);
        Ok(ReadyScene {
            parsed: parsed.clone(),
            plan,
            world,
            surfaces,
            origin,
            film,
            texels_loaded,
            texture_memory_bytes,
            share: None,
        })
    }

    /// Returns the share of the image that this process renders, or `None` for the whole image.
    fn assigned_shard(&self, plan: &RenderPlan, photons: Option<Fingerprint>) -> Option<Shard> {
        let emits_photons =
            photons.and_then(|key| self.photons.get(key)).is_some_and(PhotonStore::has_lit_caustic_casters);
        plan.shard.map(|shard| Shard::new(shard, emits_photons, plan.settings.render.samples))
    }

    /// Loads all files that the scene references. Tries every file before returning an error.
    fn load_assets(
        &mut self,
        parsed: &ParsedScene,
        lookups: TextureRolesNeededByRender,
        findings: &mut Findings,
        table: &mut StageRunner<'_>,
        reading: &FileReadContext<'_>,
    ) -> Result<(MeshesByFileIndex, Arc<GlassSolids>, Textures, NeededTextures), AbortReason> {
        let loaded = &parsed.loaded;
        let (cache, mesh_cache) = (&mut self.textures, &mut self.meshes);
        let found = table.run(Stage::Meshes, || load_meshes(loaded, mesh_cache, findings, reading))?;
        let needed = find_textures_needed_for_view(loaded, &found, lookups, cache);
        let texels =
            table.run(Stage::Textures, || load_textures(loaded, &needed, cache, findings, reading))?;
        self.assets = findings.files.clone();
        let bodies = find_glass_solids(loaded, &found, &mut self.bodies, findings, reading.token)?;
        warn_about_coplanar_lights(parsed, &found, &mut self.coplanar, findings);
        if findings.errors.is_empty() {
            self.report_read_files(findings, table.sink);
            let warnings = [findings.conflicts.as_slice(), &findings.warnings].concat();
            let generation = table.sink.generation;
            table.sink.send(Event::Warnings { generation, warnings });
            Ok((found, bodies, texels, needed))
        } else {
            Err(AbortReason::Failed(findings.take_diagnostics_as_failure()))
        }
    }

    fn render(
        &mut self,
        request: &Request,
        ready: &ReadyScene,
        photons: Option<Fingerprint>,
        sink: &EventSink,
        context: &RequestContext<'_>,
    ) -> Result<StageResult<RayCounters>, AbortReason> {
        let pool = self.render_thread_pool(ready.plan.threads)?;
        let (plan, orders) = (&ready.plan, context.orders);
        let key = ready.film;
        let watch = PausableStopwatch::start(context.token);
        // Borrow the state that the stage modifies separately from the state that it reads.
        let (mut films, written) = (std::mem::take(&mut self.films), std::mem::take(&mut self.written));
        let written = std::cell::RefCell::new(written);
        let is_own = request.own.is_none();
        let to = ImageWriteContext { plan, inputs: &self.inputs, contents: &self.contents, is_own, sink };
        let pulse = |state: &FilmState, is_covered: bool| {
            if !is_covered {
                context.report_write_awaiting_samples(sink);
            } else if orders.take_write() && write_on_request(state, to, &mut written.borrow_mut()) {
                remove_outdated_report(plan, to.inputs, sink);
            }
            if let Some(query_context) = &self.query_context {
                context.answer_query(query_context, Some(state), &self.inputs, sink);
            }
        };
        let interruption = || orders.cancellation_cause();
        let film = own::request_writes_saved_scene_image(request).then_some(key);
        let rendered = self.with_checkpointer(film, sink, &interruption, |checkpointer, engine| {
            let rendering = RenderStageInputs {
                tracer: make_tracer(engine.config.kernel, &pool, ready, context.token),
                plan,
                photons: photons.and_then(|key| engine.photons.get(key)),
                preview: request.preview,
                most_film_bytes: engine.config.most_film_bytes,
                force: request.force,
                first: request.first,
                sink,
                pulse: &pulse,
                take_preview: &|| orders.take_preview_resize(),
                is_moved: request.overrides.camera.has_changes(),
                coarse_rate: &engine.coarse_rate,
                share: ready.share.clone(),
                checkpointer,
            };
            render(key, &mut films, &rendering)
        });
        if ready.share.is_some()
            && let Some(state) = films.current_mut()
        {
            state.identity = self.own.as_ref().map(SavedSceneImage::dependencies);
        }
        (self.films, self.written) = (films, written.into_inner());
        let is_reused = rendered.as_ref().is_ok_and(|staged| staged.status == Status::Reused);
        if let Some(state) = self.films.current_mut().filter(|state| state.key == key && !is_reused) {
            state.render_seconds += watch.seconds();
        }
        rendered
    }

    /// Returns the thread pool for a render with `--threads` or the default thread count.
    fn render_thread_pool(&mut self, threads: usize) -> Result<Arc<ThreadPool>, AbortReason> {
        self.thread_pool_for(threads, true)
    }

    /// Returns a pool with `threads` threads, reusing the current pool if it already has that many.
    fn thread_pool_for(
        &mut self,
        threads: usize,
        has_threads_option: bool,
    ) -> Result<Arc<ThreadPool>, AbortReason> {
        if let Some(pool) = self.pool.as_ref().filter(|pool| pool.current_num_threads() == threads) {
            return Ok(pool.clone());
        }
        self.pool = None;
        let name = |index| format!("glimt-{index}");
        let nice = self.config.nice;
        let begin = move |_| priority::lower_thread_priority(nice);
        let failed = |error: &dyn Display| {
            AbortReason::work_failure(describe_start_failure(threads, has_threads_option, &error))
        };
        check_thread_stack_memory(threads).map_err(|error| failed(&error))?;
        let builder = ThreadPoolBuilder::new().num_threads(threads).thread_name(name).start_handler(begin);
        let pool = builder.build().map_err(|error| failed(&error))?;
        Ok(self.pool.insert(Arc::new(pool)).clone())
    }

    fn report_read_files(&self, findings: &Findings, sink: &EventSink) {
        let mut files = findings.files.clone();
        let known: HashSet<&Path> = findings.files.iter().map(|file| file.path.as_path()).collect();
        files.extend(self.assets.iter().filter(|asset| !known.contains(asset.path.as_path())).cloned());
        sink.send_files_read(files, findings.files.len(), findings.begun);
    }

    /// Loads the scene and all files it references, needed or not, for `check`.
    pub(super) fn load_scene_and_all_assets(
        &mut self,
        path: &Path,
        sets: &[String],
        sink: &EventSink,
        token: &CancelToken,
    ) -> Result<(Arc<ParsedScene>, MeshesByFileIndex, Textures, Vec<Diagnostic>), Failure> {
        let mut findings = Findings::default();
        let all = self.read_consistently(token, &mut findings, |engine, contents, findings| {
            let containers = GltfContainers::default();
            let origin = SceneParseRequest { path, sets, show: ModelViewOptions::default() };
            let pool = engine.thread_pool_for(logical_cpu_count(), false)?;
            let read = || parse(origin, (contents, &containers), &mut engine.parsed, findings, token);
            let parsed = pool.install(read)?.value;
            let reading = FileReadContext { sink, token, contents, pool: &pool, containers: &containers };
            let loaded = &parsed.loaded;
            let found = load_meshes(loaded, &mut engine.meshes, findings, &reading)?.value;
            let mut wanted = find_textures_needed_for_view(
                loaded,
                &found,
                TextureRolesNeededByRender::ALL,
                &engine.textures,
            );
            add_check_only_textures(loaded, &mut wanted.textures);
            wanted.are_required = true;
            let texels = load_textures(loaded, &wanted, &mut engine.textures, findings, &reading)?.value;
            verify_files_unchanged(contents, token)?;
            find_glass_solids(loaded, &found, &mut engine.bodies, findings, token)?;
            warn_about_coplanar_lights(&parsed, &found, &mut engine.coplanar, findings);
            let overrides = Overrides::default();
            let plan = resolve_plan(&loaded.scene, path, &overrides)
                .map_err(|error| AbortReason::Failed(Failure::Scene(vec![*error])))?;
            findings.warnings.extend(settings_warnings(loaded, &plan.scene, &plan.settings, &overrides));
            if plan.named_by == OutputNameSource::Scene {
                let inputs = collect_protected_inputs(&parsed, &found, findings);
                findings.errors.extend(output_conflicts(&plan, &inputs));
            }
            Ok((parsed, found, texels))
        });
        self.record_request_usage(all.is_ok());
        match all {
            Ok((parsed, found, texels)) if findings.errors.is_empty() => {
                Ok((parsed, found, texels, findings.warnings))
            }
            Ok(_) => Err(findings.take_diagnostics_as_failure()),
            Err(AbortReason::Failed(failure)) => Err(failure),
            Err(AbortReason::Cancelled) => Err(Failure::Work("cancelled".to_owned())),
        }
    }
}

/// Checks that no file has changed since the request first saw it.
///
/// # Errors
/// A file has changed, or the token is canceled.
fn verify_files_unchanged(contents: &FilesSeenByRequest, token: &CancelToken) -> Result<(), AbortReason> {
    contents.recheck_seen_files(token)?;
    let changed =
        contents.changed_file().map(|path| format!("{} changed while it was being read", path.display()));
    changed.map_or(Ok(()), |message| Err(AbortReason::work_failure(message)))
}

/// Creates a tracer for a scene, without photons.
fn make_tracer<'a>(
    kernel: TileKernel,
    pool: &'a ThreadPool,
    ready: &'a ReadyScene,
    token: &'a CancelToken,
) -> Tracer<'a> {
    Tracer {
        kernel,
        pool,
        world: &ready.world.1,
        settings: &ready.plan.settings,
        token,
        photons: None,
        first: 0,
        layers: None,
    }
}

/// Collects the files referenced by the scene and all other files that were read.
fn collect_protected_inputs(
    parsed: &ParsedScene,
    meshes: &MeshesByFileIndex,
    findings: &Findings,
) -> ProtectedInputs {
    let mut inputs = ProtectedInputs::from_scene(parsed);
    inputs.add_mesh_dependencies(&parsed.loaded, meshes);
    inputs.add_read(&findings.files);
    inputs
}
