//! Values that the call sets in a scene.

use super::super::nearest::nearest;
use super::super::sanitize::shortened;
use super::super::source::Source;
use super::super::toml::{Document, Layout, NoPlace, Why, set};
use super::context::{Context, Issue};
use super::shapes;

/// The tables that a key may lead through.
const LAYOUT: Layout =
    Layout { groups: &["materials", "textures"], is_list: |name| name == "light" || shapes::is_kind(name) };

/// The document with all that is set; what leads nowhere is reported.
pub(super) fn put<'s>(context: &Context<'_>, source: &'s Source, mut document: Document<'s>) -> Document<'s> {
    for at in source.sets() {
        let placed;
        (document, placed) = set(document, source.all(), at, LAYOUT);
        if let Err(no_place) = placed {
            context.report(issue(no_place));
        }
    }
    document
}

fn issue(NoPlace { span, above, part, why }: NoPlace) -> Issue {
    let list = shortened(&above.join("."), 40);
    let part = shortened(&part, 40);
    let quoted = |names: &[String]| {
        const MOST: usize = 12;
        let names = names.iter().take(MOST).map(|name| format!("`{}`", shortened(name, 40)));
        names.collect::<Vec<_>>().join(", ")
    };
    let near = |issue: Issue, names: &[String]| match nearest(&part, names.iter().map(String::as_str)) {
        Some(near) => issue.label(format!("did you mean `{}`?", shortened(near, 40))),
        None => issue,
    };
    match why {
        Why::Unknown { known } => {
            let issue = Issue::error(span, format!("the scene has no table [{list}.{part}]"));
            let help = if known.is_empty() {
                "it has none of this kind".to_owned()
            } else {
                format!("there are {}", quoted(&known))
            };
            near(issue, &known).help(help)
        }
        Why::NoEntry { count: 0, .. } => Issue::error(span, format!("the scene has no [[{list}]]")),
        Why::NoEntry { count, names } => {
            let issue = Issue::error(span, format!("there is no [[{list}]] number or name `{part}`"));
            let by_name = if names.is_empty() {
                String::new()
            } else {
                format!(", or the name of one: {}", quoted(&names))
            };
            near(issue, &names).help(format!("expected a number from 1 to {count}{by_name}"))
        }
        Why::Ambiguous { count } => Issue::error(span, format!("{count} [[{list}]] have the name `{part}`"))
            .help("give its number, from 1"),
        Why::Element => {
            Issue::error(span, format!("`{list}` is an array of values, which is set as a whole"))
                .help(format!("such as {list}=[0, 1, 2]"))
        }
    }
}
