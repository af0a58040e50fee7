//! Writes the images and reports of a session.

use rayon::ThreadPool;

use super::render::RequestImageInputs;
use super::{RequestContext, Session};
use crate::control::CancelToken;
use crate::output::OutputError;
use crate::plan::RenderPlan;
use crate::protocol::{Event, Report, SavedSceneRenderStatus, Stage, WriteRequirement, reasons};
use crate::report::finish::write_report;
use crate::sink::EventSink;
use crate::stages::write::{ImageWriteContext, add_frame_and_write_if_last, write_if_wanted};
use crate::stages::{AbortReason, Findings, StageResult};
use crate::table::StageRecorder;
use crate::targets::output_conflicts;

/// Outcome of the write stage.
pub(super) struct WriteOutcome {
    /// Whether the request's image is on disk.
    pub(super) is_written: bool,
    /// Whether the request shows another image than the scene's own, and has written the latter.
    pub(super) has_written_own: bool,
}

impl Session {
    /// Writes the image of a request, and removes or saves the checkpoint of the scene's own image.
    pub(super) fn write_image_and_checkpoint(
        &mut self,
        context: &RequestContext<'_>,
        image: &RequestImageInputs,
        table: &mut StageRecorder<'_>,
        findings: &mut Findings,
        pool: &ThreadPool,
    ) -> Result<WriteOutcome, AbortReason> {
        let (request, plan) = (context.request, &image.scene.plan);
        // Symbolic links and files may have changed during the render.
        let conflicts = output_conflicts(plan, &self.files.protected);
        findings.record_output_conflicts(conflicts, request.write, context.sink)?;
        let was_own_written = self.is_scene_image_written();
        let stage = table.start(Stage::Write);
        let wrote = self.run_write_stage(context, plan, findings, pool).map(|staged| stage.finish(staged));
        self.report_scene_image_state(context, image);
        self.finish_checkpoint(context, image, wrote.as_ref().is_ok_and(|is_written| *is_written));
        let has_written_own = request.own.is_some() && !was_own_written && self.is_scene_image_written();
        Ok(WriteOutcome { is_written: wrote?, has_written_own })
    }

    /// Reports the state of the scene's own image while another image is shown.
    pub(super) fn report_scene_image_state(&self, context: &RequestContext<'_>, image: &RequestImageInputs) {
        let Some(own) = self.own.current.as_ref().filter(|_| context.request.own.is_some()) else { return };
        let state = match self.films.get(own.film) {
            _ if self.is_scene_image_written() => SavedSceneRenderStatus::Written,
            Some(state) if state.has_samples() => {
                SavedSceneRenderStatus::Begun { is_rendering: own.film == image.film }
            }
            Some(_) | None => SavedSceneRenderStatus::NotBegun,
        };
        context.sink.send(Event::OwnImage { generation: context.request.generation, state });
    }

    /// Whether the output files contain the current version of the scene's own image.
    pub(super) fn is_scene_image_written(&self) -> bool {
        self.own.current.as_ref().is_some_and(|own| self.written.own == Some(own.image))
    }

    /// Runs the write stage. Returns whether the image is on disk.
    pub(super) fn run_write_stage(
        &mut self,
        context: &RequestContext<'_>,
        plan: &RenderPlan,
        findings: &Findings,
        pool: &ThreadPool,
    ) -> Result<StageResult<bool>, AbortReason> {
        let RequestContext { request, sink, writing: token, .. } = *context;
        if let Some(conflict) = findings.conflicts.first() {
            return Ok(StageResult::skipped(false, conflict.message.clone()));
        }
        if request.own.is_some() {
            self.write_scene_image_of_same_film(context, pool)?;
            return Ok(StageResult::skipped(false, reasons::PREVIEW_ONLY));
        }
        if self.written.has_user_written_image_on_disk(&self.contents) {
            return Ok(StageResult::skipped(false, reasons::OTHER_IMAGE_WRITTEN));
        }
        let state = self.films.current_or_error()?;
        let (inputs, contents) = (&self.files.protected, &*self.contents);
        let to = ImageWriteContext { plan, inputs, contents, is_own: true, sink };
        let written = &mut self.written;
        let wrote = match plan.outputs.images.is_empty() {
            true => StageResult::done(true, ""),
            false => pool.install(|| write_if_wanted(request.write, state, to, written, token))?,
        };
        written.own = self.own.current.as_ref().filter(|_| wrote.value).map(|own| own.image);
        let Some(turn) = plan.turn.filter(|_| !plan.outputs.animations.is_empty()) else { return Ok(wrote) };
        pool.install(|| add_frame_and_write_if_last(state, to, turn, written, token))
    }

    /// Writes the scene's own image if the request shows another view of its finished film.
    ///
    /// # Errors
    /// Returns [`AbortReason::Canceled`] if writing is canceled.
    fn write_scene_image_of_same_film(
        &mut self,
        context: &RequestContext<'_>,
        pool: &ThreadPool,
    ) -> Result<(), AbortReason> {
        let RequestContext { sink, writing: token, .. } = *context;
        if self.is_scene_image_written() || self.written.has_user_written_image_on_disk(&self.contents) {
            return Ok(());
        }
        let (Some(own), Some(state)) = (&self.own.current, self.films.current()) else { return Ok(()) };
        let plan = &own.plan;
        let is_simple = plan.layers.is_empty() && plan.turn.is_none() && !plan.outputs.images.is_empty();
        if state.key != own.film || !is_simple || !state.is_finished(plan) {
            return Ok(());
        }
        let (inputs, contents) = (&self.files.protected, &*self.contents);
        let to = ImageWriteContext { plan, inputs, contents, is_own: true, sink };
        let written = &mut self.written;
        let wrote = pool.install(|| write_if_wanted(WriteRequirement::Try, state, to, written, token))?;
        written.own = self.own.current.as_ref().filter(|_| wrote.value).map(|own| own.image);
        Ok(())
    }

    /// Removes or saves the checkpoint of the scene's own image after the write stage.
    fn finish_checkpoint(&self, context: &RequestContext<'_>, image: &RequestImageInputs, is_written: bool) {
        let Some(state) = self.films.current().filter(|_| context.request.should_write_scene_image()) else {
            return;
        };
        if let Some(checkpointer) = self.own.checkpointer(image.film, &self.files.protected, context.sink) {
            let is_written = is_written || self.is_scene_image_written();
            checkpointer.remove_or_save_checkpoint(
                state,
                state.traced,
                is_written,
                context.commands.interruption(),
            );
        }
    }

    /// Writes a report of the current image to the path in its plan.
    pub(super) fn write_report(&self, report: &Report, sink: &EventSink, token: &CancelToken) {
        let Some(current) = &self.current else { return };
        if let Err(error) = write_report(&current.plan, &self.files.protected, report, sink, token) {
            let is_canceled = matches!(error, OutputError::Canceled(_));
            let message =
                if is_canceled { format!("report not written: {error}") } else { error.to_string() };
            sink.send_write_failed(None, message);
        }
    }
}
