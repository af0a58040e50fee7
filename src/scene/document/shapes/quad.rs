//! `[[quad]]`.

use super::super::super::description::Shape;
use super::super::context::Issue;
use super::super::limits::Limits;
use super::super::table::Table;
use super::span_area;

pub(super) fn read(table: &Table<'_>) -> Option<Shape> {
    let corner = table.required("corner", "[-1, 0, 1]").vector(Limits::Any);
    let u = table.required("u", "[2, 0, 0]").vector(Limits::Any);
    let v_key = table.required("v", "[0, 0, -2]");
    let v = v_key.vector(Limits::Any);
    if let (Some(u), Some(v), Some(span)) = (u, v, v_key.span())
        && !span_area(u, v)
    {
        let issue = Issue::error(span, "the quad has no area")
            .label("`u` and `v` are parallel, or one of them is 0")
            .help("`u` and `v` are two edges from the corner, in different directions");
        table.context.report(issue);
        return None;
    }
    Some(Shape::Quad { corner: corner?, u: u?, v: v? })
}
