//! glimt: parse, run, exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    glimt::cli::run(std::env::args_os()).into()
}
