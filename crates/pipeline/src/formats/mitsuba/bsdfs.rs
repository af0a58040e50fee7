//! Converts BSDFs to materials.

use super::graph::{Child, Object, ObjectIndex, ObjectKind, PropertyValue};
use super::plastic::{PlasticCoat, remapped_reflectance};
use super::reader::{ColorRole, ColorSource, Entries, NumberSource, SceneReader, luminance};
use super::settings::span_of;
use super::textures::{TextureUse, UvConvention};
use super::xml::shorten;
use crate::choice::Choice;
use crate::formats::foreign::ior::{dielectric_ior, dielectric_names};
use crate::formats::foreign::spectra::flat_emission_color;
use crate::formats::rounding::{shorten as shorten_number, shorten_color, shorten_vector};
use crate::materials::conductor::elements::NamedConductor;
use crate::math::DVec3;
use crate::scene::BuiltValue;
use crate::scene::nearest::nearest_name;

/// Index of refraction of air, Mitsuba's usual exterior.
const AIR: f64 = 1.000_277;

/// Plugins that are BSDFs in Mitsuba 3, 2 or 0.6.
const KNOWN_BSDFS: [&str; 26] = [
    "diffuse", "roughdiffuse", "conductor", "roughconductor", "dielectric", "thindielectric", "roughdielectric",
    "plastic", "roughplastic", "twosided", "mask", "blendbsdf", "mixturebsdf", "bumpmap", "normalmap", "phong",
    "ward", "coating", "roughcoating", "principled", "principledthin", "null", "difftrans", "hk", "irawan", "measured",
];

/// What a material of the document depends on.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct MaterialKey {
    /// The BSDF, or `None` for the default one.
    pub(super) bsdf: Option<ObjectIndex>,
    /// The area light of the shape.
    pub(super) emitter: Option<ObjectIndex>,
    /// Texture coordinates of the shape. The same for all shapes if the material has no textures.
    pub(super) uv: UvConvention,
}

/// Context of a nested BSDF.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfContext {
    uv: UvConvention,
    /// Whether a `twosided` contains the BSDF.
    is_two_sided: bool,
    /// The `mask` that contains the BSDF.
    mask: Option<ObjectIndex>,
    depth: u32,
}

/// A material that is being built.
#[derive(Debug, Default)]
pub(super) struct MaterialBuilder {
    /// The keys, including `type`.
    keys: Entries,
    /// Whether the surface is an index-matched boundary that has no effect.
    is_invisible: bool,
    /// Whether the material transmits light as glass.
    is_glass: bool,
    is_blend: bool,
    /// Whether the back of the surface is black.
    is_one_sided: bool,
    /// Whether the surface has a smooth conductor or a smooth dielectric coat.
    has_smooth_reflection: bool,
}

impl MaterialBuilder {
    fn new(kind: &'static str, keys: Entries) -> Self {
        let keys = std::iter::once(("type", kind.into())).chain(keys).collect();
        Self { keys, ..Self::default() }
    }

    /// A material whose back is black unless a `twosided` contains it.
    fn one_sided(kind: &'static str, keys: Entries) -> Self {
        Self { is_one_sided: true, ..Self::new(kind, keys) }
    }

    fn has(&self, key: &str) -> bool {
        self.keys.iter().any(|(known, _)| *known == key)
    }
}

/// Maximum depth of nested BSDFs.
const MAX_DEPTH: u32 = 32;

impl<'a> SceneReader<'a> {
    /// Returns the name of a shape's material, adding it if it is new. Returns `None` if the surface is
    /// invisible or has errors.
    pub(super) fn material(
        &mut self,
        bsdf: Option<&'a Child>,
        emitter: Option<ObjectIndex>,
        uv: UvConvention,
        shape: &'a Object,
    ) -> Option<String> {
        let index = bsdf.map(|child| child.target);
        let has_textures = index.into_iter().chain(emitter).any(|index| self.has_textures(index));
        let uv = if has_textures { uv } else { UvConvention::default() };
        let key = MaterialKey { bsdf: index, emitter, uv };
        if let Some(known) = self.materials.get(&key) {
            return known.clone();
        }
        let context = BsdfContext { uv, is_two_sided: false, mask: None, depth: 0 };
        let builder = match bsdf {
            Some(child) => self.bsdf(child.target, context),
            None => Some(MaterialBuilder::one_sided("phong", vec![("diffuse", 0.5.into())])),
        };
        let span = bsdf.map_or(shape.span.clone(), |child| self.object(child.target).span.clone());
        let name = builder.and_then(|mut builder| {
            if let Some(emitter) = emitter {
                self.add_emission(&mut builder, emitter, uv, shape);
            } else if builder.is_invisible {
                return None;
            }
            let wanted = bsdf.map(|child| self.object(child.target));
            let wanted = wanted.map_or("default", |object| object.id.as_deref().unwrap_or(&object.plugin));
            Some(self.add_material(builder, wanted, span))
        });
        self.materials.insert(key, name.clone());
        name
    }

    /// Adds a material to the document and returns its name.
    fn add_material(&mut self, builder: MaterialBuilder, wanted: &str, span: std::ops::Range<usize>) -> String {
        let name = self.material_names.make_unique(wanted, "material");
        self.document.at(span);
        self.document.named_table("materials", &name);
        let is_one_sided = builder.is_one_sided && !builder.is_glass && !builder.is_blend;
        self.set_all(builder.keys);
        if is_one_sided {
            self.document.set("sides", "front");
        }
        name
    }

    /// Whether an object or an object in it is a texture.
    fn has_textures(&self, index: ObjectIndex) -> bool {
        let mut pending = vec![index];
        let mut visited = 0;
        while let Some(index) = pending.pop() {
            let object = self.object(index);
            if object.kind == ObjectKind::Texture {
                return true;
            }
            visited += 1;
            if visited > 10_000 {
                return true;
            }
            pending.extend(object.children.iter().map(|child| child.target));
        }
        false
    }

    /// Adds the emission of an area light.
    fn add_emission(&mut self, builder: &mut MaterialBuilder, emitter: ObjectIndex, uv: UvConvention, shape: &'a Object) {
        let emitter = self.object(emitter);
        if builder.is_blend {
            let text = "the shape does not emit";
            self.notes.substitute_light("an area light on a `blendbsdf`", text, shape.span.clone());
            return;
        }
        if builder.is_invisible {
            // A surface that only emits.
            *builder = MaterialBuilder::one_sided("phong", vec![("diffuse", 0.0.into())]);
        }
        match self.color(emitter, "radiance", ColorRole::Emission, 1.0) {
            ColorSource::Constant(color) => {
                if color != DVec3::ZERO {
                    builder.keys.push(("emission", shorten_color(color)));
                }
            }
            ColorSource::Texture(texture) => match self.texture(texture, TextureUse::Color, uv) {
                Some(name) => {
                    builder.keys.push(("emission", BuiltValue::Table(vec![("texture", name.into())])));
                }
                None => {
                    let color = self.constant_of_texture(texture, ColorRole::Emission);
                    builder.keys.push(("emission", shorten_color(color.unwrap_or(DVec3::ONE))));
                }
            },
        }
    }

    /// Converts a BSDF. Returns `None` after an error.
    fn bsdf(&mut self, index: ObjectIndex, context: BsdfContext) -> Option<MaterialBuilder> {
        let object = self.object(index);
        if context.depth > MAX_DEPTH {
            self.error(object.span.clone(), "BSDFs are nested too deeply", None);
            return None;
        }
        let context = BsdfContext { depth: context.depth + 1, ..context };
        let built = match object.plugin.as_str() {
            "diffuse" | "lambertian" => {
                let color = self.reflectance(object, "reflectance", 0.5, context);
                Some(MaterialBuilder::one_sided("phong", vec![("diffuse", color)]))
            }
            "roughdiffuse" => {
                let color = self.reflectance(object, "reflectance", 0.5, context);
                object.property("use_fast_approx");
                object.property("alpha");
                self.notes.substitute_light("`roughdiffuse`", "replaced by `diffuse`", object.span.clone());
                Some(MaterialBuilder::one_sided("phong", vec![("diffuse", color)]))
            }
            "conductor" | "roughconductor" => self.conductor(object, context),
            "dielectric" | "roughdielectric" | "thindielectric" => Some(self.dielectric(object, context)),
            "plastic" | "roughplastic" => Some(self.plastic(object, context)),
            "phong" => Some(self.phong(object, context)),
            "ward" => Some(self.ward(object, context)),
            "coating" | "roughcoating" => self.coating(object, context),
            "twosided" => self.two_sided(object, context),
            "mask" => self.mask(index, context),
            "blendbsdf" | "mixturebsdf" => self.blend(object, context),
            "bumpmap" | "bump" => self.bump_map(object, context),
            "normalmap" => self.normal_map(object, context),
            "principled" => Some(self.principled(object, context)),
            "principledthin" => {
                self.notes.substitute_light("`principledthin`", "rendered like `principled`", object.span.clone());
                Some(self.principled(object, context))
            }
            "difftrans" => {
                let color = self.reflectance(object, "transmittance", 0.5, context);
                let keys = vec![("diffuse", 0.0.into()), ("diffuse_transmission", color)];
                Some(MaterialBuilder::new("phong", keys))
            }
            "null" => Some(MaterialBuilder { is_invisible: true, ..MaterialBuilder::default() }),
            "hair" => return self.refused(object, "hair"),
            "pplastic" | "polarizer" | "retarder" | "circular" | "measured_polarized" => {
                return self.refused(object, "polarization");
            }
            "measured" => return self.refused(object, "measured BSDFs"),
            "hk" | "irawan" => return self.refused(object, "this BSDF"),
            _ => {
                self.unknown_plugin(object, "BSDF", &KNOWN_BSDFS);
                None
            }
        };
        self.report_unused(index);
        let is_smooth = matches!(object.plugin.as_str(), "conductor" | "dielectric" | "thindielectric" | "plastic");
        built.map(|built| MaterialBuilder { has_smooth_reflection: built.has_smooth_reflection || is_smooth, ..built })
    }

    fn refused(&mut self, object: &Object, what: &str) -> Option<MaterialBuilder> {
        self.refuse(object, what);
        None
    }

    /// Converts a reflectance or transmittance to the value of a color key.
    fn reflectance(&mut self, object: &'a Object, name: &str, default: f64, context: BsdfContext) -> BuiltValue {
        let color = self.color(object, name, ColorRole::Reflectance, default);
        self.color_value(color, context, 1.0)
    }

    /// Converts a color or texture to the value of a color key, times `factor`.
    fn color_value(&mut self, color: ColorSource, context: BsdfContext, factor: f64) -> BuiltValue {
        match color {
            ColorSource::Constant(color) => shorten_color(color * factor),
            ColorSource::Texture(texture) => {
                match self.texture_with_factor(texture, TextureUse::Color, context.uv, factor) {
                    Some(name) => BuiltValue::Table(vec![("texture", name.into())]),
                    None => {
                        let color = self.constant_of_texture(texture, ColorRole::Reflectance);
                        shorten_color(color.unwrap_or(DVec3::splat(0.5)) * factor)
                    }
                }
            }
        }
    }

    /// Converts a number or texture to the value of a number key.
    fn number_value(&mut self, number: NumberSource, context: BsdfContext) -> BuiltValue {
        match number {
            NumberSource::Constant(number) => shorten_number(number.clamp(0.0, 1.0)).into(),
            NumberSource::Texture(texture) => match self.number_texture(texture, context.uv) {
                Some(value) => value,
                None => {
                    let color = self.constant_of_texture(texture, ColorRole::Reflectance);
                    shorten_number(color.map_or(0.5, luminance).clamp(0.0, 1.0)).into()
                }
            },
        }
    }

    /// Returns a color scale that glimt lacks, unless it is 1.
    fn ignored_scale(&mut self, object: &'a Object, name: &str) {
        let scale = self.color(object, name, ColorRole::Reflectance, 1.0);
        if scale != ColorSource::Constant(DVec3::ONE) {
            let subject = format!("`{name}` of `{}`", shorten(&object.plugin));
            self.notes.substitute_light(&subject, "replaced by 1", span_of(object, name));
        }
    }

    /// Returns an index of refraction, which may be the name of a substance.
    fn ior(&mut self, object: &'a Object, name: &str, default: f64) -> f64 {
        let Some(property) = object.property(name) else { return default };
        let PropertyValue::Text(substance) = &property.value else {
            return self.float(object, name).filter(|ior| *ior > 0.0).unwrap_or_else(|| {
                self.error(property.span.clone(), "the index of refraction must be above 0", None);
                default
            });
        };
        dielectric_ior(substance.trim()).unwrap_or_else(|| {
            let near = nearest_name(substance, dielectric_names());
            let help = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("expected a number or one of {}", dielectric_names().collect::<Vec<_>>().join(", ")),
            };
            self.error(property.span.clone(), format!("unknown substance `{}`", shorten(substance)), Some(help));
            default
        })
    }

    /// Index of refraction of the inside relative to the outside.
    fn relative_ior(&mut self, object: &'a Object, default: f64) -> f64 {
        let inside = self.ior(object, "int_ior", default);
        let outside = self.ior(object, "ext_ior", AIR);
        let ratio = inside / outside;
        if !(0.1..=10.0).contains(&ratio) {
            self.error(object.span.clone(), "the ratio of the indices of refraction must be between 0.1 and 10", None);
        }
        ratio.clamp(0.1, 10.0)
    }

    /// Adds the keys of a microfacet distribution: `roughness`, `anisotropy` and `distribution`.
    fn add_distribution(&mut self, keys: &mut Entries, object: &'a Object, default_alpha: f64, context: BsdfContext, may_be_anisotropic: bool) {
        let name = self.text(object, "distribution");
        match name {
            None => keys.push(("distribution", "beckmann".into())),
            Some(("beckmann", _)) => keys.push(("distribution", "beckmann".into())),
            Some(("ggx", _)) => {}
            Some(("phong" | "as", span)) => {
                self.notes.substitute("the Phong microfacet distribution", "replaced by Beckmann", span);
                keys.push(("distribution", "beckmann".into()));
            }
            Some((other, span)) => {
                let help = "expected beckmann or ggx".to_owned();
                self.error(span, format!("unknown distribution `{}`", shorten(other)), Some(help));
            }
        }
        let has_pair = ["alpha_u", "alpha_v"].iter().any(|name| object.property(name).is_some() || object.named_child(name).is_some());
        if !has_pair {
            let alpha = self.number(object, "alpha", default_alpha);
            let roughness = self.roughness_value(alpha, object, context);
            keys.push(("roughness", roughness));
            return;
        }
        let across = self.number(object, "alpha_u", default_alpha);
        let along = self.number(object, "alpha_v", default_alpha);
        match (across, along) {
            (NumberSource::Constant(u), NumberSource::Constant(v)) => {
                let (u, v) = (u.clamp(1e-4, 1.0), v.clamp(1e-4, 1.0));
                keys.push(("roughness", shorten_number(libm::sqrt(libm::sqrt(u * v))).into()));
                let ratio = if v > u { u / v } else { v / u };
                let anisotropy = (1.0 - ratio) / 0.9;
                if anisotropy > 1.0 {
                    let text = "the ratio is limited to 10";
                    self.notes.substitute("`alpha_u` and `alpha_v` that differ by more than a factor of 10", text, object.span.clone());
                }
                let signed = if v > u { -anisotropy } else { anisotropy };
                if may_be_anisotropic && signed != 0.0 {
                    keys.push(("anisotropy", shorten_number(signed.clamp(-1.0, 1.0)).into()));
                } else if signed != 0.0 {
                    self.notes.substitute_light("anisotropic roughness of glass", "replaced by its mean", object.span.clone());
                }
            }
            (NumberSource::Texture(_) | NumberSource::Constant(_), _) => {
                let one = if matches!(across, NumberSource::Texture(_)) { across } else { along };
                let text = "the roughness is isotropic";
                self.notes.substitute_light("textures of `alpha_u` and `alpha_v`", text, object.span.clone());
                let roughness = self.roughness_value(one, object, context);
                keys.push(("roughness", roughness));
            }
        }
    }

    /// Converts α to glimt's roughness √α.
    fn roughness_value(&mut self, alpha: NumberSource, object: &'a Object, context: BsdfContext) -> BuiltValue {
        match alpha {
            // Mitsuba limits α to at least 1e-4.
            NumberSource::Constant(alpha) => shorten_number(libm::sqrt(alpha.clamp(1e-4, 1.0))).into(),
            NumberSource::Texture(texture) => match self.roughness_texture(texture, context.uv) {
                Some(value) => value,
                None => {
                    let color = self.constant_of_texture(texture, ColorRole::Reflectance);
                    let alpha = color.map_or(0.1, luminance);
                    let _ = object;
                    shorten_number(libm::sqrt(alpha.clamp(1e-4, 1.0))).into()
                }
            },
        }
    }

    fn conductor(&mut self, object: &'a Object, context: BsdfContext) -> Option<MaterialBuilder> {
        let is_rough = object.plugin == "roughconductor";
        let material = self.text(object, "material");
        let has_eta = object.property("eta").is_some() || object.named_child("eta").is_some();
        // Without a material, version 0.6 uses copper, and later versions reflect all light.
        let reflects_all = match material {
            Some((name, _)) => name == "none",
            None => !object.is_old,
        };
        if !has_eta && reflects_all {
            let color = self.color(object, "specular_reflectance", ColorRole::Reflectance, 1.0);
            let color = self.color_value(color, context, 1.0);
            if !is_rough {
                return Some(MaterialBuilder::one_sided("mirror", vec![("reflectance", color)]));
            }
            let mut keys = vec![("color", color)];
            self.add_distribution(&mut keys, object, 0.1, context, true);
            return Some(MaterialBuilder::one_sided("metal", keys));
        }
        let mut keys = Entries::new();
        if has_eta {
            let eta = self.color(object, "eta", ColorRole::Unbounded, 0.0);
            let k = self.color(object, "k", ColorRole::Unbounded, 1.0);
            keys.push(("eta", self.color_value(eta, context, 1.0)));
            keys.push(("k", self.color_value(k, context, 1.0)));
        } else {
            let (name, span) = material.unwrap_or(("Cu", object.span.clone()));
            let plain = name.trim_end_matches("_palik");
            let known = NamedConductor::ALL.iter().find(|one| one.name().eq_ignore_ascii_case(plain));
            let Some(conductor) = known else {
                let near = nearest_name(name, NamedConductor::ALL.iter().map(|one| one.name()));
                let help = near.map(|near| format!("did you mean `{near}`?"));
                self.error(span, format!("unknown conductor `{}`", shorten(name)), help);
                return None;
            };
            // Mitsuba integrates η and k like emission spectra.
            let [eta, k] = conductor.complex_ior().map(|value| value.as_dvec3() * flat_emission_color());
            keys.push(("eta", shorten_vector(eta).into()));
            keys.push(("k", shorten_vector(k).into()));
        }
        if let Some(outside) = object.property("ext_eta").map(|_| self.ior(object, "ext_eta", AIR))
            && (outside - AIR).abs() > 1e-3
        {
            self.notes.substitute_light("`ext_eta` of a conductor", "replaced by air", span_of(object, "ext_eta"));
        }
        if is_rough {
            self.add_distribution(&mut keys, object, 0.1, context, true);
        } else {
            keys.push(("roughness", 0.0.into()));
        }
        let metal = MaterialBuilder::one_sided("metal", keys);
        let scale = self.color(object, "specular_reflectance", ColorRole::Reflectance, 1.0);
        Some(self.scaled_metal(metal, scale, object, context))
    }

    /// Scales the reflectance of a metal: a blend with a black material, which is exact for a gray scale.
    fn scaled_metal(
        &mut self,
        mut metal: MaterialBuilder,
        scale: ColorSource,
        object: &'a Object,
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
                    self.notes.substitute_light("a colored `specular_reflectance`", text, span_of(object, "specular_reflectance"));
                }
                shorten_number(luminance(color).clamp(0.0, 1.0)).into()
            }
            ColorSource::Texture(texture) => match self.number_texture(texture, context.uv) {
                Some(value) => {
                    let text = "replaced by its luminance";
                    self.notes.substitute_light("a texture of `specular_reflectance`", text, span_of(object, "specular_reflectance"));
                    value
                }
                None => return metal,
            },
        };
        metal.is_one_sided &= !context.is_two_sided;
        if context.mask.is_some() {
            self.add_opacity(&mut metal, context);
        }
        let wanted = object.id.as_deref().unwrap_or(&object.plugin);
        let metal = self.add_material(metal, wanted, object.span.clone());
        let black = match &self.black {
            Some(black) if context.mask.is_none() => black.clone(),
            Some(_) | None => {
                let mut black = MaterialBuilder::new("phong", vec![("diffuse", 0.0.into())]);
                if context.mask.is_some() {
                    self.add_opacity(&mut black, context);
                }
                let name = self.add_material(black, "black", object.span.clone());
                if context.mask.is_none() {
                    self.black = Some(name.clone());
                }
                name
            }
        };
        let materials = BuiltValue::Array(vec![black.into(), metal.into()]);
        let keys = vec![("materials", materials), ("weight", weight)];
        MaterialBuilder { is_blend: true, ..MaterialBuilder::new("blend", keys) }
    }

    fn dielectric(&mut self, object: &'a Object, context: BsdfContext) -> MaterialBuilder {
        let ior = self.relative_ior(object, 1.5046);
        let mut keys: Entries = vec![("ior", shorten_number(ior).into())];
        self.ignored_scale(object, "specular_reflectance");
        match object.plugin.as_str() {
            "thindielectric" => {
                keys.push(("thin", true.into()));
                let tint = self.color(object, "specular_transmittance", ColorRole::Reflectance, 1.0);
                if tint != ColorSource::Constant(DVec3::ONE) {
                    let value = self.color_value(tint, context, 1.0);
                    keys.push(("tint", value));
                }
            }
            "roughdielectric" => {
                self.ignored_scale(object, "specular_transmittance");
                self.add_distribution(&mut keys, object, 0.1, context, false);
            }
            _ => self.ignored_scale(object, "specular_transmittance"),
        }
        MaterialBuilder { is_glass: true, ..MaterialBuilder::new("glass", keys) }
    }

    fn plastic(&mut self, object: &'a Object, context: BsdfContext) -> MaterialBuilder {
        let ior = self.relative_ior(object, 1.49).max(1.0);
        let is_nonlinear = self.boolean(object, "nonlinear", false);
        let mut keys: Entries = vec![("ior", shorten_number(ior).into())];
        let alpha = if object.plugin == "roughplastic" {
            let (mut distribution, mut alpha) = (Entries::new(), 0.1);
            if let NumberSource::Constant(constant) = self.number(object, "alpha", 0.1) {
                alpha = constant.clamp(1e-4, 1.0);
            }
            self.add_distribution(&mut distribution, object, 0.1, context, false);
            keys.extend(distribution);
            Some(alpha)
        } else {
            keys.push(("roughness", 0.0.into()));
            None
        };
        let is_beckmann = keys.iter().any(|(key, _)| *key == "distribution");
        let coat = self.plastic_coat(ior, alpha, is_beckmann);
        match self.color(object, "diffuse_reflectance", ColorRole::Reflectance, 0.5) {
            ColorSource::Constant(color) => {
                let remapped = color.to_array().map(|kd| remapped_reflectance(kd.min(1.0), &coat, is_nonlinear));
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
        let scale = self.color(object, "specular_reflectance", ColorRole::Reflectance, 1.0);
        if scale != ColorSource::Constant(DVec3::ONE) {
            let value = self.color_value(scale, context, 1.0);
            keys.push(("specular", value));
        }
        MaterialBuilder::one_sided("plastic", keys)
    }

    /// Returns the coat's integrals, which are computed once per kind.
    fn plastic_coat(&mut self, ior: f64, alpha: Option<f64>, is_beckmann: bool) -> PlasticCoat {
        let key = (ior.to_bits(), alpha.map(f64::to_bits), is_beckmann);
        *self.plastic_coats.entry(key).or_insert_with(|| PlasticCoat::new(ior, alpha, is_beckmann))
    }

    fn phong(&mut self, object: &'a Object, context: BsdfContext) -> MaterialBuilder {
        let diffuse = self.reflectance(object, "diffuse_reflectance", 0.5, context);
        let specular = self.reflectance(object, "specular_reflectance", 0.2, context);
        let exponent = match self.number(object, "exponent", 30.0) {
            NumberSource::Constant(exponent) => exponent.clamp(0.0, 1e6),
            NumberSource::Texture(_) => {
                self.notes.substitute_light("a texture of `exponent`", "replaced by 30", object.span.clone());
                30.0
            }
        };
        let keys = vec![("diffuse", diffuse), ("specular", specular), ("shininess", shorten_number(exponent).into())];
        MaterialBuilder::one_sided("phong", keys)
    }

    fn ward(&mut self, object: &'a Object, context: BsdfContext) -> MaterialBuilder {
        self.notes.substitute_light("`ward`", "replaced by Phong with a highlight of the same width", object.span.clone());
        object.property("variant");
        let diffuse = self.reflectance(object, "diffuse_reflectance", 0.5, context);
        let specular = self.reflectance(object, "specular_reflectance", 0.2, context);
        let constant = |number: NumberSource| match number {
            NumberSource::Constant(alpha) => alpha.clamp(1e-3, 1.0),
            NumberSource::Texture(_) => 0.1,
        };
        let [u, v] = ["alpha_u", "alpha_v"].map(|name| constant(self.number(object, name, 0.1)));
        let shininess = (2.0 / (u * v) - 2.0).clamp(0.0, 1e6);
        let keys = vec![("diffuse", diffuse), ("specular", specular), ("shininess", shorten_number(shininess).into())];
        MaterialBuilder::one_sided("phong", keys)
    }

    /// Returns the single nested BSDF.
    fn nested_bsdf(&mut self, object: &'a Object) -> Option<&'a Child> {
        let nested = self.children_of_kind(object, ObjectKind::Bsdf).next();
        if nested.is_none() {
            let message = format!("`{}` needs a nested BSDF", shorten(&object.plugin));
            self.error(object.span.clone(), message, None);
        }
        nested
    }

    fn two_sided(&mut self, object: &'a Object, context: BsdfContext) -> Option<MaterialBuilder> {
        let nested = self.nested_bsdf(object)?;
        if let Some(second) = self.children_of_kind(object, ObjectKind::Bsdf).nth(1)
            && second.target != nested.target
        {
            let text = "the first BSDF is on both sides";
            self.notes.substitute_light("`twosided` with two BSDFs", text, object.span.clone());
        }
        let context = BsdfContext { is_two_sided: true, ..context };
        let built = self.bsdf(nested.target, context)?;
        Some(MaterialBuilder { is_one_sided: false, ..built })
    }

    fn mask(&mut self, index: ObjectIndex, context: BsdfContext) -> Option<MaterialBuilder> {
        let object = self.object(index);
        let nested = self.nested_bsdf(object)?;
        let opacity = self.number(object, "opacity", 0.5);
        if opacity == NumberSource::Constant(1.0) {
            return self.bsdf(nested.target, context);
        }
        if context.mask.is_some() {
            let text = "the inner mask is ignored";
            self.notes.substitute_light("`mask` around another mask", text, object.span.clone());
            return self.bsdf(nested.target, context);
        }
        let context = BsdfContext { mask: Some(index), ..context };
        let mut built = self.bsdf(nested.target, context)?;
        // The materials of a blend have the opacity already.
        if !built.is_invisible && !built.is_blend {
            self.add_opacity(&mut built, context);
        }
        Some(built)
    }

    /// Adds the opacity of the mask that contains a material.
    fn add_opacity(&mut self, built: &mut MaterialBuilder, context: BsdfContext) {
        let Some(object) = context.mask.map(|index| self.object(index)) else { return };
        if built.is_glass && !built.has("thin") || built.has("opacity") {
            let text = "the mask is ignored";
            self.notes.substitute_light("`mask` around solid glass", text, object.span.clone());
            return;
        }
        let text = "they let light from point, spot and directional lights through, which Mitsuba blocks";
        self.notes.note("masks", text, object.span.clone());
        let opacity = self.number(object, "opacity", 0.5);
        let value = self.number_value(opacity, context);
        built.keys.push(("opacity", value));
    }

    fn blend(&mut self, object: &'a Object, context: BsdfContext) -> Option<MaterialBuilder> {
        let nested: Vec<&Child> = self.children_of_kind(object, ObjectKind::Bsdf).collect();
        if object.plugin == "mixturebsdf" {
            object.property("weights");
            self.refuse(object, "mixtures of BSDFs; use `blendbsdf`");
            return None;
        }
        let [first, second] = nested[..] else {
            let message = format!("`blendbsdf` needs two nested BSDFs, found {}", nested.len());
            self.error(object.span.clone(), message, None);
            return None;
        };
        let weight = self.number(object, "weight", 0.5);
        let weight = self.number_value(weight, context);
        let mut names = Vec::new();
        for child in [first, second] {
            let mut built = self.bsdf(child.target, context)?;
            let inner = self.object(child.target);
            if built.is_glass && !built.has("thin") {
                self.refuse(object, "blends that contain solid glass");
                return None;
            }
            if built.is_invisible {
                // A surface without effect is transparent.
                built = MaterialBuilder::new("phong", vec![("diffuse", 0.0.into()), ("opacity", 0.0.into())]);
            }
            if built.has_smooth_reflection {
                let text = "glimt blends their light by the weight; Mitsuba mixes up their pdfs";
                self.notes.note("smooth metal, glass or plastic in a blend", text, object.span.clone());
            }
            built.is_one_sided &= !context.is_two_sided;
            if context.mask.is_some() && !built.is_blend {
                self.add_opacity(&mut built, context);
            }
            let wanted = inner.id.as_deref().unwrap_or(&inner.plugin);
            names.push(BuiltValue::from(self.add_material(built, wanted, inner.span.clone())));
        }
        let keys = vec![("materials", BuiltValue::Array(names)), ("weight", weight)];
        Some(MaterialBuilder { is_blend: true, ..MaterialBuilder::new("blend", keys) })
    }

    fn coating(&mut self, object: &'a Object, context: BsdfContext) -> Option<MaterialBuilder> {
        let nested = self.nested_bsdf(object)?;
        let ior = self.relative_ior(object, 1.5046).max(1.0);
        let thickness = self.float(object, "thickness").unwrap_or(1.0);
        let absorption = self.color(object, "sigma_a", ColorRole::Unbounded, 0.0);
        self.ignored_scale(object, "specular_reflectance");
        let roughness = match object.plugin.as_str() {
            "roughcoating" => {
                let mut keys = Entries::new();
                self.add_distribution(&mut keys, object, 0.1, context, false);
                keys.into_iter().find(|(key, _)| *key == "roughness").map_or(0.3.into(), |(_, value)| value)
            }
            _ => 0.0.into(),
        };
        let mut built = self.bsdf(nested.target, context)?;
        if built.is_glass || built.is_blend || built.is_invisible || built.has("coat") {
            let text = "the coat is left out";
            self.notes.substitute_light("a coat on glass, a blend or another coat", text, object.span.clone());
            return Some(built);
        }
        let text = "the interreflections between the coat and the base differ";
        self.notes.note(&format!("`{}`", object.plugin), text, object.span.clone());
        built.keys.push(("coat", 1.0.into()));
        built.keys.push(("coat_roughness", roughness));
        built.keys.push(("coat_ior", shorten_number(ior).into()));
        match absorption {
            ColorSource::Constant(sigma) if sigma != DVec3::ZERO => {
                // The light passes through the layer twice.
                let tint = sigma.to_array().map(|sigma| libm::exp(-2.0 * thickness * sigma).clamp(0.0, 1.0));
                built.keys.push(("coat_tint", shorten_color(tint.into())));
            }
            ColorSource::Constant(_) => {}
            ColorSource::Texture(_) => {
                self.notes.substitute_light("a texture of `sigma_a`", "replaced by 0", object.span.clone());
            }
        }
        Some(built)
    }

    /// Returns the nested texture of a bump or normal map.
    fn nested_texture(&mut self, object: &'a Object) -> Option<ObjectIndex> {
        let texture = self.children_of_kind(object, ObjectKind::Texture).next();
        if texture.is_none() {
            let message = format!("`{}` needs a nested texture", shorten(&object.plugin));
            self.error(object.span.clone(), message, None);
        }
        texture.map(|child| child.target)
    }

    fn bump_map(&mut self, object: &'a Object, context: BsdfContext) -> Option<MaterialBuilder> {
        let nested = self.nested_bsdf(object)?;
        let texture = self.nested_texture(object)?;
        let mut scale = self.float(object, "scale").unwrap_or(1.0);
        // Version 0.6 scales the texture with a `scale` texture.
        let mut texture = texture;
        while self.object(texture).plugin == "scale" {
            let outer = self.object(texture);
            scale *= self.float(outer, "scale").or_else(|| self.float(outer, "value")).unwrap_or(1.0);
            let Some(inner) = self.children_of_kind(outer, ObjectKind::Texture).next() else { break };
            texture = inner.target;
        }
        let mut built = self.bsdf(nested.target, context)?;
        if built.is_blend || built.is_invisible || built.has("bump") {
            let text = "the bump map is left out";
            self.notes.substitute_light("`bumpmap` around a blend or another bump map", text, object.span.clone());
            return Some(built);
        }
        if let Some(value) = self.height_texture(texture, context.uv) {
            built.keys.push(("bump", value));
            built.keys.push(("bump_scale", shorten_number(scale).into()));
            let text = "light fades as the normal tilts: 2 % darker at 7 degrees";
            self.notes.note("bump and normal maps", text, object.span.clone());
        }
        Some(built)
    }

    fn normal_map(&mut self, object: &'a Object, context: BsdfContext) -> Option<MaterialBuilder> {
        let nested = self.nested_bsdf(object)?;
        if let Some(constant) = object.named_child("normalmap").map(|child| self.object(child.target))
            && constant.plugin == "rawconstant"
        {
            self.note_constant_normal_map(constant);
            return self.bsdf(nested.target, context);
        }
        let texture = self.nested_texture(object)?;
        for name in ["flip_invalid_normals", "use_shadowing_function"] {
            object.property(name);
        }
        let mut built = self.bsdf(nested.target, context)?;
        if built.is_blend || built.is_invisible || built.has("normal_map") {
            let text = "the normal map is left out";
            self.notes.substitute_light("`normalmap` around a blend or another normal map", text, object.span.clone());
            return Some(built);
        }
        if let Some(name) = self.texture(texture, TextureUse::Normal, context.uv) {
            built.keys.push(("normal_map", name.into()));
            let text = "light fades as the normal tilts: 2 % darker at 7 degrees";
            self.notes.note("bump and normal maps", text, object.span.clone());
        }
        Some(built)
    }

    /// Reports a constant normal map, unless it is the identity.
    fn note_constant_normal_map(&mut self, constant: &'a Object) {
        let value = constant.property("value").map(|property| &property.value);
        if value != Some(&PropertyValue::Vector(DVec3::new(0.5, 0.5, 1.0))) {
            self.notes.substitute_light("a constant normal map", "left out", constant.span.clone());
        }
    }

    fn principled(&mut self, object: &'a Object, context: BsdfContext) -> MaterialBuilder {
        let mut keys: Entries = vec![("color", self.reflectance(object, "base_color", 0.5, context))];
        for (name, key, default) in [("metallic", "metallic", 0.0), ("roughness", "roughness", 0.5), ("clearcoat", "clearcoat", 0.0)] {
            let number = self.number(object, name, default);
            let value = self.number_value(number, context);
            keys.push((key, value));
        }
        let gloss = match self.number(object, "clearcoat_gloss", 0.0) {
            NumberSource::Constant(gloss) => gloss.clamp(0.0, 1.0),
            NumberSource::Texture(_) => 0.0,
        };
        // Disney's coat interpolates α from 0.1 to 0.001.
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
        for name in ["anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness", "diff_trans"] {
            let is_zero = matches!(self.number(object, name, 0.0), NumberSource::Constant(0.0));
            if !is_zero {
                let subject = format!("`{name}` of `{}`", object.plugin);
                self.notes.substitute_light(&subject, "left out", span_of(object, name));
            }
        }
        for name in ["main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate", "spec_sampling_rate"] {
            object.property(name);
        }
        self.notes.substitute_light("`principled`", "rendered with glimt's principled material, which differs", object.span.clone());
        MaterialBuilder::one_sided("principled", keys)
    }
}
