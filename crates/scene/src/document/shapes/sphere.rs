//! Reads `[[sphere]]` tables.

use super::super::super::description::Shape;
use super::super::limits::Limits;
use super::super::table::TableReader;

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let center = table.required_key("center", "[0, 0.5, 0]").vector(Limits::Any);
    let radius = table.required_key("radius", "0.5").number(table.key_limits("radius"));
    Some(Shape::Sphere { center: center?, radius: radius? })
}
