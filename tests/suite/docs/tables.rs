//! Checks the definitions of scene keys (keys, defaults, ranges, choices) against the program and the
//! documented tables.

use std::collections::BTreeSet;

use glimt::scene::description::Scene;
use glimt::scene::diagnostic::Diagnostic;
use glimt::scene::keys::key::{DefaultValue, KeyInfo, TableInfo, TableSyntax, TableTypeInfo, ValueKind};
use glimt::scene::keys::{self, limits::Limits};
use glimt::scene::parse;

use super::{codes, page, root};
use crate::contract::{errors, placeless};
use crate::test_dir::mentions;

/// A key of a table, or of one of its types.
#[derive(Clone)]
struct DefinedKey {
    info: &'static KeyInfo,
    name: String,
}

/// A defined table with its header in a scene.
struct DefinedTable {
    head: String,
    /// The page headings for this table, with the number of rows below each.
    headings: Vec<(String, usize)>,
    keys: Vec<DefinedKey>,
}

const WALL: &str = "[materials.wall]\n";
const CAMERA: &str = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";

fn tables() -> Vec<DefinedTable> {
    keys::all_tables().iter().flat_map(of_definition).collect()
}

/// The scene tables for a definition, one for each type.
fn of_definition(table: &'static TableInfo) -> Vec<DefinedTable> {
    let head = table.header().replace("NAME", "it");
    let heading = |code: String| format!("`{code}`");
    let key = |info: &'static KeyInfo| DefinedKey { info, name: info.name.to_owned() };
    if table.types.is_empty() {
        let keys: Vec<DefinedKey> = table.keys_for_type(None).map(key).collect();
        let headings = match table.form {
            // The last two keys are common to all shapes.
            TableSyntax::List => {
                vec![(heading(table.header()), keys.len() - 2), ("Every shape".to_owned(), 2)]
            }
            TableSyntax::Single | TableSyntax::Named => vec![(heading(table.header()), keys.len())],
        };
        return vec![DefinedTable { head: format!("{head}\n"), headings, keys }];
    }
    let of_type = |kind: &'static TableTypeInfo| {
        let code = format!("type = \"{}\"", kind.name);
        // Opacity applies only to surfaces.
        let is_solid = |info: &KeyInfo| kind.name == "glass" && info.name.starts_with("opacity");
        let keys = table.keys_for_type(Some(kind)).filter(|info| !is_solid(info)).map(key).collect();
        let own = (heading(code.clone()), kind.keys.len());
        let common = ("Every material".to_owned(), table.keys.len());
        let headings = [own, common].into_iter().filter(|(_, count)| *count > 0).collect();
        DefinedTable { head: format!("{head}\n{code}\n"), headings, keys }
    };
    table.types.iter().map(of_type).collect()
}

/// A value for a required key.
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

impl DefinedTable {
    /// A scene with this table, including an extra line and all required keys except one.
    fn scene(&self, without: &str, line: &str) -> String {
        let required = self
            .keys
            .iter()
            .filter(|key| matches!(key.info.default, DefaultValue::Required(_)) && key.name != without);
        let lines: String =
            required.map(|key| format!("{} = {}\n", key.name, example(&self.head, &key.name))).collect();
        let camera = if self.head.starts_with("[camera]") { "" } else { CAMERA };
        // The example mesh has no materials.
        let is_bare = self.head.starts_with("[[mesh]]") && without != "material";
        let material = if is_bare { "material = \"wall\"\n" } else { "" };
        // A metal needs exactly one of three groups of keys.
        let group = match without {
            _ if !self.head.contains("\"metal\"") => "",
            "color" | "element" => "",
            "eta" => "k = 1\n",
            "k" => "eta = 1\n",
            _ => "color = 1\n",
        };
        format!("{camera}{WALL}{}{lines}{material}{group}{line}\n", self.head)
    }

    /// Returns the diagnostics for a value of a key.
    fn said(&self, key: &DefinedKey, value: &str) -> Vec<Diagnostic> {
        let text = self.scene(&key.name, &format!("{} = {value}", key.name));
        parse(text.into(), &root().join("scenes/page.toml")).diagnostics
    }

    fn takes(&self, key: &DefinedKey, value: &str) -> bool {
        errors(&self.said(key, value)).is_empty()
    }

    /// Parses the table with a line in place of a key. Returns the errors and the scene.
    fn with(&self, key: &DefinedKey, line: &str) -> (String, Option<Scene>) {
        let outcome = parse(self.scene(&key.name, line).into(), &root().join("scenes/page.toml"));
        (errors(&outcome.diagnostics).join("\n"), outcome.scene.map(placeless))
    }

    /// Reports a default that differs from the program's default.
    fn wrong_default(&self, key: &DefinedKey) -> Option<String> {
        let (said, without) = self.with(key, "");
        if matches!(key.info.default, DefaultValue::Required(_)) {
            let needs = said.contains(&format!("needs `{}`", key.name));
            return (!needs).then(|| format!("{}{} is not required", self.head, key.name));
        }
        let (refused, with) = self.with(key, &format!("{} = {}", key.name, key.literal()?));
        let is_right = said.is_empty() && refused.is_empty() && with == without;
        (!is_right).then(|| format!("{}{}: {:?} {said}{refused}", self.head, key.name, key.info.default))
    }

    /// Reports a range that differs from the program's range.
    fn wrong_range(&self, key: &DefinedKey) -> Option<String> {
        let (inside, outside) = key.range()?;
        let of = |number: f64| value(key.info.kind, number);
        let refused = inside.into_iter().map(of).find(|value| !self.takes(key, value));
        let taken = outside.into_iter().map(of).find(|value| self.takes(key, value));
        let refused = refused.map(|value| format!("{}{} = {value} is rejected", self.head, key.name));
        refused.or(taken.map(|value| format!("{}{} = {value} is accepted", self.head, key.name)))
    }
}

impl DefinedKey {
    /// The default, if it is a value.
    fn literal(&self) -> Option<&'static str> {
        match self.info.default {
            DefaultValue::Is(value) => Some(value),
            DefaultValue::Required(_) | DefaultValue::By(_) | DefaultValue::Absent => None,
        }
    }

    /// Numbers inside and outside the range.
    fn range(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        match self.info.kind {
            // Keys for glTF files, which this test's scene does not use.
            ValueKind::Whole(..) if self.info.default == DefaultValue::Absent => None,
            ValueKind::Whole(least, most) => {
                Some((vec![least as f64, most as f64], vec![least as f64 - 1.0, most as f64 + 1.0]))
            }
            ValueKind::Number(limits)
            | ValueKind::Color(limits)
            | ValueKind::ColorOrTexture(limits)
            | ValueKind::Emission(limits)
            | ValueKind::NumberOrTexture(limits)
            | ValueKind::Scale(limits) => ends(limits),
            // A direction must not be zero, and a matrix has a fixed last row.
            ValueKind::Numbers(count, _, limits) if limits != Limits::Any || count == 2 => ends(limits),
            ValueKind::Numbers(..) => None,
            ValueKind::Flag
            | ValueKind::Words(_)
            | ValueKind::Text
            | ValueKind::File(_)
            | ValueKind::Texture
            | ValueKind::Heights
            | ValueKind::Material => None,
        }
    }
}

fn ends(limits: Limits) -> Option<(Vec<f64>, Vec<f64>)> {
    const STEP: f64 = 0.001;
    Some(match limits {
        Limits::Any => (vec![-1e18, 1e18], vec![1.1e18]),
        Limits::NotZero => (vec![-2.0, 0.5], vec![0.0]),
        Limits::AtLeast(least) => (vec![least], vec![least - STEP]),
        Limits::Length => (vec![0.25], vec![0.0, -1.0]),
        Limits::LengthOrZero => (vec![0.0], vec![-1.0]),
        Limits::Between(least, most) => (vec![least, most], vec![least - STEP, most + STEP]),
        Limits::Inside(low, high) => (vec![low + STEP, high - STEP], vec![low, high]),
    })
}

/// Whether a row documents the key. The page may reorder choices and add a link at the end.
fn is_row(row: &[String], key: &KeyInfo) -> bool {
    let [name, kind, unit, range, default, meaning] = row else { return false };
    let has_kind = *kind == key.kind_text()
        || matches!(key.kind, ValueKind::Words(_)) && codes(kind) == codes(&key.kind_text());
    let meaning = unlinked(meaning);
    let rest = meaning.strip_prefix(key.doc);
    *name == format!("`{}`", key.name)
        && has_kind
        && unit == key.unit
        && *range == key.range_text()
        && *default == key.default_markdown()
        && rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(". See "))
}

/// Replaces each link with its text.
fn unlinked(text: &str) -> String {
    let Some((before, after)) = text.split_once("](") else { return text.to_owned() };
    let (begin, words) = before.rsplit_once('[').unwrap_or((before, ""));
    let rest = after.split_once(')').map_or("", |(_, rest)| rest);
    format!("{begin}{words}{}", unlinked(rest))
}

#[test]
fn documented_rows_match_definitions() {
    let page = page("docs/scene.md");
    let (mut wrong, mut count) = (Vec::new(), 0);
    for DefinedTable { head, headings, keys: _ } in tables() {
        let name = head.trim_matches(['[', '\n']).split([']', '.']).next().unwrap_or_default();
        let table = keys::find_table(name).expect("a table");
        let kind = head.split('"').nth(1).and_then(|kind| table.find_type_or_default(Some(kind)));
        let rows = headings.iter().flat_map(|(heading, number)| {
            let rows = page.rows(heading);
            assert_eq!(rows.len(), *number, "{heading}");
            rows
        });
        for (row, key) in rows.zip(table.keys_for_type(kind)) {
            count += 1;
            // The page has a single row for the material of all shapes.
            let is_right = is_row(&row, key) || head == "[[mesh]]\n" && key.name == "material";
            if !is_right {
                let key = [
                    key.kind_text(),
                    key.unit.into(),
                    key.range_text(),
                    key.default_markdown(),
                    key.doc.into(),
                ];
                wrong.push(format!("{head}| {}\n{key:?}", row.join(" | ")));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 150, "{count} rows");
}

#[test]
fn definition_has_every_key() {
    let tables = tables();
    assert_eq!(tables.len(), 24);
    for table in tables {
        let text = table.scene("", "zzz = 1");
        let outcome = parse(text.into(), &root().join("scenes/page.toml"));
        let mut all = outcome.diagnostics.iter();
        let unknown = all.find(|one| mentions(&one.message, "`zzz`")).expect("an unknown key");
        let mut expected = codes(unknown.help.as_deref().unwrap_or_default());
        let documented: BTreeSet<String> = table.keys.iter().map(|key| key.name.clone()).collect();
        if table.head.contains("type = ") {
            expected.remove("type");
        }
        assert_eq!(documented, expected, "{}", table.head);
    }
}

#[test]
fn defined_defaults_match_the_program() {
    let tables = tables();
    let keys = || tables.iter().flat_map(|table| table.keys.iter().map(move |key| (table, key)));
    let wrong: Vec<String> = keys().filter_map(|(table, key)| table.wrong_default(key)).collect();
    assert_eq!(wrong, [""; 0]);
    assert!(keys().filter(|(_, key)| key.literal().is_some()).count() > 60);
}

/// Formats a number as a value of the specified kind.
fn value(kind: ValueKind, number: f64) -> String {
    match kind {
        ValueKind::Numbers(count, ..) => format!("[{}]", vec![number.to_string(); count].join(", ")),
        _ => number.to_string(),
    }
}

#[test]
fn defined_ranges_match_the_program() {
    let tables = tables();
    let keys = || tables.iter().flat_map(|table| table.keys.iter().map(move |key| (table, key)));
    let wrong: Vec<String> = keys().filter_map(|(table, key)| table.wrong_range(key)).collect();
    assert_eq!(wrong, [""; 0]);
    assert!(keys().filter(|(_, key)| key.range().is_some()).count() > 40);
}

#[test]
fn defined_choices_match_the_program() {
    let mut count = 0;
    for table in tables() {
        for key in &table.keys {
            let ValueKind::Words(list) = key.info.kind else { continue };
            let words: BTreeSet<String> = list().iter().map(|word| format!("\"{}\"", word.name)).collect();
            let said = table.said(key, "\"zzz\"");
            let wrong = said.iter().find(|one| mentions(&one.message, "\"zzz\"")).expect("an error");
            let help = wrong.help.clone().unwrap_or_default();
            let expected: BTreeSet<String> =
                help.split('"').skip(1).step_by(2).map(|word| format!("\"{word}\"")).collect();
            assert_eq!(words, expected, "{} {}", table.head, key.name);
            count += 1;
        }
    }
    assert!(count >= 11, "{count} choices");
}
