//! Tests for failures, and for commands that arrive during a render: cancel, pause and write.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use super::*;
use crate::control::{CancelToken, Canceled};
use crate::film::{Rect, SelectedPixels, TileSamples};
use crate::integrators::{PhotonPassesBySample, RayCounters, RenderSettings};
use crate::messages::{INCOMPLETE_IMAGE, NEWEST_IMAGE_NOT_WRITTEN};
use crate::protocol::LastValidSceneRenderOutcome;
use crate::scene::description::{Integrator, ShadowMode};
use crate::session::SessionConfig;
use crate::settings::ViewMode;
use crate::world::World;

/// Blocks until its token is canceled.
fn block_until_canceled(
    _: Option<&PhotonPassesBySample>,
    _: &World,
    _: &RenderSettings,
    _: SelectedPixels,
    _: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    loop {
        token.check_pause_and_cancel()?;
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn cancel_stops_a_render() {
    let mut bench = Bench::with(SCENE, block_until_canceled);
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Cancel);
    assert!(matches!(bench.until_end(of).last(), Some(Event::Canceled { .. })));
    assert!(!bench.path("out.ppm").exists());
}

#[test]
fn paused_render_can_be_canceled() {
    let mut bench = Bench::with(SCENE, block_until_canceled);
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Pause(true));
    bench.worker.send(Command::Cancel);
    assert!(matches!(bench.until_end(of).last(), Some(Event::Canceled { .. })));
}

#[test]
fn replaced_requests_are_canceled() {
    let mut bench = Bench::with(SCENE, block_until_canceled);
    let ends: Vec<u64> = (0..4).map(|_| bench.send()).collect();
    bench.worker.send(Command::Cancel);
    let mut canceled = Vec::new();
    while canceled.len() < ends.len() {
        if let Event::Canceled { generation } = bench.next() {
            canceled.push(generation);
        }
    }
    canceled.sort_unstable();
    assert_eq!(canceled, ends);
}

#[test]
fn older_request_arriving_late_is_dropped() {
    let mut bench = Bench::new(SCENE);
    bench.generation = 10;
    bench.done();
    bench.generation = 3;
    let of = bench.send();
    assert!(matches!(bench.until_end(of).last(), Some(Event::Canceled { generation: 4 })));
}

static BREAKS: AtomicBool = AtomicBool::new(true);

fn breaks_once(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    assert!(!BREAKS.swap(false, Ordering::SeqCst), "a tile failed");
    KERNEL(photons, world, settings, pixels, samples, token)
}

#[test]
fn worker_survives_a_panic() {
    let mut bench = Bench::with(SCENE, breaks_once);
    let Failure::Work(message) = bench.failed() else { panic!("expected a work failure") };
    assert!(message.contains("internal error"), "{message}");
    assert!(bench.done().0.image.complete);
}

/// A panic payload that panics when it is dropped. The worker drops it outside of a request.
struct PanicsOnDrop;

impl Drop for PanicsOnDrop {
    fn drop(&mut self) {
        panic!("outside of a request");
    }
}

static HAS_PANICKED: AtomicBool = AtomicBool::new(false);

fn panics_on_drop(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    if !HAS_PANICKED.swap(true, Ordering::SeqCst) {
        std::panic::panic_any(PanicsOnDrop);
    }
    KERNEL(photons, world, settings, pixels, samples, token)
}

#[test]
fn panics_outside_of_requests_are_reported() {
    let mut bench = Bench::with(SCENE, panics_on_drop);
    assert!(matches!(bench.failed(), Failure::Work(_)), "the request itself fails first");
    let Event::Failed { generation, failure: Failure::Work(message) } = bench.next() else {
        panic!("expected the worker thread to fail")
    };
    assert!(generation == bench.generation && message.contains("worker thread"), "{message}");
}

static TILES: AtomicUsize = AtomicUsize::new(0);

fn breaks_first(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    assert!(TILES.fetch_add(1, Ordering::SeqCst) != 0, "the first tile failed");
    render_slowly(photons, world, settings, pixels, samples, token)
}

#[test]
fn panic_stops_the_current_pass() {
    let scene = SCENE.replace("width = 40", "width = 1280").replace("height = 30", "height = 1280");
    let mut bench = Bench::with(&scene, breaks_first);
    assert!(matches!(bench.failed(), Failure::Work(_)));
    let tiles = TILES.load(Ordering::SeqCst);
    assert!(tiles < 40 * 40 / 4, "{tiles} tiles were rendered after the panic");
}

#[test]
fn oversized_film_is_an_error() {
    let config = SessionConfig { max_film_bytes: 100_000, ..SessionConfig::default() };
    let mut bench = Bench::with_config(&SCENE.replace("width = 40", "width = 400"), config);
    assert!(matches!(bench.failed(), Failure::Work(message) if message.contains("400×30")));
    assert!(!bench.path("out.ppm").exists());
    bench.edit("400", "40");
    bench.done();
}

/// Renders so slowly that commands arrive during the render.
pub(super) fn render_slowly(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    std::thread::sleep(Duration::from_millis(2));
    KERNEL(photons, world, settings, pixels, samples, token)
}

/// For a request with an invalid scene, waits until the render of the last valid scene ends.
fn last_valid_scene_outcome(bench: &Bench, of: u64) -> LastValidSceneRenderOutcome {
    loop {
        match bench.next() {
            Event::LastGoodEnded { generation, end } if generation == of => return end,
            Event::Preview { .. } | Event::Progress { .. } | Event::WriteDone { .. } => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn nothing_is_rendered_without_a_valid_scene() {
    let mut bench = Bench::new(&SCENE.replace("width = 40", "width = = 40"));
    bench.writing = WriteRequirement::Try;
    assert!(matches!(bench.failed(), Failure::Scene(_)));
    assert_eq!(last_valid_scene_outcome(&bench, 1), LastValidSceneRenderOutcome::Stopped);
}

#[test]
fn broken_scene_file_does_not_stop_a_render() {
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 10000"), render_slowly);
    (bench.writing, bench.preview) =
        (WriteRequirement::Try, Some(PreviewBounds { width: 12, height: 12, around: None }));
    let first = bench.send();
    while !matches!(bench.next(), Event::Progress { progress, .. } if progress.samples > 0) {}
    bench.edit("width = 40", "width = = 40");
    let broken = bench.send();
    assert!(matches!(bench.until_end(first).last(), Some(Event::Canceled { .. })));
    assert!(matches!(bench.until_end(broken).last(), Some(Event::Failed { failure: Failure::Scene(_), .. })));
    // The render continues under the newest generation until the image is finished and written.
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
    let finished = |unchanged| LastValidSceneRenderOutcome::Finished { unchanged };
    assert_eq!(last_valid_scene_outcome(&bench, broken), finished(false));
    // A second typo does not keep the image from being finished.
    bench.edit("width = = 40", "width = = = 40");
    assert!(matches!(bench.failed(), Failure::Scene(_)));
    assert_eq!(last_valid_scene_outcome(&bench, bench.generation), finished(true));
    bench.edit("width = = = 40", "width = = 40");
    bench.edit("width = = 40", "width = 40");
    let report = bench.done().0;
    assert_statuses(&report, "rrrrrsrr");
}

/// Applies a change to a valid scene and returns its image.
fn image_after(scene: &str, change: impl Fn(&mut Bench)) -> Vec<u8> {
    let mut bench = Bench::new(scene);
    change(&mut bench);
    bench.done();
    bench.picture()
}

#[test]
fn last_valid_scene_applies_new_overrides() {
    use crate::math::DVec3;
    use crate::scene::description::{CameraOverrides, Pose};
    let moved = Pose { position: DVec3::new(0.5, 1.5, 4.25), look_at: DVec3::Y, up: DVec3::Y };
    let changes: [fn(&mut Bench, Pose); 4] = [
        |bench, pose| {
            bench.overrides.camera = CameraOverrides { pose: Some(pose), ..CameraOverrides::default() }
        },
        |bench, _| bench.overrides.view = Some(ViewMode::Normal),
        |bench, _| bench.overrides.shadows = Some(ShadowMode::Off),
        |bench, _| bench.overrides.exposure = Some(-2.0),
    ];
    // Test errors in the scene file and in a referenced file.
    type ChangeScene = fn(&Bench);
    let faults: [(ChangeScene, ChangeScene); 2] = [
        (|bench| bench.edit("width = 40", "width = = 40"), |bench| bench.edit("width = = 40", "width = 40")),
        (|bench| bench.write("one.obj", "v 0 0 zero\n"), |bench| bench.write("one.obj", OBJ)),
    ];
    for (fault, fix) in faults {
        for change in changes {
            let mut bench = Bench::new(SCENE);
            bench.writing = WriteRequirement::Try;
            bench.preview = Some(PreviewBounds { width: 12, height: 12, around: None });
            bench.done();
            fault(&bench);
            assert!(matches!(bench.failed(), Failure::Scene(_)));
            change(&mut bench, moved);
            let of = bench.send();
            let failed = bench.until_end(of);
            assert!(matches!(failed.last(), Some(Event::Failed { failure: Failure::Scene(_), .. })));
            // The preview and the written image have the generation number of the request for the change.
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
            assert_eq!(bench.picture(), image_after(SCENE, |bench| change(bench, moved)));
            // The fixed scene reuses this image.
            fix(&bench);
            assert_eq!(bench.done().0.stages[Stage::Render as usize].status, StageStatus::Reused);
        }
    }
}

#[test]
fn last_valid_scene_never_mixes_file_versions() {
    for is_changed in [false, true] {
        let mut bench = Bench::new(SCENE);
        bench.writing = WriteRequirement::Try;
        // This view needs no textures.
        bench.overrides.view = Some(ViewMode::Depth);
        bench.done();
        let depth = bench.picture();
        bench.edit("width = 40", "width = = 40");
        if is_changed {
            bench.write("one.obj", &OBJ.replace("v 1 0 0", "v 2 0 0"));
        }
        bench.write("skin.ppm", "P6\n1 1\n255\nxyz");
        bench.overrides.view = None;
        assert!(matches!(bench.failed(), Failure::Scene(_)));
        let end = loop {
            if let Event::LastGoodEnded { end, .. } = bench.next() {
                break end;
            }
        };
        if is_changed {
            assert_eq!(end, LastValidSceneRenderOutcome::Stopped);
            assert_eq!(bench.picture(), depth);
        } else {
            let expected = image_after(SCENE, |bench| bench.write("skin.ppm", "P6\n1 1\n255\nxyz"));
            assert_eq!(bench.picture(), expected);
        }
    }
}

/// Returns a scene with enough tiles for commands to arrive during the first pass.
fn wide() -> String {
    SCENE.replace("width = 40", "width = 640").replace("height = 30", "height = 640")
}

/// Reads the sample count from the metadata of the image on disk.
fn samples_on_disk(bench: &Bench) -> String {
    let text = String::from_utf8_lossy(&bench.picture()).into_owned();
    let line = text.lines().find_map(|line| line.strip_prefix("# glimt:samples: "));
    line.expect("a sample count").to_owned()
}

#[test]
fn priority_region_is_rendered_first() {
    let text = wide().replace("width = 640", "width = 256").replace("height = 640", "height = 256");
    let text = text.replace("samples = 4", "samples = 32");
    let mut bench = Bench::with(&text, render_slowly);
    bench.overrides.view = Some(ViewMode::Samples);
    bench.preview = Some(PreviewBounds { width: 256, height: 256, around: None });
    bench.first = Some(NormalizedRect { left: 0.0, top: 0.0, width: 0.1, height: 0.1 });
    let of = bench.send();
    // The corner tile, which is usually rendered last, must be complete before the middle tile.
    loop {
        let event = bench.next();
        assert!(!matches!(event, Event::Done { .. }), "the corner tile was not rendered first");
        let latest = bench.worker.previews.lock().expect("not poisoned").clone();
        let Some(PreviewUpdate { picture, range: Some([_, most]), .. }) = latest else { continue };
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
fn time_limit_waits_for_the_first_pass() {
    let mut bench = Bench::with(&wide(), render_slowly);
    bench.overrides.time_seconds = Some(0.001);
    let report = bench.done().0;
    assert!(report.image.samples.min >= 1, "{:?}", report.image.samples);
    assert!(!report.image.complete);
    assert!(!samples_on_disk(&bench).starts_with('0'));
}

#[test]
fn write_waits_for_the_first_pass() {
    let mut bench = Bench::with(&wide(), render_slowly);
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
fn incomplete_images_are_not_written() {
    let mut bench = Bench::with(&wide(), render_slowly);
    bench.write("out.ppm", "the old one");
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::WritePostponed { .. }) {}
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
    let is_refusal = |event: Event| match event {
        Event::WriteFailed { message, .. } => message.contains(INCOMPLETE_IMAGE),
        _ => false,
    };
    assert!(is_refusal(bench.next()), "the postponed command should be refused");
    bench.worker.send(Command::Write);
    assert!(is_refusal(bench.next()), "a later command should be refused");
    assert_eq!(bench.picture(), b"the old one");
}

#[test]
fn refusal_mentions_the_newest_image() {
    let mut bench = Bench::with(SCENE, render_slowly);
    bench.done();
    bench.write("scene.toml", &wide());
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
    bench.worker.send(Command::Write);
    let is_refusal =
        |message: &str| message.starts_with(NEWEST_IMAGE_NOT_WRITTEN) && message.ends_with(INCOMPLETE_IMAGE);
    assert!(matches!(bench.next(), Event::WriteFailed { message, .. } if is_refusal(&message)));
}

#[test]
fn next_request_carries_out_postponed_write() {
    let mut bench = Bench::with(&wide(), render_slowly);
    bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::WritePostponed { .. }) {}
    bench.writing = WriteRequirement::No;
    bench.overrides.samples = Some(2);
    let of = bench.send();
    let events = bench.until_end(of);
    assert!(
        events.iter().any(|event| matches!(event, Event::Written { generation, .. } if *generation == of))
    );
    assert!(!events.iter().any(|event| matches!(event, Event::WriteFailed { .. })));
}

#[test]
fn write_during_a_render_saves_current_samples() {
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 1000000"), render_slowly);
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { progress, .. } if progress.samples > 0) {}
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::Written { .. }) {}
    assert!(!bench.picture().is_empty());
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
    // The film is kept, so it can be written again.
    fs::remove_file(bench.path("out.ppm")).expect("removed");
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::Written { .. }) {}
}

static HELD: AtomicBool = AtomicBool::new(false);

/// Pauses the work between two passes.
fn held_between_passes(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    token.check_pause_and_cancel()?;
    let first = samples.start == 0;
    let done = KERNEL(photons, world, settings, pixels, samples, &CancelToken::new());
    if first {
        // Wait until every tile of the pass has started.
        std::thread::sleep(Duration::from_millis(50));
        token.set_paused(true);
        HELD.store(true, Ordering::SeqCst);
    }
    done
}

#[test]
fn write_is_handled_during_pause_between_passes() {
    let mut bench = Bench::with(SCENE, held_between_passes);
    let of = bench.send();
    while !HELD.load(Ordering::SeqCst) {
        std::thread::yield_now();
    }
    // Give the pass time to finish.
    std::thread::sleep(Duration::from_millis(200));
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::Written { .. }) {}
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
}

#[test]
fn write_command_rewrites_an_unchanged_image() {
    let mut bench = Bench::new(SCENE);
    bench.done();
    bench.worker.send(Command::Write);
    assert!(matches!(bench.next(), Event::Written { .. }));
}

#[test]
fn write_without_an_image_fails() {
    let bench = Bench::new(SCENE);
    bench.worker.send(Command::Write);
    assert!(matches!(bench.next(), Event::WriteFailed { .. }));
}

#[test]
fn time_limit_ends_a_render() {
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 1000000"), render_slowly);
    bench.overrides.time_seconds = Some(0.3);
    let begin = Instant::now();
    let (report, _) = bench.done();
    assert!(begin.elapsed() < Duration::from_secs(30));
    assert!(!report.image.complete);
    assert!(report.image.samples.max < 1_000_000 && report.image.samples.max > 0);
    assert!(bench.path("out.ppm").exists());
    let (again, unchanged) = bench.done();
    assert_eq!(again.stages[Stage::Render as usize].status, StageStatus::Reused);
    assert!(unchanged);
}

#[test]
fn unwritable_output_fails_before_rendering() {
    let mut bench = Bench::with(SCENE, block_until_canceled);
    bench.overrides.outputs = vec![bench.path("nowhere/out.png")];
    assert!(matches!(bench.failed(), Failure::Work(message) if message.contains("nowhere")));
}

#[test]
fn image_is_shown_despite_unwritable_output() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.outputs = vec![bench.path("nowhere/out.png")];
    bench.preview = Some(PreviewBounds { width: 12, height: 12, around: None });
    bench.writing = WriteRequirement::Try;
    let of = bench.send();
    let events = bench.until_end(of);
    let failed =
        |event: &Event| matches!(event, Event::WriteFailed { message, .. } if message.contains("nowhere"));
    let first = events.iter().position(failed).expect("a failure");
    let shown = events.iter().position(|event| matches!(event, Event::Preview { .. })).expect("a preview");
    assert!(first < shown, "the failure should be reported before rendering");
    let Some(Event::Done { report, .. }) = events.last() else { panic!("{:?}", events.last()) };
    assert_eq!((report.image.path.as_deref(), report.image.complete), (None, true));
    let write = &report.stages[Stage::Write as usize];
    assert!(write.status == StageStatus::Skipped && write.why.contains("nowhere"), "{write:?}");
    // Create the folder so that the next request can write the image.
    fs::create_dir(bench.path("nowhere")).expect("a folder");
    assert_statuses(&bench.done().0, "rrrrrsrd");
    assert!(bench.path("nowhere/out.png").exists());
}

#[test]
fn crop_outside_the_image_is_an_error() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.crop = Some(Rect { x: 39, y: 0, width: 2, height: 1 });
    assert!(matches!(bench.failed(), Failure::Scene(_)));
    bench.overrides.crop = Some(Rect { x: 38, y: 3, width: 2, height: 5 });
    let report = bench.done().0;
    assert_eq!(report.counters.camera_rays, 2 * 5 * 4);
    assert!(report.image.complete);
}

#[test]
fn warnings_are_reported_before_rendering() {
    let mut bench = Bench::new(SCENE);
    // A face with zero area.
    bench.write("one.obj", &format!("{OBJ}f 1 1 2\n"));
    bench.preview = Some(PreviewBounds { width: 20, height: 20, around: None });
    let of = bench.send();
    let events = bench.until_end(of);
    let at = |what: &dyn Fn(&Event) -> bool| events.iter().position(what).expect("an event");
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
fn anisotropy_without_uvs_causes_a_warning() {
    let brushed = SCENE.replace(
        "type = \"phong\"\ndiffuse = [0.5, 0.5, 0.5]",
        "type = \"metal\"\ncolor = [0.5, 0.5, 0.5]\nanisotropy = 0.5",
    );
    let messages = |scene: &str, mesh: &str| {
        let mut bench = Bench::new(scene);
        bench.write("one.obj", mesh);
        let (_, warnings) = bench.done_with_warnings();
        warnings.into_iter().map(|one| one.message).collect::<Vec<_>>()
    };
    let warnings = messages(&brushed, OBJ);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    for fact in ["one.obj", "`anisotropy`", "\"wall\""] {
        assert!(warnings[0].contains(fact), "{fact}: {warnings:?}");
    }
    let with_coordinates = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    assert_eq!(messages(&brushed, with_coordinates), [""; 0]);
    assert_eq!(messages(&brushed.replace("anisotropy = 0.5", "anisotropy = 0"), OBJ), [""; 0]);
}

/// Renders slightly more slowly than usual.
fn render_slightly_slowly(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    token.check_pause_and_cancel()?;
    std::thread::sleep(Duration::from_millis(5));
    KERNEL(photons, world, settings, pixels, samples, token)
}

#[test]
fn paused_time_is_not_counted() {
    const HOLD: f64 = 0.6;
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 32"), render_slightly_slowly);
    let begin = Instant::now();
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { .. }) {}
    bench.worker.send(Command::Pause(true));
    std::thread::sleep(Duration::from_secs_f64(HOLD));
    bench.worker.send(Command::Pause(false));
    let Some(Event::Done { report, .. }) = bench.until_end(of).pop() else {
        panic!("expected the render to finish")
    };
    let most = begin.elapsed().as_secs_f64() - HOLD;
    let render = report.stages[Stage::Render as usize].seconds;
    assert!(render > 0.005 && render <= most && report.seconds <= most, "{render} {} {most}", report.seconds);
    assert!(report.image.render_seconds <= most);
}

#[test]
fn reused_image_reports_original_render_time() {
    let mut bench = Bench::with(SCENE, render_slightly_slowly);
    let (first, _) = bench.done();
    bench.overrides.shadows = Some(crate::scene::description::ShadowMode::Off);
    bench.done();
    bench.overrides.shadows = None;
    let (again, _) = bench.done();
    assert_eq!(again.stages[Stage::Render as usize].status, StageStatus::Reused);
    assert_eq!(again.image.render_seconds, first.image.render_seconds);
    assert!(first.image.render_seconds > 0.005);
}

#[test]
fn continued_render_reports_total_time() {
    // Rendering about a hundred tiles takes seconds.
    let large =
        SCENE.replace("width = 40\nheight = 30\nsamples = 4", "width = 400\nheight = 300\nsamples = 64");
    let mut bench = Bench::with(&large, render_slightly_slowly);
    bench.send();
    let is_on_its_way = |event: &Event, of: u64| {
        matches!(event, Event::Progress { progress, generation }
            if *generation == of && progress.samples > 0 && progress.fraction < 1.0)
    };
    while !is_on_its_way(&bench.next(), 1) {}
    // The render continues while the scene has a typo. Once it is fixed, the existing samples are reused.
    bench.edit("samples = 64", "samples = ");
    bench.send();
    while !is_on_its_way(&bench.next(), 2) {}
    bench.edit("samples = ", "samples = 64");
    let of = bench.send();
    let mut events = bench.until_end(of);
    let Some(Event::Done { report, .. }) = events.pop() else { panic!("expected the render to finish") };
    let stage = report.stages[Stage::Render as usize].seconds;
    let earlier = report.image.render_seconds - stage;
    assert!(earlier > 0.005, "{} {stage}", report.image.render_seconds);
    let earlier_seconds = events.iter().filter_map(|event| match event {
        Event::Progress { progress, generation } if *generation == of => Some(progress.earlier_seconds),
        _ => None,
    });
    let reported: Vec<f64> = earlier_seconds.collect();
    assert!(!reported.is_empty(), "no progress");
    assert!(reported.iter().all(|seconds| (seconds - earlier).abs() < 0.05), "{reported:?} {earlier}");
}

#[test]
fn settings_event_includes_scene_values() {
    let mut bench = Bench::new(&SCENE.replace("exposure = 0.0", "exposure = 0.5"));
    bench.overrides.exposure = Some(2.0);
    bench.overrides.shadows = Some(ShadowMode::Off);
    bench.overrides.integrator = Some(Integrator::Whitted);
    bench.overrides.photons = Some(true);
    bench.overrides.camera.fov = Some(10.0);
    let of = bench.send();
    let events = bench.until_end(of);
    let reported = |event: &Event| {
        let Event::Settings { settings, own, .. } = event else { return None };
        let shadows = (settings.shadows, own.shadows);
        Some((
            settings.exposure,
            own.exposure,
            own.camera.projection.fov(),
            shadows,
            own.integrator,
            own.photons,
        ))
    };
    let shadows = (ShadowMode::Off, ShadowMode::Soft);
    assert_eq!(
        events.iter().find_map(reported),
        Some((2.0, 0.5, Some(40.0), shadows, Integrator::Whitted, false))
    );
}
