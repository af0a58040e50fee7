//! The worker driven by messages, as front ends do it.

use std::fs;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::protocol::{Command, Event, Failure, PreviewSize, Report, Request, Stage, Status};
use super::settings::Overrides;
use super::trace::Kernel;
use super::worker::{Handle, KERNEL, start_with};
use crate::control::{CancelToken, Cancelled};
use crate::film::{Rect, TileSamples};
use crate::integrators::{RayCounters, RenderSettings};
use crate::scene::description::Scene;
use crate::world::World;

/// A scene of this text; a camera is added where there is none.
pub(super) fn scene_of(text: &str) -> Scene {
    let place = "position = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
    let text = if text.contains("[camera]\n") {
        text.replace("[camera]\n", &format!("[camera]\n{place}"))
    } else {
        format!("{text}\n[camera]\n{place}")
    };
    let folder = tempfile::tempdir().expect("a scratch folder");
    let path = folder.path().join("scene.toml");
    fs::write(&path, text).expect("written");
    super::standins::scene::load(&path).expect("a scene that is right").scene
}

const SCENE: &str = r#"
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

const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

struct Bench {
    folder: tempfile::TempDir,
    worker: Handle,
    generation: u64,
    overrides: Overrides,
    preview: Option<PreviewSize>,
    force: bool,
}

impl Bench {
    fn new(scene: &str) -> Self {
        Self::with(scene, KERNEL)
    }

    fn with(scene: &str, kernel: Kernel) -> Self {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let output = folder.path().join("out.ppm");
        let overrides = Overrides { outputs: vec![output], threads: Some(2), ..Default::default() };
        let worker = start_with(kernel).expect("a thread");
        let bench = Self { folder, worker, generation: 0, overrides, preview: None, force: false };
        bench.write("scene.toml", scene);
        bench.write("one.obj", OBJ);
        bench.write("skin.ppm", "P6\n1 1\n255\nabc");
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("written");
    }

    fn edit(&self, from: &str, to: &str) {
        let text = fs::read_to_string(self.path("scene.toml")).expect("the scene");
        assert!(text.contains(from), "{from}");
        self.write("scene.toml", &text.replace(from, to));
    }

    fn send(&mut self) -> u64 {
        self.generation += 1;
        self.worker.send(Command::Render(Box::new(Request {
            generation: self.generation,
            scene: self.path("scene.toml"),
            overrides: self.overrides.clone(),
            preview: self.preview,
            write: true,
            force: self.force,
        })));
        self.generation
    }

    fn next(&self) -> Event {
        self.worker.events.recv_timeout(Duration::from_secs(60)).expect("the worker speaks")
    }

    /// All events up to the one that ends this generation.
    fn until_end(&self, of: u64) -> Vec<Event> {
        let mut events = Vec::new();
        loop {
            let event = self.next();
            let ends = matches!(&event,
                Event::Done { generation, .. } | Event::Failed { generation, .. } | Event::Cancelled { generation }
                if *generation == of);
            events.push(event);
            if ends {
                return events;
            }
        }
    }

    fn done(&mut self) -> (Report, bool) {
        let of = self.send();
        match self.until_end(of).pop() {
            Some(Event::Done { report, unchanged, .. }) => (*report, unchanged),
            other => panic!("{other:?}"),
        }
    }

    fn failed(&mut self) -> Failure {
        let of = self.send();
        match self.until_end(of).pop() {
            Some(Event::Failed { failure, .. }) => failure,
            other => panic!("{other:?}"),
        }
    }

    fn picture(&self) -> Vec<u8> {
        fs::read(self.path("out.ppm")).expect("a picture")
    }
}

/// `d`one, `r`eused or `s`kipped for each stage in order.
fn statuses(report: &Report) -> String {
    let names: Vec<Stage> = report.stages.iter().map(|stage| stage.name).collect();
    assert_eq!(names, Stage::ALL);
    let letter = |status| match status {
        Status::Done => 'd',
        Status::Reused => 'r',
        Status::Skipped => 's',
        Status::Running => '?',
    };
    report.stages.iter().map(|stage| letter(stage.status)).collect()
}

/// Whether the lights stage says anything of lights depends on the world; it is left out here.
#[track_caller]
fn assert_statuses(report: &Report, expected: &str) {
    let mut found = statuses(report);
    found.remove(Stage::Lights as usize);
    assert_eq!(found, expected, "parse meshes textures accel photons render write");
}

#[test]
fn each_edit_redoes_only_what_reads_it() {
    let mut bench = Bench::new(SCENE);
    assert_statuses(&bench.done().0, "ddddsdd");

    let (report, unchanged) = bench.done();
    assert_statuses(&report, "rrrrsrr");
    assert!(unchanged, "the same file again");

    bench.edit("[camera]", "# a comment\n[camera]");
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "drrrsrr");
    assert!(unchanged, "a comment");

    bench.edit("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]");
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "drrrsdd");
    assert!(!unchanged, "a material");

    bench.edit("position = [0, 1, 4]", "position = [0, 1, 5]");
    assert_statuses(&bench.done().0, "drrrsdd");

    bench.edit("exposure = 0.0", "exposure = 1.0");
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "drrrsrd");
    assert!(!unchanged, "the exposure");

    bench.edit("translate = [0, 0, 0]", "translate = [1, 0, 0]");
    let report = bench.done().0;
    assert_statuses(&report, "drrdsdd");
    assert!(report.stages[Stage::Accel as usize].why.contains("1 kept"), "the mesh's tree is kept");

    bench.write("skin.ppm", "P6\n1 1\n255\nxyz");
    let report = bench.done().0;
    assert_statuses(&report, "rrdrsdd");
    assert!(report.counters.texels_loaded > 0);

    bench.write("one.obj", &format!("{OBJ}f 1 3 2\n"));
    assert_statuses(&bench.done().0, "rdrdsdd");
}

#[test]
fn files_that_a_mesh_names_are_part_of_it() {
    let mut bench = Bench::new(SCENE);
    bench.write("one.mtl", "newmtl a\nKd 1 0 0\n");
    bench.write("one.obj", &format!("mtllib one.mtl\n{OBJ}"));
    bench.done();
    assert_statuses(&bench.done().0, "rrrrsrr");
    bench.write("one.mtl", "newmtl a\nKd 0 1 0\n");
    let report = bench.done().0;
    assert_eq!(report.stages[Stage::Meshes as usize].status, Status::Done);
}

#[test]
fn a_picture_that_was_deleted_is_written_again() {
    let mut bench = Bench::new(SCENE);
    bench.done();
    fs::remove_file(bench.path("out.ppm")).expect("removed");
    assert_statuses(&bench.done().0, "rrrrsrd");
    assert!(bench.path("out.ppm").exists());
}

#[test]
fn a_scene_without_files_says_why_stages_are_skipped() {
    let text = SCENE.replace("{ texture = \"skin\" }", "[1, 1, 1]");
    let text = text.replace("[textures.skin]\nfile = \"skin.ppm\"\n", "");
    let text = text.replace("[[mesh]]\nfile = \"one.obj\"\nmaterial = \"wall\"\ntranslate = [0, 0, 0]\n", "");
    let report = Bench::new(&text).done().0;
    assert_statuses(&report, "dssdsdd");
    let why = |stage: Stage| report.stages[stage as usize].why.clone();
    assert_eq!(why(Stage::Meshes), "the scene has no mesh");
    assert_eq!(why(Stage::Textures), "no visible material names a texture");
    assert_eq!(why(Stage::Photons), "the scene does not enable photons");
}

#[test]
fn all_assets_that_cannot_be_used_are_said_and_watched_and_mending_them_helps() {
    let mut bench = Bench::new(SCENE);
    bench.write("one.obj", "");
    bench.write("skin.ppm", "");
    let of = bench.send();
    let mut events = bench.until_end(of);
    let Some(Event::Failed { failure: Failure::Scene(errors), .. }) = events.pop() else {
        panic!("no failure")
    };
    for name in ["one.obj", "skin.ppm"] {
        let error = errors.iter().find(|error| error.message.contains(name)).expect("an error that names it");
        let place = error.place.as_ref().expect("a place in the scene");
        assert!(place.source[place.span.clone()].contains(name), "the place that names the file");
        assert_eq!(error.path, bench.path("scene.toml"));
    }
    let Some(Event::Files { files, .. }) = events.pop() else { panic!("no files") };
    for name in ["scene.toml", "one.obj", "skin.ppm"] {
        assert!(files.iter().any(|file| file.path == bench.path(name)), "{name}");
    }
    assert!(!bench.path("out.ppm").exists());
    bench.write("one.obj", OBJ);
    bench.write("skin.ppm", "P6\n1 1\n255\nabc");
    bench.done();
}

#[test]
fn a_broken_scene_keeps_its_assets_watched_and_loaded() {
    let mut bench = Bench::new(SCENE);
    bench.done();
    let before = bench.picture();
    bench.edit("width = 40", "width = = 40");
    let of = bench.send();
    let events = bench.until_end(of);
    assert!(matches!(events.last(), Some(Event::Failed { failure: Failure::Scene(_), .. })));
    let files = events.iter().rev().find_map(|event| match event {
        Event::Files { files, .. } => Some(files),
        _ => None,
    });
    assert!(files.expect("files").iter().any(|file| file.path == bench.path("one.obj")));
    assert_eq!(bench.picture(), before, "the picture stays");
    bench.edit("width = = 40", "width = 40");
    // A scene that was not understood is no value: it is parsed again, but nothing else is done.
    let (report, unchanged) = bench.done();
    assert_eq!(report.stages[Stage::Meshes as usize].status, Status::Reused);
    assert!(unchanged);
}

#[test]
fn a_missing_file_that_a_broken_scene_names_is_watched() {
    let mut bench = Bench::new(&SCENE.replace("one.obj", "later.obj"));
    let of = bench.send();
    let files: Vec<PathBuf> = bench
        .until_end(of)
        .into_iter()
        .filter_map(|event| match event {
            Event::Files { files, .. } => Some(files),
            _ => None,
        })
        .flatten()
        .map(|file| file.path)
        .collect();
    assert!(files.contains(&bench.path("later.obj")), "{files:?}");
}

#[test]
fn progress_never_falls_and_ends_at_one() {
    let mut bench = Bench::new(&SCENE.replace("samples = 4", "samples = 40"));
    let of = bench.send();
    let mut fractions = Vec::new();
    for event in bench.until_end(of) {
        if let Event::Progress { progress, .. } = event {
            fractions.push(progress.fraction);
            assert!(progress.total_samples == 40 && progress.samples <= 40);
        }
    }
    assert_eq!(fractions.first(), Some(&0.0));
    assert!(fractions.windows(2).all(|pair| pair[0] <= pair[1]), "{fractions:?}");
    assert_eq!(fractions.last(), Some(&1.0));
}

#[test]
fn threads_do_not_change_the_picture() {
    let picture = |threads| {
        let mut bench = Bench::new(&SCENE.replace("samples = 4", "samples = 7"));
        bench.overrides.threads = Some(threads);
        assert_eq!(bench.done().0.settings.threads, threads);
        bench.picture()
    };
    let one = picture(1);
    assert!(one == picture(2) && one == picture(7));
}

#[test]
fn more_samples_go_on_from_those_that_are_there_to_the_same_picture() {
    let mut bench = Bench::new(SCENE);
    let rays = |samples: u64| 40 * 30 * samples;
    bench.done();
    bench.overrides.samples = Some(9);
    let report = bench.done().0;
    assert_eq!(report.image.samples.min, 9);
    assert!(report.image.complete);
    let went_on = bench.picture();
    bench.force = true;
    let again = bench.done().0;
    assert_eq!(bench.picture(), went_on);
    assert_eq!(again.counters.camera_rays - report.counters.camera_rays, rays(4));
}

/// As the real one, and slowly: a tile takes until it is told to stop.
fn endless(
    _: &World,
    _: &RenderSettings,
    _: Rect,
    _: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    loop {
        token.check()?;
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn cancel_stops_a_render() {
    let mut bench = Bench::with(SCENE, endless);
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Cancel);
    assert!(matches!(bench.until_end(of).last(), Some(Event::Cancelled { .. })));
    assert!(!bench.path("out.ppm").exists());
}

#[test]
fn a_held_render_can_be_cancelled() {
    let mut bench = Bench::with(SCENE, endless);
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Pause(true));
    bench.worker.send(Command::Cancel);
    assert!(matches!(bench.until_end(of).last(), Some(Event::Cancelled { .. })));
}

#[test]
fn the_newest_request_wins_and_every_other_one_is_said_to_be_cancelled() {
    let mut bench = Bench::with(SCENE, endless);
    let ends: Vec<u64> = (0..4).map(|_| bench.send()).collect();
    bench.worker.send(Command::Cancel);
    let mut cancelled = Vec::new();
    while cancelled.len() < ends.len() {
        if let Event::Cancelled { generation } = bench.next() {
            cancelled.push(generation);
        }
    }
    cancelled.sort_unstable();
    assert_eq!(cancelled, ends);
}

#[test]
fn an_older_request_that_comes_late_is_dropped() {
    let mut bench = Bench::new(SCENE);
    bench.generation = 10;
    bench.done();
    bench.generation = 3;
    let of = bench.send();
    assert!(matches!(bench.until_end(of).last(), Some(Event::Cancelled { generation: 4 })));
}

static BREAKS: AtomicBool = AtomicBool::new(true);

fn breaks_once(
    world: &World,
    settings: &RenderSettings,
    tile: Rect,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    assert!(!BREAKS.swap(false, Ordering::SeqCst), "a tile broke");
    KERNEL(world, settings, tile, samples, token)
}

#[test]
fn the_worker_survives_a_panic() {
    let mut bench = Bench::with(SCENE, breaks_once);
    let Failure::Work(message) = bench.failed() else { panic!("a failure of the work") };
    assert!(message.contains("internal error"), "{message}");
    assert!(bench.done().0.image.complete);
}

#[test]
fn a_film_that_does_not_fit_is_an_error() {
    let mut bench =
        Bench::new(&SCENE.replace("width = 40", "width = 65536").replace("height = 30", "height = 65536"));
    // 2³² pixels need 100 GiB; a machine that has them is let off.
    bench.overrides.time_seconds = Some(0.01);
    bench.overrides.outputs = vec![bench.path("out.jpg")];
    if let Some(available) = available_memory_bytes()
        && available < 60 << 30
    {
        assert!(matches!(bench.failed(), Failure::Work(_)));
        bench.edit("65536", "16");
        bench.overrides = Overrides { outputs: vec![bench.path("out.ppm")], ..Default::default() };
        bench.done();
    }
}

fn available_memory_bytes() -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

#[test]
fn previews_fit_their_bounds_and_a_new_size_renders_nothing() {
    let mut bench = Bench::new(SCENE);
    bench.preview = Some(PreviewSize { width: 12, height: 12 });
    let generation = bench.send();
    assert!(bench.until_end(generation).iter().any(|event| matches!(event, Event::Preview { .. })));
    let latest = bench.worker.previews.lock().expect("not poisoned").clone().expect("a preview");
    assert_eq!((latest.generation, latest.picture.width, latest.picture.height), (generation, 12, 9));
    bench.preview = Some(PreviewSize { width: 20, height: 30 });
    assert_statuses(&bench.done().0, "rrrrsrr");
    let latest = bench.worker.previews.lock().expect("not poisoned").clone().expect("a preview");
    assert_eq!((latest.picture.width, latest.picture.height), (20, 15));
}

/// Slow enough that orders arrive during the render.
fn slow(
    world: &World,
    settings: &RenderSettings,
    tile: Rect,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    std::thread::sleep(Duration::from_millis(2));
    KERNEL(world, settings, tile, samples, token)
}

#[test]
fn write_during_a_render_writes_what_there_is() {
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 1000000"), slow);
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { progress, .. } if progress.samples > 0) {}
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::Written { .. }) {}
    assert!(!bench.picture().is_empty());
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
    // The film stays, and can be written again.
    fs::remove_file(bench.path("out.ppm")).expect("removed");
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::Written { .. }) {}
}

#[test]
fn write_without_a_picture_says_so() {
    let bench = Bench::new(SCENE);
    bench.worker.send(Command::Write);
    assert!(matches!(bench.next(), Event::WriteFailed { .. }));
}

#[test]
fn time_ends_a_render_and_the_counts_say_so() {
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 1000000"), slow);
    bench.overrides.time_seconds = Some(0.3);
    let begin = Instant::now();
    let (report, _) = bench.done();
    assert!(begin.elapsed() < Duration::from_secs(30));
    assert!(!report.image.complete);
    assert!(report.image.samples.max < 1_000_000 && report.image.samples.max > 0);
    assert!(bench.path("out.ppm").exists());
    let (again, unchanged) = bench.done();
    assert_eq!(again.stages[Stage::Render as usize].status, Status::Reused);
    assert!(unchanged);
}

#[test]
fn a_target_that_cannot_be_written_fails_before_the_render() {
    let mut bench = Bench::with(SCENE, endless);
    bench.overrides.outputs = vec![bench.path("nowhere/out.png")];
    assert!(matches!(bench.failed(), Failure::Work(message) if message.contains("nowhere")));
}

#[test]
fn a_crop_outside_the_picture_is_a_wrong_call() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.crop = Some(Rect { x: 39, y: 0, width: 2, height: 1 });
    assert!(matches!(bench.failed(), Failure::Scene(_)));
    bench.overrides.crop = Some(Rect { x: 38, y: 3, width: 2, height: 5 });
    let report = bench.done().0;
    assert_eq!(report.counters.camera_rays, 2 * 5 * 4);
    assert!(report.image.complete);
}
