//! Times each stage and reports its start and end.

use super::protocol::{Event, Stage, StageReport, StageStatus};
use super::sink::EventSink;
use super::stages::StageResult;
use super::stopwatch::PausableStopwatch;
use crate::control::CancelToken;
use crate::system::cpu_time::process_cpu_seconds;

/// Times the stages of one request and records their reports.
pub(super) struct StageRecorder<'a> {
    /// Receives reports of the start and end of each stage.
    sink: Option<&'a EventSink>,
    /// Token for pausing work. Pauses do not count toward stage times.
    pub(super) token: &'a CancelToken,
    pub(super) stages: Vec<StageReport>,
}

impl<'a> StageRecorder<'a> {
    pub(super) fn new(sink: Option<&'a EventSink>, token: &'a CancelToken) -> Self {
        Self { sink, token, stages: Vec::new() }
    }

    /// Starts a stage and reports it as running. A stage that fails is dropped without finishing it.
    pub(super) fn start(&mut self, name: Stage) -> RunningStage<'_, 'a> {
        let (watch, cpu_seconds) = (PausableStopwatch::start(self.token), process_cpu_seconds());
        let stage = RunningStage { table: self, name, watch, cpu_seconds };
        stage.table.send_stage_report(stage.report(StageStatus::Running, String::new()));
        stage
    }

    fn send_stage_report(&self, stage: StageReport) {
        if let Some(sink) = self.sink {
            sink.send(Event::Stage { generation: sink.generation, stage });
        }
    }
}

/// A stage that has been started.
#[must_use]
pub(super) struct RunningStage<'r, 'a> {
    table: &'r mut StageRecorder<'a>,
    name: Stage,
    watch: PausableStopwatch<'a>,
    /// Processor time of the process at the start.
    cpu_seconds: f64,
}

impl RunningStage<'_, '_> {
    /// Records and reports the end of the stage, and returns its value.
    pub(super) fn finish<T>(self, result: StageResult<T>) -> T {
        let report = self.report(result.status, result.why);
        self.table.send_stage_report(report.clone());
        self.table.stages.push(report);
        result.value
    }

    fn report(&self, status: StageStatus, why: String) -> StageReport {
        let processor_seconds = process_cpu_seconds() - self.cpu_seconds;
        StageReport { name: self.name, status, seconds: self.watch.seconds(), processor_seconds, why }
    }
}
