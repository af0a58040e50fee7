//! Output to stderr and stdout outside of the terminal UI. Errors when writing to stderr are ignored. Errors
//! when writing to stdout, for example because the disk is full, determine the exit code. All untrusted text
//! is sanitized.

use std::cell::RefCell;
use std::io::{self, IsTerminal, Write};
use std::rc::Rc;

use crate::exit::Exit;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::report::{ReportStyle, render_diagnostics};
use crate::scene::sanitize::escape_invisible_chars;
use crate::system::describe_io_error;
use crate::tui::ColorDepthChoice;

/// Writes to stderr and stdout.
#[derive(Clone, Debug)]
pub(super) struct Console {
    style: ReportStyle,
    pub(super) is_terminal: bool,
    /// The latest error from writing to stdout, other than a closed pipe.
    stdout_error: Rc<RefCell<Option<io::Error>>>,
}

/// Width of messages if stderr is not a terminal.
const DEFAULT_COLUMNS: usize = 120;

impl Console {
    pub(super) fn new(color: ColorDepthChoice) -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let is_dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        let colored = match color {
            ColorDepthChoice::None => false,
            ColorDepthChoice::Auto => is_terminal && !is_set("NO_COLOR") && !is_dumb,
            ColorDepthChoice::TrueColor | ColorDepthChoice::Indexed256 | ColorDepthChoice::Ansi16 => true,
        };
        let style = if colored { ReportStyle::Ansi } else { ReportStyle::Plain };
        Self { style, is_terminal: is_terminal && !is_dumb, stdout_error: Rc::default() }
    }

    /// Whether messages are colored.
    pub(super) fn is_colored(&self) -> bool {
        match self.style {
            ReportStyle::Ansi => true,
            ReportStyle::Plain => false,
        }
    }

    /// Prints a line to stderr. Makes line breaks within the text visible.
    pub(super) fn print_line_to_stderr(&self, text: &str) {
        let line = format!("{}\n", escape_invisible_chars(text));
        let _ = std::io::stderr().lock().write_all(line.as_bytes());
    }

    /// Prints lines to stderr.
    pub(super) fn print_lines_to_stderr(&self, text: &str) {
        text.trim_end().lines().for_each(|line| self.print_line_to_stderr(line));
    }

    /// Prints a line to stdout.
    pub(super) fn print_line(&self, text: &str) {
        self.print_trusted_text(&format!("{}\n", escape_invisible_chars(text)));
    }

    /// Width of stdout in columns, if it is a terminal.
    pub(super) fn stdout_columns(&self) -> Option<usize> {
        columns_if_terminal(io::stdout().is_terminal())
    }

    /// Prints trusted text to stdout unchanged.
    pub(super) fn print_trusted_text(&self, text: &str) {
        let mut stdout = std::io::stdout().lock();
        self.record_stdout_error(stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()));
    }

    /// Records an error from writing to stdout.
    pub(super) fn record_stdout_error(&self, written: io::Result<()>) {
        match written {
            // Ignore a closed pipe: the reader, such as `head`, does not want more output.
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                *self.stdout_error.borrow_mut() = Some(error);
            }
            Ok(()) | Err(_) => {}
        }
    }

    /// Returns the program's exit code: `exit`, or failure if writing to stdout failed.
    pub(super) fn final_exit_code(&self, exit: Exit) -> Exit {
        match self.stdout_error.take() {
            Some(error) if exit == Exit::DONE => self
                .print_error(Exit::FAILED, &format!("cannot write to stdout: {}", describe_io_error(&error))),
            Some(_) | None => exit,
        }
    }

    /// Prints `error: …` to stderr and returns `exit`.
    pub(super) fn print_error(&self, exit: Exit, message: &str) -> Exit {
        self.print_line_to_stderr(&format!("error: {message}"));
        exit
    }

    /// Prints errors and warnings with their source lines to stderr.
    pub(super) fn print_diagnostics(&self, diagnostics: &[Diagnostic]) {
        if !diagnostics.is_empty() {
            let text = render_diagnostics(diagnostics, stderr_columns(), self.style);
            let _ = writeln!(std::io::stderr().lock(), "{}", text.trim_end());
        }
    }
}

fn stderr_columns() -> usize {
    columns_if_terminal(io::stderr().is_terminal()).unwrap_or(DEFAULT_COLUMNS)
}

/// Text width on stdout in columns: the terminal's width, or 80.
pub(super) fn stdout_columns_or_default() -> usize {
    columns_if_terminal(io::stdout().is_terminal()).unwrap_or(80)
}

fn columns_if_terminal(is_terminal: bool) -> Option<usize> {
    let size = if is_terminal { crossterm::terminal::size().ok() } else { None };
    size.map(|(columns, _)| usize::from(columns)).filter(|columns| *columns > 0)
}
