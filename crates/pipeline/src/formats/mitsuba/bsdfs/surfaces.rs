//! Converts BSDFs without nested BSDFs to materials.

use super::{AIR, BsdfContext, MaterialBuilder};
use crate::choice::Choice;
use crate::formats::foreign::import::TableEntries;
use crate::formats::foreign::ior::{dielectric_ior, dielectric_names};
use crate::formats::foreign::spectra::equal_energy_emission_color;
use crate::formats::mitsuba::graph::PluginInstance;
use crate::formats::mitsuba::plastic::{PlasticCoat, remapped_reflectance};
use crate::formats::mitsuba::property::PropertyValue;
use crate::formats::mitsuba::reader::{ColorRole, ColorSource, NumberSource, SceneReader, luminance};
use crate::formats::mitsuba::settings::span_of;
use crate::formats::mitsuba::xml::truncate_for_message;
use crate::formats::rounding::{shorten_color, shorten_number, shorten_vector};
use crate::materials::conductor::elements::NamedConductor;
use crate::math::DVec3;
use crate::scene::SceneDocumentValue;
use crate::scene::nearest::nearest_name;

impl<'a> SceneReader<'a> {
    /// Reports a color scale that glimt lacks, unless it is 1.
    pub(super) fn ignored_scale(&mut self, object: &'a PluginInstance, name: &str) {
        let scale = self.color_or_texture(object, name, ColorRole::Reflectance, 1.0);
        if scale != ColorSource::Constant(DVec3::ONE) {
            let subject = format!("`{name}` of `{}`", truncate_for_message(&object.plugin));
            self.notes.note_lighting_substitution(&subject, "replaced by 1", span_of(object, name));
        }
    }

    /// Returns an index of refraction, which may be given as the name of a substance.
    pub(super) fn ior(&mut self, object: &'a PluginInstance, name: &str, default: f64) -> f64 {
        let Some(property) = object.property(name) else { return default };
        let PropertyValue::Text(substance) = &property.value else {
            return self.float(object, name).filter(|ior| *ior > 0.0).unwrap_or_else(|| {
                self.report_error(property.span.clone(), "the index of refraction must be above 0", None);
                default
            });
        };
        dielectric_ior(substance.trim()).unwrap_or_else(|| {
            let near = nearest_name(substance, dielectric_names());
            let help = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!(
                    "expected a number or one of {}",
                    dielectric_names().collect::<Vec<_>>().join(", ")
                ),
            };
            self.report_error(
                property.span.clone(),
                format!("unknown substance `{}`", truncate_for_message(substance)),
                Some(help),
            );
            default
        })
    }

    /// Interior index of refraction relative to the exterior.
    pub(super) fn relative_ior(&mut self, object: &'a PluginInstance, default: f64) -> f64 {
        let inside = self.ior(object, "int_ior", default);
        let outside = self.ior(object, "ext_ior", AIR);
        let ratio = inside / outside;
        if !(0.1..=10.0).contains(&ratio) {
            self.report_error(
                object.span.clone(),
                "the ratio of the indices of refraction must be between 0.1 and 10",
                None,
            );
        }
        ratio.clamp(0.1, 10.0)
    }

    /// Adds the keys of a microfacet distribution: `roughness`, `anisotropy` and `distribution`.
    pub(super) fn add_microfacet_keys(
        &mut self,
        keys: &mut TableEntries,
        object: &'a PluginInstance,
        default_alpha: f64,
        context: BsdfContext,
        may_be_anisotropic: bool,
    ) {
        self.add_distribution_name(keys, object);
        let has_pair = ["alpha_u", "alpha_v"]
            .iter()
            .any(|name| object.property(name).is_some() || object.named_child(name).is_some());
        if !has_pair {
            let alpha = self.number_or_texture(object, "alpha", default_alpha);
            let roughness = self.roughness_value(alpha, object, context);
            keys.push(("roughness", roughness));
            return;
        }
        let across = self.number_or_texture(object, "alpha_u", default_alpha);
        let along = self.number_or_texture(object, "alpha_v", default_alpha);
        match (across, along) {
            (NumberSource::Constant(u), NumberSource::Constant(v)) => {
                self.add_roughness_from_alphas(keys, object, [u, v], may_be_anisotropic);
            }
            (NumberSource::Texture(_) | NumberSource::Constant(_), _) => {
                let one = if matches!(across, NumberSource::Texture(_)) { across } else { along };
                let text = "one of them is used as isotropic roughness";
                self.notes.note_lighting_substitution(
                    "textured `alpha_u` and `alpha_v`",
                    text,
                    object.span.clone(),
                );
                let roughness = self.roughness_value(one, object, context);
                keys.push(("roughness", roughness));
            }
        }
    }

    /// Adds the key `distribution` of a microfacet distribution.
    pub(super) fn add_distribution_name(&mut self, keys: &mut TableEntries, object: &'a PluginInstance) {
        let name = self.text(object, "distribution");
        match name {
            None => keys.push(("distribution", "beckmann".into())),
            Some(("beckmann", _)) => keys.push(("distribution", "beckmann".into())),
            Some(("ggx", _)) => {}
            Some(("phong" | "as", span)) => {
                self.notes.note_substitution(
                    "the Phong microfacet distribution",
                    "replaced by Beckmann",
                    span,
                );
                keys.push(("distribution", "beckmann".into()));
            }
            Some((other, span)) => {
                let help = "expected beckmann or ggx".to_owned();
                self.report_error(
                    span,
                    format!("unknown distribution `{}`", truncate_for_message(other)),
                    Some(help),
                );
            }
        }
    }

    /// Converts α to glimt's roughness √α.
    pub(super) fn roughness_value(
        &mut self,
        alpha: NumberSource,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> SceneDocumentValue {
        match alpha {
            // Mitsuba clamps α to at least 1e-4.
            NumberSource::Constant(alpha) => shorten_number(libm::sqrt(alpha.clamp(1e-4, 1.0))).into(),
            NumberSource::Texture(texture) => match self.roughness_texture(texture, context.uv) {
                Some(value) => value,
                None => {
                    let color = self.color_if_spectrum(texture, ColorRole::Reflectance);
                    let alpha = color.map_or(0.1, luminance);
                    let _ = object;
                    shorten_number(libm::sqrt(alpha.clamp(1e-4, 1.0))).into()
                }
            },
        }
    }

    pub(super) fn conductor(
        &mut self,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> Option<MaterialBuilder> {
        let is_rough = object.plugin == "roughconductor";
        let material = self.text(object, "material");
        let has_eta = object.property("eta").is_some() || object.named_child("eta").is_some();
        // Without a material, version 0.6 uses copper, and later versions reflect all light.
        let reflects_all = match material {
            Some((name, _)) => name == "none",
            None => !object.is_old,
        };
        if !has_eta && reflects_all {
            let color = self.color_or_texture(object, "specular_reflectance", ColorRole::Reflectance, 1.0);
            let color = self.color_value(color, context, 1.0);
            if !is_rough {
                return Some(MaterialBuilder::one_sided("mirror", vec![("reflectance", color)]));
            }
            let mut keys = vec![("color", color)];
            if let Some(blend) = self.checkered_metal(&keys, object, context) {
                return Some(blend);
            }
            self.add_microfacet_keys(&mut keys, object, 0.1, context, true);
            return Some(MaterialBuilder::one_sided("metal", keys));
        }
        let mut keys = TableEntries::new();
        if has_eta {
            let eta = self.color_or_texture(object, "eta", ColorRole::Unbounded, 0.0);
            let k = self.color_or_texture(object, "k", ColorRole::Unbounded, 1.0);
            keys.push(("eta", self.color_value(eta, context, 1.0)));
            keys.push(("k", self.color_value(k, context, 1.0)));
        } else {
            let (name, span) = material.unwrap_or(("Cu", object.span.clone()));
            let plain = name.trim_end_matches("_palik");
            let known = NamedConductor::ALL.iter().find(|one| one.name().eq_ignore_ascii_case(plain));
            let Some(conductor) = known else {
                let near = nearest_name(name, NamedConductor::ALL.iter().map(|one| one.name()));
                let help = near.map(|near| format!("did you mean `{near}`?"));
                self.report_error(span, format!("unknown conductor `{}`", truncate_for_message(name)), help);
                return None;
            };
            // Mitsuba integrates η and k like emission spectra.
            let [eta, k] =
                conductor.complex_ior().map(|value| value.as_dvec3() * equal_energy_emission_color());
            keys.push(("eta", shorten_vector(eta).into()));
            keys.push(("k", shorten_vector(k).into()));
        }
        if let Some(outside) = object.property("ext_eta").map(|_| self.ior(object, "ext_eta", AIR))
            && (outside - AIR).abs() > 1e-3
        {
            self.notes.note_lighting_substitution(
                "`ext_eta` of a conductor",
                "replaced by air",
                span_of(object, "ext_eta"),
            );
        }
        let scale = self.color_or_texture(object, "specular_reflectance", ColorRole::Reflectance, 1.0);
        if is_rough
            && scale == ColorSource::Constant(DVec3::ONE)
            && let Some(blend) = self.checkered_metal(&keys, object, context)
        {
            return Some(blend);
        }
        if is_rough {
            self.add_microfacet_keys(&mut keys, object, 0.1, context, true);
        } else {
            keys.push(("roughness", 0.0.into()));
        }
        let metal = MaterialBuilder::one_sided("metal", keys);
        Some(self.scale_metal_by_blending(metal, scale, object, context))
    }

    /// Scales the reflectance of a metal by blending it with black, which is exact for a gray scale.
    pub(super) fn scale_metal_by_blending(
        &mut self,
        mut metal: MaterialBuilder,
        scale: ColorSource,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> MaterialBuilder {
        let weight = match scale {
            ColorSource::Constant(color) => {
                let color = color.clamp(DVec3::ZERO, DVec3::ONE);
                if color == DVec3::ONE {
                    return metal;
                }
                if color.max_element() - color.min_element() > 2e-3 {
                    let text = "replaced by its luminance";
                    self.notes.note_lighting_substitution(
                        "a colored `specular_reflectance`",
                        text,
                        span_of(object, "specular_reflectance"),
                    );
                }
                shorten_number(luminance(color).clamp(0.0, 1.0)).into()
            }
            ColorSource::Texture(texture) => match self.number_texture(texture, context.uv) {
                Some(value) => {
                    let text = "replaced by its luminance";
                    self.notes.note_lighting_substitution(
                        "a textured `specular_reflectance`",
                        text,
                        span_of(object, "specular_reflectance"),
                    );
                    value
                }
                None => return metal,
            },
        };
        metal.is_one_sided &= !context.is_two_sided;
        self.add_enclosing_keys(&mut metal, context);
        let is_enclosed = context.mask.is_some() || context.coat.is_some();
        let wanted = object.id.as_deref().unwrap_or(&object.plugin);
        let metal = self.add_material(metal, wanted, object.span.clone());
        let black = match &self.black {
            Some(black) if !is_enclosed => black.clone(),
            Some(_) | None => {
                let mut black = MaterialBuilder::new("phong", vec![("diffuse", 0.0.into())]);
                self.add_enclosing_keys(&mut black, context);
                let name = self.add_material(black, "black", object.span.clone());
                if !is_enclosed {
                    self.black = Some(name.clone());
                }
                name
            }
        };
        let materials = SceneDocumentValue::Array(vec![black.into(), metal.into()]);
        let keys = vec![("materials", materials), ("weight", weight)];
        MaterialBuilder { is_blend: true, ..MaterialBuilder::new("blend", keys) }
    }

    pub(super) fn dielectric(&mut self, object: &'a PluginInstance, context: BsdfContext) -> MaterialBuilder {
        let ior = self.relative_ior(object, 1.5046);
        let mut keys: TableEntries = vec![("ior", shorten_number(ior).into())];
        self.ignored_scale(object, "specular_reflectance");
        match object.plugin.as_str() {
            "thindielectric" => {
                keys.push(("thin", true.into()));
                let tint =
                    self.color_or_texture(object, "specular_transmittance", ColorRole::Reflectance, 1.0);
                if tint != ColorSource::Constant(DVec3::ONE) {
                    let value = self.color_value(tint, context, 1.0);
                    keys.push(("tint", value));
                }
            }
            "roughdielectric" => {
                self.ignored_scale(object, "specular_transmittance");
                self.add_microfacet_keys(&mut keys, object, 0.1, context, false);
            }
            _ => self.ignored_scale(object, "specular_transmittance"),
        }
        if let Some(tint) = self.interior_tint.filter(|_| object.plugin != "thindielectric") {
            keys.push(("tint", shorten_color(tint)));
        }
        MaterialBuilder { is_glass: true, ..MaterialBuilder::new("glass", keys) }
    }

    pub(super) fn plastic(&mut self, object: &'a PluginInstance, context: BsdfContext) -> MaterialBuilder {
        let ior = self.relative_ior(object, 1.49).max(1.0);
        let is_nonlinear = self.boolean(object, "nonlinear", false);
        let mut keys: TableEntries = vec![("ior", shorten_number(ior).into())];
        let alpha = if object.plugin == "roughplastic" {
            let (mut distribution, mut alpha) = (TableEntries::new(), 0.1);
            if let NumberSource::Constant(constant) = self.number_or_texture(object, "alpha", 0.1) {
                alpha = constant.clamp(1e-4, 1.0);
            }
            self.add_microfacet_keys(&mut distribution, object, 0.1, context, false);
            keys.extend(distribution);
            Some(alpha)
        } else {
            keys.push(("roughness", 0.0.into()));
            None
        };
        let is_beckmann = keys.iter().any(|(key, _)| *key == "distribution");
        let coat = self.cached_plastic_coat(ior, alpha, is_beckmann);
        match self.color_or_texture(object, "diffuse_reflectance", ColorRole::Reflectance, 0.5) {
            ColorSource::Constant(color) => {
                let remapped =
                    color.to_array().map(|kd| remapped_reflectance(kd.min(1.0), &coat, is_nonlinear));
                keys.push(("diffuse", shorten_color(remapped.into())));
            }
            ColorSource::Texture(texture) => {
                let factor = coat.texture_factor(is_nonlinear);
                let factor = if (factor - 1.0).abs() < 1e-6 { 1.0 } else { shorten_number(factor) };
                let value = self.color_value(ColorSource::Texture(texture), context, factor);
                keys.push(("diffuse", value));
                if !is_nonlinear {
                    keys.push(("nonlinear", false.into()));
                }
            }
        }
        let scale = self.color_or_texture(object, "specular_reflectance", ColorRole::Reflectance, 1.0);
        if scale != ColorSource::Constant(DVec3::ONE) {
            let value = self.color_value(scale, context, 1.0);
            keys.push(("specular", value));
        }
        MaterialBuilder::one_sided("plastic", keys)
    }

    /// Returns the integrals of a coat, cached by its parameters.
    pub(super) fn cached_plastic_coat(
        &mut self,
        ior: f64,
        alpha: Option<f64>,
        is_beckmann: bool,
    ) -> PlasticCoat {
        let key = (ior.to_bits(), alpha.map(f64::to_bits), is_beckmann);
        *self.plastic_coats.entry(key).or_insert_with(|| PlasticCoat::new(ior, alpha, is_beckmann))
    }

    pub(super) fn phong(&mut self, object: &'a PluginInstance, context: BsdfContext) -> MaterialBuilder {
        let diffuse = self.reflectance(object, "diffuse_reflectance", 0.5, context);
        let specular = self.reflectance(object, "specular_reflectance", 0.2, context);
        let exponent = match self.number_or_texture(object, "exponent", 30.0) {
            NumberSource::Constant(exponent) => exponent.clamp(0.0, 1e6),
            NumberSource::Texture(_) => {
                self.notes.note_lighting_substitution(
                    "a textured `exponent`",
                    "replaced by 30",
                    object.span.clone(),
                );
                30.0
            }
        };
        let keys = vec![
            ("diffuse", diffuse),
            ("specular", specular),
            ("shininess", shorten_number(exponent).into()),
        ];
        MaterialBuilder::one_sided("phong", keys)
    }

    pub(super) fn ward(&mut self, object: &'a PluginInstance, context: BsdfContext) -> MaterialBuilder {
        self.notes.note_lighting_substitution(
            "`ward`",
            "replaced by Phong with a highlight of the same width",
            object.span.clone(),
        );
        object.property("variant");
        let diffuse = self.reflectance(object, "diffuse_reflectance", 0.5, context);
        let specular = self.reflectance(object, "specular_reflectance", 0.2, context);
        let constant = |number: NumberSource| match number {
            NumberSource::Constant(alpha) => alpha.clamp(1e-3, 1.0),
            NumberSource::Texture(_) => 0.1,
        };
        let [u, v] = ["alpha_u", "alpha_v"].map(|name| constant(self.number_or_texture(object, name, 0.1)));
        let shininess = (2.0 / (u * v) - 2.0).clamp(0.0, 1e6);
        let keys = vec![
            ("diffuse", diffuse),
            ("specular", specular),
            ("shininess", shorten_number(shininess).into()),
        ];
        MaterialBuilder::one_sided("phong", keys)
    }

    pub(super) fn principled(&mut self, object: &'a PluginInstance, context: BsdfContext) -> MaterialBuilder {
        let mut keys: TableEntries = vec![("color", self.reflectance(object, "base_color", 0.5, context))];
        for (name, key, default) in
            [("metallic", "metallic", 0.0), ("roughness", "roughness", 0.5), ("clearcoat", "clearcoat", 0.0)]
        {
            let number = self.number_or_texture(object, name, default);
            let value = self.value_from_number_source(number, context);
            keys.push((key, value));
        }
        let gloss = match self.number_or_texture(object, "clearcoat_gloss", 0.0) {
            NumberSource::Constant(gloss) => gloss.clamp(0.0, 1.0),
            NumberSource::Texture(_) => 0.0,
        };
        // Disney's coat interpolates α from 0.1 to 0.001 with increasing gloss.
        let alpha = 0.1 + (0.001 - 0.1) * gloss;
        keys.push(("clearcoat_roughness", shorten_number(libm::sqrt(alpha)).into()));
        let ior = match (self.float(object, "eta"), self.float(object, "specular")) {
            (Some(eta), _) => eta,
            // The reflectance at normal incidence is 0.08 · specular.
            (None, specular) => {
                let root = libm::sqrt(0.08 * specular.unwrap_or(0.5).clamp(0.0, 1.0));
                2.0 / (1.0 - root) - 1.0
            }
        };
        keys.push(("ior", shorten_number(ior.clamp(1.0, 10.0)).into()));
        let has_sheen = self.number_or_texture(object, "sheen", 0.0) != NumberSource::Constant(0.0);
        for name in
            ["anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness", "diff_trans"]
        {
            let is_zero = matches!(self.number_or_texture(object, name, 0.0), NumberSource::Constant(0.0));
            // The tint of a sheen that is 0 has no effect.
            if !is_zero && (name != "sheen_tint" || has_sheen) {
                let subject = format!("`{name}` of `{}`", object.plugin);
                self.notes.note_lighting_substitution(&subject, "ignored", span_of(object, name));
            }
        }
        for name in [
            "main_specular_sampling_rate",
            "clearcoat_sampling_rate",
            "diffuse_reflectance_sampling_rate",
            "spec_sampling_rate",
        ] {
            object.property(name);
        }
        let has_coat = self.number_or_texture(object, "clearcoat", 0.0) != NumberSource::Constant(0.0);
        if has_coat {
            let text = "rendered with glimt's coat, which is up to 14 % darker";
            self.notes.note_lighting_substitution("`clearcoat` of `principled`", text, object.span.clone());
        }
        // Pure metals match Mitsuba's.
        if self.number_or_texture(object, "metallic", 0.0) != NumberSource::Constant(1.0) {
            let text = "about 2 % darker, because glimt's diffuse lobe is under a dielectric coat";
            self.notes.note("`principled`", text, object.span.clone());
        }
        MaterialBuilder::one_sided("principled", keys)
    }
}
