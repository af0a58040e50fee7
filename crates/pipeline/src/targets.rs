//! The files that a request writes, held against those that it reads, against each other, and against what a person
//! did not mean to lose.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};

use super::inputs::{Input, Inputs, OnDisk};
use super::plan::{NamedBy, Plan};
use super::render::keeping::path_of as checkpoint_of;
use super::report::Marks;
use super::sink::Sink;
use crate::output::part::{self, PartFile};
use crate::output::write::{FolderSweep, Guard};
use crate::output::{
    FileIdentity, Losses, OutputError, Replaced, replaced_json, replaced_picture, scene_of_picture,
    scene_path,
};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::is_mesh;

/// A file to be written.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Target<'a> {
    path: &'a Path,
    kind: Kind,
}

impl<'a> Target<'a> {
    /// An image of the plan.
    pub(super) fn picture(plan: &Plan, path: &'a Path) -> Self {
        Self { path, kind: Kind::Picture(plan.named_by) }
    }

    /// A report.
    pub(super) fn report(path: &'a Path) -> Self {
        Self { path, kind: Kind::Report }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Picture(NamedBy),
    Report,
}

/// Everything that keeps the files of this plan from being written, one for each of them. It is what holds now: links
/// and files may change.
pub(super) fn conflicts(plan: &Plan, inputs: &Inputs) -> Vec<Diagnostic> {
    let inputs = inputs.on_disk();
    // Numbers keep those apart that are still to come.
    let mut first = HashMap::new();
    for target in targets_now(plan) {
        if let Some(identity) = FileIdentity::of(target.path) {
            first.entry(identity).or_insert(target);
        }
    }
    let twin =
        |target: Target<'_>, at: &FileIdentity| first.get(at).copied().filter(|first| *first != target);
    let each = targets(plan).filter_map(|target| conflict(plan, target, target.path, &inputs, twin));
    each.chain(linked(plan)).collect()
}

/// Pictures of a turntable that are one file by links: the later one would replace the earlier one.
fn linked(plan: &Plan) -> Vec<Diagnostic> {
    let (mut seen, mut found) = (HashMap::new(), Vec::new());
    for path in plan.outputs.iter().chain(&plan.to_come).filter(|_| !plan.to_come.is_empty()) {
        let Some(identity) = FileIdentity::of(path) else { continue };
        match seen.entry(identity) {
            Entry::Vacant(new) => drop(new.insert(path)),
            Entry::Occupied(twin) if *twin.get() != path => {
                let target = Target { path, kind: Kind::Picture(plan.named_by) };
                found.push(is_twin(plan, target, twin.get()));
            }
            Entry::Occupied(_) => {}
        }
    }
    found
}

/// Writes a file of the plan, and says what of the one that was there could not be kept; unless it is found at the last moment that it must not be.
///
/// # Errors
/// Those of writing; [`OutputError::Refused`].
pub(super) fn guarded<'a, T>(
    plan: &'a Plan,
    inputs: &Inputs,
    (target, sweep): (Target<'a>, Option<&FolderSweep>),
    sink: &Sink,
    write: impl FnOnce(&Guard<'_>) -> Result<T, OutputError>,
) -> Result<T, OutputError> {
    let may_replace = |real: &Path| {
        let inputs = inputs.on_disk();
        // Targets were compared when the write stage began; since then only links can have changed.
        let twin = |target: Target<'_>, at: &FileIdentity| {
            if real == target.path {
                return None;
            }
            let mut others = targets_now(plan).filter(|other| *other != target);
            others.find(|other| FileIdentity::of(other.path).as_ref() == Some(at))
        };
        match conflict(plan, target, real, &inputs, twin) {
            Some(conflict) => Err(OutputError::Refused { reason: in_a_line(&conflict) }),
            None => Ok(()),
        }
    };
    write(&Guard {
        is_kept: &|path| inputs.contain(path),
        may_replace: &may_replace,
        sweep,
        losses: Losses::Told(&|what| sink.not_kept(what)),
    })
}

/// For messages that have no room for more.
fn in_a_line(conflict: &Diagnostic) -> String {
    let help = conflict.help.as_ref().map_or(String::new(), |help| format!("; {help}"));
    format!("{}{help}", conflict.message)
}

/// Everything that this call writes: what the request writes, then the pictures of a turntable that are still to come.
fn targets(plan: &Plan) -> impl Iterator<Item = Target<'_>> {
    let picture = |path| Target::picture(plan, path);
    targets_now(plan).chain(plan.to_come.iter().map(PathBuf::as_path).map(picture))
}

/// The pictures, then the report.
fn targets_now(plan: &Plan) -> impl Iterator<Item = Target<'_>> {
    let picture = |path| Target::picture(plan, path);
    let report = plan.report.iter().map(|path| Target::report(path));
    let pictures = plan.outputs.iter().chain(&plan.moving);
    pictures.map(PathBuf::as_path).map(picture).chain(report)
}

/// Why this target, which leads to `at`, must not be written; `twin` finds another target of the same file.
fn conflict<'a>(
    plan: &'a Plan,
    target: Target<'a>,
    at: &Path,
    inputs: &OnDisk<'_>,
    twin: impl Fn(Target<'a>, &FileIdentity) -> Option<Target<'a>>,
) -> Option<Diagnostic> {
    if let Some(identity) = FileIdentity::of(at) {
        if let Some(input) = inputs.find(at) {
            return Some(is_input(plan, target, input));
        }
        if let Some(twin) = twin(target, &identity) {
            return Some(is_twin(plan, target, twin.path));
        }
        if let Some(output) = plan.outputs.first().filter(|output| has_checkpoint_at(output, &identity)) {
            let (name, output) = (target.path.display(), output.display());
            let message = format!("cannot write {name}: it is the checkpoint of {output}");
            return Some(of_call(message, Some(way_out(plan, target.kind).to_owned())));
        }
    }
    if plan.replaces_foreign { None } else { is_foreign(plan, target, at) }
}

/// Whether the checkpoint of an output is written to this file.
fn has_checkpoint_at(output: &Path, identity: &FileIdentity) -> bool {
    FileIdentity::of(&checkpoint_of(output)).as_ref() == Some(identity)
}

fn is_input(plan: &Plan, target: Target<'_>, input: &Input) -> Diagnostic {
    let is_same_name = target.path == input.path;
    let other = if is_same_name { String::new() } else { format!("{}, ", input.path.display()) };
    let message = format!("cannot write {}: it is {other}{}", target.path.display(), input.role);
    let help = Some(way_out(plan, target.kind).to_owned());
    match &input.place {
        Some((loaded, span)) => loaded.diagnostic_at(span.clone(), Severity::Error, message, help),
        None => of_call(message, help),
    }
}

fn is_twin(plan: &Plan, target: Target<'_>, twin: &Path) -> Diagnostic {
    let (name, twin) = (target.path.display(), twin.display());
    let message = match target.kind {
        Kind::Picture(_) => format!("the outputs {twin} and {name} are one file"),
        Kind::Report => format!("the picture {twin} and the report {name} are one file"),
    };
    of_call(message, Some(format!("each needs a file of its own: {}", way_out(plan, target.kind))))
}

/// A file that exists already and that glimt did not write.
fn is_foreign(plan: &Plan, target: Target<'_>, at: &Path) -> Option<Diagnostic> {
    let (name, way_out) = (target.path.display(), way_out(plan, target.kind));
    let (replaced, help) = match target.kind {
        Kind::Picture(NamedBy::Nobody) => {
            let own = match &plan.usual_names {
                Some(names) => format!("'{}'", names.display()),
                None => name.to_string(),
            };
            let help = format!("{way_out}; -o {own} or --force replaces it");
            let replaced = replaced_picture(at);
            if let (Replaced::Own, Some(other)) = (&replaced, other_scene(plan, at)) {
                let message = format!("cannot write {name}: it is the image of another scene, {other}");
                return Some(of_call(message, Some(help)));
            }
            (replaced, help)
        }
        Kind::Report => {
            let replaced = replaced_json(at, "a report", Marks::have_all_stages);
            (replaced, format!("{way_out}; --force replaces it"))
        }
        Kind::Picture(NamedBy::Call | NamedBy::Scene) => return is_other_part(plan, target, at),
    };
    Some(of_call(format!("cannot write {name}: {}", replaced.why_kept()?), Some(help)))
}

/// The scene of a picture that glimt wrote, unless it is this one.
fn other_scene(plan: &Plan, at: &Path) -> Option<String> {
    scene_of_picture(at).filter(|named| !scene_path::is_same(named, &plan.path, at))
}

/// A checkpoint, or another part of as many: hours of work that look like an output. Parts of another number are those of a
/// render before.
fn is_other_part(plan: &Plan, target: Target<'_>, at: &Path) -> Option<Diagnostic> {
    if !part::is_part(at) {
        return None;
    }
    let head = PartFile::head(at).ok();
    let what = match head.as_ref().map(|head| (head.kind, head.share.index, head.share.count)) {
        Some((part::Kind::Part, index, count)) => match plan.shard {
            Some((own, of)) if of != count || own == index => return None,
            Some(_) | None => format!("part {index}/{count} of a render"),
        },
        Some((part::Kind::Checkpoint, ..)) => "a checkpoint".to_owned(),
        None => "a part or a checkpoint of another version of glimt".to_owned(),
    };
    let message = format!("cannot write {}: it is {what}", target.path.display());
    Some(of_call(message, Some(format!("{}; --force replaces it", way_out(plan, target.kind)))))
}

fn way_out(plan: &Plan, kind: Kind) -> &'static str {
    match kind {
        Kind::Picture(NamedBy::Nobody) if plan.turn.is_some() => "name others with -o 'NAME_####.png'",
        Kind::Picture(NamedBy::Nobody) if is_mesh(Path::new(&plan.name)) => "name a file with -o FILE",
        Kind::Picture(NamedBy::Call) => "name another file with -o FILE",
        Kind::Picture(NamedBy::Scene) => "name another file with -o FILE, or as `output` in [render]",
        Kind::Picture(NamedBy::Nobody) => "name a file with -o FILE, or with `output = \"FILE\"` in [render]",
        Kind::Report => "name another file with --report FILE.json",
    }
}

/// A diagnostic about the call, which has no place in the scene.
fn of_call(message: String, help: Option<String>) -> Diagnostic {
    Diagnostic { severity: Severity::Error, message, path: PathBuf::new(), place: None, help }
}
