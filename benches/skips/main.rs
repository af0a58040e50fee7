//! What scenes do not use costs nothing: renders in turns, without and with it.
//!
//! `cargo bench --bench skips` prints for each pair the median of the ratios of seconds and whether the pictures have the same bits;
//! it ends by 1 where a ratio is off by more than 1 % or bits differ. `-- WORD` chooses pairs, `-- rounds=N` how many rounds.

#![allow(clippy::print_stdout)]

mod pairs;
#[path = "../stress/row.rs"]
#[allow(dead_code, reason = "rows are for the stress table")]
mod row;
#[path = "../stress/run.rs"]
#[allow(dead_code, reason = "the same")]
mod run;

use std::process::ExitCode;

use pairs::Pair;

/// How far from 1 a ratio may be.
const BOUND: f64 = 0.01;

/// Width, height and samples: a few hundredths of a second.
const SIZE: [u32; 3] = [160, 120, 16];

fn main() -> ExitCode {
    let asked: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let rounds = asked.iter().find_map(|word| word.strip_prefix("rounds=")?.parse().ok()).unwrap_or(31);
    let words: Vec<&String> = asked.iter().filter(|word| !word.starts_with("rounds=")).collect();
    let is_asked =
        |pair: &Pair| words.is_empty() || words.iter().any(|word| pair.name.contains(word.as_str()));
    println!("| not used | s without | ratio with | quartiles | bits | report |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let mut faulty = false;
    for pair in pairs::pairs(SIZE).iter().filter(|pair| is_asked(pair)) {
        match ratios(pair, rounds) {
            Ok(Paired { seconds, ratio: [low, ratio, high], is_same, said }) => {
                let bits = if is_same { "same" } else { "**other**" };
                println!(
                    "| {} | {seconds:.4} | {ratio:.3} | {low:.3} … {high:.3} | {bits} | {said} |",
                    pair.name
                );
                faulty |= !is_same || !((ratio - 1.0).abs() <= BOUND);
            }
            Err(error) => {
                println!("| {} | | | | **{error}** |", pair.name);
                faulty = true;
            }
        }
    }
    ExitCode::from(u8::from(faulty))
}

/// What the rounds of a pair came to.
struct Paired {
    /// Median, without.
    seconds: f64,
    /// Quartiles and median.
    ratio: [f64; 3],
    is_same: bool,
    /// Why the report says that a stage was skipped.
    said: String,
}

/// Rounds in turns; which one is first changes from round to round.
fn ratios(pair: &Pair, rounds: usize) -> Result<Paired, String> {
    let (mut ratios, mut seconds, mut is_same, mut said) = (Vec::new(), Vec::new(), true, String::new());
    for round in 0..rounds.max(1) {
        let (off, on) = if round % 2 == 0 {
            let off = run::render(&pair.off)?;
            (off, run::render(&pair.on)?)
        } else {
            let on = run::render(&pair.on)?;
            (run::render(&pair.off)?, on)
        };
        is_same &= off.pixels.iter().map(|x| x.to_bits()).eq(on.pixels.iter().map(|x| x.to_bits()));
        said = pair.skipped.map_or(String::new(), |(stage, _)| why(&on.report, stage));
        ratios.push(on.seconds / off.seconds);
        seconds.push(off.seconds);
    }
    ratios.sort_by(f64::total_cmp);
    seconds.sort_by(f64::total_cmp);
    let at = |quarter: usize| ratios[(ratios.len() - 1) * quarter / 4];
    Ok(Paired { seconds: seconds[seconds.len() / 2], ratio: [at(1), at(2), at(3)], is_same, said })
}

/// What the report says of a stage.
fn why(report: &serde_json::Value, stage: &str) -> String {
    let stages = report["stages"].as_array().into_iter().flatten();
    let said = stages.filter(|one| one["name"] == stage);
    said.map(|one| format!("{stage} {}: {}", one["status"], one["why"]).replace('"', "")).collect()
}
