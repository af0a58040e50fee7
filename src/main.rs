//! The `glimt` executable.

use std::process::ExitCode;

use glimt::system::abort::AbortingAllocator;
use glimt::system::memory::set_rlimit_from_cgroup;
use glimt::system::threads::{STACK_BYTES, logical_cpu_count};

#[global_allocator]
static ALLOCATOR: AbortingAllocator = AbortingAllocator;

fn main() -> ExitCode {
    set_rlimit_from_cgroup(logical_cpu_count() as u64 * STACK_BYTES);
    glimt::cli::run(std::env::args_os()).into()
}
