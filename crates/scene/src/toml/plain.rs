//! The simplest lines, read in one go: nothing, a comment, `[a]`, `[a.b]`, `[[a]]`, and `key = value` with a bare key
//! and a decimal number, a word, a text without escapes, or a flat array of those on one line.
//!
//! Large scenes consist of such lines, which take a tenth of the time here. Any other line is left alone, so that its
//! errors are those of [`super::expression`]; `tests` holds both ways to the same result.

use std::borrow::Cow;

use super::assembly::{Assembly, Header};
use super::tree::{Kind, Name, Node, Radix, Span, Text};

/// Reads the line that begins at byte `at`, if it is one of the simplest; gives the byte after it.
pub(super) fn read<'s>(source: &'s str, at: usize, assembly: &mut Assembly<'s>) -> Option<usize> {
    let mut line = Line { source, at };
    line.space();
    match line.peek() {
        b'[' => {
            let header = line.header()?;
            line.end()?;
            if !assembly.is_lost {
                assembly.finish_table();
                assembly.start_table(header);
            }
        }
        first if is_bare(first) => {
            let key = line.name()?;
            line.space();
            line.take(b'=')?;
            line.space();
            let before = assembly.elements.len();
            let value = line.value(&mut assembly.elements);
            let Some((value, ())) = value.and_then(|value| Some((value, line.end()?))) else {
                assembly.elements.truncate(before);
                return None;
            };
            if assembly.is_lost {
                assembly.elements.truncate(before);
            } else {
                let kind = value.kind.unwrap_or_else(|| assembly.end_array(before));
                assembly.key_value(&[], key, Node { span: value.span, kind });
            }
        }
        _ => line.end()?,
    }
    Some(line.at)
}

/// Value after the `=`; without a kind it is an array.
struct Written {
    span: Span,
    kind: Option<Kind>,
}

struct Line<'s> {
    source: &'s str,
    at: usize,
}

impl<'s> Line<'s> {
    /// The byte here; a zero at the end.
    fn peek(&self) -> u8 {
        self.source.as_bytes().get(self.at).copied().unwrap_or(0)
    }

    fn take(&mut self, byte: u8) -> Option<()> {
        if self.peek() != byte {
            return None;
        }
        self.at += 1;
        Some(())
    }

    /// Goes over bytes of a kind; how many there were.
    fn skip(&mut self, is_one: impl Fn(u8) -> bool) -> usize {
        let rest = self.source.as_bytes().get(self.at..).unwrap_or_default();
        let count = rest.iter().position(|byte| !is_one(*byte)).unwrap_or(rest.len());
        self.at += count;
        count
    }

    fn space(&mut self) {
        self.skip(|byte| byte == b' ' || byte == b'\t');
    }

    /// Space, a comment and the end of the line or of the text.
    fn end(&mut self) -> Option<()> {
        self.space();
        if self.peek() == b'#' {
            self.skip(|byte| byte == b'\t' || (byte >= b' ' && byte != 0x7f));
        }
        if self.at == self.source.len() {
            return Some(());
        }
        if self.peek() == b'\r' {
            self.at += 1;
        }
        self.take(b'\n')
    }

    fn name(&mut self) -> Option<Name<'s>> {
        let start = self.at;
        if self.skip(is_bare) == 0 {
            return None;
        }
        let text = Cow::Borrowed(self.source.get(start..self.at)?);
        Some(Name { span: Span::new(start, self.at), text })
    }

    fn header(&mut self) -> Option<Header<'s>> {
        let start = self.at;
        self.take(b'[')?;
        let is_list = self.take(b'[').is_some();
        let mut key = self.name()?;
        let mut path = Vec::new();
        if self.take(b'.').is_some() {
            path.push(std::mem::replace(&mut key, self.name()?));
        }
        self.take(b']')?;
        if is_list {
            self.take(b']')?;
        }
        Some(Header { path, key: Some(key), span: Span::new(start, self.at), is_list })
    }

    /// The elements of an array go to `elements`.
    fn value(&mut self, elements: &mut Vec<Node>) -> Option<Written> {
        let start = self.at;
        if self.take(b'[').is_none() {
            let Node { span, kind } = self.scalar()?;
            return Some(Written { span, kind: Some(kind) });
        }
        loop {
            self.space();
            if self.take(b']').is_some() {
                return Some(Written { span: Span::new(start, self.at), kind: None });
            }
            elements.push(self.scalar()?);
            self.space();
            if self.peek() != b']' {
                self.take(b',')?;
            }
        }
    }

    fn scalar(&mut self) -> Option<Node> {
        let start = self.at;
        let kind = match self.peek() {
            b'"' => self.quoted(|byte| byte != b'"' && byte != b'\\')?,
            b'\'' => self.quoted(|byte| byte != b'\'')?,
            b't' => self.word("true", true)?,
            b'f' => self.word("false", false)?,
            _ => self.number()?,
        };
        Some(Node { span: Span::new(start, self.at), kind })
    }

    fn quoted(&mut self, is_plain: impl Fn(u8) -> bool) -> Option<Kind> {
        let quote = self.peek();
        self.at += 1;
        let length = self.skip(|byte| is_plain(byte) && (byte == b'\t' || byte >= b' ') && byte != 0x7f);
        self.take(quote)?;
        // Three quotes begin a text of several lines.
        if length == 0 && self.peek() == quote {
            return None;
        }
        Some(Kind::String(Text::QUOTED))
    }

    fn word(&mut self, word: &str, value: bool) -> Option<Kind> {
        if !self.source.as_bytes().get(self.at..)?.starts_with(word.as_bytes()) {
            return None;
        }
        self.at += word.len();
        self.is_apart().then_some(Kind::Boolean(value))
    }

    /// A decimal number; what follows it must not belong to it.
    fn number(&mut self) -> Option<Kind> {
        let sign = matches!(self.peek(), b'+' | b'-');
        self.at += usize::from(sign);
        let has_zero = self.peek() == b'0';
        let digits = self.skip(|byte| byte.is_ascii_digit());
        if digits == 0 || (has_zero && digits > 1) {
            return None;
        }
        let mut is_float = false;
        if self.take(b'.').is_some() {
            is_float = true;
            self.digits()?;
        }
        if matches!(self.peek(), b'e' | b'E') {
            is_float = true;
            self.at += 1;
            self.at += usize::from(matches!(self.peek(), b'+' | b'-'));
            self.digits()?;
        }
        let kind =
            if is_float { Kind::Float(Text::WHOLE) } else { Kind::Integer(Text::WHOLE, Radix::Decimal) };
        self.is_apart().then_some(kind)
    }

    fn digits(&mut self) -> Option<()> {
        (self.skip(|byte| byte.is_ascii_digit()) > 0).then_some(())
    }

    /// Whether a value ends here.
    fn is_apart(&self) -> bool {
        matches!(self.peek(), b' ' | b'\t' | b',' | b']' | b'\r' | b'\n' | b'#')
            || self.at == self.source.len()
    }
}

fn is_bare(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-'
}
