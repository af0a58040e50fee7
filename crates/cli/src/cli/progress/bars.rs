//! Bars on a terminal: the stage at work, one bar for each asset that is loading, one for the render.

use std::collections::HashMap;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use super::{Reporter, seconds};
use crate::pipeline::protocol::{AssetProgress, Event, RenderProgress, Stage, Status};
use crate::scene::sanitize::visible;

/// Steps of the render's bar.
const STEPS: u64 = 1000;

pub(super) struct Bars {
    all: MultiProgress,
    stage: ProgressBar,
    assets: HashMap<String, ProgressBar>,
    render: Option<ProgressBar>,
}

impl Bars {
    pub(super) fn new() -> Self {
        let all = MultiProgress::new();
        let stage = all.add(ProgressBar::new_spinner().with_style(style("{spinner} {msg}")));
        Self { all, stage, assets: HashMap::new(), render: None }
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
        let eta = progress.eta_seconds.map_or(String::new(), |eta| format!(", {} left", seconds(eta)));
        bar.set_position((progress.fraction * STEPS as f64) as u64);
        bar.set_message(format!("{} of {} samples{eta}", progress.samples, progress.total_samples));
    }
}

impl Reporter for Bars {
    fn event(&mut self, event: &Event) {
        match event {
            Event::Stage { stage, .. } if stage.status == Status::Running => {
                self.stage.set_message(stage.name.name());
                self.stage.tick();
            }
            Event::Stage { stage, .. } if stage.name == Stage::Accel => {
                self.assets.drain().for_each(|(_, bar)| bar.finish_and_clear());
            }
            Event::Asset { progress, .. } => self.asset(progress),
            Event::Progress { progress, .. } => self.progress(progress),
            Event::Started { .. }
            | Event::Stage { .. }
            | Event::Files { .. }
            | Event::Warnings { .. }
            | Event::Settings { .. }
            | Event::Preview { .. }
            | Event::Written { .. }
            | Event::WriteFailed { .. }
            | Event::Refused { .. }
            | Event::WritePostponed { .. }
            | Event::CameraKept { .. }
            | Event::Picked { .. }
            | Event::Done { .. }
            | Event::Failed { .. }
            | Event::Cancelled { .. } => {}
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

/// A style by its template; should it not be understood, the library's own.
pub(in crate::cli) fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
