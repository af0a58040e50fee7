//! The terminal front end.
//!
//! `update` handles an event by modifying the state and returning effects. `view` draws the state. Side
//! effects happen only in the event loop in [`run`](fn@run), which owns the terminal. The screen is redrawn
//! only when something changed. The help and the key line are generated from the tables in `keymap`.

mod action;
mod camera;
mod color;
mod connection;
mod display;
mod editor;
mod environment;
mod event;
mod event_queue;
mod exit_summary;
mod file_urls;
mod graphics;
mod history;
mod input;
mod keymap;
pub mod messages;
mod mosaic;
mod noise_curve;
mod options;
pub mod paint;
mod pixel_request;
mod presenter;
mod preview_style;
mod terminal_replies;
mod window_title;

mod probe;
mod rescale;
mod run;
mod signals;
mod state;
mod static_image;
mod terminal;
mod terminals;
mod update;
mod view;
mod writer;

#[cfg(test)]
mod fixtures;
#[cfg(test)]
mod manual_test;
#[cfg(test)]
mod tests;

// Modules of lower-level crates, under the names used throughout the workspace.
use glimt_base::{choice, film, math, system};
use glimt_pipeline as pipeline;
use glimt_scene as scene;

pub use color::{ColorDepth, ColorDepthChoice, xterm_rgb};
pub use editor::editor_and_variable;
pub use event_queue::{EventQueue, EventSender};
pub use graphics::TestImageTerminal;
pub use mosaic::squares_of_block_character;
pub use options::{
    ContentChangeTime, ExitStatus, PreviewChoice, TuiError, TuiOptions, TuiOutcome, WatchEvent,
};
pub use probe::{ReportedTerminalFeatures, TerminalProbeResult, probe_terminal};
pub use run::run;
pub use static_image::{NamedImage, images_as_text};
pub use view::preview::draw_for_dark_xterm;
pub use view::text::wrap_text;
