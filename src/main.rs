//! The `glimt` executable.

use std::process::ExitCode;

use glimt::system::abort::AbortingAllocator;
use glimt::system::memory::apply_cgroup_limit;
use glimt::system::threads::{STACK_BYTES, core_count};

#[global_allocator]
static ALLOCATOR: AbortingAllocator = AbortingAllocator;

fn main() -> ExitCode {
    apply_cgroup_limit(core_count() as u64 * STACK_BYTES);
    glimt::cli::run(std::env::args_os()).into()
}
