//! Reads `[[disk]]` tables.

use super::super::super::description::Shape;
use super::super::limits::Limits;
use super::super::table::TableReader;
use super::{read_length, read_unnormalized_direction};
use crate::math::DVec3;

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let center = table.optional_key("center").vector(Limits::Any).unwrap_or(DVec3::ZERO);
    let normal = read_unnormalized_direction(table, "normal", "disk", DVec3::Y);
    let radius = read_length(table, "radius", 0.5);
    Some(Shape::Disk { center, normal: normal?, radius: radius? })
}
