//! Tests of the Mitsuba reader: small scenes and the tables they are converted to.

mod broken;
mod facts;
mod features;
mod files;
mod fuzz;
mod limits;
mod messages;
mod unused;

use std::path::{Path, PathBuf};

use super::{import_with_assets, read};
use crate::control::CancelToken;
use crate::formats::foreign::{ForeignError, ForeignOptions};
use crate::formats::model::ModelViewOptions;
use crate::formats::{ForeignReadContext, ForeignScene, ImportedScene, scene_from_document};
use crate::scene::LoadedScene;
use crate::scene::diagnostic::Diagnostic;
use crate::stages::containers::OpenAssetFiles;

/// A minimal sensor. Every scene needs one.
const SENSOR: &str = r#"<sensor type="perspective"/>"#;

/// A temporary folder with the files of a scene.
struct Bench {
    folder: tempfile::TempDir,
    options: ForeignOptions,
}

impl Bench {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a folder"), options: ForeignOptions::default() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> &Self {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("created");
        std::fs::write(path, content).expect("written");
        self
    }

    fn with_context<T>(&self, use_: impl FnOnce(&Path, &ForeignReadContext<'_>) -> T) -> T {
        let (containers, token) = (OpenAssetFiles::default(), CancelToken::new());
        let context = ForeignReadContext {
            view: ModelViewOptions::default(),
            options: &self.options,
            containers: &containers,
            token: &token,
        };
        use_(&self.path("scene.xml"), &context)
    }

    fn read(&self) -> Result<ForeignScene, Vec<Diagnostic>> {
        self.with_context(read).map_err(diagnostics)
    }

    fn import(&self) -> ImportedScene {
        self.with_context(|path, context| import_with_assets(path, "scene_files", context))
            .map_err(diagnostics)
            .expect("valid")
    }

    /// The scene's tables as TOML, without the leading comment.
    fn toml(&self) -> String {
        let text = self.read().expect("a valid scene").document.to_toml();
        text.split_once("\n\n").map_or(text.clone(), |(_, tables)| tables.to_owned())
    }

    /// The validated scene.
    fn loaded(&self) -> LoadedScene {
        let document = self.read().expect("a valid scene").document;
        scene_from_document(document, &self.path("scene.xml"), &[]).expect("valid tables")
    }

    /// Messages of all notes and substitutions.
    fn notes(&self) -> Vec<String> {
        let ForeignScene { notes, substitutions, .. } = self.read().expect("a valid scene");
        notes.into_iter().chain(substitutions).map(|one| one.message).collect()
    }
}

fn diagnostics(error: ForeignError) -> Vec<Diagnostic> {
    match error {
        ForeignError::Scene { diagnostics, .. } => diagnostics,
        ForeignError::Asset(error) => panic!("{error}"),
    }
}

/// A version 3 scene with a sensor and `content`.
fn scene(content: &str) -> Bench {
    let bench = Bench::new();
    bench.write("scene.xml", format!("<scene version=\"3.0.0\">{SENSOR}{content}</scene>"));
    bench
}

/// The tables of a scene with one sphere that has the BSDF `bsdf`.
fn material(bsdf: &str) -> String {
    scene(&format!("<shape type=\"sphere\">{bsdf}</shape>")).toml()
}

/// Asserts that `text` contains `line`.
#[track_caller]
fn has_line(text: &str, line: &str) {
    assert!(text.lines().any(|found| found == line), "no line `{line}` in:\n{text}");
}

/// Asserts that no line of `text` starts with `start`.
#[track_caller]
fn lacks(text: &str, start: &str) {
    assert!(!text.lines().any(|found| found.starts_with(start)), "a line starts with `{start}` in:\n{text}");
}

/// Returns the numbers of the line `key = […]` or `key = …`.
#[track_caller]
fn numbers(text: &str, key: &str) -> Vec<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(&format!("{key} = ")));
    let line = line.unwrap_or_else(|| panic!("no `{key}` in:\n{text}"));
    let words = line.trim_matches(['[', ']']).split(',');
    words.map(|word| word.trim().parse().unwrap_or_else(|_| panic!("{line}"))).collect()
}

/// Asserts that all numbers are within `tolerance` of the wanted ones.
#[track_caller]
fn close(found: &[f64], wanted: &[f64], tolerance: f64) {
    let is_close = found.len() == wanted.len()
        && found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() <= tolerance);
    assert!(is_close, "{found:?} is not {wanted:?}");
}

/// A PNG file with one gray pixel, with or without an alpha channel.
fn png(has_alpha: bool) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = match has_alpha {
        true => {
            image::DynamicImage::ImageLumaA8(image::ImageBuffer::from_pixel(1, 1, image::LumaA([128, 255])))
        }
        false => image::DynamicImage::ImageLuma8(image::ImageBuffer::from_pixel(1, 1, image::Luma([128]))),
    };
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("encoded");
    bytes.into_inner()
}

const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

#[test]
fn small_scenes_are_valid() {
    let loaded = scene(
        r#"<integrator type="path"/><bsdf type="diffuse" id="wall"/>
        <shape type="rectangle"><ref id="wall"/></shape>
        <shape type="cube"><bsdf type="roughconductor"/></shape>
        <shape type="cylinder"><bsdf type="twosided"><bsdf type="plastic"/></bsdf></shape>
        <shape type="disk"><emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
        <emitter type="point"><point name="position" x="0" y="3" z="0"/></emitter>"#,
    )
    .loaded();
    assert_eq!((loaded.scene.objects.len(), loaded.scene.lights.len()), (4, 1));
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
}

#[test]
fn imported_scenes_copy_their_assets() {
    let bench = scene(r#"<shape type="obj"><string name="filename" value="meshes/a.obj"/></shape>"#);
    bench.write("meshes/a.obj", OBJ);
    let imported = bench.import();
    has_line(&imported.document.to_toml(), "file = \"scene_files/a.obj\"");
    assert_eq!(imported.files, [(PathBuf::from("scene_files/a.obj"), OBJ.as_bytes().to_vec())]);
}

#[test]
fn included_files_are_watched() {
    let bench = scene(r#"<include filename="parts/light.xml"/>"#);
    bench.write("parts/light.xml", "<scene version=\"3.0.0\"><emitter type=\"constant\"/></scene>");
    let companions: Vec<_> =
        bench.read().expect("valid").companions.into_iter().map(|one| one.path).collect();
    assert_eq!(companions, [bench.path("parts/light.xml")]);
}

#[test]
fn instances_place_groups() {
    let text = scene(
        r#"<shape type="shapegroup" id="pair"><shape type="sphere"/><shape type="cube"/></shape>
        <shape type="instance"><ref id="pair"/><transform name="to_world"><translate x="2"/></transform></shape>
        <shape type="instance"><ref id="pair"/></shape>"#,
    );
    let toml = text.toml();
    has_line(&toml, "[[groups.pair.sphere]]");
    has_line(&toml, "[[groups.pair.box]]");
    has_line(&toml, "matrix = [1, 0, 0, 2,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1]");
    assert_eq!(text.loaded().scene.objects.len(), 4);
}
