//! Splits the text of a pbrt file into tokens.

use std::borrow::Cow;
use std::ops::Range;

/// An error at a position in the text.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PbrtError {
    pub(super) message: String,
    /// Span in the concatenated text of all files.
    pub(super) span: Range<usize>,
    /// Label of the underlined text.
    pub(super) label: String,
    pub(super) help: Option<String>,
}

impl PbrtError {
    pub(super) fn new(span: Range<usize>, message: impl Into<String>) -> Box<Self> {
        Box::new(Self { message: message.into(), span, label: String::new(), help: None })
    }

    pub(super) fn with_label(mut self: Box<Self>, label: impl Into<String>) -> Box<Self> {
        self.label = label.into();
        self
    }

    pub(super) fn with_help(mut self: Box<Self>, help: impl Into<String>) -> Box<Self> {
        self.help = Some(help.into());
        self
    }

    /// Suggests a similar name, if there is one.
    pub(super) fn with_suggestion(self: Box<Self>, near: Option<&str>) -> Box<Self> {
        match near {
            Some(near) => self.with_label(format!("did you mean `{near}`?")),
            None => self,
        }
    }
}

pub(super) type PbrtResult<T> = Result<T, Box<PbrtError>>;

/// Kinds of tokens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TokenKind {
    /// A directive, a number, `true` or `false`.
    Word,
    /// Text in double quotes.
    Quoted,
    OpenBracket,
    CloseBracket,
}

/// A token.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Token<'a> {
    pub(super) kind: TokenKind,
    /// The text, without quotes and with escape sequences replaced.
    pub(super) text: Cow<'a, str>,
    /// Span in the concatenated text of all files.
    pub(super) span: Range<usize>,
}

/// Maximum length of a quoted string.
const MAX_STRING_BYTES: usize = 1 << 16;

/// Lexer for the text of one file.
pub(super) struct Lexer<'a> {
    text: &'a str,
    at: usize,
    /// Offset of `text` in the concatenated text of all files.
    base: usize,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str, base: usize) -> Self {
        let at = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
        Self { text, at, base }
    }

    /// An empty span at the end of the text.
    pub(super) fn end_of_text_span(&self) -> Range<usize> {
        let end = self.base + self.text.trim_end().len();
        end..end
    }

    /// Returns the next token without consuming it.
    pub(super) fn peek(&mut self) -> PbrtResult<Option<Token<'a>>> {
        self.skip_blanks();
        let at = self.at;
        let token = self.next();
        self.at = at;
        token
    }

    /// Consumes the next token, or returns `None` at the end.
    pub(super) fn next(&mut self) -> PbrtResult<Option<Token<'a>>> {
        self.skip_blanks();
        let start = self.at;
        let Some(first) = self.text.as_bytes().get(start) else { return Ok(None) };
        let kind = match first {
            b'"' => return self.next_quoted().map(Some),
            b'[' => TokenKind::OpenBracket,
            b']' => TokenKind::CloseBracket,
            _ => TokenKind::Word,
        };
        let rest = &self.text.as_bytes()[start..];
        let length = match kind {
            TokenKind::Word => rest.iter().position(|byte| b" \t\r\n\"[]".contains(byte)),
            TokenKind::Quoted | TokenKind::OpenBracket | TokenKind::CloseBracket => Some(1),
        };
        self.at = start + length.unwrap_or(rest.len());
        let text = Cow::Borrowed(&self.text[start..self.at]);
        Ok(Some(Token { kind, text, span: self.global_span(start..self.at) }))
    }

    fn global_span(&self, local: Range<usize>) -> Range<usize> {
        self.base + local.start..self.base + local.end
    }

    fn skip_blanks(&mut self) {
        let bytes = self.text.as_bytes();
        loop {
            match bytes.get(self.at) {
                Some(b' ' | b'\t' | b'\r' | b'\n') => self.at += 1,
                Some(b'#') => {
                    let rest = &bytes[self.at..];
                    self.at += rest.iter().position(|byte| b"\r\n".contains(byte)).unwrap_or(rest.len());
                }
                Some(_) | None => return,
            }
        }
    }

    fn next_quoted(&mut self) -> PbrtResult<Token<'a>> {
        let (bytes, start) = (self.text.as_bytes(), self.at);
        let mut escaped = None;
        let mut at = start + 1;
        loop {
            match bytes.get(at) {
                None | Some(b'\n') => {
                    let line = self.global_span(start..at.min(bytes.len()));
                    return Err(PbrtError::new(line, "this string has no closing quote"));
                }
                Some(b'"') => break,
                Some(b'\\') => {
                    escaped = escaped.or(Some(at));
                    at += 2;
                }
                Some(_) => at += 1,
            }
        }
        self.at = at + 1;
        let span = self.global_span(start..self.at);
        if at - start > MAX_STRING_BYTES {
            return Err(PbrtError::new(span.start..span.start + 1, "this string is longer than 64 KiB"));
        }
        let raw = &self.text[start + 1..at];
        let text = match escaped {
            None => Cow::Borrowed(raw),
            Some(_) => Cow::Owned(self.unescape(raw, start + 1)?),
        };
        Ok(Token { kind: TokenKind::Quoted, text, span })
    }

    /// Replaces escape sequences. `start` is the offset of `raw` in the text.
    fn unescape(&self, raw: &str, start: usize) -> PbrtResult<String> {
        let mut text = String::with_capacity(raw.len());
        let mut chars = raw.char_indices();
        while let Some((at, char)) = chars.next() {
            if char != '\\' {
                text.push(char);
                continue;
            }
            text.push(match chars.next().map(|(_, escaped)| escaped) {
                Some('n') => '\n',
                Some('r') => '\r',
                Some('t') => '\t',
                Some('b') => '\u{8}',
                Some('f') => '\u{c}',
                Some(same @ ('\\' | '\'' | '"')) => same,
                _ => {
                    let span = self.global_span(start + at..start + at + 1);
                    return Err(PbrtError::new(span, "unknown escape sequence").with_help(
                        "a backslash must be followed by one of \" \\ ' n r t b f; use / in paths",
                    ));
                }
            });
        }
        Ok(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<String> {
        let mut lexer = Lexer::new(text, 100);
        let mut all = Vec::new();
        while let Some(token) = lexer.next().expect("tokens") {
            assert!(token.span.start >= 100 && token.span.end <= 100 + text.len());
            all.push(format!("{}{}", if token.kind == TokenKind::Quoted { "'" } else { "" }, token.text));
        }
        all
    }

    #[test]
    fn tokens_need_no_separating_whitespace() {
        let text = "Shape\"sphere\"\"float radius\"[1 -2.5e3]# to the end [ \"\nWorldBegin";
        assert_eq!(
            tokens(text),
            ["Shape", "'sphere", "'float radius", "[", "1", "-2.5e3", "]", "WorldBegin"]
        );
        assert_eq!(tokens("\u{feff}a#b \"x\\\"y\\n\""), ["a#b", "'x\"y\n"]);
    }

    #[test]
    fn unterminated_strings_are_errors() {
        let error = |text| Lexer::new(text, 5).next().expect_err("an error").span;
        assert_eq!(error("\"abc\ndef\""), 5..9);
        assert_eq!(error("\"abc\\").start, 5);
        assert_eq!(error("\"a\\qb\""), 7..8);
    }

    #[test]
    fn peek_does_not_consume() {
        let mut lexer = Lexer::new(" # c\n a b", 0);
        assert_eq!(lexer.peek(), lexer.next());
        assert_eq!(lexer.next().expect("a token").map(|token| token.span), Some(8..9));
        assert_eq!((lexer.next(), lexer.end_of_text_span()), (Ok(None), 9..9));
    }
}
