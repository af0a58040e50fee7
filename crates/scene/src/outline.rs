//! Finds the tables in a scene's text and the spans of their keys, values and names, for use in completions
//! and editors. The text may contain errors.

use std::ops::Range;

use super::keys::all_tables;
use super::keys::key::{KeyInfo, TableInfo, TableSyntax, TableTypeInfo};
use super::toml::{self, Entries, KeyValue, Value};

/// A table with a known definition.
#[derive(Clone, Debug)]
pub struct OutlineTable {
    /// The table's definition.
    pub info: &'static TableInfo,
    /// The type that the key `type` selects, or the default type. `None` if the definition has no types or if
    /// the type is unknown.
    pub kind: Option<&'static TableTypeInfo>,
    /// `NAME` in `[materials.NAME]`, or a shape's `name`.
    pub name: Option<SpannedName>,
    /// 1-based position in a list of tables, or 1 for other tables.
    pub number: usize,
    /// Byte range of the header or the braces.
    pub span: Range<usize>,
    /// The table's keys.
    pub keys: Vec<OutlineKey>,
}

/// A name and its span.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpannedName {
    /// The name.
    pub text: String,
    /// Byte range of the name in the text.
    pub span: Range<usize>,
}

/// A key and its value.
#[derive(Clone, Debug)]
pub struct OutlineKey {
    /// The key.
    pub name: SpannedName,
    /// Byte range of the value.
    pub value: Range<usize>,
    /// The value, if it is a string.
    pub text: Option<String>,
    /// The keys of an inline table.
    pub inner: Vec<OutlineKey>,
}

/// Returns the tables in a text, in the order of [`all_tables`].
pub fn document_outline(text: &str) -> Vec<OutlineTable> {
    let (document, _) = toml::parse(text);
    let of = |info: &'static TableInfo| {
        let found = document.root().get(info.name);
        found.map_or_else(Vec::new, |found| outline_tables_of_definition(info, &found))
    };
    all_tables().iter().flat_map(of).collect()
}

/// Returns the tables whose definition is `info`.
fn outline_tables_of_definition(info: &'static TableInfo, found: &KeyValue<'_>) -> Vec<OutlineTable> {
    match info.form {
        TableSyntax::Single => found
            .value
            .as_table()
            .map(|all| outline_table(info, None, 1, found.value, &all))
            .into_iter()
            .collect(),
        TableSyntax::Named => {
            let named = found.value.as_table().into_iter().flat_map(|all| all.iter().collect::<Vec<_>>());
            named
                .filter_map(|one| {
                    let name = SpannedName { text: one.key.to_owned(), span: one.span };
                    Some(outline_table(info, Some(name), 1, one.value, &one.value.as_table()?))
                })
                .collect()
        }
        TableSyntax::List => {
            let elements =
                found.value.as_array().into_iter().flat_map(|array| array.iter().collect::<Vec<_>>());
            elements
                .enumerate()
                .filter_map(|(index, value)| {
                    let all = value.as_table()?;
                    let name = all.get("name").and_then(|name| spanned_string_value(name.value));
                    Some(outline_table(info, name, index + 1, value, &all))
                })
                .collect()
        }
    }
}

fn outline_table(
    info: &'static TableInfo,
    name: Option<SpannedName>,
    number: usize,
    value: Value<'_>,
    all: &Entries<'_>,
) -> OutlineTable {
    let kind = all.get("type").map(|kind| spanned_string_value(kind.value));
    let kind = match &kind {
        Some(Some(kind)) => info.find_type_or_default(Some(&kind.text)),
        Some(None) => None,
        None => info.find_type_or_default(None),
    };
    OutlineTable { info, kind, name, number, span: value.span(), keys: outline_keys(all) }
}

fn outline_keys(all: &Entries<'_>) -> Vec<OutlineKey> {
    let key = |one: KeyValue<'_>| OutlineKey {
        name: SpannedName { text: one.key.to_owned(), span: one.span },
        value: one.value.span(),
        text: spanned_string_value(one.value).map(|text| text.text),
        inner: one.value.as_table().map_or_else(Vec::new, |inner| outline_keys(&inner)),
    };
    all.iter().map(key).collect()
}

/// Returns a string value with its span, or `None` for other values.
fn spanned_string_value(value: Value<'_>) -> Option<SpannedName> {
    value.as_str().map(|text| SpannedName { text: text.to_owned(), span: value.span() })
}

impl OutlineTable {
    /// Returns the keys allowed for the table's type, or for any type if the table's type is unknown.
    pub fn keys_allowed_for_type(&self) -> Vec<&'static KeyInfo> {
        match self.kind {
            None if !self.info.types.is_empty() => {
                let all = self.info.types.iter().flat_map(|kind| kind.keys);
                let mut known: Vec<&'static KeyInfo> = Vec::new();
                for key in all.chain(self.info.keys) {
                    if !known.iter().any(|other| other.name == key.name) {
                        known.push(key);
                    }
                }
                known
            }
            kind => self.info.keys_for_type(kind).collect(),
        }
    }

    /// Returns the key prefixes with which `--set` can refer to this table.
    pub fn set_arg_prefixes(&self) -> Vec<String> {
        let table = self.info.name;
        let name = self.name.as_ref().map(|name| format!("{table}.{}", toml::quote_key_part(&name.text)));
        match self.info.form {
            TableSyntax::Single => vec![table.to_owned()],
            TableSyntax::Named => name.into_iter().collect(),
            TableSyntax::List => [format!("{table}.{}", self.number)].into_iter().chain(name).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[render]\nsamples = 3\n[materials]\nwall = { type = \"mirror\" }\n\"back wall\".diffuse = { texture = \"a\" }\n\
                        [[sphere]]\nname = \"ball\"\n[[sphere]]\n[[light]]\ntype = \"sun\"\n[nonsense]\na = 1\n[broken";

    #[test]
    fn tables_have_names_types_and_paths() {
        let found: Vec<(Vec<String>, &str)> = document_outline(TEXT)
            .iter()
            .map(|table| (table.set_arg_prefixes(), table.kind.map_or("", |kind| kind.name)))
            .collect();
        let expected: [(&[&str], &str); 6] = [
            (&["render"], ""),
            (&["materials.wall"], "mirror"),
            (&["materials.\"back wall\""], "phong"),
            (&["sphere.1", "sphere.ball"], ""),
            (&["sphere.2"], ""),
            (&["light.1"], ""),
        ];
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for ((paths, kind), (expected, expected_kind)) in found.iter().zip(expected) {
            assert_eq!(
                (paths.iter().map(String::as_str).collect::<Vec<_>>().as_slice(), *kind),
                (expected, expected_kind)
            );
        }
    }

    #[test]
    fn inline_table_keys_have_spans() {
        let tables = document_outline(TEXT);
        let wall = tables
            .iter()
            .find(|table| table.set_arg_prefixes() == ["materials.\"back wall\""])
            .expect("a table");
        let [diffuse] = wall.keys.as_slice() else { panic!("{wall:?}") };
        assert_eq!(&TEXT[diffuse.name.span.clone()], "diffuse");
        assert_eq!(&TEXT[diffuse.value.clone()], "{ texture = \"a\" }");
        assert_eq!(diffuse.inner[0].text.as_deref(), Some("a"));
    }

    #[test]
    fn unknown_types_allow_all_keys() {
        let tables = document_outline(TEXT);
        let known = |path: &str| {
            let table = tables
                .iter()
                .find(|table| table.set_arg_prefixes().contains(&path.to_owned()))
                .expect("a table");
            table.keys_allowed_for_type().iter().map(|key| key.name).collect::<Vec<_>>()
        };
        assert_eq!(
            known("light.1"),
            ["position", "intensity", "falloff", "look_at", "angle", "blend", "direction", "irradiance"]
        );
        assert!(known("materials.wall").starts_with(&["reflectance", "emission"]));
        assert!(known("sphere.2").ends_with(&["material", "name", "matrix"]));
    }
}
