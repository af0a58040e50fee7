use std::cell::Cell;
use std::path::PathBuf;

use super::super::diagnostic::SourceSpan;
use super::*;

fn at(source: &Arc<str>, span: Range<usize>, label: &str) -> Diagnostic {
    Diagnostic {
        severity: Severity::Error,
        message: "`radius` must be greater than 0".to_owned(),
        path: PathBuf::from("a.toml"),
        place: Some(SourceSpan { source: Arc::clone(source), span, label: label.to_owned() }),
        help: Some("use a positive radius".to_owned()),
    }
}

#[test]
fn report_shows_position_source_label_and_help() {
    let source: Arc<str> = "# äöü\n[[sphere]]\nradius = -0.5\n".into();
    let text = render_diagnostics(&[at(&source, 27..31, "found -0.5")], 80, ReportStyle::Plain);
    let expected = "\
error: `radius` must be greater than 0
 --> a.toml:3:8
  |
3 | radius = -0.5
  |        ^^^^ found -0.5
  |
  = help: use a positive radius

1 error
";
    assert_eq!(text, expected);
}

#[test]
fn columns_count_characters() {
    let source: Arc<str> = "\tmö\u{1b}[31m = \"木\u{202e}\" nix\r\n".into();
    let start = source.find("nix").expect("there");
    let text = render_diagnostics(&[at(&source, start..start + 3, "here")], 80, ReportStyle::Plain);
    assert!(text.contains("a.toml:1:17\n"), "{text}");
    assert!(!text.contains(['\u{1b}', '\u{202e}', '\t', '\r']), "{text:?}");
    let mut rows = text.lines().skip(3);
    let (line, carets) = (rows.next().expect("source"), rows.next().expect("carets"));
    let width = |text: &str| unicode_width::UnicodeWidthStr::width(text);
    assert_eq!(
        width(&line[..line.find("nix").expect("there")]),
        width(&carets[..carets.find('^').expect("^")])
    );
}

#[test]
fn empty_labels_are_not_shown_as_notes() {
    let source: Arc<str> = format!("{}a", "[".repeat(100)).into();
    let text = render_diagnostics(&[at(&source, 100..101, "")], 60, ReportStyle::Plain);
    assert!(!text.contains("note"), "{text}");
    let text = render_diagnostics(&[at(&source, 100..101, "here")], 60, ReportStyle::Plain);
    assert!(text.contains("= note: here"), "{text}");
}

#[test]
fn diagnostics_are_sorted_and_counted() {
    let source: Arc<str> = "a = 1\nb = 2\n".into();
    let mut warning = at(&source, 0..1, "first");
    warning.severity = Severity::Warning;
    let text = render_diagnostics(&[at(&source, 6..7, "second"), warning], 80, ReportStyle::Plain);
    assert!(text.find("first") < text.find("second"), "{text}");
    assert!(text.ends_with("\n1 error, 1 warning\n"), "{text}");
    assert_eq!(render_diagnostics(&[], 80, ReportStyle::Plain), "");
}

#[test]
fn long_lines_are_cut_to_the_width() {
    let source: Arc<str> = format!("{} = oops{}", "x".repeat(3_000_000), " y".repeat(1_000_000)).into();
    let text = render_diagnostics(&[at(&source, 3_000_003..3_000_007, "here")], 60, ReportStyle::Plain);
    assert!(text.contains("a.toml:1:3000004\n"), "{text}");
    assert!(text.contains("oops"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 60), "{text}");
}

#[test]
fn multiline_and_empty_spans_are_underlined() {
    let source: Arc<str> = "a = [\n 1,\n]".into();
    assert!(
        render_diagnostics(&[at(&source, 4..11, "here")], 80, ReportStyle::Plain).contains("a.toml:1:5\n")
    );
    assert!(
        render_diagnostics(&[at(&source, 11..11, "here")], 80, ReportStyle::Plain).contains("a.toml:3:2\n")
    );
    let empty: Arc<str> = "".into();
    assert!(render_diagnostics(&[at(&empty, 0..0, "here")], 80, ReportStyle::Plain).contains("a.toml:1:1\n"));
    let marked: Arc<str> = "\u{feff}a = 1".into();
    assert!(
        render_diagnostics(&[at(&marked, 3..4, "here")], 80, ReportStyle::Plain).contains("a.toml:1:1\n")
    );
}

#[test]
fn long_messages_are_wrapped() {
    let source: Arc<str> = "a = 1\n".into();
    let mut long = at(&source, 0..1, "");
    long.message = "many words ".repeat(20).trim_end().to_owned();
    long.help = Some("more words ".repeat(20).trim_end().to_owned());
    let text = render_diagnostics(&[long], 50, ReportStyle::Plain);
    assert!(text.lines().all(|line| line.chars().count() <= 50), "{text}");
    assert_eq!(text.matches("many").count(), 20);
}

#[test]
fn lines_match_the_plain_report() {
    let source: Arc<str> = "radius = -0.5 # \u{1b}[31m\n".into();
    let diagnostics = [at(&source, 9..13, "found -0.5")];
    let lines = render_diagnostics_as_lines(&diagnostics, 80);
    let joined: Vec<String> =
        lines.iter().map(|line| line.iter().map(|piece| piece.text.as_str()).collect()).collect();
    assert_eq!(joined.join("\n") + "\n", render_diagnostics(&diagnostics, 80, ReportStyle::Plain));
    let role =
        |text: &str| lines.iter().flatten().find(|piece| piece.text.contains(text)).map(|piece| piece.role);
    assert_eq!(role("error"), Some(ReportTextRole::Error));
    assert_eq!(role("found"), Some(ReportTextRole::Error));
    assert_eq!(role("greater"), Some(ReportTextRole::Message));
    assert_eq!(role("a.toml:1:10"), Some(ReportTextRole::Text));
    assert_eq!(role("-->"), Some(ReportTextRole::Frame));
    assert!(render_diagnostics(&diagnostics, 80, ReportStyle::Ansi).contains("\u{1b}["));
}

#[test]
fn labels_are_never_cut() {
    let source: Arc<str> = "[[quad]]\nu = [0, 0, 0]\n".into();
    let label = "`u` and `v` are parallel, or one of them is 0, and so on, for as long as it takes to say it";
    let one = at(&source, 13..22, label);
    for width in [30, 59, 60, 61, 80, 106, 107, 108, 200] {
        let text = render_diagnostics(std::slice::from_ref(&one), width, ReportStyle::Plain);
        let rows: Vec<&str> = text.lines().collect();
        assert!(rows.iter().all(|row| row.chars().count() <= width), "{width}:\n{text}");
        let unwrapped = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(unwrapped.contains(label), "{width}:\n{text}");
        assert!(unwrapped.contains("^^^^^^^^^"), "{width}:\n{text}");
    }
    // If the label fits, it follows the carets.
    assert!(
        render_diagnostics(std::slice::from_ref(&one), 200, ReportStyle::Plain).contains("^^^^^^^^^ `u` and")
    );
    assert!(
        render_diagnostics_as_lines(std::slice::from_ref(&one), 60)
            .iter()
            .all(|line| { line.iter().map(|piece| piece.text.chars().count()).sum::<usize>() <= 60 })
    );
}

thread_local! {
    /// Number of bytes in which characters were counted.
    pub(super) static BYTES_READ: Cell<usize> = const { Cell::new(0) };
}

#[test]
fn locating_many_places_reads_the_text_once() {
    const COUNT: usize = 40_000;
    for is_one_line in [false, true] {
        let item = if is_one_line { "é = 1 " } else { "é = 1\n" };
        let text: Arc<str> = item.repeat(COUNT).into();
        BYTES_READ.set(0);
        let mut locator = LineColumnLocator::default();
        // Mistakes are not always in the order of the text.
        for index in (0..COUNT).rev() {
            let expected = if is_one_line { (1, 6 * index + 3) } else { (index + 1, 3) };
            assert_eq!(locator.locate(&text, index * item.len() + "é ".len()), expected);
            let most = text.len() + 2 * STEP * (COUNT - index);
            assert!(BYTES_READ.get() <= most, "{} bytes for {index}", BYTES_READ.get());
        }
    }
}

#[test]
fn columns_in_long_lines_count_characters() {
    let text: Arc<str> = format!("\u{feff}{}\n{}", "aé€🙂".repeat(700), "é".repeat(2 * STEP)).into();
    let mut locator = LineColumnLocator::default();
    for (offset, _) in text.char_indices() {
        let start = text[..offset].rfind('\n').map_or(0, |at| at + 1);
        let before = text[start..offset].trim_start_matches('\u{feff}').chars().count();
        let line = text[..offset].matches('\n').count() + 1;
        assert_eq!(locator.locate(&text, offset), (line, before + 1), "{offset}");
    }
    assert_eq!(locator.locate(&text, text.len()), (2, 2 * STEP + 1));
}

#[test]
fn locator_alternates_between_texts() {
    let texts: [Arc<str>; 2] = ["a\nbä\n\nc".into(), "\u{feff}x\r\ny".into()];
    let mut locator = LineColumnLocator::default();
    for round in 0..2 {
        for text in &texts {
            for offset in 0..=text.len() {
                let found = locator.locate(text, offset);
                assert_eq!(found, line_and_column(text, offset), "{text:?} at {offset}, round {round}");
            }
        }
    }
}
