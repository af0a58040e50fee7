//! From the description's materials and those of mesh files to materials that are ready for look-ups.

use std::path::PathBuf;
use std::sync::Arc;

use super::textures::{FILE_NUMBER, FILE_OPACITY, TextureSource, declared_source, file_source};
use super::{Image, Images};
use crate::assets::{FileMaterial, PhysicalMaterial};
use crate::materials::texels::{TexelData, Texels};
use crate::materials::texture::{Color, Moved, Texture, TextureFilter, Wrap};
use crate::materials::{
    Bsdf, Bump, Coated, Emission, EmissionCoat, Glass, Material, Metal, MetalFresnel, Mirror, NormalMap,
    Number, Opacity, Pane, Phong, Plastic, Principled, PrincipledInputs, Relief, Rough,
};
use crate::math::{DVec3, Vec2, Vec3};
use crate::scene::description::{
    self, ColorSource, FresnelSource, MaterialKind, NumberSource, OpacitySource, PixelNumber, Scene,
    TextureUse,
};

/// A material of the scene file.
pub fn material(scene: &Scene, images: &Images, material: &description::Material) -> Material {
    let color = |source: &ColorSource| declared_color(scene, images, source);
    let number = |source: &NumberSource| declared_number(scene, images, source, PixelNumber::Luminance);
    let bsdf = match &material.kind {
        MaterialKind::Phong { diffuse, specular, shininess, ambient } => Bsdf::Rough(Rough::Phong(Phong {
            diffuse: color(diffuse),
            specular: color(specular),
            shininess: *shininess,
            ambient: ambient.as_ref().map(color),
        })),
        MaterialKind::Mirror { reflectance } => Bsdf::Mirror(Mirror::Even(color(reflectance))),
        MaterialKind::Metal { fresnel, roughness, anisotropy } => {
            metal(fresnel_of(fresnel, color), number(roughness), number(anisotropy))
        }
        MaterialKind::Plastic { diffuse, specular, ior, roughness } => {
            plastic(color(diffuse), color(specular), number(roughness), *ior)
        }
        MaterialKind::Principled {
            color: base,
            metallic,
            roughness,
            ior,
            specular,
            specular_color,
            transmission,
            clearcoat,
            clearcoat_roughness,
        } => Bsdf::Rough(Rough::Principled(Box::new(Principled::new(PrincipledInputs {
            color: color(base),
            metallic: number(metallic),
            roughness: number(roughness),
            ior: *ior,
            specular: number(specular),
            specular_color: color(specular_color),
            transmission: number(transmission),
            clearcoat: number(clearcoat),
            clearcoat_roughness: number(clearcoat_roughness),
        })))),
        MaterialKind::Glass { ior, tint, roughness } => {
            Bsdf::Glass(Glass::new(*ior, *tint).with_roughness(number(roughness)))
        }
        MaterialKind::Pane { ior, tint } => Bsdf::Pane(Pane { ior: *ior, tint: color(tint) }),
    };
    let emission = emission(scene, images, material);
    let normal_map = material.normal_map.map(|map| NormalMap {
        texture: declared_texture(scene, images, map.texture, TextureUse::Normal),
        strength: map.strength,
    });
    let bump = material.bump.map(|bump| Bump {
        texture: declared_texture(scene, images, bump.texture, TextureUse::Number(bump.number())),
        scale: bump.scale,
    });
    let relief = Relief::new(normal_map, bump);
    Material { bsdf, emission, relief, opacity: opacity(scene, images, &material.opacity) }
}

/// Opacity of a material of the scene file. `None` if the material is there everywhere.
pub fn opacity(scene: &Scene, images: &Images, source: &OpacitySource) -> Option<Opacity> {
    if source.is_full() {
        return None;
    }
    let value = declared_number(scene, images, &source.value, PixelNumber::Opacity);
    Some(Opacity { value, cutoff: source.cutoff })
}

/// A metal: a mirror if it is smooth.
fn metal(fresnel: MetalFresnel, roughness: Number, anisotropy: Number) -> Bsdf {
    if roughness.constant() == Some(0.0) {
        return Bsdf::Mirror(Mirror::Metal(fresnel));
    }
    let is_brushed = anisotropy.constant() != Some(0.0);
    let metal = Metal { fresnel, roughness, anisotropy };
    Bsdf::Rough(if is_brushed { Rough::BrushedMetal(metal) } else { Rough::Metal(metal) })
}

/// Plastic: if its coat is smooth, this is a δ lobe over what is left.
fn plastic(diffuse: Color, specular: Color, roughness: Number, ior: f32) -> Bsdf {
    let is_smooth = roughness.constant() == Some(0.0);
    let base = Rough::Plastic(Plastic::new(diffuse, specular.clone(), roughness, ior));
    if is_smooth { Bsdf::Coated(Coated { specular, ior, base }) } else { Bsdf::Rough(base) }
}

fn fresnel_of(source: &FresnelSource, color: impl Fn(&ColorSource) -> Color) -> MetalFresnel {
    match source {
        FresnelSource::Schlick(reflectance) => MetalFresnel::Schlick(color(reflectance)),
        FresnelSource::Index { eta, k } => MetalFresnel::Index { eta: color(eta), k: color(k) },
    }
}

/// Emission of a material of the scene file.
pub fn emission(scene: &Scene, images: &Images, material: &description::Material) -> Emission {
    let emission = &material.emission;
    let coat = material.emission_coat().and_then(|numbers| {
        let [weight, roughness] =
            numbers.map(|number| declared_number(scene, images, &number, PixelNumber::Luminance));
        EmissionCoat::new(weight, roughness).map(Arc::new)
    });
    let texture = emission.texture.map(|index| declared_texture(scene, images, index, TextureUse::Color));
    Emission { scale: emission.scale, texture, sides: emission.sides, coat }
}

/// Kind of a material of a mesh file. Models 4, 6, 7 and 9 of the MTL format are glass, unless a texture masks them; what the extension for physically based
/// rendering describes is principled; else models 3, 5 and 8 with a highlight are mirrors.
enum FileKind<'a> {
    Phong,
    Principled(&'a PhysicalMaterial),
    Mirror,
    Glass,
}

fn kind(own: &FileMaterial) -> FileKind<'_> {
    match (own.illumination_model, &own.physical) {
        (Some(4 | 6 | 7 | 9), _) if own.opacity_texture.is_none() => FileKind::Glass,
        (_, Some(physical)) => FileKind::Principled(physical),
        (Some(3 | 5 | 8), None) if own.specular.max_element() > 0.0 => FileKind::Mirror,
        (_, None) => FileKind::Phong,
    }
}

/// Whether a mesh file's material emits.
pub fn file_emits(own: &FileMaterial) -> bool {
    match kind(own) {
        FileKind::Phong | FileKind::Principled(_) => own.emission != Vec3::ZERO,
        FileKind::Mirror | FileKind::Glass => false,
    }
}

/// Whether a mesh file's material is glass.
pub fn file_is_glass(own: &FileMaterial) -> bool {
    match kind(own) {
        FileKind::Glass => true,
        FileKind::Phong | FileKind::Principled(_) | FileKind::Mirror => false,
    }
}

/// Index of refraction of a mesh file's material, and its transmittance per unit of length; `None` if it is not glass.
pub fn file_glass(own: &FileMaterial) -> Option<(f32, DVec3)> {
    file_is_glass(own).then(|| (own.ior.clamp(1.0, 10.0), DVec3::ONE))
}

/// Emission of the front side of a mesh file's material.
pub fn file_emission(images: &Images, own: &FileMaterial) -> Emission {
    if !file_emits(own) {
        return Emission::NONE;
    }
    match &own.emission_texture {
        None => Emission::constant(own.emission),
        // A material whose map cannot be read does not shine all over.
        Some(path) => match file_texture(images, &file_source(path, TextureUse::Color)) {
            None => Emission::NONE,
            texture => Emission { texture, ..Emission::constant(own.emission) },
        },
    }
}

/// Opacity of a mesh file's material. `None` if the material is there everywhere; glass is.
pub fn file_opacity(images: &Images, own: &FileMaterial) -> Option<Opacity> {
    if file_is_glass(own) {
        return None;
    }
    let texture = own.opacity_texture.as_ref();
    let value = match texture.and_then(|path| file_texture(images, &file_source(path, FILE_OPACITY))) {
        Some(texture) => Number::Texture(texture),
        None if own.opacity < 1.0 => Number::Constant(own.opacity),
        None => return None,
    };
    Some(Opacity { value, cutoff: 0.0 })
}

/// A material of a mesh file. The highlight's strength k becomes ks = 2k/(α + 2).
pub fn file_material(images: &Images, own: &FileMaterial) -> Material {
    let bsdf = match (kind(own), file_glass(own)) {
        (FileKind::Mirror, _) => Bsdf::Mirror(Mirror::Even(Color::Constant(own.specular.min(Vec3::ONE)))),
        (FileKind::Glass, Some((ior, tint))) => {
            let roughness = own.physical.as_ref().map_or(0.0, |physical| physical.roughness);
            Bsdf::Glass(Glass::new(ior, tint).with_roughness(Number::Constant(roughness)))
        }
        (FileKind::Principled(physical), _) => {
            return file_surface(images, own, file_principled(images, own, physical));
        }
        (FileKind::Phong | FileKind::Glass, _) => return file_surface(images, own, file_phong(images, own)),
    };
    Material { bsdf, emission: Emission::NONE, relief: None, opacity: file_opacity(images, own) }
}

/// A rough material of a mesh file, with its emission and its normal map.
fn file_surface(images: &Images, own: &FileMaterial, rough: Rough) -> Material {
    let normals = own.normal_texture.as_ref().and_then(|path| {
        let texture = file_texture(images, &file_source(path, TextureUse::Normal))?;
        Some(NormalMap { texture, strength: own.normal_strength })
    });
    // Grey ones are heights, of a length that the file does not tell.
    let normals = normals.filter(|map| !map.texture.texels.is_grey());
    Material {
        bsdf: Bsdf::Rough(rough),
        emission: file_emission(images, own),
        relief: Relief::new(normals, None),
        opacity: file_opacity(images, own),
    }
}

fn file_color(images: &Images, path: &Option<PathBuf>, constant: Vec3) -> Color {
    let texture = path.as_ref().and_then(|path| file_texture(images, &file_source(path, TextureUse::Color)));
    texture.map_or(Color::Constant(constant), Color::Texture)
}

fn file_phong(images: &Images, own: &FileMaterial) -> Rough {
    let strength = own.specular * (2.0 / (own.shininess + 2.0));
    let specular = match own.has_highlight() {
        true => file_color(images, &own.specular_texture, strength),
        false => Color::Constant(Vec3::ZERO),
    };
    Rough::Phong(Phong {
        diffuse: file_color(images, &own.diffuse_texture, own.diffuse),
        specular,
        shininess: own.shininess,
        ambient: None,
    })
}

/// A principled material of a mesh file. An index of refraction of 1 or less says nothing.
fn file_principled(images: &Images, own: &FileMaterial, physical: &PhysicalMaterial) -> Rough {
    let number = |path: &Option<PathBuf>, constant: f32| {
        let texture = path.as_ref().and_then(|path| file_texture(images, &file_source(path, FILE_NUMBER)));
        texture.map_or(Number::Constant(constant), Number::Texture)
    };
    Rough::Principled(Box::new(Principled::new(PrincipledInputs {
        color: file_color(images, &own.diffuse_texture, own.diffuse.min(Vec3::ONE)),
        metallic: number(&physical.metallic_texture, physical.metallic),
        roughness: number(&physical.roughness_texture, physical.roughness),
        ior: if own.ior > 1.0 { own.ior.min(10.0) } else { 1.5 },
        specular: Number::Constant(1.0),
        specular_color: Color::Constant(Vec3::ONE),
        transmission: Number::Constant(0.0),
        clearcoat: Number::Constant(physical.clearcoat),
        clearcoat_roughness: Number::Constant(physical.clearcoat_roughness),
    })))
}

/// The material of triangles of a mesh file that name none.
pub fn fallback_material() -> Material {
    let phong = Phong {
        diffuse: Color::Constant(Vec3::splat(0.7)),
        specular: Color::Constant(Vec3::ZERO),
        shininess: 1.0,
        ambient: None,
    };
    Material { bsdf: Bsdf::Rough(Rough::Phong(phong)), emission: Emission::NONE, relief: None, opacity: None }
}

fn declared_color(scene: &Scene, images: &Images, source: &ColorSource) -> Color {
    match source {
        ColorSource::Constant(color) => Color::Constant(*color),
        ColorSource::Texture(index) => {
            Color::Texture(declared_texture(scene, images, *index, TextureUse::Color))
        }
    }
}

/// A number of the scene file; `usual` is that of a pixel without a channel.
fn declared_number(scene: &Scene, images: &Images, source: &NumberSource, usual: PixelNumber) -> Number {
    match source {
        NumberSource::Constant(number) => Number::Constant(*number),
        NumberSource::Texture { texture, channel } => {
            let used = TextureUse::Number(channel.map_or(usual, PixelNumber::Channel));
            Number::Texture(declared_texture(scene, images, *texture, used))
        }
    }
}

fn declared_texture(scene: &Scene, images: &Images, index: usize, used: TextureUse) -> Arc<Texture> {
    let declared = &scene.textures[index];
    let &description::Texture { filter, wrap, repeat, rotate, offset, uv, factor, .. } = declared;
    let Image { texels, mipmaps } = image(images, &declared_source(scene, index, used));
    let mipmaps = match filter {
        TextureFilter::Nearest | TextureFilter::Bilinear => None,
        TextureFilter::Mipmap => mipmaps,
    };
    let moved = Moved::new(uv, rotate, offset.as_dvec2()).map(Box::new);
    let factor = match used {
        TextureUse::Color | TextureUse::Number(_) => Some(factor).filter(|factor| *factor != Vec3::ONE),
        TextureUse::Normal => None,
    };
    Arc::new(Texture { texels, mipmaps, filter, wrap, repeat, moved, factor })
}

/// A texture of a mesh file. `None` if it was not loaded: it is never looked up, or could not be read.
fn file_texture(images: &Images, source: &TextureSource) -> Option<Arc<Texture>> {
    let (filter, wrap, repeat) = (TextureFilter::Bilinear, Wrap::Repeat, Vec2::ONE);
    let texels = images.get(source)?.texels.clone();
    Some(Arc::new(Texture { texels, mipmaps: None, filter, wrap, repeat, moved: None, factor: None }))
}

/// The loaded image. A material that no object has may name textures that were not loaded: they are never looked up.
fn image(images: &Images, source: &TextureSource) -> Image {
    images.get(source).cloned().unwrap_or_else(|| {
        let data = TexelData::Linear8(vec![[128, 128, 255]]);
        Image { texels: Arc::new(Texels { width: 1, height: 1, data, unusable: 0 }), mipmaps: None }
    })
}
