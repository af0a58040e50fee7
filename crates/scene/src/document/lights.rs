//! The `[[light]]` tables.

use super::super::description::Light;
use super::super::description::light::{DirectionalLight, Falloff, PointLight, SpotLight};
use super::super::keys::key::DefaultValue::Is;
use super::super::keys::key::ValueKind::{Number, Words};
use super::super::keys::key::{COLOR, DIRECTION, POINT, TableInfo, TableSyntax, choice_values, table_types};
use super::context::Issue;
use super::key::KeyInTable;
use super::limits::Limits::{Between, Inside};
use super::table::TableReader;

table_types! {
    /// Types of lights.
    enum LightType, const TYPES;
    /// A point light.
    Point = "point" {
        /// Position.
        position: POINT, Is("[0, 3, 0]"), "length";
        /// Radiant intensity, the same in all directions.
        intensity: COLOR, Is("[10, 10, 10]"), "W/sr";
        /// `"square"`: inverse-square falloff, physically correct; `"none"`: `intensity` is the irradiance at
        /// normal incidence, at any distance.
        falloff: Words(choice_values::<Falloff>), Is("\"square\"");
    }
    /// A point light that shines only within a cone.
    Spot = "spot" {
        /// Position.
        position: POINT, Is("[0, 3, 0]"), "length";
        /// A point on the cone's axis.
        look_at: POINT, Is("[0, 0, 0]"), "length";
        /// Radiant intensity on the axis.
        intensity: COLOR, Is("[10, 10, 10]"), "W/sr";
        /// Full apex angle of the cone.
        angle: Number(Inside(0.0, 360.0)), Is("45"), "degrees";
        /// Outer part of the cone where the light fades out.
        blend: Number(Between(0.0, 1.0)), Is("0.2"), "fraction of the half angle";
        /// As for a point light.
        falloff: Words(choice_values::<Falloff>), Is("\"square\"");
    }
    /// Light from a distant source, such as the sun.
    Directional = "directional" {
        /// Direction in which the light travels.
        direction: DIRECTION, Is("[0, -1, 0]");
        /// Irradiance at normal incidence.
        irradiance: COLOR, Is("[1, 1, 1]"), "W/m²";
        /// Apparent diameter, 0 or at least 0.001; use 0.53 for the sun. Above 0, shadows are soft and the
        /// disk is visible.
        angle: Number(Between(0.0, 180.0)), Is("0"), "degrees";
    }
}

pub(crate) static LIGHT: TableInfo =
    TableInfo { types: TYPES, ..TableInfo::new("light", TableSyntax::List, "A light without a shape", &[]) };

pub(super) fn read_lights(root: &TableReader<'_>) -> Option<Vec<Light>> {
    let read: Vec<Option<Light>> = root.tables(&LIGHT).map(read_light).collect();
    read.into_iter().collect()
}

fn read_light(mut table: TableReader<'_>) -> Option<Light> {
    // Without a valid type, keys cannot be checked.
    let light = match table.read_type()? {
        LightType::Point => read_point_light(&table).map(Light::Point),
        LightType::Spot => read_spot_light(&table).map(Light::Spot),
        LightType::Directional => read_directional_light(&table).map(Light::Directional),
    };
    table.report_unknown_and_missing_keys();
    light
}

fn read_point_light(table: &TableReader<'_>) -> Option<PointLight> {
    let position = table.key("position").vector();
    let intensity = table.key("intensity").read_or_default(KeyInTable::color);
    let falloff = table.key("falloff").read_or_default(KeyInTable::choice);
    Some(PointLight { position: position?, intensity, falloff })
}

fn read_spot_light(table: &TableReader<'_>) -> Option<SpotLight> {
    let point = read_point_light(table);
    let (place, aim) = (table.key("position"), table.key("look_at"));
    let look_at = aim.vector();
    let (angle, blend) = (table.key("angle").number(), table.key("blend").number_f32());
    let (point, look_at) = (point?, look_at?);
    if point.position == look_at {
        let issue = Issue::error(aim.value_span().or(place.value_span())?, "the spotlight has no direction")
            .with_label("`position` and `look_at` are the same point")
            .with_help(format!(
                "the defaults are `{}` and `{}`",
                place.info.example_line(),
                aim.info.example_line()
            ));
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
    let direction = table.key("direction").nonzero_direction("light");
    let irradiance = table.key("irradiance").color();
    let key = table.key("angle");
    let angle = key.number();
    if angle.is_some_and(|angle| angle != 0.0 && angle < MIN_ANGLE_DEGREES) {
        let issue =
            Issue::error(key.value_span()?, format!("`angle` must be 0, or at least {MIN_ANGLE_DEGREES:e}"));
        table.context.report(issue.with_help("0 means no extent; use 0.53 for the sun"));
        return None;
    }
    Some(DirectionalLight { direction: direction?, irradiance: irradiance?, angle: angle? })
}
