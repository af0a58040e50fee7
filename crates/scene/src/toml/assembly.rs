//! Headers, keys and values become tables, by the rules of TOML: what a header or a dotted key may add to, and what is
//! defined twice.

use std::borrow::Cow;

use toml_parser::{ErrorSink, ParseError};

use super::error::{Errors, SyntaxError};
use super::tree::{Document, Kind, Name, Node, Origin, Span, TableId, Text};

/// `[path.key]` or `[[path.key]]`.
#[derive(Clone, Debug)]
pub(super) struct Header<'s> {
    pub(super) path: Vec<Name<'s>>,
    /// None: it cannot be used, and neither can the keys below it.
    pub(super) key: Option<Name<'s>>,
    /// With its brackets.
    pub(super) span: Span,
    /// Whether the brackets are double.
    pub(super) is_list: bool,
}

/// A document that grows.
pub(super) struct Assembly<'s> {
    pub(super) document: Document<'s>,
    /// Table that keys go to.
    table: TableId,
    /// Header of `table`, which is put in its place when the next one begins. `None` if `table` is the root.
    header: Option<Header<'s>>,
    /// A header whose end was not found yet: what follows is searched for it.
    pub(super) open: Option<Header<'s>>,
    /// After a key without a value nothing is understood any more.
    pub(super) is_lost: bool,
    pub(super) syntax: Errors,
    pub(super) meaning: Errors,
    /// Elements of arrays that are being read.
    pub(super) elements: Vec<Node>,
}

/// Reports errors of a part of the text that begins at byte `base`.
pub(super) struct Sink<'a> {
    pub(super) errors: &'a mut Errors,
    pub(super) base: usize,
}

impl ErrorSink for Sink<'_> {
    fn report_error(&mut self, error: ParseError) {
        self.errors.push_with(|| SyntaxError::new(&error, self.base));
    }
}

impl<'s> Assembly<'s> {
    pub(super) fn new(source: &'s str) -> Self {
        Self::of(Document::new(source))
    }

    /// Goes on with a document, in a table that is in no other.
    pub(super) fn apart(mut document: Document<'s>) -> (Self, TableId) {
        let table = document.add_table(Origin::default());
        (Self { table, ..Self::of(document) }, table)
    }

    fn of(document: Document<'s>) -> Self {
        Self {
            document,
            table: Document::ROOT,
            header: None,
            open: None,
            is_lost: false,
            syntax: Errors::default(),
            meaning: Errors::default(),
            elements: Vec::new(),
        }
    }

    /// Whether the text now belongs to a header that was not closed.
    pub(super) fn is_in_header(&self) -> bool {
        self.open.is_some()
    }

    /// The document is at its end.
    pub(super) fn finish(mut self) -> (Document<'s>, Vec<SyntaxError>) {
        if let Some(header) = self.open.take() {
            self.start_table(header);
        }
        self.finish_table();
        (self.document, self.syntax.then(self.meaning))
    }

    /// The value of something at `span` is a text.
    pub(super) fn text(&mut self, span: Span, text: Cow<'s, str>) -> Text {
        self.document.add_text(span, text)
    }

    /// The elements from the given one on become an array.
    pub(super) fn end_array(&mut self, first: usize) -> Kind {
        let kind = self.document.add_array(&self.elements[first..]);
        self.elements.truncate(first);
        kind
    }

    fn error(&mut self, span: Span, what: impl Into<String>) {
        self.meaning.push_with(|| SyntaxError::at(span.range(), what));
    }

    fn duplicate(&mut self, span: Span) {
        self.error(span, "duplicate key");
    }

    /// `path.key = value` below a header.
    pub(super) fn key_value(&mut self, path: &[Name<'s>], key: Name<'s>, value: Node) {
        let is_dotted = !path.is_empty();
        let Some(parent) = self.descend(self.table, path, is_dotted) else { return };
        let adds_to_defined = is_dotted && !self.document.origin(parent).is_implicit;
        if adds_to_defined || self.document.find(parent, &key.text).is_some() {
            self.duplicate(key.span);
        } else {
            self.document.add_entry(parent, key, value);
        }
    }

    /// `path.key = value` within the braces of `table`.
    pub(super) fn inline_key_value(&mut self, table: TableId, path: &[Name<'s>], key: Name<'s>, value: Node) {
        let Some(parent) = self.descend_inline(table, path) else { return };
        let adds_to_defined = self.document.origin(parent).is_dotted == path.is_empty();
        if adds_to_defined || self.document.find(parent, &key.text).is_some() {
            self.duplicate(key.span);
        } else {
            self.document.add_entry(parent, key, value);
        }
    }

    /// A header begins a table. One that longer headers made already is defined by this; one that stood there before
    /// is an error, and is continued.
    pub(super) fn start_table(&mut self, header: Header<'s>) {
        self.table = self.continued(&header).unwrap_or_else(|| self.document.add_table(Origin::default()));
        let is_inline = self.document.origin(self.table).is_inline;
        self.document.set_origin(self.table, Origin { is_inline, ..Origin::default() });
        self.header = Some(header);
    }

    /// The table that a header names a second time, taken out of its place.
    fn continued(&mut self, header: &Header<'s>) -> Option<TableId> {
        if header.is_list {
            return None;
        }
        let parent = self.descend(Document::ROOT, &header.path, false)?;
        let key = header.key.as_ref()?;
        let old = self.document.remove(parent, &key.text)?;
        let table = if let Kind::Table(table) = old.kind { Some(table) } else { None };
        let origin = table.map(|table| self.document.origin(table));
        if !origin.is_some_and(|origin| origin.is_implicit && !origin.is_dotted) {
            self.duplicate(key.span);
        }
        table
    }

    /// Puts the table that ends here in its place.
    pub(super) fn finish_table(&mut self) {
        let Some(Header { path, key, span, is_list }) = self.header.take() else { return };
        let node = Node { span, kind: Kind::Table(self.table) };
        let Some(key) = key else { return };
        let Some(parent) = self.descend(Document::ROOT, &path, false) else { return };
        if !is_list {
            self.document.add_entry(parent, key, node);
            return;
        }
        match self.document.find(parent, &key.text).map(|found| found.kind) {
            Some(Kind::List(list)) => self.document.list_mut(list).push(node),
            Some(_) => self.duplicate(key.span),
            None => {
                let list = self.document.add_list();
                self.document.add_entry(parent, key, Node { span, kind: list });
                if let Kind::List(list) = list {
                    self.document.list_mut(list).push(node);
                }
            }
        }
    }

    /// The table that a path leads to; makes it if it does not exist.
    fn descend(&mut self, from: TableId, path: &[Name<'s>], is_dotted: bool) -> Option<TableId> {
        path.iter().try_fold(from, |table, name| {
            let Some(found) = self.document.find(table, &name.text) else {
                let origin = Origin { is_implicit: true, is_dotted, is_inline: false };
                return Some(self.implicit_table(table, name, origin));
            };
            match found.kind {
                Kind::Table(inner) => self.enter(inner, name, is_dotted),
                Kind::List(list) => {
                    let last = self.document.list_mut(list).last()?.kind;
                    if let Kind::Table(last) = last { Some(last) } else { None }
                }
                other => self.cannot_extend(name, other),
            }
        })
    }

    /// Whether a header or dotted key may go through this table.
    fn enter(&mut self, table: TableId, name: &Name<'s>, is_dotted: bool) -> Option<TableId> {
        let origin = self.document.origin(table);
        if origin.is_inline {
            self.error(name.span, "cannot extend value of type inline table with a dotted key");
            return None;
        }
        if is_dotted && !origin.is_implicit {
            self.duplicate(name.span);
            return None;
        }
        if is_dotted {
            self.document.set_origin(table, Origin { is_dotted, ..origin });
        }
        Some(table)
    }

    /// The same within braces.
    fn descend_inline(&mut self, from: TableId, path: &[Name<'s>]) -> Option<TableId> {
        path.iter().try_fold(from, |table, name| {
            let Some(found) = self.document.find(table, &name.text) else {
                let origin = Origin { is_implicit: true, is_dotted: true, is_inline: true };
                return Some(self.implicit_table(table, name, origin));
            };
            match found.kind {
                Kind::Table(inner) if self.document.origin(inner).is_implicit => Some(inner),
                Kind::Table(_) => {
                    self.duplicate(name.span);
                    None
                }
                other => self.cannot_extend(name, other),
            }
        })
    }

    fn implicit_table(&mut self, parent: TableId, name: &Name<'s>, origin: Origin) -> TableId {
        let table = self.document.add_table(origin);
        self.document.add_entry(parent, name.clone(), Node { span: name.span, kind: Kind::Table(table) });
        table
    }

    fn cannot_extend(&mut self, name: &Name<'s>, kind: Kind) -> Option<TableId> {
        let what = match kind {
            Kind::String(_) => "string",
            Kind::Integer(..) => "integer",
            Kind::Float(_) => "float",
            Kind::Boolean(_) => "boolean",
            Kind::Datetime => "datetime",
            Kind::Array(_) | Kind::List(_) => "array",
            Kind::Table(_) => "table",
        };
        self.error(name.span, format!("cannot extend value of type {what} with a dotted key"));
        None
    }
}
