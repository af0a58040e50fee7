//! Checks the option tables against the program's help.

use std::collections::BTreeSet;

use super::{codes, page, pages};
use crate::test_dir::TestDir;

fn help(command: &str) -> String {
    let output = TestDir::new().run(&format!("{command} --help"));
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// The long options in a help text, except `--help` and `--version`. Descriptions are recognized by their
/// indentation.
fn listed(help: &str) -> BTreeSet<String> {
    let lines = help.lines().filter(|line| !line.starts_with("        ")).map(str::trim_start);
    let words = lines
        .filter(|line| line.starts_with('-'))
        .filter_map(|line| line.split([' ', ',']).find(|word| word.starts_with("--")));
    without_common(words.map(str::to_owned))
}

fn without_common(options: impl Iterator<Item = String>) -> BTreeSet<String> {
    options.filter(|option| option != "--help" && option != "--version").collect()
}

#[test]
fn option_tables_match_the_help() {
    let page = page("docs/command-line.md");
    for (heading, command) in [
        ("Render options", ""),
        ("Options for check", "check"),
        ("Options for info", "info"),
        ("Options for new", "new"),
        ("Options for schema", "schema"),
        ("Options for compare", "compare"),
        ("Options for bench", "bench"),
        ("Options for merge", "merge"),
        ("Options for farm", "farm"),
    ] {
        let rows = page.rows(heading);
        let cells = rows.iter().flat_map(|row| codes(&row[0]));
        let options = cells.filter_map(|code| Some(code.split_whitespace().next()?.to_owned()));
        let documented = without_common(options.filter(|option| option.starts_with("--")));
        assert_eq!(documented, listed(&help(command)), "{heading}");
    }
}

#[test]
fn every_command_is_documented() {
    let help = help("");
    let commands = help.split("Commands:\n").nth(1).and_then(|rest| rest.split("\n\n").next());
    // A command's description may continue on the next line, with more indentation.
    let lines = commands.expect("commands").lines().filter(|line| !line.starts_with("   "));
    let names = lines.filter_map(|line| line.split_whitespace().next());
    let rows = page("docs/command-line.md").rows("Commands");
    for name in names {
        let is_there = rows.iter().any(|row| row[0].starts_with(&format!("`glimt {name}")));
        assert!(is_there, "{name}");
    }
}

#[test]
fn every_option_value_is_documented() {
    let documented: BTreeSet<String> =
        pages().iter().flat_map(|page| page.prose().flat_map(codes).collect::<Vec<_>>()).collect();
    let plain = |code: &String| code.trim_matches('"').to_owned();
    let documented: BTreeSet<String> = documented.iter().map(plain).collect();
    for command in ["", "schema", "compare", "bench", "merge", "farm"] {
        let help = help(command);
        let values = help.lines().filter_map(|line| line.trim_start().strip_prefix("- ")?.split_once(':'));
        for (value, _) in values {
            assert!(documented.contains(value), "{command}: {value}");
        }
    }
}

#[test]
fn environment_variables_are_documented() {
    let rows = page("docs/command-line.md").rows("Environment variables");
    let listed = glimt::cli::environment::VARIABLES;
    let expected = listed.map(|(names, effect)| {
        let names: Vec<String> = names.split(", ").map(|name| format!("`{name}`")).collect();
        vec![names.join(", "), effect.to_owned()]
    });
    assert_eq!(rows, expected);
}
