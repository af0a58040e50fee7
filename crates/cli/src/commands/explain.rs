//! `glimt explain`: the meaning of a key, from the definition.

use crate::console::{Console, answer_columns};
use crate::exit::Exit;
use crate::scene::keys::key::{Default, KeyInfo, TableInfo, TypeInfo, ValueKind};
use crate::scene::keys::{paths, table, tables};
use crate::scene::nearest::{meant, nearest};
use crate::scene::sanitize::shortened;
use crate::tui::wrapped;

/// Prints what is known by a path of a key, of a type, of a table; without one, all tables.
pub(crate) fn run(path: Option<&str>, console: &Console) -> Exit {
    let text = match path {
        None => Some(overview()),
        Some(path) => explained(path.trim_matches(['[', ']'])),
    };
    match text {
        Some(text) => {
            console.text(&fitted(&text, answer_columns()));
            Exit::DONE
        }
        None => console.fail(Exit::WRONG, &unknown(path.unwrap_or_default())),
    }
}

/// The text in lines of at most so many columns; what goes on stands under the column where it begins.
fn fitted(text: &str, columns: usize) -> String {
    let mut fitted = String::new();
    for line in text.lines() {
        // A name and its description have two spaces or more between them.
        let indent = line.len() - line.trim_start().len();
        let gap = line[indent..].find("  ").map(|at| &line[indent + at..]);
        let begin = gap.map_or(indent, |gap| line.len() - gap.trim_start().len());
        let (name, rest) = line.split_at(begin);
        let room = columns.saturating_sub(name.chars().count());
        let lines = if room < LEAST_COLUMNS { vec![rest.to_owned()] } else { wrapped(rest, room) };
        let between = format!("\n{}", " ".repeat(name.chars().count()));
        fitted.push_str(&format!("{name}{}\n", lines.join(&between)));
    }
    fitted
}

/// Texts are not broken into lines shorter than this.
const LEAST_COLUMNS: usize = 16;

/// Whether tables may be of a type.
fn has_type(table: &TableInfo, name: &str) -> bool {
    table.types.iter().any(|kind| kind.name == name)
}

fn overview() -> String {
    let line = |table: &TableInfo| format!("{:<20}{}\n", table.head(), plain(table.doc));
    tables().iter().map(line).collect()
}

/// The text about a path. `None` if nothing has it.
fn explained(path: &str) -> Option<String> {
    let parts: Vec<&str> = path.split('.').collect();
    let found = |all: Vec<(String, &KeyInfo)>| match all.as_slice() {
        [] => None,
        [(path, key)] => Some(one(path, key)),
        [(first, _), ..] => {
            let texts: String = all.iter().map(|(path, key)| short(path, key)).collect();
            Some(format!("{texts}\nMore about one of them: glimt explain {first}\n"))
        }
    };
    match parts.as_slice() {
        [name] => match table(name) {
            Some(table) => Some(whole_table(table)),
            None if tables().iter().any(|table| has_type(table, name)) => {
                let types = tables().iter().filter(|table| has_type(table, name));
                let texts = types.filter_map(|table| Some(whole_type(table, table.type_of(Some(name))?)));
                Some(texts.collect::<Vec<_>>().join("\n"))
            }
            None => found(all_keys().filter(|(_, key)| key.name == *name).collect()),
        },
        [name, second] => {
            let table = table(name)?;
            if let Some(kind) = table.type_of(Some(second)) {
                return Some(whole_type(table, kind));
            }
            if *second == "type" && !table.types.is_empty() {
                return Some(types(table));
            }
            found(keys_of(table).filter(|(_, key)| key.name == *second).collect())
        }
        [name, second, third] => {
            let table = table(name)?;
            let kind = table.type_of(Some(second))?;
            if *third == "type" {
                return Some(types(table));
            }
            let path = format!("{}.{}", table.name, kind.name);
            found(
                table
                    .keys_of(Some(kind))
                    .filter(|key| key.name == *third)
                    .map(|key| (format!("{path}.{}", key.name), key))
                    .collect(),
            )
        }
        _ => None,
    }
}

/// Every key with its path, those of types with their type.
fn all_keys() -> impl Iterator<Item = (String, &'static KeyInfo)> {
    tables().iter().flat_map(keys_of)
}

fn keys_of(table: &'static TableInfo) -> impl Iterator<Item = (String, &'static KeyInfo)> {
    let own = table.types.iter().flat_map(move |kind| {
        kind.keys.iter().map(move |key| (format!("{}.{}.{}", table.name, kind.name, key.name), key))
    });
    own.chain(table.keys.iter().map(|key| (format!("{}.{}", table.name, key.name), key)))
}

/// The text about a key: its description, type, range, default, and an example.
fn one(path: &str, key: &KeyInfo) -> String {
    let mut text = format!("{path}\n    {}\n\n", sentence(key.doc));
    let mut row = |name: &str, value: String| {
        if !value.is_empty() {
            text.push_str(&format!("    {name:<9}{value}\n"));
        }
    };
    row("type", plain(&key.kind()));
    row("unit", key.unit.to_owned());
    row("range", key.range());
    row(
        "default",
        match key.default {
            Default::Required(_) => "required".to_owned(),
            Default::Is(_) | Default::By(_) | Default::Absent => plain(&key.default_words()),
        },
    );
    row("example", format!("{} = {}", key.name, key.example()));
    if let ValueKind::Words(list) = key.kind {
        text.push('\n');
        for word in list() {
            text.push_str(&format!("    {:<13}{}\n", format!("\"{}\"", word.name), word.meaning));
        }
    }
    text
}

/// The text about one of several keys: kind, unit, range and default in a line, and the description.
fn short(path: &str, key: &KeyInfo) -> String {
    let default = match key.default {
        Default::Required(_) => "required".to_owned(),
        Default::Is(_) | Default::By(_) => format!("default {}", plain(&key.default_words())),
        Default::Absent => String::new(),
    };
    let facts = [plain(&key.kind()), key.unit.to_owned(), key.range(), default];
    let facts: Vec<String> = facts.into_iter().filter(|fact| !fact.is_empty()).collect();
    format!("{path}: {}\n    {}\n", facts.join("; "), sentence(key.doc))
}

/// A table with a line for each of its types and keys.
fn whole_table(table: &'static TableInfo) -> String {
    let head = format!("{}\n    {}\n\n", table.head(), sentence(table.doc));
    let types = if table.types.is_empty() { String::new() } else { format!("{}\n", types(table)) };
    format!("{head}{types}{}", list(table.keys.iter()))
}

fn types(table: &TableInfo) -> String {
    let default = table.types.first().map_or("", |kind| kind.name);
    let line =
        |kind: &TypeInfo| format!("    type = {:<15}{}\n", format!("\"{}\"", kind.name), plain(kind.doc));
    let lines: String = table.types.iter().map(line).collect();
    format!("{lines}    without `type`: \"{default}\"\n")
}

/// A type with a line for each of its keys, and for those of every type.
fn whole_type(table: &'static TableInfo, kind: &'static TypeInfo) -> String {
    let head = format!("{}, type = \"{}\"\n    {}\n\n", table.head(), kind.name, sentence(kind.doc));
    format!("{head}{}", list(table.keys_of(Some(kind))))
}

fn list(keys: impl Iterator<Item = &'static KeyInfo>) -> String {
    keys.map(|key| format!("    {:<22}{}\n", key.name, plain(key.doc))).collect()
}

/// Text for a terminal: code without its marks.
fn plain(text: &str) -> String {
    text.replace('`', "")
}

fn sentence(text: &str) -> String {
    format!("{}.", plain(text))
}

/// The message about a path that nothing has, with the nearest ones.
fn unknown(path: &str) -> String {
    let shown = shortened(path, 60);
    let all = paths();
    let names: Vec<&str> = all.iter().map(|(path, _)| path.as_str()).collect();
    let parts: Vec<&str> = path.split('.').collect();
    let (first, last) =
        (parts.first().copied().unwrap_or_default(), parts.last().copied().unwrap_or_default());
    // A key of the table that is named, or of any.
    let in_table: Vec<&str> =
        names.iter().copied().filter(|name| name.split('.').next() == Some(first)).collect();
    let ends: Vec<&str> = in_table.iter().filter_map(|name| name.rsplit('.').next()).collect();
    let near_end = || {
        meant(last, &ends)
            .and_then(|end| in_table.iter().copied().find(|name| name.ends_with(&format!(".{end}"))))
    };
    let keys: Vec<&str> = names.iter().filter_map(|name| name.rsplit('.').next()).collect();
    let near = nearest(path, names.iter().copied()).or_else(near_end).or_else(|| meant(last, &keys));
    match near {
        Some(near) => format!("there is no key {shown:?}: did you mean `{near}`?"),
        None => format!("there is no key {shown:?}: `glimt explain` lists all tables"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_found_by_its_table_its_type_or_alone() {
        let text = explained("materials.metal.roughness").expect("a key");
        for part in ["0 … 1", "default  0.2", "number or texture", "roughness = 0.2"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let all = explained("materials.roughness").expect("keys");
        assert!(
            ["glass", "metal", "plastic", "principled"]
                .iter()
                .all(|kind| all.contains(&format!("materials.{kind}.roughness")))
        );
        assert!(explained("roughness").is_some_and(|alone| alone == all));
        assert!(explained("materials.metal.emission").is_some_and(|text| text.contains("radiance")));
        assert!(explained("render.integrator").is_some_and(|text| text.contains("\"path\"")));
        assert!(explained("materials.type").is_some_and(|text| text.contains("type = \"glass\"")));
    }

    #[test]
    fn several_keys_have_two_lines_each() {
        let text = explained("radius").expect("keys");
        assert!(
            text.starts_with("photons.radius: number; length; 0 …; default 0.0\n    Radius of"),
            "{text}"
        );
        assert!(text.contains("\nsphere.radius: number; length; > 0; required\n"), "{text}");
        assert!(text.lines().count() < 20 && text.ends_with(": glimt explain photons.radius\n"), "{text}");
    }

    #[test]
    fn lines_fit_the_terminal() {
        let text = "[mesh]\n    A mesh from a file.\n\n    matrix    One two three four five six.\n";
        let expected =
            "[mesh]\n    A mesh from a file.\n\n    matrix    One two three four\n              five six.\n";
        assert_eq!(fitted(text, 34), expected);
        assert_eq!(fitted(text, 10), text, "too narrow to be broken");
        for (path, _) in paths() {
            let text = fitted(&explained(&path).unwrap_or_default(), 80);
            let broken: Vec<&str> = text.lines().filter(|line| line.chars().count() > 80).collect();
            assert!(broken.is_empty(), "{broken:?}");
        }
    }

    #[test]
    fn every_path_of_the_definition_is_explained() {
        for (path, doc) in paths() {
            let text = explained(&path).unwrap_or_default();
            assert!(text.contains(&plain(doc)), "{path}: {text}");
        }
        assert!(explained("phong").is_some_and(|text| text.contains("shininess")));
        assert_eq!(explained("materials.metal.type"), explained("materials.type"));
        assert_eq!(explained("nothing"), None);
        assert_eq!(explained("materials.gold.roughness"), None);
    }

    #[test]
    fn what_is_not_there_leads_to_what_is_near() {
        for (wrong, near) in [
            ("render.sample", "render.samples"),
            ("sphere.raduis", "sphere.radius"),
            ("materials.metal.rougness", "materials.metal.roughness"),
            ("sampels", "samples"),
            ("camera.target", "camera.look_at"),
        ] {
            assert!(unknown(wrong).contains(&format!("`{near}`")), "{}", unknown(wrong));
        }
    }
}
