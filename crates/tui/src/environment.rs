//! Detects the terminal and its connection from environment variables.

use super::color::{ColorDepth, ColorDepthChoice};
use super::display::TerminalEnvironment;
use super::graphics::ImageProtocol;
use super::options::PreviewChoice;
use super::paint::terminal_supports_rep;
use super::pixel_request::UnconfirmedImageProtocol;
use super::preview_style::PreviewStyle;
use super::terminal_replies::TerminalQueries;

/// The terminal and its connection, as detected from environment variables.
pub(super) fn terminal_environment_from_variables(
    variable: impl Fn(&str) -> Option<String>,
) -> TerminalEnvironment {
    let is_set = |name: &str| variable(name).is_some_and(|value| !value.is_empty());
    let term = variable("TERM").unwrap_or_default();
    TerminalEnvironment {
        is_multiplexed: is_set("TMUX")
            || is_set("STY")
            || term.starts_with("tmux")
            || term.starts_with("screen"),
        is_in_tmux: is_set("TMUX"),
        is_remote: ["SSH_CONNECTION", "SSH_CLIENT", "SSH_TTY"].into_iter().any(is_set),
        can_repeat: terminal_supports_rep(variable),
        ask: TerminalQueries::default(),
    }
}

/// Whether the terminal may print unknown escape sequences, as the Linux console and Apple's Terminal do.
pub(super) fn may_print_unknown_escapes(variable: impl Fn(&str) -> Option<String>) -> bool {
    let term = variable("TERM").unwrap_or_default();
    ["linux", "dumb", "vt"].iter().any(|name| term.starts_with(name))
        || variable("TERM_PROGRAM").is_some_and(|program| program == "Apple_Terminal")
}

/// Returns the image protocol for the user's preview choice.
fn image_protocol_from_choice(preview: PreviewChoice) -> Option<ImageProtocol> {
    match preview {
        PreviewChoice::Kitty => Some(ImageProtocol::Kitty),
        PreviewChoice::Sixel => Some(ImageProtocol::Sixel),
        PreviewChoice::Iterm2 => Some(ImageProtocol::Iterm),
        PreviewChoice::Auto
        | PreviewChoice::HalfBlock
        | PreviewChoice::Quadrant
        | PreviewChoice::Sextant
        | PreviewChoice::Octant
        | PreviewChoice::Ascii
        | PreviewChoice::None => None,
    }
}

/// Selects the queries to send to the terminal. Few are sent to multiplexers, which reply on their own behalf
/// or not at all, and to plain terminals, which may print queries as text.
pub(super) fn select_terminal_queries(
    preview: PreviewChoice,
    color: ColorDepthChoice,
    depth: ColorDepth,
    variable: impl Fn(&str) -> Option<String>,
) -> TerminalQueries {
    let get = |name: &str| variable(name).unwrap_or_default();
    let term = get("TERM");
    let is_outermost = !terminal_environment_from_variables(&variable).is_multiplexed;
    let is_plain = may_print_unknown_escapes(&variable);
    let has_palette = matches!(depth, ColorDepth::Indexed256 | ColorDepth::Ansi16);
    let is_ramp = PreviewStyle::from_choice(preview, depth) == PreviewStyle::Ascii;
    TerminalQueries {
        blocks: preview == PreviewChoice::Auto && depth != ColorDepth::None && is_outermost && !is_plain,
        name: is_outermost && !is_plain && !term.is_empty(),
        true_color: color == ColorDepthChoice::Auto && has_palette && is_outermost && !is_plain,
        background: is_ramp && get("STY").is_empty() && !term.starts_with("linux") && term != "dumb",
        palette: depth == ColorDepth::Ansi16 && is_outermost && !is_plain,
        pixels: image_protocol_from_choice(preview)
            .map(|protocol| UnconfirmedImageProtocol::new(protocol, &variable, is_plain)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiplexers_and_networks_are_detected() {
        let link = |pairs: &[(&str, &str)]| {
            terminal_environment_from_variables(|name| {
                pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
            })
        };
        assert!(!link(&[("TERM", "xterm-256color"), ("TMUX", "")]).is_multiplexed);
        assert!(link(&[("TERM", "xterm-256color"), ("TMUX", "/tmp/tmux-0/default,1,0")]).is_multiplexed);
        assert!(link(&[("TERM", "tmux-256color")]).is_multiplexed);
        assert!(link(&[("TERM", "screen.xterm-256color")]).is_multiplexed);
        assert!(link(&[("STY", "1234.pts-0")]).is_multiplexed);
        assert!(link(&[("SSH_CONNECTION", "10.0.0.1 5000 10.0.0.2 22")]).is_remote);
        assert!(!link(&[("TMUX", "/tmp/tmux-0/default,1,0"), ("SSH_TTY", "")]).is_remote);
    }

    #[test]
    fn only_unknown_properties_are_queried() {
        let ask = |preview, color, depth, pairs: &[(&str, &str)]| {
            select_terminal_queries(preview, color, depth, |name| {
                pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
            })
        };
        let (auto, xterm) = (PreviewChoice::Auto, ("TERM", "xterm-256color"));
        let none = TerminalQueries::default();
        let found = ask(auto, ColorDepthChoice::Auto, ColorDepth::Indexed256, &[xterm]);
        assert_eq!(found, TerminalQueries { blocks: true, name: true, true_color: true, ..none });
        let found = ask(auto, ColorDepthChoice::Ansi16, ColorDepth::Ansi16, &[xterm]);
        assert_eq!(found, TerminalQueries { blocks: true, name: true, palette: true, ..none });
        let tmux = ("TMUX", "/tmp/tmux-0/default,1,0");
        assert_eq!(ask(auto, ColorDepthChoice::Auto, ColorDepth::Indexed256, &[xterm, tmux]), none);
        let found = ask(PreviewChoice::HalfBlock, ColorDepthChoice::Auto, ColorDepth::TrueColor, &[xterm]);
        assert_eq!(found, TerminalQueries { name: true, ..none });
        let found = ask(auto, ColorDepthChoice::None, ColorDepth::None, &[xterm]);
        assert_eq!(found, TerminalQueries { name: true, background: true, ..none });
        assert_eq!(ask(auto, ColorDepthChoice::Auto, ColorDepth::Ansi16, &[("TERM", "linux")]), none);
    }
}
