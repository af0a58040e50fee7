//! Keys that differ in two documents, under the names that `--set` knows them by.

use std::collections::HashMap;

use crate::key_path::{part, shortened_key};
use crate::sanitize::shortened;
use crate::toml::{self, Elements, Entries, Item, Value};

/// Bytes of the longest text that is parsed for this: some milliseconds before a save is seen.
const MOST_BYTES: usize = 256 << 10;
/// Most changes with a text of their own; of more, the text has the number.
const TOLD: usize = 3;
/// Characters of a value and of a name that are shown at most.
const VALUE: usize = 48;
const NAME: usize = 48;

/// The keys whose values differ, with both values. Empty if no key differs or a text is not TOML.
pub(super) fn changes(before: &str, after: &str) -> Vec<String> {
    if before.len().max(after.len()) > MOST_BYTES {
        return Vec::new();
    }
    let ((old, errors), (new, more)) = (toml::parse(before), toml::parse(after));
    if !errors.is_empty() || !more.is_empty() {
        return Vec::new();
    }
    let mut found = Found { texts: [before, after], told: Vec::new(), count: 0 };
    found.tables("", old.root(), new.root());
    found.words()
}

/// Differences found so far.
struct Found<'t> {
    /// Before and after.
    texts: [&'t str; 2],
    told: Vec<String>,
    count: usize,
}

impl Found<'_> {
    fn words(mut self) -> Vec<String> {
        let rest = self.count - self.told.len();
        if let Some(last) = self.told.last_mut().filter(|_| rest > 0) {
            *last += &format!(" and {rest} more");
        }
        self.told
    }

    fn tell(&mut self, words: impl FnOnce() -> String) {
        self.count += 1;
        if self.told.len() < TOLD {
            self.told.push(words());
        }
    }

    /// Keys of one table that differ.
    fn tables(&mut self, name: &str, old: Entries<'_>, new: Entries<'_>) {
        for entry in new.iter() {
            let name = joined(name, entry.key);
            match old.get(entry.key) {
                Some(before) => self.values(&name, &before.value, &entry.value),
                None => self.whole('+', &name, &entry.value, 1),
            }
        }
        for entry in old.iter().filter(|entry| new.get(entry.key).is_none()) {
            self.whole('−', &joined(name, entry.key), &entry.value, 0);
        }
    }

    fn values(&mut self, name: &str, old: &Value<'_>, new: &Value<'_>) {
        match (old.item(), new.item()) {
            (Item::Table(old), Item::Table(new)) => self.tables(name, old, new),
            (Item::Array(old), Item::Array(new)) if old.is_of_tables() && new.is_of_tables() => {
                self.lists(name, old, new);
            }
            _ if is_same(old, new) => {}
            _ => {
                let [old, new] = [(0, old), (1, new)].map(|(text, value)| self.text(text, value));
                self.tell(|| format!("{} {old} → {new}", shortened_key(name, NAME)));
            }
        }
    }

    /// Tables `[[name]]`: those that both lists begin and end with are the same ones.
    fn lists(&mut self, name: &str, old: Elements<'_>, new: Elements<'_>) {
        let (old, new): (Vec<Value<'_>>, Vec<Value<'_>>) = (old.iter().collect(), new.iter().collect());
        let least = old.len().min(new.len());
        let is_same = |(a, b): &(&Value<'_>, &Value<'_>)| is_same(a, b);
        let start = old.iter().zip(&new).take_while(is_same).count();
        let end = old.iter().rev().zip(new.iter().rev()).take(least - start).take_while(is_same).count();
        let (old_names, new_names) = (called(&old), called(&new));
        let changed = |all: &[Value<'_>]| start..all.len() - end;
        for (index, old) in changed(&old).zip(&old[changed(&old)]) {
            if let Some(after) = new[changed(&new)].get(index - start) {
                self.values(&joined(name, &new_names[index]), old, after);
            }
        }
        let sides = [('+', 1, &new, &new_names, &old), ('−', 0, &old, &old_names, &new)];
        for (sign, text, longer, names, shorter) in sides {
            for index in changed(longer).skip(changed(shorter).len()) {
                self.one_sided(sign, &joined(name, &names[index]), &longer[index], text);
            }
        }
    }

    /// A key that only one of the texts has; of tables `[[name]]`, each by itself.
    fn whole(&mut self, sign: char, name: &str, value: &Value<'_>, text: usize) {
        match value.item() {
            Item::Array(array) if array.is_of_tables() => {
                let all: Vec<Value<'_>> = array.iter().collect();
                for (element, value) in called(&all).iter().zip(&all) {
                    self.one_sided(sign, &joined(name, element), value, text);
                }
            }
            Item::Array(_)
            | Item::Table(_)
            | Item::String(_)
            | Item::Integer { .. }
            | Item::Float(_)
            | Item::Boolean(_)
            | Item::Datetime => self.one_sided(sign, name, value, text),
        }
    }

    /// A key or a table that only one of the texts has.
    fn one_sided(&mut self, sign: char, name: &str, value: &Value<'_>, text: usize) {
        let is_short = match value.item() {
            Item::Table(_) => false,
            Item::Array(array) => !array.is_of_tables(),
            Item::String(_) | Item::Integer { .. } | Item::Float(_) | Item::Boolean(_) | Item::Datetime => {
                true
            }
        };
        let shown = if is_short { format!(" = {}", self.text(text, value)) } else { String::new() };
        self.tell(|| format!("{sign} {}{shown}", shortened_key(name, NAME)));
    }

    /// A value as it is written, in one line.
    fn text(&self, text: usize, value: &Value<'_>) -> String {
        if let Item::Table(_) = value.item() {
            return "{…}".to_owned();
        }
        let written = self.texts[text].get(value.span()).unwrap_or_default();
        let shown = shortened(&written.split_whitespace().collect::<Vec<_>>().join(" "), VALUE);
        // A number that is cut looks like another number.
        match (value.item(), shown.rfind(", ")) {
            (Item::Array(_), Some(end)) if shown.ends_with('…') => format!("{}…", &shown[..end + 2]),
            _ => shown,
        }
    }
}

fn joined(name: &str, key: &str) -> String {
    if name.is_empty() { part(key) } else { format!("{name}.{}", part(key)) }
}

/// The parts of keys that lead to the elements of a list: the name if `--set` finds the element by it, else the number, from 1.
fn called(all: &[Value<'_>]) -> Vec<String> {
    let mut counts: HashMap<&str, usize> = HashMap::new();
    for name in all.iter().filter_map(name_of) {
        *counts.entry(name).or_default() += 1;
    }
    let finds = |name: &&str| name.parse::<usize>().is_err() && counts.get(name) == Some(&1);
    let of = |(number, value): (usize, &Value<'_>)| {
        name_of(value).filter(finds).map_or_else(|| number.to_string(), str::to_owned)
    };
    (1..).zip(all).map(of).collect()
}

fn name_of<'t>(value: &Value<'t>) -> Option<&'t str> {
    let Item::Table(table) = value.item() else { return None };
    match table.get("name")?.value.item() {
        Item::String(name) => Some(name),
        Item::Array(_)
        | Item::Table(_)
        | Item::Integer { .. }
        | Item::Float(_)
        | Item::Boolean(_)
        | Item::Datetime => None,
    }
}

/// Whether two values mean the same.
fn is_same(a: &Value<'_>, b: &Value<'_>) -> bool {
    match (a.item(), b.item()) {
        (Item::Table(a), Item::Table(b)) => {
            let has = |a: Entries<'_>, b: Entries<'_>| {
                a.iter()
                    .all(|entry| b.get(entry.key).is_some_and(|other| is_same(&entry.value, &other.value)))
            };
            has(a, b) && has(b, a)
        }
        (Item::Array(a), Item::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| is_same(&a, &b))
        }
        (Item::String(a), Item::String(b)) => a == b,
        (Item::Integer { digits: a, radix: of_a }, Item::Integer { digits: b, radix: of_b }) => {
            (a, of_a) == (b, of_b)
        }
        (Item::Float(a), Item::Float(b)) => a == b,
        (Item::Boolean(a), Item::Boolean(b)) => a == b,
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
    fn said(from: &str, to: &str, words: &str) {
        assert!(SCENE.contains(from), "{from}");
        assert_eq!(changes(SCENE, &SCENE.replacen(from, to, 1)).join("; "), words, "{from} → {to}");
    }

    #[test]
    fn keys_are_called_as_in_set() {
        said("fov = 40.0", "fov = 35", "camera.fov 40.0 → 35");
        said("[0, 1, 4]", "[0, 1,\n  4.5]", "camera.position [0, 1, 4] → [0, 1, 4.5]");
        said("[0.8, 0.02, 0.02]", "\"red\"", "materials.wall.diffuse [0.8, 0.02, 0.02] → \"red\"");
        said("radius = 0.5", "radius = 0.7", "sphere.ball.radius 0.5 → 0.7");
        said("radius = 1", "radius = 3", "sphere.2.radius 1 → 3");
    }

    #[track_caller]
    fn changed_to_two(before: &str, words: &str) {
        assert_eq!(changes(before, &before.replacen("= 1", "= 2", 1)).join("; "), words, "{before}");
    }

    #[test]
    fn keys_with_unusual_names_are_quoted() {
        changed_to_two(
            "[materials.\"copper ball\"]\nroughness = 1",
            "materials.\"copper ball\".roughness 1 → 2",
        );
        changed_to_two("[materials.\"a.b\"]\nroughness = 1", "materials.\"a.b\".roughness 1 → 2");
        changed_to_two("[materials.'say \"x\"']\ntint = 1", "materials.\"say \\\"x\\\"\".tint 1 → 2");
        changed_to_two("[[quad]]\nname = \"back wall\"\nu = 1", "quad.\"back wall\".u 1 → 2");
        changed_to_two("[[quad]]\nname = \"\"\nu = 1", "quad.\"\".u 1 → 2");
    }

    /// `--set` takes a number for a place in the list, and refuses a name that two tables have.
    #[test]
    fn names_that_set_cannot_find_give_way_to_numbers() {
        changed_to_two("[[quad]]\nname = \"7\"\nu = 1", "quad.1.u 1 → 2");
        let twins = "[[quad]]\nname = \"wall\"\nu = 1\n[[quad]]\nname = \"wall\"";
        changed_to_two(twins, "quad.1.u 1 → 2");
    }

    #[test]
    fn long_keys_keep_the_property() {
        let name = "a material with a very long name indeed, longer than any line";
        changed_to_two(&format!("[materials.\"{name}\"]\nroughness = 1"), "…roughness 1 → 2");
    }

    #[test]
    fn values_are_whole_or_cut_between_their_elements() {
        let three = "[-0.3773, 0.9512, 3.5904]";
        said("[0, 1, 4]", three, &format!("camera.position [0, 1, 4] → {three}"));
        let matrix = "[1.25, 0.125, 0.125, 0.125, 0.125, 1.25, 0.125, 0.125, 0.125]";
        let cut = "camera.position [0, 1, 4] → [1.25, 0.125, 0.125, 0.125, 0.125, 1.25, …";
        said("[0, 1, 4]", matrix, cut);
    }

    #[test]
    fn what_comes_and_goes_has_a_sign() {
        said("fov = 40.0\n", "", "− camera.fov = 40.0");
        said("width = 64", "width = 64\nseed = 7", "+ render.seed = 7");
        said("[[sphere]]\nradius = 1\n", "", "− sphere.2");
        said("[[sphere]]\nradius = 1", "[[sphere]]\nname = \"b\"\n[[sphere]]\nradius = 1", "+ sphere.b");
        said("[[sphere]]\nname", "[[quad]]\nu = 1\n[[sphere]]\nname", "+ quad.1");
        said("[[sphere]]\nname", "[[quad]]\nname = \"wall\"\n[[sphere]]\nname", "+ quad.wall");
    }

    #[test]
    fn many_changes_are_counted() {
        let all = SCENE.replace("64", "32").replace("40.0", "41").replace("radius = ", "radius = 1");
        let words =
            ["render.width 64 → 32", "camera.fov 40.0 → 41", "sphere.ball.radius 0.5 → 10.5 and 2 more"];
        assert_eq!(changes(SCENE, &all), words);
    }

    #[test]
    fn other_words_for_the_same_scene_are_no_change() {
        for (from, to) in
            [("fov = 40.0", "fov = 40.0 # wide"), ("[0, 1, 4]", "[ 0, 1, 4 ]"), ("\nname", "\n\nname")]
        {
            assert!(changes(SCENE, &SCENE.replace(from, to)).is_empty(), "{to}");
        }
        assert!(changes(SCENE, "[render").is_empty());
    }
}
