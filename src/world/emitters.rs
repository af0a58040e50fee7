//! The lights of a scene: those without extent, and the objects that emit.

use std::sync::Arc;

use super::lower::file_emission;
use super::{Geometry, MeshInstance, Object};
use crate::lights::emitter::{Emitter, Part};
use crate::lights::mesh::MeshEmitter;
use crate::lights::{
    AreaLight, DirectionalLight, Environment, Light, Lights, PointLight, SkyMap, SpotLight, area_light,
};
use crate::materials::texels::Texels;
use crate::math::{DVec3, Vec3};
use crate::scene::description::{self, Scene};

/// The map of the environment, by the texels of its file; none where they are black.
pub fn sky(texels: &Arc<Texels>) -> Option<Arc<SkyMap>> {
    SkyMap::new(Arc::clone(texels)).map(Arc::new)
}

/// The lights of a scene with these objects: those without extent first, then the environment, then the objects that emit.
/// A mesh is a light for each of its emitting materials. `sky` is the map of an environment that has one.
pub fn lights(scene: &Scene, geometry: &Geometry, sky: Option<Arc<SkyMap>>) -> Arc<Lights> {
    let points = scene.lights.iter().map(|light| described(light, geometry.origin()));
    let objects = (0_u32..).zip(geometry.objects()).zip(&scene.objects);
    let areas = objects.flat_map(|((id, object), described)| {
        let emission = described.material.map(|index| scene.materials[index].emission);
        match object {
            Object::Shape(shape) => match emission {
                Some(radiance) if radiance != Vec3::ZERO => {
                    area_light(shape, radiance, id).into_iter().collect()
                }
                Some(_) | None => Vec::new(),
            },
            Object::Mesh(mesh) => mesh_lights(id, mesh, emission),
        }
    });
    let environment = scene.environment.as_ref().and_then(|environment| around(environment, sky));
    let all = points.chain(environment.map(Light::Environment)).chain(areas.map(Light::Area));
    Arc::new(Lights::new(all.collect()))
}

/// Light from all around; none where it is black.
fn around(environment: &description::Environment, sky: Option<Arc<SkyMap>>) -> Option<Environment> {
    let description::Environment { color, file, rotate } = environment;
    if *color == Vec3::ZERO {
        return None;
    }
    match file {
        Some(_) => Some(Environment::map(sky?, *color, *rotate)),
        None => Some(Environment::Constant(*color)),
    }
}

/// A light that is no shape, in coordinates that start at `origin`.
fn described(light: &description::Light, origin: DVec3) -> Light {
    let point = |light: &description::PointLight| {
        let description::PointLight { position, intensity, falloff } = *light;
        PointLight { position: position - origin, intensity, falloff }
    };
    match light {
        description::Light::Point(light) => Light::Point(point(light)),
        description::Light::Spot(light) => {
            let axis = (light.look_at - light.point.position).normalize().as_vec3();
            let half_angle = (light.angle.to_radians() * 0.5) as f32;
            Light::Spot(SpotLight { point: point(&light.point), axis, half_angle, blend: light.blend })
        }
        description::Light::Directional(light) => {
            let to_light = -light.direction.normalize().as_vec3();
            Light::Directional(DirectionalLight::new(to_light, light.irradiance, light.angle.to_radians()))
        }
    }
}

/// Of a mesh whose triangles all emit this; none: what their own materials emit.
fn mesh_lights(object: u32, mesh: &MeshInstance, emission: Option<Vec3>) -> Vec<AreaLight> {
    let loaded = mesh.tree.loaded();
    let emissions: Vec<(Option<u32>, Vec3)> = match emission {
        Some(radiance) => vec![(None, radiance)],
        None => {
            (0..).zip(&loaded.materials).map(|(own, material)| (Some(own), file_emission(material))).collect()
        }
    };
    let light = |(own, radiance): (Option<u32>, Vec3)| {
        let triangles = triangles_of(mesh, own).map(|id| (mesh.world_corners(id), id)).collect();
        let mesh = MeshEmitter::new(triangles)?;
        let bounds = mesh.bounds().times(radiance);
        Some(AreaLight { shape: Emitter::Mesh(mesh), radiance, object, part: Part::Listed, bounds })
    };
    emissions.into_iter().filter(|(_, radiance)| *radiance != Vec3::ZERO).filter_map(light).collect()
}

/// The triangles of one of the mesh file's own materials; none: all.
fn triangles_of(mesh: &MeshInstance, own: Option<u32>) -> impl Iterator<Item = u32> {
    let mesh = &mesh.tree.loaded().mesh;
    let is_meant = move |id: &u32| own.is_none() || mesh.materials.get(*id as usize).copied() == own;
    (0..mesh.triangles.len() as u32).filter(is_meant)
}
