//! Mesh files, several at once, each read only when its content changed.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::super::cache::Pool;
use super::super::fingerprint::{Fingerprint, Key};
use super::super::watch::content::FileRead;
use super::{Asset, Findings, Reading, Staged, Stop, loaded_and_kept};
use crate::assets::mesh::load;
use crate::assets::{AssetError, Dropped, LoadedMesh};
use crate::control::Cancelled;
use crate::scene::Loaded;

/// A mesh file with the files that it names.
#[derive(Debug)]
pub(in crate::pipeline) struct KeptMesh {
    pub(in crate::pipeline) mesh: Arc<LoadedMesh>,
    /// All contents that the mesh was made of.
    pub(in crate::pipeline) key: Key,
    companions: Vec<FileRead>,
}

/// One for each of the scene's mesh files; those that failed are empty.
pub(in crate::pipeline) type Meshes = Vec<Arc<KeptMesh>>;

/// Load what the scene names. All files are tried; errors go to the findings.
///
/// # Errors
/// Cancelled.
pub(in crate::pipeline) fn meshes(
    loaded: &Loaded,
    cache: &mut Pool<PathBuf, KeptMesh>,
    findings: &mut Findings,
    reading: &Reading<'_>,
) -> Result<Staged<Meshes>, Stop> {
    let files = &loaded.scene.mesh_files;
    if files.is_empty() {
        return Ok(Staged::skipped(Vec::new(), "the scene has no mesh"));
    }
    let before: Vec<Option<Arc<KeptMesh>>> = files
        .iter()
        .map(|file| {
            let content = reading.contents.read(&file.value, reading.token)?;
            Ok(cache.get(&canonical(&file.value), file_key(&file.value, content)))
        })
        .collect::<Result<_, Cancelled>>()?;
    let assets: Vec<Asset<KeptMesh>> = reading.pool.install(|| {
        files
            .par_iter()
            .zip(before)
            .map(|(file, kept)| one(&file.value, kept, reading))
            .collect::<Result<_, _>>()
    })?;
    let mut meshes = Vec::new();
    let mut kept = 0;
    for (file, asset) in files.iter().zip(assets) {
        let content = asset.files[0].content;
        asset.files.into_iter().for_each(|file| findings.read(file));
        let mesh = match asset.result {
            Ok((mesh, was_kept)) => {
                kept += usize::from(was_kept);
                warn(loaded, file.span.clone(), &file.value, &mesh.mesh, findings);
                cache.insert(canonical(&file.value), file_key(&file.value, content), mesh.clone());
                mesh
            }
            Err(AssetError::Cancelled(_)) => return Err(Stop::Cancelled),
            Err(error) => {
                findings.asset_error(loaded, file.span.clone(), &error);
                let key = file_key(&file.value, content);
                Arc::new(KeptMesh { mesh: Arc::default(), key, companions: Vec::new() })
            }
        };
        meshes.push(mesh);
    }
    let loaded = meshes.len() - kept;
    Ok(loaded_and_kept(meshes, loaded, kept))
}

/// One file: from before if it and all that it names are as they were.
fn one(
    path: &Path,
    kept: Option<Arc<KeptMesh>>,
    reading: &Reading<'_>,
) -> Result<Asset<KeptMesh>, Cancelled> {
    let content = reading.contents.read(path, reading.token)?;
    let mut files = vec![FileRead { path: path.to_owned(), content }];
    if let Some(mesh) = kept
        && mesh.companions == companions(mesh.companions.iter().map(|file| &file.path), reading)?
    {
        files.extend(mesh.companions.iter().cloned());
        return Ok(Asset { files, result: Ok((mesh, true)) });
    }
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let result = match reading.sink.asset(&name, |progress| load(path, progress, reading.token)) {
        Ok(mesh) => {
            let companions = companions(mesh.companions.iter(), reading)?;
            files.extend(companions.iter().cloned());
            let mut key = Fingerprint::new("mesh");
            key.key(&file_key(path, content));
            for file in &companions {
                key.path(&file.path).content(file.content);
            }
            Ok((Arc::new(KeptMesh { mesh: Arc::new(mesh), key: key.finish(), companions }), false))
        }
        Err(error) => Err(error),
    };
    Ok(Asset { files, result })
}

fn companions<'a>(
    paths: impl Iterator<Item = &'a PathBuf>,
    reading: &Reading<'_>,
) -> Result<Vec<FileRead>, Cancelled> {
    paths
        .map(|path| {
            let content = reading.contents.read(path, reading.token)?;
            Ok(FileRead { path: path.clone(), content })
        })
        .collect()
}

fn file_key(path: &Path, content: super::super::watch::content::Content) -> Key {
    Fingerprint::new("file").path(path).content(content).finish()
}

/// One file by whatever name; a name that leads nowhere stands for itself.
pub(super) fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

fn warn(
    loaded: &Loaded,
    span: std::ops::Range<usize>,
    path: &Path,
    mesh: &LoadedMesh,
    findings: &mut Findings,
) {
    if let Some(message) = dropped(&mesh.dropped) {
        findings.warn(loaded, span.clone(), format!("{}: {message}", path.display()));
    }
    for warning in &mesh.warnings {
        findings.warn(loaded, span.clone(), format!("{}: {warning}", path.display()));
    }
}

/// The faces that were left out, in words.
fn dropped(faces: &Dropped) -> Option<String> {
    let count = |number: u64, what: &str| {
        (number > 0).then(|| format!("{number} face{} {what}", if number == 1 { "" } else { "s" }))
    };
    let parts: Vec<String> =
        [count(faces.non_finite, "with non-finite coordinates"), count(faces.degenerate, "without area")]
            .into_iter()
            .flatten()
            .collect();
    (!parts.is_empty()).then(|| format!("left out {}", parts.join(" and ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dropped_faces_are_counted_in_words() {
        assert_eq!(dropped(&Dropped::default()), None);
        let some = Dropped { non_finite: 1, degenerate: 12 };
        assert_eq!(
            dropped(&some).as_deref(),
            Some("left out 1 face with non-finite coordinates and 12 faces without area")
        );
    }
}
