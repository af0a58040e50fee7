//! `glimt explain`: describes scene keys.

use crate::console::{Console, stdout_columns_or_default};
use crate::exit::Exit;
use crate::scene::keys::key::{DefaultValue, KeyInfo, TableInfo, TableTypeInfo, ValueKind};
use crate::scene::keys::{all_paths_with_descriptions, all_tables, find_table};
use crate::scene::nearest::{nearest_name, translated_or_nearest_name};
use crate::scene::sanitize::escape_and_truncate;
use crate::tui::wrap_text;

/// Prints the description of a key, a type or a table, or a list of all tables.
pub(crate) fn run(path: Option<&str>, console: &Console) -> Exit {
    let text = match path {
        None => Some(format_table_list()),
        Some(path) => path_explanation(path.trim_matches(['[', ']'])),
    };
    match text {
        Some(text) => {
            console.print_trusted_text(&wrap_with_hanging_indents(&text, stdout_columns_or_default()));
            Exit::DONE
        }
        None => console.print_error(Exit::WRONG, &unknown_path_message(path.unwrap_or_default())),
    }
}

/// Wraps text to `columns` with hanging indents.
fn wrap_with_hanging_indents(text: &str, columns: usize) -> String {
    let mut fitted = String::new();
    for line in text.lines() {
        // A name and its description are separated by at least two spaces.
        let indent = line.len() - line.trim_start().len();
        let gap = line[indent..].find("  ").map(|at| &line[indent + at..]);
        let begin = gap.map_or(indent, |gap| line.len() - gap.trim_start().len());
        let (name, rest) = line.split_at(begin);
        let room = columns.saturating_sub(name.chars().count());
        let lines = if room < MIN_COLUMNS { vec![rest.to_owned()] } else { wrap_text(rest, room) };
        let between = format!("\n{}", " ".repeat(name.chars().count()));
        fitted.push_str(&format!("{name}{}\n", lines.join(&between)));
    }
    fitted
}

/// Minimum width for wrapping.
const MIN_COLUMNS: usize = 16;

/// Whether a table defines a type with this name.
fn defines_type_named(table: &TableInfo, name: &str) -> bool {
    table.types.iter().any(|kind| kind.name == name)
}

fn format_table_list() -> String {
    let line = |table: &TableInfo| format!("{:<20}{}\n", table.header(), without_backticks(table.doc));
    all_tables().iter().map(line).collect()
}

/// Describes the key, type or table at this path, or returns `None` if the path is unknown.
fn path_explanation(path: &str) -> Option<String> {
    let parts: Vec<&str> = path.split('.').collect();
    let found = |all: Vec<(String, &KeyInfo)>| match all.as_slice() {
        [] => None,
        [(path, key)] => Some(key_details(path, key)),
        [(first, _), ..] => {
            let texts: String = all.iter().map(|(path, key)| key_summary(path, key)).collect();
            Some(format!("{texts}\nFor details, run for example: glimt explain {first}\n"))
        }
    };
    match parts.as_slice() {
        [group, _, inner, rest @ ..] if find_table(group)?.find_inner_table(inner).is_some() => {
            path_explanation(&[&[*inner], rest].concat().join("."))
        }
        [name] => match find_table(name) {
            Some(table) => Some(table_details(table)),
            None if all_tables().iter().any(|table| defines_type_named(table, name)) => {
                let types = all_tables().iter().filter(|table| defines_type_named(table, name));
                let texts = types.filter_map(|table| {
                    Some(table_type_details(table, table.find_type_or_default(Some(name))?))
                });
                Some(texts.collect::<Vec<_>>().join("\n"))
            }
            None => {
                let all = all_tables().iter().flat_map(table_keys_with_paths);
                found(all.filter(|(_, key)| key.name == *name).collect())
            }
        },
        [name, second] => {
            let table = find_table(name)?;
            if !(table.tables)().is_empty() {
                return Some(table_details(table));
            }
            if let Some(kind) = table.find_type_or_default(Some(second)) {
                return Some(table_type_details(table, kind));
            }
            if *second == "type" && !table.types.is_empty() {
                return Some(format_table_types(table));
            }
            found(table_keys_with_paths(table).filter(|(_, key)| key.name == *second).collect())
        }
        [name, second, third] => {
            let table = find_table(name)?;
            if let Some(key) = table.keys.iter().find(|key| key.name == *second) {
                let inner = key.kind.inner_keys().iter().filter(|key| key.name == *third);
                return found(inner.map(|inner| (path.to_owned(), inner)).collect());
            }
            let kind = table.find_type_or_default(Some(second))?;
            if *third == "type" {
                return Some(format_table_types(table));
            }
            let path = format!("{}.{}", table.name, kind.name);
            found(
                table
                    .keys_for_type(Some(kind))
                    .filter(|key| key.name == *third)
                    .map(|key| (format!("{path}.{}", key.name), key))
                    .collect(),
            )
        }
        _ => None,
    }
}

/// Returns a table's keys with their full paths, such as `TABLE.TYPE.KEY`.
fn table_keys_with_paths(table: &'static TableInfo) -> impl Iterator<Item = (String, &'static KeyInfo)> {
    let own = table.types.iter().flat_map(move |kind| {
        kind.keys.iter().map(move |key| (format!("{}.{}.{}", table.name, kind.name, key.name), key))
    });
    own.chain(table.keys.iter().map(|key| (format!("{}.{}", table.name, key.name), key)))
}

/// Describes a key: description, type, unit, range, default and an example.
fn key_details(path: &str, key: &KeyInfo) -> String {
    let mut text = format!("{path}\n    {}\n\n", without_backticks_with_period(key.doc));
    let mut row = |name: &str, value: String| {
        if !value.is_empty() {
            text.push_str(&format!("    {name:<9}{value}\n"));
        }
    };
    row("type", without_backticks(&key.kind_text()));
    row("unit", key.unit.to_owned());
    row("range", key.range_text());
    row(
        "default",
        match key.default {
            DefaultValue::Required(_) => "required".to_owned(),
            DefaultValue::Is(_)
            | DefaultValue::By(_)
            | DefaultValue::Alternative(_)
            | DefaultValue::Absent => without_backticks(&key.default_markdown()),
        },
    );
    row("example", key.example_line());
    if let ValueKind::Words(list) = key.kind {
        text.push('\n');
        for word in list() {
            text.push_str(&format!("    {:<13}{}\n", format!("\"{}\"", word.name), word.meaning));
        }
    }
    let inner = key.kind.inner_keys();
    if !inner.is_empty() {
        text.push_str(&format!("\n{}", format_key_list(inner.iter())));
    }
    text
}

/// Summarizes one of several keys in two lines: type, unit, range and default, followed by the description.
fn key_summary(path: &str, key: &KeyInfo) -> String {
    let default = match key.default {
        DefaultValue::Required(_) => "required".to_owned(),
        DefaultValue::Is(_) | DefaultValue::By(_) => {
            format!("default {}", without_backticks(&key.default_markdown()))
        }
        DefaultValue::Alternative(_) | DefaultValue::Absent => String::new(),
    };
    let facts = [without_backticks(&key.kind_text()), key.unit.to_owned(), key.range_text(), default];
    let facts: Vec<String> = facts.into_iter().filter(|fact| !fact.is_empty()).collect();
    format!("{path}: {}\n    {}\n", facts.join("; "), without_backticks_with_period(key.doc))
}

/// Describes a table, with one line per type and key.
fn table_details(table: &'static TableInfo) -> String {
    let head = format!("{}\n    {}\n\n", table.header(), without_backticks_with_period(table.doc));
    let types =
        if table.types.is_empty() { String::new() } else { format!("{}\n", format_table_types(table)) };
    let inner =
        |(header, inner): (String, &TableInfo)| format!("    {header:<26}{}\n", without_backticks(inner.doc));
    let tables: String = table.inner_headers().map(inner).collect();
    format!("{head}{types}{tables}{}", format_key_list(table.keys.iter()))
}

fn format_table_types(table: &TableInfo) -> String {
    let default = table.types.first().map_or("", |kind| kind.name);
    let line = |kind: &TableTypeInfo| {
        format!("    type = {:<15}{}\n", format!("\"{}\"", kind.name), without_backticks(kind.doc))
    };
    let lines: String = table.types.iter().map(line).collect();
    format!("{lines}    the default is \"{default}\"\n")
}

/// Describes a type, with one line for each of its keys and each common key.
fn table_type_details(table: &'static TableInfo, kind: &'static TableTypeInfo) -> String {
    let head = format!(
        "{}, type = \"{}\"\n    {}\n\n",
        table.header(),
        kind.name,
        without_backticks_with_period(kind.doc)
    );
    format!("{head}{}", format_key_list(table.keys_for_type(Some(kind))))
}

fn format_key_list(keys: impl Iterator<Item = &'static KeyInfo>) -> String {
    keys.map(|key| format!("    {:<22}{}\n", key.name, without_backticks(key.doc))).collect()
}

/// Removes Markdown backticks.
fn without_backticks(text: &str) -> String {
    text.replace('`', "")
}

fn without_backticks_with_period(text: &str) -> String {
    format!("{}.", without_backticks(text))
}

/// Error message for an unknown path, with a suggestion.
fn unknown_path_message(path: &str) -> String {
    let shown = escape_and_truncate(path, 60);
    let all = all_paths_with_descriptions();
    let names: Vec<&str> = all.iter().map(|(path, _)| path.as_str()).collect();
    let parts: Vec<&str> = path.split('.').collect();
    let (first, last) =
        (parts.first().copied().unwrap_or_default(), parts.last().copied().unwrap_or_default());
    // Suggest a key from the same table or, failing that, from any table.
    let in_table: Vec<&str> =
        names.iter().copied().filter(|name| name.split('.').next() == Some(first)).collect();
    let ends: Vec<&str> = in_table.iter().filter_map(|name| name.rsplit('.').next()).collect();
    let near_end = || {
        translated_or_nearest_name(last, &ends)
            .and_then(|end| in_table.iter().copied().find(|name| name.ends_with(&format!(".{end}"))))
    };
    let keys: Vec<&str> = names.iter().filter_map(|name| name.rsplit('.').next()).collect();
    let near = nearest_name(path, names.iter().copied())
        .or_else(near_end)
        .or_else(|| translated_or_nearest_name(last, &keys));
    match near {
        Some(near) => format!("unknown key {shown:?}; did you mean `{near}`?"),
        None => format!("unknown key {shown:?}; `glimt explain` lists all tables"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partial_paths_find_keys() {
        let text = path_explanation("materials.metal.roughness").expect("a key");
        for part in ["0 … 1", "default  0.2", "number or texture", "roughness = 0.2"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let all = path_explanation("materials.roughness").expect("keys");
        assert!(
            ["glass", "metal", "plastic", "principled"]
                .iter()
                .all(|kind| all.contains(&format!("materials.{kind}.roughness")))
        );
        assert!(path_explanation("roughness").is_some_and(|alone| alone == all));
        assert!(path_explanation("materials.metal.emission").is_some_and(|text| text.contains("radiance")));
        assert!(path_explanation("render.integrator").is_some_and(|text| text.contains("\"path\"")));
        assert!(path_explanation("materials.type").is_some_and(|text| text.contains("type = \"glass\"")));
    }

    #[test]
    fn ambiguous_keys_are_summarized_in_two_lines() {
        let text = path_explanation("radius").expect("keys");
        assert!(text.starts_with("photons.radius: number; length; 0 …; default 0.0\n    Kernel"), "{text}");
        assert!(text.contains("\nsphere.radius: number; length; > 0; required\n"), "{text}");
        assert!(text.lines().count() < 20 && text.ends_with(": glimt explain photons.radius\n"), "{text}");
    }

    #[test]
    fn lines_wrap_to_the_terminal() {
        let text = "[mesh]\n    A mesh from a file.\n\n    matrix    One two three four five six.\n";
        let expected =
            "[mesh]\n    A mesh from a file.\n\n    matrix    One two three four\n              five six.\n";
        assert_eq!(wrap_with_hanging_indents(text, 34), expected);
        assert_eq!(wrap_with_hanging_indents(text, 10), text, "too narrow to wrap");
        for (path, _) in all_paths_with_descriptions() {
            let text = wrap_with_hanging_indents(&path_explanation(&path).unwrap_or_default(), 80);
            let broken: Vec<&str> = text.lines().filter(|line| line.chars().count() > 80).collect();
            assert!(broken.is_empty(), "{broken:?}");
        }
    }

    #[test]
    fn every_path_is_explained() {
        for (path, doc) in all_paths_with_descriptions() {
            let text = path_explanation(&path).unwrap_or_default();
            assert!(text.contains(&without_backticks(doc)), "{path}: {text}");
        }
        assert!(path_explanation("phong").is_some_and(|text| text.contains("shininess")));
        assert_eq!(path_explanation("materials.metal.type"), path_explanation("materials.type"));
        assert!(path_explanation("groups").is_some_and(|text| text.contains("[[groups.NAME.sphere]]")));
        assert_eq!(path_explanation("groups.stool"), path_explanation("groups"));
        assert_eq!(path_explanation("groups.stool.sphere.radius"), path_explanation("sphere.radius"));
        assert_eq!(path_explanation("nothing"), None);
        assert_eq!(path_explanation("materials.gold.roughness"), None);
    }

    #[test]
    fn unknown_keys_get_suggestions() {
        for (wrong, near) in [
            ("render.sample", "render.samples"),
            ("sphere.raduis", "sphere.radius"),
            ("materials.metal.rougness", "materials.metal.roughness"),
            ("sampels", "samples"),
            ("camera.target", "camera.look_at"),
        ] {
            assert!(
                unknown_path_message(wrong).contains(&format!("`{near}`")),
                "{}",
                unknown_path_message(wrong)
            );
        }
    }
}
