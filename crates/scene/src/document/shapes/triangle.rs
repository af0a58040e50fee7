//! Reads `[[triangle]]` tables.

use super::super::super::description::Shape;
use super::super::NO_AREA;
use super::super::context::Issue;
use super::super::key::KeyInTable;
use super::super::limits::Limits;
use super::super::table::TableReader;
use super::edges_span_area;
use crate::math::DVec3;

/// Default corners of a triangle.
const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let keys = ["a", "b", "c"].map(|name| table.optional_key(name));
    let [a, b, c] = [0, 1, 2].map(|i| keys[i].vector_or(Limits::Any, CORNERS[i]));
    let (a, b, c) = (a?, b?, c?);
    let [a_key, b_key, c_key] = &keys;
    if !(a_key.check_points_equal_or_far_apart(a, b_key, b)
        && a_key.check_points_equal_or_far_apart(a, c_key, c)
        && b_key.check_points_equal_or_far_apart(b, c_key, c))
    {
        return None;
    }
    if !edges_span_area(b - a, c - a) {
        let span = keys.iter().rev().find_map(KeyInTable::value_span)?;
        let issue = Issue::error(span, format!("the triangle {NO_AREA}"))
            .with_label("`a`, `b` and `c` are collinear")
            .with_help("use three points that are not collinear");
        table.context.report(issue);
        return None;
    }
    Some(Shape::Triangle { a, b, c })
}
