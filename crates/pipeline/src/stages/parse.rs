//! The parse stage: reads the scene file, and the orbiter file if the camera uses one.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::super::cache::Memo;
use super::super::formats::foreign::{ForeignError, ForeignOptions};
use super::super::formats::model::ModelViewOptions;
use super::super::formats::{
    ForeignFormat, ForeignReadContext, ForeignScene, not_a_scene_file_error, scene_from_document,
};
use super::super::protocol::{Failure, reasons};
use super::super::watch::content::{FileContentId, FilePathAndContentId};
use super::{AbortReason, FileReadContext, Findings, StageResult};
use crate::assets::orbiter::load as load_orbiter;
use crate::assets::{self, AssetError, Companion, GkitOrbiterCamera};
use crate::control::{CancelToken, Canceled};
use crate::output::held::{self, BackupRecovery};
use crate::scene;
use crate::scene::description::{Camera, Texture};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};
use crate::scene::sanitize::escape_invisible_chars;

/// A valid scene and the files it references.
#[derive(Debug)]
pub(crate) struct ParsedScene {
    pub(crate) loaded: Arc<scene::LoadedScene>,
    pub(crate) orbiter: Option<GkitOrbiterCamera>,
    /// Files that the scene references without the overrides, and the files that those files reference.
    pub(crate) named: Vec<PathBuf>,
    /// Other files that the scene in a foreign file depends on.
    companions: Vec<FilePathAndContentId>,
    /// Notes and substitutions from the importer of a foreign file.
    notes: Vec<Diagnostic>,
    orbiter_content: Option<FileContentId>,
}

/// The scene to parse: its path, the overrides and, for a model, the view.
#[derive(Clone, Copy)]
pub(crate) struct SceneParseRequest<'a> {
    /// Path of a scene file or model.
    pub(crate) path: &'a Path,
    /// Scene key overrides from the command line.
    pub(crate) sets: &'a [String],
    /// View of a model.
    pub(crate) show: ModelViewOptions,
    /// Options for scenes from other renderers.
    pub(crate) foreign: &'a ForeignOptions,
}

/// Converts an importer's error. Watches missing files to detect when they are created.
fn abort_reason_from_import_error(
    error: AssetError,
    findings: &mut Findings,
    reading: &FileReadContext<'_>,
) -> AbortReason {
    match error {
        AssetError::Canceled(_) => AbortReason::Canceled,
        AssetError::OutOfMemory { .. }
        | AssetError::MemoryLimit { .. }
        | AssetError::TooManyOpenFiles { .. } => AbortReason::from_work_error(error),
        AssetError::Unreadable { path, reason } => {
            if let Ok(content) = reading.contents.first_seen_content_id(&path, reading.token) {
                findings.add_file(FilePathAndContentId { path: path.clone(), content });
            }
            scene_failure_from_message(&path, format!("cannot read it: {reason}"))
        }
        AssetError::Malformed { path, line, reason } => {
            let line = line.map_or(String::new(), |line| format!("line {line}: "));
            scene_failure_from_message(&path, format!("{line}{reason}"))
        }
    }
}

fn scene_failure_from_message(path: &Path, message: String) -> AbortReason {
    AbortReason::Failed(Failure::Scene(vec![Diagnostic::about_file(path, Severity::Error, message)]))
}

/// Reads and validates the scene, including the command-line overrides.
///
/// # Errors
/// Returns all errors in the scene file.
pub(crate) fn parse_or_reuse_scene(
    origin: SceneParseRequest<'_>,
    memo: &mut Memo<Arc<ParsedScene>>,
    findings: &mut Findings,
    reading: &FileReadContext<'_>,
) -> Result<StageResult<Arc<ParsedScene>>, AbortReason> {
    let SceneParseRequest { path, show, .. } = origin;
    let FileReadContext { contents, token, .. } = *reading;
    if let BackupRecovery::Differs(held) = held::recover_backup(path) {
        let help =
            Some("compare both files, save the one you need as the scene, and remove the other".to_owned());
        findings.warnings.push(Diagnostic {
            help,
            ..Diagnostic::about_file(path, Severity::Warning, held::backup_differs_warning(&held))
        });
    }
    let content = contents.first_seen_content_id(path, token)?;
    let format = ForeignFormat::from_file_unless_scene(path);
    if !format.is_some_and(|format| format.is_model) && (show.from.is_some() || show.up.is_some()) {
        findings.add_file(FilePathAndContentId { path: path.to_owned(), content });
        let message = match show.from {
            Some(_) => "`--from` applies to models; a scene has its own camera",
            None => "`--up` applies to models; scenes are always y-up",
        };
        return Err(AbortReason::Failed(Failure::Scene(vec![Diagnostic::about_file(
            Path::new(""),
            Severity::Error,
            message.to_owned(),
        )])));
    }
    let key = |content| scene_key(origin, content, format);
    // A foreign scene may depend on several files, all of which must be unchanged.
    let is_same = |parsed: &&Arc<ParsedScene>| {
        let now = |file: &FilePathAndContentId| {
            contents.first_seen_content_id(&file.path, token).is_ok_and(|content| content == file.content)
        };
        parsed.companions.iter().all(now)
    };
    let known = memo.get(key(content)).filter(is_same).cloned();
    let (loaded, content, companions, notes) = match &known {
        Some(parsed) => (parsed.loaded.clone(), content, parsed.companions.clone(), parsed.notes.clone()),
        None => {
            // Record the current content in case parsing fails. After a successful parse, replace it with the
            // parsed content.
            findings.add_file(FilePathAndContentId { path: path.to_owned(), content });
            read_scene(origin, format, memo.latest(), findings, reading)?
        }
    };
    findings.replace_read_file(FilePathAndContentId { path: path.to_owned(), content });
    companions.iter().for_each(|file| findings.add_file(file.clone()));
    let (orbiter, orbiter_content) = read_orbiter_camera_file(&loaded, known.as_deref(), findings, reading)?;
    findings.warnings.extend(notes.iter().chain(&loaded.warnings).cloned());
    if let Some(parsed) = known.filter(|parsed| parsed.orbiter_content == orbiter_content) {
        return Ok(StageResult::reused(parsed, reasons::UNCHANGED));
    }
    let named = referenced_files(&loaded, token)?;
    let parsed = Arc::new(ParsedScene { loaded, orbiter, named, companions, notes, orbiter_content });
    // Do not cache a scene whose orbiter file could not be read, so that the next request tries again.
    if parsed.orbiter.is_some() == orbiter_content.is_some() {
        memo.set(key(content), parsed.clone());
    }
    Ok(StageResult::done(parsed, ""))
}

/// A loaded scene, the content ID of its file, the other files it depends on, and warnings about
/// approximations.
type SceneAndDependencies =
    (Arc<scene::LoadedScene>, FileContentId, Vec<FilePathAndContentId>, Vec<Diagnostic>);

fn read_scene(
    SceneParseRequest { path, sets, show, foreign }: SceneParseRequest<'_>,
    format: Option<&ForeignFormat>,
    last: Option<&Arc<ParsedScene>>,
    findings: &mut Findings,
    reading: &FileReadContext<'_>,
) -> Result<SceneAndDependencies, AbortReason> {
    let FileReadContext { contents, containers, token, .. } = *reading;
    let Some(format) = format else {
        let foreign = not_a_scene_file_error(path).map_or(Ok(()), |error| Err(vec![error]));
        let loaded = foreign.and_then(|()| scene::load(path, sets)).map_err(|errors| {
            AbortReason::Failed(Failure::Scene(add_renamed_file_hint(errors, path, last)))
        })?;
        let content = contents
            .record_decoded(path, *blake3::hash(loaded.source.text_without_set_args().as_bytes()).as_bytes());
        return Ok((Arc::new(loaded), content, Vec::new(), Vec::new()));
    };
    let context = ForeignReadContext { view: show, options: foreign, containers, token };
    let record = |companions: &[Companion]| {
        let companions = companions.iter().map(|companion| contents.record_companion(companion, token));
        companions.collect::<Result<Vec<_>, Canceled>>()
    };
    let ForeignScene { document, hash, companions, notes, substitutions } =
        match reading.pool.install(|| (format.read)(path, &context)) {
            Ok(scene) => scene,
            Err(ForeignError::Asset(error)) => {
                return Err(abort_reason_from_import_error(error, findings, reading));
            }
            Err(ForeignError::Scene { diagnostics, companions }) => {
                record(&companions)?.into_iter().for_each(|file| findings.add_file(file));
                return Err(AbortReason::Failed(Failure::Scene(diagnostics)));
            }
        };
    let content = contents.record_decoded(path, hash);
    let companions = record(&companions)?;
    let strict = if foreign.is_strict { substitutions_as_errors(&substitutions) } else { Vec::new() };
    let loaded = match strict.is_empty() {
        true => scene_from_document(document, path, sets),
        false => Err(strict),
    };
    let loaded = loaded.map_err(|errors| {
        companions.iter().for_each(|file| findings.add_file(file.clone()));
        AbortReason::Failed(Failure::Scene(errors))
    })?;
    Ok((Arc::new(loaded), content, companions, [substitutions, notes].concat()))
}

/// Turns substitutions into errors.
fn substitutions_as_errors(substitutions: &[Diagnostic]) -> Vec<Diagnostic> {
    let strict = |one: &Diagnostic| Diagnostic {
        severity: Severity::Error,
        help: Some("without --strict, this is a warning".to_owned()),
        ..one.clone()
    };
    substitutions.iter().map(strict).collect()
}

/// Returns the key for a scene whose file has the given content.
fn scene_key(
    SceneParseRequest { path, sets, show, foreign }: SceneParseRequest<'_>,
    content: FileContentId,
    format: Option<&ForeignFormat>,
) -> Fingerprint {
    let mut key = FingerprintHasher::new("parse");
    content.add_to_fingerprint(key.add_path_bytes(path));
    sets.iter().for_each(|set| {
        key.add_str(set);
    });
    if format.is_some() {
        show.add_to_fingerprint(&mut key);
        foreign.add_to_fingerprint(&mut key);
    }
    key.finish()
}

/// If the scene file is missing but another file contains the same text as the last valid scene, adds a hint
/// to the error.
fn add_renamed_file_hint(
    mut errors: Vec<Diagnostic>,
    path: &Path,
    last: Option<&Arc<ParsedScene>>,
) -> Vec<Diagnostic> {
    let last = last.filter(|last| last.loaded.path == path && !last.loaded.is_foreign());
    if let [error] = &mut errors[..]
        && scene::is_scene_not_found_diagnostic(error)
        && let Some(last) = last
        && let Some(file) =
            scene::find_renamed_scene_by_text(path, &last.loaded.source.text_without_set_args_as_arc())
    {
        let name = escape_invisible_chars(&file.to_string_lossy()).into_owned();
        error.help = Some(format!("{name} {}; run `glimt {name}` to watch it", scene::SAME_TEXT));
    }
    errors
}

/// Returns the files that the scene references without the overrides. Includes files referenced by meshes
/// that have not been read.
fn referenced_files(loaded: &scene::LoadedScene, token: &CancelToken) -> Result<Vec<PathBuf>, Canceled> {
    let is_read = |path: &&PathBuf| loaded.scene.mesh_files.iter().any(|file| file.value == **path);
    let named = loaded.named.iter().filter(|path| !is_read(path));
    let images = loaded.scene.textures.iter().filter_map(Texture::as_image);
    let containers = images.filter(|image| image.image.is_some());
    let containers = containers.map(|image| &image.file.value).filter(|path| !is_read(path));
    let referenced = files_referenced_by_assets(named.chain(containers), token)?;
    Ok(loaded.named.iter().cloned().chain(referenced).collect())
}

/// Lists the files that mesh and glTF files reference, without loading the files. Ignores other kinds of
/// files and any errors in the files.
///
/// # Errors
/// Returns [`Canceled`] if the token is canceled.
pub fn files_referenced_by_assets<'a>(
    files: impl Iterator<Item = &'a PathBuf>,
    token: &CancelToken,
) -> Result<BTreeSet<PathBuf>, Canceled> {
    let mut companions = BTreeSet::new();
    for path in files.collect::<BTreeSet<_>>() {
        companions.extend(assets::referenced_files(path, token)?);
    }
    Ok(companions)
}

type OrbiterCameraAndFileContentId = (Option<GkitOrbiterCamera>, Option<FileContentId>);

/// Reads the camera's orbiter file, if it has one. Adds errors to the findings.
fn read_orbiter_camera_file(
    loaded: &scene::LoadedScene,
    known: Option<&ParsedScene>,
    findings: &mut Findings,
    reading: &FileReadContext<'_>,
) -> Result<OrbiterCameraAndFileContentId, AbortReason> {
    let Camera::Orbiter { file, .. } = &loaded.scene.camera else { return Ok((None, None)) };
    let FileReadContext { contents, token, .. } = *reading;
    let content = contents.first_seen_content_id(&file.value, token)?;
    if let Some(parsed) = known.filter(|parsed| parsed.orbiter_content == Some(content)) {
        findings.add_file(FilePathAndContentId { path: file.value.clone(), content });
        return Ok((parsed.orbiter, Some(content)));
    }
    match load_orbiter(&file.value) {
        Ok((camera, hash)) => {
            let content = contents.record_decoded(&file.value, hash);
            findings.add_file(FilePathAndContentId { path: file.value.clone(), content });
            Ok((Some(camera), Some(content)))
        }
        Err(error) => {
            findings.add_file(FilePathAndContentId { path: file.value.clone(), content });
            findings.add_asset_error(loaded, file.span.clone(), &error);
            Ok((None, Some(content)))
        }
    }
}
