//! Reads the `[[light]]` tables.

use super::super::description::Light;
use super::super::description::light::{DirectionalLight, Falloff, PointLight, SpotLight};
use super::context::Issue;
use super::limits::Limits;
use super::shapes::read_unnormalized_direction;
use super::table::TableReader;
use crate::choice;
use crate::math::{DVec3, Vec3};

choice! {
    /// Types of lights.
    enum LightKind {
        /// A point light.
        Point = "point",
        /// A point light that shines only within a cone.
        Spot = "spot",
        /// A distant light.
        Directional = "directional",
    }
}

pub(super) fn read_lights(root: &TableReader<'_>) -> Option<Vec<Light>> {
    let read: Vec<Option<Light>> = root.tables("light").map(|table| read_light(&table)).collect();
    read.into_iter().collect()
}

fn read_light(table: &TableReader<'_>) -> Option<Light> {
    let key = table.optional_key("type");
    // Without a valid type, keys cannot be checked.
    let kind = if key.is_present() { key.choice()? } else { LightKind::Point };
    let light = match kind {
        LightKind::Point => read_point_light(table).map(Light::Point),
        LightKind::Spot => read_spot_light(table).map(Light::Spot),
        LightKind::Directional => read_directional_light(table).map(Light::Directional),
    };
    table.report_unknown_and_missing_keys();
    light
}

fn read_point_light(table: &TableReader<'_>) -> Option<PointLight> {
    let position = table.optional_key("position").vector_or(Limits::Any, DVec3::new(0.0, 3.0, 0.0));
    let intensity = table.optional_key("intensity").color().unwrap_or(Vec3::splat(10.0));
    let falloff = table.optional_key("falloff").choice().unwrap_or(Falloff::Square);
    Some(PointLight { position: position?, intensity, falloff })
}

fn read_spot_light(table: &TableReader<'_>) -> Option<SpotLight> {
    let point = read_point_light(table);
    let aim = table.optional_key("look_at");
    let look_at = aim.vector_or(Limits::Any, DVec3::ZERO);
    let angle = table.optional_key("angle");
    let angle = if angle.is_present() { angle.number(table.key_limits("spot.angle")) } else { Some(45.0) };
    let blend = table.optional_key("blend");
    let blend = if blend.is_present() { blend.number_f32(table.key_limits("spot.blend")) } else { Some(0.2) };
    let (point, look_at) = (point?, look_at?);
    let place = table.optional_key("position");
    if point.position == look_at {
        let issue = Issue::error(aim.value_span().or(place.value_span())?, "the spotlight has no direction")
            .with_label("`position` and `look_at` are the same point")
            .with_help("the defaults are `position = [0, 3, 0]` and `look_at = [0, 0, 0]`");
        table.context.report(issue);
        return None;
    }
    if !place.check_points_equal_or_far_apart(point.position, &aim, look_at) {
        return None;
    }
    Some(SpotLight { point, look_at, angle: angle?, blend: blend? })
}

/// Minimum apparent diameter in degrees. Single-precision directions cannot distinguish smaller diameters
/// from 0.
const MIN_ANGLE_DEGREES: f64 = 1e-3;

fn read_directional_light(table: &TableReader<'_>) -> Option<DirectionalLight> {
    let direction = read_unnormalized_direction(table, "direction", "light", DVec3::NEG_Y);
    let irradiance = table.optional_key("irradiance").color().unwrap_or(Vec3::ONE);
    let key = table.optional_key("angle");
    let angle = if key.is_present() { key.number(table.key_limits("directional.angle")) } else { Some(0.0) };
    if angle.is_some_and(|angle| angle != 0.0 && angle < MIN_ANGLE_DEGREES) {
        let issue =
            Issue::error(key.value_span()?, format!("`angle` must be 0, or at least {MIN_ANGLE_DEGREES:e}"));
        table.context.report(issue.with_help("0 means no extent; use 0.53 for the sun"));
        return None;
    }
    Some(DirectionalLight { direction: direction?, irradiance, angle: angle? })
}
