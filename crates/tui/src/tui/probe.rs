//! Questions to the terminal outside of the front end, for a report on what it is.

use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{FlushArg, SetArg, cfmakeraw, tcgetattr, tcsetattr};

use super::color::{self, ColorChoice, ColorDepth};
use super::environment::way;
use super::known::Blocks;
use super::terminal;
use super::terminals::Terminal;

/// Answers of a terminal, and what its environment says.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Columns and rows of cells.
    pub cells: (u16, u16),
    /// Width and height of a cell in pixels, as far as the terminal says.
    pub cell_pixels: (u16, u16),
    /// Colours by the environment.
    pub depth: ColorDepth,
    /// Whether tmux or screen lies between.
    pub is_multiplexed: bool,
    /// Whether the shell came over a network.
    pub is_remote: bool,
    /// The terminal's answers. `None` if it gives none.
    pub answers: Option<Answers>,
}

/// Answers of a terminal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// Time from a status report's request to its answer.
    pub round_trip: Duration,
    /// Name and version (XTVERSION).
    pub name: Option<String>,
    /// Whether it has 24 bits of colour (XTGETTCAP).
    pub has_true_color: bool,
    /// Whether it shows images by kitty's protocol.
    pub has_kitty: bool,
    /// Whether it shows sixels (DA1).
    pub has_sixel: bool,
    /// Whether large changes appear at once (DECRQM 2026).
    pub is_synchronized: bool,
    /// Background in sRGB, as it says it (OSC 11).
    pub background: Option<String>,
}

impl Probe {
    /// The parts of a cell that a preview without a choice draws, in words.
    pub fn preview(&self) -> &'static str {
        let name = self.answers.as_ref().and_then(|answers| answers.name.as_deref());
        let terminal = name.filter(|_| !self.is_multiplexed).and_then(Terminal::of_report);
        match (self.depth, terminal.map_or(Blocks::Unknown, Blocks::of)) {
            (ColorDepth::None, _) => "characters",
            (_, Blocks::Octants) => "octants",
            (_, Blocks::Sextants) => "sextants",
            (_, Blocks::Unknown) => "half blocks",
        }
    }
}

/// Time to wait for answers.
const PATIENCE: Duration = Duration::from_secs(1);

/// The end of every sequence of questions: DA1, which all terminals answer.
const LAST: &[u8] = b"\x1b[c";

/// XTVERSION, capabilities `RGB` and `Tc`, mode 2026, the background, an image of one pixel that is not kept.
const QUESTIONS: &[u8] =
    b"\x1b[>q\x1bP+q524742\x1b\\\x1bP+q5463\x1b\\\x1b[?2026$p\x1b]11;?\x1b\\\x1b_Gi=4211,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\";

/// Asks the terminal. `None` if stdin and stdout are not one.
///
/// It asks multiplexers and consoles DA1 alone, as they may print other questions.
pub fn probe() -> Option<Probe> {
    if !(io::stdin().is_terminal() && io::stdout().is_terminal()) {
        return None;
    }
    let variable = |name: &str| std::env::var(name).ok();
    let (term, window) = (variable("TERM").unwrap_or_default(), terminal::window(None));
    let is_plain = ["linux", "dumb", "vt"].iter().any(|name| term.starts_with(name))
        || variable("TERM_PROGRAM").is_some_and(|program| program == "Apple_Terminal");
    let way = way(variable);
    let questions: &[u8] = if is_plain || way.is_multiplexed { b"" } else { QUESTIONS };
    let answers = if term == "dumb" { None } else { ask(questions).ok().flatten() };
    Some(Probe {
        cells: (window.columns, window.rows),
        cell_pixels: window.cell_pixels,
        depth: color::depth(ColorChoice::Auto, variable),
        is_multiplexed: way.is_multiplexed,
        is_remote: way.is_remote,
        answers,
    })
}

/// Sends questions in raw mode, and gives the modes back.
fn ask(questions: &[u8]) -> io::Result<Option<Answers>> {
    let stdin = io::stdin();
    let before = tcgetattr(&stdin)?;
    let mut raw = before.clone();
    cfmakeraw(&mut raw);
    tcsetattr(&stdin, SetArg::TCSANOW, &raw)?;
    let answers = converse(questions);
    // What comes late is not for the shell.
    let _ = nix::sys::termios::tcflush(&stdin, FlushArg::TCIFLUSH);
    tcsetattr(&stdin, SetArg::TCSANOW, &before)?;
    answers
}

fn converse(questions: &[u8]) -> io::Result<Option<Answers>> {
    let begin = Instant::now();
    send(b"\x1b[5n")?;
    let mut heard = Vec::new();
    if !listen(&mut heard, begin, |heard| ends(heard, b'n').is_some())? {
        return Ok(None);
    }
    let round_trip = begin.elapsed();
    send(&[questions, LAST].concat())?;
    listen(&mut heard, Instant::now(), |heard| attributes(heard).is_some())?;
    Ok(Some(Answers { round_trip, ..read(&heard) }))
}

fn send(bytes: &[u8]) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(bytes)?;
    stdout.flush()
}

/// Reads until all is heard, or it takes too long; whether it is.
fn listen(heard: &mut Vec<u8>, begin: Instant, is_all: impl Fn(&[u8]) -> bool) -> io::Result<bool> {
    let stdin = io::stdin();
    let mut bytes = [0; 4096];
    while !is_all(heard) {
        let rest = PATIENCE.saturating_sub(begin.elapsed());
        let timeout = PollTimeout::try_from(rest).unwrap_or(PollTimeout::ZERO);
        let mut ends = [PollFd::new(stdin.as_fd(), PollFlags::POLLIN)];
        if rest.is_zero() || poll(&mut ends, timeout)? == 0 {
            return Ok(false);
        }
        match nix::unistd::read(&stdin, &mut bytes)? {
            0 => return Ok(false),
            count => heard.extend_from_slice(&bytes[..count]),
        }
    }
    Ok(true)
}

/// Parameters of the first control sequence (CSI) with this last byte.
fn ends(heard: &[u8], last: u8) -> Option<String> {
    sequences(heard, b"\x1b[").find_map(|rest| {
        let end = rest.iter().position(|byte| (0x40..=0x7e).contains(byte))?;
        (rest[end] == last).then(|| String::from_utf8_lossy(&rest[..end]).into_owned())
    })
}

/// Everything behind each beginning of a sequence.
fn sequences<'h>(heard: &'h [u8], begin: &'static [u8]) -> impl Iterator<Item = &'h [u8]> {
    (0..heard.len())
        .filter(move |at| heard[*at..].starts_with(begin))
        .map(move |at| &heard[at + begin.len()..])
}

/// Attributes of DA1, once they are there.
fn attributes(heard: &[u8]) -> Option<String> {
    ends(heard, b'c').filter(|text| text.starts_with('?'))
}

/// Text of the first string that begins so, up to its end (ST or BEL).
fn string(heard: &[u8], begin: &'static [u8]) -> Option<String> {
    let rest = sequences(heard, begin).next()?;
    let end = rest.iter().position(|byte| matches!(byte, 0x1b | 0x07))?;
    Some(String::from_utf8_lossy(&rest[..end]).into_owned())
}

/// The answers among all that was heard.
fn read(heard: &[u8]) -> Answers {
    let has = |list: &str, wanted: &str| list.split([';', '?']).any(|one| one == wanted);
    Answers {
        round_trip: Duration::ZERO,
        name: string(heard, b"\x1bP>|"),
        has_true_color: string(heard, b"\x1bP1+r").is_some_and(|text| !text.is_empty()),
        has_kitty: string(heard, b"\x1b_Gi=4211;").is_some_and(|text| text == "OK"),
        has_sixel: attributes(heard).is_some_and(|list| has(&list, "4")),
        is_synchronized: ends(heard, b'y')
            .is_some_and(|text| ["?2026;1$", "?2026;2$", "?2026;3$"].contains(&text.as_str())),
        background: string(heard, b"\x1b]11;"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_found_in_any_order() {
        let heard = b"\x1b[0n\x1bP>|foot(1.20.2)\x1b\\\x1bP1+r524742=38\x1b\\\x1b[?2026;2$y\x1b]11;rgb:1c1c/1c1c/1c1c\x1b\\\x1b_Gi=4211;OK\x1b\\\x1b[?62;4;22c";
        let answers = read(heard);
        assert_eq!(answers.name.as_deref(), Some("foot(1.20.2)"));
        assert_eq!(answers.background.as_deref(), Some("rgb:1c1c/1c1c/1c1c"));
        assert!(answers.has_true_color && answers.has_kitty && answers.has_sixel && answers.is_synchronized);
        assert_eq!(ends(heard, b'n').as_deref(), Some("0"));
    }

    #[test]
    fn refusals_are_no_abilities() {
        let answers = read(b"\x1bP0+r524742\x1b\\\x1b[?2026;0$y\x1b_Gi=4211;ENOTSUPPORTED\x1b\\\x1b[?1;42c");
        assert_eq!(answers, Answers::default());
        assert_eq!(attributes(b"\x1b[?62;"), None);
    }
}
