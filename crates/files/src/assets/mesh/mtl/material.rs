//! The renderer's material of an MTL's statements.

use std::path::Path;

use super::MtlMaterial;
use super::map::Kind;
use super::statements::{Colour, Number};
use crate::assets::{FileMaterial, PhysicalMaterial};
use crate::math::{DVec3, Vec3};

/// A material for the renderer; files are relative to `folder`, the MTL's. Missing values are those of other readers of
/// the format: diffuse 0.6 grey without a texture, white with one; black below the reflections of a mirror.
pub(in crate::assets::mesh) fn material(found: &MtlMaterial, folder: &Path) -> FileMaterial {
    let texture = |kind| found.map(kind).and_then(|map| map.texture(folder));
    let specular = color(found, Colour::Specular, 0.0);
    let is_mirror =
        matches!(found.illumination, Some(at) if matches!(at.value, 3 | 5 | 8)) && specular != Vec3::ZERO;
    let diffuse_texture = texture(Kind::Diffuse);
    let plain = match diffuse_texture {
        Some(_) => 1.0,
        None if is_mirror => 0.0,
        None => 0.6,
    };
    let emission_texture = texture(Kind::Emission);
    let shining = if emission_texture.is_some() { 1.0 } else { 0.0 };
    let normals = found.map(Kind::Normal).or(found.map(Kind::Bump));
    FileMaterial {
        name: found.name.clone(),
        diffuse: color(found, Colour::Diffuse, plain),
        specular,
        shininess: (found.number(Number::Shininess).unwrap_or(0.0) as f32).max(0.0),
        emission: color(found, Colour::Emission, shining),
        ior: found.number(Number::Ior).unwrap_or(1.0) as f32,
        illumination_model: found.illumination.map(|at| at.value),
        opacity: opacity(found),
        opacity_texture: texture(Kind::Opacity),
        diffuse_texture,
        specular_texture: texture(Kind::Specular),
        emission_texture,
        normal_texture: normals.and_then(|map| map.texture(folder)),
        normal_strength: normals.map_or(1.0, |map| map.strength as f32),
        physical: physical(found, folder),
    }
}

/// The color, with 0 for negative components.
fn color(found: &MtlMaterial, color: Colour, otherwise: f32) -> Vec3 {
    let color = found.color(color);
    color.map_or(Vec3::splat(otherwise), |at| DVec3::from_array(at.value).as_vec3().max(Vec3::ZERO))
}

/// The opacity: `d`, or else 1 − `Tr`, unless that alone would hide the material.
fn opacity(found: &MtlMaterial) -> f32 {
    let transparency = found.number(Number::Transparency).map(|part| 1.0 - part);
    let opacity = found.number(Number::Dissolve).or(transparency);
    if is_hidden_by_tr(found) { 1.0 } else { opacity.unwrap_or(1.0).clamp(0.0, 1.0) as f32 }
}

/// Whether `Tr` says without `d` that there is nothing to see: MeshLab and others write so what is opaque.
pub(super) fn is_hidden_by_tr(found: &MtlMaterial) -> bool {
    let transparency = found.number(Number::Transparency);
    found.number(Number::Dissolve).is_none() && transparency.is_some_and(|part| part >= 1.0)
}

/// The extension for physically based rendering.
fn physical(found: &MtlMaterial, folder: &Path) -> Option<PhysicalMaterial> {
    const NUMBERS: [Number; 7] = [
        Number::Roughness,
        Number::Metallic,
        Number::Coat,
        Number::CoatRoughness,
        Number::Sheen,
        Number::Anisotropy,
        Number::AnisotropyRotation,
    ];
    let [roughness_map, metallic_map] = [Kind::Roughness, Kind::Metallic].map(|kind| found.map(kind));
    let is_physical = NUMBERS.iter().any(|number| found.number(*number).is_some());
    let has_maps = roughness_map.is_some() || metallic_map.is_some();
    let number =
        |number, otherwise| found.number(number).map_or(otherwise, |value| value.clamp(0.0, 1.0) as f32);
    (is_physical || has_maps).then(|| PhysicalMaterial {
        roughness: number(Number::Roughness, 0.5),
        metallic: number(Number::Metallic, 0.0),
        clearcoat: number(Number::Coat, 0.0),
        clearcoat_roughness: number(Number::CoatRoughness, 0.0),
        roughness_texture: roughness_map.and_then(|map| map.texture(folder)),
        metallic_texture: metallic_map.and_then(|map| map.texture(folder)),
    })
}
