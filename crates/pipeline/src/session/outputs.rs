//! Writes the images and reports of a session.

use rayon::ThreadPool;

use super::own_image::writes_own_image;
use super::render::RequestImage;
use super::{RequestContext, Session};
use crate::control::CancelToken;
use crate::output::OutputError;
use crate::plan::RenderPlan;
use crate::protocol::{Report, WriteRequirement, reasons};
use crate::report::finish::write_report;
use crate::sink::EventSink;
use crate::stages::write::{ImageWriteContext, add_frame_and_write_if_last, write_if_wanted};
use crate::stages::{AbortReason, Findings, StageResult};

impl Session {
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
            self.write_own_image_if_shown(context, pool)?;
            return Ok(StageResult::skipped(false, reasons::PREVIEW_ONLY));
        }
        if self.written.has_user_written_image_on_disk(&self.contents) {
            return Ok(StageResult::skipped(false, reasons::OTHER_IMAGE_WRITTEN));
        }
        let state = self.films.existing()?;
        let (inputs, contents) = (&self.files.protected, &*self.contents);
        let to = ImageWriteContext { plan, inputs, contents, is_own: true, sink };
        let written = &mut self.written;
        let wrote = match plan.outputs.is_empty() {
            true => StageResult::done(true, ""),
            false => pool.install(|| write_if_wanted(request.write, state, to, written, token))?,
        };
        self.own.record_written(wrote.value, &mut self.written);
        let Some(turn) = plan.turn.filter(|_| !plan.moving.is_empty()) else { return Ok(wrote) };
        let written = &mut self.written;
        pool.install(|| add_frame_and_write_if_last(state, to, turn, written, token))
    }

    /// Writes the scene's own image if the request shows another view of its finished film.
    ///
    /// # Errors
    /// Returns [`AbortReason::Cancelled`] if writing is canceled.
    fn write_own_image_if_shown(
        &mut self,
        context: &RequestContext<'_>,
        pool: &ThreadPool,
    ) -> Result<(), AbortReason> {
        let RequestContext { sink, writing: token, .. } = *context;
        let is_written = self.own.is_written(&self.written);
        if is_written || self.written.has_user_written_image_on_disk(&self.contents) {
            return Ok(());
        }
        let (Some(own), Some(state)) = (&self.own.current, self.films.current()) else { return Ok(()) };
        let plan = &own.plan;
        let is_simple = plan.layers.is_empty() && plan.turn.is_none() && !plan.outputs.is_empty();
        if state.key != own.film || !is_simple || !state.is_finished(plan) {
            return Ok(());
        }
        let (inputs, contents) = (&self.files.protected, &*self.contents);
        let to = ImageWriteContext { plan, inputs, contents, is_own: true, sink };
        let written = &mut self.written;
        let wrote = pool.install(|| write_if_wanted(WriteRequirement::Try, state, to, written, token))?;
        self.own.record_written(wrote.value, &mut self.written);
        Ok(())
    }

    /// Removes or saves the checkpoint of the scene's own image after the write stage.
    pub(super) fn finish_checkpoint(
        &self,
        context: &RequestContext<'_>,
        image: &RequestImage,
        is_written: bool,
    ) {
        let Some(state) = self.films.current().filter(|_| writes_own_image(context.request)) else { return };
        if let Some(checkpointer) = self.own.checkpointer(image.film, &self.files.protected, context.sink) {
            let is_written = is_written || self.own.is_written(&self.written);
            checkpointer.finish(state, state.traced, is_written, context.commands.interruption());
        }
    }

    /// Writes a report of the current image to the path in its plan.
    pub(super) fn write_report(&self, report: &Report, sink: &EventSink, token: &CancelToken) {
        let Some(current) = &self.current else { return };
        if let Err(error) = write_report(&current.plan, &self.files.protected, report, sink, token) {
            let is_cancelled = matches!(error, OutputError::Cancelled(_));
            let message =
                if is_cancelled { format!("report not written: {error}") } else { error.to_string() };
            sink.send_write_failed(None, message);
        }
    }
}
