//! Answers of terminals, and questions to ask them.

use super::graphics::Protocol;
use super::pixel_request::PixelRequest;
use super::terminals::{Brand, TerminalId};

/// The finest blocks that a terminal draws itself, whatever its font.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BlockGlyphs {
    /// Nothing is known.
    Unknown,
    /// Unicode 13.
    Sextants,
    /// Unicode 16.
    Octants,
}

impl BlockGlyphs {
    /// Blocks of a terminal of this version; all those that are known draw sextants since long.
    pub(super) fn of(terminal: TerminalId) -> Self {
        let octants_since = match terminal.brand {
            Brand::Kitty => [0, 40],
            Brand::Foot => [1, 20],
            Brand::Ghostty => [1, 2],
            Brand::Vte => [7800, 0],
            Brand::WezTerm | Brand::Contour => return Self::Sextants,
            Brand::Konsole
            | Brand::Iterm2
            | Brand::WindowsTerminal
            | Brand::ConEmu
            | Brand::Mintty
            | Brand::Alacritty
            | Brand::VsCode
            | Brand::AppleTerminal
            | Brand::Xterm => return Self::Unknown,
        };
        if terminal.version >= octants_since { Self::Octants } else { Self::Sextants }
    }
}

/// A report of the terminal, to a question or of its own accord.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TerminalReply {
    /// To a status report (DSR 5): all that was sent before has been processed.
    Ready,
    /// To a question for the primary device attributes (DA1).
    Attributes,
    /// Whether mode 2026 is known, by which large changes appear at once.
    Synchronized { is_known: bool },
    /// The terminal and its version (XTVERSION), if glimt knows its name.
    Name(TerminalId),
    /// Whether its window has the focus now (mode 1004).
    Focus { is_here: bool },
    /// It has 24 bits of color (XTGETTCAP).
    TrueColor,
    /// Its background, in sRGB (OSC 11).
    Background([u8; 3]),
    /// It shows images by this protocol.
    Images(Protocol),
    /// One of its palette, in sRGB (OSC 4).
    Ink { index: u8, rgb: [u8; 3] },
    /// Any other report: the cursor's position, modes, colors, other names.
    Other,
}

/// Questions to the terminal: only useful ones, and only if the terminal itself answers. glimt ignores answers to other
/// questions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct TerminalQueries {
    /// The blocks that it draws, by its name.
    pub(super) blocks: bool,
    /// Its name, for what it can do besides.
    pub(super) name: bool,
    /// Whether it has 24 bits of color.
    pub(super) true_color: bool,
    /// Its background.
    pub(super) background: bool,
    /// Its 16 colors.
    pub(super) palette: bool,
    /// Whether it shows images.
    pub(super) pixels: Option<PixelRequest>,
}

impl TerminalQueries {
    /// The bytes of the questions.
    pub(super) fn questions(self) -> Vec<u8> {
        let mut questions = Vec::new();
        let mut ask = |is_asked: bool, bytes: &[u8]| {
            if is_asked {
                questions.extend_from_slice(bytes);
            }
        };
        let pixels = self.pixels.map(PixelRequest::question).unwrap_or_default();
        ask(self.blocks || self.name, b"\x1b[>q");
        ask(true, &pixels);
        // `RGB` and `Tc`, in hexadecimal digits.
        ask(self.true_color, b"\x1bP+q524742\x1b\\\x1bP+q5463\x1b\\");
        ask(self.background, b"\x1b]11;?\x1b\\");
        for index in 0..16 {
            ask(self.palette, format!("\x1b]4;{index};?\x1b\\").as_bytes());
        }
        questions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_of_use_is_asked() {
        assert!(TerminalQueries::default().questions().is_empty());
        for ask in [
            TerminalQueries { blocks: true, ..TerminalQueries::default() },
            TerminalQueries { name: true, blocks: true, ..TerminalQueries::default() },
        ] {
            assert_eq!(ask.questions(), b"\x1b[>q");
        }
        let palette = TerminalQueries { palette: true, ..TerminalQueries::default() }.questions();
        assert!(palette.ends_with(b"\x1b]4;15;?\x1b\\"));
    }

    #[test]
    fn octants_came_with_a_version() {
        for (report, blocks) in [
            ("kitty(0.40.1)", BlockGlyphs::Octants),
            ("kitty(0.35.2)", BlockGlyphs::Sextants),
            ("foot(1.20.2)", BlockGlyphs::Octants),
            ("foot(1.9.0)", BlockGlyphs::Sextants),
            ("ghostty 1.2.0", BlockGlyphs::Octants),
            ("ghostty 1.1.3-arch2", BlockGlyphs::Sextants),
            ("VTE(7802)", BlockGlyphs::Octants),
            ("WezTerm 20240203-110809-5046fc22", BlockGlyphs::Sextants),
            ("contour 0.6.0", BlockGlyphs::Sextants),
            ("kitty", BlockGlyphs::Sextants),
            ("tmux 3.4", BlockGlyphs::Unknown),
            ("XTerm(390)", BlockGlyphs::Unknown),
            ("", BlockGlyphs::Unknown),
        ] {
            let found = TerminalId::of_report(report).map_or(BlockGlyphs::Unknown, BlockGlyphs::of);
            assert_eq!(found, blocks, "{report}");
        }
    }
}
