//! Reads the keys common to all materials.

use super::super::description::{Bump, EmissionSource, NormalMap, NumberSource, OpacitySource};
use super::context::Issue;
use super::names::DefinedNames;
use super::table::TableReader;

/// Reads `emission` and `emission_sides`.
pub(super) fn read_emission(table: &TableReader<'_>, textures: &DefinedNames) -> EmissionSource {
    let source = table.optional("emission").emission(textures).unwrap_or(EmissionSource::NONE);
    let sides = table.optional("emission_sides").choice().unwrap_or(source.sides);
    warn_without(table, "emission_sides", "emission");
    EmissionSource { sides, ..source }
}

/// Reads `normal_map` and `normal_strength`.
pub(super) fn read_normal_map(table: &TableReader<'_>, textures: &DefinedNames) -> Option<NormalMap> {
    let texture = table.optional("normal_map").index_by_name(textures);
    let strength = table.optional("normal_strength").number32(table.limits("normal_strength")).unwrap_or(1.0);
    warn_without(table, "normal_strength", "normal_map");
    texture.map(|texture| NormalMap { texture, strength })
}

/// Reads `bump` and `bump_scale`.
pub(super) fn read_bump(table: &TableReader<'_>, textures: &DefinedNames) -> Option<Bump> {
    let texture = table.optional("bump").texture_of_numbers(textures);
    let scale = table.optional("bump_scale").number32(table.limits("bump_scale")).unwrap_or(0.01);
    warn_without(table, "bump_scale", "bump");
    texture.map(|(texture, channel)| Bump { texture, channel, scale })
}

/// Reads `opacity` and `opacity_cutoff`.
pub(super) fn read_opacity(table: &TableReader<'_>, textures: &DefinedNames) -> OpacitySource {
    let value = table.optional("opacity").number_or_texture(textures, table.limits("opacity"));
    let cutoff = table.optional("opacity_cutoff").number32(table.limits("opacity_cutoff")).unwrap_or(0.0);
    warn_without(table, "opacity_cutoff", "opacity");
    OpacitySource { value: value.unwrap_or(NumberSource::Constant(1.0)), cutoff }
}

/// Warns if a key has no effect because another key is missing.
pub(super) fn warn_without(table: &TableReader<'_>, name: &'static str, other: &'static str) {
    let key = table.optional(name);
    if let Some(span) = key.key_span().filter(|_| !table.optional(other).is_present()) {
        key.context.report(Issue::warning(span, format!("`{name}` has no effect without `{other}`")));
    }
}

/// Reports opacity keys on solid glass as errors.
pub(super) fn reject_opacity_keys(table: &TableReader<'_>) {
    for name in ["opacity", "opacity_cutoff"] {
        let message = format!("solid glass cannot have `{name}`");
        table.reject_key(name, &message, Some("use `thin = true` for a pane"));
    }
}
