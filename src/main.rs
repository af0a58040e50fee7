//! The `glimt` executable.

use std::process::ExitCode;

use glimt::system::abort::AbortingAllocator;

#[global_allocator]
static ALLOCATOR: AbortingAllocator = AbortingAllocator;

fn main() -> ExitCode {
    glimt::cli::run(std::env::args_os()).into()
}
