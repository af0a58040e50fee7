//! Commands that arrive while no request is running.

use super::{CurrentImage, Session};
use crate::control::CancelToken;
use crate::messages::{INCOMPLETE_IMAGE, NEWEST_IMAGE_NOT_WRITTEN, NO_IMAGE, SCENE_HAS_ERRORS};
use crate::protocol::{ImageReport, PreviewBounds, Report};
use crate::queries::QueryOrEdit;
use crate::render::checkpointer::Interruption;
use crate::render::film_state::FilmState;
use crate::render::preview::PreviewSender;
use crate::report::finish::remove_outdated_report;
use crate::sink::EventSink;
use crate::stages::write::{ImageWriteContext, write_on_request};

impl Session {
    /// Whether every pixel of the current image has a sample.
    pub(crate) fn has_sample_in_every_pixel(&self) -> bool {
        self.films.current().is_some_and(FilmState::has_sampled_all_pixels)
    }

    /// Sends a preview of the current image at another size.
    pub(crate) fn send_resized_preview(
        &mut self,
        bounds: Option<PreviewBounds>,
        sink: &EventSink,
        token: &CancelToken,
    ) {
        if let (Some(state), Some(current), Some(pool)) =
            (self.films.current_mut(), &self.current, self.threads.current_pool())
        {
            PreviewSender { bounds, plan: &current.plan, sink }.send_film_preview(state, pool, token);
        }
    }

    /// Answers a query about the current image.
    pub(crate) fn answer_query(&self, query: &QueryOrEdit, sink: &EventSink) {
        match &self.current {
            Some(current) => current.queries.run(query, self.films.current(), &self.files.protected, sink),
            None => query.report_failure(NO_IMAGE, sink),
        }
    }

    /// Writes the current image.
    pub(crate) fn write_current_image(&mut self, sink: &EventSink) {
        let (Some(state), Some(current), Some(pool)) =
            (self.films.current(), &self.current, self.threads.current_pool())
        else {
            return sink.send_write_failed(None, NO_IMAGE.to_owned());
        };
        let CurrentImage { plan, is_own, .. } = current;
        if !state.has_sampled_all_pixels() {
            // Earlier requests may have written images.
            let what =
                if self.contents.outputs.is_empty() { "no image written" } else { NEWEST_IMAGE_NOT_WRITTEN };
            let message = format!("{what}: {INCOMPLETE_IMAGE}");
            return sink.send_write_failed(None, message);
        }
        if self.files.is_broken
            && let Some(path) = self.contents.outputs.first_foreign_file(&plan.outputs.images, &self.contents)
        {
            let path = path.display();
            let message = format!(
                "no image written: {SCENE_HAS_ERRORS} and may reference {path}, which this run did not write; fix \
                 the scene first"
            );
            return sink.send_write_failed(None, message);
        }
        let (inputs, contents) = (&self.files.protected, &*self.contents);
        let to = ImageWriteContext { plan, inputs, contents, is_own: *is_own, sink };
        let written = &mut self.written;
        let is_written = pool.install(|| write_on_request(state, to, written));
        let is_own_written = is_written && state.is_finished(plan) && *is_own;
        written.own = self.own.current.as_ref().filter(|_| is_own_written).map(|own| own.image);
        if is_written {
            self.write_or_remove_report(current, sink);
        }
        if self.is_scene_image_written() {
            self.remove_scene_image_checkpoint(sink);
        }
    }

    /// Writes the report for an image that was written at the user's request. If the render is unfinished,
    /// removes the outdated report instead.
    fn write_or_remove_report(&self, CurrentImage { plan, report, .. }: &CurrentImage, sink: &EventSink) {
        let Some(report) = report else { return remove_outdated_report(plan, &self.files.protected, sink) };
        let paths: Vec<String> =
            plan.outputs.images.iter().map(|path| path.to_string_lossy().into_owned()).collect();
        let image = ImageReport { path: paths.first().cloned(), paths, ..report.image.clone() };
        // Use a token that is never canceled, because the user requested the image.
        self.write_report(&Report { image, ..report.clone() }, sink, &CancelToken::new());
    }

    /// Removes the checkpoint of the scene's own image after that image has been written.
    fn remove_scene_image_checkpoint(&self, sink: &EventSink) {
        let Some(state) = self.own.current.as_ref().and_then(|own| self.films.get(own.film)) else { return };
        if let Some(checkpointer) = self.own.checkpointer(state.key, &self.files.protected, sink) {
            checkpointer.detect_own_checkpoint(state);
            checkpointer.remove_or_save_checkpoint(state, state.traced, true, Interruption::Replaced);
        }
    }

    /// Saves a checkpoint of the scene's own image if the worker stops while showing another image.
    pub(crate) fn save_scene_image_checkpoint(&self, sink: &EventSink, interruption: Interruption) {
        let own = self.own.current.as_ref().filter(|_| !self.is_scene_image_written());
        let Some(state) = own.and_then(|own| self.films.get(own.film)).filter(|state| !state.is_kept) else {
            return;
        };
        if let Some(checkpointer) = self.own.checkpointer(state.key, &self.files.protected, sink) {
            checkpointer.detect_own_checkpoint(state);
            checkpointer.save_if_canceled(state, state.traced, state.render_seconds, interruption);
        }
    }
}
