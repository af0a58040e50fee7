//! What the views of a picture hold.

use super::desk::Desk;

/// Red, green and blue of each pixel of a float picture.
fn floats(desk: &Desk, name: &str) -> Vec<[f32; 3]> {
    let picture = image::open(desk.path(name)).expect("a float picture").into_rgb32f();
    picture.pixels().map(|pixel| pixel.0).collect()
}

#[test]
fn the_parts_of_every_bundled_scene_add_up_to_its_picture() {
    let desk = Desk::new();
    // But for a million triangles, whose mesh is generated first.
    for scene in [
        "cornell",
        "cornell_glass",
        "dof",
        "mesh",
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
            desk.expect(
                &format!("{path} --once --width 36 --height 27 --samples 2 --view {view} -o {view}.exr"),
                0,
            );
            floats(&desk, &format!("{view}.exr"))
        };
        let beauty = view("beauty");
        let parts = ["ambient", "diffuse", "specular", "emission"].map(view);
        for (pixel, beauty) in beauty.iter().enumerate() {
            for channel in 0..3 {
                let sum: f64 = parts.iter().map(|part| f64::from(part[pixel][channel])).sum();
                let whole = f64::from(beauty[channel]);
                assert!(
                    (sum - whole).abs() <= 1e-5 * whole.max(1.0),
                    "{scene}, {pixel}: {sum} is not {whole}"
                );
            }
        }
        assert!(beauty.iter().any(|pixel| pixel[0] > 0.01), "{scene}: something is seen");
    }
}

#[test]
fn depth_is_a_distance_in_float_files_and_stretched_in_others() {
    let desk = Desk::new();
    desk.expect("ball.toml --once --samples 16 --view depth -o depth.exr -o depth.png", 0);
    let depths: Vec<f32> = floats(&desk, "depth.exr").iter().map(|pixel| pixel[0]).collect();
    // The ball's front is 3.5 before the eye, its rim a little nearer than its middle at 4; behind it there is nothing.
    let middle = depths[12 * 32 + 16];
    assert!((middle - 3.505).abs() < 0.006, "{middle}");
    assert_eq!(depths[0], 0.0);
    assert!(depths.iter().all(|&depth| depth < 4.0));
    let shown = image::open(desk.path("depth.png")).expect("a picture").into_rgb8();
    let at = |x, y| shown.get_pixel(x, y).0[0];
    let brightest = shown.pixels().map(|pixel| pixel.0[0]).max();
    assert_eq!((brightest, at(0, 0)), (Some(255), 0), "near is bright, nothing is black");
    assert!(at(16, 12) > 200, "{}", at(16, 12));
}
