//! Reads meshes, and reads, writes and compares images. See the `glimt` crate for an overview.

pub mod assets;
pub mod compare;
pub mod output;

// Import modules of lower-level crates under the names used throughout the workspace.
use glimt_base::{choice, control, film, math, system};
use glimt_kernel::{geometry, materials};
