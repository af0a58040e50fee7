//! Progress on stderr: bars, plain lines, JSON lines or nothing.

mod bars;
mod json;
mod plain;

pub(super) use self::bars::style;
pub(super) use self::json::{failed, line as json_line};
use crate::args::Progress;
use crate::console::Console;
use crate::pipeline::protocol::{Event, RenderProgress};
use crate::pipeline::words::samples_so_far;
pub(super) use crate::pipeline::words::seconds;

/// Reports progress.
pub(super) trait Reporter {
    /// Handles an event.
    fn event(&mut self, event: &Event);

    /// Clears temporary output. May be called more than once.
    fn end(&mut self) {}

    /// Whether written files are reported in text.
    fn says_results(&self) -> bool {
        true
    }

    /// Whether the reporter prints errors and warnings itself. If so, nothing else may print them.
    fn says_diagnostics(&self) -> bool {
        false
    }
}

/// Creates the reporter for a progress option. `time` is the render's time limit in seconds.
pub(super) fn reporter(progress: Progress, time: Option<f64>, console: &Console) -> Box<dyn Reporter> {
    match progress {
        Progress::Auto if console.is_terminal => Box::new(bars::Bars::new(time)),
        Progress::Auto | Progress::Plain => Box::new(plain::Plain::new(console.clone())),
        Progress::Json => Box::new(json::Json),
        Progress::None => Box::new(Silent),
    }
}

/// Describes the samples so far, with the total if known.
fn samples(progress: &RenderProgress) -> String {
    if progress.is_total_fixed {
        return format!("{} of {} samples", samples_so_far(progress), progress.total_samples);
    }
    format!("about {:.0} samples per pixel so far", progress.mean_samples.floor())
}

struct Silent;

impl Reporter for Silent {
    fn event(&mut self, _event: &Event) {}

    fn says_results(&self) -> bool {
        false
    }
}
