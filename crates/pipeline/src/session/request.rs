//! The steps of a request.

use super::{RequestContext, Session};
use crate::plan::thread_count;
use crate::protocol::{Event, Failure, Report, Stage, StageStatus};
use crate::render::film_cache::FilmCache;
use crate::report::finish::{RequestResults, make_report};
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Fingerprint;
use crate::settings::ViewMode;
use crate::stages::photons::PhotonStore;
use crate::stages::{AbortReason, Findings};
use crate::stopwatch::PausableStopwatch;
use crate::table::StageRecorder;

/// Outcome of a finished request.
pub(crate) struct CompletedRequest {
    pub(crate) report: Report,
    /// Reasons why the image is not written.
    pub(crate) conflicts: Vec<Diagnostic>,
    /// Likely mistakes in the scene.
    pub(crate) warnings: Vec<Diagnostic>,
    /// Whether the displayed image is unchanged.
    pub(crate) unchanged: bool,
}

impl Session {
    /// Runs a request and sends its outcome. If the scene is invalid, renders the last valid one.
    pub(crate) fn handle_request(&mut self, context: &RequestContext<'_>) {
        let generation = context.request.generation;
        let outcome = self.run_request(context);
        let is_broken = matches!(outcome, Err(AbortReason::Failed(Failure::Scene(_))));
        context.sink.send(match outcome {
            Ok(CompletedRequest { report, conflicts, warnings, unchanged }) => {
                let warnings = [conflicts, warnings].concat();
                Event::Done { generation, report: Box::new(report), warnings, unchanged }
            }
            Err(AbortReason::Canceled) => Event::Canceled { generation },
            Err(AbortReason::Failed(failure)) => Event::Failed { generation, failure },
        });
        if is_broken {
            self.render_and_write_last_valid_scene(context);
        }
    }

    /// Runs a request and returns its outcome.
    pub(crate) fn run_request(
        &mut self,
        context: &RequestContext<'_>,
    ) -> Result<CompletedRequest, AbortReason> {
        let RequestContext { request, sink, .. } = *context;
        sink.send(Event::Started { generation: request.generation });
        let mut findings = Findings::default();
        let before = self.current_image_key_and_view();
        let outcome = self.run_stages(context, &mut findings);
        if let Err(AbortReason::Failed(Failure::Scene(diagnostics))) = &outcome {
            findings.watch_files_named_in_errors(diagnostics, &request.scene, &self.contents, context.token);
        }
        if let (Ok(report), Some(current)) = (&outcome, &mut self.current) {
            current.report = Some(report.clone());
            let is_user_written = self.written.has_user_written_image_on_disk(&self.contents);
            if request.own.is_none() && findings.conflicts.is_empty() && !is_user_written {
                self.write_report(report, sink, context.writing);
            }
        }
        self.files.record_request_outcome(&outcome, &findings, sink);
        let report = outcome?;
        let settled = |stage: Stage| report.stages[stage as usize].status != StageStatus::Done;
        let unchanged =
            self.current_image_key_and_view() == before && settled(Stage::Render) && settled(Stage::Write);
        let Findings { conflicts, warnings, .. } = findings;
        Ok(CompletedRequest { report, conflicts, warnings, unchanged })
    }

    /// Runs all stages of a request and returns its report.
    fn run_stages(
        &mut self,
        context: &RequestContext<'_>,
        findings: &mut Findings,
    ) -> Result<Report, AbortReason> {
        let RequestContext { request, sink, token, .. } = *context;
        let watch = PausableStopwatch::start(token);
        let mut table = StageRecorder::new(Some(sink), token);
        // A turntable never revisits earlier images.
        if request.overrides.turn.is_some() {
            self.films = FilmCache::default();
        }
        // Prepare the scene, from its files to the world.
        let pool = self.threads.get_or_create_pool(thread_count(&request.overrides), true)?;
        let scene = self.prepare_scene(context, &pool, &mut table, findings);
        // Even if the render is stopped, keep the files for later requests.
        self.scenes.end_request(scene.is_ok());
        // Trace photons and render the film.
        let mut image = self.make_current_and_trace_photons(context, scene?, &mut table, &pool)?;
        self.assign_share(context, &mut image);
        self.report_scene_image_state(context, &image);
        let stage = table.start(Stage::Render);
        let rays = stage.finish(self.render(context, &image, &pool)?);
        // Write the image.
        let wrote = self.write_image_and_checkpoint(context, &image, &mut table, findings, &pool)?;
        // Report the results.
        let results = RequestResults {
            scene: &image.scene,
            plan: &image.scene.plan,
            is_written: wrote.is_written,
            state: self.films.current_or_error()?,
            films: &self.films,
            rays,
            photons: image.photons.and_then(|key| self.photons.get(key)).map(PhotonStore::to_photons_report),
        };
        let (stages, seconds) = (table.stages, watch.seconds());
        if let Some(own) = self.own.current.as_ref().filter(|_| wrote.has_written_own) {
            let results = RequestResults { plan: &own.plan, is_written: true, ..results };
            let report = pool.install(|| make_report(&results, stages.clone(), seconds));
            self.write_report(&report, sink, context.writing);
        }
        Ok(pool.install(|| make_report(&results, stages, seconds)))
    }

    /// Returns the current image's key and view.
    pub(super) fn current_image_key_and_view(&self) -> (Option<Fingerprint>, Option<ViewMode>) {
        let view = self.current.as_ref().map(|current| current.plan.settings.view);
        (self.films.current().map(|state| state.key), view)
    }
}
