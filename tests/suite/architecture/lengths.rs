//! Lengths of the source files.

use std::fs;

use super::{all_modules, all_sources};

/// Maximum number of lines in a file, as in CONTRIBUTING. Files that contain only tests may be longer.
const MAX_LINES: usize = 500;

#[test]
fn production_files_have_at_most_500_lines() {
    let modules = all_modules();
    let (mut count, mut found) = (0, Vec::new());
    for (file, path) in all_sources() {
        let path = path.to_str().expect("UTF-8");
        if !modules.is_production(path) {
            continue;
        }
        count += 1;
        let lines = fs::read_to_string(&file).expect("a source file").lines().count();
        if lines > MAX_LINES {
            found.push(format!("{path}: {lines} lines"));
        }
    }
    assert!(count > 500, "only {count} files");
    assert!(found.is_empty(), "divide these files by subject:\n{}", found.join("\n"));
}
