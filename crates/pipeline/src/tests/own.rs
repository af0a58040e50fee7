//! Tests for the scene's own image while the user views another one.

use super::*;
use crate::protocol::SavedSceneRenderStatus;
use crate::scene::description::ShadowMode;
use crate::settings::{CheckpointSettings, ResumeMode, ViewMode};

/// A front end whose user views an image other than the scene's own.
struct ToggledBench(Bench);

impl ToggledBench {
    fn new() -> Self {
        let mut bench = Bench::new(SCENE);
        bench.writing = WriteRequirement::Try;
        Self(bench)
    }

    fn with(kernel: TileKernel) -> Self {
        let mut bench = Bench::with(SCENE, kernel);
        bench.writing = WriteRequirement::Try;
        Self(bench)
    }

    /// Requests an image with settings changed by the user.
    fn show(&mut self, change: impl FnOnce(&mut Overrides)) -> u64 {
        let own = self.0.overrides.clone();
        change(&mut self.0.overrides);
        let shown = std::mem::replace(&mut self.0.overrides, own);
        self.0.generation += 1;
        let request = Request::new(self.0.generation, self.0.path(self.0.scene), shown);
        let (own, saves) = (Some(Box::new(self.0.overrides.clone())), self.0.saves.get());
        self.0.worker.send(Command::Render(Box::new(Request { own, saves, ..request })));
        self.0.generation
    }

    /// Like [`Self::show`], but waits for the end and returns all events.
    fn shown(&mut self, change: impl FnOnce(&mut Overrides)) -> Vec<Event> {
        let of = self.show(change);
        self.0.until_end(of)
    }
}

fn no_shadows(overrides: &mut Overrides) {
    overrides.shadows = Some(ShadowMode::Off);
}

/// Asserts that a render continued from existing samples.
#[track_caller]
fn assert_resumed(report: &Report) {
    let why = &report.stages[Stage::Render as usize].why;
    assert!(why.starts_with(reasons::RESUMED), "{report:?}");
}

fn states(events: &[Event]) -> Vec<SavedSceneRenderStatus> {
    let state = |event: &Event| match event {
        Event::OwnImage { state, .. } => Some(*state),
        _ => None,
    };
    events.iter().filter_map(state).collect()
}

#[test]
fn viewing_does_not_change_output_files() {
    let mut keys = ToggledBench::new();
    keys.0.overrides.report = Some(keys.0.path("r.json"));
    keys.0.done();
    let files = |keys: &ToggledBench| (keys.0.picture(), fs::read(keys.0.path("r.json")).expect("a report"));
    let before = files(&keys);
    let changes: [fn(&mut Overrides); 5] = [
        no_shadows,
        |overrides| overrides.exposure = Some(1.0),
        |overrides| overrides.dof = Some(false),
        |overrides| overrides.view = Some(ViewMode::Normal),
        |overrides| overrides.view = Some(ViewMode::Samples),
    ];
    for change in changes {
        let events = keys.shown(change);
        assert_eq!(states(&events), [SavedSceneRenderStatus::Written; 2], "{events:?}");
        assert!(!events.iter().any(|event| matches!(event, Event::Written { .. })));
        assert!(files(&keys) == before);
    }
    // Nothing needs to be rendered or written again.
    assert_statuses(&keys.0.done().0, "rrrrrsrr");
}

#[test]
fn write_command_saves_the_shown_image() {
    let mut keys = ToggledBench::new();
    let report = keys.0.path("r.json");
    keys.0.overrides.report = Some(report.clone());
    keys.0.done();
    let own = keys.0.picture();
    keys.shown(no_shadows);
    keys.0.worker.send(Command::Write);
    let of = keys.show(no_shadows);
    let events = keys.0.until_end(of);
    let by_hand = |event: &Event| matches!(event, Event::Written { is_own: false, .. });
    assert!(events.iter().any(by_hand), "{events:?}");
    assert_eq!(states(&events).last(), Some(&SavedSceneRenderStatus::Begun { is_rendering: false }));
    assert!(keys.0.picture() != own, "without shadows");
    let shadows = || {
        let report = fs::read_to_string(&report).expect("a report");
        let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
        (report["settings"]["shadows"].clone(), report["image"]["path"].is_string())
    };
    assert_eq!(shadows(), ("off".into(), true));
    // Returning to the scene's settings only changes the preview.
    let written = keys.0.picture();
    assert_statuses(&keys.0.done().0, "rrrrrsrs");
    assert!(keys.0.picture() == written);
    assert_eq!(shadows(), ("off".into(), true));
    let events = write_now(&mut keys);
    assert!(events.iter().any(|event| matches!(event, Event::Written { is_own: true, .. })));
    assert!(keys.0.picture() == own);
    // The next request starts after the report has been written.
    assert_statuses(&keys.0.done().0, "rrrrrsrr");
    assert_eq!(shadows(), ("soft".into(), true));
}

/// Sends a write command for the finished image. Returns its events.
fn write_now(keys: &mut ToggledBench) -> Vec<Event> {
    keys.0.worker.send(Command::Write);
    let mut events = vec![keys.0.next()];
    while !matches!(events.last(), Some(Event::WriteDone { .. } | Event::WriteFailed { .. })) {
        events.push(keys.0.next());
    }
    events
}

/// Starts rendering the scene's own image, then writes it with another exposure. Returns the request and the
/// written image.
fn write_brighter(keys: &mut ToggledBench) -> (u64, Vec<u8>) {
    begin(keys);
    let of = keys.show(|overrides| overrides.exposure = Some(2.0));
    keys.0.worker.send(Command::Write);
    while !matches!(keys.0.next(), Event::WriteDone { .. }) {}
    (of, keys.0.picture())
}

#[test]
fn own_render_keeps_an_image_written_on_request() {
    let changes: [fn(&mut Overrides); 4] = [
        |overrides| overrides.exposure = Some(2.0),
        |overrides| overrides.view = Some(ViewMode::Samples),
        |overrides| overrides.view = Some(ViewMode::Normal),
        no_shadows,
    ];
    for change in changes {
        let mut keys = ToggledBench::with(render_slowly);
        begin(&mut keys);
        let of = keys.show(change);
        keys.0.worker.send(Command::Write);
        while !matches!(keys.0.next(), Event::WriteDone { .. }) {}
        let written = keys.0.picture();
        let events = keys.0.until_end(of);
        assert!(!events.iter().any(|event| matches!(event, Event::Written { .. })), "{events:?}");
        assert!(matches!(states(&events).last(), Some(SavedSceneRenderStatus::Begun { .. })), "{events:?}");
        let (report, _) = keys.0.done();
        assert_eq!(report.image.path, None);
        assert_eq!(report.stages[Stage::Write as usize].why, reasons::OTHER_IMAGE_WRITTEN);
        assert!(keys.0.picture() == written);
        assert!(
            write_now(&mut keys).iter().any(|event| matches!(event, Event::Written { is_own: true, .. }))
        );
        assert!(keys.0.picture() != written);
        assert_statuses(&keys.0.done().0, "rrrrrsrr");
    }
}

#[test]
fn save_replaces_an_image_written_on_request() {
    let mut keys = ToggledBench::with(render_slowly);
    let (of, written) = write_brighter(&mut keys);
    keys.0.until_end(of);
    // A scene that cannot be read does not count as a new version.
    keys.0.edit("[camera]", "[camera");
    keys.0.send();
    while !matches!(keys.0.next(), Event::LastGoodEnded { .. }) {}
    assert!(keys.0.picture() == written);
    // The scene's own image shares its film with the preview.
    keys.0.edit("[camera", "[camera] # saved");
    let events = keys.shown(|overrides| overrides.exposure = Some(2.0));
    assert_eq!(states(&events).last(), Some(&SavedSceneRenderStatus::Written));
    let own = keys.0.picture();
    assert!(own != written);
    // Without a shared film, the saved scene's image is written once the user returns to the scene's
    // settings.
    keys.shown(no_shadows);
    write_now(&mut keys);
    assert!(keys.0.picture() != own);
    keys.0.edit("# saved", "# saved again");
    keys.shown(no_shadows);
    assert!(keys.0.picture() != own);
    keys.0.done();
    assert!(keys.0.picture() == own);
}

#[test]
fn requested_image_is_not_kept_once_removed() {
    let mut keys = ToggledBench::with(render_slowly);
    let (of, written) = write_brighter(&mut keys);
    fs::rename(keys.0.path("out.ppm"), keys.0.path("bright.ppm")).expect("moved");
    let events = keys.0.until_end(of);
    assert_eq!(states(&events).last(), Some(&SavedSceneRenderStatus::Written));
    assert!(keys.0.picture() != written);
}

#[test]
fn failed_write_keeps_the_earlier_image() {
    let mut keys = ToggledBench::with(render_slowly);
    let image = keys.0.path("images/out.ppm");
    fs::create_dir(keys.0.path("images")).expect("a folder");
    keys.0.overrides.outputs = vec![image.clone()];
    begin(&mut keys);
    let of = keys.show(no_shadows);
    keys.0.worker.send(Command::Write);
    keys.0.until_end(of);
    let written = fs::read(&image).expect("an image");
    fs::rename(keys.0.path("images"), keys.0.path("away")).expect("moved");
    assert!(write_now(&mut keys).iter().any(|event| matches!(event, Event::WriteFailed { .. })));
    fs::rename(keys.0.path("away"), keys.0.path("images")).expect("moved back");
    keys.0.done();
    assert!(fs::read(&image).expect("an image") == written);
}

#[test]
fn checkpoint_remains_until_own_image_is_written() {
    let mut keys = ToggledBench::with(render_slowly);
    keys.0.overrides.checkpoints =
        CheckpointSettings { seconds: 0.01, resume: ResumeMode::IfSame, are_kept: false };
    let (of, _) = write_brighter(&mut keys);
    keys.0.until_end(of);
    let path = keys.0.path("out.ppm.checkpoint");
    assert!(path.exists());
    keys.0.done();
    assert!(path.exists());
    write_now(&mut keys);
    // The next request starts after the write command has been handled.
    keys.0.done();
    assert!(!path.exists());
}

#[test]
fn edit_during_another_view_keeps_old_image() {
    let mut keys = ToggledBench::new();
    keys.0.done();
    let old = keys.0.picture();
    keys.0.edit("intensity = [10, 10, 10]", "intensity = [5, 5, 5]");
    assert_eq!(states(&keys.shown(no_shadows)), [SavedSceneRenderStatus::NotBegun; 2]);
    assert!(keys.0.picture() == old);
    // After the edit is reverted and a comment added, the image is up to date again.
    keys.0.edit("intensity = [5, 5, 5]", "intensity = [10, 10, 10] # as before");
    assert_eq!(states(&keys.shown(no_shadows)), [SavedSceneRenderStatus::Written; 2]);
    // Saving the shown settings in the scene makes this the scene's own image.
    keys.0.edit("samples = 4", "samples = 4\nshadows = \"off\"");
    let events = keys.shown(no_shadows);
    assert_eq!(states(&events).last(), Some(&SavedSceneRenderStatus::Written));
    assert!(keys.0.picture() != old);
}

#[test]
fn other_view_is_not_written_if_scene_is_broken() {
    let mut keys = ToggledBench::new();
    keys.0.done();
    let own = keys.0.picture();
    keys.shown(no_shadows);
    keys.0.edit("[camera]", "[camera");
    keys.shown(no_shadows);
    while !matches!(keys.0.next(), Event::LastGoodEnded { .. }) {}
    assert!(keys.0.picture() == own);
}

/// Renders later samples so slowly that another request can be sent in the meantime.
fn render_slowly(
    photons: Option<&crate::integrators::PhotonPassesBySample>,
    world: &crate::world::World,
    settings: &crate::integrators::RenderSettings,
    pixels: crate::film::SelectedPixels,
    samples: std::ops::Range<u32>,
    token: &crate::control::CancelToken,
) -> Result<(crate::film::TileSamples, crate::integrators::RayCounters), crate::control::Canceled> {
    if samples.start > 1 && settings.render.shadows == ShadowMode::Soft {
        std::thread::sleep(Duration::from_millis(20));
    }
    KERNEL(photons, world, settings, pixels, samples, token)
}

/// Requests the scene's own image and waits until every pixel has two samples.
fn begin(keys: &mut ToggledBench) -> u64 {
    keys.0.overrides.samples = Some(64);
    let of = keys.0.send();
    loop {
        match keys.0.next() {
            Event::Progress { progress, .. } if progress.samples >= 2 => return of,
            Event::Done { .. } => panic!("the render should not end before two samples per pixel"),
            _ => {}
        }
    }
}

#[test]
fn interrupted_own_render_resumes() {
    let whole = {
        let mut keys = ToggledBench::new();
        keys.0.overrides.samples = Some(64);
        keys.0.done();
        keys.0.picture()
    };
    let mut keys = ToggledBench::with(render_slowly);
    begin(&mut keys);
    let events = keys.shown(no_shadows);
    assert_eq!(states(&events), [SavedSceneRenderStatus::Begun { is_rendering: false }; 2]);
    assert!(!keys.0.path("out.ppm").exists());
    let (report, _) = keys.0.done();
    assert_resumed(&report);
    assert!(keys.0.picture() == whole);
}

#[test]
fn own_image_is_written_despite_exposure_change() {
    let mut keys = ToggledBench::with(render_slowly);
    begin(&mut keys);
    let events = keys.shown(|overrides| overrides.exposure = Some(2.0));
    assert_eq!(
        states(&events),
        [SavedSceneRenderStatus::Begun { is_rendering: true }, SavedSceneRenderStatus::Written]
    );
    let picture = keys.0.picture();
    let (report, _) = keys.0.done();
    assert_statuses(&report, "rrrrrsrr");
    assert!(keys.0.picture() == picture, "the image should be written with the scene's exposure");
}

#[test]
fn own_checkpoint_is_saved_during_another_view() {
    let checkpoints = CheckpointSettings { seconds: 60.0, resume: ResumeMode::IfSame, are_kept: false };
    for (end, is_kept) in [(Command::Suspend, true), (Command::Quit, false)] {
        let mut keys = ToggledBench::with(render_slowly);
        keys.0.overrides.checkpoints = checkpoints;
        begin(&mut keys);
        keys.shown(no_shadows);
        let path = keys.0.path("out.ppm.checkpoint");
        keys.0.worker.send(end);
        assert!(keys.0.worker.stop_within(Duration::from_secs(60)));
        assert_eq!(path.exists(), is_kept, "a short render should be saved only after a signal");
        if is_kept {
            (keys.0.worker, keys.0.events) = start_worker(SessionConfig::default(), &keys.0.contents);
            let (report, _) = keys.0.done();
            assert_resumed(&report);
            assert!(!path.exists(), "the checkpoint should be removed once the image is written");
        }
    }
    // An edit makes the earlier render useless.
    let mut keys = ToggledBench::with(render_slowly);
    keys.0.overrides.checkpoints = checkpoints;
    begin(&mut keys);
    keys.0.edit("intensity = [10, 10, 10]", "intensity = [5, 5, 5]");
    keys.shown(no_shadows);
    keys.0.worker.send(Command::Suspend);
    assert!(keys.0.worker.stop_within(Duration::from_secs(60)));
    assert!(!keys.0.path("out.ppm.checkpoint").exists());
}

#[test]
fn unfinished_image_removes_outdated_report() {
    let mut keys = ToggledBench::with(render_slowly);
    let report = keys.0.path("r.json");
    keys.0.overrides.report = Some(report.clone());
    keys.0.done();
    assert!(report.exists());
    keys.0.edit("samples = 4", "samples = 200");
    let narrow = |overrides: &mut Overrides| overrides.camera.fov = Some(30.0);
    let begins = |of: u64, keys: &ToggledBench| {
        let is_begun = |event: &Event| matches!(event, Event::Progress { generation, progress } if *generation == of && progress.samples >= 2);
        while !is_begun(&keys.0.next()) {}
    };
    let of = keys.show(narrow);
    begins(of, &keys);
    keys.0.worker.send(Command::Write);
    while !matches!(keys.0.next(), Event::Written { is_own: false, .. }) {}
    // The next request starts after the image and its report have been handled.
    let events = keys.shown(no_shadows);
    assert!(!report.exists(), "{events:?}");
    // A file that is not a report must be kept.
    fs::write(&report, "{}").expect("written");
    let of = keys.show(narrow);
    begins(of, &keys);
    keys.0.worker.send(Command::Write);
    keys.shown(no_shadows);
    assert_eq!(fs::read_to_string(&report).expect("kept"), "{}");
}

#[test]
fn last_valid_image_removes_outdated_report() {
    let mut bench = Bench::with(SCENE, render_slowly);
    bench.writing = WriteRequirement::Try;
    let report = bench.path("r.json");
    bench.overrides.report = Some(report.clone());
    bench.done();
    let earlier = bench.picture();
    bench.edit("samples = 4", "samples = 8");
    bench.edit("intensity = [10, 10, 10]", "intensity = [5, 5, 5]");
    let of = bench.send();
    // Break the scene once its files have been read.
    while !matches!(bench.next(), Event::Progress { generation, .. } if generation == of) {}
    bench.edit("[camera]", "[camera");
    bench.send();
    while !matches!(bench.next(), Event::LastGoodEnded { .. }) {}
    assert!(bench.picture() != earlier && !report.exists());
}

/// Returns the memory, in bytes, needed to render the scene with these overrides.
fn estimate_memory(keys: &ToggledBench, overrides: &Overrides) -> u64 {
    crate::check::estimate_memory(&keys.0.path("scene.toml"), overrides).expect("a scene")
}

#[test]
fn memory_check_includes_unfinished_own_film() {
    let film = 40 * 30 * 40;
    for (more, fits) in [(film / 2, false), (2 * film, true)] {
        let mut keys = ToggledBench::with(render_slowly);
        keys.0.overrides.samples = Some(64);
        keys.0.overrides.memory = Some(estimate_memory(&keys, &keys.0.overrides) + more);
        begin(&mut keys);
        // Another view of the same film needs no additional memory.
        let stops = |keys: &mut ToggledBench, change: fn(&mut Overrides)| {
            let of = keys.show(change);
            let begins =
                |event: &Event| matches!(event, Event::Progress { generation, .. } if *generation == of);
            loop {
                match keys.0.next() {
                    Event::Failed { generation, failure } if generation == of => return Some(failure),
                    event if begins(&event) => return None,
                    _ => {}
                }
            }
        };
        assert!(stops(&mut keys, |overrides| overrides.exposure = Some(1.0)).is_none());
        let failure = stops(&mut keys, no_shadows);
        assert_eq!(matches!(failure, Some(Failure::Work(_))), !fits, "{failure:?}");
        // The scene's own image continues to render when the user returns to the scene's settings.
        let (report, _) = keys.0.done();
        assert_resumed(&report);
    }
}

#[test]
fn own_film_may_be_dropped_once_written() {
    let film = 40 * 30 * 40;
    for (more, stays) in [(film / 2, false), (2 * film, true)] {
        let mut keys = ToggledBench::new();
        keys.0.overrides.memory = Some(estimate_memory(&keys, &keys.0.overrides) + more);
        keys.0.done();
        let own = keys.0.picture();
        assert_eq!(states(&keys.shown(no_shadows)), [SavedSceneRenderStatus::Written; 2]);
        assert!(keys.0.picture() == own);
        let (report, _) = keys.0.done();
        assert_statuses(&report, if stays { "rrrrrsrr" } else { "rrrrrsdr" });
        assert!(keys.0.picture() == own);
    }
}
