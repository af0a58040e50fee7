//! A scripted worker and a UI without a terminal, for tests.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::color::{ColorDepth, XTERM};
use super::event::{Effect, Event, KeyPress, WindowSize};
use super::options::ContentChangeTime;
use super::preview_style::PreviewStyle;
use super::state::{InitialState, State};
use super::terminal_replies::TerminalQueries;
use super::terminals::TerminalExtras;
use super::update::{request_first_render, update};
use super::view;
use crate::film::Srgb8Image;
use crate::math::DVec3;
use crate::pipeline::protocol::{
    self, AssetProgress, Command, Failure, ImageReport, PreviewUpdate, RenderProgress, Report, Request,
    ResolvedCamera, SampleCounts, Stage, StageReport, StageStatus, WorkCounters,
};
use crate::pipeline::settings::{AdjustableSceneSettings, EffectiveSettingsSummary, Overrides, ViewMode};
use crate::scene::description::{Accel, ImageShiftAndMirror, Integrator, Pose, Projection, ShadowMode};
use crate::scene::diagnostic::{Diagnostic, Severity, SourceSpan};

pub(super) fn window(columns: u16, rows: u16) -> WindowSize {
    WindowSize { columns, rows, cell_aspect: 2.0, cell_pixels: (8, 16) }
}

/// Creates a state from which no request has been sent yet.
pub(super) fn state(columns: u16, rows: u16) -> State {
    state_with(columns, rows, PreviewStyle::HalfBlock, ColorDepth::TrueColor, Overrides::default())
}

pub(super) fn state_with(
    columns: u16,
    rows: u16,
    preview: PreviewStyle,
    depth: ColorDepth,
    overrides: Overrides,
) -> State {
    let scene = PathBuf::from("scenes/cornell.toml");
    let setup = InitialState {
        scene,
        overrides,
        window: window(columns, rows),
        preview,
        depth,
        is_light: false,
        ansi: XTERM,
        ask: TerminalQueries::default(),
        capabilities: TerminalExtras::default(),
        notify_after: Some(Duration::from_secs(30)),
    };
    State::new(setup, Instant::now())
}

/// A user interface driven by a test instead of the event loop.
pub(super) struct TestUi {
    pub state: State,
    pub now: Instant,
}

impl TestUi {
    /// An 80×24 UI that has sent its first request.
    pub(super) fn new() -> Self {
        Self::from_state(state(80, 24))
    }

    pub(super) fn from_state(mut state: State) -> Self {
        let now = state.now;
        request_first_render(&mut state);
        Self { state, now }
    }

    /// Handles an event and returns its effects.
    pub(super) fn handle_event(&mut self, event: Event) -> Vec<Effect> {
        update(&mut self.state, event, self.now)
    }

    pub(super) fn worker_event(&mut self, event: protocol::Event) -> Vec<Effect> {
        self.handle_event(Event::Worker(event))
    }

    pub(super) fn press_key(&mut self, key: KeyPress) -> Vec<Effect> {
        self.handle_event(Event::Key(key))
    }

    pub(super) fn press_character(&mut self, character: char) -> Vec<Effect> {
        self.press_key(KeyPress::plain(character))
    }

    pub(super) fn advance_clock(&mut self, milliseconds: u64) -> Vec<Effect> {
        self.now += Duration::from_millis(milliseconds);
        self.handle_event(Event::Tick)
    }

    /// Saves a scene with this text and lets the worker load it.
    pub(super) fn simulate_scene_save(&mut self, text: &str) {
        self.handle_event(Event::FileChanged(ContentChangeTime { noticed: self.now }));
        let generation = self.state.request.generation;
        self.worker_event(protocol::Event::Text { generation, text: text.into() });
    }

    /// Starts the current request and reports that its scene is valid.
    pub(super) fn report_scene_read(&mut self) {
        let generation = self.state.request.generation;
        self.worker_event(protocol::Event::Started { generation });
        self.worker_event(protocol::Event::Settings {
            generation,
            settings: Box::new(effective_settings()),
            own: scene_settings(),
        });
    }

    /// Delivers a preview of the current request.
    pub(super) fn show_preview(&mut self, color: [u8; 3]) {
        self.handle_event(Event::Preview(PreviewUpdate {
            generation: self.state.request.generation,
            picture: uniform_picture(50, 38, color),
            range: None,
            section: None,
            lacks_photons: false,
            source: None,
        }));
    }

    /// Simulates a complete render of a uniform image.
    pub(super) fn finish_render(&mut self, color: [u8; 3]) {
        self.report_scene_read();
        self.show_preview(color);
        self.worker_event(done_event(self.state.request.generation, Vec::new(), false));
    }

    pub(super) fn report_scene_errors(&mut self, diagnostics: Vec<Diagnostic>) {
        let generation = self.state.request.generation;
        self.worker_event(protocol::Event::Started { generation });
        self.worker_event(protocol::Event::Failed { generation, failure: Failure::Scene(diagnostics) });
    }

    /// Draws the screen into a buffer.
    pub(super) fn draw_screen(&mut self) -> Buffer {
        self.state.dirty = false;
        let mut buffer =
            Buffer::empty(Rect::new(0, 0, self.state.display.window.columns, self.state.display.window.rows));
        view::draw(&self.state, &mut buffer);
        buffer
    }

    /// The text on the screen. Half blocks are removed and runs of spaces are collapsed.
    pub(super) fn screen_words(&mut self) -> String {
        self.screen_text().replace('▀', " ").split_whitespace().collect::<Vec<_>>().join(" ")
    }

    pub(super) fn screen_text(&mut self) -> String {
        buffer_text(&self.draw_screen())
    }
}

/// A buffer's rows as text.
pub(super) fn buffer_text(buffer: &Buffer) -> String {
    let width = usize::from(buffer.area.width).max(1);
    let rows = buffer.content.chunks(width);
    rows.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>() + "\n").collect()
}

/// The render request in a list of effects.
pub(super) fn sent_render_request(effects: &[Effect]) -> Option<&Request> {
    effects.iter().find_map(|effect| match effect {
        Effect::Send(Command::Render(request)) => Some(&**request),
        _ => None,
    })
}

pub(super) fn uniform_picture(width: u32, height: u32, color: [u8; 3]) -> Arc<Srgb8Image> {
    Arc::new(Srgb8Image { width, height, pixels: vec![color; width as usize * height as usize] })
}

pub(super) fn effective_settings() -> EffectiveSettingsSummary {
    EffectiveSettingsSummary {
        width: 640,
        height: 480,
        error: 0.0,
        samples: 64,
        integrator: Integrator::Whitted,
        shadows: ShadowMode::Soft,
        clamp: 0.0,
        photons: false,
        dof: true,
        accel: Accel::Bvh,
        view: ViewMode::Beauty,
        exposure: 0.0,
        seed: 0,
        threads: 2,
        outputs: vec![PathBuf::from("cornell.png")],
    }
}

/// Settings from the scene file, before any overrides.
pub(super) fn scene_settings() -> AdjustableSceneSettings {
    let (integrator, shadows) = (Integrator::Whitted, ShadowMode::Soft);
    AdjustableSceneSettings { camera: camera(), exposure: 0.0, integrator, shadows, photons: false }
}

/// A camera at (0, 1, 4) that looks along −z at a point 4 units away.
pub(super) fn camera() -> ResolvedCamera {
    let pose = Pose { position: DVec3::new(0.0, 1.0, 4.0), look_at: DVec3::Y, up: DVec3::Y };
    ResolvedCamera {
        pose,
        projection: Projection::Perspective { fov: 40.0 },
        window: ImageShiftAndMirror::default(),
        aperture: 0.1,
        focus: 4.0,
    }
}

pub(super) fn stage_report(name: Stage, status: StageStatus, seconds: f64, why: &str) -> StageReport {
    StageReport { name, status, seconds, processor_seconds: seconds, why: why.to_owned() }
}

pub(super) fn asset_progress(name: &str, done: u64, total: u64) -> AssetProgress {
    AssetProgress { name: name.to_owned(), done, total }
}

pub(super) fn render_progress(fraction: f64, eta_seconds: Option<f64>) -> RenderProgress {
    let samples = (fraction * 64.0) as u32;
    RenderProgress {
        fraction,
        elapsed_seconds: 1.0,
        earlier_seconds: 0.0,
        eta_seconds,
        samples,
        mean_samples: f64::from(samples),
        total_samples: 64,
        is_total_fixed: true,
        noise: None,
    }
}

pub(super) fn done_event(generation: u64, warnings: Vec<Diagnostic>, unchanged: bool) -> protocol::Event {
    let image = ImageReport {
        path: Some("cornell.png".to_owned()),
        paths: vec!["cornell.png".to_owned()],
        width: 640,
        height: 480,
        samples: SampleCounts { min: 64, mean: 64.0, max: 64 },
        error: Some(0.0081),
        render_seconds: 0.25,
        complete: true,
        range: None,
    };
    let report = Report {
        photons: None,
        glimt: "0.1.0",
        scene: "scenes/cornell.toml".to_owned(),
        image,
        settings: effective_settings(),
        lights: protocol::LightSamplingReport {
            count: 1,
            sampled: protocol::SampledLightSet::All,
            picks: 0,
            tree_nodes: 0,
            memory_bytes: 0,
        },
        stages: Stage::ALL.iter().map(|name| stage_report(*name, StageStatus::Done, 0.25, "")).collect(),
        counters: WorkCounters::default(),
        seconds: 1.93,
        peak_memory_bytes: 0,
    };
    protocol::Event::Done { generation, report: Box::new(report), warnings, unchanged }
}

/// Event for a finished image written to a file.
pub(super) fn written_event(generation: u64, path: &str, is_own: bool) -> protocol::Event {
    protocol::Event::Written { generation, path: path.into(), bytes: 1, is_own, unfinished: None }
}

/// A diagnostic on the third line of a scene.
pub(super) fn diagnostic(severity: Severity, message: &str) -> Diagnostic {
    let source: Arc<str> = Arc::from("[render]\nwidth = 4\nheigth = 4\n");
    Diagnostic {
        severity,
        message: message.to_owned(),
        path: PathBuf::from("scenes/cornell.toml"),
        place: Some(SourceSpan { source, span: 19..25, label: "here".to_owned() }),
        help: Some("did you mean `height`?".to_owned()),
    }
}
