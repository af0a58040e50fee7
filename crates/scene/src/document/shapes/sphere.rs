//! `[[sphere]]`.

use super::super::super::description::Shape;
use super::super::limits::Limits;
use super::super::table::Table;

pub(super) fn read(table: &Table<'_>) -> Option<Shape> {
    let center = table.required("center", "[0, 0.5, 0]").vector(Limits::Any);
    let radius = table.required("radius", "0.5").number(table.limits("radius"));
    Some(Shape::Sphere { center: center?, radius: radius? })
}
