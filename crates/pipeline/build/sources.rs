//! Platform-independent hashing of source files.

use std::fs;
use std::path::{Path, PathBuf};

/// Hashes the relative path and content of every file in `roots`, each of which is a folder or a single file.
/// Ignores tests and line endings. A missing root counts as empty, so that a crate can be built outside the
/// workspace.
pub fn source_hash(roots: &[PathBuf]) -> u64 {
    let mut hash = Fnv1a::default();
    for root in roots {
        for file in list_files(root) {
            let name = file.strip_prefix(root).unwrap_or(&file);
            hash.add_text(name.to_string_lossy().as_bytes());
            hash.add_text(&fs::read(&file).unwrap_or_default());
        }
    }
    hash.0
}

/// Recursively lists all files under a path in sorted order, skipping tests.
fn list_files(path: &Path) -> Vec<PathBuf> {
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
    paths.iter().flat_map(|path| list_files(path)).collect()
}

/// 64-bit FNV-1a hash.
struct Fnv1a(u64);

impl Default for Fnv1a {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv1a {
    /// Hashes the bytes, skipping carriage returns, followed by a terminator that never occurs in UTF-8 text.
    fn add_text(&mut self, bytes: &[u8]) {
        for byte in bytes.iter().filter(|byte| **byte != b'\r').chain(&[0xff]) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
