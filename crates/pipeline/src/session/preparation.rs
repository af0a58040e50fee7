//! Prepares the scene of a request, and checks in between whether its image fits in memory and may be
//! written.

use std::sync::Arc;

use rayon::ThreadPool;

use super::{RequestContext, Session};
use crate::formats::model::ModelViewOptions;
use crate::inputs::ProtectedInputs;
use crate::keys;
use crate::memory::MemoryEstimate;
use crate::plan::{RenderPlan, ShownAndScenePlans};
use crate::prepare::{FileReader, ReadyScene, RequestCamera, SceneAssets, SceneReadAttempt};
use crate::protocol::{Event, Request};
use crate::render::film_state::FilmState;
use crate::scene::description::CameraOverrides;
use crate::settings::AdjustableSceneSettings;
use crate::sink::EventSink;
use crate::stages::parse::{ParsedScene, SceneParseRequest};
use crate::stages::textures::TextureSelection;
use crate::stages::write::check_outputs_are_writable;
use crate::stages::{AbortReason, Findings};
use crate::table::StageRecorder;
use crate::targets::output_conflicts;
use crate::warnings::settings_warnings;

impl Session {
    /// Reads one consistent version of the request's scene and builds its world.
    pub(super) fn prepare_scene(
        &mut self,
        context: &RequestContext<'_>,
        pool: &ThreadPool,
        table: &mut StageRecorder<'_>,
        findings: &mut Findings,
    ) -> Result<ReadyScene, AbortReason> {
        let RequestContext { request, sink, token, .. } = *context;
        let contents = Arc::clone(&self.contents);
        let reader = FileReader { contents: &contents, pool, sink, token };
        let read = |reading: &mut SceneReadAttempt<'_, '_>| self.read_scene(request, reading);
        let (assets, plans) = reader.read_until_files_unchanged(table, findings, read)?;
        let ready = self.build_world(request, Arc::new(assets), plans, table, pool)?;
        self.written.allow_replacing_if_scene_saved(request.saves);
        self.files.last_valid = Some(Arc::clone(&ready.assets));
        Ok(ready)
    }

    /// Reads the scene and all files it needs. Rejects the request as early as possible if its image does not
    /// fit in memory or cannot be written.
    fn read_scene(
        &mut self,
        request: &Request,
        reading: &mut SceneReadAttempt<'_, '_>,
    ) -> Result<(SceneAssets, ShownAndScenePlans), AbortReason> {
        let (Request { overrides, write, .. }, sink) = (request, reading.files.sink);
        let show = ModelViewOptions::from_overrides(overrides);
        let foreign = &overrides.foreign;
        let scene = SceneParseRequest { path: &request.scene, sets: &overrides.sets, show, foreign };
        let parsed = self.scenes.parse_scene(scene, reading)?;
        if !parsed.loaded.is_foreign() {
            let text = parsed.loaded.source.text_without_set_args_as_arc();
            sink.send(Event::Text { generation: request.generation, text });
        }
        let plans = ShownAndScenePlans::resolve(&parsed.loaded.scene, request)?;
        let plan = &plans.shown;
        reading.files.available_memory =
            self.check_memory_and_limit_films(&MemoryEstimate::for_image(plan), request, &plans)?;
        let findings = &mut *reading.findings;
        findings.warnings.extend(settings_warnings(&parsed.loaded, &plan.scene, &plan.settings, overrides));
        send_settings(&parsed, plan, sink);
        findings.record_output_conflicts(
            self.files.protect_inputs_and_find_conflicts(&parsed, plan),
            *write,
            sink,
        )?;
        if findings.conflicts.is_empty() {
            check_outputs_are_writable(*write, plan, sink)?;
        }
        let textures = TextureSelection::ForImage(plans.texture_needs());
        let assets = self.scenes.load_assets(&parsed, textures, reading)?;
        self.files.record_and_report_loaded(reading.findings, sink)?;
        // Otherwise, parts rendered from a half-written file could be merged.
        if plan.shard.is_some() {
            reading.files.contents.wait_for_writers(reading.files.token)?;
        }
        reading.verify_files_unchanged()?;
        self.check_memory_and_limit_films(
            &MemoryEstimate::for_image_and_scene(plan, &assets),
            request,
            &plans,
        )?;
        self.files.protected = ProtectedInputs::from_assets(&assets);
        reading.findings.record_output_conflicts(
            output_conflicts(plan, &self.files.protected),
            *write,
            sink,
        )?;
        Ok((assets, plans))
    }

    /// Checks whether a request fits in memory, and limits the cached films to the remaining memory. If the
    /// request shows another image, the film of the scene's own image also counts. If the two films do not
    /// fit together, the film of the scene's own image may be dropped, but only if that image has been
    /// written. Returns the number of bytes left.
    ///
    /// # Errors
    /// The request needs more memory than is available.
    pub(super) fn check_memory_and_limit_films(
        &mut self,
        estimate: &MemoryEstimate,
        request: &Request,
        plans: &ShownAndScenePlans,
    ) -> Result<u64, AbortReason> {
        let bytes = self.extra_scene_film_bytes(request, plans);
        let all = estimate.clone().with_saved_scene_film(bytes).check(&plans.shown);
        let is_expendable = all.is_err() && self.is_scene_image_written();
        self.own.is_film_expendable = is_expendable;
        let room = if is_expendable { estimate.check(&plans.shown)? } else { all? };
        if is_expendable {
            self.films.unpin();
        }
        self.films.set_byte_limit(room);
        Ok(room)
    }

    /// Returns the size of the own image's film in bytes if it is kept in addition to the request's film.
    fn extra_scene_film_bytes(&self, request: &Request, plans: &ShownAndScenePlans) -> u64 {
        let (Some(own), Some(own_plan)) = (&self.own.current, &plans.own) else { return 0 };
        let of = |plan: &RenderPlan| keys::film_sums_key(own.film, &plan.settings, plan.crop);
        let is_shared = of(&plans.shown) == of(own_plan)
            && request.overrides.camera == request.scene_image_overrides().camera;
        let state = self.films.get(own.film).filter(|state| state.has_samples() && !is_shared);
        state.map_or(0, FilmState::memory_bytes)
    }

    /// Builds the world for the request, and determines the scene's own image.
    pub(super) fn build_world(
        &mut self,
        request: &Request,
        assets: Arc<SceneAssets>,
        plans: ShownAndScenePlans,
        table: &mut StageRecorder<'_>,
        pool: &ThreadPool,
    ) -> Result<ReadyScene, AbortReason> {
        let ShownAndScenePlans { shown, own } = plans;
        let ready = self.scenes.build_ready_scene(assets, shown, &request.overrides.camera, table, pool)?;
        let own = own.unwrap_or_else(|| ready.plan.clone());
        self.own.set_for_request(&ready, own, request.scene_image_overrides().camera, &mut self.films);
        Ok(ready)
    }
}

/// Sends a valid scene's settings.
fn send_settings(parsed: &ParsedScene, plan: &RenderPlan, sink: &EventSink) {
    let scene = &parsed.loaded.scene;
    let camera = RequestCamera::new(&plan.scene, parsed.orbiter, &CameraOverrides::default());
    sink.send(Event::Settings {
        generation: sink.generation,
        settings: Box::new(plan.effective_settings_summary()),
        own: AdjustableSceneSettings {
            camera: camera.resolved_camera(),
            exposure: scene.render.exposure,
            integrator: scene.render.integrator,
            shadows: scene.render.shadows,
            photons: scene.photons.enabled,
        },
    });
}
