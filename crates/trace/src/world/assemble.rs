//! Assembles a world from its prepared parts.

use std::sync::Arc;

use super::null_interaction::SeeThroughObjects;
use super::packet_material::PacketShadingMaterial;
use super::{Camera, Geometry, GlassSolids, ObjectMaterial, World, WorldInputs, file_materials, lower};
use crate::assets::LoadedMesh;
use crate::control::CancelToken;
use crate::lights::Lights;
use crate::materials::{Material, UvSet};
use crate::math::DVec3;
use crate::math::transform::Transform;
use crate::scene::description::{self, Scene};

impl World {
    /// Assembles a world.
    pub fn new(scene: &Scene, inputs: &WorldInputs, geometry: Arc<Geometry>, lights: Arc<Lights>) -> Self {
        let (materials, object_materials) = lower_materials(scene, inputs);
        let camera = inputs.camera.as_ref().unwrap_or(&scene.camera);
        let camera = Camera::from_description(camera, inputs.orbiter.as_ref())
            .relative_to(geometry.coordinate_origin());
        let is_rough =
            |material: &Material| material.bsdf.as_dielectric().is_some_and(|glass| !glass.is_smooth());
        let has_rough_glass = materials.iter().any(is_rough);
        let has_glass = materials.iter().any(|material| material.bsdf.as_dielectric().is_some());
        let solids =
            inputs.glass_solids.clone().unwrap_or_else(|| Arc::new(find_glass_solids(scene, inputs)));
        let has_second_uvs = scene_uses_second_uvs(scene, inputs);
        let object_frames = find_object_frames(scene, geometry.coordinate_origin());
        let world = Self {
            camera,
            geometry,
            packet_material: materials.iter().map(PacketShadingMaterial::from_material).collect(),
            has_directions: materials.iter().any(|material| material.bsdf.is_anisotropic()),
            textured: materials.iter().map(Material::needs_uvs_or_tangents).collect(),
            mipmapped: materials.iter().map(Material::uses_footprint).collect(),
            materials,
            object_materials,
            lights,
            has_open_glass: solids.has_open(),
            has_glass,
            has_rough_glass,
            glass_solids: solids,
            unlit_glass: Box::default(),
            lens_glass: Vec::new(),
            enclosing_glass: Box::default(),
            camera_solids: Vec::new(),
            solids_near_ray_origins: Vec::new(),
            has_second_uvs,
            has_extra_coordinates: has_second_uvs || object_frames.is_some(),
            object_frames,
            colored: vertex_color_usage_by_object(scene),
            see_through: None,
        };
        Self {
            unlit_glass: world.find_glass_not_touching_lights(),
            lens_glass: world.find_closed_glass_near_lens(),
            enclosing_glass: world.closed_glass_shapes_by_subtree(),
            camera_solids: world.find_solids_around_camera(),
            solids_near_ray_origins: world.find_solids_near_ray_origins(),
            see_through: SeeThroughObjects::from_world(&world).map(Box::new),
            ..world
        }
    }
}

/// Whether any texture uses the second UV set and any mesh has a second UV set.
fn scene_uses_second_uvs(scene: &Scene, inputs: &WorldInputs) -> bool {
    let asks = scene.textures.iter().any(|texture| texture.uv_set() == Some(UvSet::Second));
    asks && inputs.meshes.iter().any(|mesh| !mesh.loaded_mesh().mesh.second_uvs.is_empty())
}

/// For each object whose textures use the shape's own coordinates, the map from these coordinates to world
/// coordinates. `None` if there is no such object.
fn find_object_frames(scene: &Scene, origin: DVec3) -> Option<Box<[Option<Transform>]>> {
    let frame =
        |object: &description::Object| object.placement.is_some().then(|| object.object_frame(origin));
    let frames = scene.objects.iter().any(|object| object.placement.is_some());
    frames.then(|| scene.objects.iter().map(frame).collect())
}

fn find_glass_solids(scene: &Scene, inputs: &WorldInputs) -> GlassSolids {
    let meshes: Vec<&LoadedMesh> = inputs.meshes.iter().map(|mesh| mesh.loaded_mesh()).collect();
    // This token is never canceled.
    GlassSolids::find(scene, &meshes, &CancelToken::new()).unwrap_or_default()
}

/// Whether each object's vertex colors are used, or `None` if no object uses them.
fn vertex_color_usage_by_object(scene: &Scene) -> Option<Box<[bool]>> {
    let is_colored =
        |object: &description::Object| object.shape.as_mesh().is_some_and(|mesh| mesh.vertex_colors);
    let all: Box<[bool]> = scene.objects.iter().map(is_colored).collect();
    all.contains(&true).then_some(all)
}

/// The scene's materials, followed by the materials of each mesh file and the fallback for triangles without
/// a material.
fn lower_materials(scene: &Scene, inputs: &WorldInputs) -> (Vec<Material>, Vec<ObjectMaterial>) {
    let mut materials: Vec<_> = scene
        .materials
        .iter()
        .map(|material| lower::lower_material(scene, &inputs.images, material))
        .collect();
    let mut first_of_file = Vec::new();
    for mesh in &inputs.meshes {
        first_of_file.push(materials.len() as u32);
        materials.extend(
            mesh.loaded_mesh()
                .materials
                .iter()
                .map(|own| file_materials::lower_file_material(&inputs.images, own)),
        );
    }
    let fallback = materials.len() as u32;
    materials.push(file_materials::fallback_material());
    let of_object = |object: &description::Object| match (object.material, object.shape.as_mesh()) {
        (Some(index), _) => ObjectMaterial::One(index as u32),
        (None, Some(mesh)) => ObjectMaterial::OfFile { first: first_of_file[mesh.file], fallback },
        (None, None) => ObjectMaterial::One(fallback),
    };
    let of_objects = scene.objects.iter().map(of_object).collect();
    (materials, of_objects)
}
