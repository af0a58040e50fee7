//! Applies `--set` values to a document.

use super::super::keys::find_table;
use super::super::keys::key::TableSyntax;
use super::super::nearest::nearest_name;
use super::super::sanitize::escape_and_truncate;
use super::super::source::SceneText;
use super::super::toml::{Document, KeyError, KeyErrorKind, TableKindPredicates, apply_assignment};
use super::context::{FileContext, Issue};

/// The scene keys that are groups of named tables or lists of tables.
const LAYOUT: TableKindPredicates = TableKindPredicates {
    is_group: |name| is_known_table_of_form(name, TableSyntax::Named),
    is_list: is_table_list_path,
};

fn is_table_list_path(path: &[&str]) -> bool {
    match path {
        [name] => is_known_table_of_form(name, TableSyntax::List),
        [group, _, name] => find_table(group).is_some_and(|info| info.find_inner_table(name).is_some()),
        _ => false,
    }
}

fn is_known_table_of_form(name: &str, form: TableSyntax) -> bool {
    find_table(name).is_some_and(|info| info.form == form)
}

/// Applies all `--set` values and reports keys that cannot be set.
pub(super) fn apply_set_args<'s>(
    context: &FileContext<'_>,
    source: &'s SceneText,
    mut document: Document<'s>,
) -> Document<'s> {
    for at in source.override_arg_offsets() {
        let placed;
        (document, placed) = apply_assignment(document, source.full_text(), at, LAYOUT);
        if let Err(key_error) = placed {
            context.report(key_error_issue(key_error));
        }
    }
    document
}

fn key_error_issue(KeyError { span, above, part, why }: KeyError) -> Issue {
    let list = escape_and_truncate(&above.join("."), 40);
    let part = escape_and_truncate(&part, 40);
    let quoted = |names: &[String]| {
        const MAX_LISTED: usize = 12;
        let names = names.iter().take(MAX_LISTED).map(|name| format!("`{}`", escape_and_truncate(name, 40)));
        names.collect::<Vec<_>>().join(", ")
    };
    let near = |issue: Issue, names: &[String]| match nearest_name(&part, names.iter().map(String::as_str)) {
        Some(near) => issue.with_label(format!("did you mean `{}`?", escape_and_truncate(near, 40))),
        None => issue,
    };
    match why {
        KeyErrorKind::Unknown { known } => {
            let issue = Issue::error(span, format!("the scene has no table [{list}.{part}]"));
            let help = if known.is_empty() {
                format!("the scene has no {list}")
            } else {
                format!("there are {}", quoted(&known))
            };
            near(issue, &known).with_help(help)
        }
        KeyErrorKind::NoEntry { count: 0, .. } => Issue::error(span, format!("the scene has no [[{list}]]")),
        KeyErrorKind::NoEntry { count, names } => {
            let issue = Issue::error(span, format!("there is no [[{list}]] with number or name `{part}`"));
            let by_name = if names.is_empty() {
                String::new()
            } else {
                format!(", or the name of one: {}", quoted(&names))
            };
            near(issue, &names).with_help(format!("expected a number from 1 to {count}{by_name}"))
        }
        KeyErrorKind::Ambiguous { count } => {
            Issue::error(span, format!("{count} [[{list}]] tables are named `{part}`"))
                .with_help("use a number, counting from 1")
        }
        KeyErrorKind::Element => {
            Issue::error(span, format!("`{list}` is an array of values and can only be set as a whole"))
                .with_help(format!("for example {list}=[0, 1, 2]"))
        }
    }
}
