//! The table of stages as it fills: each is timed and said, when it begins and when it ends.

use std::time::Instant;

use super::protocol::{Stage, StageReport, Status};
use super::sink::Sink;
use super::stages::{Staged, Stop};

/// The stages of one request.
pub(super) struct StageTable<'a> {
    pub(super) sink: &'a Sink,
    pub(super) stages: Vec<StageReport>,
}

impl StageTable<'_> {
    /// Do one stage.
    ///
    /// # Errors
    /// Those of the work.
    pub(super) fn run<T>(
        &mut self,
        name: Stage,
        work: impl FnOnce() -> Result<Staged<T>, Stop>,
    ) -> Result<T, Stop> {
        let begin = Instant::now();
        let report = |status, why| StageReport { name, status, seconds: begin.elapsed().as_secs_f64(), why };
        self.sink.stage(report(Status::Running, String::new()));
        let staged = work()?;
        let report = report(staged.status, staged.why);
        self.sink.stage(report.clone());
        self.stages.push(report);
        Ok(staged.value)
    }
}
