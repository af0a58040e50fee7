//! `[[light]]`.

use super::super::description::{Falloff, PointLight};
use super::limits::Limits;
use super::table::Table;
use crate::choice;
use crate::math::{DVec3, Vec3};

choice! {
    /// What a light is.
    enum Kind {
        /// Without extent.
        Point = "point",
    }
    unavailable "spot", "directional"
}

pub(super) fn read(root: &Table<'_>) -> Option<Vec<PointLight>> {
    let read: Vec<Option<PointLight>> = root.tables("light").map(|table| light(&table)).collect();
    read.into_iter().collect()
}

fn light(table: &Table<'_>) -> Option<PointLight> {
    let key = table.optional("type");
    // Without knowing the type, no key can be called unknown.
    let kind = if key.is_given() { key.choice()? } else { Kind::Point };
    let light = match kind {
        Kind::Point => point(table),
    };
    table.finish();
    light
}

fn point(table: &Table<'_>) -> Option<PointLight> {
    let position = table.optional("position").vector_or(Limits::Any, DVec3::new(0.0, 3.0, 0.0));
    let intensity = table.optional("intensity").color().unwrap_or(Vec3::splat(10.0));
    let falloff = table.optional("falloff").choice().unwrap_or(Falloff::Square);
    Some(PointLight { position: position?, intensity, falloff })
}
