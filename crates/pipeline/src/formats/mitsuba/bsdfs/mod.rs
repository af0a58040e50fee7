//! Converts BSDFs to materials.

mod checkered;
mod nested;
mod surfaces;

use super::graph::{Child, GraphObjectIndex, ObjectKind, PluginInstance};
use super::material_key::{MaterialKey, UvFlips};
use super::reader::{ColorRole, ColorSource, NumberSource, SceneReader, luminance};
use super::textures::MitsubaTextureUse;
use crate::formats::foreign::import::TableEntries;
use crate::formats::rounding::{shorten_color, shorten_number};
use crate::math::DVec3;
use crate::scene::SceneDocumentValue;

/// Index of refraction of air, Mitsuba's default exterior.
const AIR: f64 = 1.000_277;

/// BSDF plugins of Mitsuba 3, 2 and 0.6.
const KNOWN_BSDFS: [&str; 26] = [
    "diffuse",
    "roughdiffuse",
    "conductor",
    "roughconductor",
    "dielectric",
    "thindielectric",
    "roughdielectric",
    "plastic",
    "roughplastic",
    "twosided",
    "mask",
    "blendbsdf",
    "mixturebsdf",
    "bumpmap",
    "normalmap",
    "phong",
    "ward",
    "coating",
    "roughcoating",
    "principled",
    "principledthin",
    "null",
    "difftrans",
    "hk",
    "irawan",
    "measured",
];

/// Context inherited by a nested BSDF.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfContext {
    uv: UvFlips,
    /// Whether a `twosided` contains the BSDF.
    is_two_sided: bool,
    /// The `mask` that contains the BSDF.
    mask: Option<GraphObjectIndex>,
    /// The `coating` that contains the BSDF.
    coat: Option<GraphObjectIndex>,
    depth: u32,
}

/// A material under construction.
#[derive(Debug, Default)]
pub(super) struct MaterialBuilder {
    /// The keys, including `type`.
    keys: TableEntries,
    /// Whether the surface is an index-matched boundary, which has no effect.
    is_invisible: bool,
    /// Whether the material is `glass`.
    is_glass: bool,
    is_blend: bool,
    /// Whether the back of the surface is black.
    is_one_sided: bool,
    /// Whether the surface is or contains a smooth conductor, dielectric or plastic.
    has_smooth_reflection: bool,
}

impl MaterialBuilder {
    fn new(kind: &'static str, keys: TableEntries) -> Self {
        let keys = std::iter::once(("type", kind.into())).chain(keys).collect();
        Self { keys, ..Self::default() }
    }

    /// A material whose back is black unless a `twosided` contains it.
    fn one_sided(kind: &'static str, keys: TableEntries) -> Self {
        Self { is_one_sided: true, ..Self::new(kind, keys) }
    }

    fn has_key(&self, key: &str) -> bool {
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
        emitter: Option<GraphObjectIndex>,
        uv: UvFlips,
        shape: &'a PluginInstance,
    ) -> Option<String> {
        let index = bsdf.map(|child| child.target);
        let has_textures = self.any_nested_object_satisfies(index.into_iter().chain(emitter), |inner| {
            inner.kind == ObjectKind::Texture
        });
        let uv = if has_textures { uv } else { UvFlips::default() };
        let mesh = self.attributes.as_ref().map(|mesh| mesh.id);
        let tint = self.interior_tint.map(|tint| tint.to_array().map(f64::to_bits));
        let key = MaterialKey { bsdf: index, emitter, uv, mesh, tint };
        if let Some(known) = self.materials.get(&key) {
            return known.clone();
        }
        if !self.may_add_material(bsdf.map_or(&shape.span, |child| &child.span)) {
            return None;
        }
        self.blend_parts.clear();
        let context = BsdfContext { uv, is_two_sided: false, mask: None, coat: None, depth: 0 };
        let builder = match bsdf {
            Some(child) => self.bsdf(child.target, context),
            None => Some(MaterialBuilder::one_sided("phong", vec![("diffuse", 0.5.into())])),
        };
        let span = bsdf.map_or(shape.span.clone(), |child| self.object_by_index(child.target).span.clone());
        let name = builder.and_then(|mut builder| {
            if let Some(emitter) = emitter {
                self.add_emission(&mut builder, emitter, uv, shape);
            } else if builder.is_invisible {
                return None;
            }
            let wanted = bsdf.map(|child| self.object_by_index(child.target));
            let wanted = wanted.map_or("default", |object| object.id.as_deref().unwrap_or(&object.plugin));
            Some(self.add_material(builder, wanted, span))
        });
        self.materials.insert(key, name.clone());
        name
    }

    /// Adds a material to the document and returns its name.
    fn add_material(
        &mut self,
        builder: MaterialBuilder,
        wanted: &str,
        span: std::ops::Range<usize>,
    ) -> String {
        self.material_count += 1;
        let name = self.material_names.make_unique(wanted, "material");
        self.document.set_span_for_next_values(span);
        self.document.start_named_table("materials", &name);
        let is_one_sided = builder.is_one_sided && !builder.is_glass && !builder.is_blend;
        self.set_all(builder.keys);
        if is_one_sided {
            self.document.set("sides", "front");
        }
        name
    }

    /// Adds the emission of an area light.
    fn add_emission(
        &mut self,
        builder: &mut MaterialBuilder,
        emitter: GraphObjectIndex,
        uv: UvFlips,
        shape: &'a PluginInstance,
    ) {
        let index = emitter;
        let emitter = self.object_by_index(index);
        if builder.is_blend {
            let text = "the shape does not emit";
            self.notes.note_lighting_substitution("an area light on a `blendbsdf`", text, shape.span.clone());
            return;
        }
        if builder.is_invisible {
            // Use a black surface, which only emits.
            *builder = MaterialBuilder::one_sided("phong", vec![("diffuse", 0.0.into())]);
        }
        match self.color_or_texture(emitter, "radiance", ColorRole::Emission, 1.0) {
            ColorSource::Constant(color) => {
                if color != DVec3::ZERO {
                    builder.keys.push(("emission", shorten_color(color)));
                }
            }
            ColorSource::Texture(texture) => {
                match self.find_or_add_texture(texture, MitsubaTextureUse::Color, uv) {
                    Some(name) => {
                        builder
                            .keys
                            .push(("emission", SceneDocumentValue::Table(vec![("texture", name.into())])));
                    }
                    None => {
                        let color = self.color_if_spectrum(texture, ColorRole::Emission);
                        builder.keys.push(("emission", shorten_color(color.unwrap_or(DVec3::ONE))));
                    }
                }
            }
        }
        self.report_unused(index);
        self.report_unused_children(index);
    }

    /// Converts a BSDF. Returns `None` after an error.
    fn bsdf(&mut self, index: GraphObjectIndex, context: BsdfContext) -> Option<MaterialBuilder> {
        let object = self.object_by_index(index);
        if context.depth > MAX_DEPTH {
            self.report_error(object.span.clone(), "BSDFs are nested too deeply", None);
            return None;
        }
        let context = BsdfContext { depth: context.depth + 1, ..context };
        let built = match object.plugin.as_str() {
            "diffuse" | "lambertian" => {
                let color = self.vertex_color_scale(object);
                let color = color.unwrap_or_else(|| self.reflectance(object, "reflectance", 0.5, context));
                Some(MaterialBuilder::one_sided("phong", vec![("diffuse", color)]))
            }
            "roughdiffuse" => {
                let color = self.reflectance(object, "reflectance", 0.5, context);
                object.property("use_fast_approx");
                object.property("alpha");
                self.notes.note_lighting_substitution(
                    "`roughdiffuse`",
                    "replaced by `diffuse`",
                    object.span.clone(),
                );
                Some(MaterialBuilder::one_sided("phong", vec![("diffuse", color)]))
            }
            "conductor" | "roughconductor" => self.conductor(object, context),
            "dielectric" | "roughdielectric" | "thindielectric" => Some(self.dielectric(object, context)),
            "plastic" | "roughplastic" => Some(self.plastic(object, context)),
            "phong" => Some(self.phong(object, context)),
            "ward" => Some(self.ward(object, context)),
            "coating" | "roughcoating" => self.coating(index, context),
            "twosided" => self.two_sided(object, context),
            "mask" => self.mask(index, context),
            "blendbsdf" | "mixturebsdf" => self.blend(object, context),
            "bumpmap" | "bump" => self.bump_map(object, context),
            "normalmap" => self.normal_map(object, context),
            "principled" => Some(self.principled(object, context)),
            "principledthin" => {
                self.notes.note_lighting_substitution(
                    "`principledthin`",
                    "rendered as `principled`",
                    object.span.clone(),
                );
                Some(self.principled(object, context))
            }
            "difftrans" => {
                let color = self.reflectance(object, "transmittance", 0.5, context);
                let keys = vec![("diffuse", 0.0.into()), ("diffuse_transmission", color)];
                Some(MaterialBuilder::new("phong", keys))
            }
            "null" => Some(MaterialBuilder { is_invisible: true, ..MaterialBuilder::default() }),
            "hair" => return self.refuse_bsdf(object, "hair"),
            "pplastic" | "polarizer" | "retarder" | "circular" | "measured_polarized" => {
                return self.refuse_bsdf(object, "polarization");
            }
            "measured" => return self.refuse_bsdf(object, "measured BSDFs"),
            "hk" | "irawan" => return self.refuse_bsdf(object, "this BSDF"),
            _ => {
                self.report_unknown_plugin(object, "BSDF", &KNOWN_BSDFS);
                None
            }
        };
        self.report_unused(index);
        if built.is_some() {
            self.report_unused_children(index);
        }
        let is_smooth =
            matches!(object.plugin.as_str(), "conductor" | "dielectric" | "thindielectric" | "plastic");
        built.map(|built| MaterialBuilder {
            has_smooth_reflection: built.has_smooth_reflection || is_smooth,
            ..built
        })
    }

    fn refuse_bsdf(&mut self, object: &PluginInstance, what: &str) -> Option<MaterialBuilder> {
        self.refuse(object, what);
        None
    }

    /// Converts a reflectance or transmittance to the value of a color key.
    fn reflectance(
        &mut self,
        object: &'a PluginInstance,
        name: &str,
        default: f64,
        context: BsdfContext,
    ) -> SceneDocumentValue {
        let color = self.color_or_texture(object, name, ColorRole::Reflectance, default);
        self.color_value(color, context, 1.0)
    }

    /// Converts a color or texture to the value of a color key, times `factor`.
    fn color_value(&mut self, color: ColorSource, context: BsdfContext, factor: f64) -> SceneDocumentValue {
        match color {
            ColorSource::Constant(color) => shorten_color(color * factor),
            ColorSource::Texture(texture) => {
                match self.find_or_add_scaled_texture(texture, MitsubaTextureUse::Color, context.uv, factor) {
                    Some(name) => SceneDocumentValue::Table(vec![("texture", name.into())]),
                    None => {
                        let color = self.color_if_spectrum(texture, ColorRole::Reflectance);
                        shorten_color(color.unwrap_or(DVec3::splat(0.5)) * factor)
                    }
                }
            }
        }
    }

    /// Converts a number or texture to the value of a number key.
    fn value_from_number_source(&mut self, number: NumberSource, context: BsdfContext) -> SceneDocumentValue {
        match number {
            NumberSource::Constant(number) => shorten_number(number.clamp(0.0, 1.0)).into(),
            NumberSource::Texture(texture) => match self.number_texture(texture, context.uv) {
                Some(value) => value,
                None => {
                    let color = self.color_if_spectrum(texture, ColorRole::Reflectance);
                    shorten_number(color.map_or(0.5, luminance).clamp(0.0, 1.0)).into()
                }
            },
        }
    }
}
