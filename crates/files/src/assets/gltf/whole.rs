//! A whole glTF file as one mesh: its scene, each part in its place, with what materials of mesh files can say.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::description::{Alpha, ModelMaterial, Placed};
use super::{Container, ModelScene, Wrong};
use crate::assets::{AssetError, FileMaterial, LoadedMesh, PhysicalMaterial};
use crate::control::{CancelToken, ignore_progress};
use crate::geometry::mesh::TriangleMesh;
use crate::math::Vec3;
use crate::math::origin::origin_near;

/// Most triangles of a whole file, instances counted.
const MOST_TRIANGLES: usize = 1 << 25;

impl Container {
    /// The file's scene as one mesh.
    ///
    /// # Errors
    /// As for [`Container::scene`] and [`Container::part`]; a scene without faces, or with too many.
    pub fn whole(&self, token: &CancelToken) -> Result<LoadedMesh, AssetError> {
        let scene = self.scene(token)?;
        let Some([least, greatest]) = scene.bounds else {
            return Err(self.wrong(Wrong::new("its scene shows no faces")));
        };
        let origin = origin_near((least + greatest) * 0.5, (greatest - least).max_element() * 0.5);
        let (companions, pictures) = (self.companions.clone(), self.pictures());
        let mut whole = LoadedMesh { hash: self.hash, companions, pictures, ..LoadedMesh::default() };
        whole.mesh.origin = origin;
        whole.material_warnings = self.material_warnings(&scene);
        whole.warnings = scene.notes;
        whole.materials = scene.materials.iter().map(file_material).collect();
        // Normals, coordinates and colours are all vertices' or nobody's.
        let mut parts: HashMap<usize, TriangleMesh> = HashMap::new();
        for instance in &scene.instances {
            let part = match parts.entry(instance.part) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => {
                    let LoadedMesh { mesh, dropped, .. } =
                        self.part(instance.part, &ignore_progress, token)?;
                    whole.dropped.degenerate += dropped.degenerate;
                    whole.dropped.non_finite += dropped.non_finite;
                    new.insert(mesh)
                }
            };
            if whole.mesh.triangles.len() + part.triangles.len() > MOST_TRIANGLES {
                return Err(self.wrong(Wrong::new(format!(
                    "more than {MOST_TRIANGLES} triangles with all instances; `glimt import` makes a scene of instances"
                ))));
            }
            append(&mut whole.mesh, part, &instance.placed, instance.material as u32);
            token.check()?;
        }
        Ok(whole)
    }

    fn material_warnings(&self, scene: &ModelScene) -> Vec<String> {
        let has_texture =
            |material: &ModelMaterial| material.color.texture.is_some() || material.normal.is_some();
        let textured = scene.materials.iter().filter(|material| has_texture(material)).count();
        let warning = format!(
            "the textures of {textured} of its materials are not shown in [[mesh]]; `glimt import` makes a scene with them"
        );
        if textured > 0 { vec![warning] } else { Vec::new() }
    }
}

/// Adds a placed part.
fn append(whole: &mut TriangleMesh, part: &TriangleMesh, placed: &Placed, material: u32) {
    let first = whole.positions.len() as u32;
    let positions = part.positions.iter().map(|at| at.as_dvec3() + part.origin);
    whole.positions.extend(positions.map(|at| (placed.point(at) - whole.origin).as_vec3()));
    // A missing value is filled in where others have one.
    fill(&mut whole.normals, first, &part.normals, part.positions.len(), Vec3::ZERO, |normal| {
        let turned = placed.linear.inverse().transpose() * normal.as_dvec3();
        turned.normalize_or_zero().as_vec3()
    });
    fill(&mut whole.uvs, first, &part.uvs, part.positions.len(), crate::math::Vec2::ZERO, |uv| uv);
    let second = &part.second_uvs;
    fill(&mut whole.second_uvs, first, second, part.positions.len(), crate::math::Vec2::ZERO, |uv| uv);
    fill(&mut whole.colors, first, &part.colors, part.positions.len(), [255; 3], |color| color);
    // A mirrored part keeps its front.
    let is_mirrored = placed.linear.determinant() < 0.0;
    let turned = |[a, b, c]: [u32; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
    whole.triangles.extend(part.triangles.iter().map(|corners| turned(corners.map(|corner| first + corner))));
    whole.materials.resize(whole.triangles.len(), material);
}

/// Adds values of vertices to a list that is empty while no vertex has one.
fn fill<T: Copy>(all: &mut Vec<T>, first: u32, more: &[T], count: usize, missing: T, map: impl Fn(T) -> T) {
    if all.is_empty() && more.is_empty() {
        return;
    }
    all.resize(first as usize, missing);
    all.extend(more.iter().map(|value| map(*value)));
    all.resize(first as usize + count, missing);
}

/// The parts of a material that a mesh file can state.
fn file_material(material: &ModelMaterial) -> FileMaterial {
    let number = |slot: &super::Slot| slot.factor.x as f32;
    FileMaterial {
        name: material.name.clone(),
        diffuse: material.color.factor.as_vec3(),
        specular: Vec3::ZERO,
        shininess: 1.0,
        emission: material.emission.factor.as_vec3(),
        ior: material.ior as f32,
        illumination_model: material.glass.map(|_| 7),
        opacity: match &material.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Blend(value) => number(value),
            Alpha::Mask { value, cutoff } if value.factor.x < *cutoff => 0.0,
            Alpha::Mask { .. } => 1.0,
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
            roughness_texture: None,
            metallic_texture: None,
        }),
    }
}
