//! Reads meshes and images, writes images, and compares them. See the crate `glimt` for an overview.

pub mod assets;
pub mod compare;
pub mod output;

// Modules of lower crates, under the names used throughout the workspace.
use glimt_base::{choice, control, film, math, system};
use glimt_kernel::{geometry, materials};
