//! Reads `[[torus]]` tables.

use super::super::super::description::Shape;
use super::super::context::Issue;
use super::super::limits::Limits;
use super::super::table::TableReader;
use super::{read_length, read_unnormalized_direction};
use crate::math::DVec3;

/// Reads a torus. Rejects self-intersecting tori, whose surface has no consistent front side.
pub(super) fn read(table: &TableReader<'_>) -> Option<Shape> {
    let center = table.optional_key("center").vector(Limits::Any).unwrap_or(DVec3::ZERO);
    let axis = read_unnormalized_direction(table, "axis", "torus", DVec3::Y);
    let radius = read_length(table, "radius", 0.5);
    let tube = read_length(table, "tube", radius.unwrap_or(0.5) / 4.0);
    let (radius, tube) = (radius?, tube?);
    if tube >= radius {
        let issue = Issue::error(table.optional_key("tube").value_span()?, "the torus intersects itself")
            .with_label(format!("`tube` must be less than `radius` = {radius}"))
            .with_help(
                "`radius` is measured to the middle of the tube, and `tube` from there to the surface",
            );
        table.context.report(issue);
        return None;
    }
    Some(Shape::Torus { center, axis: axis?, radius, tube })
}
