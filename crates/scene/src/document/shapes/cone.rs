//! `[[cone]]`.

use super::super::super::description::Shape;
use super::super::table::TableReader;
use super::{axis_ends, length};

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let ends = axis_ends(table, ["base", "tip"], "cone");
    let radius = length(table, "radius", 0.5);
    let cap = table.optional("cap").flag().unwrap_or(true);
    let [base, tip] = ends?;
    Some(Shape::Cone { base, tip, radius: radius?, cap })
}
