//! glimt: numbers, colour, random streams, films, names of choices, the operating system. The map of the house is in the crate `glimt`.

pub mod choice;
pub mod control;
pub mod film;
pub mod math;
pub mod sampling;
pub mod system;
