//! The stages, one per file. Each stage is a function of its inputs and its cache.

pub(super) mod accel;
pub(super) mod containers;
pub(super) mod coplanar;
pub(super) mod glass;
pub(super) mod lights;
pub(super) mod mesh_warnings;
pub(super) mod meshes;
pub(super) mod parse;
pub(super) mod photons;
pub(super) mod render;
mod texture_images;
mod texture_warnings;
pub(super) mod textures;
pub(super) mod write;

use std::collections::HashSet;
use std::error::Error;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use rayon::ThreadPool;

use self::containers::OpenAssetFiles;
use super::plan::argument_error;
use super::protocol::{Failure, StageStatus, WriteRequirement, reasons};
use super::sink::EventSink;
use super::watch::content::{FileHashCache, FilePathAndContentId, FilesSeenByRequest};
use crate::assets::AssetError;
use crate::control::{CancelToken, Canceled};
use crate::scene::LoadedScene;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::report::{ReportStyle, render_diagnostics};

/// Line width for diagnostics in error messages.
const COLUMNS: usize = 120;

/// Reasons for ending a request early.
#[derive(Clone, Debug)]
pub enum AbortReason {
    /// A cancel token stopped the work.
    Canceled,
    /// The scene is invalid, or the work failed.
    Failed(Failure),
}

impl fmt::Display for AbortReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Failed(Failure::Scene(diagnostics)) => {
                f.write_str(render_diagnostics(diagnostics, COLUMNS, ReportStyle::Plain).trim_end())
            }
            Self::Failed(Failure::Work(message)) => f.write_str(message),
            Self::Canceled => f.write_str("the render was canceled"),
        }
    }
}

impl Error for AbortReason {}

impl From<Canceled> for AbortReason {
    fn from(_: Canceled) -> Self {
        Self::Canceled
    }
}

impl From<Box<Diagnostic>> for AbortReason {
    fn from(error: Box<Diagnostic>) -> Self {
        Self::Failed(Failure::Scene(vec![*error]))
    }
}

impl AbortReason {
    #[allow(clippy::needless_pass_by_value, reason = "`map_err` passes ownership")]
    pub(super) fn from_work_error(message: impl ToString) -> Self {
        Self::Failed(Failure::Work(message.to_string()))
    }

    /// Returns the error as `Ok` unless it must end the request.
    pub(super) fn reject_fatal_asset_error(error: AssetError) -> Result<AssetError, Self> {
        match error {
            AssetError::Canceled(_) => Err(Self::Canceled),
            AssetError::OutOfMemory { .. }
            | AssetError::MemoryLimit { .. }
            | AssetError::TooManyOpenFiles { .. } => Err(Self::from_work_error(error)),
            AssetError::Unreadable { .. } | AssetError::Malformed { .. } => Ok(error),
        }
    }

    /// A failure without a location in the scene, and how to fix it.
    pub(super) fn failure_with_remedy(message: String, help: &str) -> Self {
        argument_error(message, help).into()
    }
}

/// A stage's result, its status and the reason for that status.
#[derive(Debug)]
pub(super) struct StageResult<T> {
    pub(super) value: T,
    pub(super) status: StageStatus,
    pub(super) why: String,
}

impl<T> StageResult<T> {
    pub(super) fn done(value: T, why: impl Into<String>) -> Self {
        Self { value, status: StageStatus::Done, why: why.into() }
    }

    pub(super) fn reused(value: T, why: impl Into<String>) -> Self {
        Self { value, status: StageStatus::Reused, why: why.into() }
    }

    pub(super) fn skipped(value: T, why: impl Into<String>) -> Self {
        Self { value, status: StageStatus::Skipped, why: why.into() }
    }
}

/// Inputs shared by the stages that read files.
pub(super) struct FileReadContext<'a> {
    pub(super) sink: &'a EventSink,
    pub(super) token: &'a CancelToken,
    pub(super) contents: &'a FilesSeenByRequest,
    pub(super) pool: &'a ThreadPool,
    pub(super) containers: &'a OpenAssetFiles,
    /// Bytes left for meshes and textures, or [`u64::MAX`] without a limit.
    pub(super) available_memory: u64,
}

impl FileReadContext<'_> {
    /// Makes the files that exist only in memory readable, and keeps them from being watched.
    pub(super) fn add_generated_files(&self, loaded: &LoadedScene, findings: &mut Findings) {
        for (path, file) in loaded.in_memory_files() {
            self.contents.record_decoded(&path, file.hash);
            findings.generated.insert(path);
        }
        let files = loaded.in_memory_files().map(|(path, file)| (path, Arc::clone(&file.bytes)));
        self.containers.add_importer_generated_files(files);
    }
}

/// Files, errors and warnings found by a request.
#[derive(Debug)]
pub(super) struct Findings {
    /// A point in time before the first read.
    pub(super) begun: Instant,
    /// All files that the request tried to read, without duplicates.
    pub(super) files: Vec<FilePathAndContentId>,
    known: HashSet<FilePathAndContentId>,
    /// Files that exist only in memory and are not watched.
    generated: HashSet<PathBuf>,
    pub(super) errors: Vec<Diagnostic>,
    /// Current reasons for not writing an image.
    pub(super) conflicts: Vec<Diagnostic>,
    pub(super) warnings: Vec<Diagnostic>,
}

impl Default for Findings {
    fn default() -> Self {
        Self {
            begun: Instant::now(),
            files: Vec::new(),
            known: HashSet::new(),
            generated: HashSet::new(),
            errors: Vec::new(),
            conflicts: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

impl Findings {
    /// Resets everything except the request's start time.
    pub(super) fn reset(&mut self) {
        *self = Self { begun: self.begun, ..Self::default() };
    }

    pub(super) fn add_file(&mut self, file: FilePathAndContentId) {
        if !self.generated.contains(&file.path) && self.known.insert(file.clone()) {
            self.files.push(file);
        }
    }

    /// Replaces a file's recorded content with the decoded content.
    pub(super) fn replace_read_file(&mut self, file: FilePathAndContentId) {
        self.known.retain(|known| known.path != file.path);
        self.files.retain(|known| known.path != file.path);
        self.add_file(file);
    }

    /// Watches files whose absence may have caused an error. Treats the text underlined by each error as a
    /// file name.
    pub(super) fn watch_files_named_in_errors(
        &mut self,
        diagnostics: &[Diagnostic],
        scene: &Path,
        contents: &FileHashCache,
        token: &CancelToken,
    ) {
        let folder = scene.parent().unwrap_or(Path::new(""));
        for place in diagnostics.iter().filter_map(|one| one.place.as_ref()) {
            let text = place.source.get(place.span.clone()).unwrap_or("").trim_matches(['"', '\'']);
            if text.is_empty() || text.len() > 255 || text.contains(['\n', '\0']) {
                continue;
            }
            let path = folder.join(text);
            if let Ok(content) = contents.read_content_id(&path, token) {
                self.add_file(FilePathAndContentId { path, content });
            }
        }
    }

    /// Adds an error about an asset, located where the scene references it.
    pub(super) fn add_asset_error(&mut self, loaded: &LoadedScene, span: Range<usize>, error: &AssetError) {
        self.errors.push(diagnostic_at_span(loaded, span, Severity::Error, error.to_string()));
    }

    /// Adds an error about an asset that does not fit the scene.
    pub(super) fn add_error(
        &mut self,
        loaded: &LoadedScene,
        span: Range<usize>,
        message: String,
        help: &str,
    ) {
        self.errors.push(loaded.create_diagnostic_at(span, Severity::Error, message, Some(help.to_owned())));
    }

    pub(super) fn add_warning(&mut self, loaded: &LoadedScene, span: Range<usize>, message: String) {
        self.warnings.push(diagnostic_at_span(loaded, span, Severity::Warning, message));
    }

    /// Records the outputs that must not be written, and sends them to the front end if they have changed.
    ///
    /// # Errors
    /// Returns all conflicts if the image must be written.
    pub(super) fn record_output_conflicts(
        &mut self,
        found: Vec<Diagnostic>,
        writing: WriteRequirement,
        sink: &EventSink,
    ) -> Result<(), AbortReason> {
        if !found.is_empty() && writing == WriteRequirement::Must {
            self.errors.extend(found);
            return Err(AbortReason::Failed(self.take_diagnostics_as_failure()));
        }
        if !found.is_empty() && found != self.conflicts {
            sink.send_write_refused(found.clone());
        }
        self.conflicts = found;
        Ok(())
    }

    /// Takes all errors and warnings, errors first.
    pub(super) fn take_diagnostics_as_failure(&mut self) -> Failure {
        let mut all = std::mem::take(&mut self.errors);
        all.append(&mut self.warnings);
        Failure::Scene(all)
    }
}

/// Creates a diagnostic at a span in the scene file, without a help text.
fn diagnostic_at_span(
    loaded: &LoadedScene,
    span: Range<usize>,
    severity: Severity,
    message: String,
) -> Diagnostic {
    loaded.create_diagnostic_at(span, severity, message, None)
}

/// Result of loading an asset.
pub(super) struct AssetLoadResult<T> {
    /// The file, followed by the files it references.
    pub(super) files: Vec<FilePathAndContentId>,
    /// The value, and whether it came from the cache.
    pub(super) result: Result<(Arc<T>, bool), AssetError>,
}

/// Creates the result of a stage that loads files, including the numbers of loaded and cached files.
pub(super) fn loading_result<T>(value: T, counts: FileCounts) -> StageResult<T> {
    let FileCounts { loaded, kept, failed, left_out } = counts;
    if loaded + failed == 0 {
        return StageResult::reused(value, reasons::UNCHANGED);
    }
    let parts =
        [(loaded, "loaded"), (kept, "cached"), (failed, "failed"), (left_out, "not needed")].into_iter();
    let parts: Vec<String> =
        parts.filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    StageResult::done(value, parts.join(", "))
}

/// File counts for a stage.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FileCounts {
    pub(super) loaded: usize,
    pub(super) kept: usize,
    pub(super) failed: usize,
    /// Files that were not loaded because the view does not need them.
    pub(super) left_out: usize,
}
