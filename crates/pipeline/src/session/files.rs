//! The files of the current scene.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use crate::inputs::ProtectedInputs;
use crate::plan::RenderPlan;
use crate::prepare::SceneAssets;
use crate::protocol::{Event, Failure, Report};
use crate::scene::diagnostic::Diagnostic;
use crate::sink::EventSink;
use crate::stages::parse::ParsedScene;
use crate::stages::{AbortReason, Findings};
use crate::targets::output_conflicts;
use crate::watch::content::FilePathAndContentId;

/// The scene's files: which to watch, which not to write, and the last valid scene that was read from them.
#[derive(Default)]
pub(super) struct SceneFileTracker {
    /// Files of the last loaded scene, which are watched while the scene file is broken.
    loaded: Vec<FilePathAndContentId>,
    /// All files that must not be written: the files of the last valid scene and all files referenced since.
    pub(super) protected: ProtectedInputs,
    /// Whether the current scene file is invalid, which means that its referenced files are unknown.
    pub(super) is_broken: bool,
    pub(super) last_valid: Option<Arc<SceneAssets>>,
}

impl SceneFileTracker {
    /// Protects the files that a parsed scene references, and returns the output files that conflict with
    /// them. The previous scene's files remain protected, because its image is still shown and may have to be
    /// written.
    pub(super) fn protect_inputs_and_find_conflicts(
        &mut self,
        parsed: &ParsedScene,
        plan: &RenderPlan,
    ) -> Vec<Diagnostic> {
        let before = std::mem::replace(&mut self.protected, ProtectedInputs::from_scene(parsed));
        let conflicts = output_conflicts(plan, &self.protected);
        self.protected.merge(before);
        conflicts
    }

    /// Records the files of a loaded scene, and reports them and the warnings to the front end.
    ///
    /// # Errors
    /// Returns all errors in the files.
    pub(super) fn record_and_report_loaded(
        &mut self,
        findings: &mut Findings,
        sink: &EventSink,
    ) -> Result<(), AbortReason> {
        self.loaded.clone_from(&findings.files);
        if !findings.errors.is_empty() {
            return Err(AbortReason::Failed(findings.take_diagnostics_as_failure()));
        }
        self.report_read_files(findings, sink);
        let warnings = [findings.conflicts.as_slice(), &findings.warnings].concat();
        sink.send(Event::Warnings { generation: sink.generation, warnings });
        Ok(())
    }

    /// Records the outcome of a request, and reports the files that it read.
    pub(super) fn record_request_outcome(
        &mut self,
        outcome: &Result<Report, AbortReason>,
        findings: &Findings,
        sink: &EventSink,
    ) {
        // Watched files must not be written.
        self.protected.add_other_read_files(&findings.files);
        match outcome {
            Ok(_) => self.is_broken = false,
            Err(AbortReason::Failed(Failure::Scene(_))) => self.is_broken = true,
            Err(AbortReason::Failed(Failure::Work(_)) | AbortReason::Canceled) => {}
        }
        self.report_read_files(findings, sink);
    }

    /// Reports the files that a request read, followed by other files of the last loaded scene.
    fn report_read_files(&self, findings: &Findings, sink: &EventSink) {
        let mut files = findings.files.clone();
        let known: HashSet<&Path> = findings.files.iter().map(|file| file.path.as_path()).collect();
        files.extend(self.loaded.iter().filter(|file| !known.contains(file.path.as_path())).cloned());
        let (generation, read, since) = (sink.generation, findings.files.len(), findings.begun);
        sink.send(Event::Files { generation, files, read, since });
    }
}
