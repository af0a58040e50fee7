//! Hashing of source files, independent of the machine.

use std::fs;
use std::path::{Path, PathBuf};

/// Hashes all files in these folders and these files, by content and relative path. Ignores tests and line endings. A
/// missing root is treated as empty, for a crate that is built alone.
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

/// Lists all files below a path except tests, in order.
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

/// 64-bit FNV-1a hash.
struct Hash(u64);

impl Default for Hash {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Hash {
    /// Adds bytes without carriage returns, and a terminator that text does not contain.
    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes.iter().filter(|byte| **byte != b'\r').chain(&[0xff]) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
