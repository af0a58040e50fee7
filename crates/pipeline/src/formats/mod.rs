//! Foreign formats: files other than scene files that glimt can render or import.
//!
//! [`FORMATS`] lists the formats with their extensions and importers. It is the only place that determines
//! the format of a file on the command line. An importer reads the file into a [`ForeignScene`], whose
//! document consists of the same tables and keys as a scene file. [`scene_from_document`] validates the
//! document like a scene file, and `glimt import` writes it as one; the rest of the pipeline is independent
//! of the format. `model` generates the view and the lights for models. `glimt MODEL` and `glimt import`
//! share it, so they produce the same image.

pub(crate) mod foreign;
mod frame;
mod gltf;
mod import;
mod mesh;
mod mitsuba;
pub(crate) mod model;
mod pbrt;
mod rounding;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use self::foreign::{ForeignError, ForeignOptions};
use self::model::ModelViewOptions;
use super::stages::containers::OpenAssetFiles;
use crate::assets::{Companion, FileHash};
use crate::control::CancelToken;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::sanitize::escape_invisible_chars;
use crate::scene::{
    LoadedScene, MODEL_NOT_FOUND, NEW_SCENE_HELP, SceneDocumentBuilder, lacks_camera_header,
    load_from_built_document, missing_file_help,
};
use crate::system::file::{FileKind, file_kind_and_metadata};

pub use import::{ImportError, import_scene};

/// All foreign formats.
const FORMATS: [ForeignFormat; 6] = [
    ForeignFormat {
        extensions: &["obj", "off", "serialized"],
        is_model: true,
        read: mesh::read_y_up_mesh,
        convert: None,
    },
    ForeignFormat { extensions: &["ply"], is_model: true, read: mesh::read_ply, convert: None },
    ForeignFormat { extensions: &["stl"], is_model: true, read: mesh::read_stl, convert: None },
    ForeignFormat {
        extensions: &["glb", "gltf"],
        is_model: true,
        read: gltf::read,
        convert: Some(gltf::convert),
    },
    ForeignFormat {
        extensions: &["pbrt"],
        is_model: false,
        read: pbrt::read,
        convert: Some(pbrt::import_with_assets),
    },
    ForeignFormat {
        extensions: &["xml"],
        is_model: false,
        read: mitsuba::read,
        convert: Some(mitsuba::import_with_assets),
    },
];

/// Extensions of unsupported model formats.
const UNSUPPORTED_EXTENSIONS: [&str; 22] = [
    "3dm", "3ds", "3mf", "abc", "blend", "c4d", "dae", "fbx", "iges", "igs", "lwo", "ma", "max", "mb",
    "step", "stp", "usd", "usda", "usdc", "usdz", "wrl", "x3d",
];

/// A foreign format.
#[derive(Debug)]
pub(crate) struct ForeignFormat {
    /// Extensions in lowercase, without dots.
    extensions: &'static [&'static str],
    /// Whether the file is a model rather than a scene. Users do not edit models as text, and glimt chooses a
    /// view and lights for them.
    pub(crate) is_model: bool,
    /// Reads a file.
    pub(crate) read: ReadFn,
    /// Converts a file to a scene for `glimt import`, with the meshes and images in the named folder. `None`
    /// if the format cannot be imported.
    convert: Option<ImportFn>,
}

type ReadFn = fn(&Path, &ForeignReadContext<'_>) -> Result<ForeignScene, ForeignError>;
type ImportFn = fn(&Path, &str, &ForeignReadContext<'_>) -> Result<ImportedScene, ForeignError>;

/// Everything an importer needs besides the file.
#[derive(Clone, Copy)]
pub(crate) struct ForeignReadContext<'a> {
    /// View of a model.
    pub(crate) view: ModelViewOptions,
    /// Options for scenes from other renderers.
    pub(crate) options: &'a ForeignOptions,
    /// Open files. Meshes stored here are not read again when the scene's assets are loaded.
    pub(crate) containers: &'a OpenAssetFiles,
    pub(crate) token: &'a CancelToken,
}

/// The scene in a foreign file.
#[derive(Debug)]
pub(crate) struct ForeignScene {
    /// The tables and keys of the scene.
    pub(crate) document: SceneDocumentBuilder,
    /// Hash of the file.
    pub(crate) hash: FileHash,
    /// Other files to watch because they affect the scene, without the assets that the document references.
    pub(crate) companions: Vec<Companion>,
    /// Other warnings, such as missing materials or features that glimt defines differently.
    pub(crate) notes: Vec<Diagnostic>,
    /// Features without an equivalent, and what replaces them.
    pub(crate) substitutions: Vec<Diagnostic>,
}

/// A foreign file converted to a scene file, ready to be written.
#[derive(Debug)]
pub struct ImportedScene {
    /// The scene. Its paths are relative to the scene file.
    pub document: SceneDocumentBuilder,
    /// Files referenced by the scene, with paths relative to the scene file.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// Features without an equivalent, and what replaces them.
    pub substitutions: Vec<Diagnostic>,
    /// Warnings other than substitutions.
    pub notes: Vec<Diagnostic>,
}

/// Validates a document like a scene file, with the overrides from the command line.
///
/// # Errors
/// Returns all errors and warnings.
pub(crate) fn scene_from_document(
    document: SceneDocumentBuilder,
    path: &Path,
    sets: &[String],
) -> Result<LoadedScene, Vec<Diagnostic>> {
    load_from_built_document(document, path, sets).map_err(|mut errors| {
        // The user cannot see generated values, so explain their origin. Errors in overrides need no prefix.
        for error in errors.iter_mut().filter(|error| error.path == path && error.place.is_none()) {
            let what = if has_model_extension(path) {
                "generated for this model"
            } else {
                "converted from this file"
            };
            error.message = format!("in the scene {what}, {}", error.message);
        }
        errors
    })
}

impl ForeignFormat {
    /// Returns the format with the path's extension. The file need not exist.
    fn from_extension(path: &Path) -> Option<&'static Self> {
        FORMATS.iter().find(|format| format.extensions.contains(&lowercase_extension(path).as_str()))
    }

    /// Returns the format of a readable file, or `None` if the file must be read as a scene file, which may
    /// have any extension.
    pub(crate) fn from_file_unless_scene(path: &Path) -> Option<&'static Self> {
        Self::from_extension(path).filter(|_| lacks_camera_header(path))
    }
}

/// Returns the error for a file that is not a scene file, or `None` if the file must be read as a scene file.
/// Files with the extension of a foreign format are not scene files unless they have a scene's header.
pub fn not_a_scene_file_error(path: &Path) -> Option<Diagnostic> {
    let error = |message: String, help| {
        Some(Diagnostic { help, ..Diagnostic::about_file(path, Severity::Error, message) })
    };
    let extension = lowercase_extension(path);
    if UNSUPPORTED_EXTENSIONS.contains(&extension.as_str()) && lacks_camera_header(path) {
        let models = FORMATS.iter().filter(|format| format.is_model).flat_map(|format| format.extensions);
        let models: Vec<_> = models.map(|one| format!(".{one}")).collect();
        let help = format!("export it in one of these formats: {}", models.join(", "));
        return error(format!("glimt cannot read .{extension} models"), Some(help));
    }
    ForeignFormat::from_extension(path)?;
    match file_kind_and_metadata(path) {
        Ok((FileKind::Regular, _)) if lacks_camera_header(path) => {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
            let help = format!(
                "to use it in a scene, add [[mesh]] with `file = \"{}\"`; {NEW_SCENE_HELP}",
                escape_invisible_chars(&name)
            );
            error("this is a mesh, not a scene".to_owned(), Some(help))
        }
        Ok((FileKind::Regular, _)) => None,
        Ok((kind, _)) => error(format!("this is {}, not a model", kind.description()), None),
        // `scene::load` reports dangling links and other errors.
        Err(failure) if failure.kind() == ErrorKind::NotFound && !path.is_symlink() => {
            error(MODEL_NOT_FOUND.to_owned(), missing_file_help(path, has_foreign_extension))
        }
        Err(_) => None,
    }
}

/// Returns a path's extension in lowercase, or an empty string.
fn lowercase_extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Whether a path has a foreign format's extension.
pub fn has_foreign_extension(path: &Path) -> bool {
    ForeignFormat::from_extension(path).is_some()
}

/// Whether a path has a model's extension.
pub fn has_model_extension(path: &Path) -> bool {
    ForeignFormat::from_extension(path).is_some_and(|format| format.is_model)
}

/// Whether a path has the extension of a format that `glimt import` accepts.
pub fn has_importable_extension(path: &Path) -> bool {
    ForeignFormat::from_extension(path).is_some_and(|format| format.convert.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::keys::endings::MESHES;

    #[test]
    fn extensions_are_unique_and_every_mesh_is_a_model() {
        let mut all: Vec<_> = FORMATS.iter().flat_map(|format| format.extensions).collect();
        all.sort_unstable();
        assert!(all.windows(2).all(|two| two[0] != two[1]), "{all:?}");
        for extension in MESHES {
            let path = PathBuf::from(format!("a.{}", extension.to_uppercase()));
            assert!(has_model_extension(&path) && has_foreign_extension(&path), "{extension}");
        }
        for other in ["a.toml", "a.png", "obj", "a"] {
            assert!(!has_foreign_extension(Path::new(other)), "{other}");
        }
    }

    #[test]
    fn scene_files_may_have_any_extension() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.obj");
        assert!(ForeignFormat::from_file_unless_scene(&path).is_none(), "missing files have no format");
        std::fs::write(&path, "v 0 0 0\n").expect("written");
        assert!(ForeignFormat::from_file_unless_scene(&path).is_some());
        std::fs::write(&path, "[camera]\n").expect("written");
        assert!(ForeignFormat::from_file_unless_scene(&path).is_none());
    }

    fn message(path: &Path) -> Diagnostic {
        not_a_scene_file_error(path).expect("a diagnostic")
    }

    #[test]
    fn missing_models_suggest_similar_names() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("cornell.toml"), "").expect("written");
        std::fs::write(folder.path().join("knot.obj"), "").expect("written");
        for (name, help) in [("know.obj", Some("knot.obj")), ("nothing.glb", None), ("cornell.ply", None)] {
            let model = message(&folder.path().join(name));
            assert_eq!(model.message, MODEL_NOT_FOUND);
            assert_eq!(model.help.is_some(), help.is_some(), "{name}: {:?}", model.help);
            assert!(model.help.is_none_or(|help| help.contains("did you mean") && help.contains("knot.obj")));
        }
        std::fs::create_dir(folder.path().join("folder.ply")).expect("made");
        assert!(message(&folder.path().join("folder.ply")).message.ends_with("not a model"));
        assert_eq!(not_a_scene_file_error(&folder.path().join("missing.fbx")), None);
    }

    #[test]
    fn models_are_not_scenes() {
        let folder = tempfile::tempdir().expect("a folder");
        let contents: [(&str, &[u8]); 4] =
            [("a.obj", b"v 0 0 0\n"), ("b.PLY", b"ply\n"), ("c.glb", b"glTF\0\0"), ("d.FBX", b"Kaydara\n")];
        for (name, content) in contents {
            let path = folder.path().join(name);
            std::fs::write(&path, content).expect("written");
            let Diagnostic { message, help, .. } = message(&path);
            let help = help.expect("a help text");
            if name == "d.FBX" {
                assert!(
                    message.contains(".fbx")
                        && help.contains(".obj, .off, .serialized, .ply, .stl, .glb, .gltf")
                );
            } else {
                assert_eq!(message, "this is a mesh, not a scene");
                assert!(help.contains(&format!("`file = \"{name}\"`")), "{help}");
            }
            std::fs::write(&path, "[camera]\n").expect("written");
            assert_eq!(not_a_scene_file_error(&path), None);
        }
    }
}
