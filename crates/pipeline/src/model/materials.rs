//! Writes the `[textures]` and `[materials]` tables of a converted glTF file.

use std::collections::HashMap;

use super::Unique;
use super::toml::{Toml, color, key_name, number, pair};
use crate::assets::gltf::{Alpha, ModelMaterial, ModelScene, TextureRef, TextureWrap, TexturedValue};
use crate::math::{DVec3, Vec2};
use crate::scene::quoted;

/// Access to the scene text and image files while writing materials.
pub(super) trait Files {
    /// The scene text.
    fn toml(&mut self) -> &mut Toml;
    /// Name of an image, without an extension.
    fn image_name(&self, image: usize) -> String;
    /// The file that contains an image.
    fn image(&mut self, image: usize) -> TextureFile;
}

/// File of a texture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureFile {
    /// Path as it appears in the scene.
    pub(super) file: String,
    /// Index of the image in a glTF file.
    pub(super) image: Option<usize>,
}

/// How a texture's values are used. Each use has its own table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum TextureUse {
    Colors,
    Numbers,
    Normals,
}

/// Keys and values of a table.
type TableKeys = Vec<(&'static str, String)>;

/// Identity of a texture: its image, use, and other table keys.
type TextureIdentity = (usize, TextureUse, String);

/// Writer for materials and their textures.
pub(super) struct MaterialWriter<'a, F> {
    files: &'a mut F,
    textures: HashMap<TextureIdentity, String>,
    names: Unique,
}

impl<F: Files> MaterialWriter<'_, F> {
    /// Writes the tables and returns the material names.
    pub(super) fn write(scene: &ModelScene, names: &mut Unique, files: &mut F) -> Vec<String> {
        let mut all = MaterialWriter { files, textures: HashMap::new(), names: Unique::default() };
        scene
            .materials
            .iter()
            .map(|material| {
                let name = names.name(&material.name, "material");
                all.material(material, &name);
                name
            })
            .collect()
    }

    fn material(&mut self, material: &ModelMaterial, name: &str) {
        // Collect the keys first, because texture tables precede the material's table.
        let mut keys = TableKeys::new();
        match material.glass {
            Some(glass) => {
                keys.push(("type", "\"glass\"".to_owned()));
                self.number(&mut keys, ("roughness", 0.0), &material.roughness, "g");
                if glass.tint != DVec3::ONE {
                    keys.push(("tint", color(glass.tint)));
                }
            }
            None => self.principled(&mut keys, material),
        }
        if material.ior != 1.5 {
            keys.push(("ior", number(material.ior)));
        }
        self.surface(&mut keys, material);
        let toml = self.files.toml();
        toml.table(&format!("[materials.{}]", key_name(name)));
        keys.iter().for_each(|(key, value)| toml.key(key, value));
    }

    fn principled(&mut self, keys: &mut TableKeys, material: &ModelMaterial) {
        keys.push(("type", "\"principled\"".to_owned()));
        self.color(keys, ("color", 0.8), &material.color);
        self.number(keys, ("metallic", 0.0), &material.metallic, "b");
        self.number(keys, ("roughness", 0.5), &material.roughness, "g");
        self.number(keys, ("specular", 1.0), &material.specular, "a");
        self.color(keys, ("specular_color", 1.0), &material.specular_color);
        self.number(keys, ("transmission", 0.0), &material.transmission, "r");
        self.number(keys, ("clearcoat", 0.0), &material.clearcoat, "r");
        if material.clearcoat.factor != DVec3::ZERO {
            self.number(keys, ("clearcoat_roughness", 0.0), &material.clearcoat_roughness, "g");
        }
    }

    /// Adds the keys that all material types share.
    fn surface(&mut self, keys: &mut TableKeys, material: &ModelMaterial) {
        let emission = &material.emission;
        if emission.factor != DVec3::ZERO {
            match &emission.texture {
                Some(texture) => {
                    let name = self.texture(texture, TextureUse::Colors, DVec3::ONE);
                    let scale = emission.factor;
                    let scale = if scale == DVec3::ONE {
                        String::new()
                    } else {
                        format!(", scale = {}", color(scale))
                    };
                    keys.push(("emission", format!("{{ texture = {}{scale} }}", quoted(&name))));
                }
                None => keys.push(("emission", color(emission.factor))),
            }
            if material.is_two_sided {
                keys.push(("emission_sides", "\"both\"".to_owned()));
            }
        }
        if let Some(normal) = &material.normal {
            let name = self.texture(normal, TextureUse::Normals, DVec3::ONE);
            keys.push(("normal_map", quoted(&name)));
            if material.normal_strength != 1.0 {
                keys.push(("normal_strength", number(material.normal_strength)));
            }
        }
        if material.glass.is_some() {
            return;
        }
        match &material.alpha {
            Alpha::Opaque => {}
            Alpha::Mask { value, cutoff } => {
                self.opacity(keys, value, &material.color);
                // A cutoff has no effect if it is 0 or if alpha is always 1.
                if *cutoff > 0.0 && (value.texture.is_some() || value.factor != DVec3::ONE) {
                    keys.push(("opacity_cutoff", number(*cutoff)));
                }
            }
            Alpha::Blend(value) => self.opacity(keys, value, &material.color),
        }
    }

    /// Writes the opacity, which uses the alpha channel of a texture if there is one.
    fn opacity(&mut self, keys: &mut TableKeys, value: &TexturedValue, color: &TexturedValue) {
        match &value.texture {
            Some(texture) => {
                // Without factors, color and alpha can share a texture table.
                let is_same = color.texture.as_ref() == Some(texture) && color.factor == DVec3::ONE;
                let use_ = if is_same && value.factor == DVec3::ONE {
                    TextureUse::Colors
                } else {
                    TextureUse::Numbers
                };
                let name = self.texture(texture, use_, value.factor);
                keys.push(("opacity", format!("{{ texture = {}, channel = \"a\" }}", quoted(&name))));
            }
            None if value.factor != DVec3::ONE => keys.push(("opacity", number(value.factor.x))),
            None => {}
        }
    }

    fn color(&mut self, keys: &mut TableKeys, (key, usual): (&'static str, f64), slot: &TexturedValue) {
        match &slot.texture {
            Some(texture) => {
                let name = self.texture(texture, TextureUse::Colors, slot.factor);
                keys.push((key, format!("{{ texture = {} }}", quoted(&name))));
            }
            None if slot.factor != DVec3::splat(usual) => {
                let most = if key == "color" { slot.factor.min(DVec3::ONE) } else { slot.factor };
                keys.push((key, color(most)));
            }
            None => {}
        }
    }

    fn number(
        &mut self,
        keys: &mut TableKeys,
        (key, usual): (&'static str, f64),
        slot: &TexturedValue,
        channel: &str,
    ) {
        match &slot.texture {
            Some(texture) => {
                let name = self.texture(texture, TextureUse::Numbers, slot.factor);
                keys.push((key, format!("{{ texture = {}, channel = \"{channel}\" }}", quoted(&name))));
            }
            None if slot.factor.x != usual => keys.push((key, number(slot.factor.x))),
            None => {}
        }
    }

    /// Returns a texture's name. Writes its table if it is new.
    fn texture(&mut self, texture: &TextureRef, use_: TextureUse, factor: DVec3) -> String {
        let mut keys = TableKeys::new();
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
            keys.push(("repeat", pair(texture.repeat)));
        }
        if texture.rotate != 0.0 {
            keys.push(("rotate", number(texture.rotate)));
        }
        if texture.offset != Vec2::ZERO {
            keys.push(("offset", pair(texture.offset)));
        }
        if factor != DVec3::ONE {
            keys.push(("factor", color(factor)));
        }
        let shared = keys.iter().map(|(key, value)| format!("{key}={value};")).collect();
        let identity = (texture.image, use_, shared);
        if let Some(known) = self.textures.get(&identity) {
            return known.clone();
        }
        let wanted = self.files.image_name(texture.image);
        let name = self.names.name(&wanted, "image");
        let TextureFile { file, image } = self.files.image(texture.image);
        let toml = self.files.toml();
        toml.table(&format!("[textures.{}]", key_name(&name)));
        toml.key("file", quoted(&file));
        if let Some(image) = image {
            toml.key("image", image.to_string());
        }
        keys.iter().for_each(|(key, value)| toml.key(key, value));
        self.textures.insert(identity, name.clone());
        name
    }
}
