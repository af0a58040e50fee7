//! Environment variables used by glimt, with descriptions for the help, the manual page and the
//! documentation.

/// Comma-separated names of related variables, and the effect of each group.
pub const VARIABLES: [(&str, &str); 14] = [
    ("NO_COLOR", "no colors, unless `--color` is given"),
    (
        "CLICOLOR, CLICOLOR_FORCE, COLUMNS",
        "colors (0: off, 1: on without a terminal) and width of help texts",
    ),
    ("COLORTERM, TERM, TERM_PROGRAM", "colors and block characters that the terminal supports"),
    (
        "TERM_PROGRAM_VERSION, VTE_VERSION, KONSOLE_VERSION, XTERM_VERSION",
        "terminal version, which determines support for progress, links and notifications",
    ),
    ("WT_SESSION, ConEmuANSI, LC_TERMINAL, LC_TERMINAL_VERSION", "the same, for other terminals"),
    ("COLORFGBG", "whether the background is light"),
    ("TMUX, STY", "glimt is running in tmux or screen"),
    ("SSH_CONNECTION, SSH_CLIENT, SSH_TTY", "glimt is running over SSH"),
    ("VISUAL, EDITOR", "editor for the key `o`"),
    ("XDG_CACHE_HOME", "`bench` caches references in `glimt/references` inside this folder"),
    ("HOME", "without `XDG_CACHE_HOME`, the cache is inside `.cache` in this folder"),
    ("LANG", "whether progress bars may use non-ASCII characters"),
    ("GLIMT_SIMD", "`portable` or `avx2` limits the instruction set; slower, with identical results"),
    ("GLIMT_COMPLETE", "set by shell completion scripts: print candidates and exit"),
];

/// The `Environment` section of the help.
pub(super) fn help_section() -> String {
    let line = |(names, effect): &(&str, &str)| format!("\n  {names}\n          {}", effect.replace('`', ""));
    format!("Environment:{}", VARIABLES.iter().map(line).collect::<String>())
}
