//! Assembly of a world.

use std::sync::Arc;

use super::plain::PlainMaterial;
use super::straight::Passable;
use super::{Bodies, Camera, Geometry, ObjectMaterial, Parts, World, lower};
use crate::assets::LoadedMesh;
use crate::control::CancelToken;
use crate::lights::Lights;
use crate::materials::{Material, UvSet};
use crate::scene::description::{self, Scene};

impl World {
    /// Assembles a world from its parts.
    pub fn new(scene: &Scene, parts: &Parts, geometry: Arc<Geometry>, lights: Arc<Lights>) -> Self {
        let (materials, object_materials) = lower_materials(scene, parts);
        let camera = parts.camera.as_ref().unwrap_or(&scene.camera);
        let camera = Camera::new(camera, parts.orbiter.as_ref()).seen_from(geometry.origin());
        let is_rough = |material: &Material| material.bsdf.glass().is_some_and(|glass| !glass.is_smooth());
        let has_rough_glass = materials.iter().any(is_rough);
        let has_glass = materials.iter().any(|material| material.bsdf.glass().is_some());
        let bodies = parts.bodies.clone().unwrap_or_else(|| Arc::new(bodies_of(scene, parts)));
        let world = Self {
            camera,
            geometry,
            plain: materials.iter().map(PlainMaterial::of).collect(),
            has_directions: materials.iter().any(|material| material.bsdf.has_direction()),
            textured: materials.iter().map(Material::is_textured).collect(),
            mipmapped: materials.iter().map(Material::is_mipmapped).collect(),
            materials,
            object_materials,
            lights,
            has_open_glass: bodies.has_open(),
            has_glass,
            has_rough_glass,
            bodies,
            dark_bodies: Box::default(),
            glass_at_eye: Vec::new(),
            bodies_at_eye: Vec::new(),
            has_second_uvs: has_second_uvs(scene, parts),
            colored: colored(scene),
            passable: None,
        };
        Self {
            dark_bodies: world.find_dark_bodies(),
            glass_at_eye: world.find_glass_at_eye(),
            bodies_at_eye: world.find_bodies_at_eye(),
            passable: Passable::of(&world).map(Box::new),
            ..world
        }
    }
}

/// Whether a texture asks for the second set of coordinates, and a mesh has one.
fn has_second_uvs(scene: &Scene, parts: &Parts) -> bool {
    let asks = scene.textures.iter().any(|texture| texture.uv == UvSet::Second);
    asks && parts.meshes.iter().any(|mesh| !mesh.loaded().mesh.second_uvs.is_empty())
}

fn bodies_of(scene: &Scene, parts: &Parts) -> Bodies {
    let meshes: Vec<&LoadedMesh> = parts.meshes.iter().map(|mesh| mesh.loaded()).collect();
    // A token that nobody cancels.
    Bodies::find(scene, &meshes, &CancelToken::new()).unwrap_or_default()
}

/// Whether the vertex colours of each object count. `None` if those of none do.
fn colored(scene: &Scene) -> Option<Box<[bool]>> {
    let is_colored =
        |object: &description::Object| object.shape.mesh().is_some_and(|mesh| mesh.vertex_colors);
    let all: Box<[bool]> = scene.objects.iter().map(is_colored).collect();
    all.contains(&true).then_some(all)
}

/// The scene's materials, then each mesh file's, then the one for triangles without any.
fn lower_materials(scene: &Scene, parts: &Parts) -> (Vec<Material>, Vec<ObjectMaterial>) {
    let mut materials: Vec<_> =
        scene.materials.iter().map(|material| lower::material(scene, &parts.images, material)).collect();
    let mut first_of_file = Vec::new();
    for mesh in &parts.meshes {
        first_of_file.push(materials.len() as u32);
        materials.extend(mesh.loaded().materials.iter().map(|own| lower::file_material(&parts.images, own)));
    }
    let fallback = materials.len() as u32;
    materials.push(lower::fallback_material());
    let of_object = |object: &description::Object| match (object.material, object.shape.mesh()) {
        (Some(index), _) => ObjectMaterial::One(index as u32),
        (None, Some(mesh)) => ObjectMaterial::OfFile { first: first_of_file[mesh.file], fallback },
        (None, None) => ObjectMaterial::One(fallback),
    };
    let of_objects = scene.objects.iter().map(of_object).collect();
    (materials, of_objects)
}
