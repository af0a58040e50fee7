//! The arrows between the rooms, as the map in `src/lib.rs` draws them: no other ones, and none for nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Room → rooms that it may use, read from the `text` block of the map.
fn map() -> BTreeMap<String, BTreeSet<String>> {
    let lib = fs::read_to_string(root().join("lib.rs")).expect("src/lib.rs");
    lib.lines()
        .filter_map(|line| line.strip_prefix("//! ")?.split_once("->"))
        .map(|(from, to)| (from.trim().to_owned(), to.split_whitespace().map(str::to_owned).collect()))
        .collect()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// Every room that the text names as `crate::room`, outside comments.
fn used(text: &str) -> BTreeSet<String> {
    text.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| line.split("crate::").skip(1))
        .map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect())
        .collect()
}

#[test]
fn every_arrow_is_on_the_map_and_every_one_there_is_used() {
    let map = map();
    let mut files = Vec::new();
    sources(&root(), &mut files);
    let mut drawn: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for file in files {
        let inside = file.strip_prefix(root()).expect("a file of src");
        let room = inside.components().next().expect("a component").as_os_str();
        let room = room.to_str().expect("UTF-8").to_owned();
        if ["lib.rs", "main.rs", "bin"].contains(&room.as_str()) {
            continue;
        }
        let allowed = map.get(&room).unwrap_or_else(|| panic!("{room} is not on the map"));
        let drawn = drawn.entry(room.clone()).or_default();
        for other in used(&fs::read_to_string(&file).expect("a source file")) {
            if other == room {
                continue;
            }
            assert!(allowed.contains(&other), "{}: {room} -> {other} is not on the map", inside.display());
            drawn.insert(other);
        }
    }
    assert_eq!(drawn, map, "the map has rooms or arrows that nothing needs");
}

#[test]
fn the_map_has_no_cycle() {
    let map = map();
    for start in map.keys() {
        let mut reached: BTreeSet<&String> = map[start].iter().collect();
        loop {
            let next: BTreeSet<&String> = reached.iter().flat_map(|room| &map[*room]).collect();
            let before = reached.len();
            reached.extend(next);
            if reached.len() == before {
                break;
            }
        }
        assert!(!reached.contains(start), "{start} is reached from itself");
    }
}
