//! The stage table, which times each stage and reports its start and end.

use super::protocol::{Stage, StageReport, Status};
use super::sink::EventSink;
use super::stages::{AbortReason, StageResult};
use super::stopwatch::PausableStopwatch;
use crate::control::CancelToken;
use crate::system::cpu_time::process_cpu_seconds;

/// Runs the stages of one request and records their reports.
pub(super) struct StageRunner<'a> {
    sink: &'a EventSink,
    /// Token for pausing work. Pauses do not count toward stage times.
    pub(super) token: &'a CancelToken,
    pub(super) stages: Vec<StageReport>,
    /// Whether events are suppressed.
    is_silent: bool,
}

impl<'a> StageRunner<'a> {
    pub(super) fn new(sink: &'a EventSink, token: &'a CancelToken) -> Self {
        Self { sink, token, stages: Vec::new(), is_silent: false }
    }

    /// Creates a runner that does not report the stages.
    pub(super) fn silent(sink: &'a EventSink, token: &'a CancelToken) -> Self {
        Self { is_silent: true, ..Self::new(sink, token) }
    }

    /// Runs a stage and reports its start and end.
    ///
    /// # Errors
    /// Returns the error from `work`.
    pub(super) fn run<T>(
        &mut self,
        name: Stage,
        work: impl FnOnce() -> Result<StageResult<T>, AbortReason>,
    ) -> Result<T, AbortReason> {
        let watch = PausableStopwatch::start(self.token);
        let before = process_cpu_seconds();
        let report = |status, why| {
            let processor_seconds = process_cpu_seconds() - before;
            StageReport { name, status, seconds: watch.seconds(), processor_seconds, why }
        };
        self.send_report(report(Status::Running, String::new()));
        let staged = work()?;
        let report = report(staged.status, staged.why);
        self.send_report(report.clone());
        self.stages.push(report);
        Ok(staged.value)
    }

    fn send_report(&self, report: StageReport) {
        if !self.is_silent {
            self.sink.send_stage_report(report);
        }
    }
}
