//! Lenses, fields of view, cameras inside and on objects, extreme image sizes.

use super::{CAMERA, CaseSet, SceneFiles, StressRow, furnace, head, signs};

/// A white surface. Under uniform light with radiance 1, its radiance is 1.
const WHITE: &str =
    "[materials.w]\ndiffuse = 1\n[[sphere]]\ncenter = [0, 0, -5]\nradius = 1\nmaterial = \"w\"\n";

pub(super) fn rows(_: CaseSet) -> Vec<StressRow> {
    let mut rows = Vec::new();
    let plain = signs("", CAMERA, "");
    rows.push(
        StressRow::matching(
            "aperture 0 vs. no lens",
            vec![(signs("", &with("aperture = 0\nfocus = 3"), ""), plain.clone())],
            0.0,
        )
        .timed(),
    );
    rows.push(
        StressRow::matching(
            "aperture 1e-12 vs. no lens",
            vec![(signs("", &with("aperture = 1e-12"), ""), plain.clone())],
            1e-3,
        )
        .timed(),
    );
    let white = |camera: &str| (furnace(64, camera, WHITE), furnace(64, CAMERA, WHITE));
    rows.push(
        StressRow::mean(
            "white ball, aperture as large as the scene",
            white(&with("aperture = 8")),
            1.0,
            1e-2,
        )
        .timed(),
    );
    rows.push(
        StressRow::mean("white ball, field of view of 179°", white(&with("fov = 179")), 1.0, 1e-2).timed(),
    );
    rows.extend([1e-3, 179.0].map(angle_of_view));
    for (name, place) in [("glass with IOR 1", "1"), ("glass with IOR 1.000001", "1.000001")] {
        let ball = glass_around_camera(place);
        let pairs = vec![(signs("", CAMERA, &ball), plain.clone())];
        rows.push(StressRow::matching(format!("camera in {name} vs. air"), pairs, 1e-3));
        let white = (furnace(64, CAMERA, &ball), furnace(64, CAMERA, &glass_around_camera("1.5")));
        rows.push(StressRow::mean(format!("camera in {name} under uniform light"), white, 1.0, 1e-3).timed());
    }
    let inside = (furnace(64, CAMERA, &glass_around_camera("1.5")), furnace(64, CAMERA, WHITE));
    rows.push(StressRow::mean("camera in glass with IOR 1.5 under uniform light", inside, 1.0, 1e-3));
    let black = "[materials.k]\ndiffuse = 0\n";
    for (name, thing) in [
        ("sphere", "[[sphere]]\ncenter = [0, 0, 1]\nradius = 1"),
        ("box", "[[box]]\ncenter = [0, 0, 1]\nsize = [2, 2, 2]"),
        ("quad", "[[quad]]\ncorner = [-1, -1, 0]\nu = [2, 0, 0]\nv = [0, 2, 0]"),
        ("plane", "[[plane]]\npoint = [1, 1, 0]\nnormal = [0, 0, 1]"),
        ("cylinder", "[[cylinder]]\na = [-1, 0, 1]\nb = [1, 0, 1]\nradius = 1"),
        ("cone", "[[cone]]\nbase = [0, 0, 1]\ntip = [0, 0, 0]\nradius = 1"),
        ("torus", "[[torus]]\ncenter = [0, 0, 1]\naxis = [1, 0, 0]\nradius = 0.75\ntube = 0.25"),
        ("triangle", "[[triangle]]\na = [-1, -1, 0]\nb = [1, -1, 0]\nc = [0, 1, 0]"),
        ("disk", "[[disk]]\ncenter = [0, 0, 0]\nnormal = [0, 0, 1]\nradius = 1"),
    ] {
        let picture = |z: f64| {
            let camera = format!("[camera]\nposition = [0, 0, {z:?}]\nlook_at = [0, 0, -5]\n");
            signs("", &camera, &format!("{black}{thing}\nmaterial = \"k\"\n"))
        };
        rows.push(StressRow::matching(
            format!("camera on a {name} vs. no {name}"),
            vec![(picture(0.0), plain.clone())],
            0.0,
        ));
        // The reference must also include the cost of the invisible object, so place its camera as close in
        // front of the object as single precision allows.
        let beside = vec![(picture(0.0), picture(-2_f64.powi(-20)))];
        rows.push(
            StressRow::matching(format!("camera on a {name} vs. in front of it"), beside, 1e-3).timed(),
        );
    }
    rows.extend(images());
    rows
}

fn with(key: &str) -> String {
    format!("{CAMERA}{key}\n")
}

fn glass_around_camera(ior: &str) -> String {
    format!(
        "[materials.g]\ntype = \"glass\"\nior = {ior}\n[[sphere]]\ncenter = [0.1, 0, 0]\nradius = 0.5\nmaterial = \"g\"\n"
    )
}

/// At distance d, the image covers a height of 2 d tan(fov / 2). Compares a wall at this field of view with
/// the same wall at 40°.
fn angle_of_view(fov: f64) -> StressRow {
    let distance = |fov: f64| 1.0 / (0.5 * fov.to_radians()).tan();
    let picture = |fov: f64| {
        let camera =
            format!("[camera]\nposition = [0, 0, {:?}]\nlook_at = [0, 0, 0]\nfov = {fov:?}\n", distance(fov));
        let wall = r#"
[materials]
red = { diffuse = 0, emission = [0.9, 0.2, 0.1] }
blue = { diffuse = 0, emission = [0.2, 0.3, 1.0] }
[[disk]]
center = [0.2, 0.1, 0]
normal = [0, 0, 1]
radius = 0.6
material = "red"
[[triangle]]
a = [-1.2, -0.9, 0]
b = [-0.3, -0.8, 0]
c = [-0.7, 0.9, 0]
material = "blue"
"#;
        SceneFiles::new(head(64, "") + &camera + wall)
    };
    let name = format!("wall at a field of view of {fov}° vs. 40°");
    StressRow::matching(name, vec![(picture(fov), picture(40.0))], 1e-3).timed()
}

/// A sphere with reflectance ρ around the camera and a point light with intensity I. Every pixel has radiance
/// ρ I / (π R²), here 1.
fn images() -> Vec<StressRow> {
    let around =
        "[materials.w]\ndiffuse = 0.5\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 5\nmaterial = \"w\"\n";
    let light = format!("[[light]]\nposition = [0, 0, 0]\nintensity = {:?}\n", 50.0 * std::f64::consts::PI);
    let sized = |width: u32, height: u32, samples: u32| {
        let render = format!("[render]\nwidth = {width}\nheight = {height}\nsamples = {samples}\n");
        SceneFiles::new(render + CAMERA + around + &light)
    };
    let row = |(width, height, samples)| {
        let name = format!("{width} × {height} image at {samples} spp vs. 256 × 256 at 1 spp");
        StressRow::mean(name, (sized(width, height, samples), sized(256, 256, 1)), 1.0, 1e-5).timed()
    };
    [(1, 1, 65_536), (65_536, 1, 1), (1, 65_536, 1)].map(row).into()
}
