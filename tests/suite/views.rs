//! Pixel values of the views.

use super::test_dir::TestDir;

/// RGB pixels of a float image.
fn floats(dir: &TestDir, name: &str) -> Vec<[f32; 3]> {
    let picture = image::open(dir.path(name)).expect("a float picture").into_rgb32f();
    picture.pixels().map(|pixel| pixel.0).collect()
}

#[test]
fn bundled_scene_components_add_up() {
    let dir = TestDir::new();
    // Skip scenes with generated meshes.
    for scene in [
        "cornell",
        "cornell_glass",
        "dof",
        "leaves",
        "mesh",
        "normal_map",
        "orbiter",
        "phong",
        "refraction",
        "shadows",
        "shapes",
        "spheres",
        "sun",
        "lamps",
        "environment",
        "textures",
    ] {
        let path = format!("{}/scenes/{scene}.toml", env!("CARGO_MANIFEST_DIR"));
        let view = |view: &str| {
            dir.expect(
                &format!("{path} --once --width 36 --height 27 --samples 2 --view {view} -o {view}.exr"),
                0,
            );
            floats(&dir, &format!("{view}.exr"))
        };
        let beauty = view("beauty");
        let parts = ["ambient", "diffuse", "specular", "emission"].map(view);
        for (pixel, beauty) in beauty.iter().enumerate() {
            for channel in 0..3 {
                let sum: f64 = parts.iter().map(|part| f64::from(part[pixel][channel])).sum();
                let whole = f64::from(beauty[channel]);
                assert!(
                    (sum - whole).abs() <= 1e-5 * whole.max(1.0),
                    "{scene}, {pixel}: {sum}, expected {whole}"
                );
            }
        }
        assert!(beauty.iter().any(|pixel| pixel[0] > 0.01), "{scene}: the image is black");
    }
}

#[test]
fn depth_is_metric_only_in_float_files() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once --samples 16 --view depth -o depth.exr -o depth.png", 0);
    let depths: Vec<f32> = floats(&dir, "depth.exr").iter().map(|pixel| pixel[0]).collect();
    // The front of the ball is at depth 3.5. The rim is slightly closer than the center, which is at depth 4.
    // Nothing is behind the ball.
    let middle = depths[12 * 32 + 16];
    assert!((middle - 3.505).abs() < 0.006, "{middle}");
    assert_eq!(depths[0], 0.0);
    assert!(depths.iter().all(|&depth| depth < 4.0));
    let shown = image::open(dir.path("depth.png")).expect("a picture").into_rgb8();
    let at = |x, y| shown.get_pixel(x, y).0[0];
    let brightest = shown.pixels().map(|pixel| pixel.0[0]).max();
    assert_eq!((brightest, at(0, 0)), (Some(255), 0), "near must be bright, empty space black");
    assert!(at(16, 12) > 200, "{}", at(16, 12));
}

/// Text chunks of a PNG.
fn notes(dir: &TestDir, name: &str) -> Vec<(String, String)> {
    let file = std::io::BufReader::new(std::fs::File::open(dir.path(name)).expect("a file"));
    let reader = png::Decoder::new(file).read_info().expect("a PNG");
    let texts =
        reader.info().uncompressed_latin1_text.iter().map(|text| (text.keyword.clone(), text.text.clone()));
    texts
        .chain(
            reader.info().utf8_text.iter().map(|text| (text.keyword.clone(), text.get_text().expect("text"))),
        )
        .collect()
}

#[test]
fn infinite_floor_keeps_near_depth_contrast() {
    let dir = TestDir::new();
    let floor = "[[plane]]\nnormal = [0, 1, 0]\npoint = [0, 0.4, 0]\nmaterial = \"ball\"\n";
    dir.write("floor.toml", format!("{}{floor}", super::test_dir::SCENE));
    let report = dir.report("floor.toml --view depth -o depth.png -o depth.exr");
    let range = report["image"]["range"].as_array().expect("near and far").clone();
    let (near, far) = (range[0].as_f64().expect("near"), range[1].as_f64().expect("far"));
    let depths: Vec<f32> = floats(&dir, "depth.exr").iter().map(|pixel| pixel[0]).collect();
    assert!(near < 2.0 && far > 10.0, "{near} {far}");
    // Points near the horizon are arbitrarily far away, so some are beyond the range.
    let end = far as f32;
    assert!(depths.iter().any(|&depth| depth > end) && depths.contains(&end));
    assert!(notes(&dir, "depth.png").contains(&("glimt:range".to_owned(), format!("{near} to {far}"))));
    // On a linear scale, the ball at 3.5 and the floor next to it at 5.7 would differ by 37 shades.
    let shown = image::open(dir.path("depth.png")).expect("a picture").into_rgb8();
    let at = |x, y| i32::from(shown.get_pixel(x, y).0[0]);
    assert!(at(16, 13) - at(2, 15) > 42, "{} {}", at(16, 13), at(2, 15));
    let beauty = dir.report("floor.toml -o beauty.png");
    assert!(beauty["image"]["range"].is_null());
}

#[test]
fn sample_and_error_views_are_per_pixel() {
    let dir = TestDir::new();
    let report = dir.report("ball.toml --samples 5 --view samples -o samples.exr -o samples.png");
    assert_eq!(report["image"]["range"], serde_json::json!([0.0, 5.0]));
    assert!(floats(&dir, "samples.exr").iter().all(|pixel| *pixel == [5.0; 3]));
    let white = image::open(dir.path("samples.png")).expect("a picture").into_rgb8();
    assert!(white.pixels().all(|pixel| pixel.0 == [255; 3]));
    dir.expect("ball.toml --once --samples 16 --view error -o error.exr", 0);
    let errors = floats(&dir, "error.exr");
    assert_eq!(errors[0], [0.0; 3], "equal samples must have no error");
    assert!(errors.iter().any(|pixel| pixel[0] > 1e-3), "the ball's silhouette must have an error");
    assert!(errors.iter().all(|pixel| pixel[0].is_finite() && pixel[0] < 0.5));
}
