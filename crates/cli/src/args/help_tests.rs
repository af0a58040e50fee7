//! Layout tests for `-h` and `--help`.

use clap::CommandFactory;

use super::Args;

/// The program's short help and each command's short and long help, wrapped to `columns`.
fn help_texts(columns: usize) -> Vec<(String, String)> {
    let mut all = Args::command().term_width(columns);
    all.build();
    let mut helps = vec![("glimt".to_owned(), all.render_help().to_string())];
    for command in all.get_subcommands_mut() {
        let name = command.get_name().to_owned();
        let texts = [command.render_help(), command.render_long_help()];
        helps.extend(texts.map(|text| (name.clone(), text.to_string())));
    }
    helps
}

#[test]
fn help_fits_the_requested_width() {
    for columns in [80, 100, 140] {
        for (name, help) in help_texts(columns) {
            // The usage line is not wrapped.
            for line in help.lines().filter(|line| !line.starts_with("Usage:")) {
                assert!(line.chars().count() <= columns, "{name} at {columns}: {line}");
            }
        }
    }
}

/// Checks that lines break only where the next word does not fit.
#[test]
fn help_lines_break_only_when_full() {
    for columns in [80, 100, 140] {
        for (name, help) in help_texts(columns) {
            let lines: Vec<&str> = help.lines().collect();
            for pair in lines.windows(2) {
                let [line, next] = [pair[0], pair[1]];
                let is_text = |line: &str| line.starts_with(|c: char| c.is_alphanumeric() || c == '|');
                if !is_text(line) || !is_text(next) || line.ends_with(':') {
                    continue;
                }
                let word = next.split(' ').next().unwrap_or_default();
                let is_full = line.chars().count() + 1 + word.chars().count() > columns;
                assert!(is_full, "{name} at {columns}: {line:?} then {next:?}");
            }
        }
    }
}
