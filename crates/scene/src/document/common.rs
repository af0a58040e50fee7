//! Reads the keys common to all materials.

use super::super::description::{Bump, EmissionSource, NormalMap, NumberSource, OpacitySource};
use super::context::Issue;
use super::names::DefinedNames;
use super::table::TableReader;

/// Reads `emission` and `emission_sides`.
pub(super) fn read_emission(table: &TableReader<'_>, textures: &DefinedNames) -> EmissionSource {
    let source = table.optional_key("emission").emission_source(textures).unwrap_or(EmissionSource::NONE);
    let sides = table.optional_key("emission_sides").choice().unwrap_or(source.sides);
    warn_if_ineffective_without(table, "emission_sides", "emission");
    EmissionSource { sides, ..source }
}

/// Reads `normal_map` and `normal_strength`.
pub(super) fn read_normal_map(table: &TableReader<'_>, textures: &DefinedNames) -> Option<NormalMap> {
    let texture = table.optional_key("normal_map").index_by_name(textures);
    let strength =
        table.optional_key("normal_strength").number_f32(table.key_limits("normal_strength")).unwrap_or(1.0);
    warn_if_ineffective_without(table, "normal_strength", "normal_map");
    texture.map(|texture| NormalMap { texture, strength })
}

/// Reads `bump` and `bump_scale`.
pub(super) fn read_bump(table: &TableReader<'_>, textures: &DefinedNames) -> Option<Bump> {
    let texture = table.optional_key("bump").texture_with_optional_channel(textures);
    let scale = table.optional_key("bump_scale").number_f32(table.key_limits("bump_scale")).unwrap_or(0.01);
    warn_if_ineffective_without(table, "bump_scale", "bump");
    texture.map(|(texture, channel)| Bump { texture, channel, scale })
}

/// Reads `opacity` and `opacity_cutoff`.
pub(super) fn read_opacity_and_cutoff(table: &TableReader<'_>, textures: &DefinedNames) -> OpacitySource {
    let value = table.optional_key("opacity").number_or_texture(textures, table.key_limits("opacity"));
    let cutoff =
        table.optional_key("opacity_cutoff").number_f32(table.key_limits("opacity_cutoff")).unwrap_or(0.0);
    warn_if_ineffective_without(table, "opacity_cutoff", "opacity");
    OpacitySource { value: value.unwrap_or(NumberSource::Constant(1.0)), cutoff }
}

/// Warns if a key has no effect because another key is missing.
pub(super) fn warn_if_ineffective_without(table: &TableReader<'_>, name: &'static str, other: &'static str) {
    let key = table.optional_key(name);
    if let Some(span) = key.key_span().filter(|_| !table.optional_key(other).is_present()) {
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
