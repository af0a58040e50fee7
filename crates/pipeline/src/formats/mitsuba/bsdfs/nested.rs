//! Converts BSDFs that contain other BSDFs.

use super::{BsdfContext, MaterialBuilder};
use crate::formats::foreign::import::TableEntries;
use crate::formats::mitsuba::graph::{Child, GraphObjectIndex, ObjectKind, PluginInstance};
use crate::formats::mitsuba::material_key::BlendPartKey;
use crate::formats::mitsuba::property::PropertyValue;
use crate::formats::mitsuba::reader::{ColorRole, ColorSource, NumberSource, SceneReader};
use crate::formats::mitsuba::textures::MitsubaTextureUse;
use crate::formats::mitsuba::xml::truncate_for_message;
use crate::formats::rounding::{shorten_color, shorten_number};
use crate::math::DVec3;
use crate::scene::SceneDocumentValue;

impl<'a> SceneReader<'a> {
    /// Returns the first nested BSDF, or reports an error.
    pub(super) fn nested_bsdf(&mut self, object: &'a PluginInstance) -> Option<&'a Child> {
        let nested = self.children_of_kind(object, ObjectKind::Bsdf).next();
        if nested.is_none() {
            let message = format!("`{}` needs a nested BSDF", truncate_for_message(&object.plugin));
            self.report_error(object.span.clone(), message, None);
        }
        nested
    }

    pub(super) fn two_sided(
        &mut self,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> Option<MaterialBuilder> {
        let nested = self.nested_bsdf(object)?;
        if let Some(second) = self.children_of_kind(object, ObjectKind::Bsdf).nth(1)
            && second.target != nested.target
        {
            let text = "the first BSDF is used on both sides";
            self.notes.note_lighting_substitution("`twosided` with two BSDFs", text, object.span.clone());
        }
        let context = BsdfContext { is_two_sided: true, ..context };
        let built = self.bsdf(nested.target, context)?;
        Some(MaterialBuilder { is_one_sided: false, ..built })
    }

    pub(super) fn mask(&mut self, index: GraphObjectIndex, context: BsdfContext) -> Option<MaterialBuilder> {
        let object = self.object_by_index(index);
        let nested = self.nested_bsdf(object)?;
        let opacity = self.fraction(object, "opacity", 0.5);
        if opacity == NumberSource::Constant(1.0) {
            return self.bsdf(nested.target, context);
        }
        if context.mask.is_some() {
            let text = "the inner mask is ignored";
            self.notes.note_lighting_substitution("`mask` around another mask", text, object.span.clone());
            return self.bsdf(nested.target, context);
        }
        let context = BsdfContext { mask: Some(index), ..context };
        let mut built = self.bsdf(nested.target, context)?;
        // The materials of a blend already have the opacity.
        if !built.is_invisible && !built.is_blend {
            self.add_opacity(&mut built, context);
        }
        Some(built)
    }

    /// Adds the opacity of the mask that contains a material.
    pub(super) fn add_opacity(&mut self, built: &mut MaterialBuilder, context: BsdfContext) {
        let Some(object) = context.mask.map(|index| self.object_by_index(index)) else { return };
        if built.is_glass && !built.has_key("thin") || built.has_key("opacity") {
            let text = "the mask is ignored";
            self.notes.note_lighting_substitution("`mask` around solid glass", text, object.span.clone());
            return;
        }
        let text = "light from point, spot and directional lights passes through them; Mitsuba blocks it";
        self.notes.note("masks", text, object.span.clone());
        let opacity = self.number_or_texture(object, "opacity", 0.5);
        let mut value = self.value_from_number_source(opacity, context);
        if let (NumberSource::Texture(texture), SceneDocumentValue::Table(entries)) = (opacity, &mut value)
            && self.image_may_have_alpha(self.object_by_index(texture))
        {
            // By default, `opacity` reads alpha, and Mitsuba the luminance. Masks are gray.
            entries.push(("channel", "r".into()));
        }
        built.keys.push(("opacity", value));
    }

    pub(super) fn blend(
        &mut self,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> Option<MaterialBuilder> {
        let nested: Vec<&Child> = self.children_of_kind(object, ObjectKind::Bsdf).collect();
        if object.plugin == "mixturebsdf" {
            object.property("weights");
            self.refuse(object, "mixtures of BSDFs; use `blendbsdf`");
            return None;
        }
        let [first, second] = nested[..] else {
            let message = format!("`blendbsdf` needs two nested BSDFs, found {}", nested.len());
            self.report_error(object.span.clone(), message, None);
            return None;
        };
        let weight = self.fraction(object, "weight", 0.5);
        let weight = self.value_from_number_source(weight, context);
        let mut names = Vec::new();
        for child in [first, second] {
            names.push(SceneDocumentValue::from(self.blend_part(object, child, context)?));
        }
        let keys = vec![("materials", SceneDocumentValue::Array(names)), ("weight", weight)];
        Some(MaterialBuilder { is_blend: true, ..MaterialBuilder::new("blend", keys) })
    }

    /// Returns the name of a material of a blend, adding it if it is new. Returns `None` after an error.
    fn blend_part(
        &mut self,
        blend: &'a PluginInstance,
        child: &'a Child,
        context: BsdfContext,
    ) -> Option<String> {
        let BsdfContext { uv, is_two_sided, mask, coat, depth: _ } = context;
        let key = BlendPartKey { bsdf: child.target, uv, is_two_sided, mask, coat };
        if let Some(known) = self.blend_parts.get(&key) {
            return known.clone();
        }
        let name = self.new_blend_part(blend, child, context);
        self.blend_parts.insert(key, name.clone());
        name
    }

    fn new_blend_part(
        &mut self,
        blend: &'a PluginInstance,
        child: &'a Child,
        context: BsdfContext,
    ) -> Option<String> {
        if !self.may_add_material(&child.span) {
            return None;
        }
        let mut built = self.bsdf(child.target, context)?;
        let inner = self.object_by_index(child.target);
        if built.is_glass && !built.has_key("thin") {
            self.refuse(blend, "blends that contain solid glass");
            return None;
        }
        if built.is_invisible {
            // A surface without effect is transparent.
            built = MaterialBuilder::new("phong", vec![("diffuse", 0.0.into()), ("opacity", 0.0.into())]);
        }
        if built.has_smooth_reflection {
            let text = "glimt blends their light by the weight; Mitsuba mixes up their pdfs";
            self.notes.note("smooth metal, glass or plastic in a blend", text, blend.span.clone());
        }
        built.is_one_sided &= !context.is_two_sided;
        self.add_enclosing_keys(&mut built, context);
        let wanted = inner.id.as_deref().unwrap_or(&inner.plugin);
        Some(self.add_material(built, wanted, inner.span.clone()))
    }

    pub(super) fn coating(
        &mut self,
        index: GraphObjectIndex,
        context: BsdfContext,
    ) -> Option<MaterialBuilder> {
        let object = self.object_by_index(index);
        let nested = self.nested_bsdf(object)?;
        if context.coat.is_some() {
            let text = "the inner coat is ignored";
            self.notes.note_lighting_substitution("a coat on another coat", text, object.span.clone());
            return self.bsdf(nested.target, context);
        }
        let context = BsdfContext { coat: Some(index), ..context };
        let mut built = self.bsdf(nested.target, context)?;
        // The materials of a blend already have the coat.
        if !built.is_invisible && !built.is_blend {
            self.add_coat(&mut built, context);
        }
        Some(built)
    }

    /// Adds the keys of the `mask` and the `coating` that contain one material of a blend.
    pub(super) fn add_enclosing_keys(&mut self, part: &mut MaterialBuilder, context: BsdfContext) {
        if part.is_blend {
            return;
        }
        if context.coat.is_some() {
            self.add_coat(part, context);
        }
        if context.mask.is_some() {
            self.add_opacity(part, context);
        }
    }

    /// Adds the coat of the `coating` that contains a material.
    fn add_coat(&mut self, built: &mut MaterialBuilder, context: BsdfContext) {
        let Some(object) = context.coat.map(|index| self.object_by_index(index)) else { return };
        if built.is_glass {
            let text = "the coat is ignored";
            self.notes.note_lighting_substitution("a coat on glass", text, object.span.clone());
            return;
        }
        let text = "interreflections between coat and base differ";
        self.notes.note(&format!("`{}`", object.plugin), text, object.span.clone());
        let ior = self.relative_ior(object, 1.5046).max(1.0);
        let thickness = self.float(object, "thickness").unwrap_or(1.0);
        self.ignored_scale(object, "specular_reflectance");
        let roughness = match object.plugin.as_str() {
            "roughcoating" => {
                let mut keys = TableEntries::new();
                self.add_microfacet_keys(&mut keys, object, 0.1, context, false);
                keys.into_iter().find(|(key, _)| *key == "roughness").map_or(0.3.into(), |(_, value)| value)
            }
            _ => 0.0.into(),
        };
        built.keys.push(("coat", 1.0.into()));
        built.keys.push(("coat_roughness", roughness));
        built.keys.push(("coat_ior", shorten_number(ior).into()));
        match self.color_or_texture(object, "sigma_a", ColorRole::Unbounded, 0.0) {
            ColorSource::Constant(sigma) if sigma != DVec3::ZERO => {
                // Light passes through the layer twice.
                let tint = sigma.to_array().map(|sigma| libm::exp(-2.0 * thickness * sigma).clamp(0.0, 1.0));
                built.keys.push(("coat_tint", shorten_color(tint.into())));
            }
            ColorSource::Constant(_) => {}
            ColorSource::Texture(_) => {
                self.notes.note_lighting_substitution(
                    "a textured `sigma_a`",
                    "replaced by 0",
                    object.span.clone(),
                );
            }
        }
    }

    /// Returns the nested texture of a bump or normal map.
    pub(super) fn nested_texture(&mut self, object: &'a PluginInstance) -> Option<GraphObjectIndex> {
        let texture = self.children_of_kind(object, ObjectKind::Texture).next();
        if texture.is_none() {
            let message = format!("`{}` needs a nested texture", truncate_for_message(&object.plugin));
            self.report_error(object.span.clone(), message, None);
        }
        texture.map(|child| child.target)
    }

    pub(super) fn bump_map(
        &mut self,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> Option<MaterialBuilder> {
        let nested = self.nested_bsdf(object)?;
        let texture = self.nested_texture(object)?;
        let mut scale = self.float(object, "scale").unwrap_or(1.0);
        // Version 0.6 wraps the texture in a `scale` texture to scale it.
        let mut texture = texture;
        while self.object_by_index(texture).plugin == "scale" {
            let outer = self.object_by_index(texture);
            scale *= self.float(outer, "scale").or_else(|| self.float(outer, "value")).unwrap_or(1.0);
            let Some(inner) = self.children_of_kind(outer, ObjectKind::Texture).next() else { break };
            texture = inner.target;
        }
        let mut built = self.bsdf(nested.target, context)?;
        if built.is_blend || built.is_invisible || built.has_key("bump") {
            let text = "the bump map is ignored";
            self.notes.note_lighting_substitution(
                "`bumpmap` around a blend or another bump map",
                text,
                object.span.clone(),
            );
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

    pub(super) fn normal_map(
        &mut self,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> Option<MaterialBuilder> {
        let nested = self.nested_bsdf(object)?;
        if let Some(constant) =
            object.named_child("normalmap").map(|child| self.object_by_index(child.target))
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
        if built.is_blend || built.is_invisible || built.has_key("normal_map") {
            let text = "the normal map is ignored";
            self.notes.note_lighting_substitution(
                "`normalmap` around a blend or another normal map",
                text,
                object.span.clone(),
            );
            return Some(built);
        }
        if let Some(name) = self.find_or_add_texture(texture, MitsubaTextureUse::Normal, context.uv) {
            built.keys.push(("normal_map", name.into()));
            let text = "light fades as the normal tilts: 2 % darker at 7 degrees";
            self.notes.note("bump and normal maps", text, object.span.clone());
        }
        Some(built)
    }

    /// Reports a constant normal map, unless it is the identity.
    pub(super) fn note_constant_normal_map(&mut self, constant: &'a PluginInstance) {
        let value = constant.property("value").map(|property| &property.value);
        if value != Some(&PropertyValue::Vector(DVec3::new(0.5, 0.5, 1.0))) {
            self.notes.note_lighting_substitution("a constant normal map", "ignored", constant.span.clone());
        }
    }
}
