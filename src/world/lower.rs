//! From the description's materials and those of mesh files to materials that can be looked up.

use std::path::Path;
use std::sync::Arc;

use super::Parts;
use super::textures::{TextureSource, Use, declared_source, file_source};
use crate::assets::FileMaterial;
use crate::materials::normal_map::NormalMap;
use crate::materials::texels::{TexelData, Texels};
use crate::materials::texture::{Color, Texture, TextureFilter, Wrap};
use crate::materials::{Glass, Material, Mirror, Phong};
use crate::math::{Vec2, Vec3};
use crate::scene::description::{self, ColorSource, MaterialKind, Scene};

/// A material of the scene file.
pub fn material(scene: &Scene, parts: &Parts, kind: &MaterialKind) -> Material {
    match kind {
        MaterialKind::Phong { diffuse, specular, shininess, ambient, emission, normal_map } => {
            let color = |source: &ColorSource| declared_color(scene, parts, source);
            Material::Phong(Phong {
                diffuse: color(diffuse),
                specular: color(specular),
                shininess: *shininess,
                ambient: ambient.as_ref().map(color),
                emission: *emission,
                normal_map: normal_map.map(|(texture, strength)| NormalMap {
                    texture: declared_texture(scene, parts, texture, Use::Normal),
                    strength,
                }),
            })
        }
        MaterialKind::Mirror { reflectance } => Material::Mirror(Mirror { reflectance: *reflectance }),
        MaterialKind::Glass { ior, tint } => Material::Glass(Glass { ior: *ior, tint: *tint }),
    }
}

/// A material of a mesh file. Models 3, 5 and 8 of the MTL format with a highlight are mirrors, 4, 6, 7 and 9 glass;
/// the highlight's strength k becomes ks = 2k/(α + 2).
pub fn file_material(parts: &Parts, own: &FileMaterial) -> Material {
    match own.illumination_model {
        Some(3 | 5 | 8) if own.specular.max_element() > 0.0 => {
            Material::Mirror(Mirror { reflectance: own.specular.min(Vec3::ONE) })
        }
        Some(4 | 6 | 7 | 9) => Material::Glass(Glass { ior: own.ior.clamp(1.0, 10.0), tint: Vec3::ONE }),
        _ => {
            let texture = |path: &Path, used| file_texture(parts, &file_source(path, used));
            let normalised = own.specular * (2.0 / (own.shininess + 2.0));
            Material::Phong(Phong {
                diffuse: own
                    .diffuse_texture
                    .as_ref()
                    .map_or(Color::Constant(own.diffuse), |path| Color::Texture(texture(path, Use::Color))),
                specular: own
                    .specular_texture
                    .as_ref()
                    .map_or(Color::Constant(normalised), |path| Color::Texture(texture(path, Use::Color))),
                shininess: own.shininess,
                ambient: None,
                emission: own.emission,
                normal_map: own
                    .normal_texture
                    .as_ref()
                    .map(|path| NormalMap { texture: texture(path, Use::Normal), strength: 1.0 }),
            })
        }
    }
}

/// For triangles of a mesh file that name no material.
pub fn fallback_material() -> Material {
    Material::Phong(Phong {
        diffuse: Color::Constant(Vec3::splat(0.7)),
        specular: Color::Constant(Vec3::ZERO),
        shininess: 1.0,
        ambient: None,
        emission: Vec3::ZERO,
        normal_map: None,
    })
}

fn declared_color(scene: &Scene, parts: &Parts, source: &ColorSource) -> Color {
    match source {
        ColorSource::Constant(color) => Color::Constant(*color),
        ColorSource::Texture(index) => Color::Texture(declared_texture(scene, parts, *index, Use::Color)),
    }
}

fn declared_texture(scene: &Scene, parts: &Parts, index: usize, used: Use) -> Arc<Texture> {
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
        Arc::new(Texels { width: 1, height: 1, data: TexelData::Linear8(vec![[128, 128, 255]]) })
    })
}
