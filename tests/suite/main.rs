//! The program as a whole: one crate, so that it links once.

mod closed_forms;
mod house;
