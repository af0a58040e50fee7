//! The scene file: its syntax, its validation and what it means.
//!
//! [`load`] reads a file safely, [`parse`] turns its text into a [`description::Scene`] and a list of
//! [`diagnostic::Diagnostic`]s; [`report`] makes text of those.

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
pub use source::{Source, quoted};

/// Scene files over this size, in bytes, are refused.
pub const MAX_FILE_BYTES: u64 = 128 << 20;

/// The message where a scene file is not there.
const NO_SUCH_FILE: &str = "there is no such scene file";
/// Message about a file that is not there and is named like a model.
const NO_SUCH_MODEL: &str = "there is no such file";

/// Words about another file in the help of an error about a missing scene.
pub const SAME_TEXT: &str = "has the same text";

/// Whether a diagnostic says that a scene or model does not exist.
pub fn is_absence(diagnostic: &Diagnostic) -> bool {
    [NO_SUCH_FILE, NO_SUCH_MODEL].contains(&diagnostic.message.as_str())
}

/// Scene files of more parts are refused, as each takes many times its bytes in memory: brackets, `=`, `,` and lines. A
/// million spheres have half as many.
const MAX_PARTS: usize = 32 << 20;

/// A scene file that can be rendered.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// Its meaning.
    pub scene: Arc<Scene>,
    /// Its text, and what the call sets, which every span in [`Self::scene`] points into.
    pub source: Source,
    /// The file, as named by the caller.
    pub path: PathBuf,
    /// Likely mistakes, in the order of the file.
    pub warnings: Vec<Diagnostic>,
    /// Files that the scene file names, where the call sets anything: other ones may be read in their place.
    pub named: Vec<PathBuf>,
    /// Places of the settings' values.
    pub settings: Vec<Setting>,
}

/// The place of a value in a table of settings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// The name of the table: `render` or `photons`.
    pub table: &'static str,
    /// The key.
    pub key: String,
    /// Bytes of the text, and of what the call sets.
    pub span: Range<usize>,
}

/// The text of a scene file as it is now.
///
/// # Errors
/// Why it cannot be read, with its name.
pub fn text_now(path: &Path) -> Result<Arc<str>, Box<Diagnostic>> {
    read::text(path)
}

impl Loaded {
    /// The text of the file with this camera in place of its own: numbers take the place of numbers, keys that are not there
    /// are added, all else stays as it is.
    ///
    /// # Errors
    /// Why that cannot be.
    pub fn text_with_camera(&self, camera: &Viewpoint) -> Result<String, String> {
        edit::with_camera(self.source.text(), camera)
    }

    /// The camera of a text with what the call sets, if both can be read.
    pub fn camera_of(text: &str, sets: &[String]) -> Option<Camera> {
        document::camera_of(&Source::with_sets(text.into(), sets).ok()?)
    }

    /// A warning for each light that shines away from everything, as far as only the loaded meshes show it. Asks for their
    /// bounds, one for each of [`Scene::mesh_files`], if there are such lights.
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

    /// The line of the file, from 1, in which something begins.
    pub fn line(&self, span: &Range<usize>) -> usize {
        let before = self.source.text().get(..span.start).unwrap_or_default();
        before.bytes().filter(|byte| *byte == b'\n').count() + 1
    }

    /// Place of a setting's value: in the file or in the values that the call sets. `None` if neither sets it.
    pub fn setting(&self, table: &str, key: &str) -> Option<Range<usize>> {
        let is_it = |setting: &&Setting| setting.table == table && setting.key == key;
        self.settings.iter().find(is_it).map(|setting| setting.span.clone())
    }

    /// A diagnostic at a place of this scene file, for what shows only later: a mesh without a usable face, a
    /// texture that does not decode.
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

/// Meaning of a text, as far as it could be understood.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The scene; none if there is an error.
    pub scene: Option<Scene>,
    /// Errors and warnings, in the order of the text.
    pub diagnostics: Vec<Diagnostic>,
    /// Places of the settings' values.
    pub settings: Vec<Setting>,
}

/// Reads and validates a scene file, with values in place of its own: texts of the form `TABLE.KEY=VALUE`.
///
/// # Errors
/// Everything that is wrong with it, and its warnings, in the order of the file. Anything but a regular file
/// of at most [`MAX_FILE_BYTES`] bytes of UTF-8 text is refused without blocking.
pub fn load(path: &Path, sets: &[String]) -> Result<Loaded, Vec<Diagnostic>> {
    let text = read::text(path).map_err(|problem| vec![*problem])?;
    load_source(Source::with_sets(text, sets)?, path, sets)
}

/// Validates a text as the scene of a model, which is not read: its lines are in no file. Otherwise as [`load`].
///
/// # Errors
/// As for [`load`].
pub fn load_made(text: Arc<str>, path: &Path, sets: &[String]) -> Result<Loaded, Vec<Diagnostic>> {
    load_source(Source::with_sets(text, sets)?.made(), path, sets)
}

fn load_source(source: Source, path: &Path, sets: &[String]) -> Result<Loaded, Vec<Diagnostic>> {
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

/// Validates the text of a scene file. Of the files that it names only the metadata are looked at; they are
/// searched for beside `path`, which names the scene in diagnostics and is not read.
pub fn parse(text: Arc<str>, path: &Path) -> Outcome {
    if text.contains('\0') {
        return Outcome { scene: None, diagnostics: vec![*read::binary(path)], settings: Vec::new() };
    }
    document::lower(&Source::file(text), path)
}

/// Whether a file shows a model of its own: it is a mesh by its name, and holds no scene all the same.
pub fn is_model(path: &Path) -> bool {
    read::is_model(path)
}

/// Whether a file is a mesh by its name.
pub fn is_mesh(path: &Path) -> bool {
    document::is_mesh(path)
}

/// The commented scene that a new file starts with.
pub fn starter() -> &'static str {
    include_str!("starter.toml")
}

#[cfg(test)]
mod set_tests;
#[cfg(test)]
mod tests;
