//! `[[disk]]`.

use super::super::super::description::Shape;
use super::super::limits::Limits;
use super::super::table::TableReader;
use super::{direction, length};
use crate::math::DVec3;

pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let center = table.optional("center").vector(Limits::Any).unwrap_or(DVec3::ZERO);
    let normal = direction(table, "normal", "disk", DVec3::Y);
    let radius = length(table, "radius", 0.5);
    Some(Shape::Disk { center, normal: normal?, radius: radius? })
}
