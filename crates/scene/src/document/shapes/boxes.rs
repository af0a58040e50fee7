//! Reads `[[box]]` tables.

use super::super::super::description::Shape;
use super::super::limits::Limits;
use super::super::table::TableReader;
use crate::math::DVec3;

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let center = table.optional_key("center").vector_or(Limits::Any, DVec3::new(0.0, 0.5, 0.0));
    let size = table.optional_key("size").vector(table.key_limits("size")).unwrap_or(DVec3::ONE);
    let rotate = table.optional_key("rotate").vector(Limits::Any).unwrap_or(DVec3::ZERO);
    Some(Shape::Box { center: center?, size, rotate })
}
