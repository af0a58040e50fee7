//! Renders the last valid scene while the scene file is broken.

use std::cell::Cell;
use std::sync::Arc;

use super::{RequestContext, Session};
use crate::memory::MemoryEstimate;
use crate::plan::ShownAndScenePlans;
use crate::prepare::FileReader;
use crate::protocol::{Event, LastValidSceneRenderOutcome, Request, StageStatus};
use crate::report::finish::remove_outdated_report;
use crate::stages::{AbortReason, Findings};
use crate::table::StageRecorder;

impl Session {
    /// Renders and writes the last valid scene with the overrides from the newest request, whose own scene
    /// cannot be loaded. Does not overwrite files that the broken scene might reference.
    pub(super) fn render_and_write_last_valid_scene(&mut self, context: &RequestContext<'_>) {
        let RequestContext { request, sink, token, writing, commands, .. } = *context;
        let before = self.current_image_key_and_view();
        let request = Request { force: false, ..request.clone() };
        let is_postponed = Cell::new(context.is_postponed.get());
        let context = RequestContext { request: &request, sink, token, writing, commands, is_postponed };
        // Drop errors from this render, because the failed request has already reported its own.
        let end = match self.run_last_valid_scene_stages(&context) {
            Ok(Some(is_reused)) => LastValidSceneRenderOutcome::Finished {
                unchanged: is_reused && self.current_image_key_and_view() == before,
            },
            Ok(None) | Err(_) => LastValidSceneRenderOutcome::Stopped,
        };
        sink.send(Event::LastGoodEnded { generation: request.generation, end });
    }

    /// Renders and writes the last valid scene. Returns whether the existing image and files were reused, or
    /// `None` if there is no valid scene or its files have changed.
    fn run_last_valid_scene_stages(
        &mut self,
        context: &RequestContext<'_>,
    ) -> Result<Option<bool>, AbortReason> {
        let RequestContext { request, sink, token, .. } = *context;
        let last = self.files.last_valid.as_mut();
        let Some(last) = last.filter(|last| last.parsed.loaded.path == request.scene) else {
            return Ok(None);
        };
        // Load the textures needed for another view if their files are still valid.
        let plans = ShownAndScenePlans::resolve(&last.parsed.loaded.scene, request)?;
        let pool = self.threads.get_or_create_pool(plans.shown.limits.threads, true)?;
        let reader = FileReader { contents: &self.contents, pool: &pool, sink, token };
        let roles = plans.texture_needs();
        let assets = reader.read_once_if_files_unchanged(|reading| {
            self.scenes.load_missing_textures(last, roles, reading)
        })?;
        let Some(assets) = assets.flatten() else { return Ok(None) };
        *last = Arc::clone(&assets);
        let estimate = MemoryEstimate::for_image_and_scene(&plans.shown, &assets);
        self.check_memory_and_limit_films(&estimate, request, &plans)?;
        // Prepare the scene, reusing unchanged values, and render it.
        let mut table = StageRecorder::new(None, token);
        let scene = self.build_world(request, assets, plans, &mut table, &pool)?;
        let image = self.make_current_and_trace_photons(context, scene, &mut table, &pool)?;
        let rendered = self.render(context, &image, &pool)?;
        // Write the image. The write stage reports files that cannot be written.
        let plan = &image.scene.plan;
        let is_kept =
            self.contents.outputs.first_foreign_file(&plan.outputs.images, &self.contents).is_some();
        let is_written_now = !is_kept
            && self
                .run_write_stage(context, plan, &Findings::default(), &pool)
                .is_ok_and(|staged| staged.status == StageStatus::Done);
        if is_written_now {
            // Remove the existing report, because it does not describe this image.
            remove_outdated_report(plan, &self.files.protected, sink);
        }
        Ok(Some(rendered.status == StageStatus::Reused && !is_written_now))
    }
}
