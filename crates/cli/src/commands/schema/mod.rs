//! The JSON Schema for scene files, generated from the key definitions.
//!
//! Draft 4 is for editors that use Taplo, which does not support `if`. In this draft, a material or light
//! accepts the keys of all types, and dependencies restrict each key to its types. In draft 2020-12, each
//! type has its own schema.

mod value;

use serde_json::{Map, Value, json};

use self::value::{color_string_schema, value_schema};
use crate::args::SchemaDraft;
use crate::console::Console;
use crate::exit::Exit;
use crate::scene::keys::all_tables;
use crate::scene::keys::key::{DefaultValue, KeyInfo, TableInfo, TableSyntax, TableTypeInfo};

/// The file name of the schema.
pub const FILE: &str = "glimt.schema.json";

/// First line of a scene that references the schema in the same folder.
pub const LINE: &str = "#:schema glimt.schema.json\n";

/// Prints the schema.
pub(crate) fn run(draft: SchemaDraft, console: &Console) -> Exit {
    console.print_trusted_text(&schema_text(draft));
    Exit::DONE
}

/// Returns the schema as formatted text.
pub fn schema_text(draft: SchemaDraft) -> String {
    format!("{:#}\n", schema(draft))
}

/// Generates the schema.
pub fn schema(draft: SchemaDraft) -> Value {
    let properties: Map<String, Value> =
        all_tables().iter().map(|info| (info.name.to_owned(), top_level_key_schema(info, draft))).collect();
    let mut schema = json!({
        "$schema": draft.schema_uri(),
        "title": "glimt scene",
        "description": "See `glimt explain KEY`, and `glimt new FILE` for a commented scene.",
        "type": "object",
        "properties": properties,
        "required": ["camera"],
        "additionalProperties": false,
    });
    schema[draft.definitions_keyword()] = json!({ "color": color_string_schema() });
    schema
}

/// Returns the schema for a top-level key: a table, named tables or a list of tables.
fn top_level_key_schema(info: &'static TableInfo, draft: SchemaDraft) -> Value {
    let one = table_schema(info, draft);
    let mut all = match info.form {
        TableSyntax::Single => one,
        TableSyntax::Named => json!({ "type": "object", "additionalProperties": one }),
        TableSyntax::List => json!({ "type": "array", "items": one }),
    };
    all["description"] = info.doc.into();
    all
}

fn table_schema(info: &'static TableInfo, draft: SchemaDraft) -> Value {
    let mut table = match (info.types.is_empty(), draft) {
        (true, _) => {
            object_schema(&info.keys.iter().collect::<Vec<_>>(), draft, |key| key_schema(key, draft))
        }
        (false, SchemaDraft::Four) => all_types_table_schema(info),
        (false, SchemaDraft::Latest) => table_schema_with_type_conditions(info),
    };
    for (name, condition) in key_combination_conditions_for_table(info.name, draft) {
        table[name] = condition;
    }
    for inner in (info.tables)() {
        table["properties"][inner.name] = json!({ "$ref": format!("#/properties/{}", inner.name) });
    }
    table
}

/// Returns the schema for an object that allows only these keys.
fn object_schema(
    keys: &[&'static KeyInfo],
    draft: SchemaDraft,
    of: impl Fn(&'static KeyInfo) -> Value,
) -> Value {
    let properties: Map<String, Value> = keys.iter().map(|key| (key.name.to_owned(), of(key))).collect();
    let is_required =
        |key: &&&KeyInfo| matches!(key.default, DefaultValue::Required(_)) && !has_alternative_key(key);
    let required: Vec<&str> = keys.iter().filter(is_required).map(|key| key.name).collect();
    let mut object = json!({ "type": "object", "properties": properties, "additionalProperties": false });
    // Draft 4 does not allow an empty list.
    if !required.is_empty() || draft == SchemaDraft::Latest {
        object["required"] = required.into();
    }
    object
}

/// Whether a key can be omitted in favor of another key.
fn has_alternative_key(key: &KeyInfo) -> bool {
    matches!(key.name, "position" | "look_at")
}

/// Returns the schema for a key's value, with the key's description and default.
fn key_schema(key: &KeyInfo, draft: SchemaDraft) -> Value {
    let mut schema = value_schema(key.kind, draft);
    schema["description"] = key_description_markdown(key).into();
    if let DefaultValue::Is(default) = key.default
        && let Ok(default) = serde_json::from_str(default)
    {
        schema["default"] = default;
    }
    schema
}

/// Returns a key's description, unit, range and default as Markdown.
fn key_description_markdown(key: &KeyInfo) -> String {
    let named =
        |name: &str, text: String| if text.is_empty() { text } else { format!("\n\n{name}: {text}.") };
    let default = match key.default {
        DefaultValue::Required(_) => "\n\nRequired.".to_owned(),
        DefaultValue::Is(_) | DefaultValue::By(_) => named("Default", key.default_markdown()),
        DefaultValue::Alternative(_) | DefaultValue::Absent => String::new(),
    };
    format!("{}.{}{}{default}", key.doc, named("Unit", key.unit.to_owned()), named("Range", key.range_text()))
}

/// Returns the schema for a table that has types, with one condition per type.
fn table_schema_with_type_conditions(info: &'static TableInfo) -> Value {
    let draft = SchemaDraft::Latest;
    let conditions: Vec<Value> = info
        .types
        .iter()
        .map(|kind| {
            let mut then = object_schema(&info.keys_for_type(Some(kind)).collect::<Vec<_>>(), draft, |key| {
                key_schema(key, draft)
            });
            then["properties"]["type"] = json!(true);
            for (name, condition) in key_combination_conditions_for_type(kind.name) {
                then[name] = condition;
            }
            json!({ "if": type_condition(info, kind), "then": then })
        })
        .collect();
    json!({ "type": "object", "properties": { "type": type_key_schema(info) }, "allOf": conditions })
}

/// Returns the condition that a table has this type. The key `type` is optional for the default type.
fn type_condition(info: &TableInfo, kind: &TableTypeInfo) -> Value {
    let is_default = info.types.first().is_some_and(|first| first.name == kind.name);
    let mut condition = json!({ "properties": { "type": { "enum": [kind.name] } } });
    if !is_default {
        condition["required"] = json!(["type"]);
    }
    condition
}

/// Returns the schema for the key `type`.
fn type_key_schema(info: &TableInfo) -> Value {
    let names: Vec<&str> = info.types.iter().map(|kind| kind.name).collect();
    let docs: Vec<String> = info.types.iter().map(|kind| format!("`{}`: {}", kind.name, kind.doc)).collect();
    json!({ "type": "string", "enum": names, "default": names.first(), "description": docs.join("\n\n") })
}

/// Returns the schema for a table that accepts the keys of all types. Dependencies restrict each key to its
/// types, and conditions require the keys that a type needs.
fn all_types_table_schema(info: &'static TableInfo) -> Value {
    let draft = SchemaDraft::Four;
    let (mut properties, mut dependencies) = (Map::new(), Map::new());
    properties.insert("type".to_owned(), type_key_schema(info));
    for key in info.keys {
        properties.insert(key.name.to_owned(), key_schema(key, draft));
    }
    let own = || info.types.iter().flat_map(|kind| kind.keys.iter().map(move |key| (kind, key)));
    for (_, key) in own() {
        let of_name: Vec<_> = own().filter(|(_, other)| other.name == key.name).collect();
        properties.insert(key.name.to_owned(), shared_key_schema(&of_name));
        if of_name.len() < info.types.len() {
            dependencies.insert(key.name.to_owned(), key_type_restriction_schema(info, &of_name));
        }
    }
    let mut table = json!({ "type": "object", "properties": properties, "additionalProperties": false });
    table["dependencies"] = dependencies.into();
    let required: Vec<Value> =
        info.types.iter().filter_map(|kind| required_keys_condition(info, kind)).collect();
    if !required.is_empty() {
        table["allOf"] = required.into();
    }
    table
}

/// Returns the condition that a table of this type has the type's required keys, or `None` if there are none.
fn required_keys_condition(info: &TableInfo, kind: &TableTypeInfo) -> Option<Value> {
    let is_required = |key: &&KeyInfo| matches!(key.default, DefaultValue::Required(_));
    let required: Vec<&str> = kind.keys.iter().filter(is_required).map(|key| key.name).collect();
    let is_other = json!({ "not": type_condition(info, kind) });
    (!required.is_empty()).then(|| json!({ "anyOf": [is_other, { "required": required }] }))
}

/// Returns the schema for a key shared by several types. It accepts every value that any of the types
/// accepts.
fn shared_key_schema(keys: &[(&'static TableTypeInfo, &'static KeyInfo)]) -> Value {
    let draft = SchemaDraft::Four;
    let mut values: Vec<Value> = keys.iter().map(|(_, key)| value_schema(key.kind, draft)).collect();
    values.dedup();
    let mut schema = match values.as_slice() {
        [one] => one.clone(),
        _ => json!({ "anyOf": values }),
    };
    let docs: Vec<String> = keys
        .iter()
        .map(|(kind, key)| format!("`{}`: {}", kind.name, key_description_markdown(key)))
        .collect();
    schema["description"] = docs.join("\n\n").into();
    schema
}

/// Returns the schema that allows a key only in tables of the types that have this key.
fn key_type_restriction_schema(
    info: &TableInfo,
    keys: &[(&'static TableTypeInfo, &'static KeyInfo)],
) -> Value {
    let names: Vec<&str> = keys.iter().map(|(kind, _)| kind.name).collect();
    let has_default = info.types.first().is_some_and(|first| names.contains(&first.name));
    let mut schema = json!({ "properties": { "type": { "enum": names } } });
    if !has_default {
        schema["required"] = json!(["type"]);
    }
    schema
}

/// Returns conditions on combinations of keys in a table.
fn key_combination_conditions_for_table(table: &str, draft: SchemaDraft) -> Vec<(&'static str, Value)> {
    let none_of = |names: &[&str]| {
        let each: Vec<Value> = names.iter().map(|name| json!({ "required": [name] })).collect();
        json!({ "not": { "anyOf": each } })
    };
    let dependent = match draft {
        SchemaDraft::Four => "dependencies",
        SchemaDraft::Latest => "dependentSchemas",
    };
    match (table, draft) {
        ("camera", _) => vec![
            ("anyOf", json!([{ "required": ["orbiter"] }, { "required": ["position", "look_at"] }])),
            (dependent, projection_key_conditions(&none_of(&["position", "look_at", "up"]))),
        ],
        ("environment", _) => vec![(dependent, json!({ "matrix": none_of(&["rotate"]) }))],
        ("mesh" | "instance", _) => {
            vec![(dependent, json!({ "matrix": none_of(&["scale", "rotate", "translate"]) }))]
        }
        ("materials", SchemaDraft::Four) => {
            let is_other =
                json!({ "not": { "properties": { "type": { "enum": ["metal"] } }, "required": ["type"] } });
            let mut any = vec![is_other];
            any.extend(
                key_combination_conditions_for_type("metal")
                    .into_iter()
                    .map(|(name, condition)| json!({ name: condition })),
            );
            vec![("anyOf", any.into())]
        }
        _ => Vec::new(),
    }
}

/// Returns the conditions under which a camera's keys have an effect. `orbiter` is the condition of that key.
fn projection_key_conditions(orbiter: &Value) -> Value {
    let any_of = |names: &[&str]| json!({ "properties": { "projection": { "enum": names } } });
    let only = |name: &str| json!({ "properties": { "projection": { "enum": [name] } }, "required": ["projection"] });
    let has_lens = any_of(&["perspective", "orthographic"]);
    let mut is_narrow = any_of(&["perspective"]);
    is_narrow["properties"]["fov"] = json!({ "not": { "minimum": 180 } });
    let is_sized = json!({ "required": ["view_height"] });
    json!({
        "orbiter": orbiter,
        "projection": { "anyOf": [any_of(&["perspective", "panorama", "fisheye"]), is_sized] },
        "fov": { "anyOf": [is_narrow, only("fisheye")] },
        "view_height": only("orthographic"),
        "aperture": has_lens,
        "focus": has_lens,
    })
}

/// Returns conditions on combinations of a type's keys.
fn key_combination_conditions_for_type(kind: &str) -> Vec<(&'static str, Value)> {
    match kind {
        // Require exactly one of three groups of keys.
        "metal" => vec![(
            "oneOf",
            json!([{ "required": ["color"] }, { "required": ["eta", "k"] }, { "required": ["element"] }]),
        )],
        _ => Vec::new(),
    }
}
