//! Inputs and results of the front end.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use super::color::ColorChoice;
use crate::choice;
use crate::pipeline::protocol::{Command, Event, PreviewSlot};
use crate::pipeline::settings::Overrides;
pub use crate::pipeline::watch::{Changed, ExternalChange, News, OutputChange};

choice! {
    /// Choice of how the preview is drawn.
    pub enum PreviewChoice {
        /// The finest blocks that the terminal is known to have if it has colors, else characters.
        Auto = "auto",
        /// Two pixels a cell.
        HalfBlock = "halfblock",
        /// Two colors a cell, in quarters.
        Quadrant = "quadrant",
        /// The same in sixths: what Unicode 13 has.
        Sextant = "sextant",
        /// The same in eighths: what Unicode 16 has.
        Octant = "octant",
        /// Characters by brightness.
        Ascii = "ascii",
        /// In pixels, by kitty's protocol.
        Kitty = "kitty",
        /// In pixels, by DEC's sixels.
        Sixel = "sixel",
        /// In pixels, by iTerm2's inline images.
        Iterm2 = "iterm2",
        /// None; the stages get the room.
        None = "none",
    }
}

/// Inputs of the front end.
pub struct Options {
    /// The scene file.
    pub scene: PathBuf,
    /// Overrides from the command line; keys can change more.
    pub overrides: Overrides,
    /// Choice of colors.
    pub color: ColorChoice,
    /// Choice of how the preview is drawn.
    pub preview: PreviewChoice,
    /// Height of a cell divided by its width. `None` to ask the terminal, with 2 as the fallback.
    pub cell_aspect: Option<f32>,
    /// Minimum duration of a render whose end is reported by a notification if the terminal does not have the
    /// focus. `None` to disable notifications.
    pub notify_after: Option<Duration>,
    /// Sends commands to the worker. Must not block.
    pub commands: Box<dyn FnMut(Command)>,
    /// Events from the worker. The front end ends with an error when the channel closes.
    pub events: Receiver<Event>,
    /// Slot of the worker's previews.
    pub previews: PreviewSlot,
    /// Events from the file watcher. A message reports when the channel closes.
    pub news: Receiver<News>,
}

/// Exit code of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExitStatus(pub u8);

impl ExitStatus {
    /// The user quit.
    pub const QUIT: Self = Self(0);
    /// SIGHUP: the terminal is gone.
    pub const HANGUP: Self = Self(129);
    /// SIGQUIT.
    pub const ABORTED: Self = Self(131);
    /// SIGINT or ctrl-c.
    pub const INTERRUPTED: Self = Self(130);
    /// SIGTERM.
    pub const TERMINATED: Self = Self(143);

    /// Terminated by the signal of this number.
    pub fn signal(number: i32) -> Self {
        Self(u8::try_from(128 + number).unwrap_or(1))
    }
}

/// Result of the front end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TuiOutcome {
    /// Exit code of the program.
    pub status: ExitStatus,
    /// Whether the user requested an image whose outcome is not known yet.
    pub is_write_unanswered: bool,
    /// The written files with their samples and render times, in one line.
    pub summary: String,
    /// Whether a file was written.
    pub has_written: bool,
    /// Whether the last image that should have been written is not on disk.
    pub is_unwritten: bool,
    /// Changes made with keys that are neither in the scene nor in an image, as command-line options.
    pub not_kept: Option<String>,
}

/// Why the front end failed.
#[derive(Debug, thiserror::Error)]
pub enum TuiError {
    /// Standard input or output is a file or a pipe.
    #[error("{stream} is not a terminal: use `--once` to render without one")]
    NotATerminal {
        /// `standard input` or `standard output`.
        stream: &'static str,
    },
    /// The terminal could not be set up or written to.
    #[error("cannot {action} the terminal: {source}; `--once` renders without one")]
    Terminal {
        /// The action that failed.
        action: &'static str,
        /// Why not.
        source: std::io::Error,
    },
    /// The worker ended unexpectedly.
    #[error("the renderer stopped{}", .reason.as_ref().map(|text| format!(": {text}")).unwrap_or_default())]
    WorkerGone {
        /// The message of its panic, if there was one.
        reason: Option<String>,
    },
}
