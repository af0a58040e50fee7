//! The stages, one file each: a function of its inputs and of what is kept from before.

pub(super) mod accel;
pub(super) mod containers;
pub(super) mod coplanar;
pub(super) mod glass;
pub(super) mod lights;
pub(super) mod meshes;
pub(super) mod parse;
pub(super) mod photons;
pub(super) mod render;
pub(super) mod textures;
pub(super) mod write;

use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use rayon::ThreadPool;

use self::containers::Containers;
use super::protocol::{Failure, Status};
use super::sink::Sink;
use super::watch::content::{Contents, FileRead, Snapshot};
use crate::assets::AssetError;
use crate::control::{CancelToken, Cancelled};
use crate::scene::Loaded;
use crate::scene::diagnostic::{Diagnostic, Severity};

/// Why a request went no further.
#[derive(Debug)]
pub(super) enum Stop {
    Cancelled,
    Failed(Failure),
}

impl From<Cancelled> for Stop {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

impl Stop {
    #[allow(clippy::needless_pass_by_value, reason = "it is handed to `map_err`")]
    pub(super) fn work(message: impl ToString) -> Self {
        Self::Failed(Failure::Work(message.to_string()))
    }

    /// Something is wrong with the call, which has no place in the scene.
    pub(super) fn wrong_call(message: String, help: &str) -> Self {
        let (severity, help) = (Severity::Error, Some(help.to_owned()));
        let path = std::path::PathBuf::new();
        Self::Failed(Failure::Scene(vec![Diagnostic { severity, message, path, place: None, help }]))
    }
}

/// Result of a stage, and how it came about.
#[derive(Debug)]
pub(super) struct Staged<T> {
    pub(super) value: T,
    pub(super) status: Status,
    pub(super) why: String,
}

impl<T> Staged<T> {
    pub(super) fn done(value: T, why: impl Into<String>) -> Self {
        Self { value, status: Status::Done, why: why.into() }
    }

    pub(super) fn reused(value: T, why: impl Into<String>) -> Self {
        Self { value, status: Status::Reused, why: why.into() }
    }

    pub(super) fn skipped(value: T, why: impl Into<String>) -> Self {
        Self { value, status: Status::Skipped, why: why.into() }
    }
}

/// Inputs shared by stages that read files.
pub(super) struct Reading<'a> {
    pub(super) sink: &'a Sink,
    pub(super) token: &'a CancelToken,
    pub(super) contents: &'a Snapshot,
    pub(super) pool: &'a ThreadPool,
    pub(super) containers: &'a Containers,
}

/// Findings of a request about files, errors and warnings.
#[derive(Debug)]
pub(super) struct Findings {
    /// Before anything was read.
    pub(super) begun: Instant,
    /// Everything that was read or tried, each once.
    pub(super) files: Vec<FileRead>,
    known: HashSet<FileRead>,
    pub(super) errors: Vec<Diagnostic>,
    /// Why nothing is written, as it was found last.
    pub(super) conflicts: Vec<Diagnostic>,
    pub(super) warnings: Vec<Diagnostic>,
}

impl Default for Findings {
    fn default() -> Self {
        Self {
            begun: Instant::now(),
            files: Vec::new(),
            known: HashSet::new(),
            errors: Vec::new(),
            conflicts: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

impl Findings {
    /// Forgets everything but when the request began.
    pub(super) fn start_again(&mut self) {
        *self = Self { begun: self.begun, ..Self::default() };
    }

    pub(super) fn read(&mut self, file: FileRead) {
        if self.known.insert(file.clone()) {
            self.files.push(file);
        }
    }

    /// Puts the content that was decoded in place of one that was seen before.
    pub(super) fn read_instead(&mut self, file: FileRead) {
        self.known.retain(|known| known.path != file.path);
        self.files.retain(|known| known.path != file.path);
        self.read(file);
    }

    /// A scene may be broken because it names a file that is not there: what the errors underline is watched as
    /// if it were a file's name, so that its coming is noticed.
    pub(super) fn read_named(
        &mut self,
        diagnostics: &[Diagnostic],
        scene: &Path,
        contents: &Contents,
        token: &CancelToken,
    ) {
        let folder = scene.parent().unwrap_or(Path::new(""));
        for place in diagnostics.iter().filter_map(|one| one.place.as_ref()) {
            let text = place.source.get(place.span.clone()).unwrap_or("").trim_matches(['"', '\'']);
            if text.is_empty() || text.len() > 255 || text.contains(['\n', '\0']) {
                continue;
            }
            let path = folder.join(text);
            if let Ok(content) = contents.read(&path, token) {
                self.read(FileRead { path, content });
            }
        }
    }

    /// An asset could not be used; the error stands where the scene names it.
    pub(super) fn asset_error(&mut self, loaded: &Loaded, span: Range<usize>, error: &AssetError) {
        self.errors.push(at(loaded, span, Severity::Error, error.to_string()));
    }

    /// Something in the scene does not go with the assets.
    pub(super) fn error(&mut self, loaded: &Loaded, span: Range<usize>, message: String, help: &str) {
        self.errors.push(loaded.diagnostic_at(span, Severity::Error, message, Some(help.to_owned())));
    }

    pub(super) fn warn(&mut self, loaded: &Loaded, span: Range<usize>, message: String) {
        self.warnings.push(at(loaded, span, Severity::Warning, message));
    }

    /// All errors and warnings, errors first.
    pub(super) fn take_failure(&mut self) -> Failure {
        let mut all = std::mem::take(&mut self.errors);
        all.append(&mut self.warnings);
        Failure::Scene(all)
    }
}

/// A diagnostic at a place of the scene file.
fn at(loaded: &Loaded, span: Range<usize>, severity: Severity, message: String) -> Diagnostic {
    loaded.diagnostic_at(span, severity, message, None)
}

/// One asset, as a parallel load gives it back.
pub(super) struct Asset<T> {
    /// The file first, then those that it names.
    pub(super) files: Vec<FileRead>,
    /// The value and whether it was kept from before.
    pub(super) result: Result<(Arc<T>, bool), AssetError>,
}

/// The words for how many of some assets were loaded and how many kept.
pub(super) fn loaded_and_kept<T>(value: T, counts: Counts) -> Staged<T> {
    let Counts { loaded, kept, failed, left_out } = counts;
    if loaded + failed == 0 {
        return Staged::reused(value, "the files did not change");
    }
    let parts = [(loaded, "loaded"), (kept, "kept"), (failed, "failed"), (left_out, "not shown")].into_iter();
    let parts: Vec<String> =
        parts.filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    Staged::done(value, parts.join(", "))
}

/// Counts of a stage's files.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub(super) loaded: usize,
    pub(super) kept: usize,
    pub(super) failed: usize,
    /// Not asked for, as the view does not show them.
    pub(super) left_out: usize,
}
