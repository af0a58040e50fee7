//! Reads `[[sphere]]` tables.

use super::super::super::description::Shape;
use super::super::limits::Limits;
use super::super::table::TableReader;

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let center = table.required("center", "[0, 0.5, 0]").vector(Limits::Any);
    let radius = table.required("radius", "0.5").number(table.limits("radius"));
    Some(Shape::Sphere { center: center?, radius: radius? })
}
