//! Help and key descriptions fill the width of the terminal.

use crate::test_dir::{PROGRAM, TestDir};

/// Columns of a terminal that is wider than every paragraph.
const WIDE: u16 = 2000;

/// Key descriptions: the list of tables, a table, a type and a key.
const EXPLAIN_ARGUMENTS: [&str; 4] = ["", "camera", "materials.metal", "render.integrator"];

/// Arguments for each invocation under test: the short help of the program and of each command, and the key
/// descriptions.
fn invocations(folder: &TestDir) -> Vec<String> {
    let program = lines(folder, "-h", WIDE);
    let list =
        program.split(|line| line == "Commands:").nth(1).and_then(|rest| rest.split(String::is_empty).next());
    let names = list.expect("a list of commands").iter().filter_map(|line| line.split_whitespace().next());
    let commands = names.filter(|name| *name != "help").map(|name| format!("{name} -h"));
    let described = EXPLAIN_ARGUMENTS.iter().map(|path| format!("explain {path}"));
    ["-h".to_owned()].into_iter().chain(commands).chain(described).collect()
}

/// Prints the output of `glimt CALL` on a terminal with this many columns. Returns its lines.
fn lines(folder: &TestDir, call: &str, columns: u16) -> Vec<String> {
    let script = format!("\"$0\" {call}; echo \"exit code $?\"");
    let mut terminal =
        folder.sized_terminal(&["sh", "-c", &script, PROGRAM], &[("NO_COLOR", "1")], (columns, 400));
    assert_eq!(terminal.code(), 0, "{call}");
    let text = || String::from_utf8_lossy(&terminal.bytes()).into_owned();
    terminal.wait("the exit code", |_| {
        text().split_once("exit code ").is_some_and(|(_, code)| code.ends_with('\n'))
    });
    let text = text();
    assert!(!text.contains('\u{1b}'), "{call}: escape sequence with NO_COLOR");
    let (text, code) = text.split_once("exit code ").expect("the output is complete");
    assert_eq!(code.trim(), "0", "{call}: {text}");
    text.lines().map(|line| line.trim_end().to_owned()).collect()
}

fn width(text: &str) -> usize {
    text.chars().count()
}

/// The separator before a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    /// A space between two words of a paragraph.
    Space,
    /// At least two spaces, as between an option and its description.
    Gap,
    /// A line break, after a line of the given width.
    LineBreak(usize),
}

/// All words with the separators before them.
fn words(lines: &[String]) -> Vec<(Separator, &str)> {
    let mut words = Vec::new();
    let mut before = 0;
    for line in lines {
        let mut separator = Separator::LineBreak(before);
        for word in line.trim_start().split(' ') {
            if word.is_empty() {
                separator = Separator::Gap;
                continue;
            }
            words.push((separator, word));
            separator = Separator::Space;
        }
        before = width(line);
    }
    words
}

#[test]
fn help_is_not_wider_than_the_terminal() {
    let folder = TestDir::with_board();
    for call in invocations(&folder) {
        for columns in [50, 100] {
            for line in lines(&folder, &call, columns) {
                // The usage line is not wrapped.
                let fits = line.starts_with("Usage:") || width(&line) <= usize::from(columns);
                assert!(fits, "{call} at {columns}: {line}");
            }
        }
    }
}

#[test]
fn help_breaks_lines_only_where_they_are_full() {
    let folder = TestDir::with_board();
    let mut wrapped_lines = 0;
    for call in invocations(&folder) {
        let wide = lines(&folder, &call, WIDE);
        let paragraphs = words(&wide);
        for columns in [50, 100] {
            let narrow = lines(&folder, &call, columns);
            let wrapped = words(&narrow);
            let texts = |words: &[(Separator, &str)]| {
                words.iter().map(|(_, word)| *word).collect::<Vec<_>>().join(" ")
            };
            assert_eq!(texts(&wrapped), texts(&paragraphs), "{call} at {columns}");
            let mut breaks = 0;
            for ((before, word), (unwrapped, _)) in wrapped.into_iter().zip(&paragraphs) {
                let (Separator::LineBreak(length), Separator::Space) = (before, unwrapped) else { continue };
                assert!(
                    length + 1 + width(word) > usize::from(columns),
                    "{call} at {columns}: break before {word:?}"
                );
                breaks += 1;
            }
            wrapped_lines += breaks;
        }
    }
    assert!(wrapped_lines > 100, "{wrapped_lines}");
}

/// Byte offsets of a line's text and, if the text contains a gap, of the description after the gap.
fn text_columns(line: &str) -> [Option<usize>; 2] {
    let text = line.trim_start();
    let description = text.split_once("  ").map(|(_, rest)| line.len() - rest.trim_start().len());
    [(!text.is_empty()).then(|| line.len() - text.len()), description]
}

#[test]
fn paragraphs_are_single_lines_on_wide_terminals() {
    let folder = TestDir::with_board();
    for call in invocations(&folder) {
        let wide = lines(&folder, &call, WIDE);
        for pair in wide.windows(2) {
            let [line, next] = [pair[0].as_str(), pair[1].as_str()];
            let text = next.trim_start();
            let is_continuation = text_columns(line).contains(&Some(next.len() - text.len()))
                && !text.contains("  ")
                && text.starts_with(|c: char| c.is_lowercase());
            assert!(!is_continuation, "{call}: {line:?} continues with {next:?}");
        }
    }
}
