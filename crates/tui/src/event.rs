//! Front-end events and effects.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::time::Duration;

use crossterm::event::{KeyCode, KeyModifiers};

use super::options::{ContentChangeTime, OutputChange, WatchEvent};
use super::terminal_replies::TerminalReply;
use crate::pipeline::protocol::{self, PreviewUpdate};

/// An input to the front end.
#[derive(Clone, Debug)]
pub(super) enum Event {
    /// A key press.
    Key(KeyPress),
    /// A mouse action.
    Mouse(MouseEvent),
    /// Pasted text. Its content is ignored.
    Paste,
    /// A reply or report from the terminal.
    TerminalReply(TerminalReply),
    /// The operating system has accepted bytes for the terminal.
    Written { bytes: usize },
    /// Writing to the terminal failed.
    Unwritable(ErrorKind),
    /// A preview has been sent.
    PreviewSent(PreviewSendReport),
    /// The window size may have changed.
    Resize(WindowSize),
    /// A message from the worker. Previews arrive as [`Event::Preview`].
    Worker(protocol::Event),
    /// A new preview.
    Preview(PreviewUpdate),
    /// A file that the scene depends on was written.
    FileChanged(ContentChangeTime),
    /// The changed files have been fully written.
    Settled,
    /// An output file was modified or restored by another program.
    OutputChanged(OutputChange),
    /// A signal was received, or the terminal was closed.
    Signal(Signal),
    /// The first bytes of a preview for this request have been sent.
    FirstPreviewSent { generation: u64 },
    /// A timeout of the event loop has expired.
    Tick,
    /// Ctrl-z was pressed, but no shell could continue the process.
    SuspendFailed,
    /// The editor has exited.
    EditorExited,
    /// The editor could not be run, for this reason.
    EditorFailed(String),
    /// A source of events has ended.
    SourceEnded(RequiredEventSource),
}

impl Event {
    /// Wraps a file watcher event.
    pub(super) fn from_watcher(news: WatchEvent) -> Self {
        match news {
            WatchEvent::Changed(changed) => Self::FileChanged(changed),
            WatchEvent::Settled => Self::Settled,
            WatchEvent::Output(change) => Self::OutputChanged(change),
        }
    }
}

/// A key with modifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct KeyPress {
    pub code: KeyCode,
    pub modifiers: KeyModifiers,
}

impl KeyPress {
    /// Creates a key press for a character without ctrl or alt.
    pub(super) const fn plain(character: char) -> Self {
        Self { code: KeyCode::Char(character), modifiers: KeyModifiers::NONE }
    }

    /// Creates a key press for a character with ctrl.
    pub(super) const fn ctrl(character: char) -> Self {
        Self { code: KeyCode::Char(character), modifiers: KeyModifiers::CONTROL }
    }

    /// Creates a key press for a key that is not a character.
    pub(super) const fn special(code: KeyCode) -> Self {
        Self { code, modifiers: KeyModifiers::NONE }
    }
}

/// A mouse event over a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MouseEvent {
    pub kind: MouseEventKind,
    /// Column of the cell, counted from 0.
    pub column: u16,
    /// Row of the cell, counted from 0.
    pub row: u16,
}

/// A left-button or wheel event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MouseEventKind {
    Press,
    /// The mouse was moved while the button was down.
    Drag,
    Release,
    WheelUp,
    WheelDown,
}

/// Terminal window size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WindowSize {
    pub columns: u16,
    pub rows: u16,
    /// Height of a cell divided by its width.
    pub cell_aspect: f32,
    /// Cell size in pixels, or a typical size if the terminal does not report it.
    pub cell_pixels: (u16, u16),
}

/// Signals that the event loop handles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Signal {
    Interrupt,
    Terminate,
    /// SIGQUIT.
    Quit,
    /// SIGHUP, or the terminal was closed.
    Hangup,
    /// Another terminating signal, by number.
    Other(i32),
    /// SIGTSTP.
    Suspend,
    /// SIGCONT.
    Continue,
    /// SIGWINCH.
    Resize,
}

/// Event sources that must not end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RequiredEventSource {
    Worker,
    Watcher,
    Keys,
}

/// Side effects for the event loop to carry out.
#[derive(Clone, Debug)]
pub(super) enum Effect {
    /// Send a command to the worker.
    Send(protocol::Command),
    /// Restore the terminal and exit.
    Quit(super::ExitStatus),
    /// The worker has ended. Restore the terminal and exit with an error.
    GiveUp,
    /// Ctrl-z was pressed. Stop the whole job.
    StopJob,
    /// SIGTSTP was received. Restore the terminal and stop.
    Suspend,
    /// SIGCONT was received. Set up the terminal again and redraw everything.
    Redraw,
    /// Enable or disable mouse reporting.
    Mouse(bool),
    /// Open the editor at this position.
    Edit(FileLineColumn),
    /// Query the window size.
    Measure,
    /// Send bytes after the preview: a notification or clipboard text.
    Aside(Vec<u8>),
    /// Enable focus reporting.
    ReportFocus,
}

/// A position in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FileLineColumn {
    pub path: PathBuf,
    /// Line number, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
}

/// Bytes and round-trip time for sending the last preview.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PreviewSendReport {
    /// Bytes sent since the render began.
    pub bytes: usize,
    /// Round-trip time of the terminal, or `None` if it does not reply.
    pub round_trip: Option<Duration>,
}

/// Why an image was not written to disk.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WriteFailure {
    pub why: String,
    /// Generation of the request that failed.
    pub generation: u64,
    /// Whether glimt refused to write the image. The errors and warnings give the reason.
    pub is_refused: bool,
}
