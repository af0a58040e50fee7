//! Merges a glTF file's scene into one mesh with mesh-file materials.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::description::{AffineMap, AlphaMode, ModelMaterial};
use super::{GltfError, GltfFile, ModelScene};
use crate::assets::{AssetError, FileMaterial, LoadedMesh, PhysicalMaterial};
use crate::control::{CancelToken, ignore_progress};
use crate::geometry::mesh::TriangleMesh;
use crate::math::origin::local_coordinate_origin;
use crate::math::{DVec3, Vec3};

/// Maximum number of triangles in a merged scene, counting every instance.
const MAX_TRIANGLES: usize = 1 << 25;

impl GltfFile {
    /// Merges the file's scene into one mesh.
    ///
    /// # Errors
    /// Same as [`GltfFile::convert_scene`] and [`GltfFile::build_part_mesh`]. Also fails if the scene has no faces
    /// or too many triangles.
    pub fn merge_scene_into_mesh(&self, token: &CancelToken) -> Result<LoadedMesh, AssetError> {
        let scene = self.convert_scene(token)?;
        let Some([min, max]) = scene.bounds else {
            return Err(self.malformed_error(GltfError::new("its scene has no visible faces")));
        };
        let origin = local_coordinate_origin((min + max) * 0.5, (max - min).max_element() * 0.5);
        let (companions, pictures) = (self.companions.clone(), self.image_file_paths());
        let mut merged = LoadedMesh { hash: self.hash, companions, pictures, ..LoadedMesh::default() };
        merged.mesh.origin = origin;
        merged.material_warnings = self.dropped_texture_warnings(&scene);
        merged.warnings = scene.notes;
        merged.materials = scene.materials.iter().map(to_file_material).collect();
        // Add all instances. In the merged mesh, either all vertices have an attribute or none do.
        let mut parts: HashMap<usize, TriangleMesh> = HashMap::new();
        for instance in &scene.instances {
            let part = match parts.entry(instance.part) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => {
                    let LoadedMesh { mesh, dropped, .. } =
                        self.build_part_mesh(instance.part, &ignore_progress, token)?;
                    merged.dropped.degenerate += dropped.degenerate;
                    merged.dropped.non_finite += dropped.non_finite;
                    new.insert(mesh)
                }
            };
            if merged.mesh.triangles.len() + part.triangles.len() > MAX_TRIANGLES {
                return Err(self.malformed_error(GltfError::new(format!(
                    "more than {MAX_TRIANGLES} triangles including instances; use `glimt import` to keep the instances"
                ))));
            }
            append_part(&mut merged.mesh, part, &instance.placed, instance.material as u32);
            token.check_pause_and_cancel()?;
        }
        Ok(merged)
    }

    fn dropped_texture_warnings(&self, scene: &ModelScene) -> Vec<String> {
        let has_texture =
            |material: &ModelMaterial| material.color.texture.is_some() || material.normal.is_some();
        let textured = scene.materials.iter().filter(|material| has_texture(material)).count();
        let warning = format!(
            "textures of {textured} materials are not shown in [[mesh]]; use `glimt import` to keep them"
        );
        if textured > 0 { vec![warning] } else { Vec::new() }
    }
}

/// Appends a transformed part to the merged mesh.
fn append_part(merged: &mut TriangleMesh, part: &TriangleMesh, placed: &AffineMap, material: u32) {
    let first = merged.positions.len() as u32;
    let positions = part.positions.iter().map(|at| at.as_dvec3() + part.origin);
    merged.positions.extend(positions.map(|at| (placed.transform_point(at) - merged.origin).as_vec3()));
    // Fill in attributes that this part or earlier parts lack.
    append_attribute(&mut merged.normals, first, &part.normals, part.positions.len(), Vec3::ZERO, |normal| {
        let transformed = placed.linear.inverse().transpose() * normal.as_dvec3();
        transformed.normalize_or_zero().as_vec3()
    });
    append_attribute(
        &mut merged.uvs,
        first,
        &part.uvs,
        part.positions.len(),
        crate::math::Vec2::ZERO,
        |uv| uv,
    );
    let second = &part.second_uvs;
    append_attribute(
        &mut merged.second_uvs,
        first,
        second,
        part.positions.len(),
        crate::math::Vec2::ZERO,
        |uv| uv,
    );
    append_attribute(&mut merged.colors, first, &part.colors, part.positions.len(), [255; 3], |color| color);
    // Swap two corners in mirrored parts to keep their orientation.
    let is_mirrored = placed.linear.determinant() < 0.0;
    let oriented = |[a, b, c]: [u32; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
    merged
        .triangles
        .extend(part.triangles.iter().map(|corners| oriented(corners.map(|corner| first + corner))));
    merged.materials.resize(merged.triangles.len(), material);
}

/// Appends a part's values for a vertex attribute. The list stays empty until a part has the attribute.
fn append_attribute<T: Copy>(
    all: &mut Vec<T>,
    first: u32,
    more: &[T],
    count: usize,
    missing: T,
    map: impl Fn(T) -> T,
) {
    if all.is_empty() && more.is_empty() {
        return;
    }
    all.resize(first as usize, missing);
    all.extend(more.iter().map(|value| map(*value)));
    all.resize(first as usize + count, missing);
}

/// Converts the material properties that mesh files support.
fn to_file_material(material: &ModelMaterial) -> FileMaterial {
    let number = |slot: &super::TexturedValue| slot.factor.x as f32;
    let (reflected, transmitted) = match &material.diffuse_transmission {
        None => (material.color.factor, DVec3::ZERO),
        Some(through) => {
            let weight = through.weight.factor.x;
            (material.color.factor * (1.0 - weight), through.color.factor * weight)
        }
    };
    FileMaterial {
        name: material.name.clone(),
        diffuse: reflected.as_vec3(),
        specular: Vec3::ZERO,
        shininess: 1.0,
        emission: material.emission.factor.as_vec3(),
        ior: material.ior as f32,
        illumination_model: material.glass.map(|_| 7),
        opacity: match &material.alpha {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Blend(value) => number(value),
            AlphaMode::Mask { value, cutoff } if value.factor.x < *cutoff => 0.0,
            AlphaMode::Mask { .. } => 1.0,
        },
        opacity_texture: None,
        diffuse_texture: None,
        specular_texture: None,
        emission_texture: None,
        normal_texture: None,
        normal_strength: 1.0,
        physical: Some(PhysicalMaterial {
            roughness: number(&material.roughness),
            metallic: number(&material.metallic),
            clearcoat: number(&material.clearcoat),
            clearcoat_roughness: number(&material.clearcoat_roughness),
            diffuse_transmission: transmitted.as_vec3(),
            ..PhysicalMaterial::default()
        }),
    }
}
