//! Parses the values of a parameter: a single value, or a list in brackets.

use std::ops::Range;

use super::lexer::{Lexer, PbrtError, PbrtResult, Token, TokenKind};
use crate::scene::sanitize::escape_and_truncate;

/// A string with its span.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Text {
    pub(super) text: String,
    pub(super) span: Range<usize>,
}

/// The values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<Text>),
    Flags(Vec<bool>),
}

/// Parses a number that is finite in single precision.
pub(super) fn parse_number(token: &Token<'_>) -> PbrtResult<f64> {
    let number = (token.kind == TokenKind::Word).then(|| token.text.parse::<f64>().ok()).flatten();
    match number {
        Some(number) if number.is_finite() && number.abs() <= f64::from(f32::MAX) => Ok(number),
        Some(_) => Err(PbrtError::new(token.span.clone(), "this number is too large")),
        None => {
            let shown = escape_and_truncate(&token.text, 32);
            Err(PbrtError::new(token.span.clone(), format!("expected a number, found {shown}")))
        }
    }
}

/// Parses the values that follow a declaration. Also returns their span.
pub(super) fn parse_values(
    declaration: &Range<usize>,
    lexer: &mut Lexer<'_>,
) -> PbrtResult<(Values, Range<usize>)> {
    let missing = || PbrtError::new(declaration.clone(), "this parameter has no value");
    let first = lexer.next()?.ok_or_else(missing)?;
    let start = first.span.start;
    let mut values = ValueList::default();
    match first.kind {
        TokenKind::Word | TokenKind::Quoted => {
            let end = first.span.end;
            values.add(&first)?;
            return Ok((values.finish(), start..end));
        }
        TokenKind::CloseBracket => return Err(PbrtError::new(first.span, "expected a value, found ]")),
        TokenKind::OpenBracket => {}
    }
    loop {
        let open = || PbrtError::new(first.span.clone(), "this bracket is never closed");
        let token = lexer.next()?.ok_or_else(open)?;
        match token.kind {
            TokenKind::CloseBracket => return Ok((values.finish(), start..token.span.end)),
            TokenKind::OpenBracket => return Err(PbrtError::new(token.span, "lists cannot be nested")),
            TokenKind::Word | TokenKind::Quoted => values.add(&token)?,
        }
    }
}

/// Values read so far.
#[derive(Default)]
struct ValueList(Option<Values>);

impl ValueList {
    fn add(&mut self, token: &Token<'_>) -> PbrtResult<()> {
        let flag = match (&*token.text, token.kind) {
            ("true", TokenKind::Word) => Some(true),
            ("false", TokenKind::Word) => Some(false),
            _ => None,
        };
        let text = || Text { text: token.text.clone().into_owned(), span: token.span.clone() };
        match (&mut self.0, flag, token.kind) {
            (None, Some(flag), _) => self.0 = Some(Values::Flags(vec![flag])),
            (None, None, TokenKind::Quoted) => self.0 = Some(Values::Texts(vec![text()])),
            (None, None, _) => self.0 = Some(Values::Numbers(vec![parse_number(token)?])),
            (Some(Values::Flags(flags)), Some(flag), _) => flags.push(flag),
            (Some(Values::Texts(texts)), None, TokenKind::Quoted) => texts.push(text()),
            (Some(Values::Numbers(numbers)), None, TokenKind::Word) => numbers.push(parse_number(token)?),
            (Some(_), _, _) => {
                return Err(PbrtError::new(
                    token.span.clone(),
                    "all values in a list must have the same type",
                ));
            }
        }
        Ok(())
    }

    /// Returns the values. An empty list becomes a list of numbers.
    fn finish(self) -> Values {
        self.0.unwrap_or_else(|| Values::Numbers(Vec::new()))
    }
}
