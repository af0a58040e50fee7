//! The arrows between the rooms, as the map in `src/lib.rs` draws them: no others are used, and each is used.

mod circles;
mod imports;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Room → rooms that it may use, read from the `text` block of the map.
fn map() -> BTreeMap<String, BTreeSet<String>> {
    let lib = fs::read_to_string(root().join("src/lib.rs")).expect("src/lib.rs");
    lib.lines()
        .filter_map(|line| line.strip_prefix("//! ")?.split_once("->"))
        .map(|(from, to)| (from.trim().to_owned(), to.split_whitespace().map(str::to_owned).collect()))
        .collect()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// Folders in which rooms stand: the sources of every crate.
fn houses() -> Vec<PathBuf> {
    let crates = fs::read_dir(root().join("crates")).expect("the folder of crates");
    crates.map(|entry| entry.expect("an entry").path().join("src")).chain([root().join("src")]).collect()
}

/// Every source file, with its path below its crate's sources: `room/file.rs`.
fn all_sources() -> Vec<(PathBuf, PathBuf)> {
    let mut found = Vec::new();
    for house in houses() {
        let mut files = Vec::new();
        sources(&house, &mut files);
        found.extend(files.into_iter().map(|file| {
            let inside = file.strip_prefix(&house).expect("a file of this crate").to_owned();
            (file, inside)
        }));
    }
    found
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
    let mut drawn: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (file, inside) in all_sources() {
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

/// Functions of the system's library, whose bits differ between machines. (`sqrt` is right to the last bit everywhere;
/// a fused product is too, but slow if the processor has none.)
const OF_THE_SYSTEM: [&str; 34] = [
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "sin_cos",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "acosh",
    "atanh",
    "exp",
    "exp2",
    "exp_m1",
    "ln",
    "ln_1p",
    "log",
    "log2",
    "log10",
    "powf",
    "powi",
    "cbrt",
    "hypot",
    "mul_add",
    "rotate_x",
    "rotate_y",
    "rotate_z",
    "to_angle",
    "angle_between",
    "slerp",
    "angle_to",
];

/// Rooms whose results are in no picture: the screen, progress, the assets' generator (which has `libm`).
const ELSEWHERE: [&str; 3] = ["tui", "bin", "pipeline/render/forecast/pace.rs"];

/// The room whose functions are compiled for instructions by name, among them those that `mul_add` is.
const INSTRUCTIONS: &str = "accel/wide_bvh/simd";

#[test]
fn no_function_of_the_system_s_library_is_between_a_scene_and_its_picture() {
    let mut found = Vec::new();
    for (file, inside) in all_sources() {
        let is_test = inside.to_str().is_some_and(|path| path.contains("tests"));
        if is_test || ELSEWHERE.iter().any(|place| inside.starts_with(place)) {
            continue;
        }
        let text = fs::read_to_string(&file).expect("a source file");
        let production = text.split("\n#[cfg(test)]\n").next().unwrap_or_default();
        for (number, line) in
            (1..).zip(production.lines()).filter(|(_, line)| !line.trim_start().starts_with("//"))
        {
            let is_called = |name: &str| {
                line.contains(&format!(".{name}("))
                    || line.contains(&format!("f32::{name}"))
                    || line.contains(&format!("f64::{name}"))
            };
            let is_glam = line.contains("from_angle(")
                || line.contains("from_axis_angle(")
                || line.contains("from_euler(");
            let is_instruction = |name: &str| name == "mul_add" && inside.starts_with(INSTRUCTIONS);
            if is_glam || OF_THE_SYSTEM.iter().any(|name| is_called(name) && !is_instruction(name)) {
                found.push(format!("{}:{number}: {}", inside.display(), line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "use `math::elementary` or `libm`:\n{}", found.join("\n"));
}
