//! Tokenizer for text files that consist mostly of numbers. Works on bytes, so it neither requires UTF-8 nor
//! copies the text.

use std::borrow::Cow;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use fast_float2::parse_partial;

use crate::assets::AssetError;
use crate::assets::read;
use crate::control::{CancelToken, Canceled};

/// Replaces carriage returns with line feeds in files without line feeds (classic Mac OS).
pub(super) fn convert_mac_line_ends(bytes: &[u8]) -> Cow<'_, [u8]> {
    if memchr::memchr(b'\n', bytes).is_some() || memchr::memchr(b'\r', bytes).is_none() {
        return Cow::Borrowed(bytes);
    }
    Cow::Owned(bytes.iter().map(|byte| if *byte == b'\r' { b'\n' } else { *byte }).collect())
}

/// Strips a UTF-8 byte order mark.
pub(super) fn strip_byte_order_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// Decodes a line as UTF-8. If it is not valid UTF-8, decodes it as Latin-1, where each byte is one
/// character.
pub(super) fn decode_line(line: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(line) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(line.iter().copied().map(char::from).collect()),
    }
}

/// Lines of a text file, read one at a time. If reading fails, the lines end early.
pub(super) struct LineReader {
    reader: BufReader<File>,
    /// Last byte of each line: a line feed, or a carriage return in classic Mac OS files.
    end: u8,
    line: Vec<u8>,
}

impl LineReader {
    /// Number of buffered bytes.
    const BUFFER: usize = 1 << 16;
    /// Maximum length of a line. Longer lines are split.
    const MAX_LENGTH: usize = 1 << 20;

    /// Opens a file with at most `limit` bytes, and skips the byte order mark.
    pub(super) fn open(path: &Path, limit: u64) -> Result<Self, AssetError> {
        let (file, _) = read::open_regular_with_limit(path, limit)?;
        let mut reader = BufReader::with_capacity(Self::BUFFER, file);
        let unreadable = |error| AssetError::from_io(path, &error);
        let start = reader.fill_buf().map_err(unreadable)?;
        let end = if matches!(convert_mac_line_ends(start), Cow::Owned(_)) { b'\r' } else { b'\n' };
        let mark = start.len() - strip_byte_order_mark(start).len();
        reader.consume(mark);
        Ok(Self { reader, end, line: Vec::new() })
    }

    /// Reads the next line, including its line end.
    pub(super) fn read_next_line(&mut self, token: &CancelToken) -> Result<Option<&[u8]>, Canceled> {
        self.line.clear();
        Ok(self.append_next_line(token)?.then_some(&self.line))
    }

    /// Skips buffered lines that do not contain `letter` in upper or lower case. This is much faster than
    /// reading them.
    pub(super) fn skip_buffered_lines_without_letter(&mut self, letter: u8) {
        let Ok(buffer) = self.reader.fill_buf() else { return };
        let (lower, upper) = (letter.to_ascii_lowercase(), letter.to_ascii_uppercase());
        let found = memchr::memchr2(lower, upper, buffer).unwrap_or(buffer.len());
        let skipped = memchr::memrchr(self.end, &buffer[..found]).map_or(0, |end| end + 1);
        self.reader.consume(skipped);
    }

    /// Appends further lines for as long as the last one ends with a backslash. Returns the joined lines.
    pub(super) fn append_continuation_lines(&mut self, token: &CancelToken) -> Result<&[u8], Canceled> {
        let is_continued = |line: &[u8]| line.trim_ascii_end().ends_with(b"\\");
        while is_continued(&self.line)
            && self.line.len() < Self::MAX_LENGTH
            && self.append_next_line(token)?
        {}
        Ok(&self.line)
    }

    fn append_next_line(&mut self, token: &CancelToken) -> Result<bool, Canceled> {
        token.check_pause_and_cancel()?;
        let mut rest = (&mut self.reader).take(Self::MAX_LENGTH as u64);
        Ok(rest.read_until(self.end, &mut self.line).is_ok_and(|length| length > 0))
    }
}

/// A cursor in a text file.
#[derive(Clone, Copy)]
pub(super) struct TextCursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> TextCursor<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// Byte offset.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    pub(super) fn remaining_byte_count(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Moves to the next word, skipping line ends and comments. Returns false at the end of the text.
    pub(super) fn skip_to_word_across_lines(&mut self) -> bool {
        loop {
            match self.bytes.get(self.at) {
                None => return false,
                Some(b'#') => self.move_to_next_line(),
                Some(byte) if byte.is_ascii_whitespace() => self.at += 1,
                Some(_) => return true,
            }
        }
    }

    /// Moves to the next word on this line. Returns false at the end of the line or at a comment.
    pub(super) fn skip_to_word_in_line(&mut self) -> bool {
        loop {
            match self.bytes.get(self.at) {
                None | Some(b'\n' | b'#') => return false,
                Some(byte) if byte.is_ascii_whitespace() => self.at += 1,
                Some(_) => return true,
            }
        }
    }

    /// Moves past the end of this line.
    pub(super) fn move_to_next_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|&byte| byte == b'\n').map_or(rest.len(), |end| end + 1);
    }

    /// Consumes the word at the cursor.
    pub(super) fn take_word(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&byte| byte.is_ascii_whitespace() || byte == b'#');
        let word = &rest[..length.unwrap_or(rest.len())];
        self.at += word.len();
        word
    }

    /// Consumes the number at the cursor. `nan` and `inf` are accepted. Overflow results in infinity.
    pub(super) fn take_float(&mut self) -> Option<f64> {
        let (value, length) = parse_partial::<f64, _>(&self.bytes[self.at..]).ok()?;
        self.skip_number_if_word_ends(length).then_some(value)
    }

    /// Consumes the integer at the cursor.
    pub(super) fn take_integer(&mut self) -> Option<i64> {
        let rest = &self.bytes[self.at..];
        let negative = rest.first() == Some(&b'-');
        let digits = &rest[usize::from(negative)..];
        let mut value = 0_i64;
        let mut length = 0;
        while let Some(digit) =
            digits.get(length).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10)
        {
            value = value.checked_mul(10)?.checked_add(i64::from(digit))?;
            length += 1;
        }
        let whole = length > 0 && self.skip_number_if_word_ends(length + usize::from(negative));
        whole.then_some(if negative { -value } else { value })
    }

    /// Moves past a number that is `length` bytes long, if a word ends there.
    fn skip_number_if_word_ends(&mut self, length: usize) -> bool {
        let ends =
            self.bytes.get(self.at + length).is_none_or(|byte| byte.is_ascii_whitespace() || *byte == b'#');
        self.at += if ends { length } else { 0 };
        ends
    }
}

/// Formats the first 20 bytes of a word for a message. Control characters are escaped.
pub(super) fn quote_word(bytes: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(&bytes[..bytes.len().min(20)]))
}

/// Error message for an unexpected word.
pub(super) fn expected_message(wanted: &str, found: &[u8]) -> String {
    format!("expected {wanted}, found {}", quote_word(found))
}

/// Error message for a line that ends too early.
pub(super) fn unexpected_line_end_message(wanted: &str) -> String {
    format!("expected {wanted}, found the end of the line")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blanks_and_comments_separate_words() {
        let mut cursor = TextCursor::new(b" ab#c d\n\r\n # e\nf", 0);
        assert!(cursor.skip_to_word_across_lines());
        assert_eq!(cursor.take_word(), b"ab");
        assert!(!cursor.skip_to_word_in_line());
        assert!(cursor.skip_to_word_across_lines());
        assert_eq!(cursor.take_word(), b"f");
        assert!(!cursor.skip_to_word_across_lines());
    }

    #[test]
    fn lone_carriage_returns_become_line_feeds() {
        assert_eq!(*convert_mac_line_ends(b"a\rb\r"), *b"a\nb\n");
        for as_it_is in [b"a\r\nb\rc".as_slice(), b"a\nb", b"a", b""] {
            assert!(matches!(convert_mac_line_ends(as_it_is), Cow::Borrowed(same) if same == as_it_is));
        }
    }

    #[test]
    fn numbers_must_span_the_whole_word() {
        let float = |text: &'static str| TextCursor::new(text.as_bytes(), 0).take_float();
        assert_eq!(float("1.5e-3 "), Some(1.5e-3));
        assert_eq!(float("-.5#"), Some(-0.5));
        assert_eq!(float("+2"), Some(2.0));
        assert_eq!(float("1e999"), Some(f64::INFINITY));
        assert!(float("nan").is_some_and(f64::is_nan));
        assert_eq!(float("1.5x"), None);
        assert_eq!(float(""), None);
        let integer = |text: &'static str| TextCursor::new(text.as_bytes(), 0).take_integer();
        assert_eq!(integer("-12\n"), Some(-12));
        assert_eq!(integer("1.0"), None);
        assert_eq!(integer("-"), None);
        assert_eq!(integer("99999999999999999999"), None);
    }
}
