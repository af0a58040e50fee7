//! Shared foundations of glimt: numbers, color, random samples, films, named choices and the operating
//! system. See the crate `glimt` for an overview.

pub mod choice;
pub mod control;
pub mod film;
pub mod math;
pub mod sampling;
pub mod system;
