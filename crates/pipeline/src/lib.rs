//! glimt: stages, caches, the worker, watching files. The map of the house is in the crate `glimt`.

pub mod pipeline;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, control, film, math, system};
use glimt_files::{assets, output};
use glimt_kernel::{lights, materials};
use glimt_scene::scene;
use glimt_trace::{integrators, world};
