//! Reports TOML syntax errors in plain language.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::super::sanitize::escape_and_truncate;
use super::super::toml::{BracketToken, SyntaxError, find_all_array_brackets, innermost_bracket_open_at_end};
use super::context::{FileContext, Issue};

/// Reports only the first error on each line, because it usually causes the other errors on the line. Returns
/// the unreliable lines in order: lines with errors, and the lines after a broken header, because their keys
/// appear to belong to another table.
pub(super) fn report_errors_and_collect_broken_lines(
    context: &FileContext<'_>,
    mut errors: Vec<SyntaxError>,
) -> Vec<Range<usize>> {
    let lists = LazyBracketIndex { text: context.text_without_set_args(), brackets: OnceCell::new() };
    let (mut lines, mut firsts) = (BTreeSet::new(), Vec::new());
    errors.sort_by_key(|error| error.span.start);
    // The opening brackets of unclosed lists, indexed by line.
    let (mut in_open_array, mut opened) = (false, BTreeMap::new());
    for error in errors {
        let lacks_comma = error.what == MISSING_COMMA;
        let is_new =
            lines.insert(context.line_number_at_offset(error.span.start)) && !(lacks_comma && in_open_array);
        in_open_array = lacks_comma;
        if !is_new {
            continue;
        }
        match find_unclosed_bracket(context, &lists, &error) {
            // The parser treated all lines from the bracket to the error as part of the list.
            Some(open) => {
                lines.extend(
                    context.line_number_at_offset(open)..context.line_number_at_offset(error.span.start),
                );
                opened.insert(context.line_number_at_offset(open), open);
            }
            None => firsts.push(error),
        }
    }
    // The parser does not report an unclosed list at the end of the file. Skip this check if lists are nested
    // too deeply, because the list may be closed after all.
    if let Some(open) = last_unclosed_bracket(context.text_without_set_args())
        .filter(|_| !firsts.iter().any(is_nesting_limit_error))
    {
        lines.insert(context.line_number_at_offset(open));
        opened.insert(context.line_number_at_offset(open), open);
    }
    for error in firsts {
        // Ignore errors after an unclosed bracket on the same line.
        let open = opened.get(&context.line_number_at_offset(error.span.start));
        if open.is_none_or(|open| error.span.start < *open) {
            context.report(syntax_issue(context, &lists, error).marked_as_syntax_error());
        }
    }
    for open in opened.into_values() {
        let issue = Issue::error(open..open + 1, "`[` opened here is not closed");
        context.report(issue.with_help(unclosed_list_help(context, open)).marked_as_syntax_error());
    }
    lines.into_iter().map(|line| line..first_line_unaffected_by_error(context, line)).collect()
}

/// The array brackets in a text with syntax errors, found on first use.
struct LazyBracketIndex<'a> {
    text: &'a str,
    brackets: OnceCell<Vec<BracketToken>>,
}

impl LazyBracketIndex<'_> {
    /// Returns the opening bracket of the innermost list that is open at byte `end`.
    fn enclosing_open_bracket(&self, end: usize) -> Option<usize> {
        let all = self.brackets.get_or_init(|| find_all_array_brackets(self.text));
        innermost_bracket_open_at_end(&all[..all.partition_point(|bracket| bracket.at < end)])
    }
}

const MISSING_COMMA: &str = "missing comma between array elements";

/// Finds the unclosed bracket that caused an error because its list extends into a line with a key or a
/// header.
fn find_unclosed_bracket(
    context: &FileContext<'_>,
    lists: &LazyBracketIndex<'_>,
    SyntaxError { span, what, .. }: &SyntaxError,
) -> Option<usize> {
    if what == "unclosed array" {
        let is_bracket = context.span_text(&(span.start..span.end)).starts_with('[');
        return if is_bracket { Some(span.start) } else { lists.enclosing_open_bracket(span.end) };
    }
    let open = lists.enclosing_open_bracket(span.start)?;
    let line = context.line_text_by_number(context.line_number_at_offset(span.start))?.trim();
    let is_header = line.starts_with('[') && line.ends_with(']') && !line.contains([',', ' ']);
    let is_later = context.line_number_at_offset(open) < context.line_number_at_offset(span.start);
    (what == MISSING_COMMA && is_later && (starts_with_key(line) || is_header)).then_some(open)
}

fn is_nesting_limit_error(error: &SyntaxError) -> bool {
    error.what.contains("recurs")
}

/// Whether a line starts with a key and `=`.
fn starts_with_key(line: &str) -> bool {
    line.split_once('=').is_some_and(|(key, _)| !key.contains(['[', '{', ',', '\"', '#']))
}

/// Returns the opening bracket of a list that is still open at the end of the file. Examines only the text
/// from the last key on, because files may be long.
fn last_unclosed_bracket(text: &str) -> Option<usize> {
    let mut start = text.len();
    loop {
        let line = text[..start].rfind('\n').map_or(0, |end| end + 1);
        if starts_with_key(&text[line..start]) {
            return innermost_bracket_open_at_end(&find_all_array_brackets(&text[line..]))
                .map(|open| line + open);
        }
        start = line.checked_sub(1)?;
    }
}

/// Returns the help text for an unclosed list. The text shows the corrected list if the list consists of
/// numbers on one line.
fn unclosed_list_help(context: &FileContext<'_>, open: usize) -> String {
    let end = context
        .span_text(&(open..context.text_without_set_args().len()))
        .find('\n')
        .map_or(context.text_without_set_args().len(), |at| open + at);
    match reformat_number_list(context.span_text(&(open + 1..end))) {
        Some(list) => format!("write {list}"),
        None => "expected `]`".to_owned(),
    }
}

/// Returns the message about missing commas in a single-line list. `at` is the position of the first missing
/// comma.
fn missing_commas_message(
    context: &FileContext<'_>,
    lists: &LazyBracketIndex<'_>,
    at: usize,
) -> Option<String> {
    let open = lists.enclosing_open_bracket(at)?;
    let line_start = context.span_text(&(0..at)).rfind('\n').map_or(0, |end| end + 1);
    let line = context.line_text_by_number(context.line_number_at_offset(at))?;
    let inner = line.get(open.checked_sub(line_start)? + 1..)?;
    let inner = &inner[..inner.find(']')?];
    let values = split_at_separators(inner);
    let is_plain = |value: &&str| !value.contains(['[', '{', '"', '\'', '#', '=']);
    let list = format_array_if_short(&values).filter(|_| values.iter().all(is_plain))?;
    let missing = (values.len() - 1).saturating_sub(inner.matches(',').count());
    let words = if missing > 1 { "commas are missing" } else { "a comma is missing" };
    Some(format!("{words}: write {list}"))
}

/// Returns an issue about a list of numbers in the wrong brackets, such as `(0, 1, 0)`, `{0, 1, 0}` or
/// `vec3(0, 1, 0)`.
fn wrong_brackets_issue(context: &FileContext<'_>, at: usize) -> Option<Issue> {
    let line = context.line_text_by_number(context.line_number_at_offset(at))?;
    let line_start = context.span_text(&(0..at)).rfind('\n').map_or(0, |end| end + 1);
    let (key, after) = line.split_once('=').filter(|_| starts_with_key(line))?;
    let value = after.split('#').next()?.trim();
    let name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let inner = value.trim_start_matches(name).strip_prefix(['(', '{', '<'])?;
    let list = reformat_number_list(inner)?;
    let start = line_start + key.len() + 1 + after.find(value)?;
    let issue = Issue::error(start..start + value.len(), format!("lists use square brackets: write {list}"));
    Some(issue)
}

/// Formats numbers with any separators as a list, ignoring a closing bracket.
fn reformat_number_list(text: &str) -> Option<String> {
    let text = text.split('#').next().unwrap_or_default().trim();
    let values = split_at_separators(text.strip_suffix([']', ')', '}', '>']).unwrap_or(text));
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    let is_number = |value: &&str| {
        let digits = value.trim_start_matches(['+', '-']);
        value.parse::<f64>().is_ok()
            && is_digit(digits.chars().next())
            && is_digit(digits.chars().next_back())
    };
    format_array_if_short(&values).filter(|_| values.iter().all(is_number))
}

/// Splits at commas, semicolons and whitespace.
fn split_at_separators(text: &str) -> Vec<&str> {
    text.split([',', ';', ' ', '\t']).map(str::trim).filter(|value| !value.is_empty()).collect()
}

/// Formats at least two values as a list. Returns `None` for fewer values or if the list would be long.
fn format_array_if_short(values: &[&str]) -> Option<String> {
    const MAX_LENGTH: usize = 60;
    let list = format!("[{}]", values.join(", "));
    (values.len() > 1 && list.len() <= MAX_LENGTH).then_some(list)
}

/// Returns the first line not affected by an error in `line`: the next header if `line` is a broken header,
/// otherwise the next line.
fn first_line_unaffected_by_error(context: &FileContext<'_>, line: usize) -> usize {
    let is_header =
        |line: usize| context.line_text_by_number(line).map(|text| text.trim_start().starts_with('['));
    if is_header(line) != Some(true) {
        return line + 1;
    }
    (line + 1..).find(|next| is_header(*next) != Some(false)).unwrap_or(usize::MAX)
}

/// Returns the text of the number that contains `span`.
fn number_text_at<'c>(context: &'c FileContext<'_>, span: &Range<usize>) -> &'c str {
    let is_of_number = |text: &str| text.starts_with(|c: char| c.is_ascii_digit() || "+-._eE".contains(c));
    let (mut start, mut end) = (span.start, span.end);
    while start > 0 && is_of_number(context.span_text(&(start - 1..start))) {
        start -= 1;
    }
    while is_of_number(context.span_text(&(end..end + 1))) {
        end += 1;
    }
    context.span_text(&(start..end))
}

/// Adds missing digits before or after the decimal point. Returns `None` if no digit is missing or the result
/// is not a number.
fn add_missing_digits(number: &str) -> Option<String> {
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

fn syntax_issue(context: &FileContext<'_>, lists: &LazyBracketIndex<'_>, error: SyntaxError) -> Issue {
    let is_deep = is_nesting_limit_error(&error);
    let SyntaxError { span, what, expected } = error;
    if let Some(issue) = wrong_brackets_issue(context, span.start) {
        return issue;
    }
    let expected = expected.unwrap_or_default();
    let written = escape_and_truncate(context.span_text(&span), 40);
    let error = |words: &str| Issue::error(span.clone(), words);
    match what.as_str() {
        "duplicate key" => Issue::error(span, format!("`{written}` is defined twice"))
            .with_label("second definition")
            .with_help("remove one of them; headers of shapes have double brackets, such as [[sphere]]"),
        MISSING_COMMA => match missing_commas_message(context, lists, span.start) {
            Some(words) => error(&words),
            None => error("a comma is missing").with_help("expected `,` or the closing `]`"),
        },
        "unclosed array" => error("this list is not closed").with_help("expected `]`"),
        "unclosed table" | "unclosed array table" => {
            error("this header is not closed").with_help(format!("expected {expected}"))
        }
        "invalid mantissa" | "invalid fraction" | "invalid exponent" => {
            let help = match add_missing_digits(number_text_at(context, &span)) {
                Some(number) => format!("write {number}"),
                None => "write 0.5, 5.0 and 1e3".to_owned(),
            };
            error("digits are missing in this number").with_help(help)
        }
        "unexpected key or value" => error("unexpected text after the value")
            .with_help("expected the end of the line; put several numbers in brackets, such as [0, 1, 0]"),
        "key with no value" => error("this key has no value").with_help("expected `=`"),
        "invalid unquoted key" if written.starts_with("//") => {
            error("this is not a key").with_help("comments start with #")
        }
        what if what.ends_with("basic string") || what.ends_with("literal string") => {
            error("this string is not closed").with_help(format!("expected a closing {expected}"))
        }
        _ if is_deep => {
            error("arrays or tables are nested too deeply").with_help("scenes need at most three levels")
        }
        what if what.contains("must be quoted") => match missing_commas_message(context, lists, span.start) {
            Some(words) => error(&words),
            None => invalid_value_issue(span, &written),
        },
        what => {
            let issue = Issue::error(span, format!("this is not TOML: {what}"));
            match expected.as_str() {
                "" => issue,
                "nothing" => issue.with_help("remove it"),
                expected => issue.with_help(format!("expected {expected}")),
            }
        }
    }
}

/// Error message for a key without a value.
pub(crate) const MISSING_VALUE: &str = "a value is missing";

/// Returns an issue about a missing value, an invalid number or an unquoted string.
fn invalid_value_issue(span: Range<usize>, written: &str) -> Issue {
    const VALUES: &str = "expected a number, true, false, a quoted string, or values in brackets";
    if written.trim().is_empty() {
        return Issue::error(span, MISSING_VALUE).with_help(VALUES);
    }
    if written.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) {
        return Issue::error(span, format!("`{written}` is not a number")).with_help(VALUES);
    }
    Issue::error(span, "strings must be quoted").with_label(format!("write \"{written}\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_digits_are_added() {
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
            assert_eq!(add_missing_digits(number).as_deref(), whole, "{number}");
        }
    }
}
