//! glimt: the scene file. The map of the house is in the crate `glimt`.

pub mod scene;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, film, math, sampling, system};
use glimt_kernel::{geometry, lights, materials};
