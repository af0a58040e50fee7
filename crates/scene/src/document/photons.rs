//! Reads the `[photons]` table.

use super::super::description::Photons;
use super::table::TableReader;

pub(super) fn read_photons(root: &TableReader<'_>) -> Option<Photons> {
    let default = Photons { enabled: false, count: 0, radius: 0.0, bounces: 16 };
    let Some(table) = root.table("photons") else { return Some(default) };
    let photons = Photons {
        enabled: table.optional("enabled").boolean().unwrap_or(default.enabled),
        count: table.optional("count").integer(table.range("count")).unwrap_or(default.count),
        radius: table.optional("radius").number(table.limits("radius")).unwrap_or(default.radius),
        bounces: table.optional("bounces").integer(table.range("bounces")).unwrap_or(default.bounces),
    };
    table.finish();
    Some(photons)
}
