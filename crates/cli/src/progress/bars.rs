//! Progress bars on a terminal: the current stage, a bar per asset being loaded, and a bar for the render.

use std::collections::HashMap;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use super::{Reporter, describe_samples, format_seconds};
use crate::pipeline::protocol::{AssetProgress, Event, RenderProgress, Stage, StageReport, StageStatus};
use crate::pipeline::words::Eta;
use crate::scene::sanitize::escape_invisible_chars;

/// Minimum width of the bar.
const MIN_BAR_COLUMNS: usize = 10;
/// Assumed width if the terminal's size is unknown.
const DEFAULT_COLUMNS: usize = 80;
/// Number of steps in the render's progress bar.
const STEPS: u64 = 1000;

pub(super) struct ProgressBars {
    all: MultiProgress,
    stage: ProgressBar,
    assets: HashMap<String, ProgressBar>,
    render: Option<ProgressBar>,
    /// The render's time limit in seconds.
    time: Option<f64>,
}

impl ProgressBars {
    pub(super) fn new(time: Option<f64>) -> Self {
        let all = MultiProgress::new();
        let stage =
            all.add(ProgressBar::new_spinner().with_style(bar_style_from_template("{spinner} {msg}")));
        Self { all, stage, assets: HashMap::new(), render: None, time }
    }

    fn show_stage(&mut self, stage: &StageReport) {
        if stage.status == StageStatus::Running {
            self.stage.set_message(stage.name.name());
            self.stage.tick();
        } else if stage.name == Stage::Accel {
            self.assets.drain().for_each(|(_, bar)| bar.finish_and_clear());
        }
    }

    fn show_asset(&mut self, progress: &AssetProgress) {
        let (all, stage) = (&self.all, &self.stage);
        let bar = self.assets.entry(progress.name.clone()).or_insert_with(|| {
            let bar = ProgressBar::new(progress.total)
                .with_style(bar_style_from_template("  {bar:24} {percent:>3}% {msg}"));
            let bar = all.insert_after(stage, bar);
            bar.set_message(escape_invisible_chars(&progress.name).into_owned());
            bar
        });
        bar.set_position(progress.done);
        if progress.done == progress.total {
            bar.finish();
        }
    }

    fn show_progress(&mut self, progress: &RenderProgress) {
        let all = &self.all;
        let bar = self.render.get_or_insert_with(|| {
            all.add(
                ProgressBar::new(STEPS)
                    .with_style(bar_style_from_template("  {wide_bar} {percent:>3}% {msg}")),
            )
        });
        // Query the size every time, because the terminal may be resized.
        let columns =
            crossterm::terminal::size().map_or(DEFAULT_COLUMNS, |(columns, _)| usize::from(columns));
        bar.set_position((progress.fraction * STEPS as f64) as u64);
        bar.set_message(format_bar_text(progress, self.time, columns));
    }
}

impl Reporter for ProgressBars {
    fn handle_event(&mut self, event: &Event) {
        if let Event::Stage { stage, .. } = event {
            self.show_stage(stage);
        } else if let Event::Asset { progress, .. } = event {
            self.show_asset(progress);
        } else if let Event::Progress { progress, .. } = event {
            self.show_progress(progress);
        }
    }

    fn clear_output(&mut self) {
        self.assets.drain().for_each(|(_, bar)| bar.finish_and_clear());
        if let Some(bar) = self.render.take() {
            bar.finish_and_clear();
        }
        self.stage.finish_and_clear();
        // Ignore errors: at worst, the output stays on the screen.
        let _ = self.all.clear();
    }
}

/// Returns the text next to the bar, as detailed as the width allows. Shows seconds instead of samples if
/// there is a time limit.
fn format_bar_text(progress: &RenderProgress, time: Option<f64>, columns: usize) -> String {
    let done = match time {
        Some(limit) => {
            format!("{} of {}", format_seconds(progress.elapsed_seconds.min(limit)), format_seconds(limit))
        }
        None => describe_samples(progress),
    };
    let left = Eta::from_progress(progress).map(|eta| format!("{} left", eta.format()));
    let whole = match (&left, time) {
        (Some(left), None) => format!("{done}, {left}"),
        (_, _) => done.clone(),
    };
    let room = columns.saturating_sub(MIN_BAR_COLUMNS + "   100% ".len());
    let shorter = [Some(whole), left, Some(done)].into_iter().flatten();
    shorter.into_iter().find(|words| words.chars().count() <= room).unwrap_or_default()
}

/// Creates a style from a template, or returns the library's default style if the template is invalid.
pub(crate) fn bar_style_from_template(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress() -> RenderProgress {
        RenderProgress {
            fraction: 0.25,
            elapsed_seconds: 2.5,
            earlier_seconds: 0.0,
            eta_seconds: Some(7.5),
            samples: 1000,
            mean_samples: 1000.5,
            total_samples: 4096,
            is_total_fixed: true,
            noise: None,
        }
    }

    #[test]
    fn narrow_terminals_keep_the_bar() {
        let progress = progress();
        assert_eq!(format_bar_text(&progress, None, 80), "1000 of 4096 samples, 7.50 s left");
        for columns in 0..200 {
            let said = format_bar_text(&progress, None, columns).chars().count();
            assert!(
                said == 0 || columns >= said + "  ".len() + MIN_BAR_COLUMNS + " 100% ".len(),
                "{columns}"
            );
        }
        assert_eq!(format_bar_text(&progress, None, 30), "7.50 s left");
    }

    #[test]
    fn time_limits_are_shown_in_seconds() {
        for columns in [80, 40] {
            assert_eq!(format_bar_text(&progress(), Some(10.0), columns), "2.50 s of 10.0 s");
        }
    }
}
