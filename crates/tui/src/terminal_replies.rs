//! Terminal queries and replies.

use super::graphics::ImageProtocol;
use super::pixel_request::UnconfirmedImageProtocol;
use super::terminals::{TerminalBrand, TerminalId};

/// The finest block characters that a terminal draws without using a font.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FinestNativeBlocks {
    /// The block characters that the terminal draws are unknown.
    Unknown,
    /// Sextants (Unicode 13).
    Sextants,
    /// Octants (Unicode 16).
    Octants,
}

impl FinestNativeBlocks {
    /// Returns the finest block characters that a terminal version draws. Terminals that draw octants in
    /// newer versions have long drawn sextants.
    pub(super) fn supported_by(terminal: TerminalId) -> Self {
        let octants_since = match terminal.brand {
            TerminalBrand::Kitty => [0, 40],
            TerminalBrand::Foot => [1, 20],
            TerminalBrand::Ghostty => [1, 2],
            TerminalBrand::Vte => [7800, 0],
            TerminalBrand::WezTerm | TerminalBrand::Contour => return Self::Sextants,
            TerminalBrand::Konsole
            | TerminalBrand::Iterm2
            | TerminalBrand::WindowsTerminal
            | TerminalBrand::ConEmu
            | TerminalBrand::Mintty
            | TerminalBrand::Alacritty
            | TerminalBrand::VsCode
            | TerminalBrand::AppleTerminal
            | TerminalBrand::Xterm => return Self::Unknown,
        };
        if terminal.version >= octants_since { Self::Octants } else { Self::Sextants }
    }
}

/// A terminal report, solicited or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TerminalReply {
    /// Status report (DSR 5): everything sent before it has been processed.
    Ready,
    /// Primary device attributes (DA1).
    Attributes,
    /// Whether mode 2026, synchronized output, is supported.
    Synchronized { is_known: bool },
    /// Name and version (XTVERSION), if glimt recognizes the terminal.
    Name(TerminalId),
    /// Whether the window is focused (mode 1004).
    Focus { is_here: bool },
    /// 24-bit color is supported (XTGETTCAP).
    TrueColor,
    /// Background color in sRGB (OSC 11).
    Background([u8; 3]),
    /// The terminal supports images in this protocol.
    Images(ImageProtocol),
    /// A palette color in sRGB (OSC 4).
    Ink { index: u8, rgb: [u8; 3] },
    /// Any other report from the terminal.
    Other,
}

/// Which queries to send. A query is sent only if it is useful and the terminal itself answers it. Replies to
/// other queries are ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct TerminalQueries {
    /// Query the terminal's name to determine which block characters it draws.
    pub(super) blocks: bool,
    /// Query the terminal's name to determine its other capabilities.
    pub(super) name: bool,
    /// Query whether the terminal supports 24-bit color.
    pub(super) true_color: bool,
    /// Query the background color.
    pub(super) background: bool,
    /// Query the 16 ANSI colors.
    pub(super) palette: bool,
    /// Query whether the terminal supports this image protocol.
    pub(super) pixels: Option<UnconfirmedImageProtocol>,
}

impl TerminalQueries {
    /// The escape sequences that send the queries.
    pub(super) fn requested_query_bytes(self) -> Vec<u8> {
        let mut queries = Vec::new();
        let mut ask = |is_asked: bool, bytes: &[u8]| {
            if is_asked {
                queries.extend_from_slice(bytes);
            }
        };
        let pixels = self.pixels.map(UnconfirmedImageProtocol::query).unwrap_or_default();
        ask(self.blocks || self.name, b"\x1b[>q");
        ask(true, &pixels);
        // The capability names `RGB` and `Tc` are hex-encoded.
        ask(self.true_color, b"\x1bP+q524742\x1b\\\x1bP+q5463\x1b\\");
        ask(self.background, b"\x1b]11;?\x1b\\");
        for index in 0..16 {
            ask(self.palette, format!("\x1b]4;{index};?\x1b\\").as_bytes());
        }
        queries
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_useful_queries_are_sent() {
        assert!(TerminalQueries::default().requested_query_bytes().is_empty());
        for ask in [
            TerminalQueries { blocks: true, ..TerminalQueries::default() },
            TerminalQueries { name: true, blocks: true, ..TerminalQueries::default() },
        ] {
            assert_eq!(ask.requested_query_bytes(), b"\x1b[>q");
        }
        let palette = TerminalQueries { palette: true, ..TerminalQueries::default() }.requested_query_bytes();
        assert!(palette.ends_with(b"\x1b]4;15;?\x1b\\"));
    }

    #[test]
    fn octant_support_depends_on_version() {
        for (report, blocks) in [
            ("kitty(0.40.1)", FinestNativeBlocks::Octants),
            ("kitty(0.35.2)", FinestNativeBlocks::Sextants),
            ("foot(1.20.2)", FinestNativeBlocks::Octants),
            ("foot(1.9.0)", FinestNativeBlocks::Sextants),
            ("ghostty 1.2.0", FinestNativeBlocks::Octants),
            ("ghostty 1.1.3-arch2", FinestNativeBlocks::Sextants),
            ("VTE(7802)", FinestNativeBlocks::Octants),
            ("WezTerm 20240203-110809-5046fc22", FinestNativeBlocks::Sextants),
            ("contour 0.6.0", FinestNativeBlocks::Sextants),
            ("kitty", FinestNativeBlocks::Sextants),
            ("tmux 3.4", FinestNativeBlocks::Unknown),
            ("XTerm(390)", FinestNativeBlocks::Unknown),
            ("", FinestNativeBlocks::Unknown),
        ] {
            let found = TerminalId::from_report(report)
                .map_or(FinestNativeBlocks::Unknown, FinestNativeBlocks::supported_by);
            assert_eq!(found, blocks, "{report}");
        }
    }
}
