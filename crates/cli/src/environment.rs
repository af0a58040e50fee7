//! Environment variables used by glimt, with descriptions for the help, the manual page and the
//! documentation.

/// Comma-separated names of related variables, and their effect.
pub const VARIABLES: [(&str, &str); 14] = [
    ("NO_COLOR", "no colors, unless `--color` is given"),
    ("CLICOLOR, CLICOLOR_FORCE, COLUMNS", "colors (0: off, 1: on without a terminal) and width of the help"),
    ("COLORTERM, TERM, TERM_PROGRAM", "colors and block characters of the terminal"),
    (
        "TERM_PROGRAM_VERSION, VTE_VERSION, KONSOLE_VERSION, XTERM_VERSION",
        "version of the terminal, which determines support for progress, links and notifications",
    ),
    ("WT_SESSION, ConEmuANSI, LC_TERMINAL, LC_TERMINAL_VERSION", "the same, for other terminals"),
    ("COLORFGBG", "whether the background is light"),
    ("TMUX, STY", "glimt runs in tmux or screen"),
    ("SSH_CONNECTION, SSH_CLIENT, SSH_TTY", "glimt runs over SSH"),
    ("VISUAL, EDITOR", "editor for the key `o`"),
    ("XDG_CACHE_HOME", "`bench` caches references in its folder `glimt/references`"),
    ("HOME", "without `XDG_CACHE_HOME`, that folder is in `.cache` of the home folder"),
    ("LANG", "whether progress bars may use non-ASCII characters"),
    ("GLIMT_SIMD", "`portable` or `avx2` limits the instruction set; slower, with identical results"),
    ("GLIMT_COMPLETE", "set by shell completion scripts: print candidates and exit"),
];

/// The `Environment` section of the help.
pub(super) fn help_section() -> String {
    let line = |(names, effect): &(&str, &str)| format!("\n  {names}\n          {}", effect.replace('`', ""));
    format!("Environment:{}", VARIABLES.iter().map(line).collect::<String>())
}
