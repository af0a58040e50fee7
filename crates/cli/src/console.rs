//! Texts on stderr and stdout outside of the terminal UI. Text on stderr cannot fail: whoever closed the pipe does not read.
//! Answers on stdout can, if the disk is full. Every text is made harmless before it is shown.

use std::cell::RefCell;
use std::io::{self, IsTerminal, Write};
use std::rc::Rc;

use crate::exit::Exit;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::report::{Style, render};
use crate::scene::sanitize::visible;
use crate::system::describe_error;
use crate::tui::ColorChoice;

/// The two streams.
#[derive(Clone, Debug)]
pub(super) struct Console {
    style: Style,
    pub(super) is_terminal: bool,
    /// Why an answer did not get through.
    lost: Rc<RefCell<Option<io::Error>>>,
}

/// Columns where stderr is no terminal.
const PLAIN_COLUMNS: usize = 120;

impl Console {
    pub(super) fn new(color: ColorChoice) -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let is_dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        let colored = match color {
            ColorChoice::None => false,
            ColorChoice::Auto => is_terminal && !is_set("NO_COLOR") && !is_dumb,
            ColorChoice::TrueColor | ColorChoice::Indexed256 | ColorChoice::Ansi16 => true,
        };
        let style = if colored { Style::Ansi } else { Style::Plain };
        Self { style, is_terminal: is_terminal && !is_dumb, lost: Rc::default() }
    }

    /// Whether messages have colors.
    pub(super) fn is_colored(&self) -> bool {
        match self.style {
            Style::Ansi => true,
            Style::Plain => false,
        }
    }

    /// A line on stderr; a line end within the text becomes visible.
    pub(super) fn say(&self, text: &str) {
        let line = format!("{}\n", visible(text));
        let _ = std::io::stderr().lock().write_all(line.as_bytes());
    }

    /// Lines on stderr, one after the other.
    pub(super) fn say_lines(&self, text: &str) {
        text.trim_end().lines().for_each(|line| self.say(line));
    }

    /// A line on stdout.
    pub(super) fn answer(&self, text: &str) {
        self.text(&format!("{}\n", visible(text)));
    }

    /// Columns of stdout, if it is a terminal.
    pub(super) fn answer_columns(&self) -> Option<usize> {
        terminal_columns(io::stdout().is_terminal())
    }

    /// A text of our own on stdout, as it is.
    pub(super) fn text(&self, text: &str) {
        let mut stdout = std::io::stdout().lock();
        self.note(stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()));
    }

    /// Note whether something went to stdout.
    pub(super) fn note(&self, written: io::Result<()>) {
        match written {
            // Who closed the pipe has read enough.
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => *self.lost.borrow_mut() = Some(error),
            Ok(()) | Err(_) => {}
        }
    }

    /// Exit code of the program: a failure if an answer did not get through.
    pub(super) fn end(&self, exit: Exit) -> Exit {
        match self.lost.take() {
            Some(error) if exit == Exit::DONE => self.fail(
                Exit::FAILED,
                &format!("the answer cannot be written to stdout: {}", describe_error(&error)),
            ),
            Some(_) | None => exit,
        }
    }

    /// `error: …` on stderr.
    pub(super) fn fail(&self, exit: Exit, message: &str) -> Exit {
        self.say(&format!("error: {message}"));
        exit
    }

    /// Errors and warnings, with their places.
    pub(super) fn diagnostics(&self, diagnostics: &[Diagnostic]) {
        if !diagnostics.is_empty() {
            let text = render(diagnostics, columns(), self.style);
            let _ = writeln!(std::io::stderr().lock(), "{}", text.trim_end());
        }
    }
}

fn columns() -> usize {
    terminal_columns(io::stderr().is_terminal()).unwrap_or(PLAIN_COLUMNS)
}

/// Width of running text on stdout in columns: the terminal's, or 80 without a terminal.
pub(super) fn answer_columns() -> usize {
    terminal_columns(io::stdout().is_terminal()).unwrap_or(80)
}

fn terminal_columns(is_terminal: bool) -> Option<usize> {
    let size = if is_terminal { crossterm::terminal::size().ok() } else { None };
    size.map(|(columns, _)| usize::from(columns)).filter(|columns| *columns > 0)
}
