//! Converts pbrt materials to keys of glimt materials.

use super::colors::SpectrumUse;
use super::lexer::{PbrtError, PbrtResult};
use super::parameters::{Parameters, Text};
use super::scene::PbrtConverter;
use super::state::{ColorSpace, TypedStatement};
use super::texture_nodes::{ImageFilter, ImageNode, ImageWrap, TextureNode, TextureValueKind, UvMapping};
use super::textures::PbrtTextureUse;
use crate::formats::foreign::import::TableEntries;
use crate::formats::rounding::shorten_color;
use crate::materials::conductor::elements::NamedConductor;
use crate::math::{DVec3, Vec3};
use crate::scene::SceneDocumentValue;
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;
use std::ops::Range;

/// Reference to one of the materials of a `mix`.
pub(super) struct BlendPartReference {
    pub(super) name: String,
    pub(super) span: Range<usize>,
}

/// A converted material, without the properties of shapes.
pub(super) enum ConvertedMaterial {
    Plain {
        keys: TableEntries,
        /// Whether it uses texture coordinates or tangents.
        needs_uv: bool,
        /// Whether it is solid glass.
        is_glass: bool,
    },
    Blend {
        parts: [BlendPartReference; 2],
        amount: TextureNode,
    },
    Invisible,
}

const MATERIALS: [&str; 12] = [
    "interface",
    "diffuse",
    "coateddiffuse",
    "coatedconductor",
    "diffusetransmission",
    "dielectric",
    "thindielectric",
    "hair",
    "conductor",
    "measured",
    "mix",
    "subsurface",
];

const OLD_MATERIALS: [&str; 9] =
    ["matte", "plastic", "metal", "glass", "mirror", "uber", "substrate", "translucent", "fourier"];

/// α below which pbrt treats a surface as smooth.
const SMOOTH_ALPHA: f64 = 1e-3;

/// Roughness of a microfacet surface.
enum Roughness {
    Constant {
        /// Square root of α.
        roughness: f64,
        /// From −1 to 1. Positive values stretch the highlight along u.
        anisotropy: f64,
    },
    /// A texture of pbrt's roughness values.
    Textured(TextureNode),
}

/// Reads the parameters of a material.
struct MaterialReader<'w, 'a> {
    writer: &'w mut PbrtConverter<'a>,
    parameters: &'w Parameters,
    space: ColorSpace,
    keys: TableEntries,
    needs_uv: bool,
}

impl PbrtConverter<'_> {
    /// Reads a material. Named materials have their type in a parameter.
    pub(super) fn read_material(
        &mut self,
        entity: &TypedStatement,
        is_named: bool,
    ) -> PbrtResult<ConvertedMaterial> {
        let parameters = &entity.parameters;
        let kind = match is_named {
            true => parameters.string("type")?.unwrap_or(&entity.kind).clone(),
            false => entity.kind.clone(),
        };
        if is_named && parameters.string("type")?.is_none() {
            return Err(PbrtError::new(entity.span(), "this material has no `type`"));
        }
        let reader = MaterialReader {
            writer: self,
            parameters,
            space: entity.color_space,
            keys: Vec::new(),
            needs_uv: false,
        };
        let model = reader.read(&kind, entity)?;
        parameters.check_all_used()?;
        Ok(model)
    }
}

impl MaterialReader<'_, '_> {
    fn read(mut self, kind: &Text, entity: &TypedStatement) -> PbrtResult<ConvertedMaterial> {
        let mut is_glass = false;
        match &*kind.text {
            "" | "none" | "interface" => return Ok(ConvertedMaterial::Invisible),
            "mix" => return self.read_mix(),
            "diffuse" => self.color("diffuse", "reflectance", 0.5)?,
            "coateddiffuse" => self.read_coated_diffuse(entity)?,
            "conductor" => self.read_conductor(false, 1.0)?,
            "coatedconductor" => {
                let text = "refraction in the coat does not widen the metal's highlight";
                self.writer.notes.note("material `coatedconductor`", text, entity.span());
                self.read_coated_conductor()?;
            }
            "dielectric" => {
                is_glass = true;
                self.read_dielectric()?;
            }
            "thindielectric" => {
                self.keys.push(("type", "glass".into()));
                self.keys.push(("thin", true.into()));
                self.add_ior_key("eta", 1.5)?;
            }
            "diffusetransmission" => self.read_diffuse_transmission()?,
            "subsurface" => self.read_subsurface(entity)?,
            "measured" => {
                self.parameters.ignore(&["filename"]);
                self.keys.push(("diffuse", 0.5.into()));
                let text = "a gray diffuse surface is used";
                self.writer.notes.note_lighting_substitution("material `measured`", text, entity.span());
            }
            "hair" => self.read_hair(entity)?,
            other => return Err(unknown_material_type_error(other, kind)),
        }
        self.read_bump()?;
        self.read_normal_map()?;
        Ok(ConvertedMaterial::Plain { keys: self.keys, needs_uv: self.needs_uv, is_glass })
    }

    /// Reads a parameter that may be a texture or a constant.
    fn read_texture_or_constant(
        &mut self,
        name: &'static str,
        value: TextureValueKind,
    ) -> PbrtResult<Option<TextureNode>> {
        let PbrtConverter { resolver, notes, .. } = &mut *self.writer;
        let node = resolver.texture_or_constant(self.parameters, name, value, self.space, notes)?;
        self.needs_uv |= node.as_ref().is_some_and(|node| node.as_constant().is_none());
        Ok(node)
    }

    /// Reads the color parameter `name` into `key`.
    fn color(&mut self, key: &'static str, name: &'static str, default: f64) -> PbrtResult<()> {
        let node = self.read_texture_or_constant(name, TextureValueKind::REFLECTANCE)?;
        let node = node.unwrap_or(TextureNode::Constant(DVec3::splat(default)));
        let value = self.writer.color_value(&node);
        self.keys.push((key, value));
        Ok(())
    }

    fn add_ior_key(&mut self, name: &'static str, default: f64) -> PbrtResult<()> {
        let ior = self.read_ior(name, default)?;
        self.keys.push(("ior", ior.into()));
        Ok(())
    }

    fn read_ior(&mut self, name: &'static str, default: f64) -> PbrtResult<f64> {
        let (ior, is_dispersive) = self.writer.resolver.colors.ior(self.parameters, name, default)?;
        let span = self.parameters.span_of(name);
        if is_dispersive {
            let text = "one index of refraction is used for all wavelengths";
            self.writer.notes.note_substitution("dispersion", text, span.clone());
        }
        if (0.1..=10.0).contains(&ior) {
            return Ok(ior);
        }
        Err(PbrtError::new(span, format!("`{name}` must be between 0.1 and 10")))
    }

    /// Reads a roughness. `names` are the parameters for both directions, for u and for v.
    fn roughness(&mut self, names: [&'static str; 3]) -> PbrtResult<Roughness> {
        let [both, u, v] = names;
        let is_remapped = self.parameters.bool("remaproughness", true)?;
        let usual = self.read_texture_or_constant(both, TextureValueKind::Number)?;
        let usual = usual.unwrap_or(TextureNode::Constant(DVec3::ZERO));
        let along_u =
            self.read_texture_or_constant(u, TextureValueKind::Number)?.unwrap_or_else(|| usual.clone());
        let along_v = self.read_texture_or_constant(v, TextureValueKind::Number)?.unwrap_or(usual);
        let alpha = |node: &TextureNode| {
            let value = node.as_constant()?.x.max(0.0);
            Some(if is_remapped { value.sqrt() } else { value })
        };
        let (Some(alpha_u), Some(alpha_v)) = (alpha(&along_u), alpha(&along_v)) else {
            if along_u != along_v {
                let text = "one of the textures is used in both directions";
                let span = self.parameters.span_of(u);
                self.writer.notes.note_substitution("roughness textures along u and v", text, span);
            }
            let node = if along_u.as_constant().is_none() { along_u } else { along_v };
            return Ok(Roughness::Textured(self.writer.roughness_node(node, is_remapped)));
        };
        if alpha_u.max(alpha_v) < SMOOTH_ALPHA {
            return Ok(Roughness::Constant { roughness: 0.0, anisotropy: 0.0 });
        }
        let (alpha_u, alpha_v) = (alpha_u.clamp(1e-4, 1.0), alpha_v.clamp(1e-4, 1.0));
        let roughness = (alpha_u * alpha_v).sqrt().sqrt();
        let ratio = alpha_u.min(alpha_v) / alpha_u.max(alpha_v);
        let size = ((1.0 - ratio) / 0.9).min(1.0);
        if ratio < 0.099 {
            let text = "the highlight is only 10 times as long as it is wide";
            self.writer.notes.note_substitution("strong anisotropy", text, self.parameters.span_of(u));
        }
        let anisotropy = if alpha_v > alpha_u { -size } else { size };
        Ok(Roughness::Constant { roughness, anisotropy: if ratio > 0.9999 { 0.0 } else { anisotropy } })
    }

    /// Adds the roughness of a surface that cannot be anisotropic.
    fn add_isotropic_roughness(&mut self, key: &'static str, names: [&'static str; 3]) -> PbrtResult<()> {
        match self.roughness(names)? {
            Roughness::Constant { roughness, anisotropy } => {
                if anisotropy != 0.0 {
                    let text = "the mean roughness is used in both directions";
                    let span = self.parameters.span_of(names[1]);
                    self.writer.notes.note_substitution("anisotropy of a dielectric", text, span);
                }
                self.keys.push((key, roughness.into()));
            }
            Roughness::Textured(node) => {
                let value = self.writer.number_value(&node);
                self.keys.push((key, value));
            }
        }
        Ok(())
    }

    fn read_coated_diffuse(&mut self, entity: &TypedStatement) -> PbrtResult<()> {
        self.keys.push(("type", "plastic".into()));
        self.color("diffuse", "reflectance", 0.5)?;
        let ior = self.read_ior("eta", 1.5)?;
        self.keys.push(("ior", ior.max(1.0).into()));
        let roughness = ["roughness", "uroughness", "vroughness"];
        self.add_isotropic_roughness("roughness", roughness)?;
        let is_smooth = self.keys.last().is_some_and(|(_, value)| *value == SceneDocumentValue::Number(0.0));
        if !is_smooth {
            let text =
                "glimt's base receives all light that the coat does not reflect, and is 2 to 5 % brighter";
            self.writer.notes.note("rough `coateddiffuse`", text, entity.span());
        }
        self.ignore_layer_medium()
    }

    /// Ignores the medium between the layers of a coated material, and notes if it is not clear.
    fn ignore_layer_medium(&mut self) -> PbrtResult<()> {
        let albedo = self.read_texture_or_constant("albedo", TextureValueKind::REFLECTANCE)?;
        if albedo.is_some_and(|albedo| albedo.as_constant() != Some(DVec3::ZERO)) {
            let text = "the layer is clear";
            let span = self.parameters.span_of("albedo");
            self.writer.notes.note_lighting_substitution("`albedo` of a coat", text, span);
        }
        self.parameters.ignore(&["thickness", "g", "maxdepth", "nsamples"]);
        Ok(())
    }

    fn read_dielectric(&mut self) -> PbrtResult<()> {
        self.keys.push(("type", "glass".into()));
        self.add_ior_key("eta", 1.5)?;
        self.add_isotropic_roughness("roughness", ["roughness", "uroughness", "vroughness"])
    }

    /// Reads a conductor, either in air (`coat_ior` is 1) or under a coat with the index of refraction
    /// `coat_ior`.
    fn read_conductor(&mut self, is_coated: bool, coat_ior: f64) -> PbrtResult<()> {
        let [eta_name, k_name] = if is_coated { ["conductor.eta", "conductor.k"] } else { ["eta", "k"] };
        let roughness = match is_coated {
            true => ["conductor.roughness", "conductor.uroughness", "conductor.vroughness"],
            false => ["roughness", "uroughness", "vroughness"],
        };
        self.keys.push(("type", "metal".into()));
        let unbounded = TextureValueKind::Color(SpectrumUse::Unbounded);
        let [eta, k] = [
            self.read_texture_or_constant(eta_name, unbounded)?,
            self.read_texture_or_constant(k_name, unbounded)?,
        ];
        match self.read_texture_or_constant("reflectance", TextureValueKind::REFLECTANCE)? {
            Some(_) if eta.is_some() || k.is_some() => {
                let span = self.parameters.span_of("reflectance");
                let message = format!("`reflectance` cannot be combined with `{eta_name}` and `{k_name}`");
                return Err(PbrtError::new(span, message).with_help("remove one of them"));
            }
            Some(reflectance) => self.push_eta_k_from_reflectance(&reflectance, coat_ior),
            None => self.push_complex_ior(eta, k, coat_ior),
        }
        match self.roughness(roughness)? {
            Roughness::Constant { roughness, anisotropy } => {
                self.keys.push(("roughness", roughness.into()));
                if anisotropy != 0.0 {
                    self.needs_uv = true;
                    self.keys.push(("anisotropy", anisotropy.into()));
                }
            }
            Roughness::Textured(node) => {
                let value = self.writer.number_value(&node);
                self.keys.push(("roughness", value));
            }
        }
        Ok(())
    }

    /// Adds the complex index of refraction with η = 1 that has the given reflectance at normal incidence.
    fn push_eta_k_from_reflectance(&mut self, reflectance: &TextureNode, coat_ior: f64) {
        match reflectance.as_constant() {
            Some(color) => {
                let k = |part: f64| {
                    let part = part.clamp(0.0, 0.9999);
                    2.0 * part.sqrt() / (1.0 - part).sqrt() / coat_ior
                };
                self.keys.push(("eta", (1.0 / coat_ior).into()));
                self.keys.push(("k", shorten_color(DVec3::from(color.to_array().map(k)))));
            }
            None => {
                let value = self.writer.color_value(reflectance);
                self.keys.push(("color", value));
                let text = "Schlick's approximation is used at grazing angles";
                let span = self.parameters.span_of("reflectance");
                self.writer.notes.note("a textured `reflectance` of a conductor", text, span);
            }
        }
    }

    /// Adds η and k relative to the coat. The default is copper.
    fn push_complex_ior(&mut self, eta: Option<TextureNode>, k: Option<TextureNode>, coat_ior: f64) {
        let [copper_eta, copper_k] = NamedConductor::Cu.complex_ior().map(Vec3::as_dvec3);
        for (key, node, copper) in [("eta", eta, copper_eta), ("k", k, copper_k)] {
            let node = node.unwrap_or(TextureNode::Constant(copper));
            let node = TextureNode::product(TextureNode::Constant(DVec3::splat(1.0 / coat_ior)), node);
            let value = self.writer.color_value(&node);
            self.keys.push((key, value));
        }
    }

    fn read_coated_conductor(&mut self) -> PbrtResult<()> {
        let ior = self.read_ior("interface.eta", 1.5)?;
        self.read_conductor(true, ior)?;
        self.keys.push(("coat", 1.0.into()));
        self.keys.push(("coat_ior", ior.max(1.0).into()));
        self.add_isotropic_roughness(
            "coat_roughness",
            ["interface.roughness", "interface.uroughness", "interface.vroughness"],
        )?;
        self.ignore_layer_medium()
    }

    fn read_diffuse_transmission(&mut self) -> PbrtResult<()> {
        let scale = TextureNode::Constant(DVec3::splat(self.parameters.float("scale", 1.0)?));
        let parts = [("diffuse", "reflectance"), ("diffuse_transmission", "transmittance")];
        for (key, name) in parts {
            let node = self.read_texture_or_constant(name, TextureValueKind::REFLECTANCE)?;
            let node = node.unwrap_or(TextureNode::Constant(DVec3::splat(0.25)));
            let value = self.writer.color_value(&TextureNode::product(scale.clone(), node));
            self.keys.push((key, value));
        }
        Ok(())
    }

    /// Replaces a subsurface material with a diffuse base of the same albedo under a dielectric coat.
    fn read_subsurface(&mut self, entity: &TypedStatement) -> PbrtResult<()> {
        self.keys.push(("type", "plastic".into()));
        let unbounded = TextureValueKind::Color(SpectrumUse::Unbounded);
        let constant = |node: Option<TextureNode>, default: [f64; 3]| {
            node.and_then(|node| node.as_constant()).unwrap_or(DVec3::from(default))
        };
        let absorption =
            constant(self.read_texture_or_constant("sigma_a", unbounded)?, [0.0011, 0.0024, 0.014]);
        let scattering = constant(self.read_texture_or_constant("sigma_s", unbounded)?, [2.55, 3.21, 3.77]);
        let asymmetry = self.parameters.float("g", 0.0)?;
        let reflectance = match self.read_texture_or_constant("reflectance", TextureValueKind::REFLECTANCE)? {
            Some(reflectance) => reflectance,
            None => TextureNode::Constant(diffusion_albedo(absorption, scattering, asymmetry)),
        };
        let value = self.writer.color_value(&reflectance);
        self.keys.push(("diffuse", value));
        self.add_ior_key("eta", 1.33)?;
        self.add_isotropic_roughness("roughness", ["roughness", "uroughness", "vroughness"])?;
        self.parameters.ignore(&["mfp", "name", "scale"]);
        let text = "a diffuse surface under a coat is used; no light passes through the object";
        self.writer.notes.note_lighting_substitution("material `subsurface`", text, entity.span());
        Ok(())
    }

    fn read_hair(&mut self, entity: &TypedStatement) -> PbrtResult<()> {
        let color = match self.read_texture_or_constant("reflectance", TextureValueKind::REFLECTANCE)? {
            Some(color) => Some(color),
            None => self.read_texture_or_constant("color", TextureValueKind::REFLECTANCE)?,
        };
        let brown = TextureNode::Constant(DVec3::new(0.22, 0.12, 0.05));
        let value = self.writer.color_value(&color.unwrap_or(brown));
        self.keys.push(("diffuse", value));
        let ignored = ["sigma_a", "eumelanin", "pheomelanin", "eta", "beta_m", "beta_n", "alpha"];
        self.parameters.ignore(&ignored);
        let text = "a diffuse surface is used";
        self.writer.notes.note_lighting_substitution("material `hair`", text, entity.span());
        Ok(())
    }

    fn read_mix(&mut self) -> PbrtResult<ConvertedMaterial> {
        let names = self.parameters.strings("materials")?;
        let [first, second] = names else {
            let span = self.parameters.span_of("materials");
            return Err(PbrtError::new(span, "a mix needs two names in `materials`"));
        };
        let part = |text: &Text| BlendPartReference { name: text.text.clone(), span: text.span.clone() };
        let parts = [part(first), part(second)];
        let amount = self.read_texture_or_constant("amount", TextureValueKind::Number)?;
        let amount = amount.unwrap_or(TextureNode::Constant(DVec3::splat(0.5)));
        Ok(ConvertedMaterial::Blend { parts, amount })
    }

    /// Reads `displacement`, which becomes a bump map.
    fn read_bump(&mut self) -> PbrtResult<()> {
        let Some(node) = self.read_texture_or_constant("displacement", TextureValueKind::Number)? else {
            return Ok(());
        };
        let node = self.writer.with_missing_images_gray(&node);
        if node.as_constant().is_some() {
            return Ok(());
        }
        let span = self.parameters.span_of("displacement");
        let text = "shading darkens where the bumps are steep, by 2 % at 7 degrees";
        self.writer.notes.note("`displacement`", text, span);
        let (name, scale) = self.writer.height_texture(&node);
        let texture = SceneDocumentValue::Table(vec![("texture", name.into()), ("channel", "r".into())]);
        self.keys.push(("bump", texture));
        self.keys.push(("bump_scale", scale.into()));
        Ok(())
    }

    fn read_normal_map(&mut self) -> PbrtResult<()> {
        let Some(file) = self.parameters.string("normalmap")?.cloned() else { return Ok(()) };
        if self.writer.tolerate_if_missing(&file, "normal map", "the surface is smooth") {
            return Ok(());
        }
        self.needs_uv = true;
        let image = ImageNode {
            file,
            mapping: UvMapping::IDENTITY,
            wrap: ImageWrap::Repeat,
            filter: ImageFilter::Bilinear,
            is_linear: true,
            is_number: false,
            factor: DVec3::ONE,
            is_inverted: false,
        };
        let name = self.writer.texture(&TextureNode::Image(image), PbrtTextureUse::Normal);
        self.keys.push(("normal_map", name.into()));
        Ok(())
    }
}

/// Diffuse albedo of a semi-infinite medium (van de Hulst, *Multiple Light Scattering*, 1980).
fn diffusion_albedo(absorption: DVec3, scattering: DVec3, asymmetry: f64) -> DVec3 {
    let albedo = |absorbed: f64, scattered: f64| {
        let reduced = scattered * (1.0 - asymmetry);
        if absorbed + reduced <= 0.0 {
            return 0.0;
        }
        let s = (absorbed / (absorbed + reduced)).sqrt();
        ((1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)).clamp(0.0, 1.0)
    };
    DVec3::new(
        albedo(absorption.x, scattering.x),
        albedo(absorption.y, scattering.y),
        albedo(absorption.z, scattering.z),
    )
}

fn unknown_material_type_error(kind: &str, at: &Text) -> Box<PbrtError> {
    let shown = escape_and_truncate(kind, 40);
    if OLD_MATERIALS.contains(&kind) || kind == "kdsubsurface" || kind == "disney" {
        let error = PbrtError::new(at.span.clone(), format!("\"{shown}\" is a pbrt-v3 material"));
        return error.with_help(super::parameters::V3_HELP);
    }
    let error = PbrtError::new(at.span.clone(), format!("unknown material \"{shown}\""));
    error.with_suggestion(nearest_name(kind, MATERIALS))
}
