//! The scene file format: TOML syntax, validation and the resulting scene description.
//!
//! [`load`] reads a file with size and type checks, [`parse`] turns its text into a [`description::Scene`] and a list of
//! [`diagnostic::Diagnostic`]s, and [`report`] formats diagnostics for the terminal.

mod changes;
pub mod description;
pub mod diagnostic;
mod document;
mod edit;
mod facing;
pub mod fingerprint;
mod key_path;
pub mod keys;
pub mod nearest;
mod other_content;
pub mod outline;
mod read;
pub mod report;
pub mod sanitize;
mod source;
mod toml;

// Modules of lower crates, under the names used throughout the workspace.
use glimt_base::{choice, film, math, sampling, system};
use glimt_kernel::{geometry, lights, materials};

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use changes::{MOST_COMPARED_BYTES, changes};
use description::{Camera, Scene, Viewpoint};
use diagnostic::{Diagnostic, Severity};
pub use facing::MeshBounds;
pub use key_path::{key_parts, shortened_key, split_key};
pub use other_content::other_content;
pub use read::same_text_beside;
pub use source::{SceneText, quoted};

/// Largest accepted scene file, in bytes.
pub const MAX_FILE_BYTES: u64 = 128 << 20;

/// Message for a missing scene file.
pub const SCENE_NOT_FOUND: &str = "scene file not found";
/// Message for a missing file with the extension of a model.
pub const MODEL_NOT_FOUND: &str = "file not found";

/// Phrase that names a renamed copy in the help of the error about a missing scene.
pub const SAME_TEXT: &str = "has the same text";

/// Whether a diagnostic reports that the scene or model file does not exist.
pub fn is_absence(diagnostic: &Diagnostic) -> bool {
    [SCENE_NOT_FOUND, MODEL_NOT_FOUND].contains(&diagnostic.message.as_str())
}

/// Maximum number of syntax elements (brackets, `=`, `,` and lines) in a scene file: each takes many times its size in memory. A scene
/// of a million spheres has half as many.
const MAX_PARTS: usize = 32 << 20;

/// A valid scene, with its text and warnings.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene description.
    pub scene: Arc<Scene>,
    /// The file's text followed by the `--set` values. All spans in [`Self::scene`] index into it.
    pub source: SceneText,
    /// The path as given by the caller.
    pub path: PathBuf,
    /// Likely mistakes, in file order.
    pub warnings: Vec<Diagnostic>,
    /// Files referenced by the scene file itself; filled only with `--set`, which may replace them.
    pub named: Vec<PathBuf>,
    /// Spans of the settings' values.
    pub settings: Vec<Setting>,
}

/// The span of a value in `[render]` or `[photons]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// The name of the table: `render` or `photons`.
    pub table: &'static str,
    /// The key.
    pub key: String,
    /// Byte range in the text with the `--set` values.
    pub span: Range<usize>,
}

/// Reads the current text of a scene file.
///
/// # Errors
/// The reason that the file cannot be read.
pub fn text_now(path: &Path) -> Result<Arc<str>, Box<Diagnostic>> {
    read::text(path)
}

impl Loaded {
    /// Returns the file's text with `camera` written into `[camera]`. Replaces numbers in place and adds missing keys;
    /// comments and formatting stay unchanged.
    ///
    /// # Errors
    /// The reason that the table cannot be edited.
    pub fn text_with_camera(&self, camera: &Viewpoint) -> Result<String, String> {
        edit::with_camera(self.source.text(), camera)
    }

    /// The camera of a scene text with `--set` values applied. `None` if either has errors.
    pub fn camera_of(text: &str, sets: &[String]) -> Option<Camera> {
        document::camera_of(&SceneText::with_sets(text.into(), sets).ok()?)
    }

    /// Warnings for lights that shine away from everything, in scenes with mesh files. Calls `bounds` only if there are
    /// candidates; it returns one item per entry of [`Scene::mesh_files`].
    pub fn lights_facing_away(&self, bounds: impl FnOnce() -> Vec<MeshBounds>) -> Vec<Diagnostic> {
        if self.scene.mesh_files.is_empty() {
            return Vec::new();
        }
        let warning = |span| {
            let help = Some(facing::HELP.to_owned());
            let mut warning = self.diagnostic_at(span, Severity::Warning, facing::MESSAGE, help);
            if let Some(place) = &mut warning.place {
                place.label = facing::LABEL.to_owned();
            }
            warning
        };
        facing::away(&self.scene, bounds).into_iter().map(warning).collect()
    }

    /// The line number in the file, from 1, where `span` starts.
    pub fn line(&self, span: &Range<usize>) -> usize {
        let before = self.source.text().get(..span.start).unwrap_or_default();
        before.bytes().filter(|byte| *byte == b'\n').count() + 1
    }

    /// The span of a setting's value, in the file or in a `--set` argument. `None` if neither sets it.
    pub fn setting(&self, table: &str, key: &str) -> Option<Range<usize>> {
        let is_it = |setting: &&Setting| setting.table == table && setting.key == key;
        self.settings.iter().find(is_it).map(|setting| setting.span.clone())
    }

    /// Creates a diagnostic at `span`, for problems found after parsing, such as a mesh without usable faces or a texture
    /// that does not decode.
    pub fn diagnostic_at(
        &self,
        span: Range<usize>,
        severity: Severity,
        message: impl Into<String>,
        help: Option<String>,
    ) -> Diagnostic {
        let (path, place) = self.source.place(&self.path, span, String::new());
        Diagnostic { severity, message: message.into(), path, place, help }
    }
}

/// Result of parsing a scene text.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The scene. `None` if there is an error.
    pub scene: Option<Scene>,
    /// Errors and warnings, in text order.
    pub diagnostics: Vec<Diagnostic>,
    /// Spans of the settings' values.
    pub settings: Vec<Setting>,
}

/// Reads and validates a scene file. `sets` are overrides of the form `TABLE.KEY=VALUE`.
///
/// # Errors
/// All errors and warnings, in file order. Anything but a regular file of at most [`MAX_FILE_BYTES`] bytes of UTF-8 is
/// rejected without blocking.
pub fn load(path: &Path, sets: &[String]) -> Result<Loaded, Vec<Diagnostic>> {
    let text = read::text(path).map_err(|problem| vec![*problem])?;
    load_source(SceneText::with_sets(text, sets)?, path, sets)
}

/// Like [`load`], for the generated scene of the model at `path`. Diagnostics have no line, as the text is in no file.
///
/// # Errors
/// As for [`load`].
pub fn load_generated(text: Arc<str>, path: &Path, sets: &[String]) -> Result<Loaded, Vec<Diagnostic>> {
    load_source(SceneText::with_sets(text, sets)?.generated(), path, sets)
}

fn load_source(source: SceneText, path: &Path, sets: &[String]) -> Result<Loaded, Vec<Diagnostic>> {
    let Outcome { scene, diagnostics, settings } = document::lower(&source, path);
    match scene {
        Some(scene) => {
            let named = if sets.is_empty() { Vec::new() } else { document::named_files(source.text(), path) };
            let (scene, path) = (Arc::new(scene), path.to_owned());
            Ok(Loaded { scene, source, path, warnings: diagnostics, named, settings })
        }
        None => Err(diagnostics),
    }
}

/// Validates the text of a scene file. `path` is not read: it is used in diagnostics, and relative paths are resolved
/// against its folder. Of referenced files only the metadata is read.
pub fn parse(text: Arc<str>, path: &Path) -> Outcome {
    if text.contains('\0') {
        return Outcome { scene: None, diagnostics: vec![*read::binary(path)], settings: Vec::new() };
    }
    document::lower(&SceneText::file(text), path)
}

/// Whether a file is a model: it has a mesh extension and does not contain a scene.
pub fn is_model(path: &Path) -> bool {
    read::is_model(path)
}

/// Whether a file has a mesh extension.
pub fn is_mesh(path: &Path) -> bool {
    document::is_mesh(path)
}

/// The commented scene that `glimt new` writes.
pub fn starter() -> &'static str {
    include_str!("starter.toml")
}

#[cfg(test)]
mod set_tests;
#[cfg(test)]
mod tests;
