//! The worker's progress on the newest request.

use std::time::{Duration, Instant};

use super::request::ImageProvenance;
use crate::noise_curve::NoiseCurve;
use crate::pipeline::protocol::{AssetProgress, RenderProgress, Report, Stage, StageReport};

/// The worker's state for the current generation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RequestStatus {
    /// The worker is processing the request.
    Running { since: Instant },
    /// The request has finished.
    Done,
    /// The request failed, but the scene file may still be incomplete.
    Waiting,
    /// The request failed.
    Broken,
    /// The request was stopped.
    Canceled,
}

/// State of the newest request's render. While the scene is broken, this is a render of the last valid scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RenderState {
    UnderWay,
    Finished,
    Stopped,
}

/// Progress bar for an asset that is being loaded.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AssetProgressBar {
    pub progress: AssetProgress,
    /// Time when the bar became full. It stays at 100% for a moment.
    pub finished: Option<Instant>,
}

impl AssetProgressBar {
    const LINGER: Duration = Duration::from_millis(400);

    /// Time when the bar disappears.
    pub(crate) fn disappears_at(&self) -> Option<Instant> {
        self.finished.map(|finished| finished + Self::LINGER)
    }
}

/// Progress and result of the newest request.
pub(crate) struct WorkState {
    pub activity: RequestStatus,
    pub rendering: RenderState,
    pub paused: bool,
    /// Time when the request was paused.
    pub paused_at: Option<Instant>,
    pub stages: [Option<StageReport>; Stage::ALL.len()],
    /// Duration of each stage's last run before this request.
    pub last_seconds: [Option<f64>; Stage::ALL.len()],
    pub assets: Vec<AssetProgressBar>,
    pub progress: Option<RenderProgress>,
    pub report: Option<Box<Report>>,
    /// Noise over time for this render.
    pub curve: NoiseCurve,
    /// Noise over time for the last finished render.
    pub last_curve: NoiseCurve,
    /// Curves of recent renders, from oldest to newest. They are restored if a later request reproduces an
    /// image.
    curves: Vec<(ImageProvenance, NoiseCurve)>,
    /// Whether the request left the image unchanged.
    pub unchanged: bool,
    /// Number of finished renders, not counting exposure changes.
    pub renders: u64,
    /// Whether `renders` includes the newest render. A change of exposure does not count as a new render.
    pub is_counted: bool,
}

impl WorkState {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            activity: RequestStatus::Running { since: now },
            rendering: RenderState::UnderWay,
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
            is_counted: false,
        }
    }

    /// Stores a finished render's curve.
    pub(crate) fn store_finished_noise_curve(&mut self, origin: ImageProvenance) {
        const MAX: usize = 16;
        self.curves.retain(|(other, _)| *other != origin);
        self.curves.push((origin, self.curve.clone()));
        if self.curves.len() > MAX {
            self.curves.remove(0);
        }
    }

    /// Restores the curve if an earlier request rendered the same image.
    pub(crate) fn restore_noise_curve_for_image(&mut self, origin: &ImageProvenance) {
        let found = self.curves.iter().find(|(other, _)| other == origin);
        self.curve = found.map(|(_, curve)| curve.clone()).unwrap_or_default();
    }

    /// Whether a render is running. It may be a render of the last valid scene.
    pub(crate) fn is_rendering(&self) -> bool {
        self.rendering == RenderState::UnderWay
    }

    pub(crate) fn is_request_running(&self) -> bool {
        matches!(self.activity, RequestStatus::Running { .. })
    }

    /// How long the current request has been running, not counting pauses.
    pub(crate) fn running_time(&self, now: Instant) -> Option<Duration> {
        match self.activity {
            RequestStatus::Running { since } => {
                Some(self.paused_at.unwrap_or(now).saturating_duration_since(since))
            }
            RequestStatus::Done
            | RequestStatus::Waiting
            | RequestStatus::Broken
            | RequestStatus::Canceled => None,
        }
    }

    /// Like [`WorkState::running_time`], but includes the time that earlier requests spent on the same
    /// samples.
    pub(crate) fn total_rendering_time(&self, now: Instant) -> Option<Duration> {
        let earlier = self.progress.map_or(0.0, |progress| progress.earlier_seconds);
        let earlier = Duration::try_from_secs_f64(earlier).unwrap_or_default();
        self.running_time(now).map(|time| time.saturating_add(earlier))
    }

    /// Pauses or resumes the request's clock.
    pub(crate) fn set_clock_paused(&mut self, paused: bool, now: Instant) {
        self.paused = paused;
        if paused {
            self.paused_at = Some(now);
        } else if let Some(held) = self.paused_at.take()
            && let RequestStatus::Running { since } = &mut self.activity
        {
            *since += now.saturating_duration_since(held);
        }
    }
}
