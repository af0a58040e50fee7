//! References to the values of a document, which are decoded when they are read.

use std::ops::Range;

use super::number::Number;
use super::{Document, NONE, NodeKind, TableEntry, TableId, ValueNode};

/// A reference to a value in a document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Value<'d> {
    pub(super) document: &'d Document<'d>,
    pub(super) node: ValueNode,
}

/// A decoded value.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TomlValue<'d> {
    /// A decoded string, without quotes or escapes.
    String(&'d str),
    /// An integer or a float.
    Number(Number<'d>),
    /// `true` or `false`.
    Boolean(bool),
    /// A date, a time, or both.
    Datetime,
    /// An array, or all `[[name]]` tables.
    Array(Elements<'d>),
    /// A table from a header, braces or a dotted key.
    Table(Entries<'d>),
}

impl<'d> Value<'d> {
    /// Returns the byte range in the source. For a table, this is the range of its header or braces.
    pub(crate) fn span(&self) -> Range<usize> {
        self.node.span.range()
    }

    /// Returns the value's text in the source.
    pub(in super::super) fn source_text(&self) -> &'d str {
        self.document.source.get(self.span()).unwrap_or_default()
    }

    /// Returns the elements of an array, or `None` if the value is not an array.
    pub(crate) fn as_array(&self) -> Option<Elements<'d>> {
        if let TomlValue::Array(array) = self.decode() { Some(array) } else { None }
    }

    /// Returns the entries of a table, or `None` if the value is not a table.
    pub(crate) fn as_table(&self) -> Option<Entries<'d>> {
        if let TomlValue::Table(entries) = self.decode() { Some(entries) } else { None }
    }

    /// Returns the number, or `None` if the value is not a number.
    pub(crate) fn as_number(&self) -> Option<Number<'d>> {
        if let TomlValue::Number(number) = self.decode() { Some(number) } else { None }
    }

    /// Returns the decoded string, or `None` if the value is not a string.
    pub(crate) fn as_str(&self) -> Option<&'d str> {
        if let TomlValue::String(text) = self.decode() { Some(text) } else { None }
    }

    /// Decodes the value.
    pub(crate) fn decode(&self) -> TomlValue<'d> {
        let (document, span) = (self.document, self.node.span);
        match self.node.kind {
            NodeKind::String(text) => TomlValue::String(document.resolve_string(span, text)),
            NodeKind::Integer(text, radix) => TomlValue::Number(Number::Integer {
                digits: document.resolve_string(span, text),
                radix: radix as u32,
            }),
            NodeKind::Float(text) => TomlValue::Number(Number::Float(document.resolve_string(span, text))),
            NodeKind::Number(number) => TomlValue::Number(Number::Exact(document.numbers[number as usize])),
            NodeKind::Boolean(value) => TomlValue::Boolean(value),
            NodeKind::Datetime => TomlValue::Datetime,
            NodeKind::Array(array) => {
                let nodes = &document.elements[document.arrays[array as usize].range()];
                TomlValue::Array(Elements { document, nodes })
            }
            NodeKind::List(list) => {
                TomlValue::Array(Elements { document, nodes: &document.lists[list as usize] })
            }
            NodeKind::Table(table) => TomlValue::Table(Entries { document, table }),
        }
    }
}

/// The values of an array.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Elements<'d> {
    document: &'d Document<'d>,
    pub(super) nodes: &'d [ValueNode],
}

impl<'d> Elements<'d> {
    /// Number of elements.
    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The elements in text order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Value<'d>> + use<'d> {
        let document = self.document;
        self.nodes.iter().map(move |node| Value { document, node: *node })
    }

    /// Whether the first element is a table.
    pub(crate) fn starts_with_table(&self) -> bool {
        self.nodes.first().is_some_and(|node| matches!(node.kind, NodeKind::Table(_)))
    }
}

/// The entries of a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entries<'d> {
    pub(super) document: &'d Document<'d>,
    pub(super) table: TableId,
}

/// A key and its value.
#[derive(Clone, Debug)]
pub(crate) struct KeyValue<'d> {
    /// The decoded key.
    pub(crate) key: &'d str,
    /// Byte range of the key.
    pub(crate) span: Range<usize>,
    /// Value of the key.
    pub(crate) value: Value<'d>,
}

impl<'d> Entries<'d> {
    /// The table's ID.
    pub(crate) fn table_id(&self) -> TableId {
        self.table
    }

    /// Whether the table has no header because a longer header created it.
    pub(in super::super) fn is_implicit(&self) -> bool {
        self.document.table_origin(self.table).is_implicit
    }

    /// Whether the table is an inline table.
    pub(in super::super) fn is_inline(&self) -> bool {
        self.document.table_origin(self.table).is_inline
    }

    /// Finds the entry with this key.
    pub(crate) fn get(&self, name: &str) -> Option<KeyValue<'d>> {
        self.document.find_entry(self.table, name).map(|entry| self.key_value_of_entry(entry))
    }

    /// The entries in insertion order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = KeyValue<'d>> + use<'d> {
        let this = *self;
        let entries = &this.document.entries;
        let first = this.document.tables[this.table.0 as usize].first;
        let start = (first != NONE).then_some(first);
        let next = |entry: &u32| Some(entries[*entry as usize].next).filter(|next| *next != NONE);
        std::iter::successors(start, next)
            .filter(|entry| !entries[*entry as usize].is_removed)
            .map(move |entry| this.key_value_of_entry(entry))
    }

    fn key_value_of_entry(&self, entry: u32) -> KeyValue<'d> {
        let document = self.document;
        let TableEntry { key, text, node, .. } = document.entries[entry as usize];
        KeyValue {
            key: document.resolve_string(key, text),
            span: key.range(),
            value: Value { document, node },
        }
    }
}
