//! The tree: nodes of 16 bytes in a few long lists, texts as places in the source.
//!
//! A sphere with a centre, a radius and a material takes about 180 bytes.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;

/// Bytes of the source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) start: u32,
    pub(super) end: u32,
}

impl Span {
    /// The source has less than 4 GiB.
    pub(super) fn new(start: usize, end: usize) -> Self {
        let offset = |at| u32::try_from(at).unwrap_or(u32::MAX);
        Self { start: offset(start), end: offset(end) }
    }

    pub(super) fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A decoded text: its whole span, its span without the quotes, or a text of the document's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Text(u32);

impl Text {
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

/// Index of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct TableId(u32);

/// Kind of a node.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    String(Text),
    Integer(Text, Radix),
    Float(Text),
    Boolean(bool),
    Datetime,
    /// `[…]`: index into the arrays.
    Array(u32),
    /// All `[[name]]` of one name: index into the lists.
    List(u32),
    Table(TableId),
}

impl Kind {
    /// Index of the table, if it is one.
    pub(super) fn table(self) -> Option<TableId> {
        if let Self::Table(table) = self { Some(table) } else { None }
    }
}

/// A value and its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) span: Span,
    pub(super) kind: Kind,
}

/// A key with its value, in the list of its table.
#[derive(Clone, Copy, Debug)]
struct Entry {
    key: Span,
    text: Text,
    node: Node,
    /// The next entry of the table, or [`NONE`].
    next: u32,
    is_removed: bool,
}

/// No entry.
const NONE: u32 = u32::MAX;

/// Origin of a table, which decides whether keys may be added to it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Origin {
    /// Whether a longer header or key than its own made it.
    pub(super) is_implicit: bool,
    /// Whether a dotted key made it.
    pub(super) is_dotted: bool,
    /// Within braces.
    pub(super) is_inline: bool,
}

#[derive(Clone, Copy, Debug)]
struct Table {
    first: u32,
    last: u32,
    /// Entries in the list, removed ones too.
    length: u32,
    origin: Origin,
}

/// Tables with more entries than this are searched by hash.
const FEW: u32 = 16;

/// A key before it is in a table.
#[derive(Clone, Debug)]
pub(super) struct Name<'s> {
    pub(super) span: Span,
    pub(super) text: Cow<'s, str>,
}

/// A TOML document.
#[derive(Debug)]
pub(in super::super) struct Document<'s> {
    source: &'s str,
    /// Decoded texts that do not stand in the source.
    texts: Vec<String>,
    tables: Vec<Table>,
    entries: Vec<Entry>,
    /// Each array's part of the elements.
    arrays: Vec<Span>,
    elements: Vec<Node>,
    lists: Vec<Vec<Node>>,
    /// Entries of the tables with many.
    index: HashMap<(TableId, Cow<'s, str>), u32>,
}

impl<'s> Document<'s> {
    pub(super) const ROOT: TableId = TableId(0);

    /// With an empty root.
    pub(super) fn new(source: &'s str) -> Self {
        let mut document = Self {
            source,
            texts: Vec::new(),
            tables: Vec::new(),
            entries: Vec::new(),
            arrays: Vec::new(),
            elements: Vec::new(),
            lists: Vec::new(),
            index: HashMap::new(),
        };
        document.add_table(Origin::default());
        document
    }

    /// The same document, with places in a text that begins with its own.
    pub(super) fn within(self, source: &'s str) -> Self {
        Self { source, ..self }
    }

    /// The top of the document.
    pub(in super::super) fn root(&self) -> Entries<'_> {
        Entries { document: self, table: Self::ROOT }
    }

    pub(super) fn add_table(&mut self, origin: Origin) -> TableId {
        self.tables.push(Table { first: NONE, last: NONE, length: 0, origin });
        TableId(index(self.tables.len() - 1))
    }

    pub(super) fn origin(&self, table: TableId) -> Origin {
        self.tables[table.0 as usize].origin
    }

    pub(super) fn set_origin(&mut self, table: TableId, origin: Origin) {
        self.tables[table.0 as usize].origin = origin;
    }

    /// The elements become an array.
    pub(super) fn add_array(&mut self, elements: &[Node]) -> Kind {
        let start = self.elements.len();
        self.elements.extend_from_slice(elements);
        self.arrays.push(Span::new(start, self.elements.len()));
        Kind::Array(index(self.arrays.len() - 1))
    }

    /// A list of tables, empty yet.
    pub(super) fn add_list(&mut self) -> Kind {
        self.lists.push(Vec::new());
        Kind::List(index(self.lists.len() - 1))
    }

    pub(super) fn list_mut(&mut self, list: u32) -> &mut Vec<Node> {
        &mut self.lists[list as usize]
    }

    /// Keeps the text of something at `span`.
    pub(super) fn add_text(&mut self, span: Span, text: Cow<'s, str>) -> Text {
        let written = self.source.get(span.range()).unwrap_or_default();
        if text == written {
            return Text::WHOLE;
        }
        if written.len() >= 2 && written.get(1..written.len() - 1) == Some(&text) {
            return Text::QUOTED;
        }
        self.texts.push(text.into_owned());
        Text(index(self.texts.len() - 1))
    }

    fn text(&self, span: Span, text: Text) -> &str {
        let range = span.range();
        match text {
            Text::WHOLE => self.source.get(range).unwrap_or_default(),
            Text::QUOTED => self.source.get(range.start + 1..range.end - 1).unwrap_or_default(),
            Text(own) => &self.texts[own as usize],
        }
    }

    /// Adds an entry at the end of a table that has no such key.
    pub(super) fn add_entry(&mut self, table: TableId, name: Name<'s>, node: Node) {
        let entry = index(self.entries.len());
        let text = self.add_text(name.span, name.text.clone());
        self.entries.push(Entry { key: name.span, text, node, next: NONE, is_removed: false });
        let Table { first, last, length, .. } = &mut self.tables[table.0 as usize];
        let before = std::mem::replace(last, entry);
        *length += 1;
        match length {
            1 => *first = entry,
            _ => self.entries[before as usize].next = entry,
        }
        if *length == FEW + 1 {
            self.index_all(table);
        } else if *length > FEW {
            self.index.insert((table, name.text), entry);
        }
    }

    /// From now on the table is searched by hash.
    fn index_all(&mut self, table: TableId) {
        let mut next = self.tables[table.0 as usize].first;
        while let Some(entry) = self.entries.get(next as usize).copied() {
            if !entry.is_removed {
                let text = match entry.text {
                    Text::WHOLE => Cow::Borrowed(self.source.get(entry.key.range()).unwrap_or_default()),
                    _ => Cow::Owned(self.text(entry.key, entry.text).to_owned()),
                };
                self.index.insert((table, text), next);
            }
            next = entry.next;
        }
    }

    fn find_entry(&self, table: TableId, name: &str) -> Option<u32> {
        let Table { first, length, .. } = self.tables[table.0 as usize];
        if length > FEW {
            return self.index.get(&(table, Cow::Borrowed(name))).copied();
        }
        let mut next = first;
        while let Some(entry) = self.entries.get(next as usize) {
            if !entry.is_removed && self.text(entry.key, entry.text) == name {
                return Some(next);
            }
            next = entry.next;
        }
        None
    }

    /// The value of a key.
    pub(super) fn find(&self, table: TableId, name: &str) -> Option<Node> {
        self.find_entry(table, name).map(|entry| self.entries[entry as usize].node)
    }

    /// Replaces the value of a key in a table; adds the key if it does not exist.
    pub(super) fn put(&mut self, table: TableId, name: Name<'s>, node: Node) {
        let Some(found) = self.find_entry(table, &name.text) else {
            return self.add_entry(table, name, node);
        };
        let text = self.add_text(name.span, name.text);
        let entry = &mut self.entries[found as usize];
        (entry.key, entry.text, entry.node) = (name.span, text, node);
    }

    /// The only value below a table, and the dotted key that leads to it. `None` if there are several, or headers.
    pub(super) fn only_value(&self, table: TableId) -> Option<(Vec<Name<'s>>, Node)> {
        let mut keys = Vec::new();
        let mut table = Some(table);
        let mut value = None;
        while let Some(above) = table {
            let Table { first, length, .. } = self.tables[above.0 as usize];
            let Entry { key, text, node, .. } = *self.entries.get(first as usize).filter(|_| length == 1)?;
            keys.push(Name { span: key, text: Cow::Owned(self.text(key, text).to_owned()) });
            table = node.kind.table().filter(|table| self.origin(*table).is_dotted);
            value = Some(node);
        }
        value
            .filter(|node| node.kind.table().is_none_or(|table| self.origin(table).is_inline))
            .map(|node| (keys, node))
    }

    /// The keys of a table.
    pub(super) fn keys(&self, table: TableId) -> Vec<String> {
        Entries { document: self, table }.iter().map(|entry| entry.key.to_owned()).collect()
    }

    /// The value of a key that is a text.
    pub(super) fn find_text(&self, table: TableId, name: &str) -> Option<&str> {
        let node = self.find(table, name)?;
        if let Kind::String(text) = node.kind { Some(self.text(node.span, text)) } else { None }
    }

    /// The elements of an array or a list; empty for other values.
    pub(super) fn elements_of(&self, kind: Kind) -> Vec<Node> {
        let value = Value { document: self, node: Node { span: Span::default(), kind } };
        value.array().map_or_else(Vec::new, |elements| elements.nodes.to_vec())
    }

    /// Puts another value into an array or a list.
    pub(super) fn set_element(&mut self, kind: Kind, index: usize, node: Node) {
        let element = match kind {
            Kind::Array(array) => {
                let start = self.arrays[array as usize].start as usize;
                self.elements.get_mut(start + index)
            }
            Kind::List(list) => self.lists[list as usize].get_mut(index),
            Kind::String(_)
            | Kind::Integer(..)
            | Kind::Float(_)
            | Kind::Boolean(_)
            | Kind::Datetime
            | Kind::Table(_) => None,
        };
        if let Some(element) = element {
            *element = node;
        }
    }

    /// Takes an entry out of its table.
    pub(super) fn remove(&mut self, table: TableId, name: &str) -> Option<Node> {
        let found = self.find_entry(table, name)?;
        // Only entries of tables with many are in the index.
        if self.tables[table.0 as usize].length > FEW {
            self.index.remove(&(table, Cow::Owned(name.to_owned())));
        }
        let entry = &mut self.entries[found as usize];
        entry.is_removed = true;
        Some(entry.node)
    }

    /// Bytes of the tree.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> usize {
        let lists: usize = self.lists.iter().map(|list| size_of_val(list.as_slice())).sum();
        size_of_val(self.tables.as_slice())
            + size_of_val(self.entries.as_slice())
            + size_of_val(self.arrays.as_slice())
            + size_of_val(self.elements.as_slice())
            + lists
    }
}

fn index(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(NONE)
}

/// A value of a document.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Value<'d> {
    document: &'d Document<'d>,
    node: Node,
}

/// A value.
#[derive(Clone, Copy, Debug)]
pub(in super::super) enum Item<'d> {
    /// Decoded.
    String(&'d str),
    /// Digits with a sign, without underscores and prefix.
    Integer { digits: &'d str, radix: u32 },
    /// Text that `f64::from_str` reads.
    Float(&'d str),
    /// `true` or `false`.
    Boolean(bool),
    /// A date, a time, or both.
    Datetime,
    /// Values in brackets, or all tables `[[name]]`.
    Array(Elements<'d>),
    /// With a header, in braces, or made by a dotted key.
    Table(Entries<'d>),
}

impl<'d> Value<'d> {
    /// Bytes of the source; of a table its header or its braces.
    pub(in super::super) fn span(&self) -> Range<usize> {
        self.node.span.range()
    }

    /// Its elements, if it is an array.
    pub(in super::super) fn array(&self) -> Option<Elements<'d>> {
        if let Item::Array(array) = self.item() { Some(array) } else { None }
    }

    /// The value.
    pub(in super::super) fn item(&self) -> Item<'d> {
        let (document, span) = (self.document, self.node.span);
        match self.node.kind {
            Kind::String(text) => Item::String(document.text(span, text)),
            Kind::Integer(text, radix) => {
                Item::Integer { digits: document.text(span, text), radix: radix as u32 }
            }
            Kind::Float(text) => Item::Float(document.text(span, text)),
            Kind::Boolean(value) => Item::Boolean(value),
            Kind::Datetime => Item::Datetime,
            Kind::Array(array) => {
                let nodes = &document.elements[document.arrays[array as usize].range()];
                Item::Array(Elements { document, nodes })
            }
            Kind::List(list) => Item::Array(Elements { document, nodes: &document.lists[list as usize] }),
            Kind::Table(table) => Item::Table(Entries { document, table }),
        }
    }
}

/// The values of an array.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Elements<'d> {
    document: &'d Document<'d>,
    nodes: &'d [Node],
}

impl<'d> Elements<'d> {
    /// Number of entries.
    pub(in super::super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// In the order of the text.
    pub(in super::super) fn iter(&self) -> impl Iterator<Item = Value<'d>> + use<'d> {
        let document = self.document;
        self.nodes.iter().map(move |node| Value { document, node: *node })
    }

    /// Whether the first one is a table.
    pub(in super::super) fn is_of_tables(&self) -> bool {
        self.nodes.first().is_some_and(|node| matches!(node.kind, Kind::Table(_)))
    }
}

/// The entries of a table.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Entries<'d> {
    document: &'d Document<'d>,
    table: TableId,
}

/// A key and its value.
#[derive(Clone, Debug)]
pub(in super::super) struct KeyValue<'d> {
    /// The key, decoded.
    pub(in super::super) key: &'d str,
    /// Its place.
    pub(in super::super) span: Range<usize>,
    /// Its value.
    pub(in super::super) value: Value<'d>,
}

impl<'d> Entries<'d> {
    /// The entry with this key.
    pub(in super::super) fn get(&self, name: &str) -> Option<KeyValue<'d>> {
        self.document.find_entry(self.table, name).map(|entry| self.entry(entry))
    }

    /// In the order in which they were made.
    pub(in super::super) fn iter(&self) -> impl Iterator<Item = KeyValue<'d>> + use<'d> {
        let this = *self;
        let entries = &this.document.entries;
        let first = this.document.tables[this.table.0 as usize].first;
        let start = (first != NONE).then_some(first);
        let next = |entry: &u32| Some(entries[*entry as usize].next).filter(|next| *next != NONE);
        std::iter::successors(start, next)
            .filter(|entry| !entries[*entry as usize].is_removed)
            .map(move |entry| this.entry(entry))
    }

    fn entry(&self, entry: u32) -> KeyValue<'d> {
        let document = self.document;
        let Entry { key, text, node, .. } = document.entries[entry as usize];
        KeyValue { key: document.text(key, text), span: key.range(), value: Value { document, node } }
    }
}
