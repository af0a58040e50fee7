//! The tables of keys of a scene, beside what the program takes: keys, defaults, ranges, and the words of choices.

use std::collections::BTreeSet;

use glimt::scene::description::Scene;
use glimt::scene::diagnostic::Diagnostic;
use glimt::scene::parse;

use super::{codes, page, root};
use crate::contract::{errors, placeless};

/// A row: key, type, unit, range, default, meaning.
struct Key {
    name: String,
    kind: String,
    range: String,
    default: String,
}

/// A table of the page, and the head of one in a scene.
struct Table {
    head: String,
    keys: Vec<Key>,
}

const WALL: &str = "[materials.wall]\n";
const CAMERA: &str = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";

/// The head of the table below a heading of the page, if it is one of keys.
fn head(heading: &str) -> Option<String> {
    let code = heading.strip_prefix('`')?.strip_suffix('`')?;
    let kind = code.strip_prefix("type = ");
    Some(match kind {
        Some(
            r#""phong""# | r#""mirror""# | r#""glass""# | r#""metal""# | r#""plastic""# | r#""principled""#,
        ) => format!("[materials.it]\n{code}\n"),
        Some(_) => format!("[[light]]\n{code}\n"),
        None => format!("{}\n", code.replace("NAME", "it")),
    })
}

fn tables() -> Vec<Table> {
    let tables = page("docs/scene.md").tables();
    let every: Vec<Vec<String>> =
        tables.iter().filter(|(name, _)| name == "Every shape").flat_map(|(_, rows)| rows.clone()).collect();
    assert_eq!(every.len(), 2);
    let materials: Vec<Vec<String>> = tables
        .iter()
        .filter(|(name, _)| name == "Every material")
        .flat_map(|(_, rows)| rows.clone())
        .collect();
    assert_eq!(materials.len(), 8);
    let is_opacity = |row: &[String]| row[0].starts_with("`opacity");
    let solid: Vec<_> = materials.iter().filter(|row| !is_opacity(row)).cloned().collect();
    let key = |row: &Vec<String>| {
        assert_eq!(row.len(), 6, "{row:?}");
        let [name, kind, range, default] = [0, 1, 3, 4].map(|index| row[index].clone());
        Key { name: name.trim_matches('`').to_owned(), kind, range, default }
    };
    tables
        .iter()
        .filter_map(|(heading, rows)| Some((head(heading)?, rows)))
        .map(|(head, rows)| {
            let is_shape = head.starts_with("[[") && !head.starts_with("[[light]]");
            let is_material = head.starts_with("[materials.it]\ntype");
            let more = match head.contains("\"glass\"") {
                _ if is_shape => every.as_slice(),
                true => solid.as_slice(),
                false if is_material => materials.as_slice(),
                false => &[],
            };
            let mut keys: Vec<Key> = rows.iter().chain(more).map(key).collect();
            // A mesh may have the materials of its file.
            let material = keys.iter_mut().find(|key| head.starts_with("[[mesh]]") && key.name == "material");
            if let Some(material) = material {
                material.default = "the file's".to_owned();
            }
            Table { keys, head }
        })
        .collect()
}

/// A value for a key that must be there.
fn example(head: &str, key: &str) -> &'static str {
    match key {
        "position" => "[0, 1, 4]",
        "look_at" => "[0, 1, 0]",
        "center" => "[0, 0.5, 0]",
        "radius" => "0.5",
        "material" => "\"wall\"",
        "file" if head.starts_with("[[mesh]]") => "\"../assets/knot.obj\"",
        "file" => "\"../assets/textures/bricks.png\"",
        _ => "\"a key without an example\"",
    }
}

impl Table {
    /// A scene with this table: its required keys but for one, and a line of its own.
    fn scene(&self, without: &str, line: &str) -> String {
        let required = self.keys.iter().filter(|key| key.default == "*required*" && key.name != without);
        let lines: String =
            required.map(|key| format!("{} = {}\n", key.name, example(&self.head, &key.name))).collect();
        let camera = if self.head.starts_with("[camera]") { "" } else { CAMERA };
        // The mesh of the example has none.
        let is_bare = self.head.starts_with("[[mesh]]") && without != "material";
        let material = if is_bare { "material = \"wall\"\n" } else { "" };
        // A metal has exactly one of three groups of keys.
        let group = match without {
            _ if !self.head.contains("\"metal\"") => "",
            "color" | "element" => "",
            "eta" => "k = 1\n",
            "k" => "eta = 1\n",
            _ => "color = 1\n",
        };
        format!("{camera}{WALL}{}{lines}{material}{group}{line}\n", self.head)
    }

    /// Returns the diagnostics of a value of a key.
    fn said(&self, key: &Key, value: &str) -> Vec<Diagnostic> {
        let text = self.scene(&key.name, &format!("{} = {value}", key.name));
        parse(text.into(), &root().join("scenes/page.toml")).diagnostics
    }

    fn takes(&self, key: &Key, value: &str) -> bool {
        errors(&self.said(key, value)).is_empty()
    }

    /// Parses the table with a line in place of a key; returns the errors and the scene.
    fn with(&self, key: &Key, line: &str) -> (String, Option<Scene>) {
        let outcome = parse(self.scene(&key.name, line).into(), &root().join("scenes/page.toml"));
        (errors(&outcome.diagnostics).join("\n"), outcome.scene.map(placeless))
    }

    /// Names a default that is not the program's.
    fn wrong_default(&self, key: &Key) -> Option<String> {
        let (said, without) = self.with(key, "");
        if key.default == "*required*" {
            let needs = said.contains(&format!("needs `{}`", key.name));
            return (!needs).then(|| format!("{}{} is not required", self.head, key.name));
        }
        let (refused, with) = self.with(key, &format!("{} = {}", key.name, key.literal()?));
        let is_right = said.is_empty() && refused.is_empty() && with == without;
        (!is_right).then(|| format!("{}{}: {} {said}{refused}", self.head, key.name, key.default))
    }

    /// Names a range that is not the program's.
    fn wrong_range(&self, key: &Key) -> Option<String> {
        let (inside, outside) = key.range()?;
        let of = |number: f64| value(&key.kind, number);
        let refused = inside.into_iter().map(of).find(|value| !self.takes(key, value));
        let taken = outside.into_iter().map(of).find(|value| self.takes(key, value));
        let refused = refused.map(|value| format!("{}{} = {value} is refused", self.head, key.name));
        refused.or(taken.map(|value| format!("{}{} = {value} is taken", self.head, key.name)))
    }
}

impl Key {
    /// The default, if it is a value.
    fn literal(&self) -> Option<&str> {
        let literal = self.default.strip_prefix('`')?.strip_suffix('`')?;
        Some(literal).filter(|literal| !literal.contains('`'))
    }

    /// Numbers that the range has, and numbers that it does not have.
    fn range(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let step = if self.kind == "whole number" { 1.0 } else { 0.001 };
        let number = |text: &str| text.trim().parse::<f64>().expect("a number");
        Some(match self.range.as_str() {
            "" | "any" => return None,
            "not 0" => (vec![-2.0, 0.5], vec![0.0]),
            "> 0" => (vec![0.25], vec![0.0, -1.0]),
            range => match range.split_once('…') {
                Some((least, "")) => (vec![number(least)], vec![number(least) - step]),
                Some((least, most)) => {
                    let (least, most) = (number(least), number(most));
                    (vec![least, most], vec![least - step, most + step])
                }
                None => {
                    let (low, high) = range.split_once(',').expect("two bounds");
                    let low = number(low.trim_start_matches('>'));
                    let high = number(high.trim().trim_start_matches('<'));
                    (vec![low + step, high - step], vec![low, high])
                }
            },
        })
    }
}

#[test]
fn the_page_has_the_keys_of_every_table() {
    let tables = tables();
    assert_eq!(tables.len(), 26);
    for table in tables {
        let text = table.scene("", "zzz = 1");
        let outcome = parse(text.into(), &root().join("scenes/page.toml"));
        let mut all = outcome.diagnostics.iter();
        let unknown = all.find(|one| one.message.starts_with("unknown key `zzz`")).expect("it is unknown");
        let mut expected = codes(unknown.help.as_deref().unwrap_or_default());
        // The tables of materials and lights have it in one of their own.
        let documented: BTreeSet<String> = table.keys.iter().map(|key| key.name.clone()).collect();
        if documented.iter().eq(["type"]) {
            continue;
        }
        if table.head.contains("type = ") {
            expected.remove("type");
        }
        assert_eq!(documented, expected, "{}", table.head);
    }
}

#[test]
fn the_defaults_of_the_page_are_those_of_the_program() {
    let tables = tables();
    let keys = || tables.iter().flat_map(|table| table.keys.iter().map(move |key| (table, key)));
    let wrong: Vec<String> = keys().filter_map(|(table, key)| table.wrong_default(key)).collect();
    assert_eq!(wrong, [""; 0]);
    assert!(keys().filter(|(_, key)| key.literal().is_some()).count() > 60);
}

/// A number as a value of a type.
fn value(kind: &str, number: f64) -> String {
    match kind {
        "two numbers" => format!("[{number}, {number}]"),
        "three numbers" => format!("[{number}, {number}, {number}]"),
        _ => number.to_string(),
    }
}

#[test]
fn the_ranges_of_the_page_are_those_of_the_program() {
    let tables = tables();
    let keys = || tables.iter().flat_map(|table| table.keys.iter().map(move |key| (table, key)));
    let wrong: Vec<String> = keys().filter_map(|(table, key)| table.wrong_range(key)).collect();
    assert_eq!(wrong, [""; 0]);
    assert!(keys().filter(|(_, key)| key.range().is_some()).count() > 40);
}

#[test]
fn the_words_of_the_page_are_those_of_the_program() {
    let mut count = 0;
    for table in tables() {
        for key in &table.keys {
            let words = codes(&key.kind);
            if words.is_empty() || !words.iter().all(|word| word.starts_with('"')) {
                continue;
            }
            let said = table.said(key, "\"zzz\"");
            let wrong =
                said.iter().find(|one| one.message.contains("cannot be \"zzz\"")).expect("it is wrong");
            let help = wrong.help.clone().unwrap_or_default();
            let expected: BTreeSet<String> =
                help.split('"').skip(1).step_by(2).map(|word| format!("\"{word}\"")).collect();
            assert_eq!(words, expected, "{} {}", table.head, key.name);
            count += 1;
        }
    }
    assert!(count >= 11, "{count} choices");
}
