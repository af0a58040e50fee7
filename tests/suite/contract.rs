//! The scene file contract: all keys, their defaults, and whether they are required.

use std::fs;
use std::path::PathBuf;

use glimt::scene::description::{Camera, Scene};
use glimt::scene::diagnostic::{Diagnostic, Severity};
use glimt::scene::{parse, starter_scene};

/// Whether a key is optional, and whether its example value is the default.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Promise {
    /// Optional. The default is the example value.
    Default,
    /// Optional. The default differs from the example value.
    Other,
    /// Required.
    Required,
}

use Promise::{Default, Other, Required};

/// Key name, example value, and whether it is required.
type KeyContract = (&'static str, &'static str, Promise);

/// All tables with their keys and example values.
const TABLES: &[(&str, &[KeyContract])] = &[
    (
        "[render]",
        &[
            ("width", "640", Default),
            ("height", "480", Default),
            ("samples", "64", Default),
            ("error", "0.0", Default),
            ("max_depth", "8", Default),
            ("integrator", "\"whitted\"", Default),
            ("clamp", "0.0", Default),
            ("shadows", "\"soft\"", Default),
            ("ambient", "[0, 0, 0]", Default),
            ("background", "[0, 0, 0]", Default),
            ("filter", "\"box\"", Default),
            ("exposure", "0.0", Default),
            ("tonemap", "\"none\"", Default),
            ("accel", "\"bvh\"", Default),
            ("seed", "0", Default),
            ("output", "\"cornell.png\"", Other),
        ],
    ),
    (
        "[camera]",
        &[
            ("position", "[0, 1, 4]", Required),
            ("look_at", "[0, 1, 0]", Required),
            ("up", "[0, 1, 0]", Default),
            ("fov", "40.0", Default),
            ("aperture", "0.0", Default),
            ("focus", "4.0", Default),
        ],
    ),
    (
        "[photons]",
        &[
            ("enabled", "false", Default),
            ("count", "0", Default),
            ("radius", "0.0", Default),
            ("bounces", "16", Default),
        ],
    ),
    (
        "[textures.bricks]",
        &[
            ("file", "\"textures/bricks.png\"", Required),
            ("filter", "\"bilinear\"", Default),
            ("wrap", "\"repeat\"", Default),
            ("repeat", "[1, 1]", Default),
            ("rotate", "0.0", Default),
            ("offset", "[0, 0]", Default),
            ("factor", "1", Default),
            ("uv", "0", Default),
            ("encoding", "\"auto\"", Default),
        ],
    ),
    (
        "[materials.wall]",
        &[
            ("type", "\"phong\"", Default),
            ("diffuse", "[0.7, 0.7, 0.7]", Default),
            ("specular", "[0, 0, 0]", Default),
            ("shininess", "32.0", Default),
            ("ambient", "[1, 1, 1]", Other),
            ("emission", "[0, 0, 0]", Default),
            ("emission_sides", "\"front\"", Default),
            ("normal_map", "\"bumps\"", Other),
            ("normal_strength", "1.0", Default),
            ("bump", "\"bumps\"", Other),
            ("bump_scale", "0.01", Default),
            ("opacity", "1.0", Default),
            ("opacity_cutoff", "0.0", Default),
        ],
    ),
    (
        "[materials.steel]",
        &[
            ("type", "\"mirror\"", Other),
            ("reflectance", "[0.9, 0.9, 0.9]", Default),
            ("emission", "[0, 0, 0]", Default),
            ("emission_sides", "\"front\"", Default),
            ("normal_map", "\"bumps\"", Other),
            ("normal_strength", "1.0", Default),
            ("bump", "\"bumps\"", Other),
            ("bump_scale", "0.01", Default),
            ("opacity", "1.0", Default),
            ("opacity_cutoff", "0.0", Default),
        ],
    ),
    (
        "[materials.crystal]",
        &[
            ("type", "\"glass\"", Other),
            ("ior", "1.5", Default),
            ("tint", "[1, 1, 1]", Default),
            ("roughness", "0.0", Default),
            ("thin", "false", Default),
            ("emission", "[0, 0, 0]", Default),
            ("emission_sides", "\"front\"", Default),
            ("normal_map", "\"bumps\"", Other),
            ("normal_strength", "1.0", Default),
            ("bump", "\"bumps\"", Other),
            ("bump_scale", "0.01", Default),
        ],
    ),
    (
        "[materials.brass]",
        &[
            ("type", "\"metal\"", Other),
            ("color", "[0.89, 0.79, 0.43]", Required),
            ("roughness", "0.2", Default),
            ("anisotropy", "0.0", Default),
        ],
    ),
    (
        "[materials.enamel]",
        &[
            ("type", "\"plastic\"", Other),
            ("diffuse", "[0.7, 0.7, 0.7]", Default),
            ("specular", "[1, 1, 1]", Default),
            ("ior", "1.5", Default),
            ("roughness", "0.1", Default),
        ],
    ),
    (
        "[materials.car]",
        &[
            ("type", "\"principled\"", Other),
            ("color", "[0.8, 0.8, 0.8]", Default),
            ("metallic", "0.0", Default),
            ("roughness", "0.5", Default),
            ("ior", "1.5", Default),
            ("specular", "1.0", Default),
            ("specular_color", "[1, 1, 1]", Default),
            ("transmission", "0.0", Default),
            ("clearcoat", "0.0", Default),
            ("clearcoat_roughness", "0.0", Default),
        ],
    ),
    (
        "[[sphere]]",
        &[
            ("center", "[0, 0.5, 0]", Required),
            ("radius", "0.5", Required),
            ("material", "\"crystal\"", Required),
        ],
    ),
    (
        "[[quad]]",
        &[
            ("corner", "[-1, 0, 1]", Default),
            ("u", "[2, 0, 0]", Default),
            ("v", "[0, 0, -2]", Default),
            ("material", "\"wall\"", Required),
        ],
    ),
    (
        "[[plane]]",
        &[
            ("point", "[0, 0, 0]", Default),
            ("normal", "[0, 1, 0]", Default),
            ("material", "\"wall\"", Required),
        ],
    ),
    (
        "[[box]]",
        &[
            ("center", "[0, 0.5, 0]", Default),
            ("size", "[1, 1, 1]", Default),
            ("rotate", "[0, 30, 0]", Other),
            ("material", "\"wall\"", Required),
        ],
    ),
    (
        "[[triangle]]",
        &[
            ("a", "[0, 0, 0]", Default),
            ("b", "[1, 0, 0]", Default),
            ("c", "[0, 1, 0]", Default),
            ("material", "\"wall\"", Required),
        ],
    ),
    (
        "[[disk]]",
        &[
            ("center", "[0, 0, 0]", Default),
            ("normal", "[0, 1, 0]", Default),
            ("radius", "0.5", Default),
            ("material", "\"wall\"", Required),
        ],
    ),
    (
        "[[cylinder]]",
        &[
            ("a", "[0, 0, 0]", Default),
            ("b", "[0, 1, 0]", Default),
            ("radius", "0.5", Default),
            ("caps", "true", Default),
            ("material", "\"wall\"", Required),
        ],
    ),
    (
        "[[cone]]",
        &[
            ("base", "[0, 0, 0]", Default),
            ("tip", "[0, 1, 0]", Default),
            ("radius", "0.5", Default),
            ("cap", "true", Default),
            ("material", "\"wall\"", Required),
        ],
    ),
    (
        "[[torus]]",
        &[
            ("center", "[0, 0, 0]", Default),
            ("axis", "[0, 1, 0]", Default),
            ("radius", "0.5", Default),
            ("tube", "0.125", Default),
            ("material", "\"wall\"", Required),
        ],
    ),
    (
        "[[mesh]]",
        &[
            ("file", "\"../assets/knot.obj\"", Required),
            ("material", "\"wall\"", Other),
            ("scale", "1.0", Default),
            ("rotate", "[0, 0, 0]", Default),
            ("translate", "[0, 0, 0]", Default),
            ("smooth", "true", Default),
            ("vertex_colors", "false", Default),
        ],
    ),
    (
        "[[light]]",
        &[
            ("type", "\"point\"", Default),
            ("position", "[0, 3, 0]", Default),
            ("intensity", "[10, 10, 10]", Default),
            ("falloff", "\"square\"", Default),
        ],
    ),
    (
        "[[light]]",
        &[
            ("type", "\"spot\"", Other),
            ("position", "[0, 3, 0]", Default),
            ("look_at", "[0, 0, 0]", Default),
            ("intensity", "[10, 10, 10]", Default),
            ("angle", "45", Default),
            ("blend", "0.2", Default),
            ("falloff", "\"square\"", Default),
        ],
    ),
    (
        "[[light]]",
        &[
            ("type", "\"directional\"", Other),
            ("direction", "[0, -1, 0]", Default),
            ("irradiance", "[1, 1, 1]", Default),
            ("angle", "0", Default),
        ],
    ),
    (
        "[environment]",
        &[("color", "[1, 1, 1]", Default), ("file", "\"sky.hdr\"", Other), ("rotate", "0.0", Default)],
    ),
];

/// A texture that the materials refer to.
const BUMPS: &str = "[textures.bumps]\nfile = \"textures/bumps.png\"\n";

/// A directory with every file that the example refers to, and the path of the scene in it.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["scenes/textures", "assets"] {
        fs::create_dir_all(folder.path().join(name)).expect("a folder");
    }
    for name in [
        "scenes/textures/bricks.png",
        "scenes/textures/bumps.png",
        "scenes/sky.hdr",
        "assets/knot.obj",
        "scenes/camera.txt",
    ] {
        fs::write(folder.path().join(name), "").expect("written");
    }
    let scene = folder.path().join("scenes/cornell.toml");
    (folder, scene)
}

/// The example without the keys for which `is_out` is true.
fn example(is_out: impl Fn(usize, &str) -> bool) -> String {
    let mut text = String::from(BUMPS);
    for (table, (header, keys)) in TABLES.iter().enumerate() {
        text.push_str(&format!("{header}\n"));
        for (key, value, _) in keys.iter().filter(|(key, ..)| !is_out(table, key)) {
            text.push_str(&format!("{key} = {value}\n"));
        }
    }
    text
}

/// The messages of all errors.
pub(crate) fn errors(diagnostics: &[Diagnostic]) -> Vec<&str> {
    let errors = diagnostics.iter().filter(|one| one.severity == Severity::Error);
    errors.map(|one| one.message.as_str()).collect()
}

/// Removes source positions from the scene, because they change when a key is omitted.
pub(crate) fn placeless(mut scene: Scene) -> Scene {
    scene.objects.iter_mut().for_each(|object| object.span = 0..0);
    scene.textures.iter_mut().for_each(|texture| texture.file.span = 0..0);
    scene.mesh_files.iter_mut().for_each(|file| file.span = 0..0);
    let maps = scene.environment.iter_mut().filter_map(|environment| environment.file.as_mut());
    maps.for_each(|file| file.span = 0..0);
    scene
}

#[test]
fn unmarked_keys_are_optional() {
    let (_folder, path) = folder();
    let outcome = |text: String| parse(text.into(), &path);
    let whole = outcome(example(|_, _| false));
    assert_eq!(errors(&whole.diagnostics), [""; 0]);
    let whole = placeless(whole.scene.expect("a scene"));
    for (table, (header, keys)) in TABLES.iter().enumerate() {
        for &(key, _, promise) in *keys {
            // A Phong material has no `reflectance`. Non-default values are tested below.
            if key == "type" && promise == Other {
                continue;
            }
            let without = outcome(example(|of, name| (of, name) == (table, key)));
            let said = errors(&without.diagnostics);
            match promise {
                Required => assert_eq!(said, [format!("{header} needs `{key}`")], "{header} {key}"),
                Default | Other => {
                    assert_eq!(said, [""; 0], "{header} {key}");
                    let scene = placeless(without.scene.expect("a scene"));
                    assert_eq!(scene == whole, promise == Default, "{header} {key}: wrong default");
                }
            }
        }
    }
}

#[test]
fn environment_without_a_map_is_black() {
    let (_folder, path) = folder();
    let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
    let color = |text: &str| {
        let scene = parse(format!("{camera}{text}").into(), &path).scene.expect("a scene");
        scene.environment.map(|environment| environment.color.to_array())
    };
    assert_eq!([color(""), color("[environment]\n")], [None, Some([0.0; 3])]);
    assert_eq!(color("[environment]\nfile = \"sky.hdr\"\n"), Some([1.0; 3]));
}

#[test]
fn required_keys_suffice() {
    let (_folder, path) = folder();
    let is_kept = |table: usize, key: &str| {
        let (_, keys) = TABLES[table];
        keys.iter().any(|(name, _, promise)| *name == key && *promise == Required) || key == "type"
    };
    let outcome = parse(example(|table, key| !is_kept(table, key)).into(), &path);
    assert_eq!(errors(&outcome.diagnostics), [""; 0]);
    let scene = outcome.scene.expect("a scene");
    assert_eq!((scene.objects.len(), scene.lights.len(), scene.materials.len()), (10, 3, 6));
    assert_eq!(scene.output, None);
}

#[test]
fn camera_accepts_an_orbiter() {
    let (_folder, path) = folder();
    let outcome = parse("[camera]\norbiter = \"camera.txt\"\n".into(), &path);
    assert_eq!(errors(&outcome.diagnostics), [""; 0]);
    assert!(matches!(outcome.scene.expect("a scene").camera, Camera::Orbiter { .. }));
}

#[test]
fn mesh_accepts_a_matrix() {
    let (_folder, path) = folder();
    let scene = |placed: &str| {
        let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[materials.a]\n";
        let text = format!("{camera}[[mesh]]\nfile = \"../assets/knot.obj\"\nmaterial = \"a\"\n{placed}\n");
        let outcome = parse(text.into(), &path);
        assert_eq!(errors(&outcome.diagnostics), [""; 0], "{placed}");
        outcome.scene.expect("a scene")
    };
    let transform =
        |placed: &str| scene(placed).objects[0].shape.as_mesh().expect("a mesh").placed.to_transform();
    let by_matrix = transform("matrix = [0, -2, 0, 5, 1, 0, 0, 6, 0, 0, -3, 7, 0, 0, 0, 1]");
    let by_steps = transform("scale = [1, 2, -3]\nrotate = [0, 0, 90]\ntranslate = [5, 6, 7]");
    assert_eq!(by_matrix, by_steps);
    assert!(by_matrix.flips_handedness());
}

#[test]
fn every_choice_is_accepted() {
    let (_folder, path) = folder();
    let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
    let words: &[(&str, &[&str])] = &[
        ("[render]\nshadows", &["off", "hard", "soft"]),
        ("[render]\naccel", &["bvh", "bvh-high", "kdtree"]),
        ("[render]\nfilter", &["box", "tent", "gaussian", "mitchell"]),
        ("[render]\ntonemap", &["none", "reinhard", "aces", "agx"]),
        ("[textures.bumps]\nfile = \"textures/bumps.png\"\nfilter", &["nearest", "bilinear"]),
        ("[textures.bumps]\nfile = \"textures/bumps.png\"\nwrap", &["repeat", "clamp", "mirror"]),
        ("[textures.bumps]\nfile = \"textures/bumps.png\"\nencoding", &["auto", "srgb", "linear"]),
        ("[materials.a]\ntype", &["phong", "mirror", "glass", "plastic", "principled"]),
        (
            "[materials.a]\ntype = \"metal\"\nelement",
            &["gold", "silver", "copper", "aluminium", "iron", "chromium", "titanium"],
        ),
        ("[materials.a]\nemission_sides", &["front", "both"]),
        ("[[light]]\nfalloff", &["square", "none"]),
    ];
    for (key, words) in words {
        for word in *words {
            let outcome = parse(format!("{camera}{key} = \"{word}\"\n").into(), &path);
            assert_eq!(errors(&outcome.diagnostics), [""; 0], "{key} {word}");
        }
    }
}

#[test]
fn ranges_include_their_limits() {
    let (_folder, path) = folder();
    let said = |text: &str| {
        let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
        let outcome = parse(format!("{camera}{text}\n").into(), &path);
        errors(&outcome.diagnostics).len()
    };
    for right in [
        "fov = 179.9",
        "aperture = 0",
        "[render]\nwidth = 1",
        "[render]\nwidth = 65536\nheight = 1",
        "[render]\nheight = 65536\nwidth = 1",
        "[render]\nsamples = 1",
        "[render]\nmax_depth = 0",
        "[render]\nexposure = -3.5",
        "[render]\nbackground = \"#ffcc00\"",
        "[render]\nbackground = [0, 1, 1000.5]",
        "[photons]\nradius = 0.5\nbounces = 0",
        "[materials.a]\ntype = \"glass\"\nior = 0.75",
        "[materials.a]\ntype = \"glass\"\nthin = true\nopacity = 0.5",
        "[materials.a]\nopacity = 0\nopacity_cutoff = 1",
        "[materials.a]\nopacity = { texture = \"b\", channel = \"a\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[textures.b]\nfile = \"textures/bumps.png\"\noffset = [-0.5, 7]\nrotate = -720\nuv = 1",
        "[materials.a]\ntype = \"metal\"\neta = [0, 0, 0]\nk = [9, 9, 9]\nroughness = 0\nanisotropy = -1",
        "[materials.a]\ntype = \"metal\"\ncolor = 1\nroughness = { texture = \"b\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[materials.a]\ntype = \"plastic\"\nior = 1\nroughness = 1",
        "[materials.a]\ntype = \"principled\"\nior = 10\nspecular_color = 7",
        "[materials.a]\nambient = { texture = \"b\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[environment]",
        "[environment]\ncolor = [1, 1, 1]",
        "[environment]\ncolor = \"skyblue\"\nrotate = -720",
        "[environment]\nfile = \"textures/bricks.png\"",
    ] {
        assert_eq!(said(right), 0, "{right}");
    }
    for wrong in [
        "[materials.a]\ntype = \"metal\"",
        "[materials.a]\ntype = \"metal\"\ncolor = 1\nelement = \"gold\"",
        "[materials.a]\ntype = \"metal\"\neta = 1",
        "[materials.a]\ntype = \"metal\"\ncolor = 1.5",
        "[materials.a]\ntype = \"metal\"\ncolor = 1\nanisotropy = 1.5",
        "[materials.a]\ntype = \"principled\"\ncolor = { texture = \"b\" }\nroughness = { texture = \"b\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[materials.a]\ntype = \"plastic\"\nior = 0.9",
        "[materials.a]\ntype = \"principled\"\ntransmission = 1.5",
        "[materials.a]\ntype = \"glass\"\nthin = true\nroughness = 0.5",
        "[render]\nwidth = 0",
        "[render]\nwidth = 65537",
        "[render]\nsamples = 0",
        "[render]\nerror = -1",
        "[render]\nbackground = [0, -1, 0]",
        "[environment]\ncolor = [1, -1, 1]",
        "[environment]\ncolour = [0, 0, 0]",
        "[environment]\nfile = \"textures/brick.png\"",
        "[environment]\nfile = \"sky.txt\"",
        "[environment]\nrotate = \"left\"",
        "[materials.a]\nopacity = 1.1",
        "[materials.a]\nopacity_cutoff = -0.1",
        "[materials.a]\ntype = \"glass\"\nopacity = 0.5",
        "[textures.b]\nfile = \"textures/bumps.png\"\nuv = 2",
    ] {
        assert_eq!(said(wrong), 1, "{wrong}");
    }
}

#[test]
fn paths_are_relative_to_the_scene() {
    let (folder, path) = folder();
    let outcome = parse(example(|_, _| false).into(), &path);
    let scene = outcome.scene.expect("a scene");
    assert_eq!(scene.output, Some(folder.path().join("scenes/cornell.png")));
    assert_eq!(scene.mesh_files[0].value, folder.path().join("scenes/../assets/knot.obj"));
    assert_eq!(scene.textures[1].file.value, folder.path().join("scenes/textures/bricks.png"));
}

#[test]
fn starter_has_every_key() {
    for (header, keys) in TABLES {
        for (key, ..) in *keys {
            let has = |line: &str| line.trim_start_matches("# ").starts_with(&format!("{key} = "));
            assert!(starter_scene().lines().any(has), "starter: {header} {key}");
        }
    }
    // `name` is an optional key of every shape.
    assert!(starter_scene().contains("# name = "), "name");
}

#[test]
fn starter_lines_can_be_uncommented() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["bricks.png", "knot.obj", "sky.hdr"] {
        fs::write(folder.path().join(name), "").expect("written");
    }
    let is_key = |text: &str| {
        let name = text.split(" = ").next().unwrap_or_default();
        text.starts_with('[')
            || text.contains(" = ") && name.chars().all(|c| c.is_ascii_lowercase() || c == '_')
    };
    let uncommented = |line: &str| match line.strip_prefix("# ") {
        // These keys conflict with other keys.
        Some(text) if is_key(text) && !["orbiter", "matrix"].iter().any(|key| text.starts_with(key)) => {
            format!("{text}\n")
        }
        _ => format!("{line}\n"),
    };
    let text: String = starter_scene().lines().map(uncommented).collect();
    assert!(text.lines().filter(|line| line.starts_with('#')).count() < 12, "{text}");
    let outcome = parse(text.into(), &folder.path().join("scene.toml"));
    assert_eq!(errors(&outcome.diagnostics), [""; 0]);
    assert_eq!(outcome.scene.expect("a scene").objects.len(), 11);
}
