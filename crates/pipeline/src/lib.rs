//! Stages as functions of their inputs, the caches between them, the worker that owns both, and the watcher of files.
//!
//! [`start`] gives a [`Handle`]: commands in, events out, previews in a slot. `engine` runs one request, stage by stage: `stages` has
//! one file for each of the eight, `render` the internals of tracing. Each stage compares a [fingerprint](crate::scene::fingerprint)
//! of its inputs (`keys`) with that of its last value in `cache`, and reports whether it was done, reused or skipped. [`watch`]
//! reports when a file of a request has another content.

mod answers;
mod assembly;
mod build;
mod cache;
mod cautions;
mod check;
mod engine;
mod errands;
mod identity;
mod inputs;
mod keys;
mod memory;
mod model;
mod pace;
mod plan;
pub mod protocol;
mod render;
mod report;
pub mod session;
pub mod settings;
mod sink;
mod stages;
mod table;
mod targets;
mod trace;
pub mod turntable;
pub mod watch;
pub mod words;
mod worker;

#[cfg(test)]
mod tests;

// Modules of lower crates, under the names used throughout the workspace.
use glimt_base::{choice, control, film, math, system};
use glimt_files::{assets, output};
use glimt_kernel::{lights, materials};
use glimt_scene as scene;
use glimt_trace::{integrators, world};

pub use build::BUILD;
pub use check::{Checked, Checker, check, memory_needed};
pub use model::import::{ImportError, Imported, import};
pub use watch::content::{Content, FileRead};
pub use worker::{Handle, Remote, start};
