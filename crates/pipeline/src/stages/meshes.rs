//! The meshes stage: loads mesh files whose content has changed, in parallel.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::super::cache::CacheOfNamedValues;
use super::super::protocol::reasons;
use super::super::watch::content::{FileContentId, FilePathAndContentId};
use super::super::words::format_bytes;
use super::containers::canonical_path;
use super::mesh_warnings::{MeshWarnings, add_limited_mesh_warnings, warn_about_missing_mesh_data};
use super::{
    AbortReason, AssetLoadResult, FileCounts, FileReadContext, Findings, StageResult, loading_result,
};
use crate::assets::mesh::subdivide::{subdivide, subdivision_memory_bytes};
use crate::assets::{AssetError, Companion, LoadedMesh};
use crate::control::{CancelToken, Canceled, Progress};
use crate::scene::description::{MeshFile, Scene};
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};
use crate::scene::{LoadedScene, MeshBoundingBox};

/// A mesh file and the other files that it references.
#[derive(Debug)]
pub(crate) struct CachedMesh {
    pub(crate) mesh: Arc<LoadedMesh>,
    /// Key that covers the contents of all files that the mesh depends on.
    pub(crate) key: Fingerprint,
    companions: Vec<FilePathAndContentId>,
    /// Bounds of the mesh, computed on demand.
    bounds: OnceLock<MeshBoundingBox>,
}

impl CachedMesh {
    pub(super) fn new(
        mesh: Arc<LoadedMesh>,
        key: Fingerprint,
        companions: Vec<FilePathAndContentId>,
    ) -> Self {
        Self { mesh, key, companions, bounds: OnceLock::new() }
    }

    fn bounds(&self) -> MeshBoundingBox {
        *self.bounds.get_or_init(|| self.mesh.mesh.bounds_in_file_coordinates())
    }
}

/// One mesh for each of the scene's mesh files. Meshes that failed to load are empty.
pub(crate) type MeshesByFileIndex = Vec<Arc<CachedMesh>>;

/// Loads the scene's meshes. Tries all files and adds errors to the findings.
///
/// # Errors
/// The token is canceled, or there is not enough memory.
pub(crate) fn load_meshes(
    loaded: &LoadedScene,
    cache: &mut CacheOfNamedValues<MeshPathAndOptions, CachedMesh>,
    findings: &mut Findings,
    reading: &FileReadContext<'_>,
) -> Result<StageResult<MeshesByFileIndex>, AbortReason> {
    let files = &loaded.scene.mesh_files;
    if files.is_empty() {
        return Ok(StageResult::skipped(Vec::new(), reasons::NO_MESHES));
    }
    reading.add_generated_files(loaded, findings);
    let before: Vec<(FileContentId, Option<Arc<CachedMesh>>)> = files
        .iter()
        .map(|file| {
            let name = mesh_path_and_options(file);
            let content = reading.contents.first_seen_content_id(&file.value, reading.token)?;
            if let Some(last) = cache.get_even_if_stale(&name) {
                // The mesh probably still references the same files, so hash them before they are read.
                content_ids_seen_by_request(&last.companions, reading)?;
            }
            Ok((content, cache.get(&name, mesh_key_without_companions(file, content))))
        })
        .collect::<Result<_, Canceled>>()?;
    let assets: Vec<AssetLoadResult<CachedMesh>> = reading.pool.install(|| {
        files
            .par_iter()
            .zip(before)
            .map(|(file, (content, kept))| {
                let load = |_: &Path, progress: Progress<'_>, _: &CancelToken| {
                    load_and_subdivide(file, reading, progress)
                };
                load_or_reuse_mesh(file, content, kept, reading, load)
            })
            .collect::<Result<_, _>>()
    })?;
    let mut meshes = Vec::new();
    let mut counts = FileCounts::default();
    let mut warnings = MeshWarnings::default();
    let file_materials = files_using_own_materials_mask(&loaded.scene);
    for ((file, asset), uses_own) in files.iter().zip(assets).zip(file_materials) {
        let content = asset.files[0].content;
        asset.files.into_iter().for_each(|file| findings.add_file(file));
        let mesh = match asset.result {
            Ok((mesh, was_kept)) => {
                counts.kept += usize::from(was_kept);
                counts.loaded += usize::from(!was_kept);
                warnings.add_file_warnings(file, &mesh.mesh, uses_own);
                let (name, key) = (mesh_path_and_options(file), mesh_key_without_companions(file, content));
                cache.insert(name, key, mesh.clone(), mesh.mesh.mesh.memory_bytes());
                mesh
            }
            Err(error) => {
                let error = AbortReason::reject_fatal_asset_error(error)?;
                counts.failed += 1;
                findings.add_asset_error(loaded, file.span.clone(), &error);
                let key = mesh_key_without_companions(file, content);
                Arc::new(CachedMesh::new(Arc::default(), key, Vec::new()))
            }
        };
        meshes.push(mesh);
    }
    add_limited_mesh_warnings(loaded, warnings.messages(), findings);
    let mut is_first_copy = loaded.scene.first_copy_filter();
    for (number, object) in loaded.scene.objects.iter().enumerate() {
        if object.material.is_none()
            && let Some(mesh) = object.shape.as_mesh()
            && meshes[mesh.file].mesh.lacks_materials()
            && is_first_copy(number)
        {
            let name = files[mesh.file].value.display();
            let message = format!("[[mesh]] needs `material`: {name} has no materials of its own");
            let help = "add a line such as `material = \"name\"`";
            findings.add_error(loaded, object.span.clone(), message, help);
        }
    }
    warn_about_missing_mesh_data(loaded, |file| &*meshes[file].mesh, findings);
    if counts.failed == 0 {
        let bounds = || meshes.iter().map(|mesh| mesh.bounds()).collect();
        findings.warnings.extend(loaded.lights_facing_nothing_warnings(bounds));
    }
    Ok(loading_result(meshes, counts))
}

/// Canonical path of a mesh file, a part number, and the number of subdivision levels.
pub(crate) type MeshPathAndOptions = (PathBuf, Option<u32>, u32);

fn mesh_path_and_options(file: &MeshFile) -> MeshPathAndOptions {
    (canonical_path(&file.value), file.part, file.subdivide)
}

/// Reads a mesh file and subdivides it.
fn load_and_subdivide(
    file: &MeshFile,
    reading: &FileReadContext<'_>,
    progress: Progress<'_>,
) -> Result<LoadedMesh, AssetError> {
    let MeshFile { value: path, part, subdivide: levels, .. } = file;
    let loaded = reading.containers.load_any_mesh(path, *part, progress, reading.token)?;
    let needed = subdivision_memory_bytes(loaded.mesh.triangles.len(), *levels);
    if *levels > 0 && needed > reading.available_memory {
        let [needed, available] = [needed, reading.available_memory].map(format_bytes);
        let message = format!(
            "`subdivide = {levels}` needs about {needed} of memory, but only {available} are left; use a lower level or \
             raise the limit"
        );
        return Err(AssetError::MemoryLimit { path: path.clone(), message });
    }
    subdivide(loaded, *levels, path, reading.token)
}

/// Loads one file, or returns the cached mesh if the file and all files it references are unchanged.
fn load_or_reuse_mesh(
    file: &MeshFile,
    content: FileContentId,
    kept: Option<Arc<CachedMesh>>,
    reading: &FileReadContext<'_>,
    load: impl Fn(&Path, Progress<'_>, &CancelToken) -> Result<LoadedMesh, AssetError>,
) -> Result<AssetLoadResult<CachedMesh>, Canceled> {
    let path = &file.value;
    let mut files = vec![FilePathAndContentId { path: path.to_owned(), content }];
    if let Some(mesh) = kept
        && mesh.companions == content_ids_seen_by_request(&mesh.companions, reading)?
    {
        files.extend(mesh.companions.iter().cloned());
        return Ok(AssetLoadResult { files, result: Ok((mesh, true)) });
    }
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let read =
        || reading.sink.load_asset_with_progress(&name, |progress| load(path, progress, reading.token));
    let mut loaded = read();
    if let Ok(mesh) = &loaded
        && has_companion_appeared(&mesh.companions, reading)?
    {
        loaded = read();
    }
    let result = match loaded {
        Ok(mesh) => {
            let content = reading.contents.record_decoded(path, mesh.hash);
            files[0].content = content;
            let read = |companion| reading.contents.record_companion(companion, reading.token);
            let companions = mesh.companions.iter().map(read).collect::<Result<Vec<_>, _>>()?;
            files.extend(companions.iter().cloned());
            let mut key = FingerprintHasher::new("mesh");
            key.add_fingerprint(&mesh_key_without_companions(file, content));
            for file in &companions {
                file.content.add_to_fingerprint(key.add_path_bytes(&file.path));
            }
            Ok((Arc::new(CachedMesh::new(Arc::new(mesh), key.finish(), companions)), false))
        }
        Err(error) => Err(error),
    };
    Ok(AssetLoadResult { files, result })
}

/// Whether a file that was missing when the mesh was loaded now exists without having been seen by this
/// request.
fn has_companion_appeared(companions: &[Companion], reading: &FileReadContext<'_>) -> Result<bool, Canceled> {
    for companion in companions.iter().filter(|companion| companion.hash.is_none()) {
        let is_new = reading.contents.content_id_if_seen(&companion.path).is_none();
        let content = reading.contents.first_seen_content_id(&companion.path, reading.token)?;
        if is_new && matches!(content, FileContentId::Hash(_)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Returns the files with their contents as first seen by this request.
fn content_ids_seen_by_request(
    files: &[FilePathAndContentId],
    reading: &FileReadContext<'_>,
) -> Result<Vec<FilePathAndContentId>, Canceled> {
    let now = |file: &FilePathAndContentId| {
        let content = reading.contents.first_seen_content_id(&file.path, reading.token)?;
        Ok(FilePathAndContentId { path: file.path.clone(), content })
    };
    files.iter().map(now).collect()
}

fn mesh_key_without_companions(file: &MeshFile, content: FileContentId) -> Fingerprint {
    let mut key = FingerprintHasher::new("file");
    content.add_to_fingerprint(
        key.add_path_bytes(&file.value).add_usize(file.part.map_or(0, |part| part as usize + 1)),
    );
    key.add_usize(file.subdivide as usize);
    key.finish()
}

/// Returns, for each mesh file, whether any object uses the file's own materials.
fn files_using_own_materials_mask(scene: &Scene) -> Vec<bool> {
    let mut shown = vec![false; scene.mesh_files.len()];
    let plain = scene.objects.iter().filter(|object| object.material.is_none());
    plain.filter_map(|object| object.shape.as_mesh()).for_each(|mesh| shown[mesh.file] = true);
    shown
}

#[cfg(test)]
mod tests {
    use super::super::containers::OpenAssetFiles;
    use super::super::mesh_warnings::MAX_WARNINGS;
    use super::*;
    use crate::sink::EventSink;
    use crate::watch::content::{FileHashCache, FilesSeenByRequest};

    const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";

    /// A folder containing a mesh and its material, and the state needed to load them.
    struct MeshFixture {
        folder: tempfile::TempDir,
        sink: EventSink,
        pool: rayon::ThreadPool,
        cache: CacheOfNamedValues<MeshPathAndOptions, CachedMesh>,
        contents: Arc<FileHashCache>,
    }

    impl MeshFixture {
        fn new() -> Self {
            let folder = tempfile::tempdir().expect("a scratch folder");
            let sink = EventSink::silent(0);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
            let fixture =
                Self { folder, sink, pool, cache: CacheOfNamedValues::default(), contents: Arc::default() };
            fixture.write("a.obj", OBJ);
            fixture.write("a.mtl", "newmtl m\nKd 1 0 0\n");
            fixture
        }

        fn write(&self, name: &str, text: &str) {
            std::fs::write(self.folder.path().join(name), text).expect("written");
        }

        fn snapshot(&self) -> FilesSeenByRequest {
            FilesSeenByRequest::new(self.contents.clone())
        }

        fn hash(&self, name: &str) -> FileContentId {
            let path = self.folder.path().join(name);
            FileHashCache::default().read_content_id(&path, &CancelToken::new()).expect("not canceled")
        }

        /// Loads `a.obj` from a snapshot. Returns the mesh and the contents of its files.
        fn read(&mut self, contents: &FilesSeenByRequest) -> (Arc<CachedMesh>, Vec<FilePathAndContentId>) {
            let (meshes, findings) = self.find("[[mesh]]\nfile = \"a.obj\"\n", contents);
            assert!(findings.errors.is_empty(), "{:?}", findings.errors);
            (meshes[0].clone(), findings.files)
        }

        /// Loads the meshes of a scene that contains `tables`.
        fn find(&mut self, tables: &str, contents: &FilesSeenByRequest) -> (MeshesByFileIndex, Findings) {
            let camera = "[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n";
            self.write("scene.toml", &format!("{tables}{camera}"));
            let loaded = crate::scene::load(&self.folder.path().join("scene.toml"), &[]).expect("a scene");
            let token = CancelToken::new();
            let reading = FileReadContext {
                sink: &self.sink,
                token: &token,
                contents,
                pool: &self.pool,
                containers: &OpenAssetFiles::default(),
                available_memory: u64::MAX,
            };
            let mut findings = Findings::default();
            let meshes =
                load_meshes(&loaded, &mut self.cache, &mut findings, &reading).expect("not canceled");
            (meshes.value, findings)
        }
    }

    #[test]
    fn unused_materials_do_not_cause_warnings() {
        let mut fixture = MeshFixture::new();
        fixture.write("a.obj", &OBJ.replace("usemtl m\n", "f 1 3 2\nusemtl none\n"));
        let mut count = |tables: &str| {
            let snapshot = fixture.snapshot();
            fixture.find(tables, &snapshot).1.warnings.len()
        };
        let own = "[[mesh]]\nfile = \"a.obj\"\n";
        let given = format!("[materials.red]\n{own}material = \"red\"\n");
        assert_eq!([count(own), count(&given), count(&format!("{given}{own}"))], [1, 0, 1]);
    }

    #[test]
    fn light_facing_away_from_meshes_causes_warning() {
        let mut fixture = MeshFixture::new();
        let mut count = |light: &str, place: &str| {
            let light =
                format!("[materials.light]\nemission = [5, 5, 5]\n[[quad]]\nmaterial = \"light\"\n{light}");
            let tables = format!("{light}\n[[mesh]]\nfile = \"a.obj\"\n{place}\n");
            let snapshot = fixture.snapshot();
            let warnings = fixture.find(&tables, &snapshot).1.warnings;
            for warning in &warnings {
                let place = warning.place.as_ref().expect("a place");
                assert!(warning.message.contains("shines away") && place.label == "all shapes are behind it");
                assert!(tables[place.span.start..].starts_with("[[quad]]"), "{warning:?}");
            }
            warnings.len()
        };
        // The triangle spans y = 0 to y = 1. The camera is at y = 0.
        let above_up = "corner = [-1, 2, -1]\nu = [0, 0, 2]\nv = [2, 0, 0]";
        let above_down = "corner = [-1, 2, -1]\nu = [2, 0, 0]\nv = [0, 0, 2]";
        let below_down = "corner = [-1, -2, -1]\nu = [2, 0, 0]\nv = [0, 0, 2]";
        for (light, place, expected) in [
            (above_up, "", 1),
            (above_down, "", 0),
            (below_down, "", 1),
            (above_up, "translate = [0, 3, 0]", 0),
            (above_up, "scale = [1, 4, 1]", 0),
            // Lay the mesh on its back, and turn it upside down.
            (above_up, "scale = [1, 4, 1]\nrotate = [90, 0, 0]", 1),
            (below_down, "rotate = [180, 0, 0]", 1),
            (below_down, "rotate = [180, 0, 0]\ntranslate = [0, -1.5, 0]", 0),
            // A light that is visible to the camera is assumed to be intentional.
            (above_down, "translate = [0, 3, 0]", 0),
        ] {
            assert_eq!(count(light, place), expected, "{light}\n{place}");
        }
    }

    #[test]
    fn subdivision_levels_are_cached_separately() {
        let mut fixture = MeshFixture::new();
        let mut load = |levels: &[u32]| {
            let table = |level: &u32| format!("[[mesh]]\nfile = \"a.obj\"\nsubdivide = {level}\n");
            let tables: String = levels.iter().map(table).collect();
            let snapshot = fixture.snapshot();
            let (meshes, findings) = fixture.find(&tables, &snapshot);
            assert!(findings.errors.is_empty(), "{:?}", findings.errors);
            let summary = |mesh: &Arc<CachedMesh>| (mesh.mesh.mesh.triangles.len(), mesh.key);
            meshes.iter().map(summary).collect::<Vec<_>>()
        };
        let (all, last) = (load(&[0, 1, 3, 1]), load(&[3]));
        assert_eq!(all.iter().map(|(triangles, _)| *triangles).collect::<Vec<_>>(), [1, 4, 64]);
        assert!(all[0].1 != all[1].1 && all[1].1 != all[2].1);
        assert_eq!(last, all[2..]);
    }

    #[test]
    fn warning_count_is_limited() {
        let mut fixture = MeshFixture::new();
        let names: String = (0..102).map(|name| format!("usemtl x{name}\nf 1 2 3\n")).collect();
        fixture.write("a.obj", &OBJ.replace("usemtl m\n", &names));
        let snapshot = fixture.snapshot();
        let warnings = fixture.find("[[mesh]]\nfile = \"a.obj\"\n", &snapshot).1.warnings;
        assert_eq!(warnings.len(), MAX_WARNINGS + 1);
        assert_eq!(warnings[MAX_WARNINGS].message, "2 more warnings about mesh files");
    }

    #[test]
    fn file_change_during_request_is_detected() {
        let mut fixture = MeshFixture::new();
        let old = fixture.hash("a.obj");
        fixture.read(&fixture.snapshot());
        // Change the file after the request has hashed it.
        let snapshot = fixture.snapshot();
        snapshot
            .first_seen_content_id(&fixture.folder.path().join("a.obj"), &CancelToken::new())
            .expect("not canceled");
        fixture.write("a.obj", &format!("{OBJ}f 1 3 2\n"));
        let (mesh, files) = fixture.read(&snapshot);
        assert_eq!((mesh.mesh.mesh.triangles.len(), files[0].content), (1, old), "cached");
        assert_eq!(snapshot.changed_file(), None);
        fixture.cache = CacheOfNamedValues::default();
        let (mesh, files) = fixture.read(&snapshot);
        assert_eq!((mesh.mesh.mesh.triangles.len(), files[0].content), (2, fixture.hash("a.obj")), "decoded");
        assert_eq!(
            snapshot.changed_file(),
            Some(fixture.folder.path().join("a.obj")),
            "the request should start again"
        );
        let (mesh, files) = fixture.read(&fixture.snapshot());
        assert_eq!(mesh.mesh.mesh.triangles.len(), 2);
        assert_eq!(files[0].content, fixture.hash("a.obj"));
    }

    #[test]
    fn material_file_change_after_loading_is_detected() {
        let fixture = MeshFixture::new();
        let path = fixture.folder.path().join("a.obj");
        let file = MeshFile { value: path, span: 0..0, part: None, subdivide: 0 };
        let snapshot = fixture.snapshot();
        let token = CancelToken::new();
        let reading = FileReadContext {
            sink: &fixture.sink,
            token: &token,
            contents: &snapshot,
            pool: &fixture.pool,
            containers: &OpenAssetFiles::default(),
            available_memory: u64::MAX,
        };
        let load_and_change = |path: &Path, progress: Progress<'_>, token: &CancelToken| {
            let mesh = crate::assets::mesh::load(path, progress, token);
            fixture.write("a.mtl", "newmtl m\nKd 0 1 0\n");
            mesh
        };
        let old = fixture.hash("a.mtl");
        let asset = load_or_reuse_mesh(&file, fixture.hash("a.obj"), None, &reading, load_and_change)
            .expect("not canceled");
        let mesh = asset.result.expect("a mesh").0;
        assert_eq!((asset.files[1].content, mesh.mesh.materials[0].diffuse.x), (old, 1.0));
    }

    #[test]
    fn new_material_file_is_read() {
        let fixture = MeshFixture::new();
        std::fs::remove_file(fixture.folder.path().join("a.mtl")).expect("removed");
        let path = fixture.folder.path().join("a.obj");
        let file = MeshFile { value: path, span: 0..0, part: None, subdivide: 0 };
        let snapshot = fixture.snapshot();
        let token = CancelToken::new();
        let reading = FileReadContext {
            sink: &fixture.sink,
            token: &token,
            contents: &snapshot,
            pool: &fixture.pool,
            containers: &OpenAssetFiles::default(),
            available_memory: u64::MAX,
        };
        let load_and_appear = |path: &Path, progress: Progress<'_>, token: &CancelToken| {
            let mesh = crate::assets::mesh::load(path, progress, token);
            fixture.write("a.mtl", "newmtl m\nKd 0 1 0\n");
            mesh
        };
        let asset = load_or_reuse_mesh(&file, fixture.hash("a.obj"), None, &reading, load_and_appear)
            .expect("not canceled");
        let mesh = asset.result.expect("a mesh").0;
        assert_eq!(asset.files[1].content, fixture.hash("a.mtl"));
        assert_eq!(mesh.mesh.materials[0].diffuse.y, 1.0);
    }
}
