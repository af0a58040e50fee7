//! Compares two documents key by key. Keys have the same names as in `--set`.

use std::collections::HashMap;

use crate::key_path::shortened_key;
use crate::sanitize::escape_and_truncate;
use crate::toml::{self, Elements, Entries, TomlValue, Value, quote_key_part};

/// Maximum size of documents to parse, in bytes. Parsing a document of this size delays the new render by a
/// few milliseconds.
const MAX_BYTES: usize = 256 << 10;
/// Maximum number of changes listed individually. The others are only counted.
const MAX_LISTED: usize = 3;
/// Maximum number of characters shown per value.
const MAX_VALUE_CHARS: usize = 48;
/// Maximum width of a key in columns.
const MAX_KEY_COLUMNS: usize = 48;

/// Lists the keys whose values differ, with both values. Returns an empty list if no key differs or if a
/// document is not valid TOML.
pub(super) fn key_changes(before: &str, after: &str) -> Vec<String> {
    if before.len().max(after.len()) > MAX_BYTES {
        return Vec::new();
    }
    let ((old, errors), (new, more)) = (toml::parse(before), toml::parse(after));
    if !errors.is_empty() || !more.is_empty() {
        return Vec::new();
    }
    let mut differences = KeyDifferences { texts: [before, after], listed: Vec::new(), count: 0 };
    differences.compare_tables("", old.root(), new.root());
    differences.into_descriptions()
}

/// Key differences found so far.
struct KeyDifferences<'t> {
    /// The source texts before and after the edit.
    texts: [&'t str; 2],
    listed: Vec<String>,
    /// Number of differences, including unlisted differences.
    count: usize,
}

impl KeyDifferences<'_> {
    fn into_descriptions(mut self) -> Vec<String> {
        let rest = self.count - self.listed.len();
        if let Some(last) = self.listed.last_mut().filter(|_| rest > 0) {
            *last += &format!(" and {rest} more");
        }
        self.listed
    }

    fn add(&mut self, description: impl FnOnce() -> String) {
        self.count += 1;
        if self.listed.len() < MAX_LISTED {
            self.listed.push(description());
        }
    }

    /// Compares the entries of two tables.
    fn compare_tables(&mut self, name: &str, old: Entries<'_>, new: Entries<'_>) {
        for entry in new.iter() {
            let name = join_key(name, entry.key);
            match old.get(entry.key) {
                Some(before) => self.compare_values(&name, &before.value, &entry.value),
                None => self.add_unmatched_value_or_elements('+', &name, &entry.value, 1),
            }
        }
        for entry in old.iter().filter(|entry| new.get(entry.key).is_none()) {
            self.add_unmatched_value_or_elements('−', &join_key(name, entry.key), &entry.value, 0);
        }
    }

    fn compare_values(&mut self, name: &str, old: &Value<'_>, new: &Value<'_>) {
        match (old.decode(), new.decode()) {
            (TomlValue::Table(old), TomlValue::Table(new)) => self.compare_tables(name, old, new),
            (TomlValue::Array(old), TomlValue::Array(new))
                if old.starts_with_table() && new.starts_with_table() =>
            {
                self.compare_table_lists(name, old, new);
            }
            _ if is_equal_value(old, new) => {}
            _ => {
                let [old, new] = [(0, old), (1, new)].map(|(text, value)| self.value_text(text, value));
                self.add(|| format!("{} {old} → {new}", shortened_key(name, MAX_KEY_COLUMNS)));
            }
        }
    }

    /// Compares two lists of `[[name]]` tables after skipping their common prefix and suffix.
    fn compare_table_lists(&mut self, name: &str, old: Elements<'_>, new: Elements<'_>) {
        let (old, new): (Vec<Value<'_>>, Vec<Value<'_>>) = (old.iter().collect(), new.iter().collect());
        let least = old.len().min(new.len());
        let is_same = |(a, b): &(&Value<'_>, &Value<'_>)| is_equal_value(a, b);
        let start = old.iter().zip(&new).take_while(is_same).count();
        let end = old.iter().rev().zip(new.iter().rev()).take(least - start).take_while(is_same).count();
        let (old_names, new_names) = (element_names_or_numbers(&old), element_names_or_numbers(&new));
        let changed = |all: &[Value<'_>]| start..all.len() - end;
        for (index, old) in changed(&old).zip(&old[changed(&old)]) {
            if let Some(after) = new[changed(&new)].get(index - start) {
                self.compare_values(&join_key(name, &new_names[index]), old, after);
            }
        }
        let sides = [('+', 1, &new, &new_names, &old), ('−', 0, &old, &old_names, &new)];
        for (sign, text, longer, names, shorter) in sides {
            for index in changed(longer).skip(changed(shorter).len()) {
                self.add_unmatched_entry(sign, &join_key(name, &names[index]), &longer[index], text);
            }
        }
    }

    /// Adds a key that exists in only one document. If its value is an array of tables, adds each table
    /// separately.
    fn add_unmatched_value_or_elements(&mut self, sign: char, name: &str, value: &Value<'_>, text: usize) {
        match value.decode() {
            TomlValue::Array(array) if array.starts_with_table() => {
                let all: Vec<Value<'_>> = array.iter().collect();
                for (element, value) in element_names_or_numbers(&all).iter().zip(&all) {
                    self.add_unmatched_entry(sign, &join_key(name, element), value, text);
                }
            }
            TomlValue::Array(_)
            | TomlValue::Table(_)
            | TomlValue::String(_)
            | TomlValue::Number(_)
            | TomlValue::Boolean(_)
            | TomlValue::Datetime => self.add_unmatched_entry(sign, name, value, text),
        }
    }

    /// Adds a single key or table that exists in only one document.
    fn add_unmatched_entry(&mut self, sign: char, name: &str, value: &Value<'_>, text: usize) {
        let is_short = match value.decode() {
            TomlValue::Table(_) => false,
            TomlValue::Array(array) => !array.starts_with_table(),
            TomlValue::String(_) | TomlValue::Number(_) | TomlValue::Boolean(_) | TomlValue::Datetime => true,
        };
        let shown = if is_short { format!(" = {}", self.value_text(text, value)) } else { String::new() };
        self.add(|| format!("{sign} {}{shown}", shortened_key(name, MAX_KEY_COLUMNS)));
    }

    /// Returns a value's source text, joined into one line and truncated, or `{…}` for a table.
    fn value_text(&self, text: usize, value: &Value<'_>) -> String {
        if let TomlValue::Table(_) = value.decode() {
            return "{…}".to_owned();
        }
        let written = self.texts[text].get(value.span()).unwrap_or_default();
        let shown =
            escape_and_truncate(&written.split_whitespace().collect::<Vec<_>>().join(" "), MAX_VALUE_CHARS);
        // Cut between elements, because a truncated number would look like a different number.
        match (value.decode(), shown.rfind(", ")) {
            (TomlValue::Array(_), Some(end)) if shown.ends_with('…') => format!("{}…", &shown[..end + 2]),
            _ => shown,
        }
    }
}

fn join_key(name: &str, key: &str) -> String {
    if name.is_empty() { quote_key_part(key) } else { format!("{name}.{}", quote_key_part(key)) }
}

/// Returns the key part with which `--set` addresses each element of a list: the element's name if it is
/// unique, and otherwise its 1-based position.
fn element_names_or_numbers(all: &[Value<'_>]) -> Vec<String> {
    let mut counts: HashMap<&str, usize> = HashMap::new();
    for name in all.iter().filter_map(value_of_name_key) {
        *counts.entry(name).or_default() += 1;
    }
    let finds = |name: &&str| name.parse::<usize>().is_err() && counts.get(name) == Some(&1);
    let of = |(number, value): (usize, &Value<'_>)| {
        value_of_name_key(value).filter(finds).map_or_else(|| number.to_string(), str::to_owned)
    };
    (1..).zip(all).map(of).collect()
}

fn value_of_name_key<'t>(value: &Value<'t>) -> Option<&'t str> {
    value.as_table()?.get("name")?.value.as_str()
}

/// Whether two values are equal, ignoring formatting and key order.
fn is_equal_value(a: &Value<'_>, b: &Value<'_>) -> bool {
    match (a.decode(), b.decode()) {
        (TomlValue::Table(a), TomlValue::Table(b)) => {
            let has = |a: Entries<'_>, b: Entries<'_>| {
                a.iter().all(|entry| {
                    b.get(entry.key).is_some_and(|other| is_equal_value(&entry.value, &other.value))
                })
            };
            has(a, b) && has(b, a)
        }
        (TomlValue::Array(a), TomlValue::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| is_equal_value(&a, &b))
        }
        (TomlValue::String(a), TomlValue::String(b)) => a == b,
        (TomlValue::Number(a), TomlValue::Number(b)) => a == b,
        (TomlValue::Boolean(a), TomlValue::Boolean(b)) => a == b,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "[render]\nwidth = 64\n[camera]\nposition = [0, 1, 4]\nfov = 40.0\n[materials]\n\
        wall = { diffuse = [0.8, 0.02, 0.02] }\n[[sphere]]\nname = \"ball\"\nradius = 0.5\n[[sphere]]\nradius = 1\n\
        [[sphere]]\nradius = 2\n";

    #[track_caller]
    fn assert_change(from: &str, to: &str, expected: &str) {
        assert!(SCENE.contains(from), "{from}");
        assert_eq!(key_changes(SCENE, &SCENE.replacen(from, to, 1)).join("; "), expected, "{from} → {to}");
    }

    #[test]
    fn keys_are_named_as_in_set() {
        assert_change("fov = 40.0", "fov = 35", "camera.fov 40.0 → 35");
        assert_change("[0, 1, 4]", "[0, 1,\n  4.5]", "camera.position [0, 1, 4] → [0, 1, 4.5]");
        assert_change("[0.8, 0.02, 0.02]", "\"red\"", "materials.wall.diffuse [0.8, 0.02, 0.02] → \"red\"");
        assert_change("radius = 0.5", "radius = 0.7", "sphere.ball.radius 0.5 → 0.7");
        assert_change("radius = 1", "radius = 3", "sphere.2.radius 1 → 3");
        assert_change_to_two("[[groups.bar.box]]\nname = \"lid\"\nsize = 1", "groups.bar.box.lid.size 1 → 2");
    }

    #[track_caller]
    fn assert_change_to_two(before: &str, expected: &str) {
        assert_eq!(key_changes(before, &before.replacen("= 1", "= 2", 1)).join("; "), expected, "{before}");
    }

    #[test]
    fn keys_with_unusual_names_are_quoted() {
        assert_change_to_two(
            "[materials.\"copper ball\"]\nroughness = 1",
            "materials.\"copper ball\".roughness 1 → 2",
        );
        assert_change_to_two("[materials.\"a.b\"]\nroughness = 1", "materials.\"a.b\".roughness 1 → 2");
        assert_change_to_two("[materials.'say \"x\"']\ntint = 1", "materials.\"say \\\"x\\\"\".tint 1 → 2");
        assert_change_to_two("[[quad]]\nname = \"back wall\"\nu = 1", "quad.\"back wall\".u 1 → 2");
        assert_change_to_two("[[quad]]\nname = \"\"\nu = 1", "quad.\"\".u 1 → 2");
    }

    /// `--set` interprets numbers as positions in the list, and rejects ambiguous names.
    #[test]
    fn ambiguous_names_become_positions() {
        assert_change_to_two("[[quad]]\nname = \"7\"\nu = 1", "quad.1.u 1 → 2");
        let twins = "[[quad]]\nname = \"wall\"\nu = 1\n[[quad]]\nname = \"wall\"";
        assert_change_to_two(twins, "quad.1.u 1 → 2");
    }

    #[test]
    fn long_keys_keep_their_last_part() {
        let name = "a material with a very long name indeed, longer than any line";
        assert_change_to_two(&format!("[materials.\"{name}\"]\nroughness = 1"), "…roughness 1 → 2");
    }

    #[test]
    fn values_are_cut_between_elements() {
        let three = "[-0.3773, 0.9512, 3.5904]";
        assert_change("[0, 1, 4]", three, &format!("camera.position [0, 1, 4] → {three}"));
        let matrix = "[1.25, 0.125, 0.125, 0.125, 0.125, 1.25, 0.125, 0.125, 0.125]";
        let cut = "camera.position [0, 1, 4] → [1.25, 0.125, 0.125, 0.125, 0.125, 1.25, …";
        assert_change("[0, 1, 4]", matrix, cut);
    }

    #[test]
    fn additions_and_removals_are_marked_with_a_sign() {
        assert_change("fov = 40.0\n", "", "− camera.fov = 40.0");
        assert_change("width = 64", "width = 64\nseed = 7", "+ render.seed = 7");
        assert_change("[[sphere]]\nradius = 1\n", "", "− sphere.2");
        assert_change(
            "[[sphere]]\nradius = 1",
            "[[sphere]]\nname = \"b\"\n[[sphere]]\nradius = 1",
            "+ sphere.b",
        );
        assert_change("[[sphere]]\nname", "[[quad]]\nu = 1\n[[sphere]]\nname", "+ quad.1");
        assert_change("[[sphere]]\nname", "[[quad]]\nname = \"wall\"\n[[sphere]]\nname", "+ quad.wall");
    }

    #[test]
    fn changes_after_the_third_are_only_counted() {
        let all = SCENE.replace("64", "32").replace("40.0", "41").replace("radius = ", "radius = 1");
        let expected =
            ["render.width 64 → 32", "camera.fov 40.0 → 41", "sphere.ball.radius 0.5 → 10.5 and 2 more"];
        assert_eq!(key_changes(SCENE, &all), expected);
    }

    #[test]
    fn formatting_changes_are_ignored() {
        for (from, to) in
            [("fov = 40.0", "fov = 40.0 # wide"), ("[0, 1, 4]", "[ 0, 1, 4 ]"), ("\nname", "\n\nname")]
        {
            assert!(key_changes(SCENE, &SCENE.replace(from, to)).is_empty(), "{to}");
        }
        assert!(key_changes(SCENE, "[render").is_empty());
    }
}
