//! Statements that change the current transform.

use super::super::lexer::{Lexer, PbrtError, PbrtResult, Token, TokenKind};
use super::super::state::{look_at, rotation};
use super::super::values::parse_number;
use super::{Parser, expect_token, quoted};
use crate::math::{DMat4, DVec3};
use crate::scene::nearest::nearest_name;

impl Parser<'_> {
    pub(super) fn transform_statement(
        &mut self,
        directive: &Token<'_>,
        lexer: &mut Lexer<'_>,
    ) -> PbrtResult<()> {
        let span = &directive.span;
        match &*directive.text {
            "Identity" => self.state.map_active_transforms(|_| DMat4::IDENTITY),
            "Translate" => {
                let offset = DVec3::from(numbers(directive, lexer)?);
                self.state.concat(DMat4::from_translation(offset));
            }
            "Scale" => {
                let factors = DVec3::from(numbers(directive, lexer)?);
                self.state.concat(DMat4::from_scale(factors));
            }
            "Rotate" => {
                let [angle, x, y, z] = numbers(directive, lexer)?;
                self.state.concat(rotation(angle, DVec3::new(x, y, z), span)?);
            }
            "LookAt" => {
                let matrix = look_at(&numbers(directive, lexer)?, span)?;
                self.state.concat(matrix);
            }
            "Transform" => {
                let matrix = column_major_matrix(directive, lexer)?;
                self.state.map_active_transforms(|_| matrix);
            }
            "ConcatTransform" => {
                let matrix = column_major_matrix(directive, lexer)?;
                self.state.concat(matrix);
            }
            "TransformTimes" => {
                let [_, _] = numbers(directive, lexer)?;
            }
            "CoordinateSystem" => {
                let name = quoted(directive, lexer)?;
                self.coordinate_systems.insert(name.text, self.state.transform);
            }
            "CoordSysTransform" => {
                let name = quoted(directive, lexer)?;
                let Some(transform) = self.coordinate_systems.get(&name.text) else {
                    let near = nearest_name(&name.text, self.coordinate_systems.keys().map(String::as_str));
                    let error = PbrtError::new(name.span, "unknown coordinate system");
                    return Err(error.with_suggestion(near));
                };
                self.state.transform = *transform;
            }
            _ => self.state.active = active_transforms(directive, lexer)?,
        }
        Ok(())
    }
}

fn active_transforms(directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<[bool; 2]> {
    let which = expect_token(directive, lexer)?;
    match &*which.text {
        "All" => Ok([true; 2]),
        "StartTime" => Ok([true, false]),
        "EndTime" => Ok([false, true]),
        _ => Err(PbrtError::new(which.span, "expected All, StartTime or EndTime")),
    }
}

/// Reads `N` numbers, with or without brackets.
fn numbers<const N: usize>(directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<[f64; N]> {
    let has_brackets = lexer.peek()?.is_some_and(|token| token.kind == TokenKind::OpenBracket);
    if has_brackets {
        lexer.next()?;
    }
    let mut values = [0.0; N];
    for value in &mut values {
        *value = parse_number(&expect_token(directive, lexer)?)?;
    }
    if has_brackets {
        let close = expect_token(directive, lexer)?;
        if close.kind != TokenKind::CloseBracket {
            return Err(PbrtError::new(close.span, format!("expected ] after {N} numbers")));
        }
    }
    Ok(values)
}

/// Reads a matrix: 16 numbers, column by column.
fn column_major_matrix(directive: &Token<'_>, lexer: &mut Lexer<'_>) -> PbrtResult<DMat4> {
    Ok(DMat4::from_cols_array(&numbers(directive, lexer)?))
}
