//! Progress on stderr: bars, plain lines, JSON lines or nothing.

mod bars;
mod json;
mod plain;

pub(super) use self::bars::bar_style_from_template;
pub(super) use self::json::{failure_to_json, print_json_line_to_stderr as json_line};
use crate::args::ProgressMode;
use crate::console::Console;
use crate::pipeline::protocol::{Event, RenderProgress};
use crate::pipeline::words::format_mean_samples;
pub(super) use crate::pipeline::words::format_seconds;

/// Receives a render's events and reports its progress.
pub(super) trait Reporter {
    /// Handles an event.
    fn handle_event(&mut self, event: &Event);

    /// Clears temporary output. May be called repeatedly.
    fn clear_output(&mut self) {}

    /// Whether the caller also reports written files and other results as text.
    fn allows_text_results(&self) -> bool {
        true
    }

    /// Whether the reporter prints errors and warnings itself. If so, nothing else may print them.
    fn reports_diagnostics(&self) -> bool {
        false
    }
}

/// Creates the reporter for a progress option. `time` is the render's time limit in seconds.
pub(super) fn create_reporter(
    progress: ProgressMode,
    time: Option<f64>,
    console: &Console,
) -> Box<dyn Reporter> {
    match progress {
        ProgressMode::Auto if console.is_terminal => Box::new(bars::ProgressBars::new(time)),
        ProgressMode::Auto | ProgressMode::Plain => Box::new(plain::PlainReporter::new(console.clone())),
        ProgressMode::Json => Box::new(json::JsonReporter),
        ProgressMode::None => Box::new(SilentReporter),
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
    fn handle_event(&mut self, _event: &Event) {}

    fn allows_text_results(&self) -> bool {
        false
    }
}
