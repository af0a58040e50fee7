//! Progress on stderr: bars, plain lines, JSON lines, nothing.

mod bars;
mod json;
mod plain;

use super::args::Progress;
use super::console::Console;
use crate::pipeline::protocol::Event;

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

/// The reporter that was asked for.
pub(super) fn reporter(progress: Progress, console: &Console) -> Box<dyn Reporter> {
    match progress {
        Progress::Auto if console.is_terminal => Box::new(bars::Bars::new()),
        Progress::Auto | Progress::Plain => Box::new(plain::Plain::new(*console)),
        Progress::Json => Box::new(json::Json),
        Progress::None => Box::new(Silent),
    }
}

struct Silent;

impl Reporter for Silent {
    fn event(&mut self, _event: &Event) {}

    fn says_results(&self) -> bool {
        false
    }
}

/// Seconds in a form that suits their size.
pub(super) fn seconds(seconds: f64) -> String {
    match seconds {
        s if s < 0.001 => format!("{:.2} ms", s * 1e3),
        s if s < 0.1 => format!("{:.1} ms", s * 1e3),
        s if s < 60.0 => format!("{s:.2} s"),
        s if s < 3600.0 => format!("{} min {:02.0} s", (s / 60.0).floor(), (s % 60.0).floor()),
        s => format!("{} h {:02.0} min", (s / 3600.0).floor(), (s % 3600.0 / 60.0).floor()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_suit_their_size() {
        let shown = [0.000_12, 0.0123, 1.234, 59.999, 61.5, 7322.0].map(seconds);
        assert_eq!(shown, ["0.12 ms", "12.3 ms", "1.23 s", "60.00 s", "1 min 01 s", "2 h 02 min"]);
    }
}
