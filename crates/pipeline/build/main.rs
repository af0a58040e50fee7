//! Sets `GLIMT_BUILD` to a hash of the sources that affect images.

#![allow(clippy::print_stdout, reason = "build scripts communicate with cargo over stdout")]

mod sources;

use std::path::Path;

/// Crates whose sources affect images.
const CRATES: [&str; 6] = ["base", "kernel", "scene", "files", "trace", "pipeline"];

fn main() {
    let crates = Path::new("..");
    let mut roots: Vec<_> = CRATES.iter().map(|name| crates.join(name).join("src")).collect();
    // Dependency versions also affect images.
    roots.push(crates.join("../Cargo.lock"));
    for root in &roots {
        println!("cargo::rerun-if-changed={}", root.display());
    }
    println!("cargo::rerun-if-changed=build");
    println!("cargo::rustc-env=GLIMT_BUILD={:012x}", sources::source_hash(&roots) >> 16);
}
