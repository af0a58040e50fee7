//! Materials of a glTF file in the terms of `principled` and `glass` (glTF 2.0, 3.9, and the extensions `KHR_materials_*`).

use super::description::{Alpha, Glass, ModelMaterial, Notes, Slot, TextureRef, TextureWrap};
use super::json::{CLAMP, InfoExtensions, MIRROR, Material, NEAREST, REPEAT, TextureInfo, TextureTransform};
use super::{Container, ImageBytes, Wrong};
use crate::math::{DVec3, Vec2};

impl Material {
    /// The textures that glimt looks up.
    fn textures(&self) -> Vec<&TextureInfo> {
        let (pbr, more) = (&self.pbr_metallic_roughness, &self.extensions);
        let base = [
            &pbr.base_color_texture,
            &pbr.metallic_roughness_texture,
            &self.normal_texture,
            &self.emissive_texture,
        ];
        let glossy = more.glossiness.as_ref().map(|one| &one.diffuse_texture);
        let transmission = more.transmission.as_ref().map(|one| &one.transmission_texture);
        let coat =
            more.clearcoat.as_ref().map(|one| [&one.clearcoat_texture, &one.clearcoat_roughness_texture]);
        let specular = more.specular.as_ref().map(|one| [&one.specular_texture, &one.specular_color_texture]);
        let extended =
            glossy.into_iter().chain(transmission).chain(coat.into_iter().chain(specular).flatten());
        base.into_iter().chain(extended).flatten().collect()
    }

    /// The sets of texture coordinates of all textures, that of the colour first.
    pub(super) fn coordinate_sets(&self) -> Vec<usize> {
        self.textures().into_iter().map(TextureInfo::set).collect()
    }
}

impl TextureInfo {
    /// Its set of texture coordinates.
    fn set(&self) -> usize {
        let InfoExtensions { transform } = &self.extensions;
        transform.as_ref().and_then(|transform| transform.tex_coord).unwrap_or(self.tex_coord)
    }
}

/// Extensions whose effect glimt lacks; others that it does not read are named as unknown.
const LEFT_OUT: [(&str, &str); 6] = [
    ("KHR_materials_sheen", "its sheen is left out"),
    ("KHR_materials_iridescence", "its iridescence is left out"),
    ("KHR_materials_anisotropy", "its highlights are round: anisotropy is left out"),
    ("KHR_materials_dispersion", "its dispersion is left out"),
    ("KHR_materials_diffuse_transmission", "its diffuse transmission is left out"),
    ("KHR_materials_variants", "its variants are left out"),
];

/// Reads a material; what has no equal goes to the notes.
pub(super) fn material(
    container: &Container,
    number: usize,
    sets: [usize; 2],
    notes: &mut Notes,
) -> Result<ModelMaterial, Wrong> {
    let json = &container.root.materials[number];
    let mut reader = Reader { container, place: format!("materials[{number}]"), sets, notes };
    reader.material(json).map_err(|wrong| wrong.inside(format!("materials[{number}]")))
}

struct Reader<'a> {
    container: &'a Container,
    place: String,
    /// Sets of texture coordinates that the mesh has.
    sets: [usize; 2],
    notes: &'a mut Notes,
}

impl Reader<'_> {
    fn note(&mut self, what: &str) {
        self.notes.add(&self.place, what);
    }

    fn material(&mut self, json: &Material) -> Result<ModelMaterial, Wrong> {
        let (pbr, more) = (&json.pbr_metallic_roughness, &json.extensions);
        let mut material = ModelMaterial::named(&json.name);
        // Read what every material has.
        let [red, green, blue, alpha] = pbr.base_color_factor;
        let mut base = (DVec3::new(red, green, blue), alpha, &pbr.base_color_texture);
        material.metallic = self.number(pbr.metallic_factor, &pbr.metallic_roughness_texture)?;
        material.roughness = self.number(pbr.roughness_factor, &pbr.metallic_roughness_texture)?;
        if let Some(old) = &more.glossiness {
            self.note(
                "its specular and glossy reflection become a roughness: specular-glossiness is outdated",
            );
            let [red, green, blue, alpha] = old.diffuse_factor;
            base = (DVec3::new(red, green, blue), alpha, &old.diffuse_texture);
            material.metallic = Slot::number(0.0);
            material.roughness = Slot::number(1.0 - unit(old.glossiness_factor));
        }
        let (color, alpha, texture) = base;
        material.color = self.slot(color, texture)?;
        material.alpha = self.alpha(json, alpha, &material.color)?;
        material.is_two_sided = json.double_sided;
        if let Some(map) = &json.normal_texture {
            material.normal_strength = map.scale.max(0.0);
            material.normal = self.texture(map)?;
        }
        let strength = more.emissive_strength.as_ref().map_or(1.0, |one| one.emissive_strength);
        let emission = DVec3::from(json.emissive_factor) * strength;
        if emission.max_element() > 0.0 {
            material.emission = self.slot(emission, &json.emissive_texture)?;
        }
        // Read what extensions add.
        if let Some(ior) = &more.ior {
            // 0 stands for a reflection of everything, as old files of specular colours have it.
            if ior.ior == 0.0 {
                self.note("its index of refraction, 0 for a reflection of everything, becomes 10");
            }
            material.ior = if ior.ior == 0.0 { 10.0 } else { ior.ior.clamp(1.0, 10.0) };
        }
        if let Some(specular) = &more.specular {
            material.specular = self.number(specular.specular_factor, &specular.specular_texture)?;
            let factor = DVec3::from(specular.specular_color_factor);
            material.specular_color = self.slot(factor, &specular.specular_color_texture)?;
        }
        if let Some(coat) = &more.clearcoat {
            material.clearcoat = self.number(coat.clearcoat_factor, &coat.clearcoat_texture)?;
            let texture = &coat.clearcoat_roughness_texture;
            material.clearcoat_roughness = self.number(coat.clearcoat_roughness_factor, texture)?;
            if coat.clearcoat_normal_texture.is_some() {
                self.note("the normal map of its clear coat is left out: the coat has the material's");
            }
        }
        if let Some(transmission) = &more.transmission {
            let texture = &transmission.transmission_texture;
            material.transmission = self.number(transmission.transmission_factor, texture)?;
        }
        if let Some(volume) = more.volume.as_ref().filter(|volume| volume.thickness_factor > 0.0)
            && material.transmission.factor.x > 0.0
        {
            material.glass = self.glass(&material, volume.attenuation_color, volume.attenuation_distance);
        }
        if more.unlit {
            self.note("it is unlit: its colour becomes light, which also falls on others");
            material.emission = std::mem::replace(&mut material.color, Slot::number(0.0));
            // Nothing of its surface is left: no coat, no highlight, no glass.
            let black = || Slot::number(0.0);
            (material.metallic, material.specular) = (black(), black());
            (material.clearcoat, material.transmission, material.glass) = (black(), black(), None);
        }
        for name in &more.others {
            match LEFT_OUT.iter().find(|(known, _)| known == name) {
                Some((_, what)) => self.note(what),
                None => self.note(&format!("the extension {} is left out", super::shown(name))),
            }
        }
        Ok(material)
    }

    /// Glass that fills its shape. Its colour is what is left of the light per unit of length.
    fn glass(&mut self, material: &ModelMaterial, color: [f64; 3], distance: Option<f64>) -> Option<Glass> {
        if material.transmission.texture.is_some() || material.transmission.factor.x < 0.5 {
            self.note("its volume is left out: it is a thin sheet, as it does not transmit everywhere");
            return None;
        }
        if material.color.texture.is_some() || material.color.factor != DVec3::ONE {
            self.note("as glass it has the colour of its volume, not of its surface");
        }
        let distance = distance.filter(|distance| *distance > 0.0 && distance.is_finite());
        let left = |part: f64| distance.map_or(1.0, |distance| libm::pow(unit(part), 1.0 / distance));
        Some(Glass { tint: DVec3::from(color.map(left)) })
    }

    fn alpha(&mut self, json: &Material, alpha: f64, color: &Slot) -> Result<Alpha, Wrong> {
        let texture = match &color.texture {
            Some(texture) if self.has_alpha(texture.image) => color.texture.clone(),
            Some(_) | None => None,
        };
        let value = Slot { factor: DVec3::splat(unit(alpha)), texture };
        match json.alpha_mode.as_str() {
            "OPAQUE" => Ok(Alpha::Opaque),
            "MASK" if json.alpha_cutoff > 1.0 => {
                self.note("an alpha cutoff above 1 cuts all of it away");
                Ok(Alpha::Blend(Slot::number(0.0)))
            }
            "MASK" => Ok(Alpha::Mask { value, cutoff: unit(json.alpha_cutoff) }),
            "BLEND" => Ok(Alpha::Blend(value)),
            other => Err(Wrong::new(format!("there is no alpha mode {:?}", super::shown(other)))),
        }
    }

    /// Whether an image may have alpha, by the first bytes of PNG and JPEG files.
    fn has_alpha(&self, image: usize) -> bool {
        const COLOR_TYPE: usize = 25;
        match self.container.image(image) {
            Ok(ImageBytes::Inside(bytes)) if bytes.starts_with(b"\xff\xd8") => false,
            Ok(ImageBytes::Inside(bytes)) if bytes.starts_with(b"\x89PNG") => {
                // Grey or RGB without alpha may still have a colour that is transparent.
                let has_key = || memchr::memmem::find(&bytes[..bytes.len().min(1 << 12)], b"tRNS").is_some();
                bytes.get(COLOR_TYPE).is_some_and(|kind| kind & 4 != 0) || has_key()
            }
            Ok(ImageBytes::File(path)) => {
                let ending = path.extension().unwrap_or_default();
                !(ending.eq_ignore_ascii_case("jpg") || ending.eq_ignore_ascii_case("jpeg"))
            }
            Ok(ImageBytes::Inside(_)) => true,
            Err(_) => false,
        }
    }

    fn number(&mut self, factor: f64, texture: &Option<TextureInfo>) -> Result<Slot, Wrong> {
        self.slot(DVec3::splat(unit(factor)), texture)
    }

    fn slot(&mut self, factor: DVec3, texture: &Option<TextureInfo>) -> Result<Slot, Wrong> {
        let finite = |part: f64| if part.is_finite() { part.clamp(0.0, 1e18) } else { 0.0 };
        let factor = DVec3::from(factor.to_array().map(finite));
        let texture = match texture {
            Some(info) if factor != DVec3::ZERO => self.texture(info)?,
            Some(_) | None => None,
        };
        Ok(Slot { factor, texture })
    }

    /// A texture as far as it can be read; the notes say what cannot.
    fn texture(&mut self, info: &TextureInfo) -> Result<Option<TextureRef>, Wrong> {
        let root = &self.container.root;
        let texture = root.textures.get(info.index);
        let texture = texture.ok_or_else(|| Wrong::index("textures", info.index, root.textures.len()))?;
        let source = texture.extensions.webp.as_ref().map(|webp| webp.source).or(texture.source);
        let Some(image) = source else {
            self.note(match texture.extensions.basis {
                Some(_) => "a texture is left out: KHR_texture_basisu is not read by this version",
                None => "a texture without an image is left out",
            });
            return Ok(None);
        };
        if image >= root.images.len() {
            return Err(
                Wrong::index("images", image, root.images.len()).inside(format!("textures[{}]", info.index))
            );
        }
        let place = self.sets.iter().position(|set| *set == info.set());
        if place.is_none() {
            self.note("a texture has the coordinates of another one: a mesh has two sets of them here");
        }
        let sampler = match texture.sampler {
            Some(sampler) => root.samplers.get(sampler),
            None => None,
        };
        let wraps = sampler.map_or([REPEAT; 2], |sampler| [sampler.wrap_s, sampler.wrap_t]);
        if wraps[0] != wraps[1] {
            self.note("a texture wraps across as it does upwards");
        }
        let wrap = match wraps[1] {
            CLAMP => TextureWrap::Clamp,
            MIRROR => TextureWrap::Mirror,
            _ => TextureWrap::Repeat,
        };
        let is_nearest = sampler.is_some_and(|sampler| sampler.mag_filter == Some(NEAREST));
        let plain = TextureTransform::default();
        let moved = Moved::of(info.extensions.transform.as_ref().unwrap_or(&plain));
        Ok(Some(TextureRef {
            image,
            is_nearest,
            wrap,
            is_second: place == Some(1),
            repeat: moved.repeat,
            rotate: moved.degrees,
            offset: moved.offset,
        }))
    }
}

/// A motion of texture coordinates, in glimt's terms.
struct Moved {
    repeat: Vec2,
    degrees: f64,
    offset: Vec2,
}

impl Moved {
    /// The motion of `KHR_texture_transform`, which counts v from the top: with (u, 1 − v) for (u, v) in
    /// u' = o.x + cos·s.x·u + sin·s.y·v and v' = o.y − sin·s.x·u + cos·s.y·v, the angle stays and the offset changes.
    fn of(json: &TextureTransform) -> Self {
        let finite = |number: f64| if number.is_finite() { number.clamp(-1e9, 1e9) } else { 0.0 };
        let ([x, y], [across, down], angle) =
            (json.offset.map(finite), json.scale.map(finite), finite(json.rotation));
        // A texture that is stretched without end shows one of its texels.
        let least = |scale: f64| if scale.abs() < 1e-6 { 1e-6 } else { scale };
        let (across, down) = (least(across), least(down));
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let offset = Vec2::new((x + sin * down) as f32, (1.0 - y - cos * down) as f32);
        let tidy = |part: f32| if part.abs() < 1e-7 { 0.0 } else { part };
        Self {
            repeat: Vec2::new(across as f32, down as f32),
            degrees: angle.to_degrees(),
            offset: Vec2::new(tidy(offset.x), tidy(offset.y)),
        }
    }
}

/// A number in [0, 1]; what is not a number is 0.
fn unit(number: f64) -> f64 {
    if number.is_finite() { number.clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point of the file's coordinates goes where the extension's formula says, in coordinates that count v from the bottom.
    #[test]
    fn a_motion_of_coordinates_is_that_of_the_extension() {
        let json =
            TextureTransform { offset: [0.25, -0.5], rotation: 0.7, scale: [2.0, -3.0], tex_coord: None };
        let moved = Moved::of(&json);
        let (sin, cos) = json.rotation.sin_cos();
        for (u, v) in [(0.0, 0.0), (0.3, 0.8), (-1.5, 2.0)] {
            let expected = [
                json.offset[0] + cos * json.scale[0] * u + sin * json.scale[1] * v,
                1.0 - (json.offset[1] - sin * json.scale[0] * u + cos * json.scale[1] * v),
            ];
            let (x, y) = (u * f64::from(moved.repeat.x), (1.0 - v) * f64::from(moved.repeat.y));
            let (sin, cos) = moved.degrees.to_radians().sin_cos();
            let found = [
                x * cos - y * sin + f64::from(moved.offset.x),
                x * sin + y * cos + f64::from(moved.offset.y),
            ];
            assert!(
                (found[0] - expected[0]).abs() < 1e-6 && (found[1] - expected[1]).abs() < 1e-6,
                "{found:?} {expected:?}"
            );
        }
        let still = Moved::of(&TextureTransform::default());
        assert_eq!((still.repeat, still.degrees, still.offset), (Vec2::ONE, 0.0, Vec2::ZERO));
    }
}
