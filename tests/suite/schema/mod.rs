//! Validation with the scene schema, in both drafts of JSON Schema: it accepts the same scenes as the program
//! and reports errors in the right place.

mod validator;

use std::fs;
use std::path::{Path, PathBuf};

use glimt::choice::Choice;
use glimt::cli::args::SchemaDraft;
use glimt::cli::commands::schema::{FILE, LINE, schema, schema_text};
use glimt::scene::starter_scene;
use serde_json::Value;

use self::validator::violations;
use crate::test_dir::{TestDir, assert_mentions};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Converts TOML to JSON. `None` if the TOML is malformed.
fn json(text: &str) -> Option<Value> {
    fn of(value: toml::Value) -> Value {
        match value {
            toml::Value::String(text) => text.into(),
            toml::Value::Integer(number) => number.into(),
            toml::Value::Float(number) => number.into(),
            toml::Value::Boolean(flag) => flag.into(),
            toml::Value::Datetime(date) => date.to_string().into(),
            toml::Value::Array(items) => items.into_iter().map(of).collect(),
            toml::Value::Table(map) => map.into_iter().map(|(key, value)| (key, of(value))).collect(),
        }
    }
    Some(of(toml::Value::Table(text.parse().ok()?)))
}

/// Errors that each draft finds in a scene.
fn found(text: &str) -> Vec<Vec<(String, String)>> {
    let scene = json(text).expect("TOML");
    SchemaDraft::ALL.iter().map(|draft| violations(&schema(*draft), &scene)).collect()
}

fn files(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join(folder)).expect("a folder");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let mut files: Vec<_> =
        paths.filter(|path| path.extension().is_some_and(|ending| ending == "toml")).collect();
    files.sort();
    files
}

#[test]
fn bundled_schema_is_current() {
    let path = root().join("scenes").join(FILE);
    let there = fs::read_to_string(&path).unwrap_or_default();
    assert!(there == schema_text(SchemaDraft::Four), "outdated; run: glimt schema > scenes/{FILE}");
    for scene in files("scenes") {
        let text = fs::read_to_string(&scene).expect("a scene");
        assert!(text.starts_with(LINE), "{}: {LINE}", scene.display());
    }
}

#[test]
fn bundled_scenes_and_starter_are_valid() {
    for path in files("scenes") {
        let text = fs::read_to_string(&path).expect("a scene");
        assert_eq!(found(&text), [[], []], "{}", path.display());
    }
    assert_eq!(found(starter_scene()), [[], []]);
    // The starter scene with all keys that can be combined.
    let stands_alone = ["orbiter", "view_height", "matrix", "image", "opacity"];
    let uncommented = |line: &str| match line.strip_prefix("# ") {
        Some(text)
            if text.starts_with('[')
                || text.split_once(" = ").is_some_and(|(key, _)| {
                    key.chars().all(|c| c.is_ascii_lowercase() || c == '_') && !stands_alone.contains(&key)
                }) =>
        {
            format!("{text}\n")
        }
        _ => format!("{line}\n"),
    };
    let whole: String = starter_scene().lines().map(uncommented).collect();
    assert_eq!(found(&whole), [[], []], "{whole}");
}

const SCENE: &str = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";

#[test]
fn mistakes_are_located() {
    for (line, place) in [
        ("[render]\nwidth = 0", "render.width"),
        ("[render]\nsamples = 2.5", "render.samples"),
        ("[render]\nintegrator = \"paths\"", "render.integrator"),
        ("[render]\nheigth = 480", "render.heigth"),
        ("[render]\noutput = \"a.tiff\"", "render.output"),
        ("[render]\nbackground = [0, -1, 0]", "render.background"),
        ("[render]\nbackground = \"blu\"", "render.background"),
        ("[render]\nbackground = \"#ff00f\"", "render.background"),
        ("[photons]\nenabled = \"yes\"", "photons.enabled"),
        ("[textures.a]\nfile = \"a.txt\"", "textures.a.file"),
        ("[textures.a]\nrepeat = [1, 2]", "textures.a"),
        ("[textures.a]\nfile = \"a.png\"\nrepeat = [1, 0]", "textures.a.repeat.1"),
        ("[textures.a]\ntype = \"checker\"\ncolors = [1]", "textures.a.colors"),
        ("[textures.a]\ntype = \"bands\"\ncolors = [1, \"blu\"]", "textures.a.colors.1"),
        ("[materials.a]\ntype = \"blend\"", "materials.a"),
        ("[materials.a]\ntype = \"chrome\"", "materials.a.type"),
        ("[materials.a]\nroughnes = 0.5", "materials.a.roughnes"),
        ("[materials.a]\ntype = \"metal\"\nelement = \"gold\"\nroughness = 2", "materials.a.roughness"),
        ("[materials.a]\ntype = \"metal\"\nelement = \"gold\"\ncolor = 1", "materials.a"),
        ("[materials.a]\ntype = \"metal\"", "materials.a"),
        ("[materials.a]\nemission = { textur = \"a\" }", "materials.a.emission"),
        ("[materials.a]\nbump = 3", "materials.a.bump"),
        ("[[sphere]]\ncenter = [0, 0]\nradius = 1\nmaterial = \"a\"", "sphere.0.center"),
        ("[[sphere]]\ncenter = [0, 0, 0]\nradius = -1\nmaterial = \"a\"", "sphere.0.radius"),
        ("[[sphere]]\ncenter = [0, 0, 0]\nradius = 1", "sphere.0"),
        ("[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"a\"\nname = \"7\"", "sphere.0.name"),
        ("[[mesh]]\nfile = \"a.obj\"\nmatrix = [1]", "mesh.0.matrix"),
        ("[[groups.a.mesh]]\nfile = \"a.obj\"\nmatrix = [1]", "groups.a.mesh.0.matrix"),
        ("[[groups.a.light]]", "groups.a.light"),
        ("[[groups.a.instance]]\ntranslate = [1, 2, 3]", "groups.a.instance.0"),
        ("[[light]]\ntype = \"spot\"\nblend = 2", "light.0.blend"),
        ("[[light]]\nfallof = \"none\"", "light.0.fallof"),
        ("[[sphre]]", "sphre"),
        ("[environment]\nfile = \"sky.txt\"", "environment.file"),
    ] {
        for (draft, faults) in SchemaDraft::ALL.iter().zip(found(&format!("{SCENE}{line}\n"))) {
            assert!(!faults.is_empty(), "{} {line}", draft.name());
            for (path, keyword) in faults {
                assert_eq!(path, place, "{} {line}: {keyword}", draft.name());
            }
        }
    }
}

#[test]
fn exclusive_keys_are_an_error() {
    for wrong in [
        "[render]",
        "[camera]\nposition = [0, 1, 4]",
        "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\norbiter = \"a.txt\"",
        "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[[mesh]]\nfile = \"a.obj\"\nmatrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\nscale = 2",
        "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[materials.a]\nshininess = 3\ntype = \"glass\"",
        "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[materials.a]\nreflectance = 0.3",
        "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[materials.a]\ntype = \"metal\"\neta = 1",
    ] {
        assert!(found(wrong).iter().all(|faults| !faults.is_empty()), "{wrong}: {:?}", found(wrong));
    }
    assert_eq!(found("[camera]\norbiter = \"a.txt\"\nfov = 30"), [[], []]);
    let rotation = format!("{SCENE}[environment]\nmatrix = [1, 0, 0, 0, 1, 0, 0, 0, 1]\n");
    assert_eq!(found(&rotation), [[], []]);
    assert!(found(&format!("{rotation}rotate = 90")).iter().all(|faults| !faults.is_empty()));
}

#[test]
fn each_projection_has_its_own_keys() {
    for (keys, is_valid) in [
        ("fov = 179", true),
        ("fov = 180", false),
        ("view_height = 2", false),
        ("projection = \"perspective\"\naperture = 0.1", true),
        ("projection = \"orthographic\"", false),
        ("projection = \"orthographic\"\nview_height = 2\naperture = 0.1\nfocus = 3", true),
        ("projection = \"orthographic\"\nview_height = 2\nfov = 30", false),
        ("projection = \"panorama\"\nmirror = true\nshift = [0.5, 0]", true),
        ("projection = \"panorama\"\nfov = 30", false),
        ("projection = \"panorama\"\nfocus = 3", false),
        ("projection = \"fisheye\"\nfov = 360", true),
        ("projection = \"fisheye\"\nfov = 361", false),
        ("projection = \"fisheye\"\naperture = 0.1", false),
        ("projection = \"fisheye\"\nview_height = 2", false),
    ] {
        let text = format!("{SCENE}{keys}\n");
        for faults in found(&text) {
            assert_eq!(faults.is_empty(), is_valid, "{keys}: {faults:?}");
        }
        let scene = glimt::scene::parse(text.as_str().into(), Path::new("a.toml")).scene;
        assert_eq!(scene.is_some(), is_valid, "{keys}");
    }
}

/// Every scene that the program accepts must satisfy the schema, if it can be checked without other files.
#[test]
fn schema_accepts_all_valid_scenes() {
    let mut count = 0;
    for path in files("tests/broken") {
        let text = fs::read_to_string(&path).expect("a file");
        let has_errors = glimt::scene::parse(text.as_str().into(), &path).scene.is_none();
        let Some(scene) = json(&text).filter(|_| !has_errors) else { continue };
        for draft in SchemaDraft::ALL {
            assert_eq!(violations(&schema(*draft), &scene), [], "{}", path.display());
        }
        count += 1;
    }
    assert!(count >= 3, "{count} files with only warnings");
}

#[test]
fn new_writes_the_schema() {
    let dir = TestDir::new();
    dir.expect("new --schema first.toml", 0);
    let scene = String::from_utf8(dir.bytes("first.toml")).expect("UTF-8");
    assert_eq!(scene, format!("{LINE}{}", starter_scene()));
    assert_eq!(String::from_utf8(dir.bytes(FILE)).expect("UTF-8"), schema_text(SchemaDraft::Four));
    assert!(dir.run("check first.toml").status.success());
    // A current schema file is reused. A different file is kept, and the command fails.
    dir.expect("new --schema second.toml", 0);
    dir.write(FILE, "mine");
    assert_mentions(&dir.expect("new --schema third.toml", 2), &[FILE, "--schema"]);
    assert!(!dir.path("third.toml").exists() && dir.bytes(FILE) == b"mine");
    // No schema is written for an existing scene.
    let other = TestDir::new();
    other.write("there.toml", "mine");
    assert_mentions(&other.expect("new --schema there.toml", 2), &["there.toml"]);
    assert!(!other.path(FILE).exists() && other.bytes("there.toml") == b"mine");
}

#[test]
fn both_drafts_are_printed() {
    let dir = TestDir::new();
    for (line, draft, uri) in [
        ("schema", SchemaDraft::Four, "http://json-schema.org/draft-04/schema#"),
        ("schema --draft 2020-12", SchemaDraft::Latest, "https://json-schema.org/draft/2020-12/schema"),
    ] {
        let output = dir.run(line);
        let printed: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(printed, schema(draft));
        assert_eq!(printed["$schema"], uri);
    }
}
