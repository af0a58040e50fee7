//! Detects support for REP from environment variables.

use crate::terminals::TerminalBrand;

/// Whether the terminal supports REP (ECMA-48 8.3.103, repeat the preceding character), judging from
/// environment variables. Many terminals set `TERM` to `xterm-256color`, but not all of them support REP.
pub fn terminal_supports_rep(variable: impl Fn(&str) -> Option<String>) -> bool {
    const TERMS: [&str; 8] =
        ["xterm-kitty", "alacritty", "foot", "xterm-ghostty", "wezterm", "contour", "tmux", "rio"];
    let get = |name: &str| variable(name).unwrap_or_default();
    let (term, program) = (get("TERM"), get("TERM_PROGRAM"));
    TERMS.iter().any(|name| term.starts_with(name))
        || (get("TMUX").is_empty()
            && TerminalBrand::from_program(&program).is_some_and(TerminalBrand::supports_true_color_and_rep))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rep_is_used_only_if_known_to_work() {
        let known = |variables: &[(&str, &str)]| {
            terminal_supports_rep(|name| {
                variables.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned())
            })
        };
        assert!(known(&[("TERM", "foot-extra")]));
        assert!(known(&[("TERM", "tmux-256color"), ("TMUX", "/tmp/tmux")]));
        assert!(known(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "vscode")]));
        assert!(!known(&[("TERM", "screen-256color"), ("TERM_PROGRAM", "vscode"), ("TMUX", "/tmp/tmux")]));
        assert!(!known(&[("TERM", "xterm-256color")]));
        assert!(!known(&[("TERM", "linux")]));
        assert!(!known(&[]));
    }
}
