//! Completes tables, keys, values and names defined in the document.

use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionTextEdit, Documentation, MarkupContent, MarkupKind, Range,
    TextEdit,
};
use serde_json::{Value, json};

use super::document::OpenDocument;
use super::look::{allowed_inline_table_keys, describe_key};
use super::place::{CursorContext, CursorTable, cursor_context};
use crate::scene::keys::key::{ChoiceValue, KeyInfo, TableSyntax, ValueKind};
use crate::scene::keys::{all_tables, color_names};

/// Returns the candidates at a byte offset, or `None` if nothing can be completed there.
pub(super) fn complete(document: &OpenDocument, offset: usize) -> Option<Value> {
    let items = match cursor_context(&document.text, offset)? {
        CursorContext::Header => header_items(document, offset),
        CursorContext::Key { of, given, is_assigned } => missing_key_items(of, &given, is_assigned),
        CursorContext::Value { of, key, is_quoted } if key == "type" => type_items(of, is_quoted),
        CursorContext::Value { of, key, is_quoted } => {
            of.find_allowed_key(&key).map(|key| value_items(document, key.kind, is_quoted))?
        }
        CursorContext::InnerKey { of, outer, given } => {
            let keys = allowed_inline_table_keys(of.find_allowed_key(&outer))
                .into_iter()
                .filter(|(name, _)| !given.iter().any(|one| one == name));
            keys.map(|(name, doc)| {
                completion_item(name, CompletionItemKind::PROPERTY, &doc, format!("{name} = "))
            })
            .collect()
        }
        CursorContext::InnerValue { of, outer, key, is_quoted } => {
            let inner =
                of.find_allowed_key(&outer).map_or(&[] as &[KeyInfo], |outer| outer.kind.inner_keys());
            match (inner.iter().find(|inner| inner.name == key), key.as_str()) {
                (Some(inner), _) => value_items(document, inner.kind, is_quoted),
                (None, "texture") => defined_name_items(document, "textures", is_quoted),
                (None, "channel") => choice_items(
                    &crate::scene::keys::key::choice_values::<crate::scene::description::Channel>(),
                    is_quoted,
                ),
                (None, _) => Vec::new(),
            }
        }
    };
    Some(json!(items))
}

fn completion_item(label: &str, kind: CompletionItemKind, doc: &str, insert: String) -> CompletionItem {
    let documentation = MarkupContent { kind: MarkupKind::Markdown, value: doc.to_owned() };
    CompletionItem {
        label: label.to_owned(),
        kind: Some(kind),
        documentation: Some(Documentation::MarkupContent(documentation)),
        insert_text: Some(insert),
        ..CompletionItem::default()
    }
}

/// Returns candidates for table headers. Each replaces the partial header, including closing brackets
/// inserted by the editor.
fn header_items(document: &OpenDocument, offset: usize) -> Vec<CompletionItem> {
    let before = &document.text[..offset];
    let line = before.rsplit('\n').next().unwrap_or_default().trim_start();
    let rest = &document.text[offset..];
    let closed = rest.len() - rest.trim_start_matches(']').len();
    let [start, end] = [offset - line.len(), offset + closed].map(|at| document.position(at));
    let is_there = |table: &str| document.tables.iter().any(|one| one.info.name == table);
    let open = all_tables().iter().filter(|table| table.form != TableSyntax::Single || !is_there(table.name));
    let headers = open.flat_map(|table| [(table.header(), table)].into_iter().chain(table.inner_headers()));
    headers
        .map(|(head, table)| {
            let edit = TextEdit { range: Range { start, end }, new_text: head.clone() };
            CompletionItem {
                text_edit: Some(CompletionTextEdit::Edit(edit)),
                filter_text: Some(head.clone()),
                insert_text: None,
                ..completion_item(&head, CompletionItemKind::MODULE, table.doc, String::new())
            }
        })
        .collect()
}

/// Returns candidates for a table's missing keys. They include example values unless `=` follows the cursor.
fn missing_key_items(of: CursorTable, given: &[String], is_assigned: bool) -> Vec<CompletionItem> {
    let whole =
        |name: &str, value: &str| if is_assigned { name.to_owned() } else { format!("{name} = {value}") };
    let mut items: Vec<CompletionItem> = Vec::new();
    let is_given = |name: &str| given.iter().any(|one| one == name);
    if !of.info.types.is_empty() && !is_given("type") {
        let default = of.info.types.first().map_or("", |kind| kind.name);
        items.push(completion_item(
            "type",
            CompletionItemKind::PROPERTY,
            "",
            whole("type", &format!("\"{default}\"")),
        ));
    }
    let key = |key: &&KeyInfo| {
        let mut item = completion_item(
            key.name,
            CompletionItemKind::PROPERTY,
            &describe_key(key),
            whole(key.name, &key.default_or_example()),
        );
        item.detail = Some(key.kind_text().replace('`', ""));
        item
    };
    items.extend(of.allowed_keys().iter().filter(|key| !is_given(key.name)).map(key));
    items
}

fn type_items(of: CursorTable, is_quoted: bool) -> Vec<CompletionItem> {
    let list: Vec<ChoiceValue> =
        of.info.types.iter().map(|kind| ChoiceValue { name: kind.name, meaning: kind.doc }).collect();
    choice_items(&list, is_quoted)
}

fn value_items(document: &OpenDocument, kind: ValueKind, is_quoted: bool) -> Vec<CompletionItem> {
    let texture = |more: &str| {
        completion_item(
            "{ texture = … }",
            CompletionItemKind::STRUCT,
            "",
            format!("{{ texture = \"\"{more} }}"),
        )
    };
    let colors = || {
        let color = |name: &str| {
            completion_item(name, CompletionItemKind::COLOR, "", quote_unless_quoted(name, is_quoted))
        };
        color_names().map(color).collect::<Vec<_>>()
    };
    match kind {
        ValueKind::Words(list) => choice_items(&list(), is_quoted),
        ValueKind::Flag => ["true", "false"]
            .map(|flag| completion_item(flag, CompletionItemKind::VALUE, "", flag.to_owned()))
            .to_vec(),
        ValueKind::Material
        | ValueKind::MaterialPair
        | ValueKind::Texture
        | ValueKind::Heights
        | ValueKind::Group => kind
            .defining_table()
            .map_or_else(Vec::new, |table| defined_name_items(document, table, is_quoted)),
        ValueKind::Color(_) | ValueKind::ColorPair(_) => colors(),
        ValueKind::ColorOrTexture(_) | ValueKind::Emission(_) if is_quoted => colors(),
        ValueKind::ColorOrTexture(_) | ValueKind::Emission(_) => {
            colors().into_iter().chain([texture("")]).collect()
        }
        ValueKind::NumberOrTexture(_) => vec![texture("")],
        ValueKind::Whole(..)
        | ValueKind::Number(_)
        | ValueKind::Text
        | ValueKind::File(_)
        | ValueKind::Numbers(..)
        | ValueKind::Scale(_)
        | ValueKind::Rotation
        | ValueKind::InlineTable(_) => Vec::new(),
    }
}

fn choice_items(list: &[ChoiceValue], is_quoted: bool) -> Vec<CompletionItem> {
    let word = |word: &ChoiceValue| {
        completion_item(
            word.name,
            CompletionItemKind::ENUM_MEMBER,
            word.meaning,
            quote_unless_quoted(word.name, is_quoted),
        )
    };
    list.iter().map(word).collect()
}

/// Returns completion items for the names that tables of type `table` define. For example, `[materials.wall]`
/// defines the name `wall`.
fn defined_name_items(document: &OpenDocument, table: &str, is_quoted: bool) -> Vec<CompletionItem> {
    let named =
        document.tables.iter().filter(|one| one.info.name == table).filter_map(|one| one.name.as_ref());
    named
        .map(|name| {
            completion_item(
                &name.text,
                CompletionItemKind::REFERENCE,
                "",
                quote_unless_quoted(&name.text, is_quoted),
            )
        })
        .collect()
}

fn quote_unless_quoted(text: &str, is_quoted: bool) -> String {
    if is_quoted { text.to_owned() } else { crate::scene::quote_toml_string(text) }
}
