//! Cached references: one file per fingerprint, with a checksum.
//!
//! A file contains a line of JSON, the pixels of both images as little-endian floats, and a fingerprint of
//! all preceding bytes.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::compare::ImagePair;
use crate::control::CancelToken;
use crate::film::RadianceImage;
use crate::math::Vec3;
use crate::output::write::ExistingFilePolicy;
use crate::output::{AttributeLossPolicy, OutputError, staged, write};
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};

/// Returns the cache folder for references, inside `XDG_CACHE_HOME` or `~/.cache`, or `None` if neither
/// `XDG_CACHE_HOME` nor `HOME` is set.
pub fn cache_folder() -> Option<PathBuf> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let caches = absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".cache")))?;
    Some(caches.join("glimt").join("references"))
}

/// Writes the starter scene to a file in a subfolder and returns the file's path. Never overwrites files.
///
/// # Errors
/// Returns an error if the folder or the file cannot be created, or if a different file with this name
/// exists.
pub fn write_starter_scene(folder: &Path) -> Result<PathBuf, OutputError> {
    let text = crate::scene::starter_scene().as_bytes();
    // Use one subfolder per version of the starter scene, because a scene file directly in the cache folder
    // may belong to the user.
    let folder = folder.join(format!(
        "starter-{}",
        &FingerprintHasher::new("starter").add_bytes(text).finish().to_string()[..16]
    ));
    create_folder(&folder)?;
    let path = folder.join("starter.toml");
    let exists_unchanged = || fs::read(&path).is_ok_and(|found| found == text);
    if exists_unchanged() {
        return Ok(path);
    }
    match staged::create_files_atomically(&folder, &[("starter.toml".into(), text)], &CancelToken::new()) {
        // Another process may have written the file in the meantime.
        Err(_) if exists_unchanged() => Ok(path),
        Err(_) if path.symlink_metadata().is_ok() => Err(unrecognized_file_error(&path, "the starter scene")),
        written => written.map(|()| path),
    }
}

/// Error for an existing file that glimt did not write.
fn unrecognized_file_error(path: &Path, what: &str) -> OutputError {
    let reason = format!(
        "cannot write {}: the existing file is not {what}; move it or choose another folder with --cache",
        path.display()
    );
    OutputError::Refused { reason }
}

fn create_folder(folder: &Path) -> Result<(), OutputError> {
    fs::create_dir_all(folder).map_err(|source| OutputError::File { path: folder.to_owned(), source })
}

/// Two references and their cost.
#[derive(Clone, Debug)]
pub(super) struct ReferencesWithCost {
    pub(super) pair: ImagePair,
    pub(super) cost: ReferenceCost,
}

/// Rendering cost of two references.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ReferenceCost {
    /// Average samples per pixel of each reference.
    pub(super) samples: f64,
    /// Total rendering time in seconds.
    pub(super) seconds: f64,
}

/// The JSON line of a cache file.
#[derive(Serialize, Deserialize)]
struct CachedReferenceHeader {
    width: u32,
    height: u32,
    cost: ReferenceCost,
}

const KEY_BYTES: usize = 64;

/// Loads the references stored under a key, or returns `None` if the file is missing or damaged.
pub(super) fn load(folder: &Path, key: &Fingerprint) -> Option<ReferencesWithCost> {
    let bytes = fs::read(cached_reference_path(folder, key)).ok()?;
    let (content, seal) = bytes.split_at_checked(bytes.len().checked_sub(KEY_BYTES)?)?;
    if integrity_checksum(content).as_bytes() != seal {
        return None;
    }
    let end = content.iter().position(|byte| *byte == b'\n')?;
    let CachedReferenceHeader { width, height, cost } = serde_json::from_slice(&content[..end]).ok()?;
    let (floats, _) = content[end + 1..].as_chunks();
    let values: Vec<f32> = floats.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    let pixels: Vec<Vec3> =
        values.as_chunks().0.iter().map(|pixel: &[f32; 3]| Vec3::from_array(*pixel)).collect();
    let count = width as usize * height as usize;
    if count == 0 || pixels.len() != 2 * count {
        return None;
    }
    let image = |pixels: &[Vec3]| RadianceImage { width, height, pixels: pixels.to_vec() };
    let pair = ImagePair::new([folder, folder], image(&pixels[..count]), image(&pixels[count..])).ok()?;
    Some(ReferencesWithCost { pair, cost })
}

/// Stores references under a key.
///
/// # Errors
/// Returns an error if the folder cannot be created or the file cannot be written.
pub(super) fn store(
    folder: &Path,
    key: &Fingerprint,
    stored: &ReferencesWithCost,
) -> Result<(), OutputError> {
    let path = cached_reference_path(folder, key);
    create_folder(folder)?;
    let (a, b) = (stored.pair.measured_image(), stored.pair.reference());
    let head = CachedReferenceHeader { width: a.width, height: a.height, cost: stored.cost };
    let mut bytes = serde_json::to_vec(&head)
        .map_err(|error| OutputError::File { path: path.clone(), source: error.into() })?;
    bytes.push(b'\n');
    for pixel in a.pixels.iter().chain(&b.pixels) {
        pixel.to_array().iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    let seal = integrity_checksum(&bytes);
    bytes.extend(seal.as_bytes());
    let may_replace = |real: &Path| {
        if is_replaceable(real) { Ok(()) } else { Err(unrecognized_file_error(&path, "a reference")) }
    };
    let guard = ExistingFilePolicy {
        is_kept: &|_| false,
        may_replace: &may_replace,
        sweep: None,
        losses: AttributeLossPolicy::Report(&|_| ()),
    };
    write::write_atomically_with_policy(&path, &bytes, &guard, &CancelToken::new())
}

/// Whether a file may be replaced because it is missing, empty or a (possibly damaged) cached reference.
fn is_replaceable(path: &Path) -> bool {
    const HEAD_BYTES: u64 = 1 << 10;
    let Ok(file) = fs::File::open(path) else { return path.symlink_metadata().is_err() };
    let mut start = Vec::new();
    let is_read = file.take(HEAD_BYTES).read_to_end(&mut start).is_ok();
    let line = start.split(|byte| *byte == b'\n').next().unwrap_or_default();
    is_read && (start.is_empty() || serde_json::from_slice::<CachedReferenceHeader>(line).is_ok())
}

fn integrity_checksum(content: &[u8]) -> String {
    FingerprintHasher::new("references").add_bytes(content).finish().to_string()
}

fn cached_reference_path(folder: &Path, key: &Fingerprint) -> PathBuf {
    folder.join(format!("{key}.pair"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stored() -> ReferencesWithCost {
        let image =
            |value| RadianceImage { width: 3, height: 2, pixels: vec![Vec3::new(value, -0.5, 1e-30); 6] };
        let pair = ImagePair::new([Path::new("a"), Path::new("b")], image(1.0), image(2.0)).expect("a pair");
        ReferencesWithCost { pair, cost: ReferenceCost { samples: 12.5, seconds: 3.25 } }
    }

    #[test]
    fn foreign_files_are_never_overwritten() {
        let folder = tempfile::tempdir().expect("a folder");
        let own = folder.path().join("starter.toml");
        fs::write(&own, "the user's scene").expect("written");
        let scene = write_starter_scene(folder.path()).expect("a scene");
        assert_eq!(fs::read_to_string(&own).expect("a scene"), "the user's scene");
        assert_eq!(fs::read_to_string(&scene).expect("a scene"), crate::scene::starter_scene());
        assert_eq!(write_starter_scene(folder.path()).expect("it exists"), scene);
        fs::write(&scene, "edited").expect("written");
        let why = write_starter_scene(folder.path()).expect_err("edited").to_string();
        assert!(why.contains("starter.toml") && why.contains("--cache"), "{why}");
        assert_eq!(fs::read_to_string(&scene).expect("a scene"), "edited");
        // References replace only empty files and other references.
        let key = FingerprintHasher::new("x").finish();
        let path = cached_reference_path(folder.path(), &key);
        fs::write(&path, "notes").expect("written");
        assert!(store(folder.path(), &key, &stored()).is_err());
        assert_eq!(fs::read_to_string(&path).expect("notes"), "notes");
        for replaceable in
            ["", "{\"width\":4,\"height\":4,\"cost\":{\"samples\":1.0,\"seconds\":1.0}}\ndamaged"]
        {
            fs::write(&path, replaceable).expect("written");
            store(folder.path(), &key, &stored()).expect("stored");
            assert!(load(folder.path(), &key).is_some());
        }
    }

    #[test]
    fn stored_references_are_restored_exactly() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path().join("not/there/yet");
        let key = FingerprintHasher::new("x").finish();
        assert!(load(&folder, &key).is_none());
        store(&folder, &key, &stored()).expect("stored");
        let back = load(&folder, &key).expect("stored references");
        assert_eq!(back.cost, stored().cost);
        assert_eq!(
            (back.pair.measured_image(), back.pair.reference()),
            (stored().pair.measured_image(), stored().pair.reference())
        );
        assert!(load(&folder, &FingerprintHasher::new("y").finish()).is_none());
    }

    #[test]
    fn damaged_files_are_ignored() {
        let folder = tempfile::tempdir().expect("a folder");
        let key = FingerprintHasher::new("x").finish();
        store(folder.path(), &key, &stored()).expect("stored");
        let path = cached_reference_path(folder.path(), &key);
        let whole = fs::read(&path).expect("bytes");
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).expect("written");
            assert!(load(folder.path(), &key).is_none(), "cut after {length} bytes");
        }
        for place in 0..whole.len() {
            let mut broken = whole.clone();
            broken[place] ^= 1;
            fs::write(&path, broken).expect("written");
            assert!(load(folder.path(), &key).is_none(), "flipped a bit in byte {place}");
        }
        let lie = b"{\"width\":4,\"height\":4,\"cost\":{\"samples\":1.0,\"seconds\":1.0}}\n".to_vec();
        fs::write(&path, [lie.clone(), integrity_checksum(&lie).into_bytes()].concat()).expect("written");
        assert!(load(folder.path(), &key).is_none(), "fewer pixels than specified in the header");
    }
}
