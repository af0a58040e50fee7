//! Known terminals and their capabilities beyond text. None of the escape sequences listed here are sent to
//! unknown terminals.

/// Terminals that glimt recognizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TerminalBrand {
    Kitty,
    Foot,
    Ghostty,
    WezTerm,
    Contour,
    /// GNOME Terminal, Ptyxis and others.
    Vte,
    Konsole,
    Iterm2,
    WindowsTerminal,
    ConEmu,
    Mintty,
    Alacritty,
    VsCode,
    AppleTerminal,
    Xterm,
}

/// A terminal and its version number. `[0, 0]` means that the version is unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TerminalId {
    pub(super) brand: TerminalBrand,
    pub(super) version: [u32; 2],
}

/// Desktop notification protocols.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NotificationProtocol {
    /// iTerm2's notification protocol (OSC 9).
    Osc9,
    /// kitty's notification protocol (OSC 99).
    Osc99,
    /// rxvt-unicode's notification protocol (OSC 777), with a title.
    Osc777,
    /// The bell character, which highlights the window in most environments.
    Bell,
}

/// Terminal capabilities beyond text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct TerminalExtras {
    /// Window titles (OSC 2).
    pub(super) title: bool,
    /// A progress bar in the window frame or taskbar (OSC 9;4).
    pub(super) progress: bool,
    pub(super) notice: Option<NotificationProtocol>,
    /// Focus reporting (mode 1004).
    pub(super) focus: bool,
    /// Hyperlinks (OSC 8).
    pub(super) links: bool,
    /// Clipboard access (OSC 52). The terminal may ask the user for permission.
    pub(super) clipboard: bool,
}

impl TerminalBrand {
    /// The terminal that sets `TERM_PROGRAM` to `name`, or `None` if it is unknown.
    pub(super) fn from_program(name: &str) -> Option<Self> {
        const PROGRAMS: [(&str, TerminalBrand); 6] = [
            ("ghostty", TerminalBrand::Ghostty),
            ("WezTerm", TerminalBrand::WezTerm),
            ("iTerm.app", TerminalBrand::Iterm2),
            ("mintty", TerminalBrand::Mintty),
            ("vscode", TerminalBrand::VsCode),
            ("Apple_Terminal", TerminalBrand::AppleTerminal),
        ];
        PROGRAMS.iter().find(|(known, _)| *known == name).map(|(_, brand)| *brand)
    }

    /// Whether this terminal, as identified by `TERM_PROGRAM`, supports 24-bit color and REP.
    pub(super) fn supports_true_color_and_rep(self) -> bool {
        match self {
            Self::Ghostty | Self::WezTerm | Self::Iterm2 | Self::VsCode => true,
            Self::Kitty
            | Self::Foot
            | Self::Contour
            | Self::Vte
            | Self::Konsole
            | Self::WindowsTerminal
            | Self::ConEmu
            | Self::Mintty
            | Self::Alacritty
            | Self::AppleTerminal
            | Self::Xterm => false,
        }
    }

    /// Whether the terminal supports iTerm2's inline images.
    pub(super) fn has_iterm_images(self) -> bool {
        match self {
            Self::WezTerm | Self::Iterm2 | Self::VsCode => true,
            Self::Kitty
            | Self::Foot
            | Self::Ghostty
            | Self::Contour
            | Self::Vte
            | Self::Konsole
            | Self::WindowsTerminal
            | Self::ConEmu
            | Self::Mintty
            | Self::Alacritty
            | Self::AppleTerminal
            | Self::Xterm => false,
        }
    }
}

impl TerminalId {
    /// Parses an XTVERSION report, such as `foot(1.20.2)` or `ghostty 1.2.0`.
    pub(super) fn from_report(report: &str) -> Option<Self> {
        const NAMES: [(&str, TerminalBrand); 10] = [
            ("kitty", TerminalBrand::Kitty),
            ("foot", TerminalBrand::Foot),
            ("ghostty", TerminalBrand::Ghostty),
            ("WezTerm", TerminalBrand::WezTerm),
            ("contour", TerminalBrand::Contour),
            ("vte", TerminalBrand::Vte),
            ("Konsole", TerminalBrand::Konsole),
            ("iTerm2", TerminalBrand::Iterm2),
            ("mintty", TerminalBrand::Mintty),
            ("XTerm", TerminalBrand::Xterm),
        ];
        let (name, rest) = report.split_at(report.find(['(', ' ']).unwrap_or(report.len()));
        let (_, brand) = NAMES.iter().find(|(known, _)| name.eq_ignore_ascii_case(known))?;
        Some(Self { brand: *brand, version: parse_version(rest.get(1..).unwrap_or_default()) })
    }

    /// Detects the terminal from environment variables. Returns `None` for unknown terminals and inside tmux
    /// or screen, which do not pass on escape sequences.
    pub(super) fn from_environment(variable: impl Fn(&str) -> Option<String>) -> Option<Self> {
        const TERMS: [(&str, TerminalBrand); 6] = [
            ("xterm-kitty", TerminalBrand::Kitty),
            ("foot", TerminalBrand::Foot),
            ("xterm-ghostty", TerminalBrand::Ghostty),
            ("wezterm", TerminalBrand::WezTerm),
            ("contour", TerminalBrand::Contour),
            ("alacritty", TerminalBrand::Alacritty),
        ];
        let get = |name: &str| variable(name).unwrap_or_default();
        let is_set = |name: &str| !get(name).is_empty();
        let term = get("TERM");
        if is_set("TMUX") || is_set("STY") || supports_only_text_and_colors(&term) {
            return None;
        }
        let known =
            |brand: TerminalBrand, number: &str| Some(Self { brand, version: parse_version(&get(number)) });
        // Check `TERM_PROGRAM` and `TERM` first, because a terminal that runs inside another one overwrites
        // them.
        if let Some(brand) = TerminalBrand::from_program(&get("TERM_PROGRAM")) {
            return known(brand, "TERM_PROGRAM_VERSION");
        }
        if let Some((_, brand)) = TERMS.iter().find(|(name, _)| term.starts_with(name)) {
            return known(*brand, "TERM_PROGRAM_VERSION").filter(|_| !is_set("TERM_PROGRAM"));
        }
        match () {
            () if is_set("WT_SESSION") => known(TerminalBrand::WindowsTerminal, ""),
            () if get("ConEmuANSI") == "ON" => known(TerminalBrand::ConEmu, ""),
            () if is_set("VTE_VERSION") => known(TerminalBrand::Vte, "VTE_VERSION"),
            () if is_set("KONSOLE_VERSION") => {
                // 250402 means version 25.04.2.
                let number: u32 = get("KONSOLE_VERSION").parse().unwrap_or(0);
                Some(Self { brand: TerminalBrand::Konsole, version: [number / 10_000, number / 100 % 100] })
            }
            () if is_set("XTERM_VERSION") => known(TerminalBrand::Xterm, ""),
            // SSH usually forwards `LC_*` variables, so this also detects iTerm2 on remote machines.
            () if get("LC_TERMINAL") == "iTerm2" => known(TerminalBrand::Iterm2, "LC_TERMINAL_VERSION"),
            () => None,
        }
    }

    /// Capabilities according to the terminal's documentation.
    pub(super) fn terminal_extras(self) -> TerminalExtras {
        let Self { brand, version } = self;
        let all = TerminalExtras {
            title: true,
            progress: false,
            notice: Some(NotificationProtocol::Bell),
            focus: true,
            links: true,
            clipboard: true,
        };
        let since = |least: [u32; 2]| version >= least;
        match brand {
            TerminalBrand::Kitty => TerminalExtras { notice: Some(NotificationProtocol::Osc99), ..all },
            TerminalBrand::Foot | TerminalBrand::Contour => {
                TerminalExtras { notice: Some(NotificationProtocol::Osc777), ..all }
            }
            TerminalBrand::Ghostty => {
                TerminalExtras { notice: Some(NotificationProtocol::Osc777), progress: since([1, 2]), ..all }
            }
            // Older versions display the progress sequence as a notification.
            TerminalBrand::WezTerm => TerminalExtras {
                notice: Some(NotificationProtocol::Osc777),
                progress: since([20_250_301, 0]),
                ..all
            },
            TerminalBrand::Iterm2 => {
                TerminalExtras { notice: Some(NotificationProtocol::Osc9), progress: since([3, 7]), ..all }
            }
            TerminalBrand::WindowsTerminal => TerminalExtras { progress: true, ..all },
            TerminalBrand::VsCode => TerminalExtras { progress: since([1, 97]), ..all },
            TerminalBrand::Mintty => TerminalExtras { progress: since([3, 5]), ..all },
            TerminalBrand::Alacritty => all,
            TerminalBrand::Konsole => TerminalExtras { progress: since([25, 4]), clipboard: false, ..all },
            TerminalBrand::Vte => TerminalExtras {
                progress: since([8000, 0]),
                links: since([5000, 0]),
                clipboard: false,
                ..all
            },
            // xterm denies clipboard access by default.
            TerminalBrand::Xterm => TerminalExtras { links: false, clipboard: false, ..all },
            TerminalBrand::ConEmu => {
                TerminalExtras { title: true, progress: true, ..TerminalExtras::default() }
            }
            TerminalBrand::AppleTerminal => {
                TerminalExtras { links: false, clipboard: false, focus: false, notice: None, ..all }
            }
        }
    }
}

/// Whether a terminal with this `TERM` supports only text and colors, or intercepts other escape sequences.
fn supports_only_text_and_colors(term: &str) -> bool {
    term.is_empty() || ["linux", "dumb", "vt", "screen", "tmux"].iter().any(|name| term.starts_with(name))
}

/// The first two numbers of a version string.
fn parse_version(text: &str) -> [u32; 2] {
    let mut numbers = text.split(|c: char| !c.is_ascii_digit());
    let mut number = || numbers.next().and_then(|digits| digits.parse().ok()).unwrap_or(0);
    [number(), number()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identify(pairs: &[(&str, &str)]) -> Option<TerminalId> {
        TerminalId::from_environment(|name| {
            pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn terminals_are_detected_from_environment() {
        let xterm = ("TERM", "xterm-256color");
        for (pairs, brand, version) in [
            (&[("TERM", "xterm-kitty")][..], TerminalBrand::Kitty, [0, 0]),
            (&[("TERM", "foot-extra")], TerminalBrand::Foot, [0, 0]),
            (
                &[xterm, ("TERM_PROGRAM", "iTerm.app"), ("TERM_PROGRAM_VERSION", "3.6.6")],
                TerminalBrand::Iterm2,
                [3, 6],
            ),
            (
                &[xterm, ("LC_TERMINAL", "iTerm2"), ("LC_TERMINAL_VERSION", "3.5.1")],
                TerminalBrand::Iterm2,
                [3, 5],
            ),
            (&[xterm, ("WT_SESSION", "1-2-3")], TerminalBrand::WindowsTerminal, [0, 0]),
            (&[xterm, ("VTE_VERSION", "8002")], TerminalBrand::Vte, [8002, 0]),
            (&[xterm, ("KONSOLE_VERSION", "250402")], TerminalBrand::Konsole, [25, 4]),
            (
                &[xterm, ("TERM_PROGRAM", "WezTerm"), ("TERM_PROGRAM_VERSION", "20240203-110809-5046fc22")],
                TerminalBrand::WezTerm,
                [20_240_203, 110_809],
            ),
            // VS Code started from kitty.
            (&[xterm, ("TERM_PROGRAM", "vscode"), ("KITTY_WINDOW_ID", "1")], TerminalBrand::VsCode, [0, 0]),
        ] {
            assert_eq!(identify(pairs), Some(TerminalId { brand, version }), "{pairs:?}");
        }
    }

    #[test]
    fn unknown_terminals_are_not_detected() {
        let wezterm = ("TERM_PROGRAM", "WezTerm");
        for pairs in [
            &[][..],
            &[("TERM", "xterm-256color")],
            &[("TERM", "dumb"), ("WT_SESSION", "1")],
            &[("TERM", "linux"), wezterm],
            &[("TERM", "screen.xterm-256color"), wezterm],
            &[("TERM", "xterm-256color"), wezterm, ("STY", "12.pts-0")],
            &[("TERM", "xterm-256color"), wezterm, ("TMUX", "/tmp/tmux-0/default,1,0")],
            &[("TERM", "tmux-256color"), ("VTE_VERSION", "8002")],
        ] {
            assert_eq!(identify(pairs), None, "{pairs:?}");
        }
        assert_eq!(TerminalId::from_report("tmux 3.4"), None);
    }

    #[test]
    fn progress_bar_support_depends_on_version() {
        for (report, has_progress) in [
            ("ghostty 1.2.0", true),
            ("ghostty 1.1.3-arch2", false),
            ("WezTerm 20240203-110809-5046fc22", false),
            ("WezTerm 20250815-000000-00000000", true),
            ("VTE(7802)", false),
            ("VTE(8000)", true),
            ("Konsole 24.12.3", false),
            ("Konsole 25.04.2", true),
            ("kitty(0.40.1)", false),
            ("XTerm(390)", false),
        ] {
            let terminal = TerminalId::from_report(report).expect(report);
            assert_eq!(terminal.terminal_extras().progress, has_progress, "{report}");
        }
    }
}
