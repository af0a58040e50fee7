//! The `[materials.NAME]` tables.

mod shared_keys;

use super::super::description::{
    self, CoatSource, ColorSource, ConductorFresnelSource, EmissionSides, Material, MaterialKind,
    MicrofacetDistribution, NumberSource, OpacitySource, PhongParameters, ReflectingSides,
};
use super::super::keys::key::DefaultValue::{Absent, Alternative, By, Is, Required};
use super::super::keys::key::ValueKind::{
    self, ColorOrTexture, Emission, Flag, Heights, MaterialPair, Number, NumberOrTexture, Texture, Words,
};
use super::super::keys::key::{TableInfo, TableSyntax, choice_values, keys, table_types};
use super::blends::{ReadMaterial, UnresolvedBlend, resolve_blends};
use super::context::Issue;
use super::key::KeyInTable;
use super::limits::Limits::{Any, AtLeast, Between};
use super::names::DefinedNames;
use super::table::TableReader;
use super::textures::DefinedTextures;
use crate::materials::conductor::elements::NamedConductor;
use crate::math::Vec3;

/// A color with components from 0 to 1, or a texture.
const REFLECTANCE: ValueKind = ColorOrTexture(Between(0.0, 1.0));

/// A number or texture from 0 to 1.
const FRACTION: ValueKind = NumberOrTexture(Between(0.0, 1.0));

table_types! {
    /// Types of materials.
    enum MaterialType, const TYPES;
    /// A diffuse surface with a glossy highlight.
    Phong = "phong" {
        /// Diffuse reflectance, kd.
        diffuse: ColorOrTexture(AtLeast(0.0)), Is("[0.7, 0.7, 0.7]"), "reflectance";
        /// Glossy reflectance, ks; glimt warns if `diffuse` + `specular` + `diffuse_transmission` exceeds 1,
        /// which is not energy conserving.
        specular: ColorOrTexture(AtLeast(0.0)), Is("[0, 0, 0]"), "reflectance";
        /// Phong exponent; larger values make smaller highlights.
        shininess: Number(Between(0.0, 1000000.0)), Is("32.0");
        /// Reflectance for `[render] ambient`.
        ambient: ColorOrTexture(AtLeast(0.0)), By("as `diffuse`");
        /// Diffuse transmittance, kt, for thin surfaces such as leaves and paper.
        diffuse_transmission: ColorOrTexture(AtLeast(0.0)), Is("[0, 0, 0]"), "reflectance";
    }
    /// A perfect mirror.
    Mirror = "mirror" {
        /// Reflectance at every angle.
        reflectance: REFLECTANCE, Is("[0.9, 0.9, 0.9]"), "reflectance";
    }
    /// A smooth or rough dielectric, or a thin pane.
    Glass = "glass" {
        /// Index of refraction, relative to air.
        ior: Number(Between(0.1, 10.0)), Is("1.5");
        /// Square root of α; 0 is smooth. Thin panes are always smooth.
        roughness: FRACTION, Is("0.0");
        /// Distribution of the facets of a rough surface.
        distribution: Words(choice_values::<MicrofacetDistribution>), Is("\"ggx\"");
        /// Transmittance per unit length (Beer's law); for a thin pane, transmittance at any angle, which may
        /// be a texture.
        tint: REFLECTANCE, Is("[1, 1, 1]"), "per unit length";
        /// Whether the glass is an infinitely thin pane.
        thin: Flag, Is("false");
    }
    /// A rough or smooth conductor, defined by exactly one of `color`, `eta` with `k`, and `element`.
    Metal = "metal" {
        /// Reflectance at normal incidence; other angles use Schlick's approximation.
        color: REFLECTANCE, Alternative("[0.9, 0.8, 0.4]"), "reflectance";
        /// Index of refraction for red, green and blue, used in the exact Fresnel equations.
        eta: ColorOrTexture(AtLeast(0.0)), Alternative("[0.2, 0.9, 1.1]");
        /// Extinction coefficient for red, green and blue.
        k: ColorOrTexture(AtLeast(0.0)), Alternative("[0.2, 0.9, 1.1]");
        /// Measured `eta` and `k` of a metal or a compound.
        element: Words(choice_values::<NamedConductor>), Absent;
        /// Square root of α; 0 is a mirror.
        roughness: FRACTION, Is("0.2");
        /// Distribution of the facets.
        distribution: Words(choice_values::<MicrofacetDistribution>), Is("\"ggx\"");
        /// Stretches the highlight along u, or along v if negative.
        anisotropy: NumberOrTexture(Between(-1.0, 1.0)), Is("0.0");
    }
    /// A diffuse base under a rough or smooth coat.
    Plastic = "plastic" {
        /// Reflectance of the base.
        diffuse: REFLECTANCE, Is("[0.7, 0.7, 0.7]"), "reflectance";
        /// Scale factor for the coat's reflectance.
        specular: REFLECTANCE, Is("[1, 1, 1]");
        /// The coat's index of refraction.
        ior: Number(Between(1.0, 10.0)), Is("1.5");
        /// Square root of the coat's α; 0 is smooth.
        roughness: FRACTION, Is("0.1");
        /// Distribution of the coat's facets.
        distribution: Words(choice_values::<MicrofacetDistribution>), Is("\"ggx\"");
        /// Whether light that the coat reflects back to the base makes its color more saturated; otherwise,
        /// the reflectance is proportional to `diffuse`.
        nonlinear: Flag, Is("true");
    }
    /// The glTF material model.
    Principled = "principled" {
        /// Diffuse reflectance of the dielectric part, and the metal's reflectance at normal incidence.
        color: REFLECTANCE, Is("[0.8, 0.8, 0.8]"), "reflectance";
        /// Weight of the metal.
        metallic: FRACTION, Is("0.0");
        /// Square root of the specular lobe's GGX α.
        roughness: FRACTION, Is("0.5");
        /// Index of refraction of the dielectric part.
        ior: Number(Between(1.0, 10.0)), Is("1.5");
        /// Scale factor for the dielectric part's specular reflectance.
        specular: FRACTION, Is("1.0");
        /// Scale factor for the dielectric part's specular reflectance at normal incidence.
        specular_color: ColorOrTexture(AtLeast(0.0)), Is("[1, 1, 1]");
        /// Fraction of the diffuse light that is transmitted instead, as through a thin sheet.
        transmission: FRACTION, Is("0.0");
        /// Diffuse transmittance, for thin surfaces such as leaves and paper; at most 1 − `color`.
        diffuse_transmission: REFLECTANCE, Is("[0, 0, 0]"), "reflectance";
        /// Weight of the clear coat on top; another name for `coat`.
        clearcoat: FRACTION, Is("0.0");
        /// Square root of the clear coat's GGX α; another name for `coat_roughness`.
        clearcoat_roughness: FRACTION, Is("0.0");
    }
    /// A blend of two materials.
    Blend = "blend" {
        /// The materials, which may be blends, but not solid glass.
        materials: MaterialPair, Required("[\"paint\", \"rust\"]");
        /// Weight of the second material: 0 shows the first, 1 the second.
        weight: FRACTION, Is("0.5");
    }
}

pub(crate) static MATERIALS: TableInfo = TableInfo {
    types: TYPES,
    ..TableInfo::new(
        "materials",
        TableSyntax::Named,
        "A material, which shapes refer to by name",
        keys! {
            /// The sides of an opaque surface that reflect light; with `front`, the back is black.
            sides: Words(choice_values::<ReflectingSides>), Is("\"both\"");
            /// Emitted radiance; if not black, every shape with this material is an area light.
            emission: Emission(AtLeast(0.0)), Is("[0, 0, 0]"), "radiance";
            /// The sides that emit light.
            emission_sides: Words(choice_values::<EmissionSides>), Is("\"front\"");
            /// Tangent-space normal map.
            normal_map: Texture, Absent;
            /// Strength of the normal map.
            normal_strength: Number(AtLeast(0.0)), Is("1.0");
            /// Height map that perturbs the normals.
            bump: Heights, Absent;
            /// Displacement of white; negative values invert the relief.
            bump_scale: Number(Any), Is("0.01"), "length";
            /// Weight of a clear dielectric layer on top of the material, which also attenuates its emission.
            coat: FRACTION, Is("0.0");
            /// Square root of the layer's GGX α.
            coat_roughness: FRACTION, Is("0.05");
            /// The layer's index of refraction.
            coat_ior: Number(Between(1.0, 10.0)), Is("1.5");
            /// Transmittance for a round trip through the layer at normal incidence.
            coat_tint: REFLECTANCE, Is("[1, 1, 1]");
            /// Probability that a ray hits the surface instead of passing through.
            opacity: FRACTION, Is("1.0");
            /// If above 0, alpha testing: opaque where the opacity is at least this, invisible elsewhere.
            /// With `filter = "mipmap"`, distant surfaces keep their coverage.
            opacity_cutoff: Number(Between(0.0, 1.0)), Is("0.0");
        },
    )
};

/// The materials defined in a file.
pub(super) struct MaterialList {
    /// Material names.
    pub(super) names: DefinedNames,
    /// The materials, in the same order as the names, or `None` if any is invalid.
    pub(super) list: Option<Vec<Material>>,
    /// Whether each material emits light.
    emissive: Vec<bool>,
    /// Whether each material has a texture in the shape's own coordinates.
    use_object_point: Vec<bool>,
}

impl MaterialList {
    /// Whether a material emits light.
    pub(super) fn is_emissive(&self, index: usize) -> bool {
        self.emissive.get(index).copied().unwrap_or(false)
    }

    /// Whether a material has a texture in the shape's own coordinates.
    pub(super) fn uses_object_point(&self, index: usize) -> bool {
        self.use_object_point.get(index).copied().unwrap_or(false)
    }
}

pub(super) fn read_materials(root: &TableReader<'_>, textures: &DefinedTextures) -> MaterialList {
    let tables = root.named_tables(&MATERIALS);
    let names =
        DefinedNames::new("material", tables.iter().map(|(name, span, _)| (name.clone(), span.clone())));
    let read = tables.into_iter().map(|(name, _, table)| read_material(name, table?, textures, &names));
    let read = resolve_blends(root.context, read.collect());
    let all = |property: &dyn Fn(&Material) -> bool| -> Vec<bool> {
        read.iter().map(|material| material.as_ref().is_some_and(property)).collect()
    };
    let emissive = all(&Material::emits);
    let is_of_object = |texture: usize| {
        let texture = textures.list.as_ref().and_then(|list| list.get(texture));
        texture.is_some_and(|texture| texture.uv_set().is_none())
    };
    let use_object_point = all(&|material: &Material| {
        let mut textures =
            material.self_and_blend_parts().into_iter().flat_map(Material::own_textures_with_roles);
        textures.any(|(texture, _)| is_of_object(texture))
    });
    MaterialList { names, list: read.into_iter().collect(), emissive, use_object_point }
}

fn read_material(
    name: String,
    mut table: TableReader<'_>,
    textures: &DefinedTextures,
    materials: &DefinedNames,
) -> Option<ReadMaterial> {
    // Without a valid type, keys cannot be checked.
    let kind = table.read_type()?;
    let table = &MaterialReader { table, textures: &textures.names, defined_textures: &textures.list };
    let (kind, coat) = match kind {
        MaterialType::Phong => (Some(MaterialKind::Phong(table.read_phong())), table.read_coat()),
        MaterialType::Mirror => (
            Some(MaterialKind::Mirror { reflectance: table.color_or_texture("reflectance") }),
            table.read_coat(),
        ),
        MaterialType::Glass => {
            table.reject_coat_keys();
            (table.read_glass(), CoatSource::NONE)
        }
        MaterialType::Metal => (table.read_metal(), table.read_coat()),
        MaterialType::Plastic => (Some(table.read_plastic()), table.read_coat()),
        MaterialType::Principled => (Some(table.read_principled()), table.read_coat_or_clearcoat()),
        MaterialType::Blend => return table.read_blend(name, materials).map(ReadMaterial::Blend),
    };
    let (emission, normal_map, bump) = (table.read_emission(), table.read_normal_map(), table.read_bump());
    let opacity = if kind.as_ref().is_some_and(MaterialKind::is_solid_glass) {
        table.reject_opacity_keys();
        OpacitySource::FULL
    } else {
        table.read_opacity_and_cutoff()
    };
    let sides = table.read_reflecting_sides(kind.as_ref());
    table.table.report_unknown_and_missing_keys();
    let material = Material { name, kind: kind?, sides, emission, normal_map, bump, opacity, coat };
    Some(ReadMaterial::Complete(Box::new(material)))
}

/// A material's table, and the textures that it may refer to.
struct MaterialReader<'a> {
    table: TableReader<'a>,
    textures: &'a DefinedNames,
    /// The textures with these names, or `None` if any is invalid.
    defined_textures: &'a Option<Vec<description::Texture>>,
}

impl<'a> MaterialReader<'a> {
    fn key(&self, name: &str) -> KeyInTable<'a> {
        self.table.key(name)
    }

    /// Reads a color or a texture.
    fn color_or_texture(&self, name: &str) -> ColorSource {
        self.key(name).read_or_default(|key| key.color_or_texture(self.textures))
    }

    /// Reads a number or a texture.
    fn number_or_texture(&self, name: &str) -> NumberSource {
        self.key(name).read_or_default(|key| key.number_or_texture(self.textures))
    }

    /// Reads a number that cannot be a texture.
    fn untextured_number(&self, name: &str) -> f32 {
        self.key(name).read_or_default(KeyInTable::number_f32)
    }

    fn read_phong(&self) -> PhongParameters {
        let keys = ["diffuse", "specular", "diffuse_transmission", "ambient"].map(|name| self.key(name));
        let [diffuse_key, specular_key, transmission_key, ambient_key] = &keys;
        let color = |key: &KeyInTable<'_>| key.color_or_texture(self.textures);
        let albedos = [diffuse_key, specular_key, transmission_key].map(color);
        let are_bytes =
            keys.each_ref().map(|key| key.report_byte_color(|span| Issue::warning(span, ENERGY_GAIN)));
        if let ([Some(kd), Some(ks), Some(kt)], false) = (&albedos, are_bytes.contains(&true)) {
            warn_about_albedo_above_one(ENERGY_GAIN, &keys[..3], &[kd, ks, kt]);
        }
        let [diffuse, specular, transmission] = albedos;
        PhongParameters {
            diffuse: diffuse.unwrap_or_else(|| diffuse_key.default(color)),
            specular: specular.unwrap_or_else(|| specular_key.default(color)),
            diffuse_transmission: transmission.unwrap_or_else(|| transmission_key.default(color)),
            shininess: self.untextured_number("shininess"),
            ambient: color(ambient_key),
        }
    }

    fn read_glass(&self) -> Option<MaterialKind> {
        let ior = self.untextured_number("ior");
        let (tint, thin) = (self.key("tint"), self.key("thin"));
        let roughness = self.number_or_texture("roughness");
        let distribution = self.read_distribution(roughness);
        // If `thin` is present but invalid, the user probably wants a pane.
        if !thin.boolean().unwrap_or(thin.is_present()) {
            return Some(MaterialKind::Glass {
                ior,
                tint: tint.read_or_default(KeyInTable::color_f64),
                roughness,
                distribution,
            });
        }
        if roughness != NumberSource::Constant(0.0) {
            let issue = Issue::error(self.key("roughness").value_span()?, "thin panes cannot be rough")
                .with_help("remove `thin` and give the glass a thickness: use a box instead of a quad");
            self.table.context.report(issue);
            return None;
        }
        Some(MaterialKind::Pane { ior, tint: self.color_or_texture("tint") })
    }

    fn read_metal(&self) -> Option<MaterialKind> {
        let fresnel = self.read_metal_reflectance();
        let (roughness, anisotropy) =
            (self.number_or_texture("roughness"), self.number_or_texture("anisotropy"));
        let distribution = self.read_distribution(roughness);
        Some(MaterialKind::Metal { roughness, anisotropy, distribution, fresnel: fresnel? })
    }

    /// Reads the distribution of the facets. Warns if the surface is smooth.
    fn read_distribution(&self, roughness: NumberSource) -> MicrofacetDistribution {
        let key = self.key("distribution");
        if roughness == NumberSource::Constant(0.0)
            && let Some(span) = key.key_span()
        {
            let message = "`distribution` has no effect on a smooth surface";
            let issue = Issue::warning(span, message).with_help("set `roughness` above 0");
            self.table.context.report(issue);
        }
        key.read_or_default(KeyInTable::choice)
    }

    /// Reads a metal's reflectance. Exactly one of three groups of keys must specify it.
    fn read_metal_reflectance(&self) -> Option<ConductorFresnelSource> {
        let [color, eta, k, element] = ["color", "eta", "k", "element"].map(|name| self.key(name));
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
            self.table.context.report(issue);
            return None;
        }
        if element.is_present() {
            let [eta, k] = element.choice::<NamedConductor>()?.complex_ior().map(ColorSource::Constant);
            return Some(ConductorFresnelSource::Index { eta, k });
        }
        let required =
            |name| self.table.key_required_without_alternative(name).color_or_texture(self.textures);
        if is_index {
            let (eta, k) = (required("eta"), required("k"));
            return Some(ConductorFresnelSource::Index { eta: eta?, k: k? });
        }
        required("color").map(ConductorFresnelSource::Schlick)
    }

    fn read_plastic(&self) -> MaterialKind {
        let roughness = self.number_or_texture("roughness");
        MaterialKind::Plastic {
            diffuse: self.color_or_texture("diffuse"),
            specular: self.color_or_texture("specular"),
            ior: self.untextured_number("ior"),
            roughness,
            distribution: self.read_distribution(roughness),
            nonlinear: self.key("nonlinear").boolean().unwrap_or(true),
        }
    }

    fn read_principled(&self) -> MaterialKind {
        let names = ["color", "diffuse_transmission"];
        let [color, diffuse_transmission] = names.map(|name| self.color_or_texture(name));
        let message = "`diffuse_transmission` is limited to 1 − `color`";
        let keys = names.map(|name| self.key(name));
        warn_about_albedo_above_one(message, &keys, &[&color, &diffuse_transmission]);
        MaterialKind::Principled {
            color,
            diffuse_transmission,
            metallic: self.number_or_texture("metallic"),
            roughness: self.number_or_texture("roughness"),
            ior: self.untextured_number("ior"),
            specular: self.number_or_texture("specular"),
            specular_color: self.color_or_texture("specular_color"),
            transmission: self.number_or_texture("transmission"),
        }
    }

    /// Reads a blend, which has no keys of its own except `materials` and `weight`.
    fn read_blend(&self, name: String, materials: &DefinedNames) -> Option<UnresolvedBlend> {
        for key in MATERIALS.keys {
            let help = format!("set `{}` on the materials of the blend", key.name);
            self.table.reject_key(key.name, &format!("a blend cannot have `{}`", key.name), Some(&help));
        }
        let (pair, weight) = (self.key("materials"), self.number_or_texture("weight"));
        let parts = pair.index_pair_by_names(materials);
        self.table.report_unknown_and_missing_keys();
        Some(UnresolvedBlend { name, weight, parts: parts?, span: pair.value_span()? })
    }
}

/// Warning message for materials that violate energy conservation.
pub(crate) const ENERGY_GAIN: &str = "this material reflects more light than it receives";

/// Warns if the sum of `albedos`, the values of `keys`, exceeds 1.
fn warn_about_albedo_above_one(message: &str, keys: &[KeyInTable<'_>], albedos: &[&ColorSource]) {
    let constant = |source: &&ColorSource| match source {
        ColorSource::Constant(color) => *color,
        ColorSource::Texture(_) => Vec3::ZERO,
    };
    let sum: Vec3 = albedos.iter().map(constant).sum();
    // Decimal values that sum to 1 may sum to slightly more in binary.
    let most = sum.max_element();
    let last = keys.iter().rev().find(|key| key.is_present());
    let Some(key) = last.filter(|_| most > 1.0 + 1e-5) else { return };
    let Some(span) = key.value_span() else { return };
    let channel = ["red", "green", "blue"][sum.max_position()];
    // Name only the keys that contribute.
    let named = |(key, albedo): (&KeyInTable<'_>, &&ColorSource)| {
        (constant(albedo) != Vec3::ZERO).then_some(key.info.name)
    };
    let names: Vec<&str> = keys.iter().zip(albedos).filter_map(named).collect();
    let issue = Issue::warning(span, message)
        .with_label(format!("{} is {most:.3} in {channel}", names.join(" + ")))
        .with_help(format!("keep {} at or below 1 in every channel", names.join(" + ")));
    key.context.report(issue);
}
