//! Lines now and then, for logs.

use std::time::{Duration, Instant};

use super::super::console::Console;
use super::{Reporter, seconds};
use crate::pipeline::protocol::{Event, RenderProgress, StageReport, Status};

/// Longest silence of a render.
const INTERVAL: Duration = Duration::from_secs(5);
/// A line at every such part of a render.
const STEP: f64 = 0.1;

pub(super) struct Plain {
    console: Console,
    said: f64,
    last: Instant,
}

impl Plain {
    pub(super) fn new(console: Console) -> Self {
        Self { console, said: 0.0, last: Instant::now() }
    }

    fn progress(&mut self, progress: &RenderProgress) {
        let is_due = progress.fraction >= self.said + STEP || self.last.elapsed() >= INTERVAL;
        if is_due && progress.fraction < 1.0 {
            self.said = (progress.fraction / STEP).floor() * STEP;
            self.last = Instant::now();
            self.console.say(&line(progress));
        }
    }
}

impl Reporter for Plain {
    fn event(&mut self, event: &Event) {
        match event {
            Event::Stage { stage, .. } if stage.status != Status::Running => {
                self.console.say(&stage_line(stage));
            }
            Event::Asset { progress, .. } if progress.done == progress.total => {
                self.console.say(&format!("{:<8} {} 100%", "loaded", progress.name));
            }
            Event::Progress { progress, .. } => self.progress(progress),
            _ => {}
        }
    }
}

fn line(progress: &RenderProgress) -> String {
    let eta = progress.eta_seconds.map_or(String::new(), |eta| format!(", {} left", seconds(eta)));
    let (samples, total) = (progress.samples, progress.total_samples);
    format!("{:<8} {:3.0}% ({samples}/{total} samples{eta})", "render", progress.fraction * 100.0)
}

/// `parse    done    0.40 ms`
pub(super) fn stage_line(stage: &StageReport) -> String {
    let status = match stage.status {
        Status::Running => "running",
        Status::Done => "done",
        Status::Reused => "reused",
        Status::Skipped => "skipped",
    };
    let time = if stage.status == Status::Skipped { String::new() } else { seconds(stage.seconds) };
    format!("{:<8} {status:<7} {time:>9}  {}", stage.name.name(), stage.why).trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_how_far_and_how_long() {
        let progress = RenderProgress {
            fraction: 0.4,
            elapsed_seconds: 1.0,
            eta_seconds: Some(1.5),
            samples: 25,
            total_samples: 64,
        };
        assert_eq!(line(&progress), "render    40% (25/64 samples, 1.50 s left)");
        assert!(!line(&RenderProgress { eta_seconds: None, ..progress }).contains("left"));
    }
}
