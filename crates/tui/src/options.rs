//! Inputs and results of the front end.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use super::color::ColorChoice;
use crate::choice;
use crate::pipeline::protocol::{Command, Event, PreviewSlot};
use crate::pipeline::settings::Overrides;
pub use crate::pipeline::watch::{Changed, Lost, News, OutputChange};

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

/// Everything that the front end needs.
pub struct Options {
    /// The scene file.
    pub scene: PathBuf,
    /// Overrides of the command line; the keys change more on top.
    pub overrides: Overrides,
    /// Choice of colors.
    pub color: ColorChoice,
    /// Choice of how the preview is drawn.
    pub preview: PreviewChoice,
    /// Height of a cell over its width. `None` to ask the terminal; if it does not answer, 2.
    pub cell_aspect: Option<f32>,
    /// Time after which the end of a render is worth a notification, if the terminal has lost the focus. `None` for none.
    pub notify_after: Option<Duration>,
    /// Sends orders to the worker. Must not block.
    pub commands: Box<dyn FnMut(Command)>,
    /// Events of the worker. Their end means that the worker is gone, which ends the front end.
    pub events: Receiver<Event>,
    /// Slot of the worker's preview pictures.
    pub previews: PreviewSlot,
    /// News from the watcher. A message reports their end.
    pub news: Receiver<News>,
}

/// Exit code of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExitStatus(pub u8);

impl ExitStatus {
    /// The person asked for it.
    pub const QUIT: Self = Self(0);
    /// SIGHUP: the terminal is gone.
    pub const HANGUP: Self = Self(129);
    /// SIGQUIT.
    pub const ABORTED: Self = Self(131);
    /// SIGINT or ctrl-c.
    pub const INTERRUPTED: Self = Self(130);
    /// SIGTERM.
    pub const TERMINATED: Self = Self(143);

    /// A signal of this number.
    pub fn signal(number: i32) -> Self {
        Self(u8::try_from(128 + number).unwrap_or(1))
    }
}

/// Result of the front end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TuiOutcome {
    /// Exit code of the program.
    pub status: ExitStatus,
    /// Whether a person ordered an image and does not know the outcome yet.
    pub is_write_unanswered: bool,
    /// The files written, with their samples and seconds, in one line.
    pub summary: String,
    /// Whether a file was written.
    pub has_written: bool,
    /// Whether the last picture that was to be written is not on disk.
    pub is_unwritten: bool,
    /// Changes by keys that are neither in the scene nor in an image, as options of the next call.
    pub not_kept: Option<String>,
}

/// Why the front end could not go on.
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
    /// The worker ended by itself.
    #[error("the renderer stopped{}", .reason.as_ref().map(|text| format!(": {text}")).unwrap_or_default())]
    WorkerGone {
        /// The message of its panic, if there was one.
        reason: Option<String>,
    },
}
