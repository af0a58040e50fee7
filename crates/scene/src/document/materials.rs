//! Reads the `[materials.*]` tables.

use super::super::description::{
    ColorSource, FresnelSource, Material, MaterialKind, NumberSource, OpacitySource, PhongParameters,
};
use super::common;
use super::context::Issue;
use super::key::KeyInTable;
use super::limits::Limits;
use super::names::DefinedNames;
use super::table::TableReader;
use crate::choice;
use crate::materials::conductor::elements::MetalElement;
use crate::math::{DVec3, Vec3};

/// The materials defined in a file.
pub(super) struct MaterialList {
    /// Material names.
    pub(super) names: DefinedNames,
    /// The materials, in the same order as the names, or `None` if any is invalid.
    pub(super) list: Option<Vec<Material>>,
    /// Whether each material emits light.
    emissive: Vec<bool>,
}

impl MaterialList {
    /// Whether a material emits light.
    pub(super) fn is_emissive(&self, index: usize) -> bool {
        self.emissive.get(index).copied().unwrap_or(false)
    }
}

pub(super) fn read_materials(root: &TableReader<'_>, textures: &DefinedNames) -> MaterialList {
    let tables = root.named_tables("materials");
    let names =
        DefinedNames::new("material", tables.iter().map(|(name, span, _)| (name.clone(), span.clone())));
    let read: Vec<Option<Material>> =
        tables.into_iter().map(|(name, _, table)| read_material(name, &table?, textures)).collect();
    let emits = |material: &Material| material.emits();
    let emissive = read.iter().map(|material| material.as_ref().is_some_and(emits)).collect();
    MaterialList { names, list: read.into_iter().collect(), emissive }
}

choice! {
    /// Types of materials.
    enum MaterialType {
        /// Diffuse and glossy.
        Phong = "phong",
        /// A perfect mirror.
        Mirror = "mirror",
        /// A smooth or rough dielectric.
        Glass = "glass",
        /// A rough or smooth conductor.
        Metal = "metal",
        /// A diffuse base under a rough or smooth coat.
        Plastic = "plastic",
        /// The glTF inputs.
        Principled = "principled",
    }
}

fn read_material(name: String, table: &TableReader<'_>, textures: &DefinedNames) -> Option<Material> {
    let key = table.optional_key("type");
    // Without a valid type, keys cannot be checked.
    let kind = if key.is_present() { key.choice()? } else { MaterialType::Phong };
    let kind = match kind {
        MaterialType::Phong => Some(MaterialKind::Phong(read_phong(table, textures))),
        MaterialType::Mirror => Some(read_mirror(table, textures)),
        MaterialType::Glass => read_glass(table, textures),
        MaterialType::Metal => read_metal(table, textures),
        MaterialType::Plastic => Some(read_plastic(table, textures)),
        MaterialType::Principled => Some(read_principled(table, textures)),
    };
    let (emission, normal_map) =
        (common::read_emission(table, textures), common::read_normal_map(table, textures));
    let bump = common::read_bump(table, textures);
    let opacity = if kind.as_ref().is_some_and(MaterialKind::is_solid_glass) {
        common::reject_opacity_keys(table);
        OpacitySource::FULL
    } else {
        common::read_opacity_and_cutoff(table, textures)
    };
    table.report_unknown_and_missing_keys();
    Some(Material { name, kind: kind?, emission, normal_map, bump, opacity })
}

fn read_phong(table: &TableReader<'_>, textures: &DefinedNames) -> PhongParameters {
    let (diffuse_key, specular_key) = (table.optional_key("diffuse"), table.optional_key("specular"));
    let ambient_key = table.optional_key("ambient");
    let color = |key: &KeyInTable<'_>, name| key.color_or_texture(textures, table.key_limits(name));
    let (diffuse, specular) = (color(&diffuse_key, "phong.diffuse"), color(&specular_key, "phong.specular"));
    let is_wrong = |key: &KeyInTable<'_>, color: &Option<ColorSource>| key.is_present() && color.is_none();
    let is_invalid = is_wrong(&diffuse_key, &diffuse) || is_wrong(&specular_key, &specular);
    let diffuse = diffuse.unwrap_or(ColorSource::Constant(Vec3::splat(0.7)));
    let specular = specular.unwrap_or(ColorSource::Constant(Vec3::ZERO));
    let are_bytes = [&diffuse_key, &specular_key, &ambient_key]
        .map(|key| key.report_byte_color(|span| Issue::warning(span, ENERGY_GAIN)));
    if !is_invalid && are_bytes == [false; 3] {
        warn_about_energy_gain(&diffuse_key, &specular_key, &diffuse, &specular);
    }
    PhongParameters {
        diffuse,
        specular,
        shininess: read_or_default(table, "phong.shininess", 32.0, KeyInTable::number_f32),
        ambient: color(&ambient_key, "phong.ambient"),
    }
}

/// Warning message for materials that violate energy conservation.
pub(crate) const ENERGY_GAIN: &str = "this material reflects more light than it receives";

/// Warns about a material that reflects more light than it receives.
fn warn_about_energy_gain(
    kd_key: &KeyInTable<'_>,
    ks_key: &KeyInTable<'_>,
    kd: &ColorSource,
    ks: &ColorSource,
) {
    let constant = |source: &ColorSource| match source {
        ColorSource::Constant(color) => *color,
        ColorSource::Texture(_) => Vec3::ZERO,
    };
    let sum = constant(kd) + constant(ks);
    // Decimal values that sum to 1 may sum to slightly more in binary.
    let most = sum.max_element();
    let Some(span) = ks_key.value_span().or(kd_key.value_span()).filter(|_| most > 1.0 + 1e-5) else {
        return;
    };
    let channel = ["red", "green", "blue"][sum.max_position()];
    let issue = Issue::warning(span, ENERGY_GAIN)
        .with_label(format!("diffuse + specular is {:.3} in {channel}", most))
        .with_help("keep `diffuse` + `specular` at or below 1 in every channel");
    kd_key.context.report(issue);
}

fn read_metal(table: &TableReader<'_>, textures: &DefinedNames) -> Option<MaterialKind> {
    let fresnel = read_metal_reflectance(table, textures);
    Some(MaterialKind::Metal {
        roughness: read_number_or_texture(table, textures, "metal.roughness", 0.2),
        anisotropy: read_number_or_texture(table, textures, "metal.anisotropy", 0.0),
        fresnel: fresnel?,
    })
}

fn read_plastic(table: &TableReader<'_>, textures: &DefinedNames) -> MaterialKind {
    MaterialKind::Plastic {
        diffuse: read_color(table, textures, "plastic.diffuse", 0.7),
        specular: read_color(table, textures, "plastic.specular", 1.0),
        ior: read_ior(table, "plastic.ior"),
        roughness: read_number_or_texture(table, textures, "plastic.roughness", 0.1),
    }
}

fn read_principled(table: &TableReader<'_>, textures: &DefinedNames) -> MaterialKind {
    common::warn_if_ineffective_without(table, "clearcoat_roughness", "clearcoat");
    let (color, number) = (
        |path, default| read_color(table, textures, path, default),
        |path, default| read_number_or_texture(table, textures, path, default),
    );
    MaterialKind::Principled {
        color: color("principled.color", 0.8),
        metallic: number("principled.metallic", 0.0),
        roughness: number("principled.roughness", 0.5),
        ior: read_ior(table, "principled.ior"),
        specular: number("principled.specular", 1.0),
        specular_color: color("principled.specular_color", 1.0),
        transmission: number("principled.transmission", 0.0),
        clearcoat: number("principled.clearcoat", 0.0),
        clearcoat_roughness: number("principled.clearcoat_roughness", 0.0),
    }
}

/// Returns the key at the path `TYPE.KEY`.
fn key_at_typed_path<'a>(table: &TableReader<'a>, path: &'static str) -> KeyInTable<'a> {
    table.optional_key(path.split_once('.').map_or(path, |(_, name)| name))
}

/// Reads the key at the path `TYPE.KEY` and checks its limits. Returns `default` if the key is missing or
/// invalid.
fn read_or_default<'a, T>(
    table: &TableReader<'a>,
    path: &'static str,
    default: T,
    read: impl FnOnce(&KeyInTable<'a>, Limits) -> Option<T>,
) -> T {
    read(&key_at_typed_path(table, path), table.key_limits(path)).unwrap_or(default)
}

/// Reads a color or a texture.
fn read_color(
    table: &TableReader<'_>,
    textures: &DefinedNames,
    path: &'static str,
    default: f32,
) -> ColorSource {
    let default = ColorSource::Constant(Vec3::splat(default));
    read_or_default(table, path, default, |key, limits| key.color_or_texture(textures, limits))
}

/// Reads a number or a texture.
fn read_number_or_texture(
    table: &TableReader<'_>,
    textures: &DefinedNames,
    path: &'static str,
    default: f32,
) -> NumberSource {
    let default = NumberSource::Constant(default);
    read_or_default(table, path, default, |key, limits| key.number_or_texture(textures, limits))
}

/// Reads an index of refraction.
fn read_ior(table: &TableReader<'_>, path: &'static str) -> f32 {
    read_or_default(table, path, 1.5, KeyInTable::number_f32)
}

/// Reads a metal's reflectance. Exactly one of three groups of keys must specify it.
fn read_metal_reflectance(table: &TableReader<'_>, textures: &DefinedNames) -> Option<FresnelSource> {
    let [color, eta, k, element] = ["color", "eta", "k", "element"].map(|name| table.optional_key(name));
    let is_index = eta.is_present() || k.is_present();
    let count =
        [color.is_present(), is_index, element.is_present()].into_iter().filter(|given| *given).count();
    if count > 1 {
        let given = [&element, &k, &eta, &color].into_iter().find(|key| key.is_present());
        let issue = Issue::error(
            given.and_then(KeyInTable::key_span)?,
            "the reflectance of this metal is specified twice",
        )
        .with_help("use exactly one of `color`, `eta` with `k`, and `element`");
        table.context.report(issue);
        return None;
    }
    if element.is_present() {
        let [eta, k] = element.choice::<MetalElement>()?.complex_ior().map(ColorSource::Constant);
        return Some(FresnelSource::Index { eta, k });
    }
    if is_index {
        let [eta, k] = [("eta", "metal.eta"), ("k", "metal.k")].map(|(name, path)| {
            table.required_key(name, "[0.2, 0.9, 1.1]").color_or_texture(textures, table.key_limits(path))
        });
        return Some(FresnelSource::Index { eta: eta?, k: k? });
    }
    let color = table.required_key("color", "[0.9, 0.8, 0.4]");
    color.color_or_texture(textures, table.key_limits("metal.color")).map(FresnelSource::Schlick)
}

fn read_mirror(table: &TableReader<'_>, textures: &DefinedNames) -> MaterialKind {
    MaterialKind::Mirror { reflectance: read_color(table, textures, "mirror.reflectance", 0.9) }
}

fn read_glass(table: &TableReader<'_>, textures: &DefinedNames) -> Option<MaterialKind> {
    let ior = read_ior(table, "glass.ior");
    let (tint, thin) = (table.optional_key("tint"), table.optional_key("thin"));
    let rough = table.optional_key("roughness");
    let roughness = read_number_or_texture(table, textures, "glass.roughness", 0.0);
    // If `thin` is present but invalid, the user probably wants a pane.
    if !thin.boolean().unwrap_or(thin.is_present()) {
        let tint = tint.color_f64(table.key_limits("glass.tint")).unwrap_or(DVec3::ONE);
        return Some(MaterialKind::Glass { ior, tint, roughness });
    }
    if roughness != NumberSource::Constant(0.0) {
        let issue = Issue::error(rough.value_span()?, "thin panes cannot be rough")
            .with_help("remove `thin` and give the glass a thickness: use a box instead of a quad");
        table.context.report(issue);
        return None;
    }
    let tint = tint
        .color_or_texture(textures, table.key_limits("glass.tint"))
        .unwrap_or(ColorSource::Constant(Vec3::ONE));
    Some(MaterialKind::Pane { ior, tint })
}
