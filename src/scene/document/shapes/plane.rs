//! `[[plane]]`.

use super::super::super::description::Shape;
use super::super::context::Issue;
use super::super::limits::Limits;
use super::super::table::Table;
use crate::math::DVec3;

pub(super) fn read(table: &Table<'_>) -> Option<Shape> {
    let point = table.optional("point").vector(Limits::Any).unwrap_or(DVec3::ZERO);
    let key = table.optional("normal");
    let normal = key.vector_or(Limits::Any, DVec3::Y)?;
    if normal.try_normalize().is_none() {
        let issue = Issue::error(key.span()?, "the plane has no direction")
            .label("a normal of length 0")
            .help("`normal` points away from the front, such as [0, 1, 0] for a floor");
        table.context.report(issue);
        return None;
    }
    Some(Shape::Plane { point, normal })
}
