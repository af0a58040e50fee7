//! Splits an OBJ file into statements and words.

use fast_float2::parse;

use super::super::text::decode_line;

/// A cursor in an OBJ file's text.
pub(super) struct ObjTextCursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> ObjTextCursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Byte offset of the next word.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    /// Moves to the first word of the next statement. Returns false at the end of the text.
    pub(super) fn move_to_next_statement(&mut self) -> bool {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        self.at < self.bytes.len()
    }

    /// Consumes the next word in this statement. A statement ends at a comment or at the end of the line,
    /// unless the line ends with a backslash.
    pub(super) fn next_word(&mut self) -> Option<&'a [u8]> {
        loop {
            match self.bytes.get(self.at)? {
                b'\n' | b'#' => return None,
                b'\\' => match self.continuation_line_offset(self.at) {
                    Some(next) => self.at = next,
                    None => break,
                },
                byte if byte.is_ascii_whitespace() => self.at += 1,
                _ => break,
            }
        }
        let ends = |at: usize| match self.bytes[at] {
            b'#' => true,
            b'\\' => self.continuation_line_offset(at).is_some(),
            byte => byte.is_ascii_whitespace(),
        };
        let end = (self.at + 1..self.bytes.len()).find(|at| ends(*at)).unwrap_or(self.bytes.len());
        let word = &self.bytes[self.at..end];
        self.at = end;
        Some(word)
    }

    /// Consumes the rest of this statement as a name. Names may contain blanks and `#`.
    pub(super) fn take_name(&mut self) -> String {
        let mut name = String::new();
        loop {
            let line = self.take_raw_line_rest();
            let text = line.trim_ascii_end();
            let Some(text) = text.strip_suffix(b"\\").filter(|_| self.at < self.bytes.len()) else {
                name.push_str(&decode_line(text));
                return name.trim().to_owned();
            };
            name.push_str(&decode_line(text));
            name.push(' ');
            self.at += 1;
        }
    }

    /// Consumes the rest of this line.
    pub(super) fn take_raw_line_rest(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let line = &rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())];
        self.at += line.len();
        line
    }

    /// Returns the offset of the next line if only blanks follow the backslash at `at`.
    fn continuation_line_offset(&self, at: usize) -> Option<usize> {
        let rest = &self.bytes[at + 1..];
        let blanks = rest.iter().take_while(|byte| byte.is_ascii_whitespace() && **byte != b'\n').count();
        (rest.get(blanks) == Some(&b'\n')).then_some(at + blanks + 2)
    }
}

/// Parses a number. `nan` and `inf` are accepted. Overflow results in infinity.
pub(super) fn parse_number(word: &[u8]) -> Option<f64> {
    parse(word).ok()
}

/// Parses an integer.
pub(super) fn parse_integer(word: &[u8]) -> Option<i64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Error message for a statement with too few numbers.
pub(super) fn too_few_numbers_message(wanted: usize, what: &str, found: usize) -> String {
    format!("expected {wanted} {what}, found {found}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(text: &str) -> Vec<Vec<String>> {
        let mut words = ObjTextCursor::new(text.as_bytes());
        let mut found = Vec::new();
        while words.move_to_next_statement() {
            let statement = std::iter::from_fn(|| words.next_word());
            found.push(statement.map(|word| String::from_utf8_lossy(word).into_owned()).collect());
            words.take_raw_line_rest();
        }
        found
    }

    #[test]
    fn backslashes_continue_statements() {
        assert_eq!(
            statements("f 1 2\\\n3 \\ \n 4# x \\\nv 1\r\n"),
            [vec!["f", "1", "2", "3", "4"], vec!["v", "1"]]
        );
        assert_eq!(statements("f 1\\2 \\"), [vec!["f", "1\\2", "\\"]]);
        assert_eq!(statements("# a \\\nf 1"), [vec![], vec!["f", "1"]]);
    }

    #[test]
    fn names_keep_blanks_and_number_signs() {
        let name = |text: &str| {
            let mut words = ObjTextCursor::new(text.as_bytes());
            words.next_word();
            words.take_name()
        };
        assert_eq!(name("usemtl\ta #2 \r\nf"), "a #2");
        assert_eq!(name("mtllib a.mtl \\\n b.mtl\nf"), "a.mtl   b.mtl");
        assert_eq!(name("mtllib folder\\"), "folder\\");
        assert_eq!(name("usemtl"), "");
    }
}
