//! What the front end knows. It changes in `update` alone.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::color::{Ansi, ColorDepth, Shades};
use super::editor::FilePlace;
use super::event::{Unwritten, Window, Written};
use super::graphics::Protocol;
use super::history::History;
use super::known::Ask;
use super::mosaic::Grid;
use super::preview_kind::PreviewKind;
use crate::film::Picture;
use crate::pipeline::protocol::{
    AssetProgress, PreviewSize, RenderProgress, Report, Section, Spot, Stage, StageReport, Viewpoint,
};
use crate::pipeline::settings::{CameraChange, Effective, Overrides, View};
use crate::scene::description::{Integrator, Shadows};
use crate::scene::diagnostic::Diagnostic;

/// What the keys changed on top of the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Toggles {
    pub shadows: Option<Shadows>,
    pub integrator: Option<Integrator>,
    pub dof: Option<bool>,
    pub photons: Option<bool>,
    pub view: Option<View>,
    pub camera: CameraChange,
    pub exposure: Option<f32>,
}

/// Steps of the camera come faster than pictures: the newest one waits until the step before has its first picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Nudge {
    /// The request of a step.
    pub request: Option<u64>,
    /// Whether there is a newer step.
    pub is_waiting: bool,
}

/// What the worker is doing for the current generation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Activity {
    /// At work since then.
    Running { since: Instant },
    /// Finished.
    Done,
    /// Could not be done, perhaps because the file is not whole yet.
    Waiting,
    /// Could not be done.
    Broken,
    /// Stopped.
    Cancelled,
}

/// Why the picture is not of the file as it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Problems {
    /// Errors and warnings with places.
    pub diagnostics: Vec<Diagnostic>,
    /// A failure without a place.
    pub work: Option<String>,
}

/// A save on its way to the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PendingChange {
    pub generation: u64,
    pub noticed: Instant,
}

/// The list of views, while it is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ViewList {
    /// When it goes by itself.
    pub until: Instant,
    /// What was typed of a name after `/`; `None` while no name is looked for.
    pub name: Option<String>,
}

/// Text over the picture that can be scrolled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pane {
    pub open: bool,
    /// First line shown.
    pub scroll: usize,
}

/// The bar of a loading asset.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AssetBar {
    pub progress: AssetProgress,
    /// When it was full; it stays a moment longer, so that 100% is seen.
    pub finished: Option<Instant>,
}

impl AssetBar {
    const LINGER: Duration = Duration::from_millis(400);

    /// When it goes.
    pub(super) fn end(&self) -> Option<Instant> {
        self.finished.map(|finished| finished + Self::LINGER)
    }
}

/// What the last picture took on its way to the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameReport {
    pub bytes: usize,
    /// How long the terminal takes to answer; none: it does not.
    pub round_trip: Option<Duration>,
}

/// The picture on the screen and the request that it is of.
#[derive(Clone, Debug)]
pub(super) struct Shown {
    pub generation: u64,
    pub picture: Arc<Picture>,
    /// The least and the greatest number that it shows, where it is stretched to them.
    pub range: Option<[f32; 2]>,
    /// The part of the picture that is shown pixel by pixel; none: all of it.
    pub section: Option<Section>,
    /// Whether it lacks the light of photons, which are still being traced.
    pub lacks_photons: bool,
}

/// The left button went down over a cell of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Press {
    /// Where it was seen last.
    pub column: u16,
    pub row: u16,
    pub has_moved: bool,
    /// The place of the picture where it began.
    pub from: Option<Spot>,
}

/// Why it was asked what is at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Purpose {
    #[default]
    Inspect,
    Focus,
}

/// How the front end starts.
pub(super) struct Setup {
    pub scene: PathBuf,
    pub overrides: Overrides,
    pub window: Window,
    pub preview: PreviewKind,
    pub depth: ColorDepth,
    /// Whether the environment says that the terminal's background is light.
    pub is_light: bool,
    /// What the 16 colours are likely to be.
    pub ansi: Ansi,
    /// What the terminal is asked.
    pub ask: Ask,
}

/// Everything.
pub(super) struct State {
    pub scene: PathBuf,
    /// The command line's.
    pub base: Overrides,
    pub toggles: Toggles,
    pub window: Window,
    pub preview: PreviewKind,
    pub depth: ColorDepth,
    pub shades: Shades,
    /// The terminal's 16 colours.
    pub ansi: Ansi,
    /// What the terminal was asked of itself.
    pub ask: Ask,
    /// Whether the terminal's background is a light one.
    pub is_light: bool,

    /// Of the newest request.
    pub generation: u64,
    /// What the keys had changed for the newest request.
    pub requested_toggles: Toggles,
    /// Whether the newest request is the picture of before, brighter or darker.
    pub is_exposed: bool,
    /// The preview size of the newest request.
    pub requested: Option<PreviewSize>,
    pub activity: Activity,
    pub paused: bool,
    /// When the request under way was held.
    pub paused_at: Option<Instant>,
    /// When to ask for another preview size.
    pub resize_due: Option<Instant>,

    pub effective: Option<Effective>,
    /// The scene's own camera, of the newest request that was understood.
    pub camera: Option<Viewpoint>,
    /// The scene's own exposure, in stops.
    pub exposure: Option<f32>,
    pub nudge: Nudge,
    /// The first request of a camera that keys have moved.
    pub moved_since: Option<u64>,
    pub is_mouse_on: bool,
    pub press: Option<Press>,
    /// Whether the next click is for the focus.
    pub is_focusing: bool,
    /// The last click, else the middle of the picture.
    pub crosshair: Spot,
    /// Where the picture is shown pixel by pixel; none: all of it is shown.
    pub close_up: Option<Spot>,
    /// What is rendered before the rest.
    pub first: Option<Section>,
    /// Whether the next drag tells what that is.
    pub is_marking: bool,
    /// What the last answer about a place is for.
    pub asked: Purpose,
    /// What was found there, until the next key.
    pub inspected: Option<Vec<String>>,
    /// The same, in the scene file.
    pub picked: Option<FilePlace>,
    pub history: History,
    /// The request of the last edit.
    pub edit: Option<u64>,
    /// The last edit that changed the picture.
    pub saved: Option<u64>,
    pub stages: [Option<StageReport>; Stage::ALL.len()],
    /// What each stage took when it was last at work before this request.
    pub before: [Option<f64>; Stage::ALL.len()],
    pub assets: Vec<AssetBar>,
    pub progress: Option<RenderProgress>,
    pub report: Option<Box<Report>>,
    pub unchanged: bool,
    /// Requests that were rendered and finished; another exposure is no render.
    pub renders: u64,
    /// Changes of the files that the scene is made of.
    pub edits: u64,
    /// Whether the next picture that is written is one that was asked for.
    pub asked_to_write: bool,
    /// Why the picture at hand is not on disk although it is to be.
    pub unwritten: Option<String>,
    /// The last failure to write, until a later picture is on disk.
    pub write_failed: Option<Unwritten>,
    pub written: Vec<Written>,
    pub picture: Option<Shown>,

    /// None while the file is whole.
    pub problems: Option<Problems>,
    /// What is wrong with a file that may still be being written.
    pub held: Option<Vec<Diagnostic>>,
    /// Whether nobody is writing the files.
    pub is_settled: bool,
    pub warnings: Vec<Diagnostic>,
    /// Whether they are those of the newest request.
    pub are_warnings_known: bool,
    pub pane: Pane,
    pub help: Pane,
    pub views: Option<ViewList>,
    /// Whether the picture has the screen for itself.
    pub is_alone: bool,
    pub message: Option<String>,
    /// When the camera was written into the scene file, or was not because of what is there.
    pub kept: Option<Instant>,
    pub not_kept: Option<Instant>,

    pub change: Option<PendingChange>,
    /// When the editor last gave the terminal back.
    pub back: Option<Instant>,
    /// From the last save to its first changed cell, without the time in the editor.
    pub first_change: Option<Duration>,

    pub frame: Option<FrameReport>,

    /// The time of the newest event.
    pub now: Instant,
    /// Whether the screen is out of date.
    pub dirty: bool,
    /// Whether the next frame is the first picture of a request or the answer to a key, which do not wait for their
    /// turn.
    pub urgent: bool,
}

impl State {
    pub(super) fn new(setup: Setup, now: Instant) -> Self {
        Self {
            scene: setup.scene,
            base: setup.overrides,
            toggles: Toggles::default(),
            window: setup.window,
            preview: setup.preview,
            depth: setup.depth,
            shades: Shades::new(setup.depth, &setup.ansi),
            ansi: setup.ansi,
            ask: setup.ask,
            is_light: setup.is_light,
            generation: 0,
            requested_toggles: Toggles::default(),
            is_exposed: false,
            requested: None,
            activity: Activity::Running { since: now },
            paused: false,
            paused_at: None,
            resize_due: None,
            effective: None,
            camera: None,
            exposure: None,
            nudge: Nudge::default(),
            moved_since: None,
            is_mouse_on: true,
            press: None,
            is_focusing: false,
            crosshair: Spot { x: 0.5, y: 0.5 },
            close_up: None,
            first: None,
            is_marking: false,
            asked: Purpose::default(),
            inspected: None,
            picked: None,
            history: History::default(),
            edit: None,
            saved: None,
            stages: Default::default(),
            before: Default::default(),
            assets: Vec::new(),
            progress: None,
            report: None,
            unchanged: false,
            renders: 0,
            edits: 0,
            asked_to_write: false,
            unwritten: None,
            write_failed: None,
            written: Vec::new(),
            picture: None,
            problems: None,
            held: None,
            is_settled: true,
            warnings: Vec::new(),
            are_warnings_known: false,
            pane: Pane::default(),
            help: Pane::default(),
            views: None,
            is_alone: false,
            message: None,
            kept: None,
            not_kept: None,
            change: None,
            back: None,
            first_change: None,
            frame: None,
            now,
            dirty: true,
            urgent: false,
        }
    }

    /// The scene's settings as the command line and the keys change them.
    pub(super) fn overrides(&self) -> Overrides {
        let mut overrides = self.base.clone();
        overrides.shadows = self.toggles.shadows.or(overrides.shadows);
        overrides.integrator = self.toggles.integrator.or(overrides.integrator);
        overrides.dof = self.toggles.dof.or(overrides.dof);
        overrides.photons = self.toggles.photons.or(overrides.photons);
        overrides.view = self.toggles.view.or(overrides.view);
        overrides.camera = self.toggles.camera;
        overrides.exposure = self.toggles.exposure.or(overrides.exposure);
        overrides
    }

    /// The camera as the keys have it; none: no scene has been understood yet.
    pub(super) fn viewpoint(&self) -> Option<Viewpoint> {
        self.camera.map(|camera| camera.changed(&self.toggles.camera))
    }

    /// What the keys changed that the picture alone does not tell.
    pub(super) fn changes(&self) -> Vec<String> {
        let moved = self.toggles.camera.is_any().then(|| "camera moved".to_owned());
        let exposed = self.toggles.exposure.map(|stops| format!("exposure {stops:+}"));
        moved.into_iter().chain(exposed).collect()
    }

    /// Whether a picture is written unasked: one of the scene's own camera, in the view that the run began with.
    pub(super) fn is_written(&self) -> bool {
        self.view() == self.base_view() && !self.toggles.camera.is_any()
    }

    /// Whether the last step of the camera has no picture yet.
    pub(super) fn awaits_step(&self) -> bool {
        let is_shown = self.picture.as_ref().is_some_and(|shown| shown.generation == self.generation);
        // While the scene is broken, the last good one is rendered.
        let is_at_work = match self.activity {
            Activity::Running { .. } => true,
            Activity::Waiting | Activity::Broken => self.camera.is_some() && self.work_goes_on(),
            Activity::Done | Activity::Cancelled => false,
        };
        self.nudge.request == Some(self.generation) && is_at_work && self.requested.is_some() && !is_shown
    }

    /// Whether what failed was the scene, not the work.
    fn work_goes_on(&self) -> bool {
        self.problems.as_ref().is_none_or(|problems| problems.work.is_none())
    }

    /// The view that the run was started with: the only one that is written without being asked.
    pub(super) fn base_view(&self) -> View {
        self.base.view.unwrap_or(View::Beauty)
    }

    pub(super) fn view(&self) -> View {
        self.toggles.view.unwrap_or_else(|| self.base_view())
    }

    /// The shadows that hold now.
    pub(super) fn shadows(&self) -> Shadows {
        let of_scene = self.effective.as_ref().map_or(Shadows::Soft, |effective| effective.shadows);
        self.overrides().shadows.unwrap_or(of_scene)
    }

    /// Whether photons are on now.
    pub(super) fn photons(&self) -> bool {
        let of_scene = self.effective.as_ref().is_some_and(|effective| effective.photons);
        self.overrides().photons.unwrap_or(of_scene)
    }

    /// The integrator that holds now.
    pub(super) fn integrator(&self) -> Integrator {
        let of_scene = self.effective.as_ref().map_or(Integrator::Whitted, |effective| effective.integrator);
        self.overrides().integrator.unwrap_or(of_scene)
    }

    /// Pixels of the preview in the width of a cell.
    pub(super) fn pixels_across(&self) -> u32 {
        /// More are not worth their bytes.
        const MOST: u32 = 10;
        /// Pixels of the whole window: summing, developing and encoding those of its picture takes some 45 bytes each.
        const MOST_PIXELS: f32 = 2_400_000.0;
        /// The same for sixels, which themselves take as much again.
        const MOST_IN_SIXELS: f32 = 1_600_000.0;
        match self.preview {
            PreviewKind::Pixels(protocol) => {
                let most = match protocol {
                    Protocol::Sixel => MOST_IN_SIXELS,
                    Protocol::Kitty | Protocol::Iterm => MOST_PIXELS,
                };
                let window = &self.window;
                let squares = f32::from(window.columns) * f32::from(window.rows) * window.cell_aspect;
                let affordable = (most / squares.max(1.0)).sqrt() as u32;
                u32::from(window.cell_pixels.0).min(affordable).clamp(1, MOST)
            }
            kind => kind.grid().map_or(1, Grid::columns),
        }
    }

    /// Whether colours are mixed from those that the terminal has.
    pub(super) fn mixes_colors(&self) -> bool {
        matches!(self.depth, ColorDepth::Indexed256 | ColorDepth::Ansi16)
            || self.preview == PreviewKind::Pixels(Protocol::Sixel)
    }

    /// Width over height of the picture, as far as it is known.
    pub(super) fn aspect(&self) -> f32 {
        const USUAL: f32 = 4.0 / 3.0;
        self.effective
            .as_ref()
            .map_or(USUAL, |it| it.width as f32 / it.height.max(1) as f32)
            .clamp(0.02, 50.0)
    }

    /// Shows the list of views for a moment more.
    pub(super) fn list_views(&mut self) {
        const MOMENT: Duration = Duration::from_secs(4);
        let name = self.views.take().and_then(|views| views.name);
        self.views = Some(ViewList { until: self.now + MOMENT, name });
        self.dirty = true;
    }

    pub(super) fn is_running(&self) -> bool {
        matches!(self.activity, Activity::Running { .. })
    }

    /// How long the current request has been at work; while it is held, the time stands still.
    pub(super) fn running_for(&self) -> Option<Duration> {
        match self.activity {
            Activity::Running { since } => {
                Some(self.paused_at.unwrap_or(self.now).saturating_duration_since(since))
            }
            Activity::Done | Activity::Waiting | Activity::Broken | Activity::Cancelled => None,
        }
    }

    /// Hold the clock of the request or let it go on.
    pub(super) fn set_paused(&mut self, paused: bool) {
        self.paused = paused;
        if paused {
            self.paused_at = Some(self.now);
        } else if let Some(held) = self.paused_at.take()
            && let Activity::Running { since } = &mut self.activity
        {
            *since += self.now.saturating_duration_since(held);
        }
    }

    /// When the state has to hear of the time again, if nothing else happens.
    pub(super) fn next_tick(&self) -> Option<Instant> {
        const CLOCK: Duration = Duration::from_millis(250);
        let clock = (self.is_running() && !self.paused).then(|| self.now + CLOCK);
        let bars = self.assets.iter().filter_map(AssetBar::end).min();
        let views = self.views.as_ref().map(|views| views.until);
        [clock, self.resize_due, bars, views].into_iter().flatten().min()
    }
}
