//! Bars on a terminal: the stage at work, one bar for each asset that is loading, one for the render.

use std::collections::HashMap;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use super::{Reporter, samples, seconds};
use crate::pipeline::protocol::{AssetProgress, Event, RenderProgress, Stage, StageReport, Status};
use crate::pipeline::words::Eta;
use crate::scene::sanitize::visible;

/// Columns that the bar keeps at least.
const LEAST_BAR: usize = 10;
/// Columns where the size is not known.
const PLAIN_COLUMNS: usize = 80;
/// Steps of the render's bar.
const STEPS: u64 = 1000;

pub(super) struct Bars {
    all: MultiProgress,
    stage: ProgressBar,
    assets: HashMap<String, ProgressBar>,
    render: Option<ProgressBar>,
    /// The seconds after which the render ends, if the call says so.
    time: Option<f64>,
}

impl Bars {
    pub(super) fn new(time: Option<f64>) -> Self {
        let all = MultiProgress::new();
        let stage = all.add(ProgressBar::new_spinner().with_style(style("{spinner} {msg}")));
        Self { all, stage, assets: HashMap::new(), render: None, time }
    }

    fn stage(&mut self, stage: &StageReport) {
        if stage.status == Status::Running {
            self.stage.set_message(stage.name.name());
            self.stage.tick();
        } else if stage.name == Stage::Accel {
            self.assets.drain().for_each(|(_, bar)| bar.finish_and_clear());
        }
    }

    fn asset(&mut self, progress: &AssetProgress) {
        let (all, stage) = (&self.all, &self.stage);
        let bar = self.assets.entry(progress.name.clone()).or_insert_with(|| {
            let bar = ProgressBar::new(progress.total).with_style(style("  {bar:24} {percent:>3}% {msg}"));
            let bar = all.insert_after(stage, bar);
            bar.set_message(visible(&progress.name).into_owned());
            bar
        });
        bar.set_position(progress.done);
        if progress.done == progress.total {
            bar.finish();
        }
    }

    fn progress(&mut self, progress: &RenderProgress) {
        let all = &self.all;
        let bar = self.render.get_or_insert_with(|| {
            all.add(ProgressBar::new(STEPS).with_style(style("  {wide_bar} {percent:>3}% {msg}")))
        });
        // Each time anew: the terminal may have another size.
        let columns = crossterm::terminal::size().map_or(PLAIN_COLUMNS, |(columns, _)| usize::from(columns));
        bar.set_position((progress.fraction * STEPS as f64) as u64);
        bar.set_message(words(progress, self.time, columns));
    }
}

impl Reporter for Bars {
    fn event(&mut self, event: &Event) {
        if let Event::Stage { stage, .. } = event {
            self.stage(stage);
        } else if let Event::Asset { progress, .. } = event {
            self.asset(progress);
        } else if let Event::Progress { progress, .. } = event {
            self.progress(progress);
        }
    }

    fn end(&mut self) {
        self.assets.drain().for_each(|(_, bar)| bar.finish_and_clear());
        if let Some(bar) = self.render.take() {
            bar.finish_and_clear();
        }
        self.stage.finish_and_clear();
        // What cannot be cleared stays.
        let _ = self.all.clear();
    }
}

/// Words beside the bar: as many as leave it [`LEAST_BAR`] columns. Under a time limit they count seconds.
fn words(progress: &RenderProgress, time: Option<f64>, columns: usize) -> String {
    let done = match time {
        Some(limit) => format!("{} of {}", seconds(progress.elapsed_seconds.min(limit)), seconds(limit)),
        None => samples(progress),
    };
    let left = Eta::of(progress).map(|eta| format!("{} left", eta.words()));
    let whole = match (&left, time) {
        (Some(left), None) => format!("{done}, {left}"),
        (_, _) => done.clone(),
    };
    let room = columns.saturating_sub(LEAST_BAR + "   100% ".len());
    let shorter = [Some(whole), left, Some(done)].into_iter().flatten();
    shorter.into_iter().find(|words| words.chars().count() <= room).unwrap_or_default()
}

/// A style by its template; should it not be understood, the library's own.
pub(crate) fn style(template: &str) -> ProgressStyle {
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
    fn a_narrow_terminal_keeps_its_bar() {
        let progress = progress();
        assert_eq!(words(&progress, None, 80), "1000 of 4096 samples, 7.50 s left");
        for columns in 0..200 {
            let said = words(&progress, None, columns).chars().count();
            assert!(said == 0 || columns >= said + "  ".len() + LEAST_BAR + " 100% ".len(), "{columns}");
        }
        assert_eq!(words(&progress, None, 30), "7.50 s left");
    }

    #[test]
    fn under_a_time_limit_seconds_are_counted() {
        for columns in [80, 40] {
            assert_eq!(words(&progress(), Some(10.0), columns), "2.50 s of 10.0 s");
        }
    }
}
