//! The render pipeline: from scene files to previews and images.
//!
//! [`start_worker`] starts a worker thread and returns a [`WorkerHandle`], which accepts commands. The worker
//! owns a session (`session`), which runs the steps of each request: it prepares the scene (`prepare`),
//! renders its film (`render`) and writes the image. [`headless`] renders without a worker. [`watch`] reports
//! files whose content has changed.
//!
//! `stages` contains one file per stage. Stages are functions of their inputs. Each stage compares a
//! [fingerprint](crate::scene::fingerprint) of its inputs (`keys`) with the fingerprint of its cached value
//! (`cache`), and reports whether it was done, reused or skipped.

mod answers;
mod build;
mod cache;
mod check;
mod formats;
pub mod headless;
mod identity;
mod inputs;
pub mod key_overrides;
mod keys;
mod memory;
pub mod messages;
mod plan;
mod prepare;
mod protected;
pub mod protocol;
mod queries;
mod render;
mod report;
mod session;
pub mod settings;
mod sink;
mod stages;
mod stopwatch;
mod table;
mod targets;
mod threads;
mod trace;
pub mod turntable;
mod warnings;
pub mod watch;
pub mod words;
mod worker;

#[cfg(test)]
mod tests;

// Re-export modules of lower-level crates under the names used throughout the workspace.
use glimt_base::{choice, control, film, math, system};
use glimt_files::{assets, output};
use glimt_kernel::{lights, materials};
use glimt_scene as scene;
use glimt_trace::{integrators, world};

pub use build::BUILD;
pub use check::{
    IncrementalSceneChecker, SceneSummary, check_scene, check_scene_with_options, estimate_memory,
};
pub use formats::{
    ImportError, ImportedScene, has_foreign_extension, has_importable_extension, has_model_extension,
    import_scene, not_a_scene_file_error,
};
pub use stages::parse::files_referenced_by_assets;
pub use watch::content::{FileContentId, FilePathAndContentId};
pub use worker::{CommandSender, WorkerHandle, start_worker, start_worker_with_channel};
