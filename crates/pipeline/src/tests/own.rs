//! The scene's own image, while keys show something else.

use super::*;
use crate::protocol::OwnState;
use crate::scene::description::Shadows;
use crate::settings::{Checkpoints, Resume, View};

/// A front end whose keys show something else than the scene's own image.
struct Keys(Bench);

impl Keys {
    fn new() -> Self {
        let mut bench = Bench::new(SCENE);
        bench.writing = Writing::Try;
        Self(bench)
    }

    fn with(kernel: Kernel) -> Self {
        let mut bench = Bench::with(SCENE, kernel);
        bench.writing = Writing::Try;
        Self(bench)
    }

    /// Requests what keys show.
    fn show(&mut self, change: impl FnOnce(&mut Overrides)) -> u64 {
        let own = self.0.overrides.clone();
        change(&mut self.0.overrides);
        let shown = std::mem::replace(&mut self.0.overrides, own);
        self.0.generation += 1;
        self.0.worker.send(Command::Render(Box::new(Request {
            generation: self.0.generation,
            scene: self.0.path(self.0.scene),
            own: Some(Box::new(self.0.overrides.clone())),
            overrides: shown,
            preview: None,
            write: Writing::No,
            force: false,
            first: None,
        })));
        self.0.generation
    }

    /// All events of a request that keys show something else in.
    fn shown(&mut self, change: impl FnOnce(&mut Overrides)) -> Vec<Event> {
        let of = self.show(change);
        self.0.until_end(of)
    }
}

fn no_shadows(overrides: &mut Overrides) {
    overrides.shadows = Some(Shadows::Off);
}

fn states(events: &[Event]) -> Vec<OwnState> {
    let state = |event: &Event| match event {
        Event::OwnImage { state, .. } => Some(*state),
        _ => None,
    };
    events.iter().filter_map(state).collect()
}

#[test]
fn keys_leave_the_image_and_its_report_alone() {
    let mut keys = Keys::new();
    keys.0.overrides.report = Some(keys.0.path("r.json"));
    keys.0.done();
    let files = |keys: &Keys| (keys.0.picture(), fs::read(keys.0.path("r.json")).expect("a report"));
    let before = files(&keys);
    let changes: [fn(&mut Overrides); 5] = [
        no_shadows,
        |overrides| overrides.exposure = Some(1.0),
        |overrides| overrides.dof = Some(false),
        |overrides| overrides.view = Some(View::Normal),
        |overrides| overrides.view = Some(View::Samples),
    ];
    for change in changes {
        let events = keys.shown(change);
        assert_eq!(states(&events), [OwnState::Written; 2], "{events:?}");
        assert!(!events.iter().any(|event| matches!(event, Event::Written { .. })));
        assert!(files(&keys) == before);
    }
    // Nothing has to be rendered or written again.
    assert_statuses(&keys.0.done().0, "rrrrrsrr");
}

#[test]
fn a_key_writes_what_is_shown_and_the_own_image_comes_back() {
    let mut keys = Keys::new();
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
    assert_eq!(states(&events).last(), Some(&OwnState::Begun { is_rendering: false }));
    assert!(keys.0.picture() != own, "without shadows");
    let text = fs::read_to_string(&report).expect("a report");
    assert!(text.contains("\"shadows\": \"off\"") && text.contains("out.ppm"), "{text}");
    let (_, events) = (keys.0.send(), keys.0.until_end(keys.0.generation));
    assert!(events.iter().any(|event| matches!(event, Event::Written { is_own: true, .. })));
    assert!(keys.0.picture() == own);
    assert!(fs::read_to_string(&report).expect("a report").contains("\"shadows\": \"soft\""));
}

#[test]
fn a_save_while_keys_show_something_else_leaves_the_old_image() {
    let mut keys = Keys::new();
    keys.0.done();
    let old = keys.0.picture();
    keys.0.edit("intensity = [10, 10, 10]", "intensity = [5, 5, 5]");
    assert_eq!(states(&keys.shown(no_shadows)), [OwnState::NotBegun; 2]);
    assert!(keys.0.picture() == old);
    // A comment changes nothing.
    keys.0.edit("intensity = [5, 5, 5]", "intensity = [10, 10, 10] # as before");
    assert_eq!(states(&keys.shown(no_shadows)), [OwnState::Written; 2]);
    // Saved as it is shown: this is the own image.
    keys.0.edit("samples = 4", "samples = 4\nshadows = \"off\"");
    let events = keys.shown(no_shadows);
    assert_eq!(states(&events).last(), Some(&OwnState::Written));
    assert!(keys.0.picture() != old);
}

#[test]
fn a_broken_scene_does_not_let_keys_write() {
    let mut keys = Keys::new();
    keys.0.done();
    let own = keys.0.picture();
    keys.shown(no_shadows);
    keys.0.edit("[camera]", "[camera");
    keys.shown(no_shadows);
    while !matches!(keys.0.next(), Event::LastGoodEnded { .. }) {}
    assert!(keys.0.picture() == own);
}

/// Renders pixels one after another, so slowly that a request can be sent meanwhile.
fn slow(
    photons: Option<&crate::integrators::PhotonMaps>,
    world: &crate::world::World,
    settings: &crate::integrators::RenderSettings,
    pixels: crate::film::Pixels,
    samples: std::ops::Range<u32>,
    token: &crate::control::CancelToken,
) -> Result<(crate::film::TileSamples, crate::integrators::RayCounters), crate::control::Cancelled> {
    if samples.start > 1 && settings.render.shadows == Shadows::Soft {
        std::thread::sleep(Duration::from_millis(20));
    }
    KERNEL(photons, world, settings, pixels, samples, token)
}

/// Requests the own image and waits until every pixel has a sample.
fn begin(keys: &mut Keys) -> u64 {
    keys.0.overrides.samples = Some(64);
    let of = keys.0.send();
    loop {
        match keys.0.next() {
            Event::Progress { progress, .. } if progress.samples >= 2 => return of,
            Event::Done { .. } => panic!("it ended too early"),
            _ => {}
        }
    }
}

#[test]
fn the_own_render_goes_on_where_keys_interrupted_it() {
    let whole = {
        let mut keys = Keys::new();
        keys.0.overrides.samples = Some(64);
        keys.0.done();
        keys.0.picture()
    };
    let mut keys = Keys::with(slow);
    begin(&mut keys);
    let events = keys.shown(no_shadows);
    assert_eq!(states(&events), [OwnState::Begun { is_rendering: false }; 2]);
    assert!(!keys.0.path("out.ppm").exists());
    let (report, _) = keys.0.done();
    assert!(report.stages[Stage::Render as usize].why.starts_with("went on after"), "{report:?}");
    assert!(keys.0.picture() == whole);
}

#[test]
fn another_exposure_of_the_own_film_does_not_keep_it_from_its_file() {
    let mut keys = Keys::with(slow);
    begin(&mut keys);
    let events = keys.shown(|overrides| overrides.exposure = Some(2.0));
    assert_eq!(states(&events), [OwnState::Begun { is_rendering: true }, OwnState::Written]);
    let picture = keys.0.picture();
    let (report, _) = keys.0.done();
    assert_statuses(&report, "rrrrrsrr");
    assert!(keys.0.picture() == picture, "it had the scene's own exposure");
}

#[test]
fn the_checkpoint_of_the_own_render_is_kept_when_keys_show_something_else_at_the_end() {
    let checkpoints = Checkpoints { seconds: 60.0, resume: Resume::IfSame, are_kept: false };
    for (end, is_kept) in [(Command::Suspend, true), (Command::Quit, false)] {
        let mut keys = Keys::with(slow);
        keys.0.overrides.checkpoints = checkpoints;
        begin(&mut keys);
        keys.shown(no_shadows);
        let path = keys.0.path("out.ppm.checkpoint");
        keys.0.worker.send(end);
        assert!(keys.0.worker.end_within(Duration::from_secs(60)));
        assert_eq!(path.exists(), is_kept, "a render of less than a minute is kept after a signal only");
        if is_kept {
            keys.0.worker = crate::worker::start_with(Means::default()).expect("a thread");
            let (report, _) = keys.0.done();
            assert!(report.stages[Stage::Render as usize].why.starts_with("went on after"), "{report:?}");
            assert!(!path.exists(), "its image is written");
        }
    }
    // After a save, the render of before is of no use.
    let mut keys = Keys::with(slow);
    keys.0.overrides.checkpoints = checkpoints;
    begin(&mut keys);
    keys.0.edit("intensity = [10, 10, 10]", "intensity = [5, 5, 5]");
    keys.shown(no_shadows);
    keys.0.worker.send(Command::Suspend);
    assert!(keys.0.worker.end_within(Duration::from_secs(60)));
    assert!(!keys.0.path("out.ppm.checkpoint").exists());
}

#[test]
fn an_unfinished_image_leaves_no_older_report() {
    let mut keys = Keys::with(slow);
    let report = keys.0.path("r.json");
    keys.0.overrides.report = Some(report.clone());
    keys.0.done();
    assert!(report.exists());
    keys.0.edit("samples = 4", "samples = 200");
    let narrow = |overrides: &mut Overrides| overrides.camera.fov = Some(30.0);
    let begins = |of: u64, keys: &Keys| {
        let is_begun = |event: &Event| matches!(event, Event::Progress { generation, progress } if *generation == of && progress.samples >= 2);
        while !is_begun(&keys.0.next()) {}
    };
    let of = keys.show(narrow);
    begins(of, &keys);
    keys.0.worker.send(Command::Write);
    while !matches!(keys.0.next(), Event::Written { is_own: false, .. }) {}
    // The next request begins after the file and its report.
    let events = keys.shown(no_shadows);
    assert!(!report.exists(), "{events:?}");
    // A file that is no report of glimt stays.
    fs::write(&report, "{}").expect("written");
    let of = keys.show(narrow);
    begins(of, &keys);
    keys.0.worker.send(Command::Write);
    keys.shown(no_shadows);
    assert_eq!(fs::read_to_string(&report).expect("kept"), "{}");
}

#[test]
fn the_last_good_image_leaves_no_older_report() {
    let mut bench = Bench::with(SCENE, slow);
    bench.writing = Writing::Try;
    let report = bench.path("r.json");
    bench.overrides.report = Some(report.clone());
    bench.done();
    let earlier = bench.picture();
    bench.edit("samples = 4", "samples = 8");
    bench.edit("intensity = [10, 10, 10]", "intensity = [5, 5, 5]");
    let of = bench.send();
    // Its files are read; then the scene breaks.
    while !matches!(bench.next(), Event::Progress { generation, .. } if generation == of) {}
    bench.edit("[camera]", "[camera");
    bench.send();
    while !matches!(bench.next(), Event::LastGoodEnded { .. }) {}
    assert!(bench.picture() != earlier && !report.exists());
}

/// Bytes that a render of the scene needs with these overrides.
fn needed(keys: &Keys, overrides: &Overrides) -> u64 {
    crate::check::memory_needed(&keys.0.path("scene.toml"), overrides).expect("a scene")
}

#[test]
fn memory_counts_the_unfinished_own_film() {
    let film = 40 * 30 * 40;
    for (more, fits) in [(film / 2, false), (2 * film, true)] {
        let mut keys = Keys::with(slow);
        keys.0.overrides.samples = Some(64);
        keys.0.overrides.memory = Some(needed(&keys, &keys.0.overrides) + more);
        begin(&mut keys);
        // The same film in another way takes no more memory.
        let stops = |keys: &mut Keys, change: fn(&mut Overrides)| {
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
        // Back at the scene's own settings, its render continues.
        let (report, _) = keys.0.done();
        assert!(report.stages[Stage::Render as usize].why.starts_with("went on after"), "{report:?}");
    }
}

#[test]
fn a_written_own_film_makes_room() {
    let film = 40 * 30 * 40;
    for (more, stays) in [(film / 2, false), (2 * film, true)] {
        let mut keys = Keys::new();
        keys.0.overrides.memory = Some(needed(&keys, &keys.0.overrides) + more);
        keys.0.done();
        let own = keys.0.picture();
        assert_eq!(states(&keys.shown(no_shadows)), [OwnState::Written; 2]);
        assert!(keys.0.picture() == own);
        let (report, _) = keys.0.done();
        assert_statuses(&report, if stays { "rrrrrsrr" } else { "rrrrrsdr" });
        assert!(keys.0.picture() == own);
    }
}
