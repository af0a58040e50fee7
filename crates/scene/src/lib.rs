//! The scene file format: TOML syntax, validation and the resulting scene description.
//!
//! [`load`] checks a file's size and type and reads it. [`parse`] converts its text to a
//! [`description::Scene`] and a list of [`diagnostic::Diagnostic`]s. [`report`] formats diagnostics for the
//! terminal. Importers of foreign formats build a [`SceneDocumentBuilder`] instead of a text, and
//! [`load_from_built_document`] validates it in the same way.

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
mod source_files;
mod toml;

// Modules of lower-level crates, under the names used throughout the workspace.
use glimt_base::{choice, film, math, sampling, system};
use glimt_kernel::{geometry, lights, materials};

use std::collections::HashSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use self::toml::{InMemoryFile, SceneDocumentBuilder, SceneDocumentValue, quote_toml_string};
pub use changes::{MAX_COMPARED_BYTES, list_changes};
use description::{Camera, ResolvedCamera, Scene};
use diagnostic::{Diagnostic, Severity};
pub use document::MORE_LIKE_THESE;
pub use facing::MeshBoundingBox;
pub use key_path::{shortened_key, split_at_unquoted_space, split_dotted_key};
pub use other_content::{NEW_SCENE_HELP, detect_image_or_part_file, has_toml_extension};
pub use read::{find_renamed_scene_by_text, lacks_camera_header, missing_file_help};
pub use source::SceneText;
pub use source_files::SourceFiles;

/// Maximum size of a scene file in bytes.
pub const MAX_FILE_BYTES: u64 = 128 << 20;

/// Error message for a missing scene file.
pub const SCENE_NOT_FOUND: &str = "scene file not found";
/// Error message for a missing file with a model's extension.
pub const MODEL_NOT_FOUND: &str = "file not found";

/// Phrase in the help text for a missing scene that was probably renamed.
pub const SAME_TEXT: &str = "has the same text";

/// Whether a diagnostic reports that the scene or model file does not exist.
pub fn is_scene_not_found_diagnostic(diagnostic: &Diagnostic) -> bool {
    [SCENE_NOT_FOUND, MODEL_NOT_FOUND].contains(&diagnostic.message.as_str())
}

/// Maximum number of syntax elements (brackets, `=`, `,` and lines) in a scene file. Each element takes far
/// more space in memory than in the file. A scene with a million spheres has half this number.
const MAX_PARTS: usize = 32 << 20;

/// A valid scene, its text and warnings.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// The scene description.
    pub scene: Arc<Scene>,
    /// The file's text followed by the `--set` values. All spans in [`Self::scene`] index into it.
    pub source: SceneText,
    /// The document built from a foreign file, without the `--set` values. `None` for a scene file.
    pub built: Option<Arc<SceneDocumentBuilder>>,
    /// The path as passed by the caller.
    pub path: PathBuf,
    /// Likely mistakes, in file order.
    pub warnings: Vec<Diagnostic>,
    /// Files that the scene file itself references. Empty unless there are `--set` values, because only
    /// `--set` can replace references.
    pub named: Vec<PathBuf>,
    /// Spans of the values in `[render]` and `[photons]`.
    pub settings: Vec<SettingSpan>,
}

/// The location of a value in `[render]` or `[photons]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SettingSpan {
    /// The name of the table: `render` or `photons`.
    pub table: &'static str,
    /// Name of the key.
    pub key: String,
    /// Byte range of the value in the text, which includes the `--set` values.
    pub span: Range<usize>,
}

/// Reads the current text of a scene file.
///
/// # Errors
/// Returns the reason why the file cannot be read.
pub fn read_scene_file_text(path: &Path) -> Result<Arc<str>, Box<Diagnostic>> {
    read::read_scene_text(path)
}

impl LoadedScene {
    /// Whether the file at [`Self::path`] is not a scene file.
    pub fn is_foreign(&self) -> bool {
        self.built.is_some()
    }

    /// The files that exist only in memory, with their paths.
    pub fn in_memory_files(&self) -> impl Iterator<Item = (PathBuf, &InMemoryFile)> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let files = self.built.iter().flat_map(|built| built.generated.iter());
        files.map(move |(name, file)| (folder.join(name), file))
    }

    /// Returns the text of the scene file after writing `camera` to `[camera]`. Replaces numbers in place and
    /// adds missing keys. Comments and formatting stay unchanged.
    ///
    /// # Errors
    /// Returns the reason why the `[camera]` table cannot be edited.
    pub fn text_with_camera(&self, camera: &ResolvedCamera) -> Result<String, String> {
        match &self.built {
            Some(built) => edit::replace_camera(&built.to_toml(), camera),
            None => edit::replace_camera(self.source.text_without_set_args(), camera),
        }
    }

    /// Reads the camera from a scene's text, with `--set` values applied. Returns `None` if the text or a
    /// value has errors.
    pub fn parse_camera_from_text(text: &str, sets: &[String]) -> Option<Camera> {
        document::parse_camera(&SceneText::with_set_args(text.into(), sets).ok()?)
    }

    /// In scenes with mesh files, returns warnings about lights that shine away from everything. Calls
    /// `bounds` only if there are candidates. It must return one item per entry of [`Scene::mesh_files`].
    pub fn lights_facing_nothing_warnings(
        &self,
        bounds: impl FnOnce() -> Vec<MeshBoundingBox>,
    ) -> Vec<Diagnostic> {
        if self.scene.mesh_files.is_empty() {
            return Vec::new();
        }
        let warning = |span| {
            let help = Some(facing::HELP.to_owned());
            let mut warning = self.create_diagnostic_at(span, Severity::Warning, facing::MESSAGE, help);
            if let Some(place) = &mut warning.place {
                place.label = facing::LABEL.to_owned();
            }
            warning
        };
        facing::spans_of_lights_facing_nothing(&self.scene, bounds).into_iter().map(warning).collect()
    }

    /// Returns the 1-based line number in the file where `span` starts, or `None` if the file has no text for
    /// it.
    pub fn line_number(&self, span: &Range<usize>) -> Option<usize> {
        self.source.span_refers_to_text(span).then(|| self.source.line_number(span))
    }

    /// Returns the span of a setting's value in the file or in a `--set` argument, or `None` if neither sets
    /// it.
    pub fn setting_value_span(&self, table: &str, key: &str) -> Option<Range<usize>> {
        let is_setting = |setting: &&SettingSpan| setting.table == table && setting.key == key;
        self.settings.iter().find(is_setting).map(|setting| setting.span.clone())
    }

    /// Creates a diagnostic at `span` for a problem found after parsing, such as a mesh without usable faces
    /// or a texture that cannot be decoded.
    pub fn create_diagnostic_at(
        &self,
        span: Range<usize>,
        severity: Severity,
        message: impl Into<String>,
        help: Option<String>,
    ) -> Diagnostic {
        let (path, place) = self.source.resolve_span(&self.path, span, String::new());
        Diagnostic { severity, message: message.into(), path, place, help }
    }
}

/// Result of parsing a scene's text.
#[derive(Clone, Debug)]
pub struct ParseOutcome {
    /// The scene, or `None` if there is an error.
    pub scene: Option<Scene>,
    /// Errors and warnings, in text order.
    pub diagnostics: Vec<Diagnostic>,
    /// Spans of the values in `[render]` and `[photons]`.
    pub settings: Vec<SettingSpan>,
}

/// Reads and validates a scene file. `sets` are overrides of the form `TABLE.KEY=VALUE`.
///
/// # Errors
/// Returns all errors and warnings, in file order. Rejects anything but a regular UTF-8 file of at most
/// [`MAX_FILE_BYTES`] bytes, without blocking.
pub fn load(path: &Path, sets: &[String]) -> Result<LoadedScene, Vec<Diagnostic>> {
    let text = read::read_scene_text(path).map_err(|problem| vec![*problem])?;
    let source = SceneText::with_set_args(text, sets)?;
    let outcome = document::parse_and_lower(&source, path);
    let named = || document::files_referenced_by_text(source.text_without_set_args(), path);
    let named = if sets.is_empty() { Vec::new() } else { named() };
    loaded_scene_from_parse_outcome(outcome, source, None, path, named)
}

/// Like [`load`], for a document built from the foreign file at `path`. Diagnostics have no position if the
/// document has no spans.
///
/// # Errors
/// Returns all errors and warnings.
pub fn load_from_built_document(
    built: SceneDocumentBuilder,
    path: &Path,
    sets: &[String],
) -> Result<LoadedScene, Vec<Diagnostic>> {
    let source =
        SceneText::with_set_args(Arc::clone(&built.source), sets)?.mark_foreign(Arc::clone(&built.files));
    let outcome = document::lower_built(&source, &built, path);
    let mut named =
        if sets.is_empty() { Vec::new() } else { document::referenced_files(&built.document, path) };
    let folder = path.parent().unwrap_or(Path::new(""));
    let generated: HashSet<PathBuf> = built.generated.keys().map(|name| folder.join(name)).collect();
    named.retain(|file| !generated.contains(file));
    loaded_scene_from_parse_outcome(outcome, source, Some(Arc::new(built)), path, named)
}

fn loaded_scene_from_parse_outcome(
    ParseOutcome { scene, diagnostics, settings }: ParseOutcome,
    source: SceneText,
    built: Option<Arc<SceneDocumentBuilder>>,
    path: &Path,
    named: Vec<PathBuf>,
) -> Result<LoadedScene, Vec<Diagnostic>> {
    match scene {
        Some(scene) => {
            let (scene, path) = (Arc::new(scene), path.to_owned());
            Ok(LoadedScene { scene, source, built, path, warnings: diagnostics, named, settings })
        }
        None => Err(diagnostics),
    }
}

/// Returns the files that a scene file references, even if the scene has errors. The list is empty for
/// unreadable files and files that are not scene files.
pub fn referenced_files(path: &Path) -> Vec<PathBuf> {
    read::read_scene_text(path).map_or(Vec::new(), |text| document::files_referenced_by_text(&text, path))
}

/// Validates the text of a scene file. `path` is used in diagnostics and to resolve relative paths, but the
/// file itself is not read. Only the metadata of referenced files is read.
pub fn parse(text: Arc<str>, path: &Path) -> ParseOutcome {
    if text.contains('\0') {
        return ParseOutcome {
            scene: None,
            diagnostics: vec![*read::binary_file_error(path)],
            settings: Vec::new(),
        };
    }
    document::parse_and_lower(&SceneText::from_file_text(text), path)
}

/// Returns the commented scene written by `glimt new`.
pub fn starter_scene() -> &'static str {
    include_str!("starter.toml")
}

#[cfg(test)]
mod built_tests;
#[cfg(test)]
mod group_tests;
#[cfg(test)]
mod set_tests;
#[cfg(test)]
mod tests;
