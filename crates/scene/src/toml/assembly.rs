//! Builds tables from headers, keys and values. Enforces TOML's rules on extending tables and on duplicate
//! definitions.

use std::borrow::Cow;

use toml_parser::{ErrorSink, ParseError};

use super::error::{BoundedErrors, SyntaxError};
use super::tree::{DecodedTextIndex, Document, Name, NodeKind, Span, TableId, TableOrigin, ValueNode};

/// A table header, `[path.key]` or `[[path.key]]`.
#[derive(Clone, Debug)]
pub(super) struct TableHeader<'s> {
    pub(super) path: Vec<Name<'s>>,
    /// Last part of the name. `None` if the header is unusable, in which case the keys below it are ignored.
    pub(super) key: Option<Name<'s>>,
    /// Span of the header, including the brackets.
    pub(super) span: Span,
    /// Whether the header has double brackets.
    pub(super) is_list: bool,
}

/// A document under construction.
pub(super) struct DocumentBuilder<'s> {
    pub(super) document: Document<'s>,
    /// The current table.
    table: TableId,
    /// The header that starts `table`, or `None` if `table` is the root. The table is inserted when the next
    /// header begins.
    header: Option<TableHeader<'s>>,
    /// An unclosed header, which a later expression may close.
    pub(super) open: Option<TableHeader<'s>>,
    /// Whether the rest of the document is ignored because a key has no value.
    pub(super) is_lost: bool,
    pub(super) syntax: BoundedErrors,
    pub(super) meaning: BoundedErrors,
    /// Stack of the elements of all arrays being read.
    pub(super) elements: Vec<ValueNode>,
}

/// Collects parser errors in the part of the text that starts at byte `base`.
pub(super) struct ErrorCollector<'a> {
    pub(super) errors: &'a mut BoundedErrors,
    pub(super) base: usize,
}

impl ErrorSink for ErrorCollector<'_> {
    fn report_error(&mut self, error: ParseError) {
        self.errors.push_with(|| SyntaxError::from_parse_error(&error, self.base));
    }
}

impl<'s> DocumentBuilder<'s> {
    pub(super) fn new(source: &'s str) -> Self {
        Self::from_document(Document::new(source))
    }

    /// Adds a new, detached table to a document. Returns a builder that adds keys to this table, and the
    /// table's ID.
    pub(super) fn from_document_with_new_table(mut document: Document<'s>) -> (Self, TableId) {
        let table = document.add_table(TableOrigin::default());
        (Self { table, ..Self::from_document(document) }, table)
    }

    fn from_document(document: Document<'s>) -> Self {
        Self {
            document,
            table: Document::ROOT,
            header: None,
            open: None,
            is_lost: false,
            syntax: BoundedErrors::default(),
            meaning: BoundedErrors::default(),
            elements: Vec::new(),
        }
    }

    /// Whether a header is unclosed.
    pub(super) fn has_unclosed_header(&self) -> bool {
        self.open.is_some()
    }

    /// Completes the document at the end of the text.
    pub(super) fn finish(mut self) -> (Document<'s>, Vec<SyntaxError>) {
        if let Some(header) = self.open.take() {
            self.start_table(header);
        }
        self.finish_table();
        (self.document, self.syntax.concatenate(self.meaning))
    }

    /// Stores the decoded string at `span`.
    pub(super) fn store_string(&mut self, span: Span, text: Cow<'s, str>) -> DecodedTextIndex {
        self.document.store_decoded_string(span, text)
    }

    /// Creates an array from the elements starting at `first`.
    pub(super) fn end_array(&mut self, first: usize) -> NodeKind {
        let kind = self.document.add_array(&self.elements[first..]);
        self.elements.truncate(first);
        kind
    }

    fn add_error(&mut self, span: Span, what: impl Into<String>) {
        self.meaning.push_with(|| SyntaxError::at(span.range(), what));
    }

    fn report_duplicate(&mut self, span: Span) {
        self.add_error(span, "duplicate key");
    }

    /// Adds `path.key = value` to the current table.
    pub(super) fn add_key_value(&mut self, path: &[Name<'s>], key: Name<'s>, value: ValueNode) {
        let is_dotted = !path.is_empty();
        let Some(parent) = self.find_or_create_table(self.table, path, is_dotted) else { return };
        let adds_to_defined = is_dotted && !self.document.table_origin(parent).is_implicit;
        if adds_to_defined || self.document.find_in_table(parent, &key.text).is_some() {
            self.report_duplicate(key.span);
        } else {
            self.document.add_entry(parent, key, value);
        }
    }

    /// Adds `path.key = value` to the inline table `table`.
    pub(super) fn add_inline_key_value(
        &mut self,
        table: TableId,
        path: &[Name<'s>],
        key: Name<'s>,
        value: ValueNode,
    ) {
        let Some(parent) = self.find_or_create_inline_table(table, path) else { return };
        let adds_to_defined = self.document.table_origin(parent).is_dotted == path.is_empty();
        if adds_to_defined || self.document.find_in_table(parent, &key.text).is_some() {
            self.report_duplicate(key.span);
        } else {
            self.document.add_entry(parent, key, value);
        }
    }

    /// Starts the table that a header names. The header defines the table even if longer headers have already
    /// created it implicitly. If the table is already defined, reports an error but still adds keys to it.
    pub(super) fn start_table(&mut self, header: TableHeader<'s>) {
        self.table = self
            .take_existing_table(&header)
            .unwrap_or_else(|| self.document.add_table(TableOrigin::default()));
        let is_inline = self.document.table_origin(self.table).is_inline;
        self.document.set_table_origin(self.table, TableOrigin { is_inline, ..TableOrigin::default() });
        self.header = Some(header);
    }

    /// Removes and returns the table that a header names, or returns `None` if the table does not exist yet.
    fn take_existing_table(&mut self, header: &TableHeader<'s>) -> Option<TableId> {
        if header.is_list {
            return None;
        }
        let parent = self.find_or_create_table(Document::ROOT, &header.path, false)?;
        let key = header.key.as_ref()?;
        let old = self.document.remove_entry(parent, &key.text)?;
        let table = if let NodeKind::Table(table) = old.kind { Some(table) } else { None };
        let origin = table.map(|table| self.document.table_origin(table));
        if !origin.is_some_and(|origin| origin.is_implicit && !origin.is_dotted) {
            self.report_duplicate(key.span);
        }
        table
    }

    /// Inserts the current table under its header.
    pub(super) fn finish_table(&mut self) {
        let Some(TableHeader { path, key, span, is_list }) = self.header.take() else { return };
        let node = ValueNode { span, kind: NodeKind::Table(self.table) };
        let Some(key) = key else { return };
        let Some(parent) = self.find_or_create_table(Document::ROOT, &path, false) else { return };
        if !is_list {
            self.document.add_entry(parent, key, node);
            return;
        }
        match self.document.find_in_table(parent, &key.text).map(|found| found.kind) {
            Some(NodeKind::List(list)) => self.document.table_list_mut(list).push(node),
            Some(_) => self.report_duplicate(key.span),
            None => {
                let list = self.document.add_table_list();
                self.document.add_entry(parent, key, ValueNode { span, kind: list });
                if let NodeKind::List(list) = list {
                    self.document.table_list_mut(list).push(node);
                }
            }
        }
    }

    /// Returns the table at `path`, after creating any missing tables.
    fn find_or_create_table(&mut self, from: TableId, path: &[Name<'s>], is_dotted: bool) -> Option<TableId> {
        path.iter().try_fold(from, |table, name| {
            let Some(found) = self.document.find_in_table(table, &name.text) else {
                let origin = TableOrigin { is_implicit: true, is_dotted, is_inline: false };
                return Some(self.create_implicit_table(table, name, origin));
            };
            match found.kind {
                NodeKind::Table(inner) => self.check_table_extendable(inner, name, is_dotted),
                NodeKind::List(list) => {
                    let last = self.document.table_list_mut(list).last()?.kind;
                    if let NodeKind::Table(last) = last { Some(last) } else { None }
                }
                other => self.report_not_extendable(name, other),
            }
        })
    }

    /// Returns the table if a header or dotted key may add keys to it, and reports an error otherwise.
    fn check_table_extendable(
        &mut self,
        table: TableId,
        name: &Name<'s>,
        is_dotted: bool,
    ) -> Option<TableId> {
        let origin = self.document.table_origin(table);
        if origin.is_inline {
            self.add_error(name.span, "cannot extend value of type inline table with a dotted key");
            return None;
        }
        if is_dotted && !origin.is_implicit {
            self.report_duplicate(name.span);
            return None;
        }
        if is_dotted {
            self.document.set_table_origin(table, TableOrigin { is_dotted, ..origin });
        }
        Some(table)
    }

    /// Like [`Self::find_or_create_table`], but within an inline table.
    fn find_or_create_inline_table(&mut self, from: TableId, path: &[Name<'s>]) -> Option<TableId> {
        path.iter().try_fold(from, |table, name| {
            let Some(found) = self.document.find_in_table(table, &name.text) else {
                let origin = TableOrigin { is_implicit: true, is_dotted: true, is_inline: true };
                return Some(self.create_implicit_table(table, name, origin));
            };
            match found.kind {
                NodeKind::Table(inner) if self.document.table_origin(inner).is_implicit => Some(inner),
                NodeKind::Table(_) => {
                    self.report_duplicate(name.span);
                    None
                }
                other => self.report_not_extendable(name, other),
            }
        })
    }

    fn create_implicit_table(&mut self, parent: TableId, name: &Name<'s>, origin: TableOrigin) -> TableId {
        let table = self.document.add_table(origin);
        self.document.add_entry(
            parent,
            name.clone(),
            ValueNode { span: name.span, kind: NodeKind::Table(table) },
        );
        table
    }

    fn report_not_extendable(&mut self, name: &Name<'s>, kind: NodeKind) -> Option<TableId> {
        let what = match kind {
            NodeKind::String(_) => "string",
            NodeKind::Integer(..) => "integer",
            NodeKind::Float(_) | NodeKind::Number(_) => "float",
            NodeKind::Boolean(_) => "boolean",
            NodeKind::Datetime => "datetime",
            NodeKind::Array(_) | NodeKind::List(_) => "array",
            NodeKind::Table(_) => "table",
        };
        self.add_error(name.span, format!("cannot extend value of type {what} with a dotted key"));
        None
    }
}
