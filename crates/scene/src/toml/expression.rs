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
pub(super) struct TomlExpressionParser {
    tokens: Vec<Token>,
    events: Vec<Event>,
}

impl TomlExpressionParser {
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
        let mut end = StatementEndFinder::default();
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
/// `open` is a supersequence of the parser's open brackets, because only a bracket of the same kind closes a
/// bracket here. With mismatched brackets, the parser may finish earlier, but it is never inside a value
/// while `open` is empty.
#[derive(Default)]
struct StatementEndFinder {
    phase: StatementPhase,
    open: Vec<TokenKind>,
}

#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum StatementPhase {
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

impl StatementEndFinder {
    /// Processes the next token. Returns whether it ends the expression.
    fn process_token(&mut self, token: TokenKind) -> bool {
        use TokenKind as T;
        let is_end = token == T::Newline && self.open.is_empty();
        self.phase = match (self.phase, token) {
            (phase, T::Whitespace) => phase,
            (StatementPhase::Start, T::Atom | T::Dot | T::LiteralString | T::BasicString) => {
                StatementPhase::Key
            }
            (StatementPhase::Start, T::MlLiteralString | T::MlBasicString) => StatementPhase::Key,
            (StatementPhase::Start | StatementPhase::Key | StatementPhase::Equals, T::Equals) => {
                StatementPhase::Equals
            }
            (StatementPhase::Key, T::Atom | T::Dot | T::LiteralString | T::BasicString) => {
                StatementPhase::Key
            }
            (StatementPhase::Key, T::MlLiteralString | T::MlBasicString) => StatementPhase::Key,
            (StatementPhase::Equals | StatementPhase::Value, T::LeftSquareBracket | T::LeftCurlyBracket) => {
                self.open.push(token);
                StatementPhase::Value
            }
            (StatementPhase::Value, T::RightSquareBracket | T::RightCurlyBracket) => {
                self.close_bracket(token)
            }
            (StatementPhase::Value, _) => StatementPhase::Value,
            (
                StatementPhase::Start | StatementPhase::Key | StatementPhase::Equals | StatementPhase::Rest,
                _,
            ) => StatementPhase::Rest,
        };
        is_end
    }

    fn close_bracket(&mut self, token: TokenKind) -> StatementPhase {
        let opened = if token == TokenKind::RightSquareBracket {
            TokenKind::LeftSquareBracket
        } else {
            TokenKind::LeftCurlyBracket
        };
        self.open.pop_if(|last| *last == opened);
        if self.open.is_empty() { StatementPhase::Rest } else { StatementPhase::Value }
    }
}
