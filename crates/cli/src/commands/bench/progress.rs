//! Reports benchmark progress on stderr.

use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::json;

use super::chart::ConvergenceChart;
use crate::args::ProgressMode;
use crate::bench::{BenchEvent, Results};
use crate::console::Console;
use crate::progress::{bar_style_from_template, format_seconds, json_line};
use crate::scene::sanitize::escape_invisible_chars;

/// Maximum time between plain lines.
const INTERVAL: Duration = Duration::from_secs(10);
/// Resolution of the bar.
const STEPS: u64 = 1000;
/// Maximum frame rate of the plot and the bar.
const FRAMES: u8 = 8;

/// Reports progress in the requested format.
pub(super) struct BenchProgress {
    console: Console,
    format: ProgressFormat,
    begin: Instant,
    what: String,
    /// Estimated seconds left, and when they were estimated.
    left: Option<(f64, Instant)>,
    fraction: f64,
    last: Instant,
}

/// Format of progress reports.
enum ProgressFormat {
    /// A bar below the plot.
    Bar(ProgressBar, ConvergenceChart),
    Plain,
    Json,
    Silent,
}

impl BenchProgress {
    pub(super) fn new(progress: ProgressMode, console: &Console) -> Self {
        let format = match progress {
            ProgressMode::Auto if console.is_terminal => {
                let target = ProgressDrawTarget::stderr_with_hz(FRAMES);
                let bar = ProgressBar::with_draw_target(Some(STEPS), target);
                let bar =
                    bar.with_style(bar_style_from_template("{msg}\n  {wide_bar} {percent:>3}% {prefix}"));
                ProgressFormat::Bar(bar, ConvergenceChart::default())
            }
            ProgressMode::Auto | ProgressMode::Plain => ProgressFormat::Plain,
            ProgressMode::Json => ProgressFormat::Json,
            ProgressMode::None => ProgressFormat::Silent,
        };
        let now = Instant::now();
        let (console, what) = (console.clone(), String::new());
        Self { console, format, begin: now, what, left: None, fraction: 0.0, last: now }
    }

    /// Handles a benchmark event.
    pub(super) fn handle_event(&mut self, news: BenchEvent) {
        match news {
            BenchEvent::Begins { what, left } => {
                self.what = what;
                self.left = left.map(|left| (left, Instant::now()));
                self.redraw_bar_or_print_line(matches!(self.format, ProgressFormat::Json));
            }
            BenchEvent::Done(line) => {
                self.last = Instant::now();
                match &self.format {
                    ProgressFormat::Plain => self.console.print_line_to_stderr(&line),
                    ProgressFormat::Json => json_line(&json!({ "event": "step", "what": line })),
                    ProgressFormat::Bar(..) | ProgressFormat::Silent => {}
                }
            }
            BenchEvent::Point { scene, method, seconds, relmse } => {
                if let ProgressFormat::Bar(_, lines) = &mut self.format {
                    lines.add_point(&scene, &method, (seconds, relmse));
                    self.redraw_bar_or_print_line(false);
                }
            }
            BenchEvent::Warnings(warnings) => match &self.format {
                ProgressFormat::Bar(bar, _) => bar.suspend(|| self.console.print_diagnostics(&warnings)),
                ProgressFormat::Plain | ProgressFormat::Silent => self.console.print_diagnostics(&warnings),
                ProgressFormat::Json => {
                    let messages: Vec<&str> = warnings.iter().map(|one| one.message.as_str()).collect();
                    json_line(&json!({ "event": "warnings", "messages": messages }));
                }
            },
        }
    }

    /// Updates the report as time passes.
    pub(super) fn tick(&mut self) {
        let is_due = self.last.elapsed() >= INTERVAL;
        self.redraw_bar_or_print_line(is_due);
    }

    fn redraw_bar_or_print_line(&mut self, is_due: bool) {
        let elapsed = self.begin.elapsed().as_secs_f64();
        let left = self.left.map(|(left, at)| (left - at.elapsed().as_secs_f64()).max(0.0));
        if let Some(left) = left {
            self.fraction = self.fraction.max(elapsed / (elapsed + left).max(1e-9)).min(1.0);
        }
        let to_go = left.map_or(String::new(), |left| format!("{} left", format_seconds(left)));
        match &self.format {
            ProgressFormat::Bar(bar, lines) => {
                // Query the size every time, because the terminal may be resized.
                let (columns, rows) = crossterm::terminal::size().unwrap_or_default();
                let plot = lines.render_text(columns, rows, self.console.is_colored());
                bar.set_message(plot + &escape_invisible_chars(&self.what));
                bar.set_prefix(to_go);
                bar.set_position((self.fraction * STEPS as f64) as u64);
            }
            ProgressFormat::Plain if is_due => {
                let percent = self.fraction * 100.0;
                self.console.print_line_to_stderr(&format!("{percent:3.0}% {} {to_go}", self.what));
            }
            ProgressFormat::Json if is_due => json_line(&json!({
                "event": "progress", "stage": "bench", "what": self.what, "fraction": self.fraction,
                "elapsed_seconds": elapsed, "eta_seconds": left,
            })),
            ProgressFormat::Plain | ProgressFormat::Json | ProgressFormat::Silent => return,
        }
        if is_due {
            self.last = Instant::now();
        }
    }

    /// Clears temporary output.
    pub(super) fn clear(&mut self) {
        if let ProgressFormat::Bar(bar, _) = &self.format {
            bar.finish_and_clear();
        }
    }

    /// Whether reports are text rather than JSON.
    pub(super) fn is_text(&self) -> bool {
        !matches!(self.format, ProgressFormat::Json)
    }

    pub(super) fn report_failure(&self, kind: &str, message: &str) {
        if self.is_text() {
            self.console.print_line_to_stderr(message);
        } else {
            json_line(&json!({ "event": "failed", "kind": kind, "message": message }));
        }
    }

    pub(super) fn report_canceled(&self, message: &str) {
        if self.is_text() {
            self.console.print_line_to_stderr(message);
        } else {
            json_line(&json!({ "event": "cancelled" }));
        }
    }

    /// Reports a warning about a written file.
    pub(super) fn report_written_file_warning(&self, message: &str) {
        if self.is_text() {
            self.console.print_line_to_stderr(&format!("warning: {message}"));
        } else {
            json_line(&json!({ "event": "warnings", "messages": [message] }));
        }
    }

    pub(super) fn report_written(&self, path: &Path, bytes: usize) {
        match self.format {
            ProgressFormat::Bar(..) | ProgressFormat::Plain => {
                self.console.print_line_to_stderr(&format!("wrote {}", path.display()));
            }
            ProgressFormat::Json => {
                json_line(&json!({ "event": "written", "path": path.to_string_lossy(), "bytes": bytes }));
            }
            ProgressFormat::Silent => {}
        }
    }

    pub(super) fn report_done(&self, results: &Results) {
        if !self.is_text() {
            json_line(&json!({ "event": "done", "seconds": results.seconds }));
        }
    }
}
