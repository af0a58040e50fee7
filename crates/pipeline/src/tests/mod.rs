//! Tests that control the worker through messages, as front ends do.

mod adaptive;
mod camera;
mod commands;
mod own;
mod photons;
mod previews;
mod reuse;
mod sweeps;
mod switching;
mod targets;

use std::cell::Cell;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};
use std::time::Duration;

use crate::protocol::{
    Command, Event, Failure, NormalizedPosition, NormalizedRect, PreviewBounds, PreviewSlot, PreviewUpdate,
    Report, Request, Stage, StageStatus, WriteRequirement, reasons,
};
use crate::scene::LoadedScene;
use crate::scene::description::ResolvedCamera;
use crate::scene::diagnostic::Diagnostic;
use crate::session::SessionConfig;
use crate::settings::Overrides;
use crate::sink::EventSink;
use crate::trace::TileKernel;
use crate::watch::content::FileHashCache;
use crate::worker::{WorkerHandle, start_worker_with_config};

/// Loads a scene from text, with a default camera.
pub(crate) fn loaded_of(text: &str) -> LoadedScene {
    let place = "position = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
    let text = if text.contains("[camera]\n") {
        text.replace("[camera]\n", &format!("[camera]\n{place}"))
    } else {
        format!("{text}\n[camera]\n{place}")
    };
    let folder = tempfile::tempdir().expect("a scratch folder");
    let path = folder.path().join("scene.toml");
    fs::write(&path, text).expect("written");
    crate::scene::load(&path, &[]).expect("a valid scene")
}

pub(super) const SCENE: &str = r#"
[render]
width = 40
height = 30
samples = 4
exposure = 0.0
[camera]
position = [0, 1, 4]
look_at = [0, 1, 0]
[textures.skin]
file = "skin.ppm"
[materials.ball]
type = "phong"
diffuse = { texture = "skin" }
[materials.wall]
type = "phong"
diffuse = [0.5, 0.5, 0.5]
[[sphere]]
center = [0, 1, 0]
radius = 0.5
material = "ball"
[[mesh]]
file = "one.obj"
material = "wall"
translate = [0, 0, 0]
[[light]]
type = "point"
position = [0, 3, 0]
intensity = [10, 10, 10]
"#;

pub(super) const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

pub(super) const KERNEL: TileKernel = crate::integrators::render_tile_with_photons;

/// Creates a sink, and a channel that receives its events.
pub(crate) fn sink_with_channel(generation: u64) -> (EventSink, Receiver<Event>) {
    let (sender, events) = mpsc::channel();
    let listener = Arc::new(move |event| drop(sender.send(event)));
    (EventSink { generation, listener, previews: PreviewSlot::default() }, events)
}

/// Starts a worker, and returns a channel that receives its events.
pub(super) fn start_worker(
    config: SessionConfig,
    contents: &Arc<FileHashCache>,
) -> (WorkerHandle, Receiver<Event>) {
    let (sink, events) = sink_with_channel(0);
    (start_worker_with_config(config, Arc::clone(contents), sink.listener).expect("a thread"), events)
}

pub(crate) struct Bench {
    pub(super) folder: tempfile::TempDir,
    /// File name of the scene or model.
    pub(super) scene: &'static str,
    pub(super) worker: WorkerHandle,
    pub(super) events: Receiver<Event>,
    pub(super) contents: Arc<FileHashCache>,
    pub(super) generation: u64,
    pub(super) overrides: Overrides,
    pub(super) preview: Option<PreviewBounds>,
    pub(super) force: bool,
    pub(super) first: Option<NormalizedRect>,
    pub(super) writing: WriteRequirement,
    /// Number of files written so far.
    pub(super) saves: Cell<u64>,
    /// The scene's camera, as last reported by the worker.
    pub(super) own: Cell<Option<ResolvedCamera>>,
}

impl Bench {
    pub(super) fn new(scene: &str) -> Self {
        Self::with(scene, KERNEL)
    }

    pub(super) fn with(scene: &str, kernel: TileKernel) -> Self {
        Self::with_config(scene, SessionConfig { kernel, ..SessionConfig::default() })
    }

    pub(super) fn with_config(scene: &str, config: SessionConfig) -> Self {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let output = folder.path().join("out.ppm");
        let overrides = Overrides { outputs: vec![output], threads: Some(2), ..Default::default() };
        let contents = Arc::default();
        let (worker, events) = start_worker(config, &contents);
        let bench = Self {
            folder,
            scene: "scene.toml",
            worker,
            events,
            contents,
            generation: 0,
            overrides,
            preview: None,
            force: false,
            first: None,
            writing: WriteRequirement::Must,
            saves: Cell::new(0),
            own: Cell::new(None),
        };
        bench.write("scene.toml", scene);
        bench.write("one.obj", OBJ);
        bench.write("skin.ppm", "P6\n1 1\n255\nabc");
        bench
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(super) fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("written");
        self.saves.set(self.saves.get() + 1);
    }

    pub(super) fn edit(&self, from: &str, to: &str) {
        let text = fs::read_to_string(self.path("scene.toml")).expect("the scene");
        assert!(text.contains(from), "{from}");
        self.write("scene.toml", &text.replace(from, to));
    }

    pub(super) fn send(&mut self) -> u64 {
        self.generation += 1;
        self.worker.send(Command::Render(Box::new(Request {
            generation: self.generation,
            scene: self.path(self.scene),
            overrides: self.overrides.clone(),
            preview: self.preview,
            write: self.writing,
            own: None,
            saves: self.saves.get(),
            force: self.force,
            first: self.first,
        })));
        self.generation
    }

    pub(super) fn next(&self) -> Event {
        let event = self.events.recv_timeout(Duration::from_secs(60)).expect("an event within a minute");
        if let Event::Settings { own, .. } = &event {
            self.own.set(Some(own.camera));
        }
        event
    }

    /// Receives all events until generation `of` ends.
    pub(super) fn until_end(&self, of: u64) -> Vec<Event> {
        let mut events = Vec::new();
        loop {
            let event = self.next();
            let ends = matches!(&event,
                Event::Done { generation, .. } | Event::Failed { generation, .. } | Event::Canceled { generation }
                if *generation == of);
            events.push(event);
            if ends {
                return events;
            }
        }
    }

    pub(super) fn done(&mut self) -> (Report, bool) {
        let of = self.send();
        match self.until_end(of).pop() {
            Some(Event::Done { report, unchanged, .. }) => (*report, unchanged),
            other => panic!("{other:?}"),
        }
    }

    pub(super) fn done_with_warnings(&mut self) -> (Report, Vec<Diagnostic>) {
        let of = self.send();
        match self.until_end(of).pop() {
            Some(Event::Done { report, warnings, .. }) => (*report, warnings),
            other => panic!("{other:?}"),
        }
    }

    pub(super) fn failed(&mut self) -> Failure {
        let of = self.send();
        match self.until_end(of).pop() {
            Some(Event::Failed { failure, .. }) => failure,
            other => panic!("{other:?}"),
        }
    }

    pub(super) fn picture(&self) -> Vec<u8> {
        fs::read(self.path("out.ppm")).expect("an image")
    }
}

/// Returns one letter for each stage, in order: `d` for done, `r` for reused, `s` for skipped.
pub(super) fn statuses(report: &Report) -> String {
    let names: Vec<Stage> = report.stages.iter().map(|stage| stage.name).collect();
    assert_eq!(names, Stage::ALL);
    let letter = |status| match status {
        StageStatus::Done => 'd',
        StageStatus::Reused => 'r',
        StageStatus::Skipped => 's',
        StageStatus::Running => '?',
    };
    report.stages.iter().map(|stage| letter(stage.status)).collect()
}

#[track_caller]
pub(super) fn assert_statuses(report: &Report, expected: &str) {
    assert_eq!(statuses(report), expected, "parse meshes textures accel lights photons render write");
}
