//! The worker's progress on the newest request.

use std::time::{Duration, Instant};

use super::request::ImageOrigin;
use crate::noise_curve::NoiseCurve;
use crate::pipeline::protocol::{AssetProgress, RenderProgress, Report, Stage, StageReport};

/// Activity of the worker for the current generation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Activity {
    /// At work since then.
    Running { since: Instant },
    /// Finished.
    Done,
    /// Failed, perhaps because the file is not whole yet.
    Waiting,
    /// Failed.
    Broken,
    /// Stopped.
    Cancelled,
}

/// Render of the newest request's picture. While the scene is broken, that is a picture of the last good one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rendering {
    UnderWay,
    Finished,
    Stopped,
}

/// The bar of a loading asset.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AssetBar {
    pub progress: AssetProgress,
    /// Time at which the bar was full; the bar stays a moment longer, so that 100% is seen.
    pub finished: Option<Instant>,
}

impl AssetBar {
    const LINGER: Duration = Duration::from_millis(400);

    /// Time at which the bar disappears.
    pub(crate) fn end(&self) -> Option<Instant> {
        self.finished.map(|finished| finished + Self::LINGER)
    }
}

/// Progress and result of the newest request.
pub(crate) struct WorkState {
    pub activity: Activity,
    pub rendering: Rendering,
    pub paused: bool,
    /// Time at which the request was paused.
    pub paused_at: Option<Instant>,
    pub stages: [Option<StageReport>; Stage::ALL.len()],
    /// Seconds of each stage when it last worked before this request.
    pub last_seconds: [Option<f64>; Stage::ALL.len()],
    pub assets: Vec<AssetBar>,
    pub progress: Option<RenderProgress>,
    pub report: Option<Box<Report>>,
    /// Noise against the time of this render.
    pub curve: NoiseCurve,
    /// The same of the last picture that was finished.
    pub last_curve: NoiseCurve,
    /// Curves of the last renders, the newest at the end: a picture that is found again has its curve.
    curves: Vec<(ImageOrigin, NoiseCurve)>,
    /// Whether the request changed nothing.
    pub unchanged: bool,
    /// Finished renders so far; another exposure is no render.
    pub renders: u64,
}

impl WorkState {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            activity: Activity::Running { since: now },
            rendering: Rendering::UnderWay,
            paused: false,
            paused_at: None,
            stages: Default::default(),
            last_seconds: Default::default(),
            assets: Vec::new(),
            progress: None,
            report: None,
            curve: NoiseCurve::default(),
            last_curve: NoiseCurve::default(),
            curves: Vec::new(),
            unchanged: false,
            renders: 0,
        }
    }

    /// Keeps the curve of a finished render.
    pub(crate) fn keep_curve(&mut self, origin: ImageOrigin) {
        const MOST: usize = 16;
        self.curves.retain(|(other, _)| *other != origin);
        self.curves.push((origin, self.curve.clone()));
        if self.curves.len() > MOST {
            self.curves.remove(0);
        }
    }

    /// Takes up the curve of a picture that is found again, if it is known.
    pub(crate) fn find_curve(&mut self, origin: &ImageOrigin) {
        let found = self.curves.iter().find(|(other, _)| other == origin);
        self.curve = found.map(|(_, curve)| curve.clone()).unwrap_or_default();
    }

    /// Whether a picture is being rendered, be it of the last good scene.
    pub(crate) fn is_under_way(&self) -> bool {
        self.rendering == Rendering::UnderWay
    }

    pub(crate) fn is_running(&self) -> bool {
        matches!(self.activity, Activity::Running { .. })
    }

    /// Time that the current request has been at work; it stands still during a pause.
    pub(crate) fn running_for(&self, now: Instant) -> Option<Duration> {
        match self.activity {
            Activity::Running { since } => {
                Some(self.paused_at.unwrap_or(now).saturating_duration_since(since))
            }
            Activity::Done | Activity::Waiting | Activity::Broken | Activity::Cancelled => None,
        }
    }

    /// The same, with the seconds in which earlier requests rendered the samples that it goes on from.
    pub(crate) fn rendering_for(&self, now: Instant) -> Option<Duration> {
        let earlier = self.progress.map_or(0.0, |progress| progress.earlier_seconds);
        let earlier = Duration::try_from_secs_f64(earlier).unwrap_or_default();
        self.running_for(now).map(|time| time.saturating_add(earlier))
    }

    /// Stops the clock of the request, or lets it go on.
    pub(crate) fn set_paused(&mut self, paused: bool, now: Instant) {
        self.paused = paused;
        if paused {
            self.paused_at = Some(now);
        } else if let Some(held) = self.paused_at.take()
            && let Activity::Running { since } = &mut self.activity
        {
            *since += now.saturating_duration_since(held);
        }
    }
}
