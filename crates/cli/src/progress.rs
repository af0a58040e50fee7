//! Progress on stderr: bars, plain lines, JSON lines or nothing.

mod bars;
mod json;
mod plain;

pub(super) use self::bars::bar_style;
pub(super) use self::json::{failure_to_json, print_json_line as json_line};
use crate::args::Progress;
use crate::console::Console;
use crate::pipeline::protocol::{Event, RenderProgress};
use crate::pipeline::words::format_mean_samples;
pub(super) use crate::pipeline::words::seconds;

/// Receives a render's events and reports its progress.
pub(super) trait Reporter {
    /// Handles an event.
    fn event(&mut self, event: &Event);

    /// Clears temporary output. May be called repeatedly.
    fn end(&mut self) {}

    /// Whether the caller also reports written files and other results as text.
    fn says_results(&self) -> bool {
        true
    }

    /// Whether the reporter prints errors and warnings itself. If so, nothing else may print them.
    fn says_diagnostics(&self) -> bool {
        false
    }
}

/// Creates the reporter for a progress option. `time` is the render's time limit in seconds.
pub(super) fn create_reporter(progress: Progress, time: Option<f64>, console: &Console) -> Box<dyn Reporter> {
    match progress {
        Progress::Auto if console.is_terminal => Box::new(bars::ProgressBars::new(time)),
        Progress::Auto | Progress::Plain => Box::new(plain::PlainReporter::new(console.clone())),
        Progress::Json => Box::new(json::JsonReporter),
        Progress::None => Box::new(SilentReporter),
    }
}

/// Describes the samples so far, with the total if known.
fn describe_samples(progress: &RenderProgress) -> String {
    if progress.is_total_fixed {
        return format!("{} of {} samples", format_mean_samples(progress), progress.total_samples);
    }
    format!("about {:.0} samples per pixel so far", progress.mean_samples.floor())
}

struct SilentReporter;

impl Reporter for SilentReporter {
    fn event(&mut self, _event: &Event) {}

    fn says_results(&self) -> bool {
        false
    }
}
