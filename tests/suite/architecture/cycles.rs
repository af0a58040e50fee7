//! Import cycles between the files of a module. A module without cycles can be read from top to bottom.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use super::imports::Module;
use super::{all_modules, root};

/// Pairs of files that may import each other, each with the reason.
const PAIRS: [(&str, &str, &str); 9] = [
    (
        "accel/bvh/build",
        "accel/bvh/top_node",
        "the upper levels are built from the builder's sorted references",
    ),
    (
        "accel/wide_bvh/build/split",
        "accel/wide_bvh/simd/binning",
        "split bins are counted with vector instructions",
    ),
    ("cli/bench/measure", "cli/bench/run", "a run measures methods, and each method reads the run's options"),
    (
        "output/error",
        "output/format",
        "an error lists the valid formats, and parsing a format may return this error",
    ),
    (
        "scene/description/texture",
        "scene/fingerprint",
        "a fingerprint includes the textures that materials refer to",
    ),
    ("scene/document/key", "scene/document/table", "a key may contain a table, and a table contains keys"),
    (
        "pipeline/watch/content",
        "pipeline/watch/outputs",
        "outputs use the stored contents to detect whether they were replaced",
    ),
    ("world/geometry", "world/isolated", "the geometry stores its isolated surfaces"),
    ("world/mesh_instance", "world/mesh_packet", "packets and single hits share interpolation code"),
];

/// Import cycles within a module: groups of files that reach each other through imports.
fn cycles() -> Vec<Vec<String>> {
    let modules = all_modules();
    let used: BTreeMap<&Module, BTreeSet<Module>> = modules
        .all()
        .map(|module| {
            let in_module = |other: &Module| other[0] == module[0];
            (module, modules.used_by(module).into_iter().filter(in_module).collect())
        })
        .collect();
    let reached: BTreeMap<&Module, BTreeSet<&Module>> =
        used.keys().map(|module| (*module, reached_from(module, &used))).collect();
    let reaches = |from: &Module, to: &Module| reached[from].contains(to);
    let mut cycles = BTreeSet::new();
    for module in modules.all().filter(|module| reaches(module, module)) {
        let cycle = modules.all().filter(|other| reaches(module, other) && reaches(other, module));
        cycles.insert(cycle.map(|module| module.join("/")).collect());
    }
    cycles.into_iter().collect()
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
fn only_listed_pairs_import_each_other() {
    let mut pairs = BTreeSet::new();
    for cycle in cycles() {
        match &cycle[..] {
            [one, other] => drop(pairs.insert((one.clone(), other.clone()))),
            larger => panic!("import cycle of {} files: {larger:?}", larger.len()),
        }
    }
    let listed = PAIRS.map(|(one, other, _)| (one.to_owned(), other.to_owned()));
    assert_eq!(pairs, BTreeSet::from(listed), "existing pairs and listed pairs differ");
}

/// The rank of each integrator submodule: its line number in the `text` block of the module documentation.
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
fn integrators_use_only_lower_ranks() {
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
    assert_eq!(found, ranks.into_keys().collect(), "existing submodules and submodules in the table differ");
}
