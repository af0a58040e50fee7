//! Checks output files against the inputs, each other, and existing files that the user may not want to lose.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};

use super::formats::has_model_extension;
use super::inputs::{InputsByIdentity, ProtectedInput, ProtectedInputs};
use super::plan::{OutputFiles, OutputNameSource, RenderPlan};
use super::protected::{OverwriteProtection, recorded_scene_if_different};
use super::protocol::Event;
use super::render::checkpointer::checkpoint_path;
use super::report::ReportRecognitionFields;
use super::sink::EventSink;
use crate::output::part::{self, PartFile};
use crate::output::write::{ExistingFilePolicy, SweptFolders};
use crate::output::{
    AttributeLossPolicy, FileIdentity, OutputError, ReplaceCheckResult, check_image_replacement,
    check_json_replacement,
};
use crate::scene::diagnostic::{Diagnostic, Severity};

/// A file to be written.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct OutputTarget<'a> {
    path: &'a Path,
    kind: TargetKind,
}

impl<'a> OutputTarget<'a> {
    /// Creates the target for one of the plan's images.
    pub(super) fn from_image_path(plan: &RenderPlan, path: &'a Path) -> Self {
        Self { path, kind: TargetKind::Image(plan.outputs.named_by) }
    }

    /// Creates the target for a report.
    pub(super) fn from_report_path(path: &'a Path) -> Self {
        Self { path, kind: TargetKind::Report }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum TargetKind {
    Image(OutputNameSource),
    Report,
}

/// Returns which existing files the plan's image must not replace.
pub(super) fn overwrite_protection(plan: &RenderPlan) -> OverwriteProtection {
    match plan.outputs.named_by {
        _ if plan.outputs.replaces_foreign => OverwriteProtection::Nothing,
        OutputNameSource::Default => OverwriteProtection::OtherImages(plan.path.clone()),
        OutputNameSource::CommandLine | OutputNameSource::Scene => OverwriteProtection::Parts,
    }
}

/// Returns one diagnostic for each of the plan's files that must not be written. Later calls may return other
/// diagnostics, because symbolic links and files can change.
pub(super) fn output_conflicts(plan: &RenderPlan, inputs: &ProtectedInputs) -> Vec<Diagnostic> {
    let inputs = inputs.build_identity_index();
    // Later frames have distinct files, because each name contains the frame number.
    let mut first = HashMap::new();
    for target in output_files_of_request(plan) {
        if let Some(identity) = FileIdentity::from_existing_or_new_path(target.path) {
            first.entry(identity).or_insert(target);
        }
    }
    let twin =
        |target: OutputTarget<'_>, at: &FileIdentity| first.get(at).copied().filter(|first| *first != target);
    let each = targets_of_all_frames(plan)
        .filter_map(|target| write_conflict(plan, target, target.path, &inputs, twin));
    each.chain(linked_frame_conflicts(plan)).collect()
}

/// Returns diagnostics for turntable frames that symbolic links direct to the same file, where a later frame
/// would replace an earlier one.
fn linked_frame_conflicts(plan: &RenderPlan) -> Vec<Diagnostic> {
    let (mut seen, mut found) = (HashMap::new(), Vec::new());
    let OutputFiles { images, later_images, .. } = &plan.outputs;
    for path in images.iter().chain(later_images).filter(|_| !later_images.is_empty()) {
        let Some(identity) = FileIdentity::from_existing_or_new_path(path) else { continue };
        match seen.entry(identity) {
            Entry::Vacant(new) => drop(new.insert(path)),
            Entry::Occupied(twin) if *twin.get() != path => {
                let target = OutputTarget { path, kind: TargetKind::Image(plan.outputs.named_by) };
                found.push(same_file_error(plan, target, twin.get()));
            }
            Entry::Occupied(_) => {}
        }
    }
    found
}

/// Writes one of the plan's files and reports problems such as attributes that could not be kept. Checks for
/// conflicts again at the last moment.
///
/// # Errors
/// The file cannot be written, or must not be overwritten ([`OutputError::Refused`]).
pub(super) fn write_guarded<'a, T>(
    plan: &'a RenderPlan,
    inputs: &ProtectedInputs,
    target: OutputTarget<'a>,
    sweep: Option<&SweptFolders>,
    sink: &EventSink,
    write: impl FnOnce(&ExistingFilePolicy<'_>) -> Result<T, OutputError>,
) -> Result<T, OutputError> {
    let may_replace = |real: &Path| {
        let inputs = inputs.build_identity_index();
        // Targets were compared with each other when the write stage started. Since then, only symbolic links
        // can have changed.
        let twin = |target: OutputTarget<'_>, at: &FileIdentity| {
            if real == target.path {
                return None;
            }
            let mut others = output_files_of_request(plan).filter(|other| *other != target);
            others.find(|other| FileIdentity::from_existing_or_new_path(other.path).as_ref() == Some(at))
        };
        match write_conflict(plan, target, real, &inputs, twin) {
            Some(conflict) => Err(OutputError::Refused { reason: format_conflict_line(&conflict) }),
            None => Ok(()),
        }
    };
    write(&ExistingFilePolicy {
        is_kept: &|path| inputs.contains_path(path),
        may_replace: &may_replace,
        sweep,
        losses: AttributeLossPolicy::Report(&|warning| {
            sink.send(Event::WriteWarning { generation: sink.generation, warning });
        }),
    })
}

/// Formats a conflict as a single line.
fn format_conflict_line(conflict: &Diagnostic) -> String {
    let help = conflict.help.as_ref().map_or(String::new(), |help| format!("; {help}"));
    format!("{}{help}", conflict.message)
}

/// Returns the files of this request, then the files of later turntable frames.
fn targets_of_all_frames(plan: &RenderPlan) -> impl Iterator<Item = OutputTarget<'_>> {
    let picture = |path| OutputTarget::from_image_path(plan, path);
    output_files_of_request(plan).chain(plan.outputs.later_images.iter().map(PathBuf::as_path).map(picture))
}

/// Returns the files of this request: the images, then the report.
fn output_files_of_request(plan: &RenderPlan) -> impl Iterator<Item = OutputTarget<'_>> {
    let picture = |path| OutputTarget::from_image_path(plan, path);
    let OutputFiles { images, animations, report, .. } = &plan.outputs;
    let report = report.iter().map(|path| OutputTarget::from_report_path(path));
    let pictures = images.iter().chain(animations);
    pictures.map(PathBuf::as_path).map(picture).chain(report)
}

/// Returns the reason for not writing a target that resolves to `at`. `twin` finds another target that is the
/// same file.
fn write_conflict<'a>(
    plan: &'a RenderPlan,
    target: OutputTarget<'a>,
    at: &Path,
    inputs: &InputsByIdentity<'_>,
    twin: impl Fn(OutputTarget<'a>, &FileIdentity) -> Option<OutputTarget<'a>>,
) -> Option<Diagnostic> {
    if let Some(identity) = FileIdentity::from_existing_or_new_path(at) {
        if let Some(input) = inputs.find(at) {
            return Some(overwrites_input_error(plan, target, input));
        }
        if let Some(twin) = twin(target, &identity) {
            return Some(same_file_error(plan, target, twin.path));
        }
        if let Some(output) =
            plan.outputs.images.first().filter(|output| is_checkpoint_for(output, &identity))
        {
            let (name, output) = (target.path.display(), output.display());
            let message = format!("cannot write {name}: it is the checkpoint for {output}");
            return Some(command_line_error(
                message,
                Some(choose_other_file_help(plan, target.kind).to_owned()),
            ));
        }
    }
    if plan.outputs.replaces_foreign { None } else { overwrites_foreign_file_error(plan, target, at) }
}

/// Whether a file is the checkpoint for an output.
fn is_checkpoint_for(output: &Path, identity: &FileIdentity) -> bool {
    FileIdentity::from_existing_or_new_path(&checkpoint_path(output)).as_ref() == Some(identity)
}

fn overwrites_input_error(plan: &RenderPlan, target: OutputTarget<'_>, input: &ProtectedInput) -> Diagnostic {
    let is_same_name = target.path == input.path;
    let other = if is_same_name { String::new() } else { format!("{}, ", input.path.display()) };
    let message = format!("cannot write {}: it is {other}{}", target.path.display(), input.role);
    let help = Some(choose_other_file_help(plan, target.kind).to_owned());
    match &input.place {
        Some((loaded, span)) => loaded.create_diagnostic_at(span.clone(), Severity::Error, message, help),
        None => command_line_error(message, help),
    }
}

fn same_file_error(plan: &RenderPlan, target: OutputTarget<'_>, twin: &Path) -> Diagnostic {
    let (name, twin) = (target.path.display(), twin.display());
    let message = match target.kind {
        TargetKind::Image(_) => format!("the outputs {twin} and {name} are the same file"),
        TargetKind::Report => format!("the image {twin} and the report {name} are the same file"),
    };
    command_line_error(
        message,
        Some(format!("use separate files: {}", choose_other_file_help(plan, target.kind))),
    )
}

/// Returns an error if the target is an existing file not written by glimt.
fn overwrites_foreign_file_error(
    plan: &RenderPlan,
    target: OutputTarget<'_>,
    at: &Path,
) -> Option<Diagnostic> {
    let (name, remedy) = (target.path.display(), choose_other_file_help(plan, target.kind));
    let (replaced, help) = match target.kind {
        TargetKind::Image(OutputNameSource::Default) => {
            let own = match &plan.outputs.default_names {
                Some(names) => format!("'{}'", names.display()),
                None => name.to_string(),
            };
            let help = format!("{remedy}; -o {own} or --force replaces it");
            let replaced = check_image_replacement(at);
            if let (ReplaceCheckResult::Own, Some(other)) =
                (&replaced, recorded_scene_if_different(&plan.path, at))
            {
                let message = format!("cannot write {name}: it is the image of another scene, {other}");
                return Some(command_line_error(message, Some(help)));
            }
            (replaced, help)
        }
        TargetKind::Report => {
            let replaced = check_json_replacement(at, "a report", ReportRecognitionFields::have_all_stages);
            (replaced, format!("{remedy}; --force replaces it"))
        }
        TargetKind::Image(OutputNameSource::CommandLine | OutputNameSource::Scene) => {
            return overwrites_part_or_checkpoint_error(plan, target, at);
        }
    };
    Some(command_line_error(format!("cannot write {name}: {}", replaced.reason_to_keep()?), Some(help)))
}

/// Returns an error if the file is a checkpoint or another part of the same render, which may contain hours
/// of work. Parts with a different total belong to an earlier render and may be replaced.
fn overwrites_part_or_checkpoint_error(
    plan: &RenderPlan,
    target: OutputTarget<'_>,
    at: &Path,
) -> Option<Diagnostic> {
    if !part::is_part_or_checkpoint(at) {
        return None;
    }
    let head = PartFile::read_header(at).ok();
    let what = match head.as_ref().map(|head| (head.kind, head.share.index, head.share.count)) {
        Some((part::PartFileKind::Part, index, count)) => match plan.shard {
            Some((own, of)) if of != count || own == index => return None,
            Some(_) | None => format!("part {index}/{count} of a render"),
        },
        Some((part::PartFileKind::Checkpoint, ..)) => "a checkpoint".to_owned(),
        None => "a part or checkpoint from another version of glimt".to_owned(),
    };
    let message = format!("cannot write {}: it is {what}", target.path.display());
    Some(command_line_error(
        message,
        Some(format!("{}; --force replaces it", choose_other_file_help(plan, target.kind))),
    ))
}

fn choose_other_file_help(plan: &RenderPlan, kind: TargetKind) -> &'static str {
    match kind {
        TargetKind::Image(OutputNameSource::Default) if plan.turn.is_some() => {
            "choose other names with -o 'NAME_####.png'"
        }
        TargetKind::Image(OutputNameSource::Default) if has_model_extension(&plan.path) => {
            "name a file with -o FILE"
        }
        TargetKind::Image(OutputNameSource::CommandLine) => "name another file with -o FILE",
        TargetKind::Image(OutputNameSource::Scene) => {
            "name another file with -o FILE, or as `output` in [render]"
        }
        TargetKind::Image(OutputNameSource::Default) => {
            "name a file with -o FILE, or with `output = \"FILE\"` in [render]"
        }
        TargetKind::Report => "name another file with --report FILE.json",
    }
}

/// Creates a diagnostic about the command line, which has no location in the scene.
fn command_line_error(message: String, help: Option<String>) -> Diagnostic {
    Diagnostic { severity: Severity::Error, message, path: PathBuf::new(), place: None, help }
}
