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
    let (mut in_open_array, mut opened) = (false, BTreeSet::new());
    for error in errors {
        let lacks_comma = error.what == MISSING_COMMA;
        let is_new = lines.insert(context.line(error.span.start)) && !(lacks_comma && in_open_array);
        in_open_array = lacks_comma;
        if !is_new {
            continue;
        }
        match unclosed(context, &error) {
            // All that follows up to here was taken for a part of the list.
            Some(open) => {
                lines.extend(context.line(open)..context.line(error.span.start));
                opened.insert(open);
            }
            None => context.report(issue(context, error).syntax()),
        }
    }
    // The parser takes the end of the file for the end of a list.
    if let Some(open) = open_at_end(context.file()) {
        lines.insert(context.line(open));
        opened.insert(open);
    }
    for open in opened {
        let issue = Issue::error(open..open + 1, "`[` opened here is not closed");
        context.report(issue.help("expected `]`").syntax());
    }
    lines.into_iter().map(|line| line..end_of_damage(context, line)).collect()
}

const MISSING_COMMA: &str = "missing comma between array elements";

/// The place of the bracket that an error follows from, as its list is not closed: what stands in a later line is a key or
/// a header.
fn unclosed(context: &Context<'_>, SyntaxError { span, what, .. }: &SyntaxError) -> Option<usize> {
    let text = context.text(&(0..span.end));
    if what == "unclosed array" {
        return if text[span.start..].starts_with('[') { Some(span.start) } else { bracket_before(text) };
    }
    let open = bracket_before(&text[..span.start])?;
    let line = context.line_text(context.line(span.start))?.trim();
    let is_key = line.split_once('=').is_some_and(|(key, _)| !key.contains(['[', ',', '\"', '#']));
    let is_header = line.starts_with('[') && line.ends_with(']') && !line.contains([',', ' ']);
    let is_later = context.line(open) < context.line(span.start);
    (what == MISSING_COMMA && is_later && (is_key || is_header)).then_some(open)
}

/// The place of a list that the file ends in, if its last bracket is open and stands in no comment and no text.
fn open_at_end(text: &str) -> Option<usize> {
    let open = text.rfind('[').filter(|open| !text[*open..].contains(']'))?;
    let line = text[..open].rsplit('\n').next().unwrap_or_default();
    let is_value = line.contains('=') && !line.contains(['#', '"', '\'']);
    is_value.then_some(open)
}

/// The last bracket that is open at the end of a text.
fn bracket_before(text: &str) -> Option<usize> {
    let mut closed = 0_usize;
    for (at, bracket) in text.char_indices().rev().filter(|(_, c)| matches!(c, '[' | ']')) {
        match (bracket, closed) {
            ('[', 0) => return Some(at),
            ('[', _) => closed -= 1,
            (_, _) => closed += 1,
        }
    }
    None
}

/// What is said of a list in one line between whose values commas are missing; `at` is where the first one is missing.
fn with_commas(context: &Context<'_>, at: usize) -> Option<String> {
    const LONGEST: usize = 60;
    let before = context.text(&(0..at));
    let open = bracket_before(before)?;
    let line_start = before.rfind('\n').map_or(0, |end| end + 1);
    let line = context.line_text(context.line(at))?;
    let inner = line.get(open.checked_sub(line_start)? + 1..)?;
    let inner = &inner[..inner.find(']')?];
    let values: Vec<&str> =
        inner.split([',', ' ', '\t']).map(str::trim).filter(|value| !value.is_empty()).collect();
    let is_plain = |value: &&str| !value.contains(['[', '{', '"', '\'', '#', '=']);
    let list = format!("[{}]", values.join(", "));
    if values.len() < 2 || !values.iter().all(is_plain) || list.len() > LONGEST {
        return None;
    }
    let missing = (values.len() - 1).saturating_sub(inner.matches(',').count());
    let words = if missing > 1 { "commas are missing" } else { "a comma is missing" };
    Some(format!("{words}: write {list}"))
}

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
        MISSING_COMMA => match with_commas(context, span.start) {
            Some(words) => error(&words),
            None => error("a comma is missing").help("expected `,`, or `]` where the list ends"),
        },
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
        what if what.contains("must be quoted") => match with_commas(context, span.start) {
            Some(words) => error(&words),
            None => not_a_value(span, &written),
        },
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
