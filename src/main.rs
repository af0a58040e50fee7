//! The `glimt` executable.

use std::process::ExitCode;

use glimt::system::abort::Allocator;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn main() -> ExitCode {
    glimt::cli::run(std::env::args_os()).into()
}
