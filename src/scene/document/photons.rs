//! `[photons]`.

use super::super::description::Photons;
use super::context::Issue;
use super::limits::Limits;
use super::table::Table;

pub(super) fn read(root: &Table<'_>) -> Option<Photons> {
    let default = Photons { enabled: false, count: 200_000, radius: 0.0, bounces: 16 };
    let Some(table) = root.table("photons") else { return Some(default) };
    let enabled = table.optional("enabled");
    let photons = Photons {
        enabled: enabled.flag().unwrap_or(default.enabled),
        count: table.optional("count").whole(1..=1_000_000_000_000).unwrap_or(default.count),
        radius: table.optional("radius").number(Limits::LengthOrZero).unwrap_or(default.radius),
        bounces: table.optional("bounces").whole(0..=u32::MAX.into()).unwrap_or(default.bounces),
    };
    if let (true, Some(span)) = (photons.enabled, enabled.span()) {
        let issue = Issue::warning(span, "this version does not render photons")
            .help("`ambient` of [render] stands for the indirect light");
        table.context.report(issue);
    }
    table.finish();
    Some(photons)
}
