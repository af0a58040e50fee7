//! The engine's output files, and the files it must not overwrite.

use super::super::inputs::ProtectedInputs;
use super::super::plan::RenderPlan;
use super::super::protocol::{ImageReport, Report, Request, WriteRequirement, reasons};
use super::super::render::film_state::FilmState;
use super::super::report::finish::{remove_stale_report, write_report};
use super::super::sink::EventSink;
use super::super::stages::write::{
    ImageWriteContext, add_frame_and_write_if_last, write_if_wanted, write_on_request,
};
use super::super::stages::{AbortReason, Findings, StageResult};
use super::super::targets::output_conflicts;
use super::Engine;
use crate::control::CancelToken;
use crate::messages::{INCOMPLETE_IMAGE, NEWEST_IMAGE_NOT_WRITTEN, NO_IMAGE, SCENE_HAS_ERRORS};
use crate::output::OutputError;

/// Removes an existing report that does not describe the plan's image files.
pub(super) fn remove_outdated_report(plan: &RenderPlan, inputs: &ProtectedInputs, sink: &EventSink) {
    if let Err(error) = remove_stale_report(plan, inputs, sink) {
        sink.send_write_failed(None, format!("the report describes an earlier image: {error}"));
    }
}

impl Engine {
    /// Whether every pixel of the current image has a sample.
    pub(crate) fn has_sample_in_every_pixel(&self) -> bool {
        self.films.current().is_some_and(FilmState::has_sampled_all_pixels)
    }

    /// Writes the current image, outside of a request.
    pub(crate) fn write_now(&mut self, sink: &EventSink) {
        let (Some(state), Some(plan), Some(pool)) = (self.films.current(), &self.plan, &self.pool) else {
            return sink.send_write_failed(None, NO_IMAGE.to_owned());
        };
        if !state.has_sampled_all_pixels() {
            // Earlier requests may have written images.
            let what = if self.written.is_empty() { "no image written" } else { NEWEST_IMAGE_NOT_WRITTEN };
            let message = format!("{what}: {INCOMPLETE_IMAGE}");
            return sink.send_write_failed(None, message);
        }
        if self.is_broken
            && let Some(path) = self.written.first_foreign_file(&plan.outputs, &self.contents)
        {
            let path = path.display();
            let message = format!(
                "no image written: {SCENE_HAS_ERRORS} and may reference {path}, which this run did not write; fix \
                 the scene first"
            );
            return sink.send_write_failed(None, message);
        }
        let to = ImageWriteContext {
            plan,
            inputs: &self.inputs,
            contents: &self.contents,
            is_own: self.is_own,
            sink,
        };
        let written = &mut self.written;
        let is_written = pool.install(|| write_on_request(state, to, written));
        let is_finished = state.is_finished(plan);
        self.record_saved_scene_image_written(is_written && is_finished && self.is_own);
        if is_written {
            self.write_or_remove_report(sink);
        }
        if self.is_saved_scene_image_written() {
            self.remove_saved_scene_checkpoint(sink);
        }
    }

    /// Checks for outputs that must not be written. If the request can continue without writing them, sends
    /// the conflicts to the front end and adds them to the findings.
    ///
    /// # Errors
    /// Returns all conflicts if the image must be written.
    pub(super) fn check_conflicts(
        &self,
        request: &Request,
        plan: &RenderPlan,
        findings: &mut Findings,
        sink: &EventSink,
    ) -> Result<(), AbortReason> {
        let found = output_conflicts(plan, &self.inputs);
        if found.is_empty() {
            findings.conflicts = found;
            return Ok(());
        }
        if request.write == WriteRequirement::Must {
            findings.errors.extend(found);
            return Err(AbortReason::Failed(findings.take_diagnostics_as_failure()));
        }
        if found != findings.conflicts {
            sink.send_write_conflicts(found.clone());
        }
        findings.conflicts = found;
        Ok(())
    }

    /// Writes the report for an image that was written at the user's request. If the render is unfinished,
    /// removes the outdated report instead.
    fn write_or_remove_report(&self, sink: &EventSink) {
        let Some(plan) = &self.plan else { return };
        let Some(report) = &self.report else { return remove_outdated_report(plan, &self.inputs, sink) };
        let paths: Vec<String> =
            plan.outputs.iter().map(|path| path.to_string_lossy().into_owned()).collect();
        let image = ImageReport { path: paths.first().cloned(), paths, ..report.image.clone() };
        // Use a token that is never canceled, because the user requested the image.
        self.write_report(&Report { image, ..report.clone() }, sink, &CancelToken::new());
    }

    /// Writes a request's report after its image has been written or writing has failed.
    pub(super) fn write_report(&self, report: &Report, sink: &EventSink, token: &CancelToken) {
        let Some(plan) = &self.plan else { return };
        if let Err(error) = write_report(plan, &self.inputs, report, sink, token) {
            let is_cancelled = matches!(error, OutputError::Cancelled(_));
            let message =
                if is_cancelled { format!("report not written: {error}") } else { error.to_string() };
            sink.send_write_failed(None, message);
        }
    }

    /// Runs the write stage. Returns whether the image is on disk.
    pub(super) fn run_write_stage(
        &mut self,
        request: &Request,
        plan: &RenderPlan,
        findings: &Findings,
        sink: &EventSink,
        token: &CancelToken,
    ) -> Result<StageResult<bool>, AbortReason> {
        if let Some(conflict) = findings.conflicts.first() {
            return Ok(StageResult::skipped(false, conflict.message.clone()));
        }
        if request.own.is_some() {
            return self.write_image_without_overrides(sink, token);
        }
        if self.written.has_user_written_image_on_disk(&self.contents) {
            return Ok(StageResult::skipped(false, reasons::OTHER_IMAGE_WRITTEN));
        }
        let pool = self.render_thread_pool(plan.threads)?;
        let Some(state) = self.films.current() else {
            return Err(AbortReason::work_failure("the film is missing"));
        };
        let to =
            ImageWriteContext { plan, inputs: &self.inputs, contents: &self.contents, is_own: true, sink };
        let written = &mut self.written;
        let wrote = match plan.outputs.is_empty() {
            true => StageResult::done(true, ""),
            false => pool.install(|| write_if_wanted(request.write, state, to, written, token))?,
        };
        let own = self.own.as_ref().filter(|_| wrote.value);
        written.own = own.map(|own| own.image);
        let Some(turn) = plan.turn.filter(|_| !plan.moving.is_empty()) else { return Ok(wrote) };
        let frames = &mut self.frames;
        pool.install(|| add_frame_and_write_if_last(state, to, (turn, frames), token))
    }
}
