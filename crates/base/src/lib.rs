//! Shared foundations of glimt: numbers, color, random samples, films, named choices and the operating
//! system. The crate `glimt` has the map of the workspace.

pub mod choice;
pub mod control;
pub mod film;
pub mod math;
pub mod sampling;
pub mod system;
