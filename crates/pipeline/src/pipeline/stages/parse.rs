//! The scene file, and the orbiter file that holds its camera.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::super::cache::Memo;
use super::super::protocol::Failure;
use super::super::watch::content::{Content, FileRead, Snapshot};
use super::{Findings, Staged, Stop};
use crate::assets::OrbiterCamera;
use crate::assets::mesh::load as load_mesh;
use crate::assets::orbiter::load as load_orbiter;
use crate::control::CancelToken;
use crate::scene;
use crate::scene::description::Camera;
use crate::scene::fingerprint::Fingerprint;

/// A scene that was understood.
#[derive(Debug)]
pub(in crate::pipeline) struct Parsed {
    pub(in crate::pipeline) loaded: Arc<scene::Loaded>,
    pub(in crate::pipeline) orbiter: Option<OrbiterCamera>,
    /// Files that the scene file names, and those that these name, where the call sets anything.
    pub(in crate::pipeline) named: Vec<PathBuf>,
    orbiter_content: Option<Content>,
}

/// Read and validate the scene, with what the call sets in it.
///
/// # Errors
/// All errors of the scene file.
pub(in crate::pipeline) fn parse(
    path: &Path,
    sets: &[String],
    contents: &Snapshot,
    memo: &mut Memo<Arc<Parsed>>,
    findings: &mut Findings,
    token: &CancelToken,
) -> Result<Staged<Arc<Parsed>>, Stop> {
    let content = contents.read(path, token)?;
    findings.read(FileRead { path: path.to_owned(), content });
    let mut key = Fingerprint::new("parse");
    content.add_to(key.path(path));
    sets.iter().for_each(|set| {
        key.text(set);
    });
    let key = key.finish();
    let known = memo.get(key).cloned();
    let loaded = match &known {
        Some(parsed) => parsed.loaded.clone(),
        None => Arc::new(scene::load(path, sets).map_err(|errors| Stop::Failed(Failure::Scene(errors)))?),
    };
    let (orbiter, orbiter_content) = orbiter(&loaded, known.as_deref(), contents, findings, token)?;
    findings.warnings.extend(loaded.warnings.iter().cloned());
    if let Some(parsed) = known.filter(|parsed| parsed.orbiter_content == orbiter_content) {
        return Ok(Staged::reused(parsed, "the file did not change"));
    }
    let named = named(&loaded);
    let parsed = Arc::new(Parsed { loaded, orbiter, named, orbiter_content });
    // A camera that could not be read is tried again by the next request.
    if parsed.orbiter.is_some() == orbiter_content.is_some() {
        memo.set(key, parsed.clone());
    }
    Ok(Staged::done(parsed, ""))
}

/// Files of the scene without the call's changes, with the files and pictures that only its unread meshes name.
fn named(loaded: &scene::Loaded) -> Vec<PathBuf> {
    let mut named = loaded.named.clone();
    let is_read = |path: &&PathBuf| loaded.scene.mesh_files.iter().any(|file| file.value == **path);
    for path in loaded.named.iter().filter(|path| has_material_files(path) && !is_read(path)) {
        // What cannot be read names nothing that could be known.
        if let Ok(mesh) = load_mesh(path, &|_, _| {}, &CancelToken::new()) {
            named.extend(mesh.companions.into_iter().chain(mesh.pictures));
        }
    }
    named
}

fn has_material_files(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"))
}

type Orbiter = (Option<OrbiterCamera>, Option<Content>);

/// The orbiter file of a camera that has one; its errors go to the findings.
fn orbiter(
    loaded: &scene::Loaded,
    known: Option<&Parsed>,
    contents: &Snapshot,
    findings: &mut Findings,
    token: &CancelToken,
) -> Result<Orbiter, Stop> {
    let Camera::Orbiter { file, .. } = &loaded.scene.camera else { return Ok((None, None)) };
    let content = contents.read(&file.value, token)?;
    findings.read(FileRead { path: file.value.clone(), content });
    if let Some(parsed) = known.filter(|parsed| parsed.orbiter_content == Some(content)) {
        return Ok((parsed.orbiter, Some(content)));
    }
    match load_orbiter(&file.value) {
        Ok(camera) => Ok((Some(camera), Some(content))),
        Err(error) => {
            findings.asset_error(loaded, file.span.clone(), &error);
            Ok((None, Some(content)))
        }
    }
}
