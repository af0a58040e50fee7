//! Stress tests: compares extreme scenes with plain reference scenes whose result or cost is known.
//!
//! `cargo bench --bench stress` renders all cases, prints the table and writes it to
//! `benches/stress/table.md`; `-- WORD` prints only the rows whose name contains the word. The exit code
//! is 1 if a row exceeds its bound.

#![allow(clippy::print_stdout)]

mod cases;
mod frame;
#[allow(dead_code, reason = "options are used by other benchmarks")]
mod row;
#[allow(dead_code, reason = "reports are used by other benchmarks")]
mod run;

use std::fmt::Write as _;
use std::process::ExitCode;

use row::{CaseSet, RowMeasure, StressRow};

/// Number of renders per timed row.
const ROUNDS: u32 = 3;

fn main() -> ExitCode {
    let asked: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let is_asked =
        |row: &StressRow| asked.is_empty() || asked.iter().any(|word| row.name.contains(word.as_str()));
    let mut table = HEAD.to_owned();
    print!("{HEAD}");
    let mut faulty = 0;
    for row in cases::rows(CaseSet::Long).iter().filter(|row| is_asked(row)) {
        let line = line(row, &mut faulty);
        print!("{line}");
        table += &line;
    }
    let _ = write!(table, "\n{faulty} rows exceed their bounds.\n");
    println!("\n{faulty} rows exceed their bounds.");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/stress/table.md");
    let is_written = !asked.is_empty() || std::fs::write(path, table).is_ok();
    ExitCode::from(u8::from(faulty > 0 || !is_written))
}

const HEAD: &str = "# Extreme scenes

`cargo bench --bench stress` writes this table. A difference is the relative RMS error of the row's worst image against its reference.
A mean is the relative deviation of the image's mean from the expected value. Seconds cover all stages except reading and writing, on one
thread, for all images and references in the row. Rows with a ratio may take at most three times as long as the reference. No row has
non-finite samples, crashes or hangs except where noted.

| case | images | measure | value | bound | s | reference, s | ratio | |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
";

fn line(row: &StressRow, faulty: &mut u32) -> String {
    let kind = match row.figure {
        RowMeasure::Difference(_) => "difference",
        RowMeasure::Mean(_) => "mean",
    };
    let rounds = if row.is_timed { ROUNDS } else { 1 };
    let start = format!("| {} | {} | {kind} |", row.name, row.pairs.len());
    match run::measure(row, rounds) {
        Ok(measured) => {
            let faults = measured.failures(row);
            *faulty += u32::from(!faults.is_empty());
            let [seconds, twins] = measured.seconds;
            let ratio = if row.is_timed { format!("{:.2}", seconds / twins) } else { String::new() };
            let (figure, bound, faults) = (measured.figure, row.bound, faults.join(", "));
            format!("{start} {figure:.1e} | {bound:.0e} | {seconds:.3} | {twins:.3} | {ratio} | {faults} |\n")
        }
        Err(error) => {
            *faulty += 1;
            format!("{start} | {:.0e} | | | | **{}** |\n", row.bound, error.replace('\n', " "))
        }
    }
}
