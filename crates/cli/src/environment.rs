//! Environment variables that the program reads, with their effects: the one list of them, for the help, the man page and the pages.

/// Names that belong together, separated by commas, and their effect.
pub const VARIABLES: [(&str, &str); 14] = [
    ("NO_COLOR", "no colors, unless `--color` asks for them"),
    ("CLICOLOR, CLICOLOR_FORCE, COLUMNS", "colors (0: none, 1: also without a terminal) and width of help"),
    ("COLORTERM, TERM, TERM_PROGRAM", "which colors and blocks the terminal has"),
    (
        "TERM_PROGRAM_VERSION, VTE_VERSION, KONSOLE_VERSION, XTERM_VERSION",
        "which version it has, and so whether it shows progress, links and notifications",
    ),
    ("WT_SESSION, ConEmuANSI, LC_TERMINAL, LC_TERMINAL_VERSION", "the same, of other terminals"),
    ("COLORFGBG", "whether its background is light"),
    ("TMUX, STY", "glimt is in tmux or screen"),
    ("SSH_CONNECTION, SSH_CLIENT, SSH_TTY", "the shell came over SSH"),
    ("VISUAL, EDITOR", "the editor of the key `o`"),
    ("XDG_CACHE_HOME", "references of `bench` are kept in its folder `glimt/references`"),
    ("HOME", "without `XDG_CACHE_HOME`, that folder is below its `.cache`"),
    ("LANG", "whether the progress bars may have characters beyond ASCII"),
    ("GLIMT_SIMD", "`portable` or `avx2` asks for less than the processor has; the same bits, more slowly"),
    ("GLIMT_COMPLETE", "set by the shell's completions alone: print candidates and end"),
];

/// The section of the help.
pub(super) fn section() -> String {
    let line = |(names, effect): &(&str, &str)| format!("\n  {names}\n          {}", effect.replace('`', ""));
    format!("Environment:{}", VARIABLES.iter().map(line).collect::<String>())
}
