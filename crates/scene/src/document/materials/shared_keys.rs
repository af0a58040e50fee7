//! Keys that materials of all types share: emission, normals, opacity, the coat and the reflecting sides.

use super::super::super::description::{
    Bump, CoatSource, EmissionSource, MaterialKind, NormalMap, OpacitySource, ReflectingSides,
};
use super::super::context::Issue;
use super::super::key::KeyInTable;
use super::MaterialReader;

/// The keys of a coat, starting with its weight.
const COAT_KEYS: [&str; 4] = ["coat", "coat_roughness", "coat_ior", "coat_tint"];

impl MaterialReader<'_> {
    /// Reads the sides that reflect light. Transmissive surfaces always scatter light on both sides.
    pub(super) fn read_reflecting_sides(&self, kind: Option<&MaterialKind>) -> ReflectingSides {
        let key = self.key("sides");
        let sides = key.read_or_default(KeyInTable::choice);
        if sides == ReflectingSides::Both || !kind.is_some_and(MaterialKind::transmits) {
            return sides;
        }
        if let Some(span) = key.value_span() {
            let message = "`sides` has no effect on a material that transmits light";
            self.table.context.report(Issue::warning(span, message));
        }
        ReflectingSides::Both
    }

    pub(super) fn read_emission(&self) -> EmissionSource {
        let source = self.key("emission").read_or_default(|key| key.emission_source(self.textures));
        let sides = self.key("emission_sides").read_or_default(KeyInTable::choice);
        self.warn_if_ineffective_without("emission_sides", "emission");
        EmissionSource { sides, ..source }
    }

    pub(super) fn read_normal_map(&self) -> Option<NormalMap> {
        let key = self.key("normal_map");
        let texture = key.index_by_name(self.textures);
        let strength = self.untextured_number("normal_strength");
        self.warn_if_ineffective_without("normal_strength", "normal_map");
        let texture = texture?;
        let defined = self.defined_textures.as_ref().and_then(|list| list.get(texture));
        if defined.is_some_and(|texture| texture.as_image().is_none()) {
            let issue = Issue::error(key.value_span()?, "a normal map must be an image")
                .with_label("this texture is a pattern")
                .with_help("write `bump` instead of `normal_map` to use the pattern as heights");
            self.table.context.report(issue);
            return None;
        }
        Some(NormalMap { texture, strength })
    }

    pub(super) fn read_bump(&self) -> Option<Bump> {
        let texture = self.key("bump").texture_with_optional_channel(self.textures);
        let scale = self.untextured_number("bump_scale");
        self.warn_if_ineffective_without("bump_scale", "bump");
        texture.map(|(texture, channel)| Bump { texture, channel, scale })
    }

    pub(super) fn read_opacity_and_cutoff(&self) -> OpacitySource {
        let (value, cutoff) = (self.number_or_texture("opacity"), self.untextured_number("opacity_cutoff"));
        self.warn_if_ineffective_without("opacity_cutoff", "opacity");
        OpacitySource { value, cutoff }
    }

    pub(super) fn read_coat(&self) -> CoatSource {
        for name in &COAT_KEYS[1..] {
            self.warn_if_ineffective_without(name, "coat");
        }
        let coat = CoatSource {
            weight: self.number_or_texture("coat"),
            roughness: self.number_or_texture("coat_roughness"),
            ior: self.untextured_number("coat_ior"),
            tint: self.color_or_texture("coat_tint"),
        };
        coat.cleared_if_zero_weight()
    }

    /// Reads the coat of a principled material, where some keys have two names.
    pub(super) fn read_coat_or_clearcoat(&self) -> CoatSource {
        self.warn_if_ineffective_without("clearcoat_roughness", "clearcoat");
        let (coat, clearcoat) = (self.read_coat(), ["clearcoat", "clearcoat_roughness"]);
        let clear = CoatSource {
            weight: self.number_or_texture("clearcoat"),
            roughness: self.number_or_texture("clearcoat_roughness"),
            ..CoatSource::NONE
        };
        if !COAT_KEYS.iter().any(|name| self.key(name).is_present()) {
            return clear.cleared_if_zero_weight();
        }
        if let Some(span) = clearcoat.iter().find_map(|name| self.key(name).key_span()) {
            let issue = Issue::error(span, "the coat of this material is specified twice")
                .with_help("use the `coat` keys instead of the `clearcoat` keys");
            self.table.context.report(issue);
        }
        coat
    }

    /// Reports coat keys on glass as errors.
    pub(super) fn reject_coat_keys(&self) {
        for name in COAT_KEYS {
            self.table.reject_key(name, &format!("glass cannot have `{name}`"), None);
        }
    }

    /// Reports opacity keys on solid glass as errors.
    pub(super) fn reject_opacity_keys(&self) {
        for name in ["opacity", "opacity_cutoff"] {
            let message = format!("solid glass cannot have `{name}`");
            self.table.reject_key(name, &message, Some("use `thin = true` for a pane"));
        }
    }

    /// Warns if a key has no effect because another key is missing.
    fn warn_if_ineffective_without(&self, name: &'static str, other: &'static str) {
        if let Some(entry) = self.table.entry(name)
            && self.table.entry(other).is_none()
        {
            let message = format!("`{name}` has no effect without `{other}`");
            self.table.context.report(Issue::warning(entry.span, message));
        }
    }
}
