//! A fast path for simple lines: blank lines, comments, `[a]`, `[a.b]`, `[[a]]`, and `key = value` with a
//! bare key and a decimal number, a Boolean, a string without escapes, or a flat single-line array of such
//! values.
//!
//! Large scenes consist of such lines, and this parser is ten times as fast as [`super::expression`],
//! which handles all other lines, including lines with errors. Tests check that both parsers return the same
//! results.

use std::borrow::Cow;

use super::assembly::{DocumentBuilder, TableHeader};
use super::tree::{DecodedTextIndex, Name, NodeKind, Radix, Span, ValueNode};

/// Reads the line that starts at byte `at`. Returns the offset after the line, or `None` if the line is not
/// simple.
pub(super) fn read_plain_line<'s>(
    source: &'s str,
    at: usize,
    assembly: &mut DocumentBuilder<'s>,
) -> Option<usize> {
    let mut line = LineCursor { source, at };
    line.skip_whitespace();
    match line.peek() {
        b'[' => {
            let header = line.read_header()?;
            line.read_line_end()?;
            if !assembly.is_lost {
                assembly.finish_table();
                assembly.start_table(header);
            }
        }
        first if is_bare_key_byte(first) => {
            let key = line.read_bare_key_name()?;
            line.skip_whitespace();
            line.expect_byte(b'=')?;
            line.skip_whitespace();
            let before = assembly.elements.len();
            let value = line.read_value(&mut assembly.elements);
            let Some((value, ())) = value.and_then(|value| Some((value, line.read_line_end()?))) else {
                assembly.elements.truncate(before);
                return None;
            };
            if assembly.is_lost {
                assembly.elements.truncate(before);
            } else {
                let kind = value.kind.unwrap_or_else(|| assembly.end_array(before));
                assembly.add_key_value(&[], key, ValueNode { span: value.span, kind });
            }
        }
        _ => line.read_line_end()?,
    }
    Some(line.at)
}

/// A scanned value, which is an array if `kind` is `None`.
struct ScannedValue {
    span: Span,
    kind: Option<NodeKind>,
}

/// A cursor within a line.
struct LineCursor<'s> {
    source: &'s str,
    at: usize,
}

impl<'s> LineCursor<'s> {
    /// The current byte, or 0 at the end.
    fn peek(&self) -> u8 {
        self.source.as_bytes().get(self.at).copied().unwrap_or(0)
    }

    fn expect_byte(&mut self, byte: u8) -> Option<()> {
        if self.peek() != byte {
            return None;
        }
        self.at += 1;
        Some(())
    }

    /// Skips bytes while `is_one` is true. Returns the number of bytes skipped.
    fn skip_while(&mut self, is_one: impl Fn(u8) -> bool) -> usize {
        let rest = self.source.as_bytes().get(self.at..).unwrap_or_default();
        let count = rest.iter().position(|byte| !is_one(*byte)).unwrap_or(rest.len());
        self.at += count;
        count
    }

    fn skip_whitespace(&mut self) {
        self.skip_while(|byte| byte == b' ' || byte == b'\t');
    }

    /// Reads optional whitespace, an optional comment, and the end of the line or text.
    fn read_line_end(&mut self) -> Option<()> {
        self.skip_whitespace();
        if self.peek() == b'#' {
            self.skip_while(|byte| byte == b'\t' || (byte >= b' ' && byte != 0x7f));
        }
        if self.at == self.source.len() {
            return Some(());
        }
        if self.peek() == b'\r' {
            self.at += 1;
        }
        self.expect_byte(b'\n')
    }

    fn read_bare_key_name(&mut self) -> Option<Name<'s>> {
        let start = self.at;
        if self.skip_while(is_bare_key_byte) == 0 {
            return None;
        }
        let text = Cow::Borrowed(self.source.get(start..self.at)?);
        Some(Name { span: Span::new(start, self.at), text })
    }

    fn read_header(&mut self) -> Option<TableHeader<'s>> {
        let start = self.at;
        self.expect_byte(b'[')?;
        let is_list = self.expect_byte(b'[').is_some();
        let mut key = self.read_bare_key_name()?;
        let mut path = Vec::new();
        if self.expect_byte(b'.').is_some() {
            path.push(std::mem::replace(&mut key, self.read_bare_key_name()?));
        }
        self.expect_byte(b']')?;
        if is_list {
            self.expect_byte(b']')?;
        }
        Some(TableHeader { path, key: Some(key), span: Span::new(start, self.at), is_list })
    }

    /// Reads a value. Pushes the elements of an array onto `elements`.
    fn read_value(&mut self, elements: &mut Vec<ValueNode>) -> Option<ScannedValue> {
        let start = self.at;
        if self.expect_byte(b'[').is_none() {
            let ValueNode { span, kind } = self.read_scalar()?;
            return Some(ScannedValue { span, kind: Some(kind) });
        }
        loop {
            self.skip_whitespace();
            if self.expect_byte(b']').is_some() {
                return Some(ScannedValue { span: Span::new(start, self.at), kind: None });
            }
            elements.push(self.read_scalar()?);
            self.skip_whitespace();
            if self.peek() != b']' {
                self.expect_byte(b',')?;
            }
        }
    }

    fn read_scalar(&mut self) -> Option<ValueNode> {
        let start = self.at;
        let kind = match self.peek() {
            b'"' => self.read_plain_string(|byte| byte != b'"' && byte != b'\\')?,
            b'\'' => self.read_plain_string(|byte| byte != b'\'')?,
            b't' => self.read_boolean("true", true)?,
            b'f' => self.read_boolean("false", false)?,
            _ => self.read_number()?,
        };
        Some(ValueNode { span: Span::new(start, self.at), kind })
    }

    fn read_plain_string(&mut self, is_plain: impl Fn(u8) -> bool) -> Option<NodeKind> {
        let quote = self.peek();
        self.at += 1;
        let length =
            self.skip_while(|byte| is_plain(byte) && (byte == b'\t' || byte >= b' ') && byte != 0x7f);
        self.expect_byte(quote)?;
        // Three quotes start a multi-line string.
        if length == 0 && self.peek() == quote {
            return None;
        }
        Some(NodeKind::String(DecodedTextIndex::QUOTED))
    }

    fn read_boolean(&mut self, word: &str, value: bool) -> Option<NodeKind> {
        if !self.source.as_bytes().get(self.at..)?.starts_with(word.as_bytes()) {
            return None;
        }
        self.at += word.len();
        self.is_at_delimiter().then_some(NodeKind::Boolean(value))
    }

    /// Reads a decimal number that ends at a delimiter.
    fn read_number(&mut self) -> Option<NodeKind> {
        let sign = matches!(self.peek(), b'+' | b'-');
        self.at += usize::from(sign);
        let has_zero = self.peek() == b'0';
        let digits = self.skip_while(|byte| byte.is_ascii_digit());
        if digits == 0 || (has_zero && digits > 1) {
            return None;
        }
        let mut is_float = false;
        if self.expect_byte(b'.').is_some() {
            is_float = true;
            self.skip_digits()?;
        }
        if matches!(self.peek(), b'e' | b'E') {
            is_float = true;
            self.at += 1;
            self.at += usize::from(matches!(self.peek(), b'+' | b'-'));
            self.skip_digits()?;
        }
        let kind = if is_float {
            NodeKind::Float(DecodedTextIndex::WHOLE)
        } else {
            NodeKind::Integer(DecodedTextIndex::WHOLE, Radix::Decimal)
        };
        self.is_at_delimiter().then_some(kind)
    }

    fn skip_digits(&mut self) -> Option<()> {
        (self.skip_while(|byte| byte.is_ascii_digit()) > 0).then_some(())
    }

    /// Whether the value ends here because the next byte is a delimiter.
    fn is_at_delimiter(&self) -> bool {
        matches!(self.peek(), b' ' | b'\t' | b',' | b']' | b'\r' | b'\n' | b'#')
            || self.at == self.source.len()
    }
}

fn is_bare_key_byte(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-'
}
