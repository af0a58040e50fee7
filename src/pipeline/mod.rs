//! Stages as functions of their inputs, the caches between them, the worker that owns both, and the watcher of files.

pub mod protocol;
pub mod settings;
