//! Circles of imports between the files of a room: a room without circles has an order in which to read it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use super::imports::{Module, Modules};
use super::{all_sources, root};

/// Two files that import from each other, and why they do.
const PAIRS: [(&str, &str, &str); 9] = [
    (
        "accel/bvh/build",
        "accel/bvh/top_node",
        "the upper levels are built of the references that the builder sorts",
    ),
    (
        "accel/wide_bvh/build/split",
        "accel/wide_bvh/simd/binning",
        "vector instructions count what a split bins",
    ),
    ("bench/measure", "bench/run", "a run measures methods, each of which looks at the run's orders"),
    ("output/error", "output/format", "an error lists the formats; an unknown format is an error"),
    (
        "scene/description/material",
        "scene/fingerprint",
        "a fingerprint looks up the textures that materials name",
    ),
    ("scene/document/key", "scene/document/table", "a key may hold a table, a table holds keys"),
    (
        "pipeline/watch/content",
        "pipeline/watch/outputs",
        "contents are shared with the outputs, whose contents tell whether they are lost",
    ),
    ("world/geometry", "world/isolated", "the geometry keeps what is found out of it"),
    ("world/mesh_instance", "world/mesh_packet", "packets and single hits are interpolated identically"),
];

/// Rooms that have larger circles for now. To be removed with the last of these.
const UNTANGLED_LATER: [&str; 0] = [];

/// The files of all rooms, with their imports.
fn all_modules() -> Modules {
    Modules::new(all_sources().into_iter().map(|(file, inside)| {
        let path = inside.to_str().expect("UTF-8").to_owned();
        (path, fs::read_to_string(&file).expect("a source file"))
    }))
}

/// Groups of files that reach each other by imports within their room.
fn circles() -> Vec<Vec<String>> {
    let modules = all_modules();
    let used: BTreeMap<&Module, BTreeSet<Module>> = modules
        .all()
        .map(|module| {
            let in_room = |other: &Module| other[0] == module[0];
            (module, modules.used_by(module).into_iter().filter(in_room).collect())
        })
        .collect();
    let reached: BTreeMap<&Module, BTreeSet<&Module>> =
        used.keys().map(|module| (*module, reached_from(module, &used))).collect();
    let reaches = |from: &Module, to: &Module| reached[from].contains(to);
    let mut circles = BTreeSet::new();
    for module in modules.all().filter(|module| reaches(module, module)) {
        let circle = modules.all().filter(|other| reaches(module, other) && reaches(other, module));
        circles.insert(circle.map(|module| module.join("/")).collect());
    }
    circles.into_iter().collect()
}

fn reached_from<'a>(start: &Module, used: &'a BTreeMap<&Module, BTreeSet<Module>>) -> BTreeSet<&'a Module> {
    let mut reached = BTreeSet::new();
    let mut next: Vec<&Module> = used[start].iter().collect();
    while let Some(module) = next.pop() {
        if reached.insert(module) {
            next.extend(&used[module]);
        }
    }
    reached
}

#[test]
fn files_of_a_room_import_in_one_direction_but_for_pairs_with_a_reason() {
    let (mut pairs, mut tangled) = (BTreeSet::new(), BTreeSet::new());
    for circle in circles() {
        let room = circle[0].split('/').next().unwrap_or_default().to_owned();
        match &circle[..] {
            _ if UNTANGLED_LATER.contains(&&*room) => drop(tangled.insert(room)),
            [one, other] => drop(pairs.insert((one.clone(), other.clone()))),
            larger => panic!("{} files of {room} import in a circle: {larger:?}", larger.len()),
        }
    }
    let listed = PAIRS.map(|(one, other, _)| (one.to_owned(), other.to_owned()));
    assert_eq!(pairs, BTreeSet::from(listed), "pairs that are there, and pairs that are listed");
    assert_eq!(
        tangled,
        BTreeSet::from(UNTANGLED_LATER.map(str::to_owned)),
        "rooms without circles: take them from the list"
    );
}

/// Ranks of the parts of the integrators, by the `text` block of their map: a line for each rank.
fn ranks() -> BTreeMap<String, usize> {
    let map = fs::read_to_string(root().join("crates/trace/src/integrators/mod.rs")).expect("the map");
    let block = map.split("```").nth(1).and_then(|block| block.strip_prefix("text\n")).expect("a table");
    let lines = block.lines().filter_map(|line| line.strip_prefix("//! ")?.split_once("  ")).enumerate();
    let parts = |(rank, (names, _)): (usize, (&str, &str))| {
        names.split(", ").map(|name| (name.to_owned(), rank)).collect::<Vec<_>>()
    };
    lines.flat_map(parts).collect()
}

#[test]
fn each_part_of_the_integrators_uses_those_above_it() {
    let (modules, ranks) = (all_modules(), ranks());
    let mut found = BTreeSet::new();
    for module in modules.all().filter(|module| module[0] == "integrators" && module.len() > 1) {
        let rank = ranks.get(&module[1]).unwrap_or_else(|| panic!("{module:?} is not in the table"));
        found.insert(module[1].clone());
        for used in modules.used_by(module) {
            let is_other = used[0] == "integrators" && used.len() > 1 && used[1] != module[1];
            assert!(!is_other || ranks[&used[1]] < *rank, "{module:?} uses {used:?}");
        }
    }
    assert_eq!(found, ranks.into_keys().collect(), "parts that are there, and parts in the table");
}
