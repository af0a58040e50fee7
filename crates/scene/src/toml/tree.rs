//! The document tree: 16-byte nodes in a few vectors, and strings that are spans of the source.
//!
//! A sphere with a center, a radius and a material takes about 180 bytes. Documents that are built in memory
//! have no source: they store their strings and numbers.

mod number;
mod value;

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;

pub(crate) use number::Number;
pub(crate) use value::{Elements, Entries, KeyValue, TomlValue, Value};

/// Byte range in the source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) start: u32,
    pub(super) end: u32,
}

impl Span {
    /// Creates a span from offsets below 4 GiB.
    pub(super) fn new(start: usize, end: usize) -> Self {
        let offset = |at| u32::try_from(at).unwrap_or(u32::MAX);
        Self { start: offset(start), end: offset(end) }
    }

    pub(super) fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A reference to a decoded string: the whole span, the span without quotes, or an index into the document's
/// decoded strings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DecodedTextIndex(u32);

impl DecodedTextIndex {
    pub(super) const WHOLE: Self = Self(u32::MAX);
    pub(super) const QUOTED: Self = Self(u32::MAX - 1);
}

/// The base of an integer's digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Radix {
    Binary = 2,
    Octal = 8,
    Decimal = 10,
    Hexadecimal = 16,
}

/// Index of a table in the document. Tables are numbered in text order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct TableId(u32);

/// Kind of a value.
#[derive(Clone, Copy, Debug)]
pub(super) enum NodeKind {
    String(DecodedTextIndex),
    Integer(DecodedTextIndex, Radix),
    Float(DecodedTextIndex),
    /// An index into the numbers.
    Number(u32),
    Boolean(bool),
    Datetime,
    /// `[…]`: an index into the arrays.
    Array(u32),
    /// All `[[name]]` tables with the same name: an index into the lists.
    List(u32),
    Table(TableId),
}

impl NodeKind {
    /// The table's ID, or `None` if the value is not a table.
    pub(super) fn as_table_id(self) -> Option<TableId> {
        if let Self::Table(table) = self { Some(table) } else { None }
    }
}

/// A value and its span.
#[derive(Clone, Copy, Debug)]
pub(super) struct ValueNode {
    pub(super) span: Span,
    pub(super) kind: NodeKind,
}

/// A key and its value: an entry in a table's linked list.
#[derive(Clone, Copy, Debug)]
struct TableEntry {
    key: Span,
    text: DecodedTextIndex,
    node: ValueNode,
    /// The table's next entry, or [`NONE`].
    next: u32,
    is_removed: bool,
}

/// End of a linked list.
const NONE: u32 = u32::MAX;

/// How a table was created, which determines whether keys may be added to it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TableOrigin {
    /// Whether the table was created by a longer header or key.
    pub(super) is_implicit: bool,
    /// Whether the table was created by a dotted key.
    pub(super) is_dotted: bool,
    /// Whether the table is an inline table or part of an inline table.
    pub(super) is_inline: bool,
}

#[derive(Clone, Copy, Debug)]
struct TableRecord {
    first: u32,
    last: u32,
    /// Number of entries, including removed entries.
    length: u32,
    origin: TableOrigin,
}

/// Maximum number of entries in tables that do not use the hash index.
const MAX_LINEAR: u32 = 16;

/// A key that has not been added to a table yet.
#[derive(Clone, Debug)]
pub(super) struct Name<'s> {
    pub(super) span: Span,
    pub(super) text: Cow<'s, str>,
}

/// A TOML document.
#[derive(Clone, Debug)]
pub(crate) struct Document<'s> {
    source: &'s str,
    /// Decoded strings that differ from the source.
    texts: Vec<Cow<'s, str>>,
    /// Numbers that are not in the source.
    numbers: Vec<f64>,
    tables: Vec<TableRecord>,
    entries: Vec<TableEntry>,
    /// Each array's range in `elements`.
    arrays: Vec<Span>,
    elements: Vec<ValueNode>,
    lists: Vec<Vec<ValueNode>>,
    /// Hash index over the entries of tables that have more than [`MAX_LINEAR`] entries.
    index: HashMap<(TableId, Cow<'s, str>), u32>,
}

impl<'s> Document<'s> {
    pub(super) const ROOT: TableId = TableId(0);

    /// Creates a document with an empty root.
    pub(super) fn new(source: &'s str) -> Self {
        let mut document = Self {
            source,
            texts: Vec::new(),
            numbers: Vec::new(),
            tables: Vec::new(),
            entries: Vec::new(),
            arrays: Vec::new(),
            elements: Vec::new(),
            lists: Vec::new(),
            index: HashMap::new(),
        };
        document.add_table(TableOrigin::default());
        document
    }

    /// Replaces the source with a longer text that starts with the current source.
    pub(super) fn with_extended_source(self, source: &'s str) -> Self {
        Self { source, ..self }
    }

    /// The root table.
    pub(crate) fn root(&self) -> Entries<'_> {
        Entries { document: self, table: Self::ROOT }
    }

    pub(super) fn add_table(&mut self, origin: TableOrigin) -> TableId {
        self.tables.push(TableRecord { first: NONE, last: NONE, length: 0, origin });
        TableId(u32_index_or_sentinel(self.tables.len() - 1))
    }

    /// ID of the table that is added next.
    pub(super) fn next_table_id(&self) -> TableId {
        TableId(u32_index_or_sentinel(self.tables.len()))
    }

    pub(super) fn table_origin(&self, table: TableId) -> TableOrigin {
        self.tables[table.0 as usize].origin
    }

    pub(super) fn set_table_origin(&mut self, table: TableId, origin: TableOrigin) {
        self.tables[table.0 as usize].origin = origin;
    }

    /// Adds an array.
    pub(super) fn add_array(&mut self, elements: &[ValueNode]) -> NodeKind {
        let start = self.elements.len();
        self.elements.extend_from_slice(elements);
        self.arrays.push(Span::new(start, self.elements.len()));
        NodeKind::Array(u32_index_or_sentinel(self.arrays.len() - 1))
    }

    /// Adds an empty list of tables.
    pub(super) fn add_table_list(&mut self) -> NodeKind {
        self.lists.push(Vec::new());
        NodeKind::List(u32_index_or_sentinel(self.lists.len() - 1))
    }

    pub(super) fn table_list_mut(&mut self, list: u32) -> &mut Vec<ValueNode> {
        &mut self.lists[list as usize]
    }

    /// Stores the decoded string at `span`.
    pub(super) fn store_decoded_string(&mut self, span: Span, text: Cow<'s, str>) -> DecodedTextIndex {
        let written = self.source.get(span.range()).unwrap_or_default();
        if text == written && !text.is_empty() {
            return DecodedTextIndex::WHOLE;
        }
        if written.len() >= 2 && written.get(1..written.len() - 1) == Some(&text) {
            return DecodedTextIndex::QUOTED;
        }
        self.texts.push(text);
        DecodedTextIndex(u32_index_or_sentinel(self.texts.len() - 1))
    }

    /// Adds a number that is not in the source.
    pub(super) fn add_number(&mut self, number: f64) -> NodeKind {
        self.numbers.push(number);
        NodeKind::Number(u32_index_or_sentinel(self.numbers.len() - 1))
    }

    fn resolve_string(&self, span: Span, text: DecodedTextIndex) -> &str {
        let range = span.range();
        match text {
            DecodedTextIndex::WHOLE => self.source.get(range).unwrap_or_default(),
            DecodedTextIndex::QUOTED => self.source.get(range.start + 1..range.end - 1).unwrap_or_default(),
            DecodedTextIndex(own) => &self.texts[own as usize],
        }
    }

    /// Appends an entry to a table that does not contain its key.
    pub(super) fn add_entry(&mut self, table: TableId, name: Name<'s>, node: ValueNode) {
        let entry = u32_index_or_sentinel(self.entries.len());
        let text = self.store_decoded_string(name.span, name.text.clone());
        self.entries.push(TableEntry { key: name.span, text, node, next: NONE, is_removed: false });
        let TableRecord { first, last, length, .. } = &mut self.tables[table.0 as usize];
        let before = std::mem::replace(last, entry);
        *length += 1;
        match length {
            1 => *first = entry,
            _ => self.entries[before as usize].next = entry,
        }
        if *length == MAX_LINEAR + 1 {
            self.add_entries_to_index(table);
        } else if *length > MAX_LINEAR {
            self.index.insert((table, name.text), entry);
        }
    }

    /// Adds all entries of a table to the hash index.
    fn add_entries_to_index(&mut self, table: TableId) {
        let mut next = self.tables[table.0 as usize].first;
        while let Some(entry) = self.entries.get(next as usize).copied() {
            if !entry.is_removed {
                let text = match entry.text {
                    DecodedTextIndex::WHOLE => {
                        Cow::Borrowed(self.source.get(entry.key.range()).unwrap_or_default())
                    }
                    _ => Cow::Owned(self.resolve_string(entry.key, entry.text).to_owned()),
                };
                self.index.insert((table, text), next);
            }
            next = entry.next;
        }
    }

    fn find_entry(&self, table: TableId, name: &str) -> Option<u32> {
        let TableRecord { first, length, .. } = self.tables[table.0 as usize];
        if length > MAX_LINEAR {
            return self.index.get(&(table, Cow::Borrowed(name))).copied();
        }
        let mut next = first;
        while let Some(entry) = self.entries.get(next as usize) {
            if !entry.is_removed && self.resolve_string(entry.key, entry.text) == name {
                return Some(next);
            }
            next = entry.next;
        }
        None
    }

    /// Finds the value of a key.
    pub(super) fn find_in_table(&self, table: TableId, name: &str) -> Option<ValueNode> {
        self.find_entry(table, name).map(|entry| self.entries[entry as usize].node)
    }

    /// Sets the value of a key, adding it if necessary.
    pub(super) fn set_or_add_value(&mut self, table: TableId, name: Name<'s>, node: ValueNode) {
        let Some(found) = self.find_entry(table, &name.text) else {
            return self.add_entry(table, name, node);
        };
        let text = self.store_decoded_string(name.span, name.text);
        let entry = &mut self.entries[found as usize];
        (entry.key, entry.text, entry.node) = (name.span, text, node);
    }

    /// Returns the only value in a table and its dotted key, or `None` if there are several values or if the
    /// value has a header.
    pub(super) fn sole_assignment_in_table(&self, table: TableId) -> Option<(Vec<Name<'s>>, ValueNode)> {
        let mut keys = Vec::new();
        let mut table = Some(table);
        let mut value = None;
        while let Some(above) = table {
            let TableRecord { first, length, .. } = self.tables[above.0 as usize];
            let TableEntry { key, text, node, .. } =
                *self.entries.get(first as usize).filter(|_| length == 1)?;
            keys.push(Name { span: key, text: Cow::Owned(self.resolve_string(key, text).to_owned()) });
            table = node.kind.as_table_id().filter(|table| self.table_origin(*table).is_dotted);
            value = Some(node);
        }
        value
            .filter(|node| node.kind.as_table_id().is_none_or(|table| self.table_origin(table).is_inline))
            .map(|node| (keys, node))
    }

    /// Returns a table's keys.
    pub(super) fn keys(&self, table: TableId) -> Vec<String> {
        Entries { document: self, table }.iter().map(|entry| entry.key.to_owned()).collect()
    }

    /// Finds the string value of a key. Returns `None` if the key is absent or its value is not a string.
    pub(super) fn find_string(&self, table: TableId, name: &str) -> Option<&str> {
        let node = self.find_in_table(table, name)?;
        if let NodeKind::String(text) = node.kind { Some(self.resolve_string(node.span, text)) } else { None }
    }

    /// Returns the elements of an array or list, or no elements for other values.
    pub(super) fn elements_of(&self, kind: NodeKind) -> Vec<ValueNode> {
        let value = Value { document: self, node: ValueNode { span: Span::default(), kind } };
        value.as_array().map_or_else(Vec::new, |elements| elements.nodes.to_vec())
    }

    /// Replaces an element of an array or list.
    pub(super) fn set_element(&mut self, kind: NodeKind, index: usize, node: ValueNode) {
        let element = match kind {
            NodeKind::Array(array) => {
                let start = self.arrays[array as usize].start as usize;
                self.elements.get_mut(start + index)
            }
            NodeKind::List(list) => self.lists[list as usize].get_mut(index),
            NodeKind::String(_)
            | NodeKind::Integer(..)
            | NodeKind::Float(_)
            | NodeKind::Number(_)
            | NodeKind::Boolean(_)
            | NodeKind::Datetime
            | NodeKind::Table(_) => None,
        };
        if let Some(element) = element {
            *element = node;
        }
    }

    /// Removes an entry from its table.
    pub(super) fn remove_entry(&mut self, table: TableId, name: &str) -> Option<ValueNode> {
        let found = self.find_entry(table, name)?;
        // Only large tables have an index.
        if self.tables[table.0 as usize].length > MAX_LINEAR {
            self.index.remove(&(table, Cow::Owned(name.to_owned())));
        }
        let entry = &mut self.entries[found as usize];
        entry.is_removed = true;
        Some(entry.node)
    }

    /// Parses all numbers, so that reading them takes no time.
    pub(super) fn decode_numbers(&mut self) {
        for index in 0..self.elements.len() {
            self.elements[index] = self.decode_number(self.elements[index]);
        }
        for index in 0..self.entries.len() {
            self.entries[index].node = self.decode_number(self.entries[index].node);
        }
    }

    fn decode_number(&mut self, node: ValueNode) -> ValueNode {
        let number = Value { document: self, node }.as_number().and_then(Number::to_f64);
        number.map_or(node, |number| ValueNode { kind: self.add_number(number), ..node })
    }

    /// Size of the tree in bytes.
    #[cfg(test)]
    pub(super) fn memory_bytes(&self) -> usize {
        let lists: usize = self.lists.iter().map(|list| size_of_val(list.as_slice())).sum();
        size_of_val(self.tables.as_slice())
            + size_of_val(self.entries.as_slice())
            + size_of_val(self.arrays.as_slice())
            + size_of_val(self.elements.as_slice())
            + lists
    }
}

fn u32_index_or_sentinel(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(NONE)
}
