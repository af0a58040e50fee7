//! Cancelling, holding, writing, failing.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use super::*;
use crate::control::{CancelToken, Cancelled};
use crate::engine::Means;
use crate::film::{Pixels, Rect, TileSamples};
use crate::integrators::{PhotonMaps, RayCounters, RenderSettings};
use crate::protocol::LastGoodEnd;
use crate::scene::description::{Integrator, Shadows};
use crate::settings::View;
use crate::world::World;

/// A kernel as the real one, but slow: a tile takes until its token is cancelled.
fn endless(
    _: Option<&PhotonMaps>,
    _: &World,
    _: &RenderSettings,
    _: Pixels,
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
    photons: Option<&PhotonMaps>,
    world: &World,
    settings: &RenderSettings,
    pixels: Pixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    assert!(!BREAKS.swap(false, Ordering::SeqCst), "a tile broke");
    KERNEL(photons, world, settings, pixels, samples, token)
}

#[test]
fn the_worker_survives_a_panic() {
    let mut bench = Bench::with(SCENE, breaks_once);
    let Failure::Work(message) = bench.failed() else { panic!("a failure of the work") };
    assert!(message.contains("internal error"), "{message}");
    assert!(bench.done().0.image.complete);
}

static TILES: AtomicUsize = AtomicUsize::new(0);

fn breaks_first(
    photons: Option<&PhotonMaps>,
    world: &World,
    settings: &RenderSettings,
    pixels: Pixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    assert!(TILES.fetch_add(1, Ordering::SeqCst) != 0, "the first tile broke");
    slow(photons, world, settings, pixels, samples, token)
}

#[test]
fn a_panic_is_heard_before_the_pass_is_over() {
    let scene = SCENE.replace("width = 40", "width = 1280").replace("height = 30", "height = 1280");
    let mut bench = Bench::with(&scene, breaks_first);
    assert!(matches!(bench.failed(), Failure::Work(_)));
    let tiles = TILES.load(Ordering::SeqCst);
    assert!(tiles < 40 * 40 / 4, "{tiles} tiles were rendered for nothing");
}

#[test]
fn a_film_that_does_not_fit_is_an_error() {
    let means = Means { most_film_bytes: 100_000, ..Means::default() };
    let mut bench = Bench::with_means(&SCENE.replace("width = 40", "width = 400"), means);
    assert!(matches!(bench.failed(), Failure::Work(message) if message.contains("400×30")));
    assert!(!bench.path("out.ppm").exists());
    bench.edit("400", "40");
    bench.done();
}

/// Slow enough that orders arrive during the render.
pub(super) fn slow(
    photons: Option<&PhotonMaps>,
    world: &World,
    settings: &RenderSettings,
    pixels: Pixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    std::thread::sleep(Duration::from_millis(2));
    KERNEL(photons, world, settings, pixels, samples, token)
}

/// End of the render that goes on while the scene of this request is broken.
fn last_good_end(bench: &Bench, of: u64) -> LastGoodEnd {
    loop {
        match bench.next() {
            Event::LastGoodEnded { generation, end } if generation == of => return end,
            Event::Preview { .. } | Event::Progress { .. } | Event::WriteDone { .. } => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn without_a_good_scene_nothing_goes_on() {
    let mut bench = Bench::new(&SCENE.replace("width = 40", "width = = 40"));
    bench.writing = Writing::Try;
    assert!(matches!(bench.failed(), Failure::Scene(_)));
    assert_eq!(last_good_end(&bench, 1), LastGoodEnd::Stopped);
}

#[test]
fn a_file_that_breaks_during_a_render_does_not_stop_it_and_costs_nothing_that_is_kept() {
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 10000"), slow);
    (bench.writing, bench.preview) =
        (Writing::Try, Some(PreviewSize { width: 12, height: 12, around: None }));
    let first = bench.send();
    while !matches!(bench.next(), Event::Progress { progress, .. } if progress.samples > 0) {}
    bench.edit("width = 40", "width = = 40");
    let broken = bench.send();
    assert!(matches!(bench.until_end(first).last(), Some(Event::Cancelled { .. })));
    assert!(matches!(bench.until_end(broken).last(), Some(Event::Failed { failure: Failure::Scene(_), .. })));
    // It goes on to its end under the newest number and is written.
    let mut is_seen = false;
    loop {
        match bench.next() {
            Event::Written { generation, .. } => {
                assert_eq!(generation, broken);
                break;
            }
            Event::Preview { generation } => is_seen |= generation == broken,
            Event::Progress { .. } => {}
            other => panic!("{other:?}"),
        }
    }
    assert!(is_seen && samples_on_disk(&bench).starts_with("10000"), "{}", samples_on_disk(&bench));
    let finished = |unchanged| LastGoodEnd::Finished { unchanged };
    assert_eq!(last_good_end(&bench, broken), finished(false));
    // Another mistake finds it as it is.
    bench.edit("width = = 40", "width = = = 40");
    assert!(matches!(bench.failed(), Failure::Scene(_)));
    assert_eq!(last_good_end(&bench, bench.generation), finished(true));
    bench.edit("width = = = 40", "width = = 40");
    bench.edit("width = = 40", "width = 40");
    let report = bench.done().0;
    assert_statuses(&report, "rrrrrsrr");
}

/// The picture of this scene that these changes write, without any fault.
fn picture_by(scene: &str, change: impl Fn(&mut Bench)) -> Vec<u8> {
    let mut bench = Bench::new(scene);
    change(&mut bench);
    bench.done();
    bench.picture()
}

#[test]
fn while_the_scene_is_broken_keys_change_the_picture_of_the_last_good_one() {
    use crate::math::DVec3;
    use crate::scene::description::{CameraChange, Pose};
    let moved = Pose { position: DVec3::new(0.5, 1.5, 4.25), look_at: DVec3::Y, up: DVec3::Y };
    let changes: [fn(&mut Bench, Pose); 4] = [
        |bench, pose| bench.overrides.camera = CameraChange { pose: Some(pose), ..CameraChange::default() },
        |bench, _| bench.overrides.view = Some(View::Normal),
        |bench, _| bench.overrides.shadows = Some(Shadows::Off),
        |bench, _| bench.overrides.exposure = Some(-2.0),
    ];
    // The scene itself, and a file that it names.
    type Fault = fn(&Bench);
    let faults: [(Fault, Fault); 2] = [
        (|bench| bench.edit("width = 40", "width = = 40"), |bench| bench.edit("width = = 40", "width = 40")),
        (|bench| bench.write("one.obj", "v 0 0 zero\n"), |bench| bench.write("one.obj", OBJ)),
    ];
    for (fault, mend) in faults {
        for change in changes {
            let mut bench = Bench::new(SCENE);
            bench.writing = Writing::Try;
            bench.preview = Some(PreviewSize { width: 12, height: 12, around: None });
            bench.done();
            fault(&bench);
            assert!(matches!(bench.failed(), Failure::Scene(_)));
            change(&mut bench, moved);
            let of = bench.send();
            let failed = bench.until_end(of);
            assert!(matches!(failed.last(), Some(Event::Failed { failure: Failure::Scene(_), .. })));
            // It is shown and written under the number of the key.
            let mut is_seen = false;
            loop {
                match bench.next() {
                    Event::Written { generation, .. } => {
                        assert_eq!(generation, of);
                        break;
                    }
                    Event::Preview { generation } => is_seen |= generation == of,
                    Event::Progress { .. } => {}
                    other => panic!("{other:?}"),
                }
            }
            assert!(is_seen);
            assert_eq!(bench.picture(), picture_by(SCENE, |bench| change(bench, moved)));
            // The mended scene has that picture.
            mend(&bench);
            assert_eq!(bench.done().0.stages[Stage::Render as usize].status, Status::Reused);
        }
    }
}

/// Many tiles, so that orders come during the first pass.
fn wide() -> String {
    SCENE.replace("width = 40", "width = 640").replace("height = 30", "height = 640")
}

/// The comment of the picture on disk that says how many samples it has.
fn samples_on_disk(bench: &Bench) -> String {
    let text = String::from_utf8_lossy(&bench.picture()).into_owned();
    let line = text.lines().find_map(|line| line.strip_prefix("# glimt:samples: "));
    line.expect("the picture says so").to_owned()
}

#[test]
fn a_part_that_comes_first_has_its_samples_before_the_rest() {
    let text = wide().replace("width = 640", "width = 256").replace("height = 640", "height = 256");
    let text = text.replace("samples = 4", "samples = 32");
    let mut bench = Bench::with(&text, slow);
    bench.overrides.view = Some(View::Samples);
    bench.preview = Some(PreviewSize { width: 256, height: 256, around: None });
    bench.first = Some(Section { left: 0.0, top: 0.0, width: 0.1, height: 0.1 });
    let of = bench.send();
    // The tile in the corner, which comes last else, is whole before the one in the middle.
    loop {
        let event = bench.next();
        assert!(!matches!(event, Event::Done { .. }), "not seen");
        let latest = bench.worker.previews.lock().expect("not poisoned").clone();
        let Some(LatestPreview { picture, range: Some([_, most]), .. }) = latest else { continue };
        let value = |x: usize, y: usize| f32::from(picture.pixels[y * 256 + x][0]) / 255.0 * most;
        if value(5, 5) > 31.0 {
            assert!(value(128, 128) < 31.0, "{}", value(128, 128));
            break;
        }
    }
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
}

#[test]
fn a_budget_that_ends_in_the_first_pass_waits_for_its_end() {
    let mut bench = Bench::with(&wide(), slow);
    bench.overrides.time_seconds = Some(0.001);
    let report = bench.done().0;
    assert!(report.image.samples.min >= 1, "{:?}", report.image.samples);
    assert!(!report.image.complete);
    assert!(!samples_on_disk(&bench).starts_with('0'));
}

#[test]
fn write_in_the_first_pass_waits_for_its_end() {
    let mut bench = Bench::with(&wide(), slow);
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::WritePostponed { generation } if generation == of) {}
    while !matches!(bench.next(), Event::Written { .. }) {}
    assert!(matches!(bench.next(), Event::WriteDone { paths, .. } if paths.len() == 1));
    assert_eq!(samples_on_disk(&bench), "1");
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
}

#[test]
fn write_is_refused_once_the_first_pass_was_stopped() {
    let mut bench = Bench::with(&wide(), slow);
    bench.write("out.ppm", "the old one");
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::WritePostponed { .. }) {}
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
    let is_refusal = |event: Event| match event {
        Event::WriteFailed { message, .. } => message.contains("before every pixel had a sample"),
        _ => false,
    };
    assert!(is_refusal(bench.next()), "the one that waited");
    bench.worker.send(Command::Write);
    assert!(is_refusal(bench.next()), "and one that comes later");
    assert_eq!(bench.picture(), b"the old one");
}

#[test]
fn a_refusal_to_write_does_not_deny_the_picture_that_is_on_disk() {
    let mut bench = Bench::with(SCENE, slow);
    bench.done();
    bench.write("scene.toml", &wide());
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
    bench.worker.send(Command::Write);
    let why = "the newest picture is not written: the render was stopped before every pixel had a sample";
    assert!(matches!(bench.next(), Event::WriteFailed { message, .. } if message == why));
}

#[test]
fn a_write_that_waits_is_done_by_the_request_that_comes_in_between() {
    let mut bench = Bench::with(&wide(), slow);
    bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::WritePostponed { .. }) {}
    bench.writing = Writing::No;
    bench.overrides.samples = Some(2);
    let of = bench.send();
    let events = bench.until_end(of);
    assert!(
        events.iter().any(|event| matches!(event, Event::Written { generation, .. } if *generation == of))
    );
    assert!(!events.iter().any(|event| matches!(event, Event::WriteFailed { .. })));
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

static HELD: AtomicBool = AtomicBool::new(false);

/// Holds the work when the tiles of a pass are done, and at no other time.
fn held_between_passes(
    photons: Option<&PhotonMaps>,
    world: &World,
    settings: &RenderSettings,
    pixels: Pixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    token.check()?;
    let first = samples.start == 0;
    let done = KERNEL(photons, world, settings, pixels, samples, &CancelToken::new());
    if first {
        // Long enough for every tile of the pass to be begun.
        std::thread::sleep(Duration::from_millis(50));
        token.set_paused(true);
        HELD.store(true, Ordering::SeqCst);
    }
    done
}

#[test]
fn write_is_heard_while_the_render_is_held_between_two_passes() {
    let mut bench = Bench::with(SCENE, held_between_passes);
    let of = bench.send();
    while !HELD.load(Ordering::SeqCst) {
        std::thread::yield_now();
    }
    // Time for the pass to end.
    std::thread::sleep(Duration::from_millis(200));
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::Written { .. }) {}
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
}

#[test]
fn a_picture_that_is_on_disk_is_written_when_asked() {
    let mut bench = Bench::new(SCENE);
    bench.done();
    bench.worker.send(Command::Write);
    assert!(matches!(bench.next(), Event::Written { .. }));
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
fn a_target_that_cannot_be_written_is_said_and_the_picture_shown_all_the_same() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.outputs = vec![bench.path("nowhere/out.png")];
    bench.preview = Some(PreviewSize { width: 12, height: 12, around: None });
    bench.writing = Writing::Try;
    let of = bench.send();
    let events = bench.until_end(of);
    let failed =
        |event: &Event| matches!(event, Event::WriteFailed { message, .. } if message.contains("nowhere"));
    let first = events.iter().position(failed).expect("it is said");
    let shown = events.iter().position(|event| matches!(event, Event::Preview { .. })).expect("it is shown");
    assert!(first < shown, "before the work");
    let Some(Event::Done { report, .. }) = events.last() else { panic!("{:?}", events.last()) };
    assert_eq!((report.image.path.as_deref(), report.image.complete), (None, true));
    let write = &report.stages[Stage::Write as usize];
    assert!(write.status == Status::Skipped && write.why.contains("nowhere"), "{write:?}");
    // Mended while it was rendered, or by the next request.
    fs::create_dir(bench.path("nowhere")).expect("a folder");
    assert_statuses(&bench.done().0, "rrrrrsrd");
    assert!(bench.path("nowhere/out.png").exists());
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

#[test]
fn warnings_are_said_before_anything_is_rendered() {
    let mut bench = Bench::new(SCENE);
    // A face without area.
    bench.write("one.obj", &format!("{OBJ}f 1 1 2\n"));
    bench.preview = Some(PreviewSize { width: 20, height: 20, around: None });
    let of = bench.send();
    let events = bench.until_end(of);
    let at = |what: &dyn Fn(&Event) -> bool| events.iter().position(what).expect("it is said");
    let early = at(&|event| matches!(event, Event::Warnings { .. }));
    assert!(early < at(&|event| matches!(event, Event::Progress { .. })));
    assert!(early < at(&|event| matches!(event, Event::Preview { .. })));
    let (Event::Warnings { warnings: early, .. }, Some(Event::Done { warnings, .. })) =
        (&events[early], events.last())
    else {
        panic!("{events:?}")
    };
    assert_eq!((early, early.len()), (warnings, 1));
}

#[test]
fn a_mesh_without_coordinates_says_that_its_anisotropy_has_no_direction() {
    let brushed = SCENE.replace(
        "type = \"phong\"\ndiffuse = [0.5, 0.5, 0.5]",
        "type = \"metal\"\ncolor = [0.5, 0.5, 0.5]\nanisotropy = 0.5",
    );
    let said = |scene: &str, mesh: &str| {
        let mut bench = Bench::new(scene);
        bench.write("one.obj", mesh);
        let (_, warnings) = bench.done_with_warnings();
        warnings.into_iter().map(|one| one.message).collect::<Vec<_>>()
    };
    let warnings = said(&brushed, OBJ);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let expected = "one.obj has no texture coordinates: the `anisotropy` of \"wall\" has no direction there";
    assert!(warnings[0].ends_with(expected), "{warnings:?}");
    let with_coordinates = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    assert_eq!(said(&brushed, with_coordinates), [""; 0]);
    assert_eq!(said(&brushed.replace("anisotropy = 0.5", "anisotropy = 0"), OBJ), [""; 0]);
}

/// A kernel as the real one, but a little slower.
fn leisurely(
    photons: Option<&PhotonMaps>,
    world: &World,
    settings: &RenderSettings,
    pixels: Pixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    token.check()?;
    std::thread::sleep(Duration::from_millis(5));
    KERNEL(photons, world, settings, pixels, samples, token)
}

#[test]
fn the_time_for_which_a_render_is_held_does_not_count() {
    const HOLD: f64 = 0.6;
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 32"), leisurely);
    let begin = Instant::now();
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Pause(true));
    std::thread::sleep(Duration::from_secs_f64(HOLD));
    bench.worker.send(Command::Pause(false));
    let Some(Event::Done { report, .. }) = bench.until_end(of).pop() else { panic!("it is done") };
    let most = begin.elapsed().as_secs_f64() - HOLD;
    let render = report.stages[Stage::Render as usize].seconds;
    assert!(render > 0.005 && render <= most && report.seconds <= most, "{render} {} {most}", report.seconds);
    assert!(report.image.render_seconds <= most);
}

#[test]
fn a_picture_that_is_found_again_tells_what_it_took() {
    let mut bench = Bench::with(SCENE, leisurely);
    let (first, _) = bench.done();
    bench.overrides.shadows = Some(crate::scene::description::Shadows::Off);
    bench.done();
    bench.overrides.shadows = None;
    let (again, _) = bench.done();
    assert_eq!(again.stages[Stage::Render as usize].status, Status::Reused);
    assert_eq!(again.image.render_seconds, first.image.render_seconds);
    assert!(first.image.render_seconds > 0.005);
}

#[test]
fn a_render_that_goes_on_tells_the_seconds_of_all_its_samples() {
    // Some hundred tiles: seconds.
    let large =
        SCENE.replace("width = 40\nheight = 30\nsamples = 4", "width = 400\nheight = 300\nsamples = 64");
    let mut bench = Bench::with(&large, leisurely);
    bench.send();
    let is_on_its_way = |event: &Event, of: u64| {
        matches!(event, Event::Progress { progress, generation }
            if *generation == of && progress.samples > 0 && progress.fraction < 1.0)
    };
    while !is_on_its_way(&bench.next(), 1) {}
    // A typo: the render goes on. Its mend goes on from what is there.
    bench.edit("samples = 64", "samples = ");
    bench.send();
    while !is_on_its_way(&bench.next(), 2) {}
    bench.edit("samples = ", "samples = 64");
    let of = bench.send();
    let mut events = bench.until_end(of);
    let Some(Event::Done { report, .. }) = events.pop() else { panic!("it is done") };
    let stage = report.stages[Stage::Render as usize].seconds;
    let earlier = report.image.render_seconds - stage;
    assert!(earlier > 0.005, "{} {stage}", report.image.render_seconds);
    let said = events.iter().filter_map(|event| match event {
        Event::Progress { progress, generation } if *generation == of => Some(progress.earlier_seconds),
        _ => None,
    });
    let said: Vec<f64> = said.collect();
    assert!(!said.is_empty() && said.iter().all(|said| (said - earlier).abs() < 0.05), "{said:?} {earlier}");
}

#[test]
fn a_request_tells_what_the_scene_itself_says() {
    let mut bench = Bench::new(&SCENE.replace("exposure = 0.0", "exposure = 0.5"));
    bench.overrides.exposure = Some(2.0);
    bench.overrides.shadows = Some(Shadows::Off);
    bench.overrides.integrator = Some(Integrator::Whitted);
    bench.overrides.photons = Some(true);
    bench.overrides.camera.fov = Some(10.0);
    let of = bench.send();
    let events = bench.until_end(of);
    let said = |event: &Event| {
        let Event::Settings { settings, camera, exposure, own, .. } = event else { return None };
        let shadows = (settings.shadows, own.shadows);
        Some((settings.exposure, *exposure, camera.fov, shadows, own.integrator, own.photons))
    };
    let shadows = (Shadows::Off, Shadows::Soft);
    assert_eq!(events.iter().find_map(said), Some((2.0, 0.5, 40.0, shadows, Integrator::Whitted, false)));
}
