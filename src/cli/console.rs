//! What is said on stderr and stdout outside of the terminal UI. Nothing said here can fail: who closed the pipe does
//! not read. Every text is made harmless before it is shown.

use std::io::{IsTerminal, Write};

use super::exit::Exit;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::report::{Style, render};
use crate::scene::sanitize::visible;
use crate::tui::ColorChoice;

/// The two streams.
#[derive(Clone, Copy, Debug)]
pub(super) struct Console {
    style: Style,
    pub(super) is_terminal: bool,
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
        Self { style: if colored { Style::Ansi } else { Style::Plain }, is_terminal: is_terminal && !is_dumb }
    }

    /// A line on stderr; a line end within the text becomes visible.
    pub(super) fn say(&self, text: &str) {
        let line = format!("{}\n", visible(text));
        let _ = std::io::stderr().lock().write_all(line.as_bytes());
    }

    /// A line on stdout.
    pub(super) fn answer(&self, text: &str) {
        let _ = writeln!(std::io::stdout().lock(), "{}", visible(text));
    }

    /// A text of our own on stdout, as it is.
    pub(super) fn text(&self, text: &str) {
        let _ = std::io::stdout().lock().write_all(text.as_bytes());
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
    let is_terminal = std::io::stderr().is_terminal();
    let size = if is_terminal { crossterm::terminal::size().ok() } else { None };
    size.map(|(columns, _)| usize::from(columns)).filter(|columns| *columns > 0).unwrap_or(PLAIN_COLUMNS)
}
