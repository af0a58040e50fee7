//! Finds the square brackets that enclose arrays. The text may have syntax errors.

use toml_parser::Source;
use toml_parser::lexer::TokenKind;

/// An array bracket. Brackets in headers, strings and comments are skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BracketToken {
    /// Byte offset in the text.
    pub(crate) at: usize,
    /// Whether the bracket is `[`.
    pub(crate) opens: bool,
}

/// Returns the array brackets in `text`, which must begin with the start of an expression.
pub(crate) fn find_all_array_brackets(text: &str) -> Vec<BracketToken> {
    let mut brackets = Vec::new();
    let (mut depth, mut is_line_start, mut is_header) = (0_usize, true, false);
    for token in Source::new(text).lex() {
        match token.kind() {
            TokenKind::Newline => (is_line_start, is_header) = (true, false),
            TokenKind::Whitespace => {}
            TokenKind::LeftSquareBracket | TokenKind::RightSquareBracket => {
                let opens = token.kind() == TokenKind::LeftSquareBracket;
                is_header |= opens && is_line_start && depth == 0;
                if !is_header {
                    depth = if opens { depth + 1 } else { depth.saturating_sub(1) };
                    brackets.push(BracketToken { at: token.span().start(), opens });
                }
                is_line_start = false;
            }
            TokenKind::Dot
            | TokenKind::Equals
            | TokenKind::Comma
            | TokenKind::LeftCurlyBracket
            | TokenKind::RightCurlyBracket
            | TokenKind::Comment
            | TokenKind::LiteralString
            | TokenKind::BasicString
            | TokenKind::MlLiteralString
            | TokenKind::MlBasicString
            | TokenKind::Atom
            | TokenKind::Eof => is_line_start = false,
        }
    }
    brackets
}

/// Returns the offset of the innermost bracket that is still open at the end of the text.
pub(crate) fn innermost_bracket_open_at_end(brackets: &[BracketToken]) -> Option<usize> {
    let mut closed = 0_usize;
    for bracket in brackets.iter().rev() {
        match (bracket.opens, closed) {
            (true, 0) => return Some(bracket.at),
            (true, _) => closed -= 1,
            (false, _) => closed += 1,
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_array_brackets_are_found() {
        let open = |text: &str| innermost_bracket_open_at_end(&find_all_array_brackets(text));
        for closed in [
            "",
            "[a]\n[[b]]\n",
            "a = [1, [2]]",
            "a = \"[\" # [\n",
            "a = \'\'\'[\n[\'\'\'",
            "[a\n",
            "  [[a]\nb = []",
        ] {
            assert_eq!(open(closed), None, "{closed}");
        }
        for (text, at) in [
            ("a = [", 4),
            ("a = [1, \"2]\"", 4),
            ("a = [1 # ]\n", 4),
            ("a = [[1, 2], [3", 13),
            ("a = [[1, 2], [3]", 4),
            ("a = [\n[1, 2]\n", 4),
            ("[a\nb = [1", 7),
            ("a = [1\n[b]\nc = [2]\n", 4),
        ] {
            assert_eq!(open(text), Some(at), "{text}");
        }
    }
}
