//! Shared foundations of glimt: math, color, random sampling, films, named choices and operating system
//! access. See the `glimt` crate for an overview.

pub mod choice;
pub mod control;
pub mod film;
pub mod math;
pub mod sampling;
pub mod system;
