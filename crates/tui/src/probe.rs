//! Queries the terminal's capabilities while the front end is not running.

use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{FlushArg, SetArg, cfmakeraw, tcgetattr, tcsetattr};

use super::color::{self, ColorDepth, ColorDepthChoice};
use super::display::{ATTRIBUTES, STATUS, SYNCHRONIZED};
use super::environment::{may_print_unknown_escapes, terminal_environment_from_variables};
use super::input::{DecodedInput, Decoder};
use super::pixel_request::KITTY_QUERY;
use super::terminal;
use super::terminal_replies::{FinestNativeBlocks, TerminalQueries, TerminalReply};
use super::terminals::{TerminalBrand, TerminalId};

/// Terminal properties determined from replies and environment variables.
#[derive(Clone, Debug)]
pub struct TerminalProbeResult {
    /// Number of columns and rows.
    pub cells: (u16, u16),
    /// Cell size in pixels, if the terminal reports it.
    pub cell_pixels: (u16, u16),
    /// Color depth according to environment variables.
    pub depth: ColorDepth,
    /// Whether glimt is running inside tmux or screen.
    pub is_multiplexed: bool,
    /// Whether the terminal is reached over a network.
    pub is_remote: bool,
    /// Whether environment variables identify a terminal that supports iTerm2's inline images.
    pub has_iterm: bool,
    /// The terminal's replies, or `None` if it does not reply.
    pub answers: Option<ReportedTerminalFeatures>,
}

/// Data from the terminal's replies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportedTerminalFeatures {
    /// Round-trip time for a status report.
    pub round_trip: Duration,
    /// Terminal name and version (XTVERSION).
    pub name: Option<String>,
    /// Whether 24-bit color is supported (XTGETTCAP).
    pub has_true_color: bool,
    /// Whether kitty's graphics protocol is supported.
    pub has_kitty: bool,
    /// Whether Sixel is supported (DA1).
    pub has_sixel: bool,
    /// Whether synchronized output is supported (DECRQM 2026).
    pub is_synchronized: bool,
    /// Background color in sRGB (OSC 11).
    pub background: Option<[u8; 3]>,
}

impl TerminalProbeResult {
    /// Name of the character set that `--preview auto` uses.
    pub fn auto_preview_style_name(&self) -> &'static str {
        let name = self.answers.as_ref().and_then(|answers| answers.name.as_deref());
        let terminal = name.filter(|_| !self.is_multiplexed).and_then(TerminalId::from_report);
        match (self.depth, terminal.map_or(FinestNativeBlocks::Unknown, FinestNativeBlocks::supported_by)) {
            (ColorDepth::None, _) => "characters",
            (_, FinestNativeBlocks::Octants) => "octants",
            (_, FinestNativeBlocks::Sextants) => "sextants",
            (_, FinestNativeBlocks::Unknown) => "half blocks",
        }
    }
}

/// Timeout for the terminal's replies.
const REPLY_TIMEOUT: Duration = Duration::from_secs(1);

/// Queries the terminal. Returns `None` if stdin or stdout is not a terminal.
///
/// Multiplexers and consoles are queried only for their status and device attributes because they may print
/// other queries as text.
pub fn probe_terminal() -> Option<TerminalProbeResult> {
    if !(io::stdin().is_terminal() && io::stdout().is_terminal()) {
        return None;
    }
    let variable = |name: &str| std::env::var(name).ok();
    let (window, link) = (terminal::query_window_size(None), terminal_environment_from_variables(variable));
    let questions = if may_print_unknown_escapes(variable) || link.is_multiplexed {
        Vec::new()
    } else {
        let ask = TerminalQueries {
            blocks: true,
            name: true,
            true_color: true,
            background: true,
            palette: false,
            pixels: None,
        };
        [&ask.requested_query_bytes(), SYNCHRONIZED, KITTY_QUERY].concat()
    };
    let is_dumb = variable("TERM").is_some_and(|term| term == "dumb");
    let answers = if is_dumb { None } else { query_in_raw_mode(&questions).ok().flatten() };
    let brand = variable("TERM_PROGRAM").and_then(|program| TerminalBrand::from_program(&program));
    Some(TerminalProbeResult {
        cells: (window.columns, window.rows),
        cell_pixels: window.cell_pixels,
        depth: color::resolve_color_depth(ColorDepthChoice::Auto, variable),
        is_multiplexed: link.is_multiplexed,
        is_remote: link.is_remote,
        has_iterm: brand.is_some_and(TerminalBrand::has_iterm_images),
        answers,
    })
}

/// Sends the queries in raw mode, then restores the terminal modes.
fn query_in_raw_mode(questions: &[u8]) -> io::Result<Option<ReportedTerminalFeatures>> {
    let stdin = io::stdin();
    let before = tcgetattr(&stdin)?;
    let mut raw = before.clone();
    cfmakeraw(&mut raw);
    tcsetattr(&stdin, SetArg::TCSANOW, &raw)?;
    let answers = query_and_read_replies(questions);
    // Prevent late replies from reaching the shell.
    let _ = nix::sys::termios::tcflush(&stdin, FlushArg::TCIFLUSH);
    tcsetattr(&stdin, SetArg::TCSANOW, &before)?;
    answers
}

fn query_and_read_replies(questions: &[u8]) -> io::Result<Option<ReportedTerminalFeatures>> {
    let (begin, mut replies) = (Instant::now(), ReceivedReplies::default());
    write_to_terminal(STATUS)?;
    if !read_replies_until(&mut replies, begin, |replies| replies.has_received(TerminalReply::Ready))? {
        return Ok(None);
    }
    let round_trip = begin.elapsed();
    write_to_terminal(&[questions, ATTRIBUTES].concat())?;
    read_replies_until(&mut replies, Instant::now(), |replies| {
        replies.has_received(TerminalReply::Attributes)
    })?;
    Ok(Some(ReportedTerminalFeatures { round_trip, ..replies.to_reported_features() }))
}

fn write_to_terminal(bytes: &[u8]) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(bytes)?;
    stdout.flush()
}

/// Reads replies until `is_all` returns true. Returns false on timeout.
fn read_replies_until(
    replies: &mut ReceivedReplies,
    begin: Instant,
    is_all: impl Fn(&ReceivedReplies) -> bool,
) -> io::Result<bool> {
    let stdin = io::stdin();
    let mut bytes = [0; 4096];
    while !is_all(replies) {
        let rest = REPLY_TIMEOUT.saturating_sub(begin.elapsed());
        let timeout = PollTimeout::try_from(rest).unwrap_or(PollTimeout::ZERO);
        let mut ends = [PollFd::new(stdin.as_fd(), PollFlags::POLLIN)];
        if rest.is_zero() || poll(&mut ends, timeout)? == 0 {
            return Ok(false);
        }
        match nix::unistd::read(&stdin, &mut bytes)? {
            0 => return Ok(false),
            count => replies.add_received_bytes(&bytes[..count]),
        }
    }
    Ok(true)
}

/// Bytes received from the terminal and the replies parsed from them.
#[derive(Default)]
struct ReceivedReplies {
    decoder: Decoder,
    answers: Vec<TerminalReply>,
    /// All received bytes, for replies that the front end does not parse.
    bytes: Vec<u8>,
}

impl ReceivedReplies {
    fn add_received_bytes(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
        let answer = |input| match input {
            DecodedInput::TerminalReply(answer) => Some(answer),
            DecodedInput::Key(_) | DecodedInput::Mouse(_) | DecodedInput::Paste => None,
        };
        self.answers.extend(self.decoder.decode(bytes, Instant::now()).into_iter().filter_map(answer));
    }

    fn has_received(&self, answer: TerminalReply) -> bool {
        self.answers.contains(&answer)
    }

    /// Summarizes the received replies.
    fn to_reported_features(&self) -> ReportedTerminalFeatures {
        let background = |answer: &TerminalReply| match answer {
            TerminalReply::Background(rgb) => Some(*rgb),
            TerminalReply::Ready
            | TerminalReply::Attributes
            | TerminalReply::Synchronized { .. }
            | TerminalReply::Name(_)
            | TerminalReply::Focus { .. }
            | TerminalReply::TrueColor
            | TerminalReply::Ink { .. }
            | TerminalReply::Images(_)
            | TerminalReply::Other => None,
        };
        let attributes = self.find_text_between_markers(b"\x1b[?", b'c').unwrap_or_default();
        ReportedTerminalFeatures {
            round_trip: Duration::ZERO,
            name: self.find_text_between_markers(b"\x1bP>|", 0x1b),
            has_true_color: self.has_received(TerminalReply::TrueColor),
            has_kitty: self
                .find_text_between_markers(b"\x1b_Gi=4211;", 0x1b)
                .is_some_and(|text| text == "OK"),
            has_sixel: attributes.split(';').any(|attribute| attribute == "4"),
            is_synchronized: self.has_received(TerminalReply::Synchronized { is_known: true }),
            background: self.answers.iter().find_map(background),
        }
    }

    /// Finds the first text between `begin` and `end` that does not contain an escape character.
    fn find_text_between_markers(&self, begin: &[u8], end: u8) -> Option<String> {
        let starts = self.bytes.windows(begin.len()).enumerate().filter(|(_, window)| *window == begin);
        starts.into_iter().find_map(|(at, _)| {
            let rest = &self.bytes[at + begin.len()..];
            let text = rest.split(|byte| *byte == end || *byte == 0x1b).next()?;
            (rest.get(text.len()) == Some(&end)).then(|| String::from_utf8_lossy(text).into_owned())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replies_in(bytes: &[u8]) -> ReceivedReplies {
        let mut replies = ReceivedReplies::default();
        replies.add_received_bytes(bytes);
        replies
    }

    #[test]
    fn replies_are_found_in_any_order() {
        let replies = replies_in(
            b"\x1b[0n\x1bP>|foot(1.20.2)\x1b\\\x1bP1+r524742=38\x1b\\\x1b[?2026;2$y\x1b]11;rgb:1c1c/1c1c/1c1c\x1b\\\x1b_Gi=4211;OK\x1b\\\x1b[?62;4;22c",
        );
        let answers = replies.to_reported_features();
        assert_eq!(answers.name.as_deref(), Some("foot(1.20.2)"));
        assert_eq!(answers.background, Some([0x1c; 3]));
        assert!(answers.has_true_color && answers.has_kitty && answers.has_sixel && answers.is_synchronized);
        assert!(
            replies.has_received(TerminalReply::Ready) && replies.has_received(TerminalReply::Attributes)
        );
    }

    #[test]
    fn negative_replies_are_not_capabilities() {
        let refused =
            replies_in(b"\x1bP0+r524742\x1b\\\x1b[?2026;0$y\x1b_Gi=4211;ENOTSUPPORTED\x1b\\\x1b[?1;42c");
        assert_eq!(refused.to_reported_features(), ReportedTerminalFeatures::default());
        assert!(!replies_in(b"\x1b[?62;").has_received(TerminalReply::Attributes));
    }
}
