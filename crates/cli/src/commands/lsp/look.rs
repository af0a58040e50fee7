//! Hover text and go-to-definition for the key or name under the cursor.

use std::ops::Range;

use lsp_types::{Hover, HoverContents, MarkupContent, MarkupKind};
use serde_json::{Value, json};

use super::document::OpenDocument;
use crate::scene::keys::key::{DefaultValue, KeyInfo, ValueKind};
use crate::scene::outline::{OutlineKey, OutlineTable};

/// The key under the cursor, and its table. `outer` is the inline table's key if the cursor is inside an
/// inline table, and otherwise equals `key`.
struct KeyAtCursor<'d> {
    table: &'d OutlineTable,
    outer: &'d OutlineKey,
    key: &'d OutlineKey,
}

/// Finds the key whose name or value contains a byte offset.
fn find_key_at_offset(document: &OpenDocument, offset: usize) -> Option<KeyAtCursor<'_>> {
    let holds = |key: &&OutlineKey| {
        let reach = |range: &Range<usize>| range.start <= offset && offset <= range.end;
        reach(&key.name.span) || reach(&key.value)
    };
    document.tables.iter().find_map(|table| {
        let outer = table.keys.iter().find(holds)?;
        let key = outer.inner.iter().find(holds).unwrap_or(outer);
        Some(KeyAtCursor { table, outer, key })
    })
}

/// Returns the hover text for the key under the cursor.
pub(super) fn hover(document: &OpenDocument, offset: usize) -> Option<Value> {
    let KeyAtCursor { table, outer, key } = find_key_at_offset(document, offset)?;
    let name = key.name.text.as_str();
    let text = if std::ptr::eq(key, outer) {
        match table.keys_allowed_for_type().into_iter().find(|one| one.name == name) {
            Some(info) => format!("**{name}**: {}\n\n{}", info.kind_text(), describe_key(info)),
            None if name == "type" => {
                let types =
                    table.info.types.iter().map(|kind| format!("- `\"{}\"`: {}", kind.name, kind.doc));
                types.collect::<Vec<_>>().join("\n")
            }
            None => return None,
        }
    } else {
        let outer = table.keys_allowed_for_type().into_iter().find(|one| one.name == outer.name.text);
        allowed_inline_table_keys(outer).into_iter().find(|(known, _)| *known == name)?.1
    };
    let contents = HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value: text });
    Some(json!(Hover { contents, range: Some(document.to_lsp_range(&key.name.span)) }))
}

/// Describes a key in Markdown: description, unit, range and default.
pub(super) fn describe_key(key: &KeyInfo) -> String {
    let mut text = format!("{}.", key.doc);
    let mut row = |name: &str, value: String| {
        if !value.is_empty() {
            text.push_str(&format!("\n- {name}: {value}"));
        }
    };
    row("unit", key.unit.to_owned());
    row("range", key.range_text());
    row(
        "default",
        match key.default {
            DefaultValue::Alternative(_) | DefaultValue::Absent => String::new(),
            DefaultValue::Required(_) | DefaultValue::Is(_) | DefaultValue::By(_) => key.default_markdown(),
        },
    );
    if let ValueKind::Words(list) = key.kind {
        list().iter().for_each(|word| text.push_str(&format!("\n- `\"{}\"`: {}", word.name, word.meaning)));
    }
    text
}

/// Returns the keys allowed in the inline table that is the value of `outer`, with their descriptions: the table's
/// own keys, or those that refer to a texture.
pub(super) fn allowed_inline_table_keys(outer: Option<&KeyInfo>) -> Vec<(&'static str, String)> {
    let own = outer.map_or(&[] as &[KeyInfo], |outer| outer.kind.inner_keys());
    if !own.is_empty() {
        return own.iter().map(|key| (key.name, describe_key(key))).collect();
    }
    let texture = [
        ("texture", "The name of a texture."),
        ("channel", "The channel to read: `\"r\"`, `\"g\"`, `\"b\"` or `\"a\"`."),
        ("scale", "A scale factor for the texture. Only allowed in `emission`."),
    ];
    texture.map(|(name, doc)| (name, doc.to_owned())).to_vec()
}

/// Returns the location of the definition of the name under the cursor.
pub(super) fn definition(document: &OpenDocument, offset: usize) -> Option<Value> {
    let KeyAtCursor { table, outer, key } = find_key_at_offset(document, offset)?;
    let group = if std::ptr::eq(key, outer) {
        table
            .keys_allowed_for_type()
            .into_iter()
            .find(|one| one.name == key.name.text)?
            .kind
            .defining_table()?
    } else if key.name.text == "texture" {
        "textures"
    } else {
        return None;
    };
    let name = key.text.as_deref()?;
    let named =
        document.tables.iter().filter(|one| one.info.name == group).filter_map(|one| one.name.as_ref());
    let definition = named.into_iter().find(|one| one.text == name)?;
    Some(json!(document.to_lsp_range(&definition.span)))
}
