//! Parses one expression: a header, or a key and its value, together with the rest of the line.
//!
//! `toml_parser` takes a list of tokens, which are 24 bytes each. To limit memory, the document is split at
//! points where the parser is certain to have finished an expression.

use toml_parser::lexer::{Token, TokenKind};
use toml_parser::parser::{Event, RecursionGuard, ValidateWhitespace, parse_document};
use toml_parser::{ErrorSink, Source};

use super::assembly::{DocumentBuilder, ErrorCollector};
use super::events::ExpressionEventReader;
use super::{MARK, MAX_DEPTH};

/// Expression parser with reusable buffers.
#[derive(Default)]
pub(super) struct ExpressionParser {
    tokens: Vec<Token>,
    events: Vec<Event>,
}

impl ExpressionParser {
    /// Reads the expression that starts at byte `at`, which must be the start of a line. Returns the offset
    /// after the expression.
    pub(super) fn read<'s>(
        &mut self,
        source: &'s str,
        at: usize,
        assembly: &mut DocumentBuilder<'s>,
    ) -> usize {
        self.tokens.clear();
        self.events.clear();
        // The lexer skips a byte order mark at the start of its text, which is only correct for the first
        // line. For all other lines, pass text that starts with the previous newline.
        let first = at == if source.starts_with(MARK) { MARK.len() } else { 0 };
        let base = if first { 0 } else { at - 1 };
        let part = Source::new(source.get(base..).unwrap_or_default());
        let mut end = ExpressionEndFinder::default();
        for token in part.lex().skip(usize::from(!first)) {
            self.tokens.push(token);
            if end.process_token(token.kind()) {
                break;
            }
        }
        let mut sink = ErrorCollector { errors: &mut assembly.syntax, base };
        parse_into_events(&self.tokens, part, &mut self.events, &mut sink);
        let next = self.tokens.last().map_or(source.len(), |token| base + token.span().end());
        if !assembly.is_lost {
            ExpressionEventReader { events: &self.events, source: part, base, assembly }.read_all();
        }
        next
    }
}

fn parse_into_events(
    tokens: &[Token],
    source: Source<'_>,
    events: &mut Vec<Event>,
    errors: &mut dyn ErrorSink,
) {
    let mut receiver = ValidateWhitespace::new(events, source);
    let mut receiver = RecursionGuard::new(&mut receiver, MAX_DEPTH);
    parse_document(tokens, &mut receiver, errors);
}

/// Finds the end of a TOML expression.
///
/// `open` is a supersequence of the parser's open brackets, because here only a bracket of the same kind
/// closes a bracket. With mismatched brackets, the parser may finish earlier, but it is never inside a value
/// while `open` is empty.
#[derive(Default)]
struct ExpressionEndFinder {
    phase: ExpressionPhase,
    open: Vec<TokenKind>,
}

#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum ExpressionPhase {
    /// Before the first token that is not whitespace.
    #[default]
    Start,
    /// Inside or after a key.
    Key,
    /// After `=`.
    Equals,
    /// Within brackets.
    Value,
    /// In the rest of the line, where no value can start.
    Rest,
}

impl ExpressionEndFinder {
    /// Processes the next token. Returns whether it ends the expression.
    fn process_token(&mut self, token: TokenKind) -> bool {
        use TokenKind as T;
        let is_end = token == T::Newline && self.open.is_empty();
        self.phase = match (self.phase, token) {
            (phase, T::Whitespace) => phase,
            (ExpressionPhase::Start, T::Atom | T::Dot | T::LiteralString | T::BasicString) => {
                ExpressionPhase::Key
            }
            (ExpressionPhase::Start, T::MlLiteralString | T::MlBasicString) => ExpressionPhase::Key,
            (ExpressionPhase::Start | ExpressionPhase::Key | ExpressionPhase::Equals, T::Equals) => {
                ExpressionPhase::Equals
            }
            (ExpressionPhase::Key, T::Atom | T::Dot | T::LiteralString | T::BasicString) => {
                ExpressionPhase::Key
            }
            (ExpressionPhase::Key, T::MlLiteralString | T::MlBasicString) => ExpressionPhase::Key,
            (
                ExpressionPhase::Equals | ExpressionPhase::Value,
                T::LeftSquareBracket | T::LeftCurlyBracket,
            ) => {
                self.open.push(token);
                ExpressionPhase::Value
            }
            (ExpressionPhase::Value, T::RightSquareBracket | T::RightCurlyBracket) => {
                self.close_bracket(token)
            }
            (ExpressionPhase::Value, _) => ExpressionPhase::Value,
            (
                ExpressionPhase::Start
                | ExpressionPhase::Key
                | ExpressionPhase::Equals
                | ExpressionPhase::Rest,
                _,
            ) => ExpressionPhase::Rest,
        };
        is_end
    }

    fn close_bracket(&mut self, token: TokenKind) -> ExpressionPhase {
        let opened = if token == TokenKind::RightSquareBracket {
            TokenKind::LeftSquareBracket
        } else {
            TokenKind::LeftCurlyBracket
        };
        self.open.pop_if(|last| *last == opened);
        if self.open.is_empty() { ExpressionPhase::Rest } else { ExpressionPhase::Value }
    }
}
