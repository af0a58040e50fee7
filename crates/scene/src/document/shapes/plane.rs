//! Reads `[[plane]]` tables.

use super::super::super::description::Shape;
use super::super::limits::Limits;
use super::super::table::TableReader;
use super::read_unnormalized_direction;
use crate::math::DVec3;

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let point = table.optional_key("point").vector(Limits::Any).unwrap_or(DVec3::ZERO);
    Some(Shape::Plane { point, normal: read_unnormalized_direction(table, "normal", "plane", DVec3::Y)? })
}
