//! Reads `[[cylinder]]` tables.

use super::super::super::description::Shape;
use super::super::table::TableReader;
use super::{read_axis_ends, read_length};

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let ends = read_axis_ends(table, ["a", "b"], "cylinder");
    let radius = read_length(table, "radius", 0.5);
    let caps = table.optional_key("caps").boolean().unwrap_or(true);
    let [a, b] = ends?;
    Some(Shape::Cylinder { a, b, radius: radius?, caps })
}
