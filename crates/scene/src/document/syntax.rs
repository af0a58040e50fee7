//! Errors of the TOML itself, in plain words.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::super::sanitize::shortened;
use super::super::toml::{Bracket, SyntaxError, brackets, last_open};
use super::context::{Context, Issue};

/// Reports the first error of each line; the others follow from it. Gives the lines that are not to be
/// trusted, in order: those with errors, and those under a broken header, whose keys seem to be another
/// table's.
pub(super) fn report(context: &Context<'_>, mut errors: Vec<SyntaxError>) -> Vec<Range<usize>> {
    let lists = Lists { text: context.file(), brackets: OnceCell::new() };
    let (mut lines, mut firsts) = (BTreeSet::new(), Vec::new());
    errors.sort_by_key(|error| error.span.start);
    // Lists that are not closed, by their lines.
    let (mut in_open_array, mut opened) = (false, BTreeMap::new());
    for error in errors {
        let lacks_comma = error.what == MISSING_COMMA;
        let is_new = lines.insert(context.line(error.span.start)) && !(lacks_comma && in_open_array);
        in_open_array = lacks_comma;
        if !is_new {
            continue;
        }
        match unclosed(context, &lists, &error) {
            // All that follows up to here was taken for a part of the list.
            Some(open) => {
                lines.extend(context.line(open)..context.line(error.span.start));
                opened.insert(context.line(open), open);
            }
            None => firsts.push(error),
        }
    }
    // The parser takes the end of the file for the end of a list. Of one that is too deep it does not look for the end.
    if let Some(open) = open_at_end(context.file()).filter(|_| !firsts.iter().any(is_too_deep)) {
        lines.insert(context.line(open));
        opened.insert(context.line(open), open);
    }
    for error in firsts {
        // What stands after an open bracket in its line follows from it.
        let open = opened.get(&context.line(error.span.start));
        if open.is_none_or(|open| error.span.start < *open) {
            context.report(issue(context, &lists, error).syntax());
        }
    }
    for open in opened.into_values() {
        let issue = Issue::error(open..open + 1, "`[` opened here is not closed");
        context.report(issue.help(closed(context, open)).syntax());
    }
    lines.into_iter().map(|line| line..end_of_damage(context, line)).collect()
}

/// The lists of a broken text.
struct Lists<'a> {
    text: &'a str,
    brackets: OnceCell<Vec<Bracket>>,
}

impl Lists<'_> {
    /// The bracket of the innermost list that is open at a byte.
    fn open_at(&self, end: usize) -> Option<usize> {
        let all = self.brackets.get_or_init(|| brackets(self.text));
        last_open(&all[..all.partition_point(|bracket| bracket.at < end)])
    }
}

const MISSING_COMMA: &str = "missing comma between array elements";

/// The place of the bracket that an error follows from, as its list is not closed: what stands in a later line is a key or
/// a header.
fn unclosed(
    context: &Context<'_>,
    lists: &Lists<'_>,
    SyntaxError { span, what, .. }: &SyntaxError,
) -> Option<usize> {
    if what == "unclosed array" {
        let is_bracket = context.text(&(span.start..span.end)).starts_with('[');
        return if is_bracket { Some(span.start) } else { lists.open_at(span.end) };
    }
    let open = lists.open_at(span.start)?;
    let line = context.line_text(context.line(span.start))?.trim();
    let is_header = line.starts_with('[') && line.ends_with(']') && !line.contains([',', ' ']);
    let is_later = context.line(open) < context.line(span.start);
    (what == MISSING_COMMA && is_later && (is_key(line) || is_header)).then_some(open)
}

fn is_too_deep(error: &SyntaxError) -> bool {
    error.what.contains("recurs")
}

/// Whether a line begins with a key and its `=`.
fn is_key(line: &str) -> bool {
    line.split_once('=').is_some_and(|(key, _)| !key.contains(['[', '{', ',', '\"', '#']))
}

/// The place of a list that the file ends in, found from the last line that begins with a key on: the text may be long.
fn open_at_end(text: &str) -> Option<usize> {
    let mut start = text.len();
    loop {
        let line = text[..start].rfind('\n').map_or(0, |end| end + 1);
        if is_key(&text[line..start]) {
            return last_open(&brackets(&text[line..])).map(|open| line + open);
        }
        start = line.checked_sub(1)?;
    }
}

/// Way to close a list: all of the list, if it holds numbers in one line.
fn closed(context: &Context<'_>, open: usize) -> String {
    let end =
        context.text(&(open..context.file().len())).find('\n').map_or(context.file().len(), |at| open + at);
    match of_numbers(context.text(&(open + 1..end))) {
        Some(list) => format!("write {list}"),
        None => "expected `]`".to_owned(),
    }
}

/// Issue about missing commas between the values of a list in one line; `at` is the place of the first.
fn with_commas(context: &Context<'_>, lists: &Lists<'_>, at: usize) -> Option<String> {
    let open = lists.open_at(at)?;
    let line_start = context.text(&(0..at)).rfind('\n').map_or(0, |end| end + 1);
    let line = context.line_text(context.line(at))?;
    let inner = line.get(open.checked_sub(line_start)? + 1..)?;
    let inner = &inner[..inner.find(']')?];
    let values = values(inner);
    let is_plain = |value: &&str| !value.contains(['[', '{', '"', '\'', '#', '=']);
    let list = listed(&values).filter(|_| values.iter().all(is_plain))?;
    let missing = (values.len() - 1).saturating_sub(inner.matches(',').count());
    let words = if missing > 1 { "commas are missing" } else { "a comma is missing" };
    Some(format!("{words}: write {list}"))
}

/// Issue about numbers in one line in other brackets: `(0, 1, 0)`, `{0, 1, 0}`, `vec3(0, 1, 0)`.
fn in_other_brackets(context: &Context<'_>, at: usize) -> Option<Issue> {
    let line = context.line_text(context.line(at))?;
    let line_start = context.text(&(0..at)).rfind('\n').map_or(0, |end| end + 1);
    let (key, after) = line.split_once('=').filter(|_| is_key(line))?;
    let value = after.split('#').next()?.trim();
    let name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let inner = value.trim_start_matches(name).strip_prefix(['(', '{', '<'])?;
    let list = of_numbers(inner)?;
    let start = line_start + key.len() + 1 + after.find(value)?;
    let issue = Issue::error(start..start + value.len(), format!("a list stands in brackets: write {list}"));
    Some(issue)
}

/// The list that is meant by numbers apart from each other, with or without a bracket of any kind at their end.
fn of_numbers(text: &str) -> Option<String> {
    let text = text.split('#').next().unwrap_or_default().trim();
    let values = values(text.strip_suffix([']', ')', '}', '>']).unwrap_or(text));
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    let is_number = |value: &&str| {
        let digits = value.trim_start_matches(['+', '-']);
        value.parse::<f64>().is_ok()
            && is_digit(digits.chars().next())
            && is_digit(digits.chars().next_back())
    };
    listed(&values).filter(|_| values.iter().all(is_number))
}

/// Values between commas, semicolons and spaces.
fn values(text: &str) -> Vec<&str> {
    text.split([',', ';', ' ', '\t']).map(str::trim).filter(|value| !value.is_empty()).collect()
}

/// Several values as a list, if it is short.
fn listed(values: &[&str]) -> Option<String> {
    const LONGEST: usize = 60;
    let list = format!("[{}]", values.join(", "));
    (values.len() > 1 && list.len() <= LONGEST).then_some(list)
}

/// The line after the last one that suffers from an error in a line.
fn end_of_damage(context: &Context<'_>, line: usize) -> usize {
    let is_header = |line: usize| context.line_text(line).map(|text| text.trim_start().starts_with('['));
    if is_header(line) != Some(true) {
        return line + 1;
    }
    (line + 1..).find(|next| is_header(*next) != Some(false)).unwrap_or(usize::MAX)
}

/// The number around a place.
fn number_at<'c>(context: &'c Context<'_>, span: &Range<usize>) -> &'c str {
    let is_of_number = |text: &str| text.starts_with(|c: char| c.is_ascii_digit() || "+-._eE".contains(c));
    let (mut start, mut end) = (span.start, span.end);
    while start > 0 && is_of_number(context.text(&(start - 1..start))) {
        start -= 1;
    }
    while is_of_number(context.text(&(end..end + 1))) {
        end += 1;
    }
    context.text(&(start..end))
}

/// A number with the digits around its point that it lacks. `None` if that makes no number of it.
fn with_digits(number: &str) -> Option<String> {
    let unsigned = number.trim_start_matches(['+', '-']);
    let sign = &number[..number.len() - unsigned.len()];
    let end = unsigned.find(['e', 'E']).unwrap_or(unsigned.len());
    let (mantissa, exponent) = unsigned.split_at(end);
    let before = if mantissa.starts_with('.') { "0" } else { "" };
    let after = if mantissa.ends_with('.') { "0" } else { "" };
    let whole = format!("{sign}{before}{mantissa}{after}{exponent}");
    let has_digit = mantissa.contains(|c: char| c.is_ascii_digit());
    (has_digit && whole != number && whole.parse::<f64>().is_ok()).then_some(whole)
}

fn issue(context: &Context<'_>, lists: &Lists<'_>, error: SyntaxError) -> Issue {
    let is_deep = is_too_deep(&error);
    let SyntaxError { span, what, expected } = error;
    if let Some(issue) = in_other_brackets(context, span.start) {
        return issue;
    }
    let expected = expected.unwrap_or_default();
    let written = shortened(context.text(&span), 40);
    let error = |words: &str| Issue::error(span.clone(), words);
    match what.as_str() {
        "duplicate key" => Issue::error(span, format!("`{written}` is given twice"))
            .label("the second time")
            .help("keep one of the two; a shape's header has double brackets, such as [[sphere]]"),
        MISSING_COMMA => match with_commas(context, lists, span.start) {
            Some(words) => error(&words),
            None => error("a comma is missing").help("expected `,`, or `]` where the list ends"),
        },
        "unclosed array" => error("this list is not closed").help("expected `]`"),
        "unclosed table" | "unclosed array table" => {
            error("this header is not closed").help(format!("expected {expected}"))
        }
        "invalid mantissa" | "invalid fraction" | "invalid exponent" => {
            let help = match with_digits(number_at(context, &span)) {
                Some(number) => format!("write {number}"),
                None => "write 0.5, 5.0 and 1e3".to_owned(),
            };
            error("digits are missing in this number").help(help)
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
        _ if is_deep => error("arrays or tables are nested too deeply").help("a scene needs three levels"),
        what if what.contains("must be quoted") => match with_commas(context, lists, span.start) {
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

/// Issue about a text without quotes, which is no TOML value.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digits_that_a_number_lacks_are_written_for_it() {
        for (number, whole) in [
            (".3", Some("0.3")),
            ("-.5", Some("-0.5")),
            ("5.", Some("5.0")),
            (".5e3", Some("0.5e3")),
            ("5.e-3", Some("5.0e-3")),
            (".", None),
            ("1e", None),
            ("1.2.", None),
            ("", None),
        ] {
            assert_eq!(with_digits(number).as_deref(), whole, "{number}");
        }
    }
}
