//! Prints progress as occasional lines, for logs.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use super::{Reporter, describe_samples, format_seconds};
use crate::console::Console;
use crate::pipeline::protocol::{AssetProgress, Event, RenderProgress, StageReport, StageStatus};
use crate::pipeline::words::Eta;

/// Maximum time between lines during a render.
const INTERVAL: Duration = Duration::from_secs(5);
/// Lines per render, not counting lines printed because [`INTERVAL`] has passed.
const STEPS: f64 = 10.0;

pub(super) struct PlainReporter {
    console: Console,
    /// Render steps reported so far.
    reported: f64,
    last: Instant,
    last_line: String,
    /// Names of the assets reported as loaded.
    loaded: HashSet<String>,
}

impl PlainReporter {
    pub(super) fn new(console: Console) -> Self {
        Self {
            console,
            reported: 0.0,
            last: Instant::now(),
            last_line: String::new(),
            loaded: HashSet::new(),
        }
    }

    /// Returns true the first time an asset is fully loaded. A file with several meshes is loaded once per
    /// mesh.
    fn record_if_newly_loaded(&mut self, progress: &AssetProgress) -> bool {
        progress.done == progress.total && self.loaded.insert(progress.name.clone())
    }

    fn print_progress(&mut self, progress: &RenderProgress) {
        if let Some(line) = self.due_progress_line(progress) {
            self.console.print_line_to_stderr(&line);
        }
    }

    /// Returns the line to print now, if one is due. Never repeats the last line.
    fn due_progress_line(&mut self, progress: &RenderProgress) -> Option<String> {
        let step = (progress.fraction * STEPS).floor();
        if progress.fraction >= 1.0 || (step <= self.reported && self.last.elapsed() < INTERVAL) {
            return None;
        }
        (self.reported, self.last) = (step, Instant::now());
        let line = format_progress(progress);
        if line == self.last_line {
            return None;
        }
        self.last_line.clone_from(&line);
        Some(line)
    }
}

impl Reporter for PlainReporter {
    fn handle_event(&mut self, event: &Event) {
        if let Event::Stage { stage, .. } = event
            && stage.status != StageStatus::Running
        {
            self.console.print_line_to_stderr(&stage_status_line(stage));
        } else if let Event::Asset { progress, .. } = event
            && self.record_if_newly_loaded(progress)
        {
            self.console.print_line_to_stderr(&format!("{:<8} {} 100%", "loaded", progress.name));
        } else if let Event::Progress { progress, .. } = event {
            self.print_progress(progress);
        }
    }
}

fn format_progress(progress: &RenderProgress) -> String {
    let eta = Eta::from_progress(progress).map_or(String::new(), |eta| format!(", {} left", eta.format()));
    format!(
        "{:<8} {:3.0}% ({}{eta})",
        "render",
        (progress.fraction * 100.0).floor(),
        describe_samples(progress)
    )
}

/// Describes a finished stage, as in `parse done 0.40 ms`.
pub(super) fn stage_status_line(stage: &StageReport) -> String {
    let status = match stage.status {
        StageStatus::Running => "running",
        StageStatus::Done => "done",
        StageStatus::Reused => "reused",
        StageStatus::Skipped => "skipped",
    };
    let time =
        if stage.status == StageStatus::Skipped { String::new() } else { format_seconds(stage.seconds) };
    format!("{:<8} {status:<7} {time:>9}  {}", stage.name.name(), stage.why).trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_not_repeated() {
        let mut plain = PlainReporter::new(Console::new(crate::tui::ColorDepthChoice::None));
        let progress = |fraction, samples| RenderProgress {
            fraction,
            elapsed_seconds: 1.0,
            earlier_seconds: 0.0,
            eta_seconds: None,
            samples,
            mean_samples: f64::from(samples),
            total_samples: 100,
            is_total_fixed: true,
            noise: None,
        };
        let mut said = Vec::new();
        for samples in 0..100 {
            // Report each value twice, as the renderer does: at the end of a pass and at the start of the
            // next pass.
            said.extend(plain.due_progress_line(&progress(f64::from(samples) / 100.0, samples)));
            said.extend(plain.due_progress_line(&progress(f64::from(samples) / 100.0, samples)));
        }
        let tens: Vec<_> =
            (1..10).map(|ten| format_progress(&progress(f64::from(ten) / 10.0, 10 * ten))).collect();
        assert_eq!(said, tens);
        // The interval has passed, but nothing has changed.
        plain.last =
            Instant::now().checked_sub(INTERVAL).expect("expected an uptime longer than the interval");
        assert_eq!(plain.due_progress_line(&progress(0.9, 90)), None);
        plain.last =
            Instant::now().checked_sub(INTERVAL).expect("expected an uptime longer than the interval");
        assert!(plain.due_progress_line(&progress(0.91, 91)).is_some());
    }

    #[test]
    fn files_with_several_meshes_are_listed_once() {
        let mut plain = PlainReporter::new(Console::new(crate::tui::ColorDepthChoice::None));
        let asset = |name: &str, done| AssetProgress { name: name.to_owned(), done, total: 10 };
        let said = [asset("toy.glb", 5), asset("toy.glb", 10), asset("toy.glb", 10), asset("b.png", 10)];
        assert_eq!(said.map(|progress| plain.record_if_newly_loaded(&progress)), [false, true, false, true]);
    }

    #[test]
    fn lines_have_progress_and_time_left() {
        let progress = RenderProgress {
            fraction: 0.4,
            elapsed_seconds: 1.0,
            earlier_seconds: 0.0,
            eta_seconds: Some(1.5),
            samples: 25,
            mean_samples: 25.62,
            total_samples: 64,
            is_total_fixed: true,
            noise: None,
        };
        assert_eq!(format_progress(&progress), "render    40% (25.6 of 64 samples, 1.50 s left)");
        let by_noise = RenderProgress { is_total_fixed: false, ..progress };
        assert_eq!(
            format_progress(&by_noise),
            "render    40% (about 25 samples per pixel so far, 1.50 s left)"
        );
        let early = RenderProgress { elapsed_seconds: 0.1, ..progress };
        assert_eq!(format_progress(&early), "render    40% (25.6 of 64 samples)");
        assert!(!format_progress(&RenderProgress { eta_seconds: None, ..progress }).contains("left"));
    }
}
