//! Numbers from bytes: text files of numbers need no UTF-8 and no copies.

use std::borrow::Cow;

use fast_float2::parse_partial;

/// The text, with line feeds if its lines end in carriage returns alone, as on an old Macintosh.
pub(super) fn with_line_feeds(bytes: &[u8]) -> Cow<'_, [u8]> {
    if memchr::memchr(b'\n', bytes).is_some() || memchr::memchr(b'\r', bytes).is_none() {
        return Cow::Borrowed(bytes);
    }
    Cow::Owned(bytes.iter().map(|byte| if *byte == b'\r' { b'\n' } else { *byte }).collect())
}

/// The text behind the byte order mark that some editors put before it.
pub(super) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// A line as text: Latin-1 if it is not UTF-8, so that each byte is a letter and can be found again.
pub(super) fn decoded(line: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(line) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(line.iter().copied().map(char::from).collect()),
    }
}

/// A place in a text.
#[derive(Clone, Copy)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// Byte of the text.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    pub(super) fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Goes to the next word, over line ends and comments. False at the end of the text.
    pub(super) fn skip_blank(&mut self) -> bool {
        loop {
            match self.bytes.get(self.at) {
                None => return false,
                Some(b'#') => self.end_line(),
                Some(byte) if byte.is_ascii_whitespace() => self.at += 1,
                Some(_) => return true,
            }
        }
    }

    /// Goes to the next word of this line. False at its end or at a comment.
    pub(super) fn skip_in_line(&mut self) -> bool {
        loop {
            match self.bytes.get(self.at) {
                None | Some(b'\n' | b'#') => return false,
                Some(byte) if byte.is_ascii_whitespace() => self.at += 1,
                Some(_) => return true,
            }
        }
    }

    /// Goes behind the end of this line.
    pub(super) fn end_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|&byte| byte == b'\n').map_or(rest.len(), |end| end + 1);
    }

    /// Takes the word that starts here.
    pub(super) fn word(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&byte| byte.is_ascii_whitespace() || byte == b'#');
        let word = &rest[..length.unwrap_or(rest.len())];
        self.at += word.len();
        word
    }

    /// Takes the number that starts here. Overflow is infinite; `nan` and `inf` are numbers.
    pub(super) fn float(&mut self) -> Option<f64> {
        let (value, length) = parse_partial::<f64, _>(&self.bytes[self.at..]).ok()?;
        self.past(length).then_some(value)
    }

    /// Takes the whole number that starts here.
    pub(super) fn integer(&mut self) -> Option<i64> {
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
        let whole = length > 0 && self.past(length + usize::from(negative));
        whole.then_some(if negative { -value } else { value })
    }

    /// Goes past a number, if it ends there.
    fn past(&mut self, length: usize) -> bool {
        let ends =
            self.bytes.get(self.at + length).is_none_or(|byte| byte.is_ascii_whitespace() || *byte == b'#');
        self.at += if ends { length } else { 0 };
        ends
    }
}

/// Bytes from a file in a form to print: at most 20 of them, controls escaped.
pub(super) fn shown(bytes: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(&bytes[..bytes.len().min(20)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_lie_between_blanks_and_comments() {
        let mut cursor = Cursor::new(b" ab#c d\n\r\n # e\nf", 0);
        assert!(cursor.skip_blank());
        assert_eq!(cursor.word(), b"ab");
        assert!(!cursor.skip_in_line());
        assert!(cursor.skip_blank());
        assert_eq!(cursor.word(), b"f");
        assert!(!cursor.skip_blank());
    }

    #[test]
    fn carriage_returns_end_lines_where_nothing_else_does() {
        assert_eq!(*with_line_feeds(b"a\rb\r"), *b"a\nb\n");
        for as_it_is in [b"a\r\nb\rc".as_slice(), b"a\nb", b"a", b""] {
            assert!(matches!(with_line_feeds(as_it_is), Cow::Borrowed(same) if same == as_it_is));
        }
    }

    #[test]
    fn numbers_end_where_words_end() {
        let float = |text: &'static str| Cursor::new(text.as_bytes(), 0).float();
        assert_eq!(float("1.5e-3 "), Some(1.5e-3));
        assert_eq!(float("-.5#"), Some(-0.5));
        assert_eq!(float("+2"), Some(2.0));
        assert_eq!(float("1e999"), Some(f64::INFINITY));
        assert!(float("nan").is_some_and(f64::is_nan));
        assert_eq!(float("1.5x"), None);
        assert_eq!(float(""), None);
        let integer = |text: &'static str| Cursor::new(text.as_bytes(), 0).integer();
        assert_eq!(integer("-12\n"), Some(-12));
        assert_eq!(integer("1.0"), None);
        assert_eq!(integer("-"), None);
        assert_eq!(integer("99999999999999999999"), None);
    }
}
