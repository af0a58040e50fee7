//! Tests for photons in the worker: cached maps, and orders during photon tracing.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::*;
use crate::control::{CancelToken, Canceled};
use crate::film::{SelectedPixels, TileSamples};
use crate::integrators::{PhotonPassesBySample, RayCounters, RenderSettings};
use crate::world::World;

/// Returns a scene with a light enclosed in glass and `count` photons per pass.
fn wrapped(count: u32) -> String {
    let glass = "[[sphere]]\ncenter = [0, 3, 0]\nradius = 0.1\nmaterial = \"clear\"\n[[plane]]\nmaterial = \"wall\"\n[materials.clear]\ntype = \"glass\"\n";
    format!("{SCENE}{glass}[photons]\nenabled = true\ncount = {count}\n")
}

/// Waits until the photons stage is running.
fn until_first_are_sent(bench: &Bench) {
    let is_it = |event: &Event| match event {
        Event::Stage { stage, .. } => stage.name == Stage::Photons && stage.status == StageStatus::Running,
        _ => false,
    };
    while !is_it(&bench.next()) {}
}

#[test]
fn commands_are_handled_during_first_photon_pass() {
    let mut bench = Bench::new(&wrapped(1_500_000));
    let of = bench.send();
    until_first_are_sent(&bench);
    // Pause so that the stage does not end before the orders arrive.
    bench.worker.send(Command::Pause(true));
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::WritePostponed { generation } if generation == of) {}
    bench.worker.send(Command::Pick(NormalizedPosition { x: 0.5, y: 0.5 }));
    while !matches!(bench.next(), Event::Picked { picked, .. } if picked.object.is_some()) {}
    bench.worker.send(Command::Pause(false));
    let events = bench.until_end(of);
    assert!(
        !events.iter().any(|event| matches!(event, Event::WritePostponed { .. })),
        "the postponed write should be reported only once"
    );
    assert!(events.iter().any(|event| matches!(event, Event::Written { .. })));
}

#[test]
fn write_is_handled_during_later_photon_passes() {
    let text = wrapped(4_000_000).replace("samples = 4", "samples = 1000000");
    let mut bench = Bench::new(&text);
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { progress, .. } if progress.samples > 0) {}
    // Wait for a fixed time. Photon passes take most of the time but do not report progress.
    std::thread::sleep(Duration::from_millis(50));
    bench.worker.send(Command::Pause(true));
    std::thread::sleep(Duration::from_millis(100));
    bench.worker.send(Command::Write);
    while !matches!(bench.next(), Event::Written { .. }) {}
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
}

#[test]
fn time_limit_ends_a_photon_pass() {
    // A photon pass takes longer than the time limit, but an image sample takes less.
    let text = wrapped(2_000_000).replace("samples = 4", "samples = 1000000");
    let mut bench = Bench::new(&text);
    bench.overrides.time_seconds = Some(0.2);
    let report = bench.done().0;
    assert_eq!(report.image.samples.max, 1);
    assert!(!report.image.complete);
}

static WITHOUT: AtomicBool = AtomicBool::new(false);

/// Renders normally and records whether any call was without photons.
fn without(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    WITHOUT.fetch_or(photons.is_none(), Ordering::SeqCst);
    KERNEL(photons, world, settings, pixels, samples, token)
}

/// Returns, for each preview, whether it lacked light from photons and whether the photons had been traced.
fn previews_of(bench: &mut Bench) -> Vec<(bool, bool)> {
    let (of, mut previews, mut are_there) = (bench.send(), Vec::new(), false);
    loop {
        match bench.next() {
            Event::Preview { .. } => {
                let latest = bench.worker.previews.lock().expect("not poisoned").take();
                previews.extend(latest.map(|latest| (latest.lacks_photons, are_there)));
            }
            Event::Stage { stage, .. } if stage.name == Stage::Photons => {
                are_there = stage.status != StageStatus::Running;
            }
            Event::Done { generation, .. } if generation == of => return previews,
            _ => {}
        }
    }
}

#[test]
fn first_preview_does_not_wait_for_photons() {
    let mut bench = Bench::with(&wrapped(300_000), without);
    bench.preview = Some(PreviewBounds { width: 12, height: 12, around: None });
    let previews = previews_of(&mut bench);
    assert_eq!(previews.first(), Some(&(true, false)), "{previews:?}");
    assert!(WITHOUT.load(Ordering::SeqCst));
    assert!(previews.len() > 1 && previews[1..].iter().all(|it| *it == (false, true)), "{previews:?}");
    // The first image from a moving camera reuses the cached photons.
    WITHOUT.store(false, Ordering::SeqCst);
    bench.overrides.camera.fov = Some(50.0);
    let previews = previews_of(&mut bench);
    assert!(!WITHOUT.load(Ordering::SeqCst));
    assert!(!previews.is_empty() && previews.iter().all(|(lacks, _)| !lacks), "{previews:?}");
}

#[test]
fn preview_without_photons_does_not_affect_film() {
    let mut pictures = [None, Some(PreviewBounds { width: 12, height: 12, around: None })].map(|preview| {
        let mut bench = Bench::new(&wrapped(1000));
        bench.preview = preview;
        bench.done();
        std::fs::read(bench.path("out.ppm")).expect("an image")
    });
    pictures.sort();
    assert_eq!(pictures[0], pictures[1]);
}

#[test]
fn maps_are_kept_while_there_is_room() {
    const MAX_BYTES: u64 = 128 << 20;
    let mut bench = Bench::new(&wrapped(1_000_000).replace("samples = 4", "samples = 8"));
    let report = bench.done().0.photons.expect("a photon report");
    assert_eq!(report.passes, 8);
    let of_pass = report.used_memory_bytes;
    assert!(8 * of_pass > MAX_BYTES, "not all passes should fit: {of_pass} bytes per pass");
    let kept = report.kept_memory_bytes;
    assert!(kept <= MAX_BYTES && kept + of_pass > MAX_BYTES, "{kept} bytes kept, {of_pass} per pass");
}

/// Whether the kernel [`black`] has received photons.
static WITH: AtomicBool = AtomicBool::new(false);

/// Renders all samples black, with or without photons.
fn black(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    WITH.fetch_or(photons.is_some(), Ordering::SeqCst);
    let (mut samples, rays) = KERNEL(photons, world, settings, pixels, samples, token)?;
    samples.radiance.fill(crate::math::Vec3::ZERO);
    Ok((samples, rays))
}

#[test]
fn custom_kernel_is_used_with_photons() {
    let mut bench = Bench::with(&wrapped(1000), black);
    bench.done();
    let picture = std::fs::read(bench.path("out.ppm")).expect("an image");
    let bytes = picture.rsplitn(2, |byte| *byte == b'\n').next().expect("pixels");
    assert!(WITH.load(Ordering::SeqCst) && bytes.iter().all(|byte| *byte == 0));
}

#[test]
fn each_skip_of_photons_reports_its_own_reason() {
    let mut bench = Bench::new(&format!("{SCENE}[photons]\nenabled = true\n"));
    let mut reason = |integrator| {
        bench.overrides.integrator = integrator;
        let report = bench.done().0;
        let stage = &report.stages[Stage::Photons as usize];
        (stage.status, stage.why.clone())
    };
    let first = reason(None);
    assert_eq!(first, (StageStatus::Skipped, reasons::NO_SPECULAR_SURFACES.to_owned()));
    assert_ne!(reason(Some(crate::scene::description::Integrator::Path)), first);
    assert_eq!(reason(None), first);
}
