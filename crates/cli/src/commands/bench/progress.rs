//! Progress of a benchmark on stderr.

use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::json;

use super::chart::Lines;
use crate::args::Progress;
use crate::bench::{News, Results};
use crate::console::Console;
use crate::progress::{json_line, seconds, style};
use crate::scene::sanitize::visible;

/// Longest silence of plain lines.
const INTERVAL: Duration = Duration::from_secs(10);
/// Steps of the bar.
const STEPS: u64 = 1000;
/// Frames a second at most of the plot and the bar.
const FRAMES: u8 = 8;

/// Reporter of progress, in the form that the call chooses.
pub(super) struct Said {
    console: Console,
    way: Way,
    begin: Instant,
    what: String,
    /// Seconds to go, and when that was so.
    left: Option<(f64, Instant)>,
    fraction: f64,
    last: Instant,
}

enum Way {
    /// With the plot above it.
    Bar(ProgressBar, Lines),
    Plain,
    Json,
    Silent,
}

impl Said {
    pub(super) fn new(progress: Progress, console: &Console) -> Self {
        let way = match progress {
            Progress::Auto if console.is_terminal => {
                let target = ProgressDrawTarget::stderr_with_hz(FRAMES);
                let bar = ProgressBar::with_draw_target(Some(STEPS), target);
                let bar = bar.with_style(style("{msg}\n  {wide_bar} {percent:>3}% {prefix}"));
                Way::Bar(bar, Lines::default())
            }
            Progress::Auto | Progress::Plain => Way::Plain,
            Progress::Json => Way::Json,
            Progress::None => Way::Silent,
        };
        let now = Instant::now();
        let (console, what) = (console.clone(), String::new());
        Self { console, way, begin: now, what, left: None, fraction: 0.0, last: now }
    }

    pub(super) fn hear(&mut self, news: News) {
        match news {
            News::Begins { what, left } => {
                self.what = what;
                self.left = left.map(|left| (left, Instant::now()));
                self.show(matches!(self.way, Way::Json));
            }
            News::Done(line) => {
                self.last = Instant::now();
                match &self.way {
                    Way::Plain => self.console.say(&line),
                    Way::Json => json_line(&json!({ "event": "step", "what": line })),
                    Way::Bar(..) | Way::Silent => {}
                }
            }
            News::Point { scene, method, seconds, relmse } => {
                if let Way::Bar(_, lines) = &mut self.way {
                    lines.add(&scene, &method, (seconds, relmse));
                    self.show(false);
                }
            }
            News::Warnings(warnings) => match &self.way {
                Way::Bar(bar, _) => bar.suspend(|| self.console.diagnostics(&warnings)),
                Way::Plain | Way::Silent => self.console.diagnostics(&warnings),
                Way::Json => {
                    let messages: Vec<&str> = warnings.iter().map(|one| one.message.as_str()).collect();
                    json_line(&json!({ "event": "warnings", "messages": messages }));
                }
            },
        }
    }

    /// Time went by.
    pub(super) fn tick(&mut self) {
        let is_due = self.last.elapsed() >= INTERVAL;
        self.show(is_due);
    }

    fn show(&mut self, is_due: bool) {
        let elapsed = self.begin.elapsed().as_secs_f64();
        let left = self.left.map(|(left, at)| (left - at.elapsed().as_secs_f64()).max(0.0));
        if let Some(left) = left {
            self.fraction = self.fraction.max(elapsed / (elapsed + left).max(1e-9)).min(1.0);
        }
        let to_go = left.map_or(String::new(), |left| format!("{} left", seconds(left)));
        match &self.way {
            Way::Bar(bar, lines) => {
                // Each time anew: the terminal may have another size.
                let size = crossterm::terminal::size().unwrap_or_default();
                let plot = lines.text(size, self.console.is_colored());
                bar.set_message(plot + &visible(&self.what));
                bar.set_prefix(to_go);
                bar.set_position((self.fraction * STEPS as f64) as u64);
            }
            Way::Plain if is_due => {
                let percent = self.fraction * 100.0;
                self.console.say(&format!("{percent:3.0}% {} {to_go}", self.what));
            }
            Way::Json if is_due => json_line(&json!({
                "event": "progress", "stage": "bench", "what": self.what, "fraction": self.fraction,
                "elapsed_seconds": elapsed, "eta_seconds": left,
            })),
            Way::Plain | Way::Json | Way::Silent => return,
        }
        if is_due {
            self.last = Instant::now();
        }
    }

    /// Clear what is not to stay.
    pub(super) fn end(&mut self) {
        if let Way::Bar(bar, _) = &self.way {
            bar.finish_and_clear();
        }
    }

    /// Whether errors appear in words, with their places.
    pub(super) fn is_for_people(&self) -> bool {
        !matches!(self.way, Way::Json)
    }

    pub(super) fn failed(&self, kind: &str, message: &str) {
        if self.is_for_people() {
            self.console.say(message);
        } else {
            json_line(&json!({ "event": "failed", "kind": kind, "message": message }));
        }
    }

    pub(super) fn cancelled(&self, message: &str) {
        if self.is_for_people() {
            self.console.say(message);
        } else {
            json_line(&json!({ "event": "cancelled" }));
        }
    }

    /// Reports a warning about a file that was written.
    pub(super) fn warned(&self, message: &str) {
        if self.is_for_people() {
            self.console.say(&format!("warning: {message}"));
        } else {
            json_line(&json!({ "event": "warnings", "messages": [message] }));
        }
    }

    pub(super) fn written(&self, path: &Path, bytes: usize) {
        match self.way {
            Way::Bar(..) | Way::Plain => self.console.say(&format!("wrote {}", path.display())),
            Way::Json => {
                json_line(&json!({ "event": "written", "path": path.to_string_lossy(), "bytes": bytes }));
            }
            Way::Silent => {}
        }
    }

    pub(super) fn done(&self, results: &Results) {
        if !self.is_for_people() {
            json_line(&json!({ "event": "done", "seconds": results.seconds }));
        }
    }
}
