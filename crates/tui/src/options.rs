//! Front-end options and results.

use std::path::PathBuf;
use std::time::Duration;

use super::color::ColorDepthChoice;
use crate::choice;
use crate::pipeline::protocol::{Command, PreviewSlot};
use crate::pipeline::settings::Overrides;
pub use crate::pipeline::watch::{ContentChangeTime, ExternalChange, OutputChange, WatchEvent};
use crate::system::describe_io_error;

choice! {
    /// How to draw the preview.
    pub enum PreviewChoice {
        /// The finest blocks that the terminal is known to support, or ASCII characters if it lacks color.
        Auto = "auto",
        /// Two pixels per cell.
        HalfBlock = "halfblock",
        /// Two colors per cell, divided into quarters.
        Quadrant = "quadrant",
        /// Two colors per cell, divided into sixths (requires Unicode 13).
        Sextant = "sextant",
        /// Two colors per cell, divided into eighths (requires Unicode 16).
        Octant = "octant",
        /// ASCII characters of different brightness.
        Ascii = "ascii",
        /// Pixels, using kitty's graphics protocol.
        Kitty = "kitty",
        /// Pixels, using DEC's Sixel format.
        Sixel = "sixel",
        /// Pixels, using iTerm2's inline images.
        Iterm2 = "iterm2",
        /// No preview, leaving more space for the stages.
        None = "none",
    }
}

/// Options for the front end.
pub struct TuiOptions {
    /// The scene file.
    pub scene: PathBuf,
    /// Overrides from the command line. Keys can make further changes.
    pub overrides: Overrides,
    /// Which colors to use.
    pub color: ColorDepthChoice,
    /// How to draw the preview.
    pub preview: PreviewChoice,
    /// Height of a cell divided by its width, or `None` to query the terminal, with 2 as the default.
    pub cell_aspect: Option<f32>,
    /// How long a render must run for its end to trigger a notification. Notifications are sent only while
    /// the terminal is not focused. `None` disables them.
    pub notify_after: Option<Duration>,
    /// Sends commands to the worker. Must not block.
    pub commands: Box<dyn FnMut(Command)>,
    /// Slot for previews from the worker.
    pub previews: PreviewSlot,
}

/// The program's exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExitStatus(pub u8);

impl ExitStatus {
    /// The user quit.
    pub const QUIT: Self = Self(0);
    /// SIGHUP: the terminal was closed.
    pub const HANGUP: Self = Self(129);
    /// SIGQUIT.
    pub const ABORTED: Self = Self(131);
    /// SIGINT or ctrl-c.
    pub const INTERRUPTED: Self = Self(130);
    /// SIGTERM.
    pub const TERMINATED: Self = Self(143);

    /// The exit code after termination by signal `number`.
    pub fn from_signal(number: i32) -> Self {
        Self(u8::try_from(128 + number).unwrap_or(1))
    }
}

/// Result of running the front end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TuiOutcome {
    /// The program's exit code.
    pub status: ExitStatus,
    /// Whether the user requested an image that has not been written or refused yet.
    pub is_write_unanswered: bool,
    /// One line that lists the written files with their sample counts and render times.
    pub summary: String,
    /// Whether the summary claims that the scene's own image is up to date.
    pub is_current: bool,
    /// Number of handled events for which
    /// [`is_write_result`](crate::pipeline::protocol::Event::is_write_result) is true.
    pub write_results: u64,
    /// Whether any image file was written.
    pub has_written: bool,
    /// Whether the last attempt to write an image failed or was refused.
    pub is_unwritten: bool,
    /// Changes that were made with keys and saved neither to the scene nor in an image, formatted as
    /// command-line options.
    pub not_kept: Option<String>,
}

/// Why the front end failed.
#[derive(Debug, thiserror::Error)]
pub enum TuiError {
    /// Standard input or output is a file or a pipe.
    #[error("{stream} is not a terminal: use `--once` to render without one")]
    NotATerminal {
        /// The stream: `standard input` or `standard output`.
        stream: &'static str,
    },
    /// The terminal could not be set up or written to.
    #[error("cannot {action} the terminal: {}; `--once` renders without one", describe_io_error(source))]
    Terminal {
        /// The operation that failed.
        action: &'static str,
        /// The underlying error.
        source: std::io::Error,
    },
    /// The worker ended unexpectedly.
    #[error("the renderer stopped{}", .reason.as_ref().map(|text| format!(": {text}")).unwrap_or_default())]
    WorkerGone {
        /// The panic message, if the worker panicked.
        reason: Option<String>,
    },
}
