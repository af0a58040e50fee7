//! glimt: rays, shapes, trees, materials, lights. The map of the house is in the crate `glimt`.

pub mod accel;
pub mod geometry;
pub mod lights;
pub mod materials;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, control, math, sampling};
