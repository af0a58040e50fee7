//! From the description's materials and those of mesh files to materials that can be looked up.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Parts;
use super::textures::{TextureSource, declared_source, file_source};
use crate::assets::FileMaterial;
use crate::materials::texels::{TexelData, Texels};
use crate::materials::texture::{Color, Texture, TextureFilter, Wrap};
use crate::materials::{Bsdf, Glass, Material, Mirror, NormalMap, Phong};
use crate::math::{Vec2, Vec3};
use crate::scene::description::{self, ColorSource, MaterialKind, Scene, TextureUse};

/// A material of the scene file.
pub fn material(scene: &Scene, parts: &Parts, material: &description::Material) -> Material {
    let color = |source: &ColorSource| declared_color(scene, parts, source);
    let bsdf = match &material.kind {
        MaterialKind::Phong { diffuse, specular, shininess, ambient } => Bsdf::Phong(Phong {
            diffuse: color(diffuse),
            specular: color(specular),
            shininess: *shininess,
            ambient: ambient.as_ref().map(color),
        }),
        MaterialKind::Mirror { reflectance } => Bsdf::Mirror(Mirror { reflectance: *reflectance }),
        MaterialKind::Glass { ior, tint } => Bsdf::Glass(Glass { ior: *ior, tint: *tint }),
    };
    let normal_map = material.normal_map.map(|map| NormalMap {
        texture: declared_texture(scene, parts, map.texture, TextureUse::Normal),
        strength: map.strength,
    });
    Material { bsdf, emission: material.emission, normal_map }
}

/// What a material of a mesh file is. Models 3, 5 and 8 of the MTL format with a highlight are mirrors, 4, 6, 7 and 9 glass.
enum FileKind {
    Phong,
    Mirror,
    Glass,
}

fn kind(own: &FileMaterial) -> FileKind {
    match own.illumination_model {
        Some(3 | 5 | 8) if own.specular.max_element() > 0.0 => FileKind::Mirror,
        Some(4 | 6 | 7 | 9) => FileKind::Glass,
        _ => FileKind::Phong,
    }
}

/// Radiance of the front side of a mesh file's material.
pub fn file_emission(own: &FileMaterial) -> Vec3 {
    match kind(own) {
        FileKind::Phong => own.emission,
        FileKind::Mirror | FileKind::Glass => Vec3::ZERO,
    }
}

/// A material of a mesh file. The highlight's strength k becomes ks = 2k/(α + 2).
pub fn file_material(parts: &Parts, own: &FileMaterial) -> Material {
    let bsdf = match kind(own) {
        FileKind::Mirror => Bsdf::Mirror(Mirror { reflectance: own.specular.min(Vec3::ONE) }),
        FileKind::Glass => Bsdf::Glass(Glass { ior: own.ior.clamp(1.0, 10.0), tint: Vec3::ONE }),
        FileKind::Phong => return file_phong(parts, own),
    };
    Material { bsdf, emission: file_emission(own), normal_map: None }
}

fn file_phong(parts: &Parts, own: &FileMaterial) -> Material {
    let texture = |path: &Path, used| file_texture(parts, &file_source(path, used));
    let color = |path: &Option<PathBuf>, constant: Vec3| match path {
        Some(path) => Color::Texture(texture(path, TextureUse::Color)),
        None => Color::Constant(constant),
    };
    let phong = Phong {
        diffuse: color(&own.diffuse_texture, own.diffuse),
        specular: color(&own.specular_texture, own.specular * (2.0 / (own.shininess + 2.0))),
        shininess: own.shininess,
        ambient: None,
    };
    let normal_map = own
        .normal_texture
        .as_ref()
        .map(|path| NormalMap { texture: texture(path, TextureUse::Normal), strength: 1.0 });
    Material { bsdf: Bsdf::Phong(phong), emission: file_emission(own), normal_map }
}

/// For triangles of a mesh file that name no material.
pub fn fallback_material() -> Material {
    let phong = Phong {
        diffuse: Color::Constant(Vec3::splat(0.7)),
        specular: Color::Constant(Vec3::ZERO),
        shininess: 1.0,
        ambient: None,
    };
    Material { bsdf: Bsdf::Phong(phong), emission: Vec3::ZERO, normal_map: None }
}

fn declared_color(scene: &Scene, parts: &Parts, source: &ColorSource) -> Color {
    match source {
        ColorSource::Constant(color) => Color::Constant(*color),
        ColorSource::Texture(index) => {
            Color::Texture(declared_texture(scene, parts, *index, TextureUse::Color))
        }
    }
}

fn declared_texture(scene: &Scene, parts: &Parts, index: usize, used: TextureUse) -> Arc<Texture> {
    let declared = &scene.textures[index];
    let &description::Texture { filter, wrap, repeat, .. } = declared;
    let texels = texels(parts, &declared_source(scene, index, used));
    Arc::new(Texture { texels, filter, wrap, repeat })
}

fn file_texture(parts: &Parts, source: &TextureSource) -> Arc<Texture> {
    let texels = texels(parts, source);
    Arc::new(Texture { texels, filter: TextureFilter::Bilinear, wrap: Wrap::Repeat, repeat: Vec2::ONE })
}

/// The texels that were loaded. A material that no object has names textures that were not: they are never looked up.
fn texels(parts: &Parts, source: &TextureSource) -> Arc<Texels> {
    parts.textures.get(source).cloned().unwrap_or_else(|| {
        let data = TexelData::Linear8(vec![[128, 128, 255]]);
        Arc::new(Texels { width: 1, height: 1, data, unusable: 0 })
    })
}
