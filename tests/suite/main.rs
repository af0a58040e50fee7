//! The program as a whole: one crate, so that it links once.

mod bench;
mod bias;
mod broken;
mod bytes;
mod checkpoints;
mod closed_forms;
mod compare;
mod contract;
mod desk;
mod docs;
mod extremes;
mod gltf;
mod hostile;
mod house;
mod inputs;
mod json;
mod keeping;
mod kernel;
mod library;
mod lsp;
mod models;
mod mutation;
#[cfg(target_os = "linux")]
mod niceness;
mod noise;
mod once;
mod options;
mod output;
mod parts;
mod same_bits;
mod schema;
mod shell;
mod shown;
mod stress;
mod terminal;
mod views;
