//! Converts glTF materials to `principled` and `glass` parameters (glTF 2.0, 3.9, and the extensions
//! `KHR_materials_*`).

use super::description::{
    AlphaMode, DiffuseTransmission, ImportNotes, ModelMaterial, TextureLookup, TextureWrap, TexturedValue,
    TintedGlass,
};
use super::json::{
    CLAMP, JsonMaterial, MIRROR, NEAREST, REPEAT, TextureInfo, TextureInfoExtensions, TextureTransform,
};
use super::{GltfError, GltfFile, ImageLocation};
use crate::math::{DVec3, Vec2};

impl JsonMaterial {
    /// The material's supported textures.
    fn supported_textures(&self) -> Vec<&TextureInfo> {
        let (pbr, extensions) = (&self.pbr_metallic_roughness, &self.extensions);
        let base = [
            &pbr.base_color_texture,
            &pbr.metallic_roughness_texture,
            &self.normal_texture,
            &self.emissive_texture,
        ];
        let glossy = extensions.glossiness.as_ref().map(|old| &old.diffuse_texture);
        let transmission =
            extensions.transmission.as_ref().map(|transmission| &transmission.transmission_texture);
        let coat = extensions
            .clearcoat
            .as_ref()
            .map(|coat| [&coat.clearcoat_texture, &coat.clearcoat_roughness_texture]);
        let specular = extensions
            .specular
            .as_ref()
            .map(|specular| [&specular.specular_texture, &specular.specular_color_texture]);
        let diffuse = extensions.diffuse_transmission.as_ref().map(|through| {
            [&through.diffuse_transmission_texture, &through.diffuse_transmission_color_texture]
        });
        let pairs = coat.into_iter().chain(specular).chain(diffuse).flatten();
        let extended = glossy.into_iter().chain(transmission).chain(pairs);
        base.into_iter().chain(extended).flatten().collect()
    }

    /// Texture coordinate sets used by all textures, starting with the base color texture.
    pub(super) fn coordinate_set_per_texture(&self) -> Vec<usize> {
        self.supported_textures().into_iter().map(TextureInfo::coordinate_set).collect()
    }
}

impl TextureInfo {
    /// Index of the texture coordinate set.
    fn coordinate_set(&self) -> usize {
        let TextureInfoExtensions { transform } = &self.extensions;
        transform.as_ref().and_then(|transform| transform.tex_coord).unwrap_or(self.tex_coord)
    }
}

/// Known but unsupported extensions, each with its note.
const UNSUPPORTED_EXTENSIONS: [(&str, &str); 5] = [
    ("KHR_materials_sheen", "sheen is ignored"),
    ("KHR_materials_iridescence", "iridescence is ignored"),
    ("KHR_materials_anisotropy", "anisotropy is ignored"),
    ("KHR_materials_dispersion", "dispersion is ignored"),
    ("KHR_materials_variants", "material variants are ignored"),
];

/// Note about an unknown extension.
pub(super) fn extension_ignored_note(name: &str) -> String {
    format!("extension {} is ignored", super::truncate_for_message(name))
}

/// Converts a material, and adds notes about features that glimt does not support.
pub(super) fn convert_material(
    container: &GltfFile,
    number: usize,
    sets: [usize; 2],
    notes: &mut ImportNotes,
) -> Result<ModelMaterial, GltfError> {
    let json = &container.root.materials[number];
    let mut reader = MaterialConverter { container, place: format!("materials[{number}]"), sets, notes };
    reader.convert_material(json).map_err(|wrong| wrong.add_location(format!("materials[{number}]")))
}

struct MaterialConverter<'a> {
    container: &'a GltfFile,
    place: String,
    /// The mesh's texture coordinate sets.
    sets: [usize; 2],
    notes: &'a mut ImportNotes,
}

impl MaterialConverter<'_> {
    fn note(&mut self, what: &str) {
        self.notes.add(&self.place, what);
    }

    fn convert_material(&mut self, json: &JsonMaterial) -> Result<ModelMaterial, GltfError> {
        let (pbr, extensions) = (&json.pbr_metallic_roughness, &json.extensions);
        let mut material = ModelMaterial::named_gray_dielectric(&json.name);
        // Convert the core parameters.
        let [red, green, blue, alpha] = pbr.base_color_factor;
        let mut base = (DVec3::new(red, green, blue), alpha, &pbr.base_color_texture);
        material.metallic =
            self.convert_textured_scalar(pbr.metallic_factor, &pbr.metallic_roughness_texture)?;
        material.roughness =
            self.convert_textured_scalar(pbr.roughness_factor, &pbr.metallic_roughness_texture)?;
        if let Some(old) = &extensions.glossiness {
            self.note("the obsolete specular-glossiness model is converted to roughness");
            let [red, green, blue, alpha] = old.diffuse_factor;
            base = (DVec3::new(red, green, blue), alpha, &old.diffuse_texture);
            material.metallic = TexturedValue::from_scalar(0.0);
            material.roughness = TexturedValue::from_scalar(1.0 - clamp_to_unit(old.glossiness_factor));
        }
        let (color, alpha, texture) = base;
        material.color = self.convert_textured_color(color, texture)?;
        material.alpha = self.convert_alpha_mode(json, alpha, &material.color)?;
        material.is_two_sided = json.double_sided;
        if let Some(map) = &json.normal_texture {
            material.normal_strength = map.scale.max(0.0);
            material.normal = self.texture_lookup_from_gltf(map)?;
        }
        let strength =
            extensions.emissive_strength.as_ref().map_or(1.0, |extension| extension.emissive_strength);
        let emission = DVec3::from(json.emissive_factor) * strength;
        if emission.max_element() > 0.0 {
            material.emission = self.convert_textured_color(emission, &json.emissive_texture)?;
        }
        // Convert the extensions.
        if let Some(ior) = &extensions.ior {
            // An index of refraction of 0 means full reflection. Materials converted from
            // specular-glossiness use it.
            if ior.ior == 0.0 {
                self.note("an index of refraction of 0 (full reflection) is replaced by 10");
            }
            material.ior = if ior.ior == 0.0 { 10.0 } else { ior.ior.clamp(1.0, 10.0) };
        }
        if let Some(specular) = &extensions.specular {
            material.specular =
                self.convert_textured_scalar(specular.specular_factor, &specular.specular_texture)?;
            let factor = DVec3::from(specular.specular_color_factor);
            material.specular_color =
                self.convert_textured_color(factor, &specular.specular_color_texture)?;
        }
        if let Some(coat) = &extensions.clearcoat {
            material.clearcoat =
                self.convert_textured_scalar(coat.clearcoat_factor, &coat.clearcoat_texture)?;
            let texture = &coat.clearcoat_roughness_texture;
            material.clearcoat_roughness =
                self.convert_textured_scalar(coat.clearcoat_roughness_factor, texture)?;
            if coat.clearcoat_normal_texture.is_some() {
                self.note("the clear coat's normal map is ignored; the material's normal map is used");
            }
        }
        if let Some(transmission) = &extensions.transmission {
            let texture = &transmission.transmission_texture;
            material.transmission =
                self.convert_textured_scalar(transmission.transmission_factor, texture)?;
        }
        material.diffuse_transmission = self.convert_diffuse_transmission(json, &material)?;
        if let Some(volume) = extensions.volume.as_ref().filter(|volume| volume.thickness_factor > 0.0)
            && material.transmission.factor.x > 0.0
        {
            material.glass = self.convert_volume_to_solid_glass(
                &material,
                volume.attenuation_color,
                volume.attenuation_distance,
            );
        }
        self.drop_layers_unsupported_by_glass(&mut material);
        if extensions.unlit {
            self.note("the material is unlit, so its color is emitted and also lights other surfaces");
            material.emission = std::mem::replace(&mut material.color, TexturedValue::from_scalar(0.0));
            // Remove all reflection and transmission.
            let black = || TexturedValue::from_scalar(0.0);
            (material.metallic, material.specular) = (black(), black());
            (material.clearcoat, material.transmission, material.glass) = (black(), black(), None);
            material.diffuse_transmission = None;
        }
        for name in &extensions.others {
            match UNSUPPORTED_EXTENSIONS.iter().find(|(known, _)| known == name) {
                Some((_, what)) => self.note(what),
                None => self.note(&extension_ignored_note(name)),
            }
        }
        Ok(material)
    }

    /// Converts diffuse transmission, unless it has no effect.
    fn convert_diffuse_transmission(
        &mut self,
        json: &JsonMaterial,
        material: &ModelMaterial,
    ) -> Result<Option<DiffuseTransmission>, GltfError> {
        let Some(through) = &json.extensions.diffuse_transmission else { return Ok(None) };
        let weight = self.convert_textured_scalar(
            through.diffuse_transmission_factor,
            &through.diffuse_transmission_texture,
        )?;
        let factor = DVec3::from(through.diffuse_transmission_color_factor.map(clamp_to_unit));
        let color = self.convert_textured_color(factor, &through.diffuse_transmission_color_texture)?;
        let is_metal = material.metallic.texture.is_none() && material.metallic.factor == DVec3::ONE;
        if weight.factor == DVec3::ZERO || is_metal {
            return Ok(None);
        }
        if material.transmission.factor != DVec3::ZERO {
            self.note("diffuse transmission also reduces the light that passes straight through");
        }
        let volume = json.extensions.volume.as_ref().filter(|volume| volume.thickness_factor > 0.0);
        if volume.is_some() && material.transmission.factor == DVec3::ZERO {
            self.note("the volume below a diffusely transmitting surface is ignored; the surface is thin");
        }
        Ok(Some(DiffuseTransmission { weight, color }))
    }

    /// Removes the layers that solid glass cannot have, with notes.
    fn drop_layers_unsupported_by_glass(&mut self, material: &mut ModelMaterial) {
        if material.glass.is_none() {
            return;
        }
        if material.clearcoat.factor != DVec3::ZERO {
            self.note("the clear coat of solid glass is ignored");
            material.clearcoat = TexturedValue::from_scalar(0.0);
        }
        if material.diffuse_transmission.take().is_some() {
            self.note("the diffuse transmission of solid glass is ignored");
        }
    }

    /// Converts a volume to solid glass. The attenuation color becomes the transmittance per unit of
    /// distance.
    fn convert_volume_to_solid_glass(
        &mut self,
        material: &ModelMaterial,
        color: [f64; 3],
        distance: Option<f64>,
    ) -> Option<TintedGlass> {
        if material.transmission.texture.is_some() || material.transmission.factor.x < 0.5 {
            self.note("the volume is ignored because the surface is not transmissive everywhere");
            return None;
        }
        if material.color.texture.is_some() || material.color.factor != DVec3::ONE {
            self.note("glass uses the volume's color instead of the surface color");
        }
        let distance = distance.filter(|distance| *distance > 0.0 && distance.is_finite());
        let transmittance =
            |part: f64| distance.map_or(1.0, |distance| libm::pow(clamp_to_unit(part), 1.0 / distance));
        Some(TintedGlass { tint: DVec3::from(color.map(transmittance)) })
    }

    fn convert_alpha_mode(
        &mut self,
        json: &JsonMaterial,
        alpha: f64,
        color: &TexturedValue,
    ) -> Result<AlphaMode, GltfError> {
        let texture = match &color.texture {
            Some(texture) if self.can_image_have_alpha(texture.image) => color.texture.clone(),
            Some(_) | None => None,
        };
        let value = TexturedValue { factor: DVec3::splat(clamp_to_unit(alpha)), texture };
        match json.alpha_mode.as_str() {
            "OPAQUE" => Ok(AlphaMode::Opaque),
            "MASK" if json.alpha_cutoff > 1.0 => {
                self.note("an alpha cutoff above 1 makes the surface invisible");
                Ok(AlphaMode::Blend(TexturedValue::from_scalar(0.0)))
            }
            "MASK" => Ok(AlphaMode::Mask { value, cutoff: clamp_to_unit(json.alpha_cutoff) }),
            "BLEND" => Ok(AlphaMode::Blend(value)),
            other => {
                Err(GltfError::new(format!("unknown alpha mode {:?}", super::truncate_for_message(other))))
            }
        }
    }

    /// Whether an image may have an alpha channel. Checks the first bytes of embedded images and the names of
    /// image files.
    fn can_image_have_alpha(&self, image: usize) -> bool {
        const COLOR_TYPE: usize = 25;
        match self.container.locate_image(image) {
            Ok(ImageLocation::Inside(bytes)) if bytes.starts_with(b"\xff\xd8") => false,
            Ok(ImageLocation::Inside(bytes)) if bytes.starts_with(b"\x89PNG") => {
                // Gray and RGB images may define a transparent color.
                let has_key = || memchr::memmem::find(&bytes[..bytes.len().min(1 << 12)], b"tRNS").is_some();
                bytes.get(COLOR_TYPE).is_some_and(|kind| kind & 4 != 0) || has_key()
            }
            Ok(ImageLocation::File(path)) => {
                let extension = path.extension().unwrap_or_default();
                !(extension.eq_ignore_ascii_case("jpg") || extension.eq_ignore_ascii_case("jpeg"))
            }
            Ok(ImageLocation::Inside(_)) => true,
            Err(_) => false,
        }
    }

    fn convert_textured_scalar(
        &mut self,
        factor: f64,
        texture: &Option<TextureInfo>,
    ) -> Result<TexturedValue, GltfError> {
        self.convert_textured_color(DVec3::splat(clamp_to_unit(factor)), texture)
    }

    fn convert_textured_color(
        &mut self,
        factor: DVec3,
        texture: &Option<TextureInfo>,
    ) -> Result<TexturedValue, GltfError> {
        let finite = |part: f64| if part.is_finite() { part.clamp(0.0, 1e18) } else { 0.0 };
        let factor = DVec3::from(factor.to_array().map(finite));
        let texture = match texture {
            Some(info) if factor != DVec3::ZERO => self.texture_lookup_from_gltf(info)?,
            Some(_) | None => None,
        };
        Ok(TexturedValue { factor, texture })
    }

    /// Converts a texture reference, and adds notes about unsupported features.
    fn texture_lookup_from_gltf(&mut self, info: &TextureInfo) -> Result<Option<TextureLookup>, GltfError> {
        let root = &self.container.root;
        let texture = root.textures.get(info.index);
        let texture = texture
            .ok_or_else(|| GltfError::index_out_of_range("textures", info.index, root.textures.len()))?;
        let source = texture.extensions.webp.as_ref().map(|webp| webp.source).or(texture.source);
        let Some(image) = source else {
            self.note(match texture.extensions.basis {
                Some(_) => "a texture is skipped: KHR_texture_basisu is not supported",
                None => "a texture without an image is skipped",
            });
            return Ok(None);
        };
        if image >= root.images.len() {
            return Err(GltfError::index_out_of_range("images", image, root.images.len())
                .add_location(format!("textures[{}]", info.index)));
        }
        let set = self.sets.iter().position(|used| *used == info.coordinate_set());
        if set.is_none() {
            self.note("a texture uses the wrong coordinates: only two coordinate sets are supported");
        }
        let sampler = match texture.sampler {
            Some(sampler) => root.samplers.get(sampler),
            None => None,
        };
        let wraps = sampler.map_or([REPEAT; 2], |sampler| [sampler.wrap_s, sampler.wrap_t]);
        if wraps[0] != wraps[1] {
            self.note("a texture's u wrap mode is ignored; its v wrap mode is used for both");
        }
        let wrap = match wraps[1] {
            CLAMP => TextureWrap::Clamp,
            MIRROR => TextureWrap::Mirror,
            _ => TextureWrap::Repeat,
        };
        let is_nearest = sampler.is_some_and(|sampler| sampler.mag_filter == Some(NEAREST));
        let plain = TextureTransform::default();
        let transform = UvTransform::from_gltf(info.extensions.transform.as_ref().unwrap_or(&plain));
        Ok(Some(TextureLookup {
            image,
            is_nearest,
            wrap,
            is_second: set == Some(1),
            repeat: transform.repeat,
            rotate: transform.degrees,
            offset: transform.offset,
        }))
    }
}

/// A texture coordinate transform: scale, then rotation, then translation.
struct UvTransform {
    repeat: Vec2,
    degrees: f64,
    offset: Vec2,
}

impl UvTransform {
    /// Converts `KHR_texture_transform`, which measures v from the top. Substituting (u, 1 − v) for (u, v) in
    /// u' = o.x + cos·s.x·u + sin·s.y·v and v' = o.y − sin·s.x·u + cos·s.y·v keeps the angle and changes the
    /// offset.
    fn from_gltf(json: &TextureTransform) -> Self {
        let finite = |number: f64| if number.is_finite() { number.clamp(-1e9, 1e9) } else { 0.0 };
        let ([x, y], [across, down], angle) =
            (json.offset.map(finite), json.scale.map(finite), finite(json.rotation));
        // Avoid a scale of 0, which is not invertible.
        let nonzero = |scale: f64| if scale.abs() < 1e-6 { 1e-6 } else { scale };
        let (across, down) = (nonzero(across), nonzero(down));
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let offset = Vec2::new((x + sin * down) as f32, (1.0 - y - cos * down) as f32);
        let without_noise = |part: f32| if part.abs() < 1e-7 { 0.0 } else { part };
        Self {
            repeat: Vec2::new(across as f32, down as f32),
            degrees: angle.to_degrees(),
            offset: Vec2::new(without_noise(offset.x), without_noise(offset.y)),
        }
    }
}

/// Clamps to [0, 1]. NaN becomes 0.
fn clamp_to_unit(number: f64) -> f64 {
    if number.is_finite() { number.clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the conversion with the formula from `KHR_texture_transform`, which measures v from the top.
    #[test]
    fn uv_transforms_match_the_extension() {
        let json =
            TextureTransform { offset: [0.25, -0.5], rotation: 0.7, scale: [2.0, -3.0], tex_coord: None };
        let converted = UvTransform::from_gltf(&json);
        let (sin, cos) = json.rotation.sin_cos();
        for (u, v) in [(0.0, 0.0), (0.3, 0.8), (-1.5, 2.0)] {
            let expected = [
                json.offset[0] + cos * json.scale[0] * u + sin * json.scale[1] * v,
                1.0 - (json.offset[1] - sin * json.scale[0] * u + cos * json.scale[1] * v),
            ];
            let (x, y) = (u * f64::from(converted.repeat.x), (1.0 - v) * f64::from(converted.repeat.y));
            let (sin, cos) = converted.degrees.to_radians().sin_cos();
            let found = [
                x * cos - y * sin + f64::from(converted.offset.x),
                x * sin + y * cos + f64::from(converted.offset.y),
            ];
            assert!(
                (found[0] - expected[0]).abs() < 1e-6 && (found[1] - expected[1]).abs() < 1e-6,
                "{found:?} {expected:?}"
            );
        }
        let identity = UvTransform::from_gltf(&TextureTransform::default());
        assert_eq!((identity.repeat, identity.degrees, identity.offset), (Vec2::ONE, 0.0, Vec2::ZERO));
    }
}
