//! Progress on stderr: bars, plain lines, JSON lines, nothing.

mod bars;
mod json;
mod plain;

pub(super) use self::bars::style;
pub(super) use self::json::line as json_line;
use crate::args::Progress;
use crate::console::Console;
use crate::pipeline::protocol::{Event, RenderProgress};
use crate::pipeline::words::samples_so_far;
pub(super) use crate::pipeline::words::seconds;

/// Says how work goes on.
pub(super) trait Reporter {
    /// Something happened.
    fn event(&mut self, event: &Event);

    /// Clear what is not to stay. May be called more than once.
    fn end(&mut self) {}

    /// Whether people read what it says: files written are then named at the end.
    fn says_results(&self) -> bool {
        true
    }

    /// Whether it says errors and warnings itself, so that nothing may be mixed with its lines.
    fn says_diagnostics(&self) -> bool {
        false
    }
}

/// The reporter that the call chooses; `time` is the budget of the render, if it has one.
pub(super) fn reporter(progress: Progress, time: Option<f64>, console: &Console) -> Box<dyn Reporter> {
    match progress {
        Progress::Auto if console.is_terminal => Box::new(bars::Bars::new(time)),
        Progress::Auto | Progress::Plain => Box::new(plain::Plain::new(console.clone())),
        Progress::Json => Box::new(json::Json),
        Progress::None => Box::new(Silent),
    }
}

/// Samples so far, with the total only if that is certain.
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
