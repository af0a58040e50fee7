//! glimt: bytes to meshes and textures, pictures to bytes, the error between pictures. The map of the house is in the crate `glimt`.

pub mod assets;
pub mod compare;
pub mod output;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, control, film, math, system};
use glimt_kernel::{geometry, materials};
