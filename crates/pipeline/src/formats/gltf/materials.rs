//! Writes the `[textures]` and `[materials]` tables of a converted glTF file.

use std::collections::HashMap;

use super::super::model::UsedNames;
use super::super::toml::{format_color, format_key, format_number, format_pair};
use super::SceneWriter;
use crate::assets::gltf::{Alpha, ModelMaterial, TextureRef, TextureWrap, TexturedValue};
use crate::math::{DVec3, Vec2};
use crate::scene::quote_toml_string;

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

/// Keys and values of a table.
type TomlEntries = Vec<(&'static str, String)>;

/// Identity of a texture: its image, its use and its other table keys.
type TextureIdentity = (usize, TextureUse, String);

/// Writer for materials and their textures.
pub(super) struct MaterialWriter<'a, 'b> {
    scene: &'a mut SceneWriter<'b>,
    textures: HashMap<TextureIdentity, String>,
    names: UsedNames,
}

impl MaterialWriter<'_, '_> {
    /// Writes the tables and returns the material names.
    pub(super) fn write_all(
        materials: &[ModelMaterial],
        names: &mut UsedNames,
        scene: &mut SceneWriter<'_>,
    ) -> Vec<String> {
        let mut all = MaterialWriter { scene, textures: HashMap::new(), names: UsedNames::default() };
        materials
            .iter()
            .map(|material| {
                let name = names.make_unique(&material.name, "material");
                all.write_material(material, &name);
                name
            })
            .collect()
    }

    fn write_material(&mut self, material: &ModelMaterial, name: &str) {
        // Collect the keys first, because texture tables must precede the material's table.
        let mut keys = TomlEntries::new();
        match material.glass {
            Some(glass) => {
                keys.push(("type", "\"glass\"".to_owned()));
                self.push_number_or_texture(&mut keys, ("roughness", 0.0), &material.roughness, "g");
                if glass.tint != DVec3::ONE {
                    keys.push(("tint", format_color(glass.tint)));
                }
            }
            None => self.write_principled(&mut keys, material),
        }
        if material.ior != 1.5 {
            keys.push(("ior", format_number(material.ior)));
        }
        self.write_common_keys(&mut keys, material);
        let toml = &mut self.scene.toml;
        toml.table(&format!("[materials.{}]", format_key(name)));
        keys.iter().for_each(|(key, value)| toml.key_value(key, value));
    }

    fn write_principled(&mut self, keys: &mut TomlEntries, material: &ModelMaterial) {
        keys.push(("type", "\"principled\"".to_owned()));
        self.push_color_or_texture(keys, ("color", 0.8), &material.color);
        self.push_number_or_texture(keys, ("metallic", 0.0), &material.metallic, "b");
        self.push_number_or_texture(keys, ("roughness", 0.5), &material.roughness, "g");
        self.push_number_or_texture(keys, ("specular", 1.0), &material.specular, "a");
        self.push_color_or_texture(keys, ("specular_color", 1.0), &material.specular_color);
        self.push_number_or_texture(keys, ("transmission", 0.0), &material.transmission, "r");
        self.push_number_or_texture(keys, ("clearcoat", 0.0), &material.clearcoat, "r");
        if material.clearcoat.factor != DVec3::ZERO {
            self.push_number_or_texture(
                keys,
                ("clearcoat_roughness", 0.0),
                &material.clearcoat_roughness,
                "g",
            );
        }
    }

    /// Adds the keys that all material types share.
    fn write_common_keys(&mut self, keys: &mut TomlEntries, material: &ModelMaterial) {
        let emission = &material.emission;
        if emission.factor != DVec3::ZERO {
            match &emission.texture {
                Some(texture) => {
                    let name = self.ensure_texture_table(texture, TextureUse::Colors, DVec3::ONE);
                    let scale = emission.factor;
                    let scale = if scale == DVec3::ONE {
                        String::new()
                    } else {
                        format!(", scale = {}", format_color(scale))
                    };
                    keys.push(("emission", format!("{{ texture = {}{scale} }}", quote_toml_string(&name))));
                }
                None => keys.push(("emission", format_color(emission.factor))),
            }
            if material.is_two_sided {
                keys.push(("emission_sides", "\"both\"".to_owned()));
            }
        }
        if let Some(normal) = &material.normal {
            let name = self.ensure_texture_table(normal, TextureUse::Normals, DVec3::ONE);
            keys.push(("normal_map", quote_toml_string(&name)));
            if material.normal_strength != 1.0 {
                keys.push(("normal_strength", format_number(material.normal_strength)));
            }
        }
        if material.glass.is_some() {
            return;
        }
        match &material.alpha {
            Alpha::Opaque => {}
            Alpha::Mask { value, cutoff } => {
                self.write_opacity(keys, value, &material.color);
                // A cutoff has no effect if it is 0 or if alpha is always 1.
                if *cutoff > 0.0 && (value.texture.is_some() || value.factor != DVec3::ONE) {
                    keys.push(("opacity_cutoff", format_number(*cutoff)));
                }
            }
            Alpha::Blend(value) => self.write_opacity(keys, value, &material.color),
        }
    }

    /// Writes the opacity, reading it from the texture's alpha channel if there is a texture.
    fn write_opacity(&mut self, keys: &mut TomlEntries, value: &TexturedValue, color: &TexturedValue) {
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
                keys.push((
                    "opacity",
                    format!("{{ texture = {}, channel = \"a\" }}", quote_toml_string(&name)),
                ));
            }
            None if value.factor != DVec3::ONE => keys.push(("opacity", format_number(value.factor.x))),
            None => {}
        }
    }

    fn push_color_or_texture(
        &mut self,
        keys: &mut TomlEntries,
        (key, usual): (&'static str, f64),
        slot: &TexturedValue,
    ) {
        match &slot.texture {
            Some(texture) => {
                let name = self.ensure_texture_table(texture, TextureUse::Colors, slot.factor);
                keys.push((key, format!("{{ texture = {} }}", quote_toml_string(&name))));
            }
            None if slot.factor != DVec3::splat(usual) => {
                let most = if key == "color" { slot.factor.min(DVec3::ONE) } else { slot.factor };
                keys.push((key, format_color(most)));
            }
            None => {}
        }
    }

    fn push_number_or_texture(
        &mut self,
        keys: &mut TomlEntries,
        (key, usual): (&'static str, f64),
        slot: &TexturedValue,
        channel: &str,
    ) {
        match &slot.texture {
            Some(texture) => {
                let name = self.ensure_texture_table(texture, TextureUse::Numbers, slot.factor);
                keys.push((
                    key,
                    format!("{{ texture = {}, channel = \"{channel}\" }}", quote_toml_string(&name)),
                ));
            }
            None if slot.factor.x != usual => keys.push((key, format_number(slot.factor.x))),
            None => {}
        }
    }

    /// Returns a texture's name, writing its table if the texture is new.
    fn ensure_texture_table(&mut self, texture: &TextureRef, use_: TextureUse, factor: DVec3) -> String {
        let mut keys = TomlEntries::new();
        if texture.is_nearest {
            keys.push(("filter", "\"nearest\"".to_owned()));
        }
        match texture.wrap {
            TextureWrap::Repeat => {}
            TextureWrap::Clamp => keys.push(("wrap", "\"clamp\"".to_owned())),
            TextureWrap::Mirror => keys.push(("wrap", "\"mirror\"".to_owned())),
        }
        if texture.is_second {
            keys.push(("uv", "1".to_owned()));
        }
        if texture.repeat != Vec2::ONE {
            keys.push(("repeat", format_pair(texture.repeat)));
        }
        if texture.rotate != 0.0 {
            keys.push(("rotate", format_number(texture.rotate)));
        }
        if texture.offset != Vec2::ZERO {
            keys.push(("offset", format_pair(texture.offset)));
        }
        if factor != DVec3::ONE {
            keys.push(("factor", format_color(factor)));
        }
        let shared = keys.iter().map(|(key, value)| format!("{key}={value};")).collect();
        let identity = (texture.image, use_, shared);
        if let Some(known) = self.textures.get(&identity) {
            return known.clone();
        }
        let wanted = self.scene.image_name(texture.image);
        let name = self.names.make_unique(&wanted, "image");
        let TextureFileReference { file, image } = self.scene.image_file_reference(texture.image);
        let toml = &mut self.scene.toml;
        toml.table(&format!("[textures.{}]", format_key(&name)));
        toml.key_value("file", quote_toml_string(&file));
        if let Some(image) = image {
            toml.key_value("image", image.to_string());
        }
        keys.iter().for_each(|(key, value)| toml.key_value(key, value));
        self.textures.insert(identity, name.clone());
        name
    }
}
