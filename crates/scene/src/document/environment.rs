//! Reads the `[environment]` table.

use super::super::description::{Environment, Scene};
use super::super::keys::endings::MAPS;
use super::context::Issue;
use super::table::TableReader;
use crate::math::Vec3;

/// Reads the environment. Returns `None` if it is invalid, and `Some(None)` if it is absent.
pub(super) fn read_environment(root: &TableReader<'_>) -> Option<Option<Environment>> {
    let key = root.optional_key("environment");
    let Some(table) = root.table("environment") else {
        return (!key.is_present()).then_some(None);
    };
    let (color, file) = (table.optional_key("color"), table.optional_key("file"));
    let map = if file.is_present() { file.existing_file(MAPS).map(Some) } else { Some(None) };
    let default = if file.is_present() { Vec3::ONE } else { Vec3::ZERO };
    let radiance = if color.is_present() { color.color() } else { Some(default) };
    let rotate = table.optional_key("rotate");
    let degrees = if rotate.is_present() { rotate.number(table.key_limits("rotate")) } else { Some(0.0) };
    table.report_unknown_and_missing_keys();
    if let (Some(Vec3::ZERO), Some(span)) = (radiance, color.value_span().filter(|_| file.is_present())) {
        let issue = Issue::warning(span, "`color` is black, so the environment is black")
            .with_label("this scales the map in `file`");
        table.context.report(issue.with_help("remove it to use the map unchanged"));
    }
    if let Some(span) = rotate.value_span().filter(|_| !file.is_present()) {
        let issue = Issue::warning(span, "`rotate` has no effect without `file`");
        table.context.report(issue.with_help("a constant environment looks the same from every direction"));
    }
    Some(Some(Environment { color: radiance?, file: map?, rotate: degrees? }))
}

/// Warns about a background that the environment hides.
pub(super) fn warn_if_background_hidden(root: &TableReader<'_>, scene: &Scene) {
    let Some(span) = root.optional_key("environment").key_span() else { return };
    if scene.environment.is_some() && scene.render.background != Vec3::ZERO {
        let issue = Issue::warning(span, "[environment] replaces `background`, which has no effect");
        root.context.report(issue.with_help("remove one of them; only an environment lights the scene"));
    }
}
