//! A hash of source files that is the same on every machine.

use std::fs;
use std::path::{Path, PathBuf};

/// Hash of all files in these folders, and of these files, by content and by path below the root. Tests and line endings do not
/// count; a root that does not exist counts as empty, as in a crate that is built by itself.
pub fn identity(roots: &[PathBuf]) -> u64 {
    let mut hash = Hash::default();
    for root in roots {
        for file in files(root) {
            let name = file.strip_prefix(root).unwrap_or(&file);
            hash.add(name.to_string_lossy().as_bytes());
            hash.add(&fs::read(&file).unwrap_or_default());
        }
    }
    hash.0
}

/// All files below a path that are not tests, in order.
fn files(path: &Path) -> Vec<PathBuf> {
    let name = path.file_name().unwrap_or_default();
    if name == "tests" || name == "tests.rs" {
        return Vec::new();
    }
    if path.is_file() {
        return vec![path.to_owned()];
    }
    let Ok(entries) = fs::read_dir(path) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    paths.iter().flat_map(|path| files(path)).collect()
}

/// FNV-1a.
struct Hash(u64);

impl Default for Hash {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Hash {
    /// Adds bytes without carriage returns, then an end that they do not contain.
    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes.iter().filter(|byte| **byte != b'\r').chain(&[0xff]) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
