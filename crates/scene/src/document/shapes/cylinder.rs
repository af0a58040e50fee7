//! `[[cylinder]]`.

use super::super::super::description::Shape;
use super::super::table::TableReader;
use super::{axis_ends, length};

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let ends = axis_ends(table, ["a", "b"], "cylinder");
    let radius = length(table, "radius", 0.5);
    let caps = table.optional("caps").flag().unwrap_or(true);
    let [a, b] = ends?;
    Some(Shape::Cylinder { a, b, radius: radius?, caps })
}
