//! glimt: arguments, the headless front end, run time against error. The map of the house is in the crate `glimt`.

pub mod bench;
pub mod cli;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, control, film, math, system};
use glimt_files::{compare, output};
use glimt_kernel::accel;
use glimt_pipeline::pipeline;
use glimt_scene::scene;
use glimt_tui::tui;
