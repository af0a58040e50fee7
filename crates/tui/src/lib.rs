//! glimt: the terminal front end. The map of the house is in the crate `glimt`.

pub mod tui;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, film, math, system};
use glimt_pipeline::pipeline;
use glimt_scene::scene;
