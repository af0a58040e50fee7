//! `[[light]]`.

use super::super::description::Light;
use super::super::description::light::{DirectionalLight, Falloff, PointLight, SpotLight};
use super::context::Issue;
use super::limits::Limits;
use super::shapes::direction;
use super::table::Table;
use crate::choice;
use crate::math::{DVec3, Vec3};

choice! {
    /// Types of lights.
    enum Kind {
        /// Without extent.
        Point = "point",
        /// Without extent, into a cone.
        Spot = "spot",
        /// From far away.
        Directional = "directional",
    }
}

pub(super) fn read(root: &Table<'_>) -> Option<Vec<Light>> {
    let read: Vec<Option<Light>> = root.tables("light").map(|table| light(&table)).collect();
    read.into_iter().collect()
}

fn light(table: &Table<'_>) -> Option<Light> {
    let key = table.optional("type");
    // Without knowing the type, no key can be called unknown.
    let kind = if key.is_given() { key.choice()? } else { Kind::Point };
    let light = match kind {
        Kind::Point => point(table).map(Light::Point),
        Kind::Spot => spot(table).map(Light::Spot),
        Kind::Directional => directional(table).map(Light::Directional),
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

fn spot(table: &Table<'_>) -> Option<SpotLight> {
    let point = point(table);
    let aim = table.optional("look_at");
    let look_at = aim.vector_or(Limits::Any, DVec3::ZERO);
    let angle = table.optional("angle");
    let angle = if angle.is_given() { angle.number(table.limits("spot.angle")) } else { Some(45.0) };
    let blend = table.optional("blend");
    let blend = if blend.is_given() { blend.number32(table.limits("spot.blend")) } else { Some(0.2) };
    let (point, look_at) = (point?, look_at?);
    let place = table.optional("position");
    if point.position == look_at {
        let issue = Issue::error(aim.span().or(place.span())?, "the spotlight has no direction")
            .label("`position` and `look_at` are the same point")
            .help("without them, `position` is [0, 3, 0] and `look_at` [0, 0, 0]");
        table.context.report(issue);
        return None;
    }
    if !place.is_apart(point.position, &aim, look_at) {
        return None;
    }
    Some(SpotLight { point, look_at, angle: angle?, blend: blend? })
}

/// The least apparent diameter of a disc, in degrees: directions in single precision cannot tell a smaller one from none.
const NARROWEST: f64 = 1e-3;

fn directional(table: &Table<'_>) -> Option<DirectionalLight> {
    let direction = direction(table, "direction", "light", DVec3::NEG_Y);
    let irradiance = table.optional("irradiance").color().unwrap_or(Vec3::ONE);
    let key = table.optional("angle");
    let angle = if key.is_given() { key.number(table.limits("directional.angle")) } else { Some(0.0) };
    if angle.is_some_and(|angle| angle != 0.0 && angle < NARROWEST) {
        let issue = Issue::error(key.span()?, format!("`angle` must be 0, or at least {NARROWEST:e}"));
        table.context.report(issue.help("0 is a light without extent; the sun has 0.53"));
        return None;
    }
    Some(DirectionalLight { direction: direction?, irradiance, angle: angle? })
}
