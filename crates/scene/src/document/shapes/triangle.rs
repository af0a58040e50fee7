//! `[[triangle]]`.

use super::super::super::description::Shape;
use super::super::context::Issue;
use super::super::key::Key;
use super::super::limits::Limits;
use super::super::table::Table;
use super::span_area;
use crate::math::DVec3;

/// Corners of a triangle that has none.
const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

pub(super) fn read(table: &Table<'_>) -> Option<Shape> {
    let keys = ["a", "b", "c"].map(|name| table.optional(name));
    let [a, b, c] = [0, 1, 2].map(|i| keys[i].vector_or(Limits::Any, CORNERS[i]));
    let (a, b, c) = (a?, b?, c?);
    let [a_key, b_key, c_key] = &keys;
    if !(a_key.is_apart(a, b_key, b) && a_key.is_apart(a, c_key, c) && b_key.is_apart(b, c_key, c)) {
        return None;
    }
    if !span_area(b - a, c - a) {
        let span = keys.iter().rev().find_map(Key::span)?;
        let issue = Issue::error(span, "the triangle has no area")
            .label("`a`, `b` and `c` are on one line")
            .help("give three points that are not on a line");
        table.context.report(issue);
        return None;
    }
    Some(Shape::Triangle { a, b, c })
}
