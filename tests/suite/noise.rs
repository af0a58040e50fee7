//! Compares the reported, stored and requested noise with the actual noise, measured as the spread over many
//! seeds.

use std::fs;

use serde_json::Value;

use super::test_dir::TestDir;

const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Image width and height. Both are whole numbers of tiles.
const SIZE: [usize; 2] = [64, 32];

const HEAD: &str = r#"[render]
width = 64
height = 32
[camera]
position = [0, 1.2, 3]
look_at = [0, 0.3, 0]
fov = 35
"#;

/// Soft shadows and indirect light from a wall.
const PENUMBRA: &str = r#"
[materials]
wall = { diffuse = [0.7, 0.7, 0.7] }
lamp = { emission = [8, 8, 8] }
[[plane]]
material = "wall"
[[sphere]]
center = [0, 0.3, 0]
radius = 0.3
material = "wall"
[[quad]]
corner = [-2, 0, -1]
u = [4, 0, 0]
v = [0, 3, 0]
material = "wall"
[[sphere]]
center = [1.5, 2.5, 0.5]
radius = 0.4
material = "lamp"
"#;

/// A caustic on the floor, which path tracing rarely finds. The ball and the light are outside the image.
const CAUSTIC: &str = r#"
[materials]
wall = { diffuse = [0.7, 0.7, 0.7] }
ball = { type = "glass", ior = 1.5 }
lamp = { emission = [60, 60, 60] }
[[plane]]
material = "wall"
[[sphere]]
center = [0, 1.75, 0]
radius = 0.35
material = "ball"
[[sphere]]
center = [0, 2.9, 0]
radius = 0.2
material = "lamp"
"#;

/// A ball with the specified shininess and surroundings.
fn ball(around: &str, shininess: u32) -> String {
    format!(
        r#"{HEAD}{around}
[materials]
ball = {{ diffuse = [0.2, 0.2, 0.2], specular = [0.6, 0.6, 0.6], shininess = {shininess} }}
[[sphere]]
center = [0, 0.3, 0]
radius = 0.8
material = "ball"
"#
    )
}

fn dir(scene: &str) -> TestDir {
    let dir = TestDir::new();
    dir.write("scene.toml", scene);
    dir.write("sky.ppm", "P3 4 3 255 90 120 200 20 30 40 255 250 200 70 70 80 60 80 90 0 0 0 9 9 9 200 90 60 30 20 10 8 9 7 6 5 4 1 2 3");
    dir
}

/// Renders an image. Returns its luminances and the error from its report.
fn render(dir: &TestDir, options: &str) -> (Vec<f64>, f64) {
    let output = dir.run(&format!("scene.toml --once --progress none -o a.exr --report a.json {options}"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value =
        serde_json::from_slice(&fs::read(dir.path("a.json")).expect("a report")).expect("JSON");
    let picture = image::open(dir.path("a.exr")).expect("a picture").to_rgb32f();
    let luminance =
        |pixel: &[f32]| pixel.iter().zip(LUMINANCE).map(|(value, weight)| f64::from(*value) * weight).sum();
    (
        picture.as_raw().chunks_exact(3).map(luminance).collect(),
        report["image"]["error"].as_f64().expect("an error"),
    )
}

/// Statistics over several seeds: the mean and variance of each pixel, and the RMS of the reported errors.
struct SeedStatistics {
    means: Vec<f64>,
    variances: Vec<f64>,
    reported: f64,
}

impl SeedStatistics {
    fn of(dir: &TestDir, count: u32, options: &str) -> Self {
        let runs: Vec<_> = (1..=count).map(|seed| render(dir, &format!("--seed {seed} {options}"))).collect();
        let count = f64::from(count);
        let pixels = 0..runs[0].0.len();
        let means: Vec<f64> = pixels
            .clone()
            .map(|pixel| runs.iter().map(|(picture, _)| picture[pixel]).sum::<f64>() / count)
            .collect();
        let variance = |pixel: usize| {
            let square = |(picture, _): &(Vec<f64>, f64)| (picture[pixel] - means[pixel]).powi(2);
            runs.iter().map(square).sum::<f64>() / (count - 1.0)
        };
        let reported = (runs.iter().map(|(_, error)| error * error).sum::<f64>() / count).sqrt();
        Self { variances: pixels.map(variance).collect(), means, reported }
    }

    fn mean(&self) -> f64 {
        self.means.iter().sum::<f64>() / self.means.len() as f64
    }

    fn variance(&self) -> f64 {
        self.variances.iter().sum::<f64>() / self.variances.len() as f64
    }

    /// Actual relative error of the image.
    fn error(&self) -> f64 {
        self.variance().sqrt() / self.mean()
    }

    /// Actual relative error of each tile.
    fn tiles(&self) -> Vec<f64> {
        const TILE: usize = 32;
        let of = |values: &[f64], tile: usize| {
            let rows = values.chunks_exact(SIZE[0]).map(|row| row[TILE * tile..][..TILE].iter().sum::<f64>());
            rows.sum::<f64>() / (TILE * TILE) as f64
        };
        (0..SIZE[0] / TILE).map(|tile| of(&self.variances, tile).sqrt() / of(&self.means, tile)).collect()
    }
}

#[test]
fn reported_error_matches_actual_error() {
    for (name, scene) in [("penumbra", PENUMBRA), ("caustic", CAUSTIC)] {
        let dir = dir(&format!("{HEAD}{scene}"));
        for samples in [16, 64] {
            let seeds = SeedStatistics::of(&dir, 24, &format!("--integrator path --samples {samples}"));
            let ratio = seeds.reported / seeds.error();
            assert!((0.9..1.35).contains(&ratio), "{name}, {samples} samples: {ratio}");
        }
    }
}

#[test]
fn stopped_tiles_reach_the_noise_target() {
    for (name, scene, error) in [("penumbra", PENUMBRA, 0.05), ("caustic", CAUSTIC, 0.4)] {
        let dir = dir(&format!("{HEAD}{scene}"));
        let seeds =
            SeedStatistics::of(&dir, 24, &format!("--integrator path --samples 4096 --error {error}"));
        let tiles = seeds.tiles();
        let parts =
            (tiles.iter().map(|tile| (tile / error).powi(2)).sum::<f64>() / tiles.len() as f64).sqrt();
        assert!((0.5..1.1).contains(&parts), "{name}: {parts} times the target");
    }
}

#[test]
fn whitted_glossy_noise_matches_path() {
    const WIDE_SUN: &str =
        "[[light]]\ntype = \"directional\"\ndirection = [-0.3, -0.4, -1]\nirradiance = [3, 3, 3]\nangle = 60";
    let skies = ["[environment]\ncolor = [1, 1, 1]", "[environment]\nfile = \"sky.ppm\"", WIDE_SUN];
    for sky in skies {
        for shininess in [5, 60, 99, 300] {
            let dir = dir(&ball(sky, shininess));
            let [whitted, path] = ["whitted", "path"].map(|integrator| {
                SeedStatistics::of(&dir, 8, &format!("--samples 16 --integrator {integrator}"))
            });
            let ratio = whitted.variance() / path.variance();
            assert!(ratio <= 2.0, "{sky}, shininess {shininess}: {ratio} times the variance");
            let error = ((whitted.variance() + path.variance()) / 8.0 / whitted.means.len() as f64).sqrt();
            let difference = whitted.mean() - path.mean();
            assert!(error < 6e-3 * path.mean(), "{sky}, shininess {shininess}: too noisy: ± {error}");
            assert!(difference.abs() < 5.0 * error, "{sky}, shininess {shininess}: {difference} ± {error}");
        }
    }
}

#[test]
fn negative_filter_lobes_preserve_the_mean() {
    let smooth = dir(&format!("{HEAD}{PENUMBRA}"));
    let of = |filter: &str| {
        SeedStatistics::of(
            &smooth,
            16,
            &format!("--integrator path --samples 8 --set render.filter={filter}"),
        )
    };
    let [mitchell, plain] = ["mitchell", "box"].map(of);
    let pixels = (16 * plain.means.len()) as f64;
    let error = ((mitchell.variance() + plain.variance()) / pixels).sqrt();
    let difference = mitchell.mean() - plain.mean();
    assert!(error < 5e-3 * plain.mean(), "too noisy: ± {error} of {}", plain.mean());
    assert!(difference.abs() < 4.0 * error, "{difference} ± {error} of {}", plain.mean());
    let fireflies = dir(&format!("{HEAD}{CAUSTIC}"));
    let (picture, _) = render(&fireflies, "--integrator path --samples 8 --set render.filter=mitchell");
    assert!(picture.iter().any(|luminance| *luminance < 0.0), "the file must keep negative values");
}
