//! Adds the `[textures]` and `[materials]` tables of a glTF file.

use std::collections::HashMap;

use super::super::model::UsedNames;
use super::super::rounding::{shorten_color, shorten_number, shorten_pair};
use super::SceneBuilder;
use crate::assets::gltf::{
    AlphaMode, DiffuseTransmission, ModelMaterial, TextureLookup, TextureWrap, TexturedValue,
};
use crate::formats::foreign::import::TableEntries;
use crate::math::{DVec3, Vec2};
use crate::scene::SceneDocumentValue;

/// A texture's file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureFileReference {
    /// Path as it appears in the scene.
    pub(super) file: String,
    /// Index of the image in a glTF file.
    pub(super) image: Option<usize>,
}

/// How a texture's values are used. Each use needs a separate table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum TextureUse {
    Colors,
    Numbers,
    Normals,
}

/// Identity of a texture: its image, its use and its other table keys, formatted.
type TextureIdentity = (usize, TextureUse, String);

/// Builder for materials and their textures.
pub(super) struct MaterialBuilder<'a, 'b> {
    scene: &'a mut SceneBuilder<'b>,
    textures: HashMap<TextureIdentity, String>,
    names: UsedNames,
}

impl MaterialBuilder<'_, '_> {
    /// Adds the tables and returns the material names.
    pub(super) fn add_all(
        materials: &[ModelMaterial],
        names: &mut UsedNames,
        scene: &mut SceneBuilder<'_>,
    ) -> Vec<String> {
        let mut all = MaterialBuilder { scene, textures: HashMap::new(), names: UsedNames::default() };
        materials
            .iter()
            .map(|material| {
                let name = names.make_unique(&material.name, "material");
                match &material.diffuse_transmission {
                    Some(through) => all.add_translucent_material(material, through, &name, names),
                    None => all.add_material(material, &name, None),
                }
                name
            })
            .collect()
    }

    /// Adds a material with diffuse transmission.
    ///
    /// glTF mixes reflection and transmission with the weight t, and the result with the metal. If t is
    /// constant and there is no metal, (1 − t) times the base color is reflected and t times the transmission
    /// color is transmitted. Otherwise, both mixes are blends.
    fn add_translucent_material(
        &mut self,
        material: &ModelMaterial,
        through: &DiffuseTransmission,
        name: &str,
        names: &mut UsedNames,
    ) {
        let is_dielectric = material.metallic.factor == DVec3::ZERO;
        let base = match is_dielectric {
            true => name.to_owned(),
            false => names.make_unique(&format!("{name} dielectric"), "dielectric"),
        };
        let dielectric = ModelMaterial { metallic: TexturedValue::from_scalar(0.0), ..material.clone() };
        if through.weight.texture.is_none() {
            let weight = through.weight.factor.x;
            let scaled = |value: &TexturedValue, factor: f64| TexturedValue {
                factor: value.factor * factor,
                texture: value.texture.clone().filter(|_| factor > 0.0),
            };
            let color = scaled(&material.color, 1.0 - weight);
            self.add_material(
                &ModelMaterial { color, ..dielectric },
                &base,
                Some(&scaled(&through.color, weight)),
            );
        } else {
            let parts =
                ["reflection", "transmission"].map(|part| names.make_unique(&format!("{name} {part}"), part));
            self.add_material(&dielectric, &parts[0], None);
            let black = ModelMaterial { color: TexturedValue::from_scalar(0.0), ..dielectric };
            self.add_material(&black, &parts[1], Some(&through.color));
            self.add_blend(&base, parts, &through.weight, "a");
        }
        if !is_dielectric {
            let metal = names.make_unique(&format!("{name} metal"), "metal");
            let metallic = TexturedValue::from_scalar(1.0);
            self.add_material(&ModelMaterial { metallic, ..material.clone() }, &metal, None);
            self.add_blend(name, [base, metal], &material.metallic, "b");
        }
    }

    /// Adds a blend of two materials.
    fn add_blend(&mut self, name: &str, parts: [String; 2], weight: &TexturedValue, channel: &'static str) {
        let mut keys = TableEntries::new();
        self.push_number_or_texture(&mut keys, "weight", 0.5, weight, channel);
        let document = &mut self.scene.document;
        document.start_named_table("materials", name);
        document.set("type", "blend");
        document.set("materials", SceneDocumentValue::Array(parts.map(SceneDocumentValue::from).to_vec()));
        keys.into_iter().for_each(|(key, value)| document.set(key, value));
    }

    /// Adds a material, which transmits diffuse light of the color `transmitted`.
    fn add_material(&mut self, material: &ModelMaterial, name: &str, transmitted: Option<&TexturedValue>) {
        // Collect the keys first, because texture tables must precede the material's table.
        let mut keys = TableEntries::new();
        match material.glass {
            Some(glass) => {
                keys.push(("type", "glass".into()));
                self.push_number_or_texture(&mut keys, "roughness", 0.0, &material.roughness, "g");
                if glass.tint != DVec3::ONE {
                    keys.push(("tint", shorten_color(glass.tint)));
                }
            }
            None => {
                self.add_principled_keys(&mut keys, material);
                if let Some(color) = transmitted {
                    self.push_color_or_texture(&mut keys, "diffuse_transmission", 0.0, color);
                }
            }
        }
        if material.ior != 1.5 {
            keys.push(("ior", shorten_number(material.ior).into()));
        }
        self.add_common_keys(&mut keys, material);
        let document = &mut self.scene.document;
        document.start_named_table("materials", name);
        keys.into_iter().for_each(|(key, value)| document.set(key, value));
    }

    fn add_principled_keys(&mut self, keys: &mut TableEntries, material: &ModelMaterial) {
        keys.push(("type", "principled".into()));
        self.push_color_or_texture(keys, "color", 0.8, &material.color);
        self.push_number_or_texture(keys, "metallic", 0.0, &material.metallic, "b");
        self.push_number_or_texture(keys, "roughness", 0.5, &material.roughness, "g");
        self.push_number_or_texture(keys, "specular", 1.0, &material.specular, "a");
        self.push_color_or_texture(keys, "specular_color", 1.0, &material.specular_color);
        self.push_number_or_texture(keys, "transmission", 0.0, &material.transmission, "r");
        self.push_number_or_texture(keys, "clearcoat", 0.0, &material.clearcoat, "r");
        if material.clearcoat.factor != DVec3::ZERO {
            self.push_number_or_texture(keys, "clearcoat_roughness", 0.0, &material.clearcoat_roughness, "g");
        }
    }

    /// Adds the keys that all material types share.
    fn add_common_keys(&mut self, keys: &mut TableEntries, material: &ModelMaterial) {
        let emission = &material.emission;
        if emission.factor != DVec3::ZERO {
            match &emission.texture {
                Some(texture) => {
                    let name = self.ensure_texture_table(texture, TextureUse::Colors, DVec3::ONE);
                    let scale =
                        (emission.factor != DVec3::ONE).then(|| ("scale", shorten_color(emission.factor)));
                    let texture = ("texture", name.into());
                    keys.push((
                        "emission",
                        SceneDocumentValue::Table([texture].into_iter().chain(scale).collect()),
                    ));
                }
                None => keys.push(("emission", shorten_color(emission.factor))),
            }
            if material.is_two_sided {
                keys.push(("emission_sides", "both".into()));
            }
        }
        if let Some(normal) = &material.normal {
            let name = self.ensure_texture_table(normal, TextureUse::Normals, DVec3::ONE);
            keys.push(("normal_map", name.into()));
            if material.normal_strength != 1.0 {
                keys.push(("normal_strength", shorten_number(material.normal_strength).into()));
            }
        }
        if material.glass.is_some() {
            return;
        }
        match &material.alpha {
            AlphaMode::Opaque => {}
            AlphaMode::Mask { value, cutoff } => {
                self.add_opacity(keys, value, &material.color);
                // A cutoff has no effect if it is 0 or if alpha is always 1.
                if *cutoff > 0.0 && (value.texture.is_some() || value.factor != DVec3::ONE) {
                    keys.push(("opacity_cutoff", shorten_number(*cutoff).into()));
                }
            }
            AlphaMode::Blend(value) => self.add_opacity(keys, value, &material.color),
        }
    }

    /// Adds the opacity, reading it from the texture's alpha channel if there is a texture.
    fn add_opacity(&mut self, keys: &mut TableEntries, value: &TexturedValue, color: &TexturedValue) {
        match &value.texture {
            Some(texture) => {
                // Without factors, color and alpha can share a texture table.
                let is_same = color.texture.as_ref() == Some(texture) && color.factor == DVec3::ONE;
                let use_ = if is_same && value.factor == DVec3::ONE {
                    TextureUse::Colors
                } else {
                    TextureUse::Numbers
                };
                let name = self.ensure_texture_table(texture, use_, value.factor);
                keys.push(("opacity", texture_channel_reference(name, "a")));
            }
            None if value.factor != DVec3::ONE => {
                keys.push(("opacity", shorten_number(value.factor.x).into()));
            }
            None => {}
        }
    }

    fn push_color_or_texture(
        &mut self,
        keys: &mut TableEntries,
        key: &'static str,
        usual: f64,
        slot: &TexturedValue,
    ) {
        match &slot.texture {
            Some(texture) => {
                let name = self.ensure_texture_table(texture, TextureUse::Colors, slot.factor);
                keys.push((key, SceneDocumentValue::Table(vec![("texture", name.into())])));
            }
            None if slot.factor != DVec3::splat(usual) => {
                let most = if key == "color" { slot.factor.min(DVec3::ONE) } else { slot.factor };
                keys.push((key, shorten_color(most)));
            }
            None => {}
        }
    }

    fn push_number_or_texture(
        &mut self,
        keys: &mut TableEntries,
        key: &'static str,
        usual: f64,
        slot: &TexturedValue,
        channel: &'static str,
    ) {
        match &slot.texture {
            Some(texture) => {
                let name = self.ensure_texture_table(texture, TextureUse::Numbers, slot.factor);
                keys.push((key, texture_channel_reference(name, channel)));
            }
            None if slot.factor.x != usual => keys.push((key, shorten_number(slot.factor.x).into())),
            None => {}
        }
    }

    /// Returns a texture's name, adding its table if the texture is new.
    fn ensure_texture_table(&mut self, texture: &TextureLookup, use_: TextureUse, factor: DVec3) -> String {
        let mut keys = TableEntries::new();
        if texture.is_nearest {
            keys.push(("filter", "nearest".into()));
        }
        match texture.wrap {
            TextureWrap::Repeat => {}
            TextureWrap::Clamp => keys.push(("wrap", "clamp".into())),
            TextureWrap::Mirror => keys.push(("wrap", "mirror".into())),
        }
        if texture.is_second {
            keys.push(("uv", 1.0.into()));
        }
        if texture.repeat != Vec2::ONE {
            keys.push(("repeat", shorten_pair(texture.repeat).into()));
        }
        if texture.rotate != 0.0 {
            keys.push(("rotate", shorten_number(texture.rotate).into()));
        }
        if texture.offset != Vec2::ZERO {
            keys.push(("offset", shorten_pair(texture.offset).into()));
        }
        if factor != DVec3::ONE {
            keys.push(("factor", shorten_color(factor)));
        }
        let identity = (texture.image, use_, format!("{keys:?}"));
        if let Some(known) = self.textures.get(&identity) {
            return known.clone();
        }
        let wanted = self.scene.image_stem(texture.image);
        let name = self.names.make_unique(&wanted, "image");
        let TextureFileReference { file, image } = self.scene.image_file_reference(texture.image);
        let document = &mut self.scene.document;
        document.start_named_table("textures", &name);
        document.set("file", file);
        if let Some(image) = image {
            document.set("image", image as f64);
        }
        keys.into_iter().for_each(|(key, value)| document.set(key, value));
        self.textures.insert(identity, name.clone());
        name
    }
}

/// Returns the value that reads a number from a texture's channel.
fn texture_channel_reference(texture: String, channel: &'static str) -> SceneDocumentValue {
    SceneDocumentValue::Table(vec![("texture", texture.into()), ("channel", channel.into())])
}
