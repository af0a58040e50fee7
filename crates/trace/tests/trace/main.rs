//! Tests that use most of the crate, in a crate of their own so that the library is not compiled once more for
//! them.

mod direct;
mod isolated;
mod test_world;

// Modules under the names used throughout the workspace.
use glimt_base::{control, film, math};
use glimt_files::assets;
use glimt_kernel::{geometry, lights, materials};
use glimt_scene as scene;
use glimt_trace::{integrators, world};
