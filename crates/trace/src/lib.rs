//! glimt: the world that is traced, and the integrators. The map of the house is in the crate `glimt`.

pub mod integrators;
pub mod world;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, control, film, math, sampling};
use glimt_files::assets;
use glimt_kernel::{accel, geometry, lights, materials};
use glimt_scene::scene;
