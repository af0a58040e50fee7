//! Errors of the TOML itself, in plain words.

use std::collections::BTreeSet;
use std::ops::Range;

use super::super::sanitize::shortened;
use super::super::toml::SyntaxError;
use super::context::{Context, Issue};

/// Reports the first error of each line; the others follow from it. Gives the lines that are not to be
/// trusted, in order: those with errors, and those under a broken header, whose keys seem to be another
/// table's.
pub(super) fn report(context: &Context<'_>, mut errors: Vec<SyntaxError>) -> Vec<Range<usize>> {
    let mut lines = BTreeSet::new();
    errors.sort_by_key(|error| error.span.start);
    let mut in_open_array = false;
    for error in errors {
        let lacks_comma = error.what == MISSING_COMMA;
        if lines.insert(context.line(error.span.start)) && !(lacks_comma && in_open_array) {
            context.report(issue(context, error).syntax());
        }
        in_open_array = lacks_comma;
    }
    lines.into_iter().map(|line| line..end_of_damage(context, line)).collect()
}

const MISSING_COMMA: &str = "missing comma between array elements";

/// The line after the last one that suffers from an error in a line.
fn end_of_damage(context: &Context<'_>, line: usize) -> usize {
    let is_header = |line: usize| context.line_text(line).map(|text| text.trim_start().starts_with('['));
    if is_header(line) != Some(true) {
        return line + 1;
    }
    (line + 1..).find(|next| is_header(*next) != Some(false)).unwrap_or(usize::MAX)
}

fn issue(context: &Context<'_>, SyntaxError { span, what, expected }: SyntaxError) -> Issue {
    let expected = expected.unwrap_or_default();
    let written = shortened(context.text(&span), 40);
    let error = |words: &str| Issue::error(span.clone(), words);
    match what.as_str() {
        "duplicate key" => Issue::error(span, format!("`{written}` is given twice"))
            .label("the second time")
            .help("keep one of the two; a shape's header has double brackets, such as [[sphere]]"),
        MISSING_COMMA => error("a comma is missing").help("expected `,`, or `]` where the list ends"),
        "unclosed array" => error("this list is not closed").help("expected `]`"),
        "unclosed table" | "unclosed array table" => {
            error("this header is not closed").help(format!("expected {expected}"))
        }
        "invalid mantissa" | "invalid fraction" | "invalid exponent" => {
            error("digits are missing in this number").help("write 0.5, 5.0 and 1e3")
        }
        "unexpected key or value" => error("there is more on this line than one value")
            .help("expected the end of the line; several numbers stand in brackets, such as [0, 1, 0]"),
        "key with no value" => error("a key without a value").help("expected `=`"),
        "invalid unquoted key" if written.starts_with("//") => {
            error("this is not a key").help("comments begin with #")
        }
        what if what.ends_with("basic string") || what.ends_with("literal string") => {
            error("this text is not closed").help(format!("expected {expected} at its end"))
        }
        what if what.contains("recurs") => {
            error("arrays or tables are nested too deeply").help("a scene needs three levels")
        }
        what if what.contains("must be quoted") => not_a_value(span, &written),
        what => {
            let issue = Issue::error(span, format!("this is not TOML: {what}"));
            match expected.as_str() {
                "" => issue,
                "nothing" => issue.help("remove it"),
                expected => issue.help(format!("expected {expected}")),
            }
        }
    }
}

/// What TOML takes for a text without quotes.
fn not_a_value(span: Range<usize>, written: &str) -> Issue {
    const VALUES: &str = "expected a number, true or false, a text in quotes, or values in brackets";
    if written.trim().is_empty() {
        return Issue::error(span, "a value is missing").help(VALUES);
    }
    if written.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) {
        return Issue::error(span, format!("`{written}` is not a number")).help(VALUES);
    }
    Issue::error(span, "a text must stand in quotes").label(format!("write \"{written}\""))
}
