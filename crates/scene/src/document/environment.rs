//! The `[environment]` table.

use super::super::description::{Environment, MapOrientation, MapRowPlacement, Scene, Sky};
use super::super::keys::endings::MAPS;
use super::super::keys::key::DefaultValue::{Absent, By, Is, Required};
use super::super::keys::key::ValueKind::{Color, File, InlineTable, Number, Rotation, Words};
use super::super::keys::key::{COLOR, DIRECTION, KeyInfo, TableInfo, TableSyntax, choice_values, keys};
use super::context::Issue;
use super::key::KeyInTable;
use super::limits::Limits::{Any, AtLeast, Between};
use super::table::TableReader;
use crate::math::{DVec3, Vec3};

pub(crate) static ENVIRONMENT: TableInfo = TableInfo::new(
    "environment",
    TableSyntax::Single,
    "Light from all directions: a color, a map or a sky; replaces `background`",
    keys! {
        /// Radiance; with a `file`, a scale factor for the map.
        color: COLOR, By("black; `[1, 1, 1]` with a `file`"), "radiance";
        /// An equirectangular map. Its center is toward −z, the middle of its right half toward +x, and its
        /// top row toward +y.
        file: File(MAPS), Absent;
        /// Polar angles of the map's rows: `"centers"`, or `"poles"` if the first and the last row are at the
        /// poles, as in Mitsuba.
        rows: Words(choice_values::<MapRowPlacement>), Is("\"centers\"");
        /// A clear sky with a sun.
        sky: InlineTable(SKY), Absent;
        /// Rotation of the map or the sky about +y, counterclockwise seen from above.
        rotate: Number(Any), Is("0.0"), "degrees";
        /// Rotation from the environment's axes to the world's, instead of `rotate`: 9 or 16 numbers in
        /// row-major order.
        matrix: Rotation, Absent;
    },
);

/// Keys of the sky.
const SKY: &[KeyInfo] = keys! {
    /// Direction toward the sun, above the horizon; rotated by `rotate`.
    sun: DIRECTION, Required("[0.3, 0.6, 0.2]");
    /// Haze: 2 is a very clear sky, 3 a clear sky, 6 a warm and humid day, and 10 a slightly hazy day.
    turbidity: Number(Between(1.0, 10.0)), Is("3");
    /// Albedo of the ground, which brightens the sky and is visible below the horizon, lit by the sky and the
    /// sun.
    ground: Color(Between(0.0, 1.0)), Is("0.3");
    /// Apparent diameter of the sun; does not change its irradiance.
    sun_angle: Number(Between(1e-3, 90.0)), Is("0.5338"), "degrees";
    /// Factor on the sun's radiance; 0 removes the sun.
    sun_scale: Number(AtLeast(0.0)), Is("1.0");
    /// Factor on the sky's radiance; 0 removes the sky.
    sky_scale: Number(AtLeast(0.0)), Is("1.0");
    /// Factor on the light from the ground below the horizon; 0 makes it black.
    ground_scale: Number(AtLeast(0.0)), Is("1.0");
};

/// Reads the environment. Returns `None` if it is invalid, and `Some(None)` if it is absent.
pub(super) fn read_environment(root: &TableReader<'_>) -> Option<Option<Environment>> {
    if root.entry("environment").is_none() {
        return Some(None);
    }
    let table = root.table(&ENVIRONMENT)?;
    let (color, file, sky) = (table.key("color"), table.key("file"), table.key("sky"));
    let map = if file.is_present() { file.existing_file().map(Some) } else { Some(None) };
    let default = if file.is_present() { Vec3::ONE } else { Vec3::ZERO };
    let radiance = if color.is_present() { color.color() } else { Some(default) };
    let clear_sky = if sky.is_present() { read_sky(&sky, [&color, &file]).map(Some) } else { Some(None) };
    let (rotate, matrix) = (table.key("rotate"), table.key("matrix"));
    let orientation = if matrix.is_present() {
        table.reject_key("rotate", "`rotate` conflicts with `matrix`", Some("remove one of the two"));
        matrix.rotation().map(MapOrientation::Rotation)
    } else {
        rotate.number().map(MapOrientation::Turn)
    };
    let rows = table.key("rows").choice::<MapRowPlacement>();
    table.report_unknown_and_missing_keys();
    if let (Some(Vec3::ZERO), Some(span)) = (radiance, color.value_span().filter(|_| file.is_present())) {
        let issue = Issue::warning(span, "`color` is black, so the environment is black")
            .with_label("this scales the map in `file`");
        table.context.report(issue.with_help("remove it to use the map unchanged"));
    }
    for key in [rotate, matrix] {
        if let Some(span) = key.value_span().filter(|_| !file.is_present() && !sky.is_present()) {
            let issue =
                Issue::warning(span, format!("`{}` has no effect without `file` or `sky`", key.info.name));
            let help = "a constant environment looks the same from every direction";
            table.context.report(issue.with_help(help));
        }
    }
    Some(Some(Environment {
        color: radiance?,
        file: map?,
        sky: clear_sky?,
        orientation: orientation?,
        rows: rows?,
    }))
}

/// Reads the sky. The `replaced` keys must be absent.
fn read_sky(key: &KeyInTable<'_>, replaced: [&KeyInTable<'_>; 2]) -> Option<Sky> {
    let given = replaced.into_iter().find(|other| other.is_present());
    if let Some((other, span)) = given.and_then(|other| Some((other, other.key_span()?))) {
        let issue = Issue::error(span, format!("`{}` cannot be combined with `sky`", other.info.name))
            .with_help("remove one of them; `sky_scale` and `sun_scale` change the brightness of a sky");
        key.context.report(issue);
    }
    let table = key.inline_table()?;
    let sun_key = table.key("sun");
    let sun = sun_key.nonzero_direction("sun").map(DVec3::normalize);
    let [turbidity, sun_angle] = ["turbidity", "sun_angle"].map(|name| table.key(name).number());
    let [sun_scale, sky_scale, ground_scale] =
        ["sun_scale", "sky_scale", "ground_scale"].map(|name| table.key(name).number_f32());
    let ground = table.key("ground").color();
    table.report_unknown_and_missing_keys();
    if sun.is_some_and(|sun| sun.y <= 0.0) {
        let issue = Issue::error(sun_key.value_span()?, "the sun is not above the horizon")
            .with_help("`sun` points toward the sun, so its y must be positive");
        table.context.report(issue);
        return None;
    }
    Some(Sky {
        sun: sun?,
        turbidity: turbidity?,
        ground: ground?,
        sun_angle: sun_angle?,
        sun_scale: sun_scale?,
        sky_scale: sky_scale?,
        ground_scale: ground_scale?,
    })
}

/// Warns about a background that the environment hides.
pub(super) fn warn_if_background_hidden(root: &TableReader<'_>, scene: &Scene) {
    let Some(span) = root.entry("environment").map(|entry| entry.span) else { return };
    if scene.environment.is_some() && scene.render.background != Vec3::ZERO {
        let issue = Issue::warning(span, "[environment] replaces `background`, which has no effect");
        root.context.report(issue.with_help("remove one of them; only an environment lights the scene"));
    }
}
