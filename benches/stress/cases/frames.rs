//! Scaled and moved copies of scenes, which must give the same image.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use super::super::frame::Frame;
use super::{CaseSet, SceneFiles, StressRow};

/// Upper bound on the difference between the images of a scene and of a moved copy.
const MOVED: f64 = 1e-3;

/// Samples per pixel.
const SAMPLES: u32 = 4;

pub(super) fn rows(extent: CaseSet) -> Vec<StressRow> {
    let mut rows = Vec::new();
    let (steps, distances): (Vec<i32>, &[f64]) = match extent {
        CaseSet::Short => (vec![-30, -7, 30], &[1e8]),
        CaseSet::Long => ((-30..=30).filter(|k| *k != 0).collect(), &[1e2, 1e4, 1e6, 1e8]),
    };
    let settings = [
        ("whitted, bvh", "accel = \"bvh\""),
        ("whitted, kd-tree", "accel = \"kdtree\""),
        ("path, bvh", "integrator = \"path\""),
        ("path, kd-tree", "integrator = \"path\"\naccel = \"kdtree\""),
        ("photons", PHOTONS),
        ("lens", "LENS"),
        ("64 lights", "LAMPS"),
    ];
    // In a moved scene, rounding occasionally selects a different light from the tree or a different photon
    // for a kernel, which changes individual samples. Scenes with many lights therefore run only in the long
    // variant, where they get more samples.
    let settings = settings.iter().filter(|(_, setting)| extent == CaseSet::Long || *setting != "LAMPS");
    for &(name, setting) in settings {
        let is_picking = setting == PHOTONS || setting == "LAMPS";
        let moved_samples = if is_picking && extent == CaseSet::Long { 16 * SAMPLES } else { SAMPLES };
        let twins = |frames: Vec<Frame>, samples| {
            let scene = move |frame: Frame| everything(frame, setting, samples);
            frames.into_iter().map(move |frame| (scene(frame), scene(Frame::PLAIN)))
        };
        let scaled = twins(steps.iter().map(|&k| Frame::scaled(k)).collect(), SAMPLES);
        rows.push(StressRow::matching(
            format!("scene scaled by 2^−30 … 2^30, {name}"),
            scaled.collect(),
            0.0,
        ));
        for &sizes in distances {
            let moved = twins(vec![Frame::moved(sizes)], moved_samples).collect();
            rows.push(StressRow::matching(
                format!("scene moved by {sizes:e} times its size, {name}"),
                moved,
                MOVED,
            ));
        }
    }
    rows.extend(shape_rows(extent));
    rows.extend(light_rows(extent));
    rows.extend(["obj", "off", "ply"].map(georeferenced));
    rows
}

/// Placeholder for photon settings.
const PHOTONS: &str = "PHOTONS";

/// Every shape with every material and both acceleration structures, far from the origin. The long variant
/// also scales the scenes.
fn shape_rows(extent: CaseSet) -> Vec<StressRow> {
    let trees: &[&str] = if extent == CaseSet::Short { &["bvh"] } else { &["bvh", "kdtree"] };
    let one = |shape: &str| {
        // A plane cannot be a light, and its texture repeats once per unit of length at every scale.
        let materials = MATERIALS.iter().filter(|name| shape != "plane" || !["lamp", "tiles"].contains(name));
        let both = materials.flat_map(|name| trees.iter().map(move |tree| (*name, *tree)));
        both.collect::<Vec<_>>()
    };
    let pairs = |shape: &str, frame: Frame| {
        let picture = |frame, material: &str, tree: &str| {
            let render = super::head(4, &format!("background = [0.25, 0.25, 0.25]\naccel = \"{tree}\""));
            let scene = around(frame, &shape_of(shape, frame, material)) + &lights_of(frame, &LIGHTS[..3]);
            with_files(&(render + &camera(frame, "") + &scene))
        };
        let twin = |(material, tree)| (picture(frame, material, tree), picture(Frame::PLAIN, material, tree));
        one(shape).into_iter().map(twin).collect::<Vec<_>>()
    };
    let mut rows = Vec::new();
    for shape in SHAPES {
        rows.push(StressRow::matching(
            format!("{shape} with every material, moved by 1e8 times the scene size"),
            pairs(shape, Frame::moved(1e8)),
            MOVED,
        ));
        if extent == CaseSet::Long {
            let scaled = [-30, -11, 7, 30].into_iter().flat_map(|k| pairs(shape, Frame::scaled(k)));
            rows.push(StressRow::matching(
                format!("{shape} with every material, scaled by 2^−30 … 2^30"),
                scaled.collect(),
                0.0,
            ));
        }
    }
    rows
}

/// Scenes with a single light, moved and scaled.
fn light_rows(extent: CaseSet) -> Vec<StressRow> {
    let integrators: &[&str] = if extent == CaseSet::Short { &["whitted"] } else { &["whitted", "path"] };
    let picture = |frame, light: &str, integrator: &str| {
        let scene = around(frame, &shape_of("sphere", frame, "gloss")) + &lights_of(frame, &[light]);
        with_files(&(super::head(4, &format!("integrator = \"{integrator}\"")) + &camera(frame, "") + &scene))
    };
    let rows = LIGHTS.iter().flat_map(|&light| {
        let pairs = |frames: &[Frame]| {
            let both = frames.iter().flat_map(|&frame| integrators.iter().map(move |one| (frame, *one)));
            both.map(|(frame, one)| (picture(frame, light, one), picture(Frame::PLAIN, light, one))).collect()
        };
        let moved = pairs(&[Frame::moved(1e8)]);
        let scaled = pairs(&[Frame::scaled(-30), Frame::scaled(30)]);
        [
            StressRow::matching(format!("light: {light}, moved by 1e8 times the scene size"), moved, MOVED),
            StressRow::matching(format!("light: {light}, scaled by 2^−30 and 2^30"), scaled, 0.0),
        ]
    });
    rows.collect()
}

/// A mesh file with vertices 1e8 times the scene size from the origin.
fn georeferenced(ending: &'static str) -> StressRow {
    let name = match ending {
        "obj" => "far.obj",
        "off" => "far.off",
        _ => "far.ply",
    };
    let picture = |frame: Frame| {
        let mesh = format!("[[mesh]]\nfile = \"{name}\"\nmaterial = \"gloss\"\n");
        let scene =
            super::head(4, "") + &camera(frame, "") + &around(frame, &mesh) + &lights_of(frame, &LIGHTS[..2]);
        with_files(&scene).with(name, ball(ending, frame, [0.0, 0.0, -5.0], 0.75))
    };
    let pairs = vec![(picture(Frame::moved(1e8)), picture(Frame::PLAIN))];
    let title = format!(".{ending} mesh with vertices 1e8 times the scene size from the origin");
    StressRow::matching(title, pairs, MOVED)
}

const SHAPES: [&str; 10] =
    ["sphere", "quad", "plane", "box", "triangle", "disk", "cylinder", "cone", "torus", "mesh"];

const MATERIALS: [&str; 6] = ["matte", "gloss", "mirror", "glass", "lamp", "tiles"];

const LIGHTS: [&str; 9] = [
    "point",
    "spot",
    "directional",
    "point without falloff",
    "sun",
    "constant sky",
    "sky with an image",
    "quad",
    "sphere",
];

const TABLES: &str = r#"
[textures.tiles]
file = "tiles.ppm"
[textures.bumps]
file = "tiles.ppm"
[materials]
matte = { diffuse = 0.5 }
gloss = { diffuse = 0.4, specular = 0.3, shininess = 20 }
mirror = { type = "mirror" }
glass = { type = "glass" }
lamp = { diffuse = 0, emission = 0.5 }
tiles = { diffuse = { texture = "tiles" }, normal_map = "bumps", normal_strength = 0.2 }
"#;

fn camera(frame: Frame, more: &str) -> String {
    let (from, to) = (frame.point(0.125, 0.25, 0.5), frame.point(0.0, 0.0, -5.0));
    format!("[camera]\nposition = {from}\nlook_at = {to}\nfov = 50\n{more}\n")
}

/// A shape above a floor.
fn around(frame: Frame, shape: &str) -> String {
    let floor = (frame.point(-4.0, -1.0, 0.0), frame.vector(8.0, 0.0, 0.0), frame.vector(0.0, 0.0, -8.0));
    let (corner, u, v) = floor;
    format!("{TABLES}[[quad]]\ncorner = {corner}\nu = {u}\nv = {v}\nmaterial = \"matte\"\n{shape}")
}

fn shape_of(shape: &str, frame: Frame, material: &str) -> String {
    let (p, w, l) = (|x, y, z| frame.point(x, y, z), |x, y, z| frame.vector(x, y, z), |x| frame.length(x));
    let rest = match shape {
        "sphere" => format!("center = {}\nradius = {}", p(0.0, 0.0, -5.0), l(0.75)),
        "quad" => {
            format!("corner = {}\nu = {}\nv = {}", p(-1.0, -0.7, -5.5), w(2.0, 0.0, 0.25), w(0.25, 1.5, 0.0))
        }
        "plane" => format!("point = {}\nnormal = [0, 0.25, 1]", p(0.3, 0.0, -6.0)),
        "box" => {
            format!("center = {}\nsize = {}\nrotate = [20, 30, 10]", p(0.0, 0.0, -5.0), w(0.8, 1.0, 0.7))
        }
        "triangle" => {
            format!("a = {}\nb = {}\nc = {}", p(-1.0, -0.6, -5.0), p(1.2, -0.5, -5.1), p(0.1, 1.0, -5.6))
        }
        "disk" => format!("center = {}\nnormal = [1, 0.5, 2]\nradius = {}", p(0.0, 0.0, -5.0), l(0.875)),
        "cylinder" => {
            format!("a = {}\nb = {}\nradius = {}", p(-0.6, -0.4, -5.0), p(0.6, 0.5, -5.3), l(0.375))
        }
        "cone" => {
            format!("base = {}\ntip = {}\nradius = {}", p(0.0, -0.7, -5.0), p(0.2, 0.9, -5.2), l(0.625))
        }
        "torus" => format!(
            "center = {}\naxis = [0.25, 0.5, 1]\nradius = {}\ntube = {}",
            p(0.0, 0.0, -5.0),
            l(0.625),
            l(0.25)
        ),
        _ => format!("file = \"ball.obj\"\nscale = {}\ntranslate = {}", l(0.75), p(0.0, 0.0, -5.0)),
    };
    format!("[[{shape}]]\n{rest}\nmaterial = \"{material}\"\n")
}

fn lights_of(frame: Frame, lights: &[&str]) -> String {
    let (p, l) = (|x, y, z| frame.point(x, y, z), |x| frame.length(x));
    let (above, intensity) = (p(-1.5, 3.0, -3.0), frame.intensity(0.75));
    let one = |light: &str| match light {
        "point" => format!("[[light]]\nposition = {above}\nintensity = {intensity}\n"),
        "spot" => format!(
            "[[light]]\ntype = \"spot\"\nposition = {}\nlook_at = {}\nangle = 50\nintensity = {intensity}\n",
            p(2.0, 3.0, -4.0),
            p(0.0, -0.5, -5.0)
        ),
        "directional" => {
            "[[light]]\ntype = \"directional\"\ndirection = [0.5, -1, -0.75]\nirradiance = 0.1\n".to_owned()
        }
        "point without falloff" => {
            format!("[[light]]\nposition = {above}\nintensity = 0.1\nfalloff = \"none\"\n")
        }
        "sun" => {
            "[[light]]\ntype = \"directional\"\ndirection = [0.5, -1, -0.75]\nirradiance = 0.1\nangle = 5\n"
                .to_owned()
        }
        "constant sky" => "[environment]\ncolor = [0.1, 0.2, 0.3]\n".to_owned(),
        "sky with an image" => "[environment]\nfile = \"tiles.ppm\"\n".to_owned(),
        "quad" => format!(
            "[[quad]]\ncorner = {}\nu = {}\nv = {}\nmaterial = \"lamp\"\n",
            p(-0.5, 2.0, -5.5),
            frame.vector(1.0, 0.0, 0.0),
            frame.vector(0.0, 0.0, 1.0)
        ),
        _ => {
            format!("[[sphere]]\ncenter = {}\nradius = {}\nmaterial = \"lamp\"\n", p(1.5, 2.0, -4.0), l(0.25))
        }
    };
    lights.iter().map(|light| one(light)).collect()
}

/// All shapes side by side, some of them emissive, and lights.
fn everything(frame: Frame, setting: &str, samples: u32) -> SceneFiles {
    let (render, more) = match setting {
        "LENS" => ("", format!("aperture = {}\nfocus = {}", frame.length(0.0625), frame.length(5.0))),
        PHOTONS | "LAMPS" => ("", String::new()),
        other => (other, String::new()),
    };
    let mut scene =
        super::head(samples, &format!("background = [0.25, 0.25, 0.25]\n{render}")) + &camera(frame, &more);
    if setting == PHOTONS {
        scene += "[photons]\nenabled = true\ncount = 5000\n";
    }
    scene += &around(frame, "");
    for (number, shape) in SHAPES.iter().enumerate() {
        let angle = TAU * number as f64 / 10.0;
        let move_by = [1.5 * angle.cos(), 1.0 + 0.8 * angle.sin(), -1.5]
            .map(|x| (x * 1024.0).round() / 1024.0 * frame.unit);
        let there = Frame { at: [0, 1, 2].map(|axis| frame.at[axis] + move_by[axis]), ..frame };
        let material = if *shape == "plane" { "matte" } else { MATERIALS[number % MATERIALS.len()] };
        scene += &shape_of(shape, there, material);
    }
    scene += &lights_of(frame, &["point", "spot", "directional", "sun", "quad", "sphere"]);
    for number in 0..if setting == "LAMPS" { 64 } else { 0 } {
        let (x, z) = (f64::from(number % 8) - 3.5, f64::from(number / 8) - 8.0);
        let (center, radius) = (frame.point(x, 3.5, z), frame.length(0.0625));
        let _ = write!(scene, "[[sphere]]\ncenter = {center}\nradius = {radius}\nmaterial = \"lamp\"\n");
    }
    with_files(&scene)
}

/// A scene and the files it refers to.
fn with_files(scene: &str) -> SceneFiles {
    let tiles = "P3 4 3 255 90 120 200 20 30 40 255 250 200 70 70 80 60 80 90 0 0 0 9 9 9 200 90 60 30 20 10 8 9 7 6 5 4 1 2 3";
    let ball = ball("obj", Frame::PLAIN, [0.0; 3], 1.0);
    SceneFiles::new(scene.to_owned()).with("tiles.ppm", tiles.to_owned()).with("ball.obj", ball)
}

/// Generates a mesh file that contains a faceted ball.
fn ball(ending: &str, frame: Frame, center: [f64; 3], radius: f64) -> String {
    const RINGS: usize = 9;
    const STEPS: usize = 14;
    let at = |ring: usize, step: usize| {
        let (theta, phi) =
            (TAU / 2.0 * ring as f64 / RINGS as f64, TAU * (step % STEPS) as f64 / STEPS as f64);
        let [x, y, z] = [theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()];
        let text = frame.point(center[0] + radius * x, center[1] + radius * y, center[2] + radius * z);
        text.replace(['[', ']', ','], "")
    };
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for ring in 0..=RINGS {
        points.extend((0..STEPS).map(|step| at(ring, step)));
    }
    for ring in 0..RINGS {
        for step in 0..STEPS {
            let [a, b] = [step, (step + 1) % STEPS].map(|step| ring * STEPS + step);
            if ring > 0 {
                faces.push([a, b, b + STEPS]);
            }
            if ring + 1 < RINGS {
                faces.push([a, b + STEPS, a + STEPS]);
            }
        }
    }
    mesh(ending, &points, &faces)
}

/// Formats points and triangles as a mesh file.
pub(super) fn mesh(ending: &str, points: &[String], faces: &[[usize; 3]]) -> String {
    let (from, mut text) = match ending {
        "obj" => (1, String::new()),
        "off" => (0, format!("OFF\n{} {} 0\n", points.len(), faces.len())),
        _ => (
            0,
            format!(
                "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                points.len(),
                faces.len()
            ),
        ),
    };
    let (point, face) = if ending == "obj" { ("v ", "f") } else { ("", "3") };
    points.iter().for_each(|one| text += &format!("{point}{one}\n"));
    for [a, b, c] in faces {
        let _ = writeln!(text, "{face} {} {} {}", a + from, b + from, c + from);
    }
    text
}
