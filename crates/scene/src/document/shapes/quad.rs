//! Reads `[[quad]]` tables.

use super::super::super::description::Shape;
use super::super::NO_AREA;
use super::super::context::Issue;
use super::super::limits::Limits;
use super::super::table::TableReader;
use super::edges_span_area;
use crate::math::DVec3;

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let (u_key, v_key) = (table.optional_key("u"), table.optional_key("v"));
    let corner = table.optional_key("corner").vector_or(Limits::Any, DVec3::new(-1.0, 0.0, 1.0));
    let u = u_key.vector_or(Limits::Any, DVec3::new(2.0, 0.0, 0.0));
    let v = v_key.vector_or(Limits::Any, DVec3::new(0.0, 0.0, -2.0));
    let (corner, u, v) = (corner?, u?, v?);
    if !(u_key.check_vector_zero_or_long_enough(u) & v_key.check_vector_zero_or_long_enough(v)) {
        return None;
    }
    if !edges_span_area(u, v) {
        let wrong = if u == DVec3::ZERO { u_key.value_span() } else { v_key.value_span() };
        let span = wrong.or(u_key.value_span())?;
        let issue = Issue::error(span, format!("the quad {NO_AREA}"))
            .with_label("`u` and `v` are parallel, or one of them is 0")
            .with_help("use two edges in different directions");
        table.context.report(issue);
        return None;
    }
    Some(Shape::Quad { corner, u, v })
}
