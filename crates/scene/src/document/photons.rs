//! Reads the `[photons]` table.

use super::super::description::PhotonOptions;
use super::table::TableReader;

pub(super) fn read_photons(root: &TableReader<'_>) -> Option<PhotonOptions> {
    let default = PhotonOptions { enabled: false, count: 0, radius: 0.0, bounces: 16 };
    let Some(table) = root.table("photons") else { return Some(default) };
    let photons = PhotonOptions {
        enabled: table.optional_key("enabled").boolean().unwrap_or(default.enabled),
        count: table.optional_key("count").integer(table.integer_key_range("count")).unwrap_or(default.count),
        radius: table.optional_key("radius").number(table.key_limits("radius")).unwrap_or(default.radius),
        bounces: table
            .optional_key("bounces")
            .integer(table.integer_key_range("bounces"))
            .unwrap_or(default.bounces),
    };
    table.report_unknown_and_missing_keys();
    Some(photons)
}
