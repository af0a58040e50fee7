//! Reads `[[cone]]` tables.

use super::super::super::description::Shape;
use super::super::table::TableReader;
use super::{read_axis_ends, read_length};

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let ends = read_axis_ends(table, ["base", "tip"], "cone");
    let radius = read_length(table, "radius", 0.5);
    let cap = table.optional_key("cap").boolean().unwrap_or(true);
    let [base, tip] = ends?;
    Some(Shape::Cone { base, tip, radius: radius?, cap })
}
