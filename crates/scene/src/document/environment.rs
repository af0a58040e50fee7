//! The `[environment]` table.

use super::super::description::{Environment, MapOrientation, Scene};
use super::super::keys::endings::MAPS;
use super::super::keys::key::DefaultValue::{Absent, By, Is};
use super::super::keys::key::ValueKind::{File, Number, Rotation};
use super::super::keys::key::{COLOR, TableInfo, TableSyntax, keys};
use super::context::Issue;
use super::limits::Limits::Any;
use super::table::TableReader;
use crate::math::Vec3;

pub(crate) static ENVIRONMENT: TableInfo = TableInfo::new(
    "environment",
    TableSyntax::Single,
    "Light from all directions, a color or a map; replaces `background`",
    keys! {
        /// Radiance; with a `file`, a scale factor for the map.
        color: COLOR, By("black; `[1, 1, 1]` with a `file`"), "radiance";
        /// An equirectangular map. Its center is seen towards −z, its right quarter towards +x, and its top
        /// row at +y.
        file: File(MAPS), Absent;
        /// Rotation of the map about +y, counterclockwise seen from above.
        rotate: Number(Any), Is("0.0"), "degrees";
        /// Rotation from the map's own axes to the world's, instead of `rotate`: 9 or 16 numbers, row by row.
        matrix: Rotation, Absent;
    },
);

/// Reads the environment. Returns `None` if it is invalid, and `Some(None)` if it is absent.
pub(super) fn read_environment(root: &TableReader<'_>) -> Option<Option<Environment>> {
    if root.entry("environment").is_none() {
        return Some(None);
    }
    let table = root.table(&ENVIRONMENT)?;
    let (color, file) = (table.key("color"), table.key("file"));
    let map = if file.is_present() { file.existing_file().map(Some) } else { Some(None) };
    let default = if file.is_present() { Vec3::ONE } else { Vec3::ZERO };
    let radiance = if color.is_present() { color.color() } else { Some(default) };
    let (rotate, matrix) = (table.key("rotate"), table.key("matrix"));
    let orientation = if matrix.is_present() {
        table.reject_key("rotate", "`rotate` conflicts with `matrix`", Some("remove one of the two"));
        matrix.rotation().map(MapOrientation::Rotation)
    } else {
        rotate.number().map(MapOrientation::Turn)
    };
    table.report_unknown_and_missing_keys();
    if let (Some(Vec3::ZERO), Some(span)) = (radiance, color.value_span().filter(|_| file.is_present())) {
        let issue = Issue::warning(span, "`color` is black, so the environment is black")
            .with_label("this scales the map in `file`");
        table.context.report(issue.with_help("remove it to use the map unchanged"));
    }
    for key in [rotate, matrix] {
        if let Some(span) = key.value_span().filter(|_| !file.is_present()) {
            let issue = Issue::warning(span, format!("`{}` has no effect without `file`", key.info.name));
            let help = "a constant environment looks the same from every direction";
            table.context.report(issue.with_help(help));
        }
    }
    Some(Some(Environment { color: radiance?, file: map?, orientation: orientation? }))
}

/// Warns about a background that the environment hides.
pub(super) fn warn_if_background_hidden(root: &TableReader<'_>, scene: &Scene) {
    let Some(span) = root.entry("environment").map(|entry| entry.span) else { return };
    if scene.environment.is_some() && scene.render.background != Vec3::ZERO {
        let issue = Issue::warning(span, "[environment] replaces `background`, which has no effect");
        root.context.report(issue.with_help("remove one of them; only an environment lights the scene"));
    }
}
