//! The tables of keys of a scene, beside what the program takes: keys, defaults, ranges, and the words of choices.

use std::collections::BTreeSet;

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
        Some(r#""phong""# | r#""mirror""# | r#""glass""#) => format!("[materials.it]\n{code}\n"),
        Some(_) => format!("[[light]]\n{code}\n"),
        None => format!("{}\n", code.replace("NAME", "it")),
    })
}

fn tables() -> Vec<Table> {
    let tables = page("docs/scene.md").tables();
    let every: Vec<Vec<String>> =
        tables.iter().filter(|(name, _)| name == "Every shape").flat_map(|(_, rows)| rows.clone()).collect();
    assert_eq!(every.len(), 2);
    let key = |row: &Vec<String>| {
        let [name, kind, _unit, range, default, _meaning] = row.as_slice() else { panic!("{row:?}") };
        let name = name.trim_matches('`').to_owned();
        Key { name, kind: kind.clone(), range: range.clone(), default: default.clone() }
    };
    tables
        .iter()
        .filter_map(|(heading, rows)| Some((head(heading)?, rows)))
        .map(|(head, rows)| {
            let is_shape = head.starts_with("[[") && !head.starts_with("[[light]]");
            let more = if is_shape { every.as_slice() } else { &[] };
            Table { keys: rows.iter().chain(more).map(key).collect(), head }
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
        _ => panic!("{head}: {key} is required"),
    }
}

impl Table {
    /// A scene with this table: its required keys but for one, and a line of its own.
    fn scene(&self, without: &str, line: &str) -> String {
        let required = self.keys.iter().filter(|key| key.default == "*required*" && key.name != without);
        let lines: String =
            required.map(|key| format!("{} = {}\n", key.name, example(&self.head, &key.name))).collect();
        let camera = if self.head.starts_with("[camera]") { "" } else { CAMERA };
        // A mesh may leave it out, if its file has materials.
        let is_bare =
            self.head.starts_with("[[mesh]]") && without != "material" && !lines.contains("material");
        let material = if is_bare { "material = \"wall\"\n" } else { "" };
        format!("{camera}{WALL}{}{lines}{material}{line}\n", self.head)
    }

    /// What is said of a value of a key.
    fn said(&self, key: &Key, value: &str) -> Vec<Diagnostic> {
        let text = self.scene(&key.name, &format!("{} = {value}", key.name));
        parse(text.into(), &root().join("scenes/page.toml")).diagnostics
    }

    fn takes(&self, key: &Key, value: &str) -> bool {
        errors(&self.said(key, value)).is_empty()
    }
}

#[test]
fn the_page_has_the_keys_of_every_table() {
    let tables = tables();
    assert_eq!(tables.len(), 22);
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
    for table in tables() {
        for key in &table.keys {
            let scene = |line: &str| {
                let text = table.scene(&key.name, line);
                let outcome = parse(text.into(), &root().join("scenes/page.toml"));
                (errors(&outcome.diagnostics).join("\n"), outcome.scene.map(placeless))
            };
            let (said, without) = scene("");
            if key.default == "*required*" {
                assert!(
                    said.contains(&format!("needs `{}`", key.name)),
                    "{} {}: {said}",
                    table.head,
                    key.name
                );
                continue;
            }
            assert_eq!(said, "", "{} {}", table.head, key.name);
            let literal = key.default.strip_prefix('`').and_then(|rest| rest.strip_suffix('`'));
            if let Some(literal) = literal.filter(|literal| !literal.contains('`')) {
                let (said, with) = scene(&format!("{} = {literal}", key.name));
                assert_eq!(said, "", "{} {}", table.head, key.name);
                assert!(with == without, "{} {}: the default is not {literal}", table.head, key.name);
            }
        }
    }
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
    let mut count = 0;
    for table in tables() {
        for key in &table.keys {
            // Numbers that the range has, and numbers that it does not have.
            let step = if key.kind == "whole number" { 1.0 } else { 0.001 };
            let number =
                |text: &str| text.trim().parse::<f64>().unwrap_or_else(|_| panic!("{}: {text}", key.name));
            let (inside, outside) = match key.range.as_str() {
                "" | "any" => continue,
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
            };
            for number in inside {
                let value = value(&key.kind, number);
                assert!(table.takes(key, &value), "{} {} = {value} is refused", table.head, key.name);
            }
            for number in outside {
                let value = value(&key.kind, number);
                assert!(!table.takes(key, &value), "{} {} = {value} is taken", table.head, key.name);
            }
            count += 1;
        }
    }
    assert!(count > 40, "{count} ranges");
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
