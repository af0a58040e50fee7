//! Fuzzing: runs `check` on randomly mutated scenes and assets. It must not crash or hang, must exit with 0
//! or 2, must not use much memory, and must not print control characters.
//!
//! The suite runs a short version. The long version takes about ten minutes on two cores:
//!
//! ```text
//! GLIMT_FUZZ_CASES=20000,5000,500 cargo test --profile quick --test suite fuzz -- --nocapture
//! ```
//!
//! The first two numbers count the scenes and assets that the library checks in worker processes. The third
//! counts the files of each kind that the program checks. `GLIMT_FUZZ_SEED` (an integer, 1 by default)
//! selects different files; a seed always generates the same files. Files that fail are kept in a folder,
//! which the failure message names.

mod change;
mod program;
mod seeds;
mod worker;

use std::fmt;
use std::fs;
use std::path::PathBuf;

use glimt::math::random::TestRandom;
use seeds::{Seed, assets, scenes};

/// Kind of the mutated file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FuzzInput {
    Scene,
    Asset,
}

/// One file to check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Case {
    kind: FuzzInput,
    seed: u64,
    number: u64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, seed, number } = self;
        write!(f, "{kind:?} {number} of seed {seed}")
    }
}

/// The original files for all cases.
struct Corpus {
    scenes: Vec<Seed>,
    assets: Vec<Seed>,
}

impl Corpus {
    fn new() -> Self {
        Self { scenes: scenes(), assets: assets() }
    }

    /// The mutated file for a case, with the name of the original file.
    fn make(&self, case: Case) -> Seed {
        let seeds = match case.kind {
            FuzzInput::Scene => &self.scenes,
            FuzzInput::Asset => &self.assets,
        };
        let mut random = TestRandom::stream(case.seed ^ (case.kind as u64) << 32, case.number);
        let seed = random.pick(seeds);
        let other = random.pick(seeds);
        Seed { bytes: change::changed(&seed.bytes, &other.bytes, &mut random), ..seed.clone() }
    }
}

/// Number of scenes and of assets for the library to check, and number of files of each kind for the program
/// to check.
fn counts() -> [u64; 3] {
    let asked = std::env::var("GLIMT_FUZZ_CASES").unwrap_or_else(|_| "250,250,15".to_owned());
    let numbers: Vec<u64> =
        asked.split(',').map(|number| number.trim().parse().expect("three numbers")).collect();
    numbers.try_into().expect("GLIMT_FUZZ_CASES must be three numbers: scenes,assets,program")
}

fn seed() -> u64 {
    std::env::var("GLIMT_FUZZ_SEED").map_or(1, |seed| seed.parse().expect("a whole number"))
}

/// Writes the files from failed cases to a folder and panics with its path.
fn save_failures_and_panic(failures: &[(Case, String)]) {
    if failures.is_empty() {
        return;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fuzz");
    fs::create_dir_all(&folder).expect("a folder");
    let material = Corpus::new();
    let mut text = String::new();
    for (case, reason) in failures {
        let made = material.make(*case);
        let path = folder.join(format!("{:?}-{}-{}-{}", case.kind, case.seed, case.number, made.file));
        fs::write(&path, &made.bytes).expect("written");
        text.push_str(&format!("{case}: {reason}\n    {}\n", path.display()));
    }
    assert!(failures.is_empty(), "{} failed:\n{text}", failures.len());
}

#[test]
fn fuzzed_scenes_are_accepted_or_rejected() {
    save_failures_and_panic(&worker::check_all(FuzzInput::Scene, seed(), counts()[0]));
}

#[test]
fn fuzzed_assets_are_accepted_or_rejected() {
    save_failures_and_panic(&worker::check_all(FuzzInput::Asset, seed(), counts()[1]));
}

#[test]
fn check_exits_with_0_or_2() {
    let [_, _, count] = counts();
    save_failures_and_panic(
        &[
            program::check_all(FuzzInput::Scene, seed(), count),
            program::check_all(FuzzInput::Asset, seed(), count),
        ]
        .concat(),
    );
}

#[test]
fn same_seed_generates_the_same_files() {
    let (one, other) = (Corpus::new(), Corpus::new());
    let mut changed = 0;
    for number in 0..100 {
        for kind in [FuzzInput::Scene, FuzzInput::Asset] {
            let case = Case { kind, seed: 3, number };
            assert_eq!(one.make(case), other.make(case), "{case}");
            changed += usize::from(one.make(case) != one.make(Case { seed: 4, ..case }));
        }
    }
    assert!(changed > 190, "{changed}");
}
