//! JSON Schemas for key values.

use serde_json::{Value, json};

use super::{key_schema, object_schema};
use crate::args::SchemaDraft;
use crate::choice::Choice;
use crate::math::limits::{MAX_MAGNITUDE, MIN_LENGTH};
use crate::scene::description::Channel;
use crate::scene::keys::color_names;
use crate::scene::keys::key::ValueKind;
use crate::scene::keys::limits::Limits;

/// Returns the schema for a value type.
pub(super) fn value_schema(kind: ValueKind, draft: SchemaDraft) -> Value {
    match kind {
        ValueKind::Whole(least, most) => json!({ "type": "integer", "minimum": least, "maximum": most }),
        ValueKind::Number(limits) => number_schema(limits, draft),
        ValueKind::Flag => json!({ "type": "boolean" }),
        ValueKind::Words(list) => {
            let words = list();
            let names: Vec<&str> = words.iter().map(|word| word.name).collect();
            let meanings: Vec<&str> = words.iter().map(|word| word.meaning).collect();
            let mut schema = json!({ "type": "string", "enum": names });
            if draft == SchemaDraft::Four {
                schema["x-taplo"] = json!({ "docs": { "enumValues": meanings } });
            }
            schema
        }
        // Names must not be numbers, because shapes can also be referenced by number.
        ValueKind::Text => json!({ "type": "string", "pattern": "[^0-9]" }),
        ValueKind::File(endings) => path_schema(endings),
        ValueKind::Color(limits) => json!({ "anyOf": color_schemas(limits, draft) }),
        ValueKind::ColorPair(limits) => {
            let color = json!({ "anyOf": color_schemas(limits, draft) });
            json!({ "type": "array", "items": color, "minItems": 2, "maxItems": 2 })
        }
        ValueKind::ColorOrTexture(limits) => {
            any_of(color_schemas(limits, draft), texture_reference_schema(json!({})))
        }
        ValueKind::Emission(limits) => {
            let scale = json!({ "anyOf": color_schemas(Limits::AtLeast(0.0), draft) });
            any_of(color_schemas(limits, draft), texture_reference_schema(json!({ "scale": scale })))
        }
        ValueKind::NumberOrTexture(limits) => {
            any_of(vec![number_schema(limits, draft)], texture_with_channel_schema())
        }
        ValueKind::Numbers(count, _, limits) => number_array_schema(count, limits, draft),
        ValueKind::Scale(limits) => {
            json!({ "anyOf": [number_schema(limits, draft), number_array_schema(3, limits, draft)] })
        }
        ValueKind::Rotation => {
            let rotation = |count| number_array_schema(count, Limits::Between(-1.001, 1.001), draft);
            any_of(vec![rotation(9)], rotation(16))
        }
        ValueKind::Texture | ValueKind::Material | ValueKind::Group => {
            json!({ "type": "string", "minLength": 1 })
        }
        ValueKind::MaterialPair => {
            let name = json!({ "type": "string", "minLength": 1 });
            json!({ "type": "array", "items": name, "minItems": 2, "maxItems": 2 })
        }
        ValueKind::InlineTable(keys) => {
            object_schema(&keys.iter().collect::<Vec<_>>(), draft, |key| key_schema(key, draft))
        }
        ValueKind::Heights => {
            any_of(vec![json!({ "type": "string", "minLength": 1 })], texture_with_channel_schema())
        }
    }
}

fn any_of(mut values: Vec<Value>, more: Value) -> Value {
    values.push(more);
    json!({ "anyOf": values })
}

fn number_schema(limits: Limits, draft: SchemaDraft) -> Value {
    let between = |least: f64, most: f64| json!({ "type": "number", "minimum": least, "maximum": most });
    match limits {
        Limits::Any => between(-MAX_MAGNITUDE, MAX_MAGNITUDE),
        Limits::NotZero => {
            let mut schema = between(-MAX_MAGNITUDE, MAX_MAGNITUDE);
            schema["not"] = json!({ "enum": [0] });
            schema
        }
        Limits::AtLeast(least) => between(least, MAX_MAGNITUDE),
        Limits::Length => between(MIN_LENGTH, MAX_MAGNITUDE),
        Limits::LengthOrZero => between(0.0, MAX_MAGNITUDE),
        Limits::Between(least, most) => between(least, most),
        Limits::Inside(low, high) => match draft {
            SchemaDraft::Four => {
                let mut schema = between(low, high);
                schema["exclusiveMinimum"] = true.into();
                schema["exclusiveMaximum"] = true.into();
                schema
            }
            SchemaDraft::Latest => {
                json!({ "type": "number", "exclusiveMinimum": low, "exclusiveMaximum": high })
            }
        },
        Limits::UpTo(low, most) => match draft {
            SchemaDraft::Four => {
                let mut schema = between(low, most);
                schema["exclusiveMinimum"] = true.into();
                schema
            }
            SchemaDraft::Latest => json!({ "type": "number", "exclusiveMinimum": low, "maximum": most }),
        },
    }
}

fn number_array_schema(count: usize, limits: Limits, draft: SchemaDraft) -> Value {
    json!({ "type": "array", "items": number_schema(limits, draft), "minItems": count, "maxItems": count })
}

/// Returns the schemas for a color.
fn color_schemas(limits: Limits, draft: SchemaDraft) -> Vec<Value> {
    let written = json!({ "$ref": format!("#/{}/color", draft.definitions_keyword()) });
    vec![number_schema(limits, draft), number_array_schema(3, limits, draft), written]
}

/// Returns the schema for a color string.
pub(super) fn color_string_schema() -> Value {
    let mut names: Vec<&str> = color_names().collect();
    names.sort_unstable();
    json!({
        "description": "An sRGB color: `#rrggbb` or a CSS color name, ignoring case.",
        "anyOf": [{ "enum": names }, { "type": "string", "pattern": color_pattern(&names) }],
    })
}

/// Returns a case-insensitive pattern for `#rrggbb` and color names.
fn color_pattern(names: &[&str]) -> String {
    let in_any_case =
        |text: &str| text.chars().map(|c| format!("[{}{c}]", c.to_ascii_uppercase())).collect::<String>();
    let names: Vec<String> = names.iter().map(|name| in_any_case(name)).collect();
    format!("^(#[0-9A-Fa-f]{{6}}|{})$", names.join("|"))
}

/// Returns the schema for a path with one of these extensions, ignoring case.
fn path_schema(endings: &[&str]) -> Value {
    let in_any_case = |ending: &&str| {
        ending
            .chars()
            .map(|c| {
                if c.is_ascii_lowercase() {
                    format!("[{}{c}]", c.to_ascii_uppercase())
                } else {
                    c.to_string()
                }
            })
            .collect::<String>()
    };
    let endings: Vec<String> = endings.iter().map(in_any_case).collect();
    if endings.is_empty() {
        return json!({ "type": "string", "minLength": 1 });
    }
    json!({ "type": "string", "pattern": format!("\\.({})$", endings.join("|")) })
}

/// Returns the schema for `{ texture = "name" }` with additional keys.
fn texture_reference_schema(more: Value) -> Value {
    let mut properties = more;
    properties["texture"] =
        json!({ "type": "string", "minLength": 1, "description": "The name of a texture." });
    json!({ "type": "object", "properties": properties, "required": ["texture"], "additionalProperties": false })
}

/// Returns the schema for `{ texture = "name", channel = "r" }`.
fn texture_with_channel_schema() -> Value {
    let names: Vec<&str> = Channel::ALL.iter().map(|channel| channel.name()).collect();
    let doc = "The channel to read. The default is luminance, or alpha for opacity.";
    texture_reference_schema(json!({ "channel": { "type": "string", "enum": names, "description": doc } }))
}
