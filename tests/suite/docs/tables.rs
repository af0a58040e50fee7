//! Checks the definitions of scene keys (keys, defaults, ranges, choices) against the program and the
//! documented tables.

use std::collections::BTreeSet;

use glimt::cli::args::SchemaDraft;
use glimt::cli::commands::schema::schema;
use glimt::scene::description::Scene;
use glimt::scene::diagnostic::Severity;
use glimt::scene::keys::key::{DefaultValue, KeyInfo, TableInfo, TableSyntax, TableTypeInfo, ValueKind};
use glimt::scene::keys::{self, limits::Limits};
use glimt::scene::{parse, starter_scene};
use serde_json::Value;

use super::{codes, page, root};
use crate::contract::without_positions;
use crate::test_dir::{TestDir, mentions};

/// A defined table with its header in a scene.
#[derive(Clone)]
struct DefinedTable {
    info: &'static TableInfo,
    kind: Option<&'static TableTypeInfo>,
    head: String,
    /// The page headings for this table, with the number of rows below each.
    headings: Vec<(String, usize)>,
    keys: Vec<&'static KeyInfo>,
}

const WALL: &str = "[materials.wall]\n[groups.stool]\n";
const CAMERA: &str = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";

fn tables() -> Vec<DefinedTable> {
    keys::all_tables().iter().flat_map(of_definition).collect()
}

/// The scene tables for a definition, one for each type.
fn of_definition(info: &'static TableInfo) -> Vec<DefinedTable> {
    let head = info.header().replace("NAME", "it");
    let heading = |code: String| format!("`{code}`");
    if info.types.is_empty() {
        let keys: Vec<&KeyInfo> = info.keys.iter().collect();
        let headings = match info.form {
            TableSyntax::Named if keys.is_empty() => Vec::new(),
            // The last three keys are common to all shapes.
            TableSyntax::List if keys.iter().any(|key| key.name == "material") => {
                vec![(heading(info.header()), keys.len() - 3), ("Every shape".to_owned(), 3)]
            }
            TableSyntax::Single | TableSyntax::Named | TableSyntax::List => {
                vec![(heading(info.header()), keys.len())]
            }
        };
        let inner = info.keys.iter().filter(|key| !key.kind.inner_keys().is_empty());
        let inner = inner.map(|key| of_inline_table(info, key)).collect::<Vec<_>>();
        let own = DefinedTable { info, kind: None, head: format!("{head}\n"), headings, keys };
        return [vec![own], inner].concat();
    }
    let of_type = |kind: &'static TableTypeInfo| {
        let code = format!("type = \"{}\"", kind.name);
        // Opacity applies only to surfaces, coats only to opaque materials, and blends have only their own
        // keys.
        let is_refused = |key: &&KeyInfo| match kind.name {
            "glass" => key.name.starts_with("opacity") || key.name.starts_with("coat"),
            "blend" => info.keys.iter().any(|common| common.name == key.name),
            _ => false,
        };
        let keys = info.keys_for_type(Some(kind)).filter(|key| !is_refused(key)).collect();
        let own = (heading(code.clone()), kind.keys.len());
        let common = (format!("Every {}", info.name.trim_end_matches('s')), info.keys.len());
        let headings = [own, common].into_iter().filter(|(_, count)| *count > 0).collect();
        DefinedTable { info, kind: Some(kind), head: format!("{head}\n{code}\n"), headings, keys }
    };
    info.types.iter().map(of_type).collect()
}

/// The table `[TABLE.KEY]`, which can also be written inline.
fn of_inline_table(info: &'static TableInfo, key: &'static KeyInfo) -> DefinedTable {
    let name: &'static str = format!("{}.{}", info.name, key.name).leak();
    let keys = key.kind.inner_keys();
    let info = Box::leak(Box::new(TableInfo { name, keys, ..info.clone() }));
    let headings = vec![(format!("`[{name}]`"), keys.len())];
    DefinedTable { info, kind: None, head: format!("[{name}]\n"), headings, keys: keys.iter().collect() }
}

/// A value for a required key.
fn example(head: &str, key: &str) -> &'static str {
    match key {
        "position" => "[0, 1, 4]",
        "look_at" => "[0, 1, 0]",
        "center" => "[0, 0.5, 0]",
        "radius" => "0.5",
        "material" => "\"wall\"",
        "group" => "\"stool\"",
        "sun" => "[1, 1, 0]",
        "materials" => "[\"wall\", \"wall\"]",
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
            .filter(|key| matches!(key.default, DefaultValue::Required(_)) && key.name != without);
        let lines: String =
            required.map(|key| format!("{} = {}\n", key.name, example(&self.head, key.name))).collect();
        let camera = if self.head.starts_with("[camera]") { "" } else { CAMERA };
        // The example mesh has no materials.
        let is_bare = self.head.starts_with("[[mesh]]") && without != "material";
        let material = if is_bare { "material = \"wall\"\n" } else { "" };
        // A metal needs exactly one of three groups of keys.
        let group = match without {
            // Each projection has its own keys.
            "fov" => "projection = \"fisheye\"\n",
            "view_height" => "projection = \"orthographic\"\n",
            "projection" if line.contains("orthographic") => "view_height = 1\n",
            _ if !self.head.contains("\"metal\"") => "",
            "color" | "element" => "",
            "eta" => "k = 1\n",
            "k" => "eta = 1\n",
            _ => "color = 1\n",
        };
        format!("{camera}{WALL}{}{lines}{material}{group}{line}\n", self.head)
    }

    /// Parses the table with a line in place of a key. Returns the errors with their help, and the scene.
    fn with(&self, key: &KeyInfo, line: &str) -> (String, Option<Scene>) {
        let outcome = parse(self.scene(key.name, line).into(), &root().join("scenes/page.toml"));
        let errors = outcome.diagnostics.iter().filter(|one| one.severity == Severity::Error);
        let said: Vec<String> = errors
            .map(|one| format!("{}: {}", one.message, one.help.as_deref().unwrap_or_default()))
            .collect();
        (said.join("\n"), outcome.scene.map(without_positions))
    }

    fn takes(&self, key: &KeyInfo, value: &str) -> bool {
        self.with(key, &format!("{} = {value}", key.name)).0.is_empty()
    }

    /// Checks that the reader uses the defined default, or requires the key with the defined example.
    fn check_default(&self, key: &KeyInfo) {
        let (said, without) = self.with(key, "");
        match key.default {
            DefaultValue::Required(example) | DefaultValue::Alternative(example) => {
                let expected = [format!("needs `{}`", key.name), format!("`{} = {example}`", key.name)];
                assert!(expected.iter().all(|part| said.contains(part)), "{}{}: {said}", self.head, key.name);
            }
            DefaultValue::Is(value) => {
                let (refused, with) = self.with(key, &format!("{} = {value}", key.name));
                assert_eq!((&*said, &*refused), ("", ""), "{}{}", self.head, key.name);
                assert!(with.is_some() && with == without, "{}{}: another default", self.head, key.name);
            }
            DefaultValue::By(_) | DefaultValue::Absent => {}
        }
    }

    /// Checks that the reader accepts exactly the defined numbers and choices.
    fn check_range(&self, key: &KeyInfo) {
        let (inside, outside) = accepted_and_rejected(key);
        for (values, is_accepted) in [(inside, true), (outside, false)] {
            for value in values {
                assert_eq!(self.takes(key, &value), is_accepted, "{}{} = {value}", self.head, key.name);
            }
        }
    }

    /// The path of a key for `glimt explain`.
    fn path(&self, key: &KeyInfo) -> String {
        [Some(self.info.name), self.kind.map(|kind| kind.name), Some(key.name)]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
            .join(".")
    }

    /// The schema of a key.
    fn schema<'s>(&self, schema: &'s Value, key: &KeyInfo) -> &'s Value {
        let table = self.info.name.split('.').fold(schema, |table, name| &table["properties"][name]);
        let table = match self.info.form {
            TableSyntax::Single => table,
            TableSyntax::Named => &table["additionalProperties"],
            TableSyntax::List => &table["items"],
        };
        let Some(kind) = self.kind else { return &table["properties"][key.name] };
        let mut all = table["allOf"].as_array().expect("types").iter();
        let of_type = |one: &&Value| one["if"]["properties"]["type"]["enum"][0] == kind.name;
        &all.find(of_type).expect("a type")["then"]["properties"][key.name]
    }
}

/// Values inside and outside a key's range.
fn accepted_and_rejected(key: &KeyInfo) -> (Vec<String>, Vec<String>) {
    let (inside, outside) = match key.kind {
        // Keys for glTF files, which this test's scene does not use.
        ValueKind::Whole(..) if key.default == DefaultValue::Absent => (Vec::new(), Vec::new()),
        ValueKind::Whole(least, most) => {
            (vec![least as f64, most as f64], vec![least as f64 - 1.0, most as f64 + 1.0])
        }
        // A direction must not be zero, and a matrix has a fixed last row.
        ValueKind::Numbers(count, _, Limits::Any) if count != 2 => (Vec::new(), Vec::new()),
        ValueKind::Words(list) => {
            let words = list().iter().map(|word| format!("\"{}\"", word.name)).collect();
            return (words, vec!["\"zzz\"".to_owned()]);
        }
        kind => kind.limits().map_or_else(Default::default, ends),
    };
    let written = |number: f64| match key.kind {
        ValueKind::Numbers(count, ..) => format!("[{}]", vec![number.to_string(); count].join(", ")),
        ValueKind::ColorPair(_) => format!("[{number}, {number}]"),
        _ => number.to_string(),
    };
    (inside.into_iter().map(written).collect(), outside.into_iter().map(written).collect())
}

/// Numbers inside and outside a range.
fn ends(limits: Limits) -> (Vec<f64>, Vec<f64>) {
    const STEP: f64 = 0.001;
    match limits {
        Limits::Any => (vec![-1e18, 1e18], vec![1.1e18]),
        Limits::NotZero => (vec![-2.0, 0.5], vec![0.0]),
        Limits::AtLeast(least) => (vec![least], vec![least - STEP]),
        Limits::Length => (vec![0.25], vec![0.0, -1.0]),
        Limits::LengthOrZero => (vec![0.0], vec![-1.0]),
        Limits::Between(least, most) => (vec![least, most], vec![least - STEP, most + STEP]),
        Limits::Inside(low, high) => (vec![low + STEP, high - STEP], vec![low, high]),
        Limits::UpTo(low, most) => (vec![low + STEP, most], vec![low, most + STEP]),
    }
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
    for DefinedTable { info, kind, head, headings, keys: _ } in tables() {
        let rows = headings.iter().flat_map(|(heading, number)| {
            let rows = page.rows(heading);
            assert_eq!(rows.len(), *number, "{heading}");
            rows
        });
        for (row, key) in rows.zip(info.keys_for_type(kind)) {
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

/// The documentation is covered by `documented_rows_match_definitions`.
#[test]
fn reader_schema_and_explain_follow_definitions() {
    let (dir, schema) = (TestDir::new(), schema(SchemaDraft::Latest));
    let (mut defaults, mut ranges) = (0, 0);
    for table in tables() {
        for key in &table.keys {
            table.check_default(key);
            table.check_range(key);
            defaults += usize::from(matches!(key.default, DefaultValue::Is(_)));
            ranges += usize::from(!accepted_and_rejected(key).1.is_empty());
            let path = table.path(key);

            let text = |value: &Value| value["description"].as_str().unwrap_or_default().to_owned();
            let (defined, described) = (table.schema(&schema, key), text(table.schema(&schema, key)));
            assert!(described.starts_with(&format!("{}.", key.doc)), "{path}: {described}");
            assert!(
                described.contains(&format!("Range: {}.", key.range_text())) || key.range_text().is_empty()
            );
            if let DefaultValue::Is(value) = key.default {
                assert_eq!(defined["default"].to_string().replace(',', ", "), value, "{path}");
            }

            let output = dir.run(&format!("explain {path}"));
            let explained = String::from_utf8(output.stdout).expect("UTF-8");
            let explained = explained.split_whitespace().collect::<Vec<_>>().join(" ");
            let facts = [
                key.doc.to_owned(),
                format!("range {}", key.range_text()),
                format!("default {}", key.default_markdown().trim_matches('*')),
            ];
            for fact in facts.into_iter().filter(|fact| fact != "range ") {
                assert!(explained.contains(&fact.replace('`', "")), "{path}: {fact}\n{explained}");
            }
        }
    }
    assert!(defaults > 100 && ranges > 80, "{defaults} defaults, {ranges} ranges");
}

#[test]
fn definition_has_every_key() {
    let tables = tables();
    assert_eq!(tables.len(), 31);
    for table in tables {
        let text = table.scene("", "zzz = 1");
        let outcome = parse(text.into(), &root().join("scenes/page.toml"));
        let mut all = outcome.diagnostics.iter();
        let unknown = all.find(|one| mentions(&one.message, "`zzz`")).expect("an unknown key");
        let mut expected = codes(unknown.help.as_deref().unwrap_or_default());
        let inner = (table.info.tables)().iter().map(|inner| inner.name);
        let documented: BTreeSet<String> =
            table.keys.iter().map(|key| key.name).chain(inner).map(str::to_owned).collect();
        if table.kind.is_some() {
            expected.remove("type");
        }
        assert_eq!(documented, expected, "{}", table.head);
    }
}

fn uncommented(line: &str) -> &str {
    line.trim_start_matches("# ")
}

#[test]
fn starter_has_every_key_and_choice() {
    let starter = starter_scene();
    for info in keys::all_tables() {
        let head = info.header().replace("NAME]", "").replace("]]", "");
        let has_head = |part: &&str| part.lines().any(|line| uncommented(line).starts_with(&head));
        let parts: Vec<&str> = starter.split("\n\n").filter(has_head).collect();
        let own_types = info.types.iter().flat_map(|kind| kind.keys);
        for key in info.keys.iter().chain(own_types) {
            // The keys that all shapes have are shown once.
            let parts = if ["name", "matrix"].contains(&key.name) { &[starter][..] } else { &parts };
            let setting = format!("{} = ", key.name);
            let is_shown = |line: &&str| line.starts_with(&setting) || line.contains(&format!("`{setting}"));
            let lines = parts.iter().flat_map(|part| part.lines()).map(uncommented);
            let shown: Vec<&str> = lines.filter(is_shown).collect();
            assert!(!shown.is_empty(), "starter: {head} {}", key.name);
            if let ValueKind::Words(list) = key.kind {
                let lacks = |word: &str| shown.iter().all(|line| !line.contains(word));
                let missing: Vec<_> = list().into_iter().filter(|word| lacks(word.name)).collect();
                assert!(missing.is_empty(), "starter: {head} {}: {missing:?}", key.name);
            }
        }
    }
}
