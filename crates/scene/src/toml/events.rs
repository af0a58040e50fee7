//! Converts `toml_parser` events to headers, keys and values.
//!
//! If the text has errors, events may be inconsistent: a close without an open, or a key instead of a value.
//! The resulting values are the same as with the `toml` crate.

use std::borrow::Cow;

use toml_parser::Source;
use toml_parser::decoder::{IntegerRadix, ScalarKind};
use toml_parser::parser::{Event, EventKind};

use super::MAX_DEPTH;
use super::assembly::{DocumentBuilder, ErrorCollector, TableHeader};
use super::error::SyntaxError;
use super::tree::{Name, NodeKind, Radix, Span, TableOrigin, ValueNode};

/// The events of one expression.
pub(super) struct ExpressionEventReader<'e, 's> {
    pub(super) events: &'e [Event],
    /// The text into which the events index. `base` is the text's offset in the document.
    pub(super) source: Source<'s>,
    pub(super) base: usize,
    pub(super) assembly: &'e mut DocumentBuilder<'s>,
}

impl<'s> ExpressionEventReader<'_, 's> {
    /// Reads all events.
    pub(super) fn read_all(mut self) {
        if self.assembly.open.is_some() {
            self.read_rest_of_header();
        }
        while let (false, Some(event)) = (self.assembly.is_lost, self.next_raw_event()) {
            match event.kind() {
                EventKind::StdTableOpen | EventKind::ArrayTableOpen => {
                    self.assembly.finish_table();
                    let is_list = event.kind() == EventKind::ArrayTableOpen;
                    let span = self.span(event);
                    self.assembly.open = Some(TableHeader { path: Vec::new(), key: None, span, is_list });
                    self.read_rest_of_header();
                }
                EventKind::SimpleKey => self.read_key_value(event),
                // Skip whitespace and the rest of incomplete expressions.
                _ => {}
            }
        }
    }

    fn next_raw_event(&mut self) -> Option<Event> {
        let (first, rest) = self.events.split_first()?;
        self.events = rest;
        Some(*first)
    }

    fn next_if(&mut self, kind: EventKind) -> Option<Event> {
        let is_next = self.events.first().is_some_and(|event| event.kind() == kind);
        if is_next { self.next_raw_event() } else { None }
    }

    fn span(&self, event: Event) -> Span {
        Span::new(self.base + event.span().start(), self.base + event.span().end())
    }

    /// Reads the rest of the open header. An unclosed header is closed by the next header, and takes that
    /// header's key.
    fn read_rest_of_header(&mut self) {
        let Some(mut header) = self.assembly.open.take() else { return };
        while let Some(event) = self.next_raw_event() {
            match event.kind() {
                EventKind::StdTableClose | EventKind::ArrayTableClose => {
                    header.span.end = self.span(event).end;
                    self.assembly.start_table(header);
                    return;
                }
                EventKind::SimpleKey => (header.path, header.key) = self.read_key(event),
                _ => {}
            }
        }
        self.assembly.open = Some(header);
    }

    fn read_key_value(&mut self, event: Event) {
        let (path, key) = self.read_key(event);
        self.next_if(EventKind::Whitespace);
        let (Some(key), Some(_)) = (key, self.next_if(EventKind::KeyValSep)) else {
            self.assembly.is_lost = true;
            return;
        };
        self.next_if(EventKind::Whitespace);
        let value = self
            .next_raw_event()
            .and_then(|event| self.read_value(event))
            .unwrap_or_else(|| self.placeholder_value());
        self.assembly.add_key_value(&path, key, value);
    }

    /// Returns a placeholder for a missing value.
    fn placeholder_value(&mut self) -> ValueNode {
        let span = Span::default();
        let text = self.assembly.store_string(span, Cow::Borrowed("0"));
        ValueNode { span, kind: NodeKind::Integer(text, Radix::Decimal) }
    }

    /// Reads a dotted key. Returns its path and its last part, which is `None` if the key has too many parts.
    fn read_key(&mut self, event: Event) -> (Vec<Name<'s>>, Option<Name<'s>>) {
        let mut path = Vec::new();
        let mut last = event;
        let mut parts = 1;
        while self.is_before_key_dot() {
            while let Some(event) = self.next_raw_event() {
                if event.kind() != EventKind::SimpleKey {
                    continue;
                }
                if parts < MAX_DEPTH {
                    let name = self.decode_key_part(last);
                    path.push(name);
                }
                parts += 1;
                last = event;
                break;
            }
        }
        if parts > MAX_DEPTH {
            let span = Span { end: self.span(last).end, ..self.span(event) };
            self.assembly.meaning.push_with(|| SyntaxError::at(span.range(), "recursion limit"));
            return (Vec::new(), None);
        }
        let name = self.decode_key_part(last);
        (path, Some(name))
    }

    fn is_before_key_dot(&self) -> bool {
        let kind = |at: usize| self.events.get(at).map(|event: &Event| event.kind());
        match kind(0) {
            Some(EventKind::KeySep) => true,
            Some(EventKind::Whitespace) => kind(1) == Some(EventKind::KeySep),
            _ => false,
        }
    }

    fn decode_key_part(&mut self, event: Event) -> Name<'s> {
        let mut text = Cow::Borrowed("");
        let mut sink = ErrorCollector { errors: &mut self.assembly.meaning, base: self.base };
        if let Some(raw) = self.source.get(event) {
            raw.decode_key(&mut text, &mut sink);
        }
        Name { span: self.span(event), text }
    }

    fn read_value(&mut self, event: Event) -> Option<ValueNode> {
        match event.kind() {
            EventKind::InlineTableOpen => Some(self.read_inline_table(event)),
            EventKind::ArrayOpen => Some(self.read_array(event)),
            EventKind::Scalar => Some(self.read_scalar(event)),
            _ => None,
        }
    }

    fn read_scalar(&mut self, event: Event) -> ValueNode {
        let span = self.span(event);
        let mut decoded = Cow::Borrowed("");
        let mut sink = ErrorCollector { errors: &mut self.assembly.meaning, base: self.base };
        let raw = self.source.get(event);
        let kind = raw.map_or(ScalarKind::String, |raw| raw.decode_scalar(&mut decoded, &mut sink));
        if kind == ScalarKind::DateTime
            && let Err(error) = decoded.parse::<toml_datetime::Datetime>()
        {
            self.assembly.meaning.push_with(|| SyntaxError::at(span.range(), error.to_string()));
        }
        let mut text = || self.assembly.store_string(span, std::mem::take(&mut decoded));
        let kind = match kind {
            ScalarKind::String => NodeKind::String(text()),
            ScalarKind::Boolean(value) => NodeKind::Boolean(value),
            ScalarKind::DateTime => NodeKind::Datetime,
            ScalarKind::Float => NodeKind::Float(text()),
            ScalarKind::Integer(radix) => NodeKind::Integer(text(), radix_from_parser(radix)),
        };
        ValueNode { span, kind }
    }

    /// Reads an array up to its end or the first unexpected event.
    fn read_array(&mut self, open: Event) -> ValueNode {
        let first = self.assembly.elements.len();
        let mut span = self.span(open);
        let mut value = None;
        while let Some(event) = self.next_raw_event() {
            span.end = self.span(event).end;
            match event.kind() {
                EventKind::InlineTableOpen | EventKind::ArrayOpen | EventKind::Scalar => {
                    value = self.read_value(event);
                }
                EventKind::ValueSep => self.assembly.elements.extend(value.take()),
                EventKind::ArrayClose => {
                    self.assembly.elements.extend(value.take());
                    break;
                }
                EventKind::Whitespace | EventKind::Comment | EventKind::Newline | EventKind::Error => {}
                EventKind::StdTableOpen
                | EventKind::StdTableClose
                | EventKind::ArrayTableOpen
                | EventKind::ArrayTableClose
                | EventKind::InlineTableClose
                | EventKind::SimpleKey
                | EventKind::KeySep
                | EventKind::KeyValSep => break,
            }
        }
        ValueNode { span, kind: self.assembly.end_array(first) }
    }

    /// Reads an inline table up to its end or the first unexpected event.
    fn read_inline_table(&mut self, open: Event) -> ValueNode {
        let origin = TableOrigin { is_inline: true, ..TableOrigin::default() };
        let table = self.assembly.document.add_table(origin);
        let mut span = self.span(open);
        let (mut key, mut value) = (None, None);
        while let Some(event) = self.next_raw_event() {
            span.end = self.span(event).end;
            match event.kind() {
                EventKind::SimpleKey => {
                    if let (path, Some(last)) = self.read_key(event) {
                        key = Some((path, last));
                    }
                }
                EventKind::InlineTableOpen | EventKind::ArrayOpen | EventKind::Scalar => {
                    value = self.read_value(event);
                }
                EventKind::ValueSep | EventKind::InlineTableClose => {
                    if let (Some((path, key)), Some(value)) = (key.take(), value.take()) {
                        self.assembly.add_inline_key_value(table, &path, key, value);
                    }
                    if event.kind() == EventKind::InlineTableClose {
                        break;
                    }
                }
                EventKind::KeyValSep
                | EventKind::Whitespace
                | EventKind::Comment
                | EventKind::Newline
                | EventKind::Error => {}
                EventKind::StdTableOpen
                | EventKind::StdTableClose
                | EventKind::ArrayTableOpen
                | EventKind::ArrayTableClose
                | EventKind::ArrayClose
                | EventKind::KeySep => break,
            }
        }
        ValueNode { span, kind: NodeKind::Table(table) }
    }
}

fn radix_from_parser(radix: IntegerRadix) -> Radix {
    match radix {
        IntegerRadix::Dec => Radix::Decimal,
        IntegerRadix::Hex => Radix::Hexadecimal,
        IntegerRadix::Oct => Radix::Octal,
        IntegerRadix::Bin => Radix::Binary,
    }
}
