//! `[[light]]`.

use super::super::description::{Falloff, PointLight};
use super::limits::Limits;
use super::table::Table;
use crate::math::{DVec3, Vec3};

const FALLOFFS: [(&str, Falloff); 2] = [("square", Falloff::Square), ("none", Falloff::None)];

pub(super) fn read(root: &Table<'_>) -> Option<Vec<PointLight>> {
    let read: Vec<Option<PointLight>> = root.tables("light").map(|table| light(&table)).collect();
    read.into_iter().collect()
}

fn light(table: &Table<'_>) -> Option<PointLight> {
    let kind = table.optional("type");
    if kind.is_given() {
        // The keys of the other types would only be called unknown.
        kind.choice(&[("point", ())], &["spot", "directional"])?;
    }
    let position = table.optional("position").vector_or(Limits::Any, DVec3::new(0.0, 3.0, 0.0));
    let intensity = table.optional("intensity").color().unwrap_or(Vec3::splat(10.0));
    let falloff = table.optional("falloff").choice(&FALLOFFS, &[]).unwrap_or(Falloff::Square);
    table.finish();
    Some(PointLight { position: position?, intensity, falloff })
}
