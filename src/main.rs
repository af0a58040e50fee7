//! The `glimt` executable.

use std::process::ExitCode;

use glimt::system::abort::AbortingAllocator;
use glimt::system::memory::apply_cgroup_limit;

#[global_allocator]
static ALLOCATOR: AbortingAllocator = AbortingAllocator;

fn main() -> ExitCode {
    apply_cgroup_limit();
    glimt::cli::run(std::env::args_os()).into()
}
