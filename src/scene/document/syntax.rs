//! Errors of the TOML itself, in plain words.

use std::collections::BTreeSet;
use std::ops::Range;

use toml::de::Error;

use super::super::sanitize::shortened;
use super::context::{Context, Issue};

/// Reports the first error of each line; the others follow from it. Gives the lines, sorted.
pub(super) fn report(context: &Context<'_>, errors: &[Error]) -> Vec<usize> {
    const MOST_ERRORS: usize = 2_000;
    let mut lines = BTreeSet::new();
    let mut spans: Vec<(Range<usize>, &Error)> =
        errors.iter().take(MOST_ERRORS).map(|error| (error.span().unwrap_or(0..0), error)).collect();
    spans.sort_by_key(|(span, _)| span.start);
    for (span, error) in spans {
        if lines.insert(context.line(span.start)) {
            context.report(issue(context, span, error.message()));
        }
    }
    lines.into_iter().collect()
}

fn issue(context: &Context<'_>, span: Range<usize>, message: &str) -> Issue {
    let (what, expected) = match message.split_once(", expected ") {
        Some((what, expected)) => (what, Some(expected)),
        None => (message, None),
    };
    let written = shortened(context.text(&span), 40);
    let issue = match what {
        "duplicate key" => Issue::error(span, format!("`{written}` is given twice"))
            .label("the second time")
            .help("keep one of the two; a shape's header has double brackets, such as [[sphere]]"),
        what if what.contains("recurs") => {
            Issue::error(span, "arrays or tables are nested too deeply").help("a scene needs three levels")
        }
        what if what.contains("must be quoted") || what.starts_with("string values must") => {
            Issue::error(span, "a text must stand in quotes").label(format!("write \"{written}\""))
        }
        what => Issue::error(span, format!("this is not TOML: {what}")),
    };
    let issue = match expected {
        Some("nothing") => issue.help("remove it"),
        Some(expected) => issue.help(format!("expected {expected}")),
        None => issue,
    };
    issue.syntax()
}
