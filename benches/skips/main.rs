//! Measures the cost of unused features, which must be zero, by interleaving renders with and without them.
//!
//! `cargo bench --bench skips` prints these columns for each pair: the minimum seconds without the
//! feature, the median time ratio over all rounds with its standard error, the instruction ratio for smaller
//! images if valgrind is installed, and whether the images are bit-identical. The exit code is 1 if the
//! instruction counts (without valgrind, the times) differ by more than 1 % or the bits differ. Load from
//! other programs affects times but not instruction counts. `-- WORD` selects pairs, `-- rounds=N` sets the
//! number of rounds.

#![allow(clippy::print_stdout)]

mod pairs;
#[path = "../stress/row.rs"]
#[allow(dead_code, reason = "rows are used only by the stress table")]
mod row;
#[path = "../stress/run.rs"]
#[allow(dead_code, reason = "results are used only by the stress table")]
mod run;

use std::process::{Command, ExitCode};

use pairs::FeaturePair;
use row::SceneFiles;

/// Maximum deviation of the instruction or time ratio from 1.
const BOUND: f64 = 0.01;

/// Image width, height and samples per pixel. A render takes a fifth of a second.
const SIZE: [u32; 3] = [640, 480, 16];

fn main() -> ExitCode {
    let asked: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let rounds = asked.iter().find_map(|word| word.strip_prefix("rounds=")?.parse().ok()).unwrap_or(41);
    let words: Vec<&String> = asked.iter().filter(|word| !word.starts_with("rounds=")).collect();
    let is_asked =
        |pair: &FeaturePair| words.is_empty() || words.iter().any(|word| pair.name.contains(word.as_str()));
    println!(
        "| unused feature | minimum without it (s) | time ratio with it | ± | instructions | bits | report |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let mut faulty = false;
    for pair in pairs::pairs(SIZE).iter().filter(|pair| is_asked(pair)) {
        match ratios(pair, rounds) {
            Ok(PairResult { seconds, ratio, error, is_same, said }) => {
                let of_instructions = instructions(&pair.off).zip(instructions(&pair.on));
                let of_instructions = of_instructions.map(|(off, on)| on / off);
                let judged = of_instructions.unwrap_or(ratio);
                let counted = of_instructions.map_or(String::new(), |ratio| format!("{ratio:.4}"));
                let bits = if is_same { "same" } else { "**other**" };
                println!(
                    "| {} | {seconds:.4} | {ratio:.3} | {error:.3} | {counted} | {bits} | {said} |",
                    pair.name
                );
                faulty |= !is_same || !((judged - 1.0).abs() <= BOUND);
            }
            Err(error) => {
                println!("| {} | | | | | | **{error}** |", pair.name);
                faulty = true;
            }
        }
    }
    ExitCode::from(u8::from(faulty))
}

/// Results for one pair of scenes.
struct PairResult {
    /// Minimum seconds without the feature.
    seconds: f64,
    /// Median ratio over all rounds.
    ratio: f64,
    /// Standard error of the ratio.
    error: f64,
    is_same: bool,
    /// The report's reason for skipping a stage.
    said: String,
}

/// Runs all rounds, alternating the order within each round.
fn ratios(pair: &FeaturePair, rounds: usize) -> Result<PairResult, String> {
    let (mut ratios, mut seconds, mut is_same, mut said) = (Vec::new(), f64::INFINITY, true, String::new());
    for round in 0..rounds.max(1) {
        let (off, on) = if round % 2 == 0 {
            let off = run::render(&pair.off)?;
            (off, run::render(&pair.on)?)
        } else {
            let on = run::render(&pair.on)?;
            (run::render(&pair.off)?, on)
        };
        is_same &= off.pixels.iter().map(|x| x.to_bits()).eq(on.pixels.iter().map(|x| x.to_bits()));
        said = pair.skipped.map_or(String::new(), |(stage, _)| stage_reason(&on.report, stage));
        ratios.push(on.seconds / off.seconds);
        seconds = seconds.min(off.seconds);
    }
    ratios.sort_by(f64::total_cmp);
    let at = |quarter: usize| ratios[(ratios.len() - 1) * quarter / 4];
    // The quartiles of a normal distribution are 1.35 standard deviations apart, and the standard error of
    // the median is 1.25 times that of the mean.
    let error = 1.25 / 1.35 * (at(3) - at(1)) / (ratios.len() as f64).sqrt();
    Ok(PairResult { seconds, ratio: at(2), error, is_same, said })
}

/// Millions of instructions executed for a smaller image, counted by valgrind. `None` if valgrind is not
/// installed or fails.
fn instructions(picture: &SceneFiles) -> Option<f64> {
    let folder = tempfile::tempdir().ok()?;
    let mut program = Command::new("valgrind");
    program.args(["--tool=callgrind", "--callgrind-out-file=/dev/null", env!("CARGO_BIN_EXE_glimt")]);
    // valgrind does not support AVX-512.
    program.env("GLIMT_SIMD", "avx2");
    let mut command = run::call(folder.path(), picture, program).ok()?;
    let output =
        command.args("--width 160 --height 120 --samples 4 --progress none".split(' ')).output().ok()?;
    output.status.success().then_some(())?;
    let told = String::from_utf8_lossy(&output.stderr);
    let (_, count) = told.split_once("Collected :")?;
    count.split_whitespace().next()?.parse::<f64>().ok().map(|count| count * 1e-6)
}

/// Returns the reason that the report gives for a stage's status.
fn stage_reason(report: &serde_json::Value, stage: &str) -> String {
    let stages = report["stages"].as_array().into_iter().flatten();
    let said = stages.filter(|one| one["name"] == stage);
    said.map(|one| format!("{stage} {}: {}", one["status"], one["why"]).replace('"', "")).collect()
}
