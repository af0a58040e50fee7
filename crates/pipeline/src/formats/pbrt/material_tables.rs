//! Writes the `[materials]` tables.

use super::lexer::{PbrtError, PbrtResult};
use super::materials::{BlendPartReference, ConvertedMaterial};
use super::scene::{LoweredMaterial, PbrtConverter};
use super::state::{MaterialReference, TypedStatement};
use super::texture_nodes::TextureNode;
use super::textures::{PbrtTextureUse, texture_reference};
use crate::formats::foreign::import::TableEntries;
use crate::formats::rounding::shorten_color;
use crate::math::DVec3;
use crate::scene::SceneDocumentValue;
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;
use std::ops::Range;

/// Emission of a shape.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Emission {
    /// Radiance, or the factor by which `image` is multiplied.
    pub(super) color: DVec3,
    /// Image of the radiance.
    pub(super) image: Option<TextureNode>,
    pub(super) is_two_sided: bool,
}

/// Properties that belong to the shape in pbrt, and to the material in glimt.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ShapeProperties {
    pub(super) emission: Option<Emission>,
    /// The opacity, if it is not 1.
    pub(super) alpha: Option<TextureNode>,
    /// Transmittance per unit length inside the shape, if it is a dielectric.
    pub(super) tint: Option<DVec3>,
}

impl PbrtConverter<'_> {
    /// Returns the material of a shape, adding its table if it is new.
    pub(super) fn find_or_add_material(
        &mut self,
        reference: &MaterialReference,
        span: &Range<usize>,
        properties: &ShapeProperties,
    ) -> LoweredMaterial {
        let identity = (reference.clone(), format!("{properties:?}"));
        if let Some(known) = self.materials.get(&identity) {
            return known.clone();
        }
        let lowered = self.lower_material(reference, span, properties, 0);
        let lowered = self.value_or_record_error(lowered).unwrap_or(LoweredMaterial::Invalid);
        self.materials.insert(identity, lowered.clone());
        lowered
    }

    /// Finds the statement that defines a material. Also returns a name for its table.
    fn find_material_statement(
        &self,
        reference: &MaterialReference,
        span: &Range<usize>,
    ) -> PbrtResult<(&TypedStatement, String)> {
        let statements = self.statements;
        match reference {
            MaterialReference::Index(index) => {
                let entity = &statements.materials[*index];
                Ok((entity, entity.kind.text.clone()))
            }
            MaterialReference::Named(name) => match statements.named_materials.get(&**name) {
                Some(entity) => Ok((entity, name.to_string())),
                None => {
                    let shown = escape_and_truncate(name, 40);
                    let near = nearest_name(name, statements.named_materials.keys().map(String::as_str));
                    let message = format!("there is no material \"{shown}\"");
                    Err(PbrtError::new(span.clone(), message).with_suggestion(near))
                }
            },
        }
    }

    fn lower_material(
        &mut self,
        reference: &MaterialReference,
        span: &Range<usize>,
        properties: &ShapeProperties,
        depth: usize,
    ) -> PbrtResult<LoweredMaterial> {
        /// Maximum nesting depth of mixed materials.
        const MAX_DEPTH: usize = 16;
        if depth > MAX_DEPTH {
            let message = "this material contains itself, or mixes are nested too deeply";
            return Err(PbrtError::new(span.clone(), message));
        }
        let (entity, name) = self.find_material_statement(reference, span)?;
        let (entity, is_named) = (entity.clone(), matches!(reference, MaterialReference::Named(_)));
        let model = self.read_material(&entity, is_named)?;
        self.document.set_span_for_next_values(entity.span());
        match model {
            ConvertedMaterial::Invisible => Ok(self.lower_interface(&name, properties)),
            ConvertedMaterial::Blend { parts, amount } => {
                self.lower_blend(&name, &parts, &amount, properties, &entity, depth)
            }
            ConvertedMaterial::Plain { mut keys, needs_uv, is_glass } => {
                let has_alpha = properties.alpha.is_some();
                if is_glass && has_alpha {
                    let text = "it is ignored, and the surface has no holes";
                    self.notes.note_substitution("`alpha` of a dielectric", text, entity.span());
                }
                if is_glass && let Some(tint) = properties.tint {
                    keys.push(("tint", shorten_color(tint)));
                }
                let uses_image = self.push_emission_and_opacity_keys(&mut keys, properties, is_glass);
                let table = self.add_material_table(keys, &name, &entity.span());
                Ok(LoweredMaterial::Table {
                    name: table,
                    needs_uv: needs_uv || uses_image,
                    has_inside: is_glass,
                })
            }
        }
    }

    /// Lowers an `interface`, which has no surface unless it emits light.
    fn lower_interface(&mut self, name: &str, properties: &ShapeProperties) -> LoweredMaterial {
        if properties.emission.is_none() {
            return LoweredMaterial::Invisible;
        }
        let span = 0..0;
        self.notes.note_substitution(
            "a light with the material `interface`",
            "its surface is black",
            span.clone(),
        );
        let mut keys: TableEntries = vec![("diffuse", 0.0.into())];
        let needs_uv = self.push_emission_and_opacity_keys(&mut keys, properties, false);
        let name = self.add_material_table(keys, name, &span);
        LoweredMaterial::Table { name, needs_uv, has_inside: false }
    }

    fn lower_blend(
        &mut self,
        name: &str,
        parts: &[BlendPartReference; 2],
        amount: &TextureNode,
        properties: &ShapeProperties,
        entity: &TypedStatement,
        depth: usize,
    ) -> PbrtResult<LoweredMaterial> {
        let mut names = Vec::new();
        for BlendPartReference { name, span } in parts {
            let reference = MaterialReference::Named(name.as_str().into());
            let lowered = self.lower_material(&reference, span, properties, depth + 1)?;
            match lowered {
                LoweredMaterial::Table { name, has_inside: false, .. } => names.push(name),
                LoweredMaterial::Table { .. } => {
                    let text = "only the other material is used";
                    self.notes.note_lighting_substitution("`mix` with a dielectric", text, span.clone());
                }
                LoweredMaterial::Invisible => {
                    let message = "an `interface` material cannot be mixed";
                    return Err(PbrtError::new(span.clone(), message));
                }
                LoweredMaterial::Invalid => return Ok(LoweredMaterial::Invalid),
            }
        }
        let table = |name: String| LoweredMaterial::Table { name, needs_uv: true, has_inside: false };
        match &names[..] {
            [] => {
                let message = "glimt cannot mix two dielectrics";
                Err(PbrtError::new(entity.span(), message))
            }
            [only] => Ok(table(only.clone())),
            [first, second, ..] if first == second => Ok(table(first.clone())),
            [first, second, ..] => {
                let both = [first, second].map(|name| SceneDocumentValue::from(name.clone())).to_vec();
                let weight = match amount.as_constant() {
                    Some(weight) => weight.x.clamp(0.0, 1.0).into(),
                    None => self.number_value(amount),
                };
                let keys = vec![
                    ("type", "blend".into()),
                    ("materials", SceneDocumentValue::Array(both)),
                    ("weight", weight),
                ];
                Ok(table(self.add_material_table(keys, name, &entity.span())))
            }
        }
    }

    /// Adds the keys for a shape's properties. Returns whether any of them is a texture.
    fn push_emission_and_opacity_keys(
        &mut self,
        keys: &mut TableEntries,
        properties: &ShapeProperties,
        is_glass: bool,
    ) -> bool {
        let mut uses_image = false;
        if let Some(Emission { color, image, is_two_sided }) = &properties.emission {
            let value = match image {
                None => shorten_color(*color),
                Some(image) => {
                    uses_image = true;
                    let SceneDocumentValue::Table(mut entries) =
                        texture_reference(self.texture(image, PbrtTextureUse::Color))
                    else {
                        return true;
                    };
                    if *color != DVec3::ONE {
                        entries.push(("scale", shorten_color(*color)));
                    }
                    SceneDocumentValue::Table(entries)
                }
            };
            keys.push(("emission", value));
            if *is_two_sided {
                keys.push(("emission_sides", "both".into()));
            }
        }
        if let Some(alpha) = properties.alpha.as_ref().filter(|_| !is_glass) {
            uses_image |= alpha.as_constant().is_none();
            let value = match alpha.as_constant() {
                Some(alpha) => alpha.x.clamp(0.0, 1.0).into(),
                None => self.number_value(alpha),
            };
            keys.push(("opacity", value));
        }
        uses_image
    }

    fn add_material_table(&mut self, keys: TableEntries, wanted: &str, span: &Range<usize>) -> String {
        let name = self.material_names.make_unique(wanted, "material");
        self.document.set_span_for_next_values(span.clone());
        self.document.start_named_table("materials", &name);
        keys.into_iter().for_each(|(key, value)| self.document.set(key, value));
        name
    }
}
