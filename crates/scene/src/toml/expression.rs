//! One expression cut out of the text: a header or a key with its value, to the end of its line.
//!
//! `toml_parser` reads lists of tokens, of 24 bytes each. So that the list of a large document is never whole in memory,
//! expressions are cut where the parser is sure to be done with them.

use toml_parser::lexer::{Token, TokenKind};
use toml_parser::parser::{Event, RecursionGuard, ValidateWhitespace, parse_document};
use toml_parser::{ErrorSink, Source};

use super::assembly::{Assembly, Sink};
use super::events::Events;
use super::{DEEPEST, MARK};

/// Memory that all expressions share.
#[derive(Default)]
pub(super) struct Expressions {
    tokens: Vec<Token>,
    events: Vec<Event>,
}

impl Expressions {
    /// Reads the expression that begins a line at byte `at`; gives the byte after it.
    pub(super) fn read<'s>(&mut self, source: &'s str, at: usize, assembly: &mut Assembly<'s>) -> usize {
        self.tokens.clear();
        self.events.clear();
        // A text that begins with a byte order mark is read without it, which is right for the first line alone: the
        // others are read with the end of the line before.
        let first = at == if source.starts_with(MARK) { MARK.len() } else { 0 };
        let base = if first { 0 } else { at - 1 };
        let part = Source::new(source.get(base..).unwrap_or_default());
        let mut end = Cut::default();
        for token in part.lex().skip(usize::from(!first)) {
            self.tokens.push(token);
            if end.is_after(token.kind()) {
                break;
            }
        }
        let mut sink = Sink { errors: &mut assembly.syntax, base };
        parse(&self.tokens, part, &mut self.events, &mut sink);
        let next = self.tokens.last().map_or(source.len(), |token| base + token.span().end());
        if !assembly.is_lost {
            Events { events: &self.events, source: part, base, assembly }.read();
        }
        next
    }
}

fn parse(tokens: &[Token], source: Source<'_>, events: &mut Vec<Event>, errors: &mut dyn ErrorSink) {
    let mut receiver = ValidateWhitespace::new(events, source);
    let mut receiver = RecursionGuard::new(&mut receiver, DEEPEST);
    parse_document(tokens, &mut receiver, errors);
}

/// Finds the end of an expression.
///
/// Open brackets. They include those open in the parser, in order: each is closed only by its own kind. If brackets are wrong,
/// the parser may be done earlier, but it is never within a value while none is open here.
#[derive(Default)]
struct Cut {
    phase: Phase,
    open: Vec<TokenKind>,
}

#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Phase {
    /// Before anything but space.
    #[default]
    Start,
    /// After the beginning of a key.
    Key,
    /// After `=`.
    Equals,
    /// Within brackets.
    Value,
    /// Nothing that follows in this line can matter.
    Rest,
}

impl Cut {
    /// Takes the next token; whether the expression ends with it.
    fn is_after(&mut self, token: TokenKind) -> bool {
        use TokenKind as T;
        let is_end = token == T::Newline && self.open.is_empty();
        self.phase = match (self.phase, token) {
            (phase, T::Whitespace) => phase,
            (Phase::Start, T::Atom | T::Dot | T::LiteralString | T::BasicString) => Phase::Key,
            (Phase::Start, T::MlLiteralString | T::MlBasicString) => Phase::Key,
            (Phase::Start | Phase::Key | Phase::Equals, T::Equals) => Phase::Equals,
            (Phase::Key, T::Atom | T::Dot | T::LiteralString | T::BasicString) => Phase::Key,
            (Phase::Key, T::MlLiteralString | T::MlBasicString) => Phase::Key,
            (Phase::Equals | Phase::Value, T::LeftSquareBracket | T::LeftCurlyBracket) => {
                self.open.push(token);
                Phase::Value
            }
            (Phase::Value, T::RightSquareBracket | T::RightCurlyBracket) => self.close(token),
            (Phase::Value, _) => Phase::Value,
            (Phase::Start | Phase::Key | Phase::Equals | Phase::Rest, _) => Phase::Rest,
        };
        is_end
    }

    fn close(&mut self, token: TokenKind) -> Phase {
        let opened = if token == TokenKind::RightSquareBracket {
            TokenKind::LeftSquareBracket
        } else {
            TokenKind::LeftCurlyBracket
        };
        self.open.pop_if(|last| *last == opened);
        if self.open.is_empty() { Phase::Rest } else { Phase::Value }
    }
}
