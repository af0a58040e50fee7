//! A validator for the subset of JSON Schema used by the scene schema. `.ci/editors.py` runs widely used
//! validators.

use serde_json::{Map, Value};

/// Paths of invalid values, such as `sphere.0.radius`, each with the violated keyword.
pub(super) fn violations(schema: &Value, value: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    check(schema, schema, value, "", &mut found);
    found
}

fn is_valid(root: &Value, schema: &Value, value: &Value) -> bool {
    let mut found = Vec::new();
    check(root, schema, value, "", &mut found);
    found.is_empty()
}

/// Checks a value against a subschema of `root`.
fn check(root: &Value, schema: &Value, value: &Value, path: &str, found: &mut Vec<(String, String)>) {
    let Value::Object(keywords) = schema else { return };
    if let Some(Value::String(reference)) = keywords.get("$ref") {
        let target = root.pointer(reference.trim_start_matches('#')).expect("a definition");
        check(root, target, value, path, found);
    }
    for (keyword, condition) in keywords {
        if !satisfies_keyword(root, keyword, condition, value, keywords) {
            found.push((path.to_owned(), keyword.clone()));
        }
        check_nested(root, keyword, condition, value, keywords, path, found);
    }
}

/// Whether a value satisfies a keyword, ignoring nested values.
fn satisfies_keyword(
    root: &Value,
    keyword: &str,
    condition: &Value,
    value: &Value,
    keywords: &Map<String, Value>,
) -> bool {
    let all = || condition.as_array().expect("a list").iter();
    let limit = || condition.as_f64().expect("a number");
    let flag = |name: &str| keywords.get(name) == Some(&Value::Bool(true));
    match (keyword, value) {
        ("type", _) => is_of_type(condition.as_str().expect("a type"), value),
        ("enum", _) => {
            all().any(|one| one == value || one.as_f64().is_some_and(|one| value.as_f64() == Some(one)))
        }
        ("not", _) => !is_valid(root, condition, value),
        ("anyOf", _) => all().any(|one| is_valid(root, one, value)),
        ("oneOf", _) => all().filter(|one| is_valid(root, one, value)).count() == 1,
        ("required", Value::Object(map)) => all().all(|key| map.contains_key(key.as_str().expect("a key"))),
        ("minItems", Value::Array(items)) => items.len() as f64 >= limit(),
        ("maxItems", Value::Array(items)) => items.len() as f64 <= limit(),
        ("minLength", Value::String(text)) => text.chars().count() as f64 >= limit(),
        ("minimum", Value::Number(number)) => {
            let number = number.as_f64().expect("a number");
            number > limit() || number == limit() && !flag("exclusiveMinimum")
        }
        ("maximum", Value::Number(number)) => {
            let number = number.as_f64().expect("a number");
            number < limit() || number == limit() && !flag("exclusiveMaximum")
        }
        ("exclusiveMinimum", Value::Number(number)) if condition.is_number() => {
            number.as_f64() > Some(limit())
        }
        ("exclusiveMaximum", Value::Number(number)) if condition.is_number() => {
            number.as_f64() < Some(limit())
        }
        ("pattern", Value::String(text)) => matches(condition.as_str().expect("a pattern"), text),
        (
            "required"
            | "minItems"
            | "maxItems"
            | "minLength"
            | "minimum"
            | "maximum"
            | "exclusiveMinimum"
            | "exclusiveMaximum"
            | "pattern"
            | "properties"
            | "additionalProperties"
            | "items"
            | "allOf"
            | "if"
            | "then"
            | "dependencies"
            | "dependentSchemas"
            | "definitions"
            | "$defs"
            | "$ref"
            | "default"
            | "x-taplo",
            _,
        ) => true,
        ("title" | "description" | "$schema", _) => condition.is_string(),
        (unknown, _) => unreachable!("unsupported keyword: {unknown}"),
    }
}

fn check_nested(
    root: &Value,
    keyword: &str,
    condition: &Value,
    value: &Value,
    keywords: &Map<String, Value>,
    path: &str,
    found: &mut Vec<(String, String)>,
) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    let known = |key: &str| keywords.get("properties").is_some_and(|known| known.get(key).is_some());
    match (keyword, value) {
        ("properties", Value::Object(map)) => {
            for (key, schema) in condition.as_object().expect("schemas") {
                if let Some(value) = map.get(key) {
                    check(root, schema, value, &below(key), found);
                }
            }
        }
        ("additionalProperties", Value::Object(map)) => {
            for (key, value) in map.iter().filter(|(key, _)| !known(key)) {
                match condition {
                    Value::Bool(false) => found.push((below(key), keyword.to_owned())),
                    schema => check(root, schema, value, &below(key), found),
                }
            }
        }
        ("items", Value::Array(items)) => {
            for (index, item) in items.iter().enumerate() {
                check(root, condition, item, &below(&index.to_string()), found);
            }
        }
        ("allOf", _) => {
            let all = condition.as_array().expect("a list");
            all.iter().for_each(|one| check(root, one, value, path, found));
        }
        ("if", _) if is_valid(root, condition, value) => check(root, &keywords["then"], value, path, found),
        ("dependencies" | "dependentSchemas", Value::Object(map)) => {
            let schemas = condition.as_object().expect("schemas");
            let given = schemas.iter().filter(|(key, _)| map.contains_key(*key));
            given.for_each(|(_, schema)| check(root, schema, value, path, found));
        }
        _ => {}
    }
}

fn is_of_type(name: &str, value: &Value) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        other => unreachable!("unsupported type: {other}"),
    }
}

/// Whether a string matches one of the supported patterns: `[^0-9]`, `\.(one|other)$` and `^(one|other)$`.
/// `[Pp]` matches a letter in either case.
fn matches(pattern: &str, text: &str) -> bool {
    if pattern == "[^0-9]" {
        return text.chars().any(|c| !c.is_ascii_digit());
    }
    let inner = |begin: &str| pattern.strip_prefix(begin)?.strip_suffix(")$");
    let (words, text) = match (inner("\\.("), inner("^(")) {
        (Some(words), _) => (words, text.rsplit_once('.').map(|(_, ending)| ending)),
        (None, Some(words)) => (words, Some(text)),
        (None, None) => unreachable!("unsupported pattern: {pattern}"),
    };
    let Some(text) = text.map(str::to_ascii_lowercase) else { return false };
    words.split('|').any(|word| match word {
        "#[0-9A-Fa-f]{6}" => text
            .strip_prefix('#')
            .is_some_and(|digits| digits.len() == 6 && digits.chars().all(|digit| digit.is_ascii_hexdigit())),
        word => {
            let plain: String =
                word.chars().filter(|c| c.is_ascii_lowercase() || c.is_ascii_digit()).collect();
            plain == text
        }
    })
}
