//! Tests for adaptive sampling, which stops tiles early once their noise is low enough.

use super::Bench;
use crate::protocol::{NormalizedRect, Stage, reasons};

/// An area light above a floor with a ball. Some tiles contain penumbras, and others have almost no noise.
const LIT: &str = r#"
[render]
width = 128
height = 96
samples = 256
error = 0.02
[camera]
position = [0, 3, 6]
look_at = [0, 0.5, 0]
[materials.wall]
diffuse = [0.5, 0.5, 0.5]
[materials.lamp]
emission = [9, 9, 9]
[[quad]]
corner = [-8, 0, 8]
u = [16, 0, 0]
v = [0, 0, -16]
material = "wall"
[[sphere]]
center = [0, 0.7, 0]
radius = 0.7
material = "wall"
[[quad]]
corner = [-1, 4, -1]
u = [2, 0, 0]
v = [0, 0, 2]
material = "lamp"
"#;

#[test]
fn only_smooth_tiles_stop_early() {
    let mut bench = Bench::new(LIT);
    let report = bench.done().0;
    assert_eq!(report.image.samples.min, 16);
    assert!(report.image.samples.max > 32, "{:?}", report.image.samples);
    assert!(report.image.complete);
    let why = &report.stages[Stage::Render as usize].why;
    assert!(why.starts_with(reasons::NOISE_TARGET_REACHED), "{why}");
    bench.overrides.error = Some(0.0);
    let report = bench.done().0;
    assert_eq!((report.image.samples.min, report.image.samples.max), (256, 256));
}

#[test]
fn image_does_not_depend_on_threads_or_history() {
    let mut pictures = Vec::new();
    for threads in [1, 2, 7] {
        let mut bench = Bench::new(LIT);
        bench.overrides.threads = Some(threads);
        bench.done();
        pictures.push(bench.picture());
    }
    // Increase the sample count in several steps, not all of which are powers of two.
    let mut bench = Bench::new(LIT);
    for samples in [16, 40, 256] {
        bench.overrides.samples = Some(samples);
        bench.done();
    }
    pictures.push(bench.picture());
    // Render a region first.
    let mut bench = Bench::new(LIT);
    bench.first = Some(NormalizedRect { left: 0.3, top: 0.2, width: 0.3, height: 0.4 });
    bench.done();
    pictures.push(bench.picture());
    assert!(pictures.iter().all(|picture| *picture == pictures[0]));
}

#[test]
fn time_limit_favors_noisy_parts() {
    let mut bench = Bench::new(&LIT.replace("error = 0.02", "error = 0"));
    bench.overrides.samples = Some(1 << 20);
    let samples = [0.2, 0.8, 3.2, 12.8, 51.2].into_iter().find_map(|seconds| {
        bench.overrides.time_seconds = Some(seconds);
        let samples = bench.done().0.image.samples;
        (samples.mean > 100.0).then_some(samples)
    });
    let samples = samples.expect("the machine should be fast enough");
    assert!(samples.min >= 4 && samples.max >= 8 * samples.min, "{samples:?}");
}

#[test]
fn generous_time_limit_does_not_change_image() {
    let mut bench = Bench::new(&LIT.replace("error = 0.02", "error = 0"));
    bench.overrides.samples = Some(100);
    bench.done();
    let expected = bench.picture();
    for threads in [1, 2, 7] {
        let mut bench = Bench::new(&LIT.replace("error = 0.02", "error = 0"));
        bench.overrides.samples = Some(100);
        bench.overrides.threads = Some(threads);
        bench.overrides.time_seconds = Some(1e4);
        let report = bench.done().0;
        assert!(report.image.complete);
        assert_eq!((report.image.samples.min, report.image.samples.max), (100, 100));
        assert_eq!(bench.picture(), expected);
    }
}
