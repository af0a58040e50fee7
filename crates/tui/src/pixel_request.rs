//! Detects whether the terminal supports the image protocol selected with `--preview`. Until this is known,
//! the preview is drawn with half blocks.

use std::time::{Duration, Instant};

use super::graphics::{ImageProtocol, tmux_passthrough};
use super::terminals::TerminalId;

/// Image ID used in the query for kitty's protocol.
pub(super) const QUERY_ID: u32 = 4211;
/// Query for kitty's protocol: a one-pixel image that is not stored.
pub(super) const KITTY_QUERY: &[u8] = b"\x1b_Gi=4211,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\";
/// Query for the terminal's name and version (XTVERSION).
const NAME_QUERY: &[u8] = b"\x1b[>q";
/// Time after which a missing reply is reported to the user.
const REPLY_TIMEOUT: Duration = Duration::from_secs(1);

/// How escape sequences for images reach the terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MultiplexerPassthrough {
    /// Directly, without a multiplexer.
    Direct,
    /// Through tmux, which passes on wrapped escape sequences if `allow-passthrough` is on.
    Tmux,
    /// Not at all, in GNU screen and in consoles that print unknown escape sequences. No queries are sent.
    Closed,
}

/// A request to draw pixels that the terminal has not confirmed yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct UnconfirmedImageProtocol {
    pub(super) protocol: ImageProtocol,
    pub(super) route: MultiplexerPassthrough,
    /// Whether environment variables identify a terminal that supports the protocol.
    pub(super) is_known: bool,
}

impl UnconfirmedImageProtocol {
    pub(super) fn new(
        protocol: ImageProtocol,
        variable: impl Fn(&str) -> Option<String>,
        is_plain: bool,
    ) -> Self {
        let is_set = |name: &str| variable(name).is_some_and(|value| !value.is_empty());
        let term = variable("TERM").unwrap_or_default();
        let route = match () {
            () if is_set("TMUX") => MultiplexerPassthrough::Tmux,
            () if is_plain || is_set("STY") || term.starts_with("screen") => MultiplexerPassthrough::Closed,
            () => MultiplexerPassthrough::Direct,
        };
        let terminal = TerminalId::from_environment(variable);
        let has_iterm = terminal.is_some_and(|terminal| terminal.brand.has_iterm_images());
        Self { protocol, route, is_known: protocol == ImageProtocol::Iterm && has_iterm }
    }

    /// Returns the query for the protocol, or no bytes if other queries cover it or it cannot be sent.
    pub(super) fn query(self) -> Vec<u8> {
        match (self.protocol, self.route) {
            (ImageProtocol::Kitty, MultiplexerPassthrough::Direct) => KITTY_QUERY.to_vec(),
            (ImageProtocol::Kitty, MultiplexerPassthrough::Tmux) => tmux_passthrough(KITTY_QUERY),
            (ImageProtocol::Iterm, MultiplexerPassthrough::Tmux) => tmux_passthrough(NAME_QUERY),
            (ImageProtocol::Iterm, MultiplexerPassthrough::Direct) => NAME_QUERY.to_vec(),
            // Device attributes are always queried, and tmux draws Sixel images itself.
            (ImageProtocol::Sixel, _) | (_, MultiplexerPassthrough::Closed) => Vec::new(),
        }
    }

    /// Time at which a missing reply is reported to the user.
    pub(super) fn reply_deadline(self, now: Instant) -> Instant {
        if self.route == MultiplexerPassthrough::Closed { now } else { now + REPLY_TIMEOUT }
    }

    /// Whether the device attributes arrive after all other replies. This is not the case inside tmux, which
    /// answers that query itself before passing on others.
    pub(super) fn is_attributes_reply_last(self) -> bool {
        match (self.protocol, self.route) {
            (ImageProtocol::Sixel, _) | (_, MultiplexerPassthrough::Direct) => true,
            (
                ImageProtocol::Kitty | ImageProtocol::Iterm,
                MultiplexerPassthrough::Tmux | MultiplexerPassthrough::Closed,
            ) => false,
        }
    }

    /// Explains that the terminal does not support the protocol, and lists terminals that do.
    pub(super) fn unsupported_message(self) -> String {
        let (name, terminals) = match self.protocol {
            ImageProtocol::Kitty => ("kitty", "kitty, Ghostty, WezTerm or Konsole"),
            ImageProtocol::Sixel => ("sixel", "foot, xterm -ti vt340, mlterm, or tmux built with Sixel"),
            ImageProtocol::Iterm => ("iTerm2", "iTerm2, WezTerm or VS Code"),
        };
        let instead = "half blocks are shown instead";
        match (self.protocol, self.route) {
            (ImageProtocol::Kitty | ImageProtocol::Iterm, MultiplexerPassthrough::Tmux) => format!(
                "no {name} images through tmux: {instead}; `tmux set -g allow-passthrough on` enables them if tmux is running in {terminals}"
            ),
            (ImageProtocol::Sixel, _)
            | (_, MultiplexerPassthrough::Direct | MultiplexerPassthrough::Closed) => {
                format!("this terminal does not support {name} images: {instead}; use {terminals}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(protocol: ImageProtocol, pairs: &[(&str, &str)], is_plain: bool) -> UnconfirmedImageProtocol {
        let variable =
            |name: &str| pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
        UnconfirmedImageProtocol::new(protocol, variable, is_plain)
    }

    #[test]
    fn environment_determines_the_query() {
        let xterm = ("TERM", "xterm-256color");
        let direct = request(ImageProtocol::Kitty, &[xterm], false);
        assert_eq!((direct.route, direct.query()), (MultiplexerPassthrough::Direct, KITTY_QUERY.to_vec()));
        let tmux =
            request(ImageProtocol::Kitty, &[("TERM", "tmux-256color"), ("TMUX", "/tmp/tmux,1,0")], false);
        assert_eq!(tmux.route, MultiplexerPassthrough::Tmux);
        assert!(tmux.query().starts_with(b"\x1bPtmux;\x1b\x1b_G"));
        let screen = request(ImageProtocol::Kitty, &[("TERM", "screen"), ("STY", "1.a")], false);
        assert_eq!((screen.route, screen.query()), (MultiplexerPassthrough::Closed, Vec::new()));
        assert_eq!(request(ImageProtocol::Iterm, &[xterm], true).route, MultiplexerPassthrough::Closed);
        assert!(request(ImageProtocol::Iterm, &[xterm, ("TERM_PROGRAM", "iTerm.app")], false).is_known);
        assert!(!request(ImageProtocol::Iterm, &[xterm], false).is_known);
        assert!(!request(ImageProtocol::Kitty, &[xterm, ("TERM_PROGRAM", "iTerm.app")], false).is_known);
        let number = String::from_utf8_lossy(KITTY_QUERY).contains(&format!("i={QUERY_ID},"));
        assert!(number, "the reply should contain the query's ID");
    }

    #[test]
    fn tmux_answers_attribute_queries_itself() {
        for protocol in [ImageProtocol::Kitty, ImageProtocol::Iterm] {
            let tmux = request(protocol, &[("TMUX", "/tmp/tmux,1,0")], false);
            assert!(!tmux.is_attributes_reply_last());
            assert!(
                tmux.unsupported_message().contains("allow-passthrough"),
                "{}",
                tmux.unsupported_message()
            );
            assert!(request(protocol, &[], false).is_attributes_reply_last());
        }
        assert!(
            request(ImageProtocol::Sixel, &[("TMUX", "/tmp/tmux,1,0")], false).is_attributes_reply_last()
        );
    }
}
