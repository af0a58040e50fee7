//! Converts MTL statements to a material.

use std::path::Path;

use super::MtlMaterial;
use super::map::MapKind;
use super::statements::{MtlColorParameter, MtlScalarParameter};
use crate::assets::{FileMaterial, PhysicalMaterial};
use crate::math::{DVec3, Vec3};

/// Converts a material from the MTL file at `path`. As in other MTL readers, the default diffuse color is 0.6
/// without a texture, 1 with a texture, and 0 for mirrors. Textures that have no effect are dropped.
pub(in crate::assets::mesh) fn to_file_material(found: &MtlMaterial, path: &Path) -> FileMaterial {
    let texture = |kind| found.map(kind).and_then(|map| map.texture(path));
    let specular = color_or_default(found, MtlColorParameter::Specular, 0.0);
    let is_mirror =
        matches!(found.illumination, Some(at) if matches!(at.value, 3 | 5 | 8)) && specular != Vec3::ZERO;
    let diffuse_texture = texture(MapKind::Diffuse);
    let default_diffuse = match diffuse_texture {
        Some(_) => 1.0,
        None if is_mirror => 0.0,
        None => 0.6,
    };
    let emission_texture = texture(MapKind::Emission);
    let default_emission = if emission_texture.is_some() { 1.0 } else { 0.0 };
    let normals = found.map(MapKind::Normal).or(found.map(MapKind::Bump));
    let mut material = FileMaterial {
        name: found.name.clone(),
        diffuse: color_or_default(found, MtlColorParameter::Diffuse, default_diffuse),
        specular,
        shininess: found.number(MtlScalarParameter::Shininess).unwrap_or(0.0) as f32,
        emission: color_or_default(found, MtlColorParameter::Emission, default_emission),
        ior: found.number(MtlScalarParameter::Ior).unwrap_or(1.0) as f32,
        illumination_model: found.illumination.map(|at| at.value),
        opacity: opacity(found),
        opacity_texture: texture(MapKind::Opacity),
        diffuse_texture,
        specular_texture: texture(MapKind::Specular),
        emission_texture,
        normal_texture: normals.and_then(|map| map.texture(path)),
        normal_strength: normals.map_or(1.0, |map| map.strength as f32),
        physical: physical_material_from_pbr(found, path),
    };
    material.drop_unused_textures();
    material
}

fn color_or_default(found: &MtlMaterial, color: MtlColorParameter, default: f32) -> Vec3 {
    let color = found.color(color);
    color.map_or(Vec3::splat(default), |at| DVec3::from_array(at.value).as_vec3())
}

/// Returns the opacity: `d` if present, otherwise 1 − `Tr`. `Tr 1` without `d` means opaque.
fn opacity(found: &MtlMaterial) -> f32 {
    let transparency = found.number(MtlScalarParameter::Transparency).map(|part| 1.0 - part);
    let opacity = found.number(MtlScalarParameter::Dissolve).or(transparency);
    if is_opaque_despite_tr(found) { 1.0 } else { opacity.unwrap_or(1.0) as f32 }
}

/// Whether the material has `Tr 1` but no `d`. MeshLab and other programs write opaque materials this way.
pub(super) fn is_opaque_despite_tr(found: &MtlMaterial) -> bool {
    let transparency = found.number(MtlScalarParameter::Transparency);
    found.number(MtlScalarParameter::Dissolve).is_none() && transparency.is_some_and(|part| part >= 1.0)
}

/// The PBR extension, if the material uses it.
fn physical_material_from_pbr(found: &MtlMaterial, path: &Path) -> Option<PhysicalMaterial> {
    const NUMBERS: [MtlScalarParameter; 7] = [
        MtlScalarParameter::Roughness,
        MtlScalarParameter::Metallic,
        MtlScalarParameter::Coat,
        MtlScalarParameter::CoatRoughness,
        MtlScalarParameter::Sheen,
        MtlScalarParameter::Anisotropy,
        MtlScalarParameter::AnisotropyRotation,
    ];
    const MAPS: [MapKind; 4] = [MapKind::Roughness, MapKind::Metallic, MapKind::Coat, MapKind::CoatRoughness];
    let is_physical = NUMBERS.iter().any(|number| found.number(*number).is_some());
    if !is_physical && MAPS.iter().all(|kind| found.map(*kind).is_none()) {
        return None;
    }
    let usual = PhysicalMaterial::default();
    let number = |number, default| found.number(number).map_or(default, |value| value as f32);
    let [roughness_texture, metallic_texture, clearcoat_texture, clearcoat_roughness_texture] =
        MAPS.map(|kind| found.map(kind)?.texture(path));
    let physical = PhysicalMaterial {
        roughness: number(MtlScalarParameter::Roughness, usual.roughness),
        metallic: number(MtlScalarParameter::Metallic, usual.metallic),
        clearcoat: number(MtlScalarParameter::Coat, usual.clearcoat),
        clearcoat_roughness: number(MtlScalarParameter::CoatRoughness, usual.clearcoat_roughness),
        roughness_texture,
        metallic_texture,
        clearcoat_texture,
        clearcoat_roughness_texture,
        ..usual
    };
    let anisotropy = if physical.is_metal() { number(MtlScalarParameter::Anisotropy, 0.0) } else { 0.0 };
    Some(PhysicalMaterial { anisotropy, ..physical })
}
