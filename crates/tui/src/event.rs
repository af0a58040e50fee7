//! Everything that can happen to the front end: one closed set.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use crossterm::event::{KeyCode, KeyModifiers};

use super::options::{Changed, News, OutputChange};
use super::terminal_replies::TerminalReply;
use crate::film::Picture;
use crate::pipeline::protocol::{self, PreviewSource, Section};

/// One thing that happened.
#[derive(Clone, Debug)]
pub(super) enum Event {
    /// A key was pressed.
    Key(KeyPress),
    /// The mouse was used.
    Mouse(Mouse),
    /// Text was pasted.
    Paste,
    /// The terminal answered a question.
    TerminalReply(TerminalReply),
    /// The system took so many bytes for the terminal.
    Written { bytes: usize },
    /// The terminal cannot be written to.
    Unwritable(ErrorKind),
    /// A picture has been sent.
    Frame(FrameReport),
    /// The window has this size now.
    Resize(Window),
    /// The worker says something. Pictures come as [`Event::Picture`].
    Worker(protocol::Event),
    /// The newest picture of the slot. `range`: its least and greatest number, if it is stretched to them. `section`: the part of
    /// the image that it shows pixel by pixel.
    Picture {
        generation: u64,
        picture: Arc<Picture>,
        range: Option<[f32; 2]>,
        section: Option<Section>,
        lacks_photons: bool,
        source: Option<PreviewSource>,
    },
    /// A file that the scene depends on was written.
    Changed(Changed),
    /// Nobody is writing the changed files any more.
    Settled,
    /// A file that glimt wrote was changed, or is as glimt wrote it again.
    Output(OutputChange),
    /// A signal, or what amounts to one.
    Signal(Signal),
    /// A frame with the picture of this generation is on the screen.
    Shown { generation: u64 },
    /// Time passed.
    Tick,
    /// Ctrl-z where nothing could continue the program again.
    NoShell,
    /// The terminal is back from the editor.
    Back,
    /// The editor could not be used: why.
    NoEditor(String),
    /// A source of events ended.
    Lost(EventSource),
}

impl Event {
    /// The event for the watcher's news.
    pub(super) fn of_watcher(news: News) -> Self {
        match news {
            News::Changed(changed) => Self::Changed(changed),
            News::Settled => Self::Settled,
            News::Output(change) => Self::Output(change),
        }
    }
}

/// A key with its modifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct KeyPress {
    pub code: KeyCode,
    pub modifiers: KeyModifiers,
}

impl KeyPress {
    /// A character without ctrl or alt.
    pub(super) const fn plain(character: char) -> Self {
        Self { code: KeyCode::Char(character), modifiers: KeyModifiers::NONE }
    }

    /// A character with ctrl.
    pub(super) const fn ctrl(character: char) -> Self {
        Self { code: KeyCode::Char(character), modifiers: KeyModifiers::CONTROL }
    }

    /// A key that is no character.
    pub(super) const fn special(code: KeyCode) -> Self {
        Self { code, modifiers: KeyModifiers::NONE }
    }
}

/// The left button or the wheel, over a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mouse {
    pub kind: MouseKind,
    /// From 0.
    pub column: u16,
    /// From 0.
    pub row: u16,
}

/// Actions of the mouse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MouseKind {
    Press,
    /// Moved while pressed.
    Drag,
    Release,
    WheelUp,
    WheelDown,
}

/// The terminal's window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    pub columns: u16,
    pub rows: u16,
    /// Height of a cell over its width.
    pub cell_aspect: f32,
    /// Width and height of a cell in pixels; likely ones if the terminal does not report them.
    pub cell_pixels: (u16, u16),
}

/// The signals that are handled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Signal {
    Interrupt,
    Terminate,
    /// SIGQUIT.
    Quit,
    /// SIGHUP, or the terminal is gone without one.
    Hangup,
    /// One that ends every program that does not know it, by its number.
    Other(i32),
    /// SIGTSTP.
    Suspend,
    /// SIGCONT.
    Continue,
    /// SIGWINCH.
    Resize,
}

/// Sources of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EventSource {
    Worker,
    Watcher,
    Keys,
}

/// Side effects that the loop carries out.
#[derive(Clone, Debug)]
pub(super) enum Effect {
    /// An order for the worker.
    Send(protocol::Command),
    /// Restore the terminal and end.
    Quit(super::ExitStatus),
    /// The worker is gone: restore the terminal and end with an error.
    GiveUp,
    /// Ctrl-z: stop the whole job, as the terminal would.
    StopJob,
    /// SIGTSTP came: restore the terminal, stop, and take it again.
    Suspend,
    /// SIGCONT came: take the terminal again and draw everything.
    Redraw,
    /// Whether the terminal is to report the mouse.
    Mouse(bool),
    /// Leave the terminal to the editor, at this place.
    Edit(FilePosition),
    /// Ask how large the window is.
    Measure,
    /// Send this behind the picture: a notification, a text for the clipboard.
    Aside(Vec<u8>),
    /// Have the terminal report the focus from now on.
    ReportFocus,
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FilePosition {
    pub path: PathBuf,
    /// From 1.
    pub line: usize,
    /// From 1.
    pub column: usize,
}

/// Cost of the last picture on its way to the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameReport {
    /// Bytes that were sent since its render began.
    pub bytes: usize,
    /// Time until the terminal answers. `None` if it does not.
    pub round_trip: Option<Duration>,
}

/// Why a picture is not on disk although it is to be.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WriteFailure {
    pub why: String,
    /// Number of the request.
    pub generation: u64,
    /// Whether it is refused, for a reason that is among the errors and warnings.
    pub is_refused: bool,
}
