//! Keys that differ in two documents, under the names that `--set` knows them by.

use crate::scene::sanitize::shortened;
use crate::scene::toml::{self, Elements, Entries, Item, Value};

/// Bytes of the longest text that is parsed for this: some milliseconds before a save is seen.
const MOST_BYTES: usize = 256 << 10;
/// Most changes with a text of their own; of more, the text has the number.
const TOLD: usize = 3;
/// Characters of a value and of a name that are shown at most.
const VALUE: usize = 48;
const NAME: usize = 48;

/// The keys whose values differ, with both values; `None` if no key differs or one of the texts is no TOML.
pub(super) fn changes(before: &str, after: &str) -> Option<String> {
    if before.len().max(after.len()) > MOST_BYTES {
        return None;
    }
    let ((old, errors), (new, more)) = (toml::parse(before), toml::parse(after));
    if !errors.is_empty() || !more.is_empty() {
        return None;
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
    fn words(self) -> Option<String> {
        let rest = match self.count - self.told.len() {
            0 => String::new(),
            rest => format!(" and {rest} more"),
        };
        (self.count > 0).then(|| self.told.join(", ") + &rest)
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
                self.tell(|| format!("{} {old} → {new}", shortened(name, NAME)));
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
        let (old, new) = (&old[start..old.len() - end], &new[start..new.len() - end]);
        let called = |index: usize, value: &Value<'_>| joined(name, &called(value, start + index + 1));
        for (index, (old, new)) in old.iter().zip(new).enumerate() {
            self.values(&called(index, new), old, new);
        }
        for (sign, text, longer, shorter) in [('+', 1, new, old), ('−', 0, old, new)] {
            for (index, value) in longer.iter().enumerate().skip(shorter.len()) {
                self.one_sided(sign, &called(index, value), value, text);
            }
        }
    }

    /// A key that only one of the texts has; of tables `[[name]]`, each by itself.
    fn whole(&mut self, sign: char, name: &str, value: &Value<'_>, text: usize) {
        match value.item() {
            Item::Array(array) if array.is_of_tables() => {
                for (index, value) in array.iter().enumerate() {
                    self.one_sided(sign, &joined(name, &called(&value, index + 1)), &value, text);
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
        self.tell(|| format!("{sign} {}{shown}", shortened(name, NAME)));
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
    if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") }
}

/// The name of a shape, else its number, from 1.
fn called(value: &Value<'_>, number: usize) -> String {
    if let Item::Table(table) = value.item()
        && let Some(entry) = table.get("name")
        && let Item::String(name) = entry.value.item()
    {
        return name.to_owned();
    }
    number.to_string()
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
        assert_eq!(changes(SCENE, &SCENE.replacen(from, to, 1)).as_deref(), Some(words), "{from} → {to}");
    }

    #[test]
    fn keys_are_called_as_in_set() {
        said("fov = 40.0", "fov = 35", "camera.fov 40.0 → 35");
        said("[0, 1, 4]", "[0, 1,\n  4.5]", "camera.position [0, 1, 4] → [0, 1, 4.5]");
        said("[0.8, 0.02, 0.02]", "\"red\"", "materials.wall.diffuse [0.8, 0.02, 0.02] → \"red\"");
        said("radius = 0.5", "radius = 0.7", "sphere.ball.radius 0.5 → 0.7");
        said("radius = 1", "radius = 3", "sphere.2.radius 1 → 3");
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
        let words = "render.width 64 → 32, camera.fov 40.0 → 41, sphere.ball.radius 0.5 → 10.5 and 2 more";
        assert_eq!(changes(SCENE, &all).as_deref(), Some(words));
    }

    #[test]
    fn other_words_for_the_same_scene_are_no_change() {
        for (from, to) in
            [("fov = 40.0", "fov = 40.0 # wide"), ("[0, 1, 4]", "[ 0, 1, 4 ]"), ("\nname", "\n\nname")]
        {
            assert_eq!(changes(SCENE, &SCENE.replace(from, to)), None, "{to}");
        }
        assert_eq!(changes(SCENE, "[render"), None);
    }
}
