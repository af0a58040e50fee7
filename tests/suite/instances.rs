//! Groups and instances: images are bit-identical to those of scenes in which the copies are written out.

use super::test_dir::{TestDir, assert_mentions};

/// An affine map: the rows of its 3 × 4 matrix.
type Rows = [[f64; 4]; 3];

const IDENTITY: Rows = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Mirrors, shears and scales. All products of these numbers are exact in double precision.
const MIRRORED: Rows = [[-0.5, 0.125, 0.0, -1.5], [0.0, 0.75, 0.25, 0.5], [0.125, 0.0, 1.0, -0.5]];

/// A quarter turn about y, and a uniform scale.
const TURNED: Rows = [[0.0, 0.0, 0.5, 1.0], [0.0, 0.5, 0.0, 0.25], [-0.5, 0.0, 0.0, 0.5]];

/// Returns the map that applies `inner` and then `outer`.
fn product(outer: &Rows, inner: &Rows) -> Rows {
    let entry = |row: &[f64; 4], column: usize| {
        let sum: f64 = (0..3).map(|i| row[i] * inner[i][column]).sum();
        sum + if column == 3 { row[3] } else { 0.0 }
    };
    outer.map(|row| std::array::from_fn(|column| entry(&row, column)))
}

fn matrix(rows: &Rows) -> String {
    let numbers: Vec<String> = rows.iter().flatten().map(|number| format!("{number:?}")).collect();
    format!("matrix = [{}, 0, 0, 0, 1]\n", numbers.join(", "))
}

/// Tables and keys of a group with every kind of shape: lights, glass, mirrors, textures and normal maps.
/// Some shapes have a matrix.
const SHAPES: [(&str, &str, Option<Rows>); 14] = [
    ("sphere", "center = [-0.5, 0.25, 0.5]\nradius = 0.25\nmaterial = \"glass\"\n", None),
    ("sphere", "center = [0.5, 0.25, -0.5]\nradius = 0.25\nmaterial = \"steel\"\n", Some(TURNED)),
    ("quad", "corner = [-0.25, 1.25, 0]\nu = [0.5, 0, 0]\nv = [0, 0, 0.5]\nmaterial = \"lamp\"\n", None),
    ("quad", "corner = [-1, 0, -1]\nu = [2, 0, 0]\nv = [0, 1, 0]\nmaterial = \"bumpy\"\n", Some(MIRRORED)),
    ("plane", "point = [0, -0.5, 0]\nmaterial = \"floor\"\n", None),
    (
        "box",
        "center = [0, 0.25, 0]\nsize = [0.25, 0.5, 0.25]\nrotate = [0, 30, 0]\nmaterial = \"bumpy\"\n",
        None,
    ),
    ("triangle", "a = [-1, 0, -0.5]\nb = [-0.5, 0, -0.5]\nc = [-0.75, 1, -0.5]\nmaterial = \"pane\"\n", None),
    (
        "disk",
        "center = [0.75, 0.5, 0.25]\nnormal = [-1, 0.5, 1]\nradius = 0.25\nmaterial = \"bumpy\"\n",
        None,
    ),
    ("cylinder", "a = [0.25, 0, 0.5]\nb = [0.25, 0.5, 0.5]\nradius = 0.125\nmaterial = \"glass\"\n", None),
    (
        "cylinder",
        "a = [-0.25, 0.75, 0]\nb = [-0.25, 1, 0]\nradius = 0.0625\nmaterial = \"lamp\"\n",
        Some(MIRRORED),
    ),
    ("cone", "base = [0.5, 0, 0.75]\ntip = [0.5, 0.5, 0.75]\nradius = 0.125\nmaterial = \"gold\"\n", None),
    ("torus", "center = [-0.5, 0.125, 0.75]\nradius = 0.25\nmaterial = \"gold\"\n", None),
    ("mesh", "file = \"tent.obj\"\nmaterial = \"bumpy\"\n", Some(TURNED)),
    ("mesh", "file = \"tent.obj\"\nsmooth = false\nmaterial = \"lamp\"\n", None),
];

const TENT: &str = "v -0.25 0 -0.25\nv 0.25 0 -0.25\nv 0.25 0 0.25\nv -0.25 0 0.25\nv 0 0.5 0\n\
                    vt 0 0\nvt 1 0\nvt 0.5 1\nf 2/1 1/2 5/3\nf 3/1 2/2 5/3\nf 4/1 3/2 5/3\nf 1/1 4/2 5/3\n";

/// Everything except the shapes.
fn surroundings(integrator: &str) -> String {
    format!(
        r#"[render]
width = 48
height = 36
samples = 3
integrator = "{integrator}"
background = [0.2, 0.3, 0.4]
[camera]
position = [0.2, 1.6, 2.8]
look_at = [-0.2, 0.5, 0]
fov = 50
[photons]
enabled = true
count = 500
[textures.waves]
file = "waves.ppm"
encoding = "linear"
[materials]
floor = {{ diffuse = [0.6, 0.6, 0.5] }}
glass = {{ type = "glass", tint = [0.8, 0.9, 0.95] }}
pane = {{ type = "glass", thin = true, tint = [0.8, 0.9, 0.9] }}
steel = {{ type = "mirror" }}
gold = {{ type = "metal", element = "gold", roughness = 0.3, anisotropy = 0.5 }}
bumpy = {{ type = "plastic", diffuse = {{ texture = "waves" }}, bump = "waves", bump_scale = 0.05 }}
lamp = {{ diffuse = 0, emission = [6, 5, 4] }}
[[light]]
position = [1, 4, 3]
intensity = [9, 9, 9]
"#
    )
}

/// A table, with a matrix unless it is the identity.
fn table(head: &str, keys: &str, rows: &Rows) -> String {
    let matrix = if *rows == IDENTITY { String::new() } else { matrix(rows) };
    format!("[[{head}]]\n{keys}{matrix}")
}

/// The shapes in a group, with copies at these places, some of them nested in another group.
fn with_instances(places: &[Rows], nested: &[Rows]) -> String {
    let shapes = SHAPES
        .iter()
        .map(|(kind, keys, own)| table(&format!("groups.things.{kind}"), keys, &own.unwrap_or(IDENTITY)));
    let place = |head: &'static str, group: &'static str| {
        move |rows: &Rows| table(head, &format!("group = \"{group}\"\n"), rows)
    };
    let inner = nested.iter().map(place("groups.pair.instance", "things"));
    let outer = [&TURNED, &MIRRORED].map(place("instance", "pair"));
    let pair = ["[groups.pair]\n".to_owned()].into_iter();
    shapes
        .chain(pair)
        .chain(inner)
        .chain(places.iter().map(place("instance", "things")))
        .chain(outer)
        .collect()
}

/// The same copies, written out.
fn written_out(places: &[Rows], nested: &[Rows]) -> String {
    let of_pair = [TURNED, MIRRORED]
        .into_iter()
        .flat_map(|outer| nested.iter().map(move |inner| product(&outer, inner)));
    let copies = places.iter().copied().chain(of_pair);
    let copy = |place: Rows| {
        SHAPES
            .iter()
            .map(move |(kind, keys, own)| table(kind, keys, &own.map_or(place, |own| product(&place, &own))))
    };
    copies.flat_map(copy).collect()
}

/// The pixels of a scene as bits.
fn pixels(dir: &TestDir, text: &str) -> Vec<u32> {
    dir.write("scene.toml", text);
    dir.expect("scene.toml --once -o scene.exr", 0);
    let picture = image::open(dir.path("scene.exr")).expect("a picture").to_rgb32f();
    picture.as_raw().iter().map(|number| number.to_bits()).collect()
}

/// A scene with groups in groups, which uses these files.
pub(crate) fn nested_scene(mesh: &str, texture: &str) -> String {
    let text = surroundings("path") + &with_instances(&[IDENTITY, MIRRORED], &[IDENTITY, TURNED]);
    text.replace("tent.obj", mesh).replace("waves.ppm", texture)
}

fn folder() -> TestDir {
    let dir = TestDir::new();
    dir.write("tent.obj", TENT);
    dir.write("waves.ppm", "P3 2 2 255 250 120 20 30 140 80 90 20 230 60 200 120");
    dir
}

#[test]
fn images_equal_written_out_scenes() {
    let dir = folder();
    let moved = |x: f64| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -0.5]];
    let cases: [(&[Rows], &[Rows]); 3] =
        [(&[IDENTITY], &[]), (&[moved(-1.5), MIRRORED, TURNED], &[]), (&[], &[IDENTITY, moved(0.5)])];
    for integrator in ["whitted", "path"] {
        for (number, (places, nested)) in cases.into_iter().enumerate() {
            let around = surroundings(integrator);
            let [copies, written] = [with_instances(places, nested), written_out(places, nested)]
                .map(|shapes| pixels(&dir, &format!("{around}{shapes}")));
            let differing = copies.iter().zip(&written).filter(|(a, b)| a != b).count();
            assert_eq!(differing, 0, "{integrator}, case {number}: {differing} of {} values", copies.len());
            let is_varied = copies.iter().collect::<std::collections::HashSet<_>>().len() > copies.len() / 4;
            assert!(is_varied, "{integrator}, case {number}: the image is almost uniform");
        }
    }
}

#[test]
fn instance_transforms_equal_mesh_transforms() {
    let dir = folder();
    let steps = "scale = [1.5, -0.7, 1.1]\nrotate = [10, 20, 30]\ntranslate = [0.3, 0.6, 0.1]\n";
    let mesh = "file = \"tent.obj\"\nmaterial = \"bumpy\"\n";
    let around = surroundings("path");
    let written = pixels(&dir, &format!("{around}[[mesh]]\n{mesh}{steps}"));
    let copied = format!("[[groups.tent.mesh]]\n{mesh}[[instance]]\ngroup = \"tent\"\n{steps}");
    assert!(pixels(&dir, &format!("{around}{copied}")) == written);
    // Only the last of several nested instances translates.
    let inner = steps.replace("translate = [0.3, 0.6, 0.1]\n", "");
    let nested = format!(
        "[[groups.tent.mesh]]\n{mesh}{inner}[[groups.camp.instance]]\ngroup = \"tent\"\n\
         [[instance]]\ngroup = \"camp\"\ntranslate = [0.3, 0.6, 0.1]\n"
    );
    assert!(pixels(&dir, &format!("{around}{nested}")) == written);
}

#[test]
fn copies_share_mesh_files() {
    let dir = folder();
    dir.write("roof.obj", TENT.replace("v 0 0.5 0", "v 0 0.25 0"));
    let meshes = ["tent", "roof"]
        .map(|name| format!("[[groups.house.mesh]]\nfile = \"{name}.obj\"\nmaterial = \"floor\"\n"));
    let place = |i: usize| format!("[[instance]]\ngroup = \"house\"\ntranslate = [{i}, 0, 0]\n");
    let text =
        format!("{}{}{}", surroundings("whitted"), meshes.concat(), (0..1000).map(place).collect::<String>());
    dir.write("scene.toml", text);
    let report = dir.report("scene.toml -o scene.png");
    let counters = &report["counters"];
    assert_eq!((&counters["objects"], &counters["triangles"]), (&2000.into(), &8000.into()));
    let stages = report["stages"].to_string();
    assert_mentions(&stages, &["2 loaded"]);
}

#[test]
fn warnings_about_copies_are_reported_once() {
    let dir = folder();
    dir.write("bare.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let shapes = "[[groups.a.mesh]]\nfile = \"bare.obj\"\nmaterial = \"bumpy\"\n\
                  [[groups.a.quad]]\nmaterial = \"glass\"\n\
                  [[groups.a.quad]]\ncorner = [0, 5, 0]\nu = [0, 0, 1]\nv = [1, 0, 0]\nmaterial = \"lamp\"\n";
    let place = |i: usize| format!("[[instance]]\ngroup = \"a\"\ntranslate = [{i}, 0, 0]\n");
    let warnings = |count: usize| {
        let instances: String = (0..count).map(place).collect();
        let text = format!("{}{shapes}{instances}", surroundings("path"));
        dir.write("scene.toml", text);
        let output = dir.run("check --json scene.toml");
        let checked: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let all = checked["diagnostics"].as_array().expect("a list").clone();
        all.iter().map(|one| (one["line"].clone(), one["message"].clone())).collect::<Vec<_>>()
    };
    let once = warnings(1);
    assert!(once.len() >= 2, "{once:?}");
    assert_eq!(warnings(20).len(), once.len());
}
