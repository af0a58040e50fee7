//! `[[triangle]]`.

use super::super::super::description::Shape;
use super::super::context::Issue;
use super::super::limits::Limits;
use super::super::table::Table;
use super::span_area;
use crate::math::DVec3;

pub(super) fn read(table: &Table<'_>) -> Option<Shape> {
    let a = table.required("a", "[0, 0, 0]").vector(Limits::Any);
    let b = table.required("b", "[1, 0, 0]").vector(Limits::Any);
    let c_key = table.required("c", "[0, 1, 0]");
    let (a, b, c) = (a?, b?, c_key.vector(Limits::Any)?);
    // Triangles are traced in single precision.
    let [near, right, up] = [a, b, c].map(|corner: DVec3| corner.as_vec3().as_dvec3());
    if !span_area(right - near, up - near) {
        let issue = Issue::error(c_key.span()?, "the triangle has no area")
            .label("`a`, `b` and `c` are on one line")
            .help("give three points that are not on a line, far enough apart for 32-bit numbers");
        table.context.report(issue);
        return None;
    }
    Some(Shape::Triangle { a, b, c })
}
