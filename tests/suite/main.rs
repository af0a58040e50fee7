//! The program as a whole: one crate, so that it links once.

mod broken;
mod closed_forms;
mod house;
mod once;
mod output;
mod terminal;
