//! Caches results computed from asset files, so that reloading a scene after an edit does not recompute them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};

use crate::system::file::FileStamp;

/// Maximum number of cached images.
const MAX_IMAGES: usize = 10_000;

static GRAY_IMAGES: LazyLock<Mutex<HashMap<PathBuf, (FileStamp, bool)>>> = LazyLock::new(Mutex::default);

static ENVIRONMENT: Mutex<Option<(String, Vec<u8>)>> = Mutex::new(None);

/// Returns whether the image is gray. Calls `find` unless the result for this path and stamp is cached.
pub(super) fn memoized_is_gray(path: &Path, stamp: Option<FileStamp>, find: impl FnOnce() -> bool) -> bool {
    let lock = || GRAY_IMAGES.lock().unwrap_or_else(PoisonError::into_inner);
    let known = lock().get(path).filter(|(known, _)| Some(*known) == stamp).map(|(_, is_gray)| *is_gray);
    known.unwrap_or_else(|| {
        let is_gray = find();
        if let Some(stamp) = stamp {
            let mut images = lock();
            if images.len() >= MAX_IMAGES {
                images.clear();
            }
            images.insert(path.to_owned(), (stamp, is_gray));
        }
        is_gray
    })
}

/// Returns the environment map for a key. Calls `make` unless the last map had the same key.
pub(super) fn memoized_environment_map(key: String, make: impl FnOnce() -> Vec<u8>) -> Vec<u8> {
    let lock = || ENVIRONMENT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, bytes)) = lock().as_ref().filter(|(known, _)| *known == key) {
        return bytes.clone();
    }
    let bytes = make();
    *lock() = Some((key, bytes.clone()));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_depend_on_stamps_and_keys() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        std::fs::write(&path, "a").expect("written");
        let stamp = FileStamp::from_path(&path);
        assert!(memoized_is_gray(&path, stamp, || true));
        assert!(memoized_is_gray(&path, stamp, || false), "cached");
        std::fs::write(&path, "ab").expect("written");
        assert!(!memoized_is_gray(&path, FileStamp::from_path(&path), || false));
        assert_eq!(memoized_environment_map("first of test".to_owned(), || vec![1]), [1]);
        assert_eq!(memoized_environment_map("second of test".to_owned(), || vec![2]), [2]);
    }
}
