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
    /// Key of the table, or of the list that contains it, such as `sphere` or `groups.chair.sphere`.
    path: String,
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
        found.map_or_else(Vec::new, |found| outline_tables_of_definition(info, info.name, found.value))
    };
    all_tables().iter().flat_map(of).collect()
}

/// Returns the tables with the definition `info` at `path`, and the tables inside them.
fn outline_tables_of_definition(info: &'static TableInfo, path: &str, found: Value<'_>) -> Vec<OutlineTable> {
    match info.form {
        TableSyntax::Single => outline_table(info, path, None, (1, found)).into_iter().collect(),
        TableSyntax::Named => {
            let named = found.as_table().into_iter().flat_map(|all| all.iter().collect::<Vec<_>>());
            let of_name = |one: KeyValue<'_>| {
                let path = format!("{path}.{}", toml::quote_key_part(one.key));
                let name = SpannedName { text: one.key.to_owned(), span: one.span };
                let inner = (info.tables)().iter().flat_map(|inner| {
                    let found = one.value.as_table().and_then(|all| all.get(inner.name));
                    let path = format!("{path}.{}", inner.name);
                    found.map_or_else(Vec::new, |list| outline_tables_of_definition(inner, &path, list.value))
                });
                let own = outline_table(info, &path, Some(name), (1, one.value));
                own.into_iter().chain(inner).collect::<Vec<_>>()
            };
            named.flat_map(of_name).collect()
        }
        TableSyntax::List => {
            let elements = found.as_array().into_iter().flat_map(|array| array.iter().collect::<Vec<_>>());
            let of_element = |(number, value): (usize, Value<'_>)| {
                let name = value.as_table()?.get("name").and_then(|name| spanned_string_value(name.value));
                outline_table(info, path, name, (number, value))
            };
            (1..).zip(elements).filter_map(of_element).collect()
        }
    }
}

/// Returns the table `value`, or `None` if the value is not a table.
fn outline_table(
    info: &'static TableInfo,
    path: &str,
    name: Option<SpannedName>,
    (number, value): (usize, Value<'_>),
) -> Option<OutlineTable> {
    let all = &value.as_table()?;
    let kind = all.get("type").map(|kind| spanned_string_value(kind.value));
    let kind = match &kind {
        Some(Some(kind)) => info.find_type_or_default(Some(&kind.text)),
        Some(None) => None,
        None => info.find_type_or_default(None),
    };
    let mut keys = outline_keys(all);
    keys.retain(|key| info.find_inner_table(&key.name.text).is_none());
    Some(OutlineTable { info, path: path.to_owned(), kind, name, number, span: value.span(), keys })
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
    pub fn override_key_prefixes(&self) -> Vec<String> {
        let of = |part: &str| format!("{}.{part}", self.path);
        let name = self.name.as_ref().map(|name| of(&toml::quote_key_part(&name.text)));
        match self.info.form {
            TableSyntax::Single | TableSyntax::Named => vec![self.path.clone()],
            TableSyntax::List => [of(&self.number.to_string())].into_iter().chain(name).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[render]\nsamples = 3\n[materials]\nwall = { type = \"mirror\" }\n\"back wall\".diffuse = { texture = \"a\" }\n\
                        [[sphere]]\nname = \"ball\"\n[[sphere]]\n[[groups.\"a b\".box]]\nname = \"lid\"\n[[light]]\ntype = \"sun\"\n[nonsense]\na = 1\n[broken";

    #[test]
    fn tables_have_names_types_and_paths() {
        let found: Vec<(Vec<String>, &str)> = document_outline(TEXT)
            .iter()
            .map(|table| (table.override_key_prefixes(), table.kind.map_or("", |kind| kind.name)))
            .collect();
        let expected: [(&[&str], &str); 8] = [
            (&["render"], ""),
            (&["materials.wall"], "mirror"),
            (&["materials.\"back wall\""], "phong"),
            (&["sphere.1", "sphere.ball"], ""),
            (&["sphere.2"], ""),
            (&["groups.\"a b\""], ""),
            (&["groups.\"a b\".box.1", "groups.\"a b\".box.lid"], ""),
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
            .find(|table| table.override_key_prefixes() == ["materials.\"back wall\""])
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
                .find(|table| table.override_key_prefixes().contains(&path.to_owned()))
                .expect("a table");
            table.keys_allowed_for_type().iter().map(|key| key.name).collect::<Vec<_>>()
        };
        assert_eq!(
            known("light.1"),
            ["position", "intensity", "falloff", "look_at", "angle", "blend", "direction", "irradiance"]
        );
        let wall = known("materials.wall");
        assert!(wall.starts_with(&["reflectance"]) && wall.contains(&"emission"), "{wall:?}");
        assert!(known("sphere.2").ends_with(&["material", "name", "matrix"]));
    }
}
