//! Checks that module dependencies match the table in `src/lib.rs` exactly.

mod cycles;
mod imports;
mod lengths;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use imports::Modules;

/// The modules that each top-level module may use, from the `text` block in `src/lib.rs`.
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let lib = fs::read_to_string(root().join("src/lib.rs")).expect("src/lib.rs");
    lib.lines()
        .filter_map(|line| line.strip_prefix("//! ")?.split_once("->"))
        .map(|(from, to)| (from.trim().to_owned(), to.split_whitespace().map(str::to_owned).collect()))
        .collect()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// Every source file with its module path: `module/file.rs`. In a single-module crate, the crate name is the
/// first component.
fn all_sources() -> Vec<(PathBuf, PathBuf)> {
    let modules = dependencies();
    let mut found = Vec::new();
    let crates = fs::read_dir(root().join("crates")).expect("the crates folder");
    let crates = crates.map(|entry| entry.expect("an entry").path()).chain([root()]);
    for folder in crates {
        let src = folder.join("src");
        let name = folder.file_name().and_then(|name| name.to_str()).expect("UTF-8");
        let prefix = if modules.contains_key(name) { name } else { "" };
        let mut files = Vec::new();
        sources(&src, &mut files);
        found.extend(files.into_iter().map(|file| {
            let path = Path::new(prefix).join(file.strip_prefix(&src).expect("a file of this crate"));
            (file, path)
        }));
    }
    found
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a source folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// All source files with their imports.
fn all_modules() -> Modules {
    Modules::new(all_sources().into_iter().map(|(file, path)| {
        let path = path.to_str().expect("UTF-8").to_owned();
        (path, fs::read_to_string(&file).expect("a source file"))
    }))
}

/// Every module that the code, excluding comments, refers to as `crate::module`.
fn used(text: &str) -> BTreeSet<String> {
    text.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| line.split("crate::").skip(1))
        .map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect())
        .collect()
}

#[test]
fn dependencies_match_the_table() {
    let table = dependencies();
    let mut seen: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (file, path) in all_sources() {
        let module = path.components().next().expect("a component").as_os_str();
        let module = module.to_str().expect("UTF-8").to_owned();
        if ["lib.rs", "main.rs", "bin"].contains(&module.as_str()) {
            continue;
        }
        let allowed = table.get(&module).unwrap_or_else(|| panic!("{module} is not in the table"));
        let seen = seen.entry(module.clone()).or_default();
        for other in used(&fs::read_to_string(&file).expect("a source file")) {
            // In a single-module crate, `crate::` also refers to the module's children.
            if other == module || !table.contains_key(&other) {
                continue;
            }
            assert!(allowed.contains(&other), "{}: {module} -> {other} is not in the table", path.display());
            seen.insert(other);
        }
    }
    assert_eq!(seen, table, "the table lists modules or dependencies that do not exist");
}

#[test]
fn dependencies_have_no_cycle() {
    let table = dependencies();
    for start in table.keys() {
        let mut reached: BTreeSet<&String> = table[start].iter().collect();
        loop {
            let next: BTreeSet<&String> = reached.iter().flat_map(|module| &table[*module]).collect();
            let before = reached.len();
            reached.extend(next);
            if reached.len() == before {
                break;
            }
        }
        assert!(!reached.contains(start), "{start} depends on itself");
    }
}

/// Functions from the system's math library, whose results differ between machines. `sqrt` and `mul_add` are
/// correctly rounded everywhere, but `mul_add` is slow on processors without an FMA instruction.
const LIBM: [&str; 34] = [
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

/// Modules that do not affect images: the terminal interface, progress, and the asset generator, which uses
/// the `libm` crate.
const EXEMPT: [&str; 3] = ["tui", "bin", "pipeline/render/forecast/work_rate.rs"];

/// Module compiled for specific instruction sets, some of which include FMA.
const SIMD: &str = "accel/wide_bvh/simd";

/// Standard library functions that panic if the system fails to close a folder. The asset generator and build
/// scripts may use them.
const PANICKING: [&str; 2] = ["fs::read_dir(", "fs::remove_dir_all("];

#[test]
fn folders_are_read_without_panics() {
    let mut found = Vec::new();
    for (file, path) in all_sources() {
        let is_test = path.to_str().is_some_and(|path| path.contains("tests"));
        if is_test || path.starts_with("bin") {
            continue;
        }
        let text = fs::read_to_string(&file).expect("a source file");
        let production = text.split("\n#[cfg(test)]\n").next().unwrap_or_default();
        let is_code = |(_, line): &(usize, &str)| !line.trim_start().starts_with("//");
        let lines = (1..).zip(production.lines()).filter(is_code);
        let called = lines.filter(|(_, line)| PANICKING.iter().any(|name| line.contains(name)));
        found.extend(called.map(|(number, line)| format!("{}:{number}: {}", path.display(), line.trim())));
    }
    assert!(found.is_empty(), "use `system::folder`:\n{}", found.join("\n"));
}

#[test]
fn images_do_not_depend_on_libm() {
    let mut found = Vec::new();
    for (file, path) in all_sources() {
        let is_test = path.to_str().is_some_and(|path| path.contains("tests"));
        if is_test || EXEMPT.iter().any(|exempt| path.starts_with(exempt)) {
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
            let is_instruction = |name: &str| name == "mul_add" && path.starts_with(SIMD);
            if is_glam || LIBM.iter().any(|name| is_called(name) && !is_instruction(name)) {
                found.push(format!("{}:{number}: {}", path.display(), line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "use `math::elementary` or `libm`:\n{}", found.join("\n"));
}
