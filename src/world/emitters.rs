//! The lights of a scene: those without extent, and the objects that emit.

use std::sync::Arc;

use super::lower::{emission, file_emission};
use super::{Geometry, Images, MeshInstance, Object};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::Shape;
use crate::lights::emitter::{Emitter, Part};
use crate::lights::mesh::MeshEmitter;
use crate::lights::{
    AreaLight, Chart, DirectionalLight, Environment, Light, LightBounds, Lights, Patch, Pattern, PointLight,
    SkyMap, SpotLight, area_light,
};
use crate::materials::Emission;
use crate::materials::texels::Texels;
use crate::math::{DVec3, Vec3};
use crate::scene::description::{self, Scene};

/// The map of the environment, by the texels of its file; none where they are black.
pub fn sky(texels: &Arc<Texels>) -> Option<Arc<SkyMap>> {
    SkyMap::new(Arc::clone(texels)).map(Arc::new)
}

/// The lights of a scene with these objects: those without extent first, then the environment, then the objects that emit.
/// A mesh is a light for each of its emitting materials. `sky` is the map of an environment that has one.
///
/// # Errors
/// [`Cancelled`] when the token was told so.
pub fn lights(
    scene: &Scene,
    geometry: &Geometry,
    images: &Images,
    sky: Option<Arc<SkyMap>>,
    token: &CancelToken,
) -> Result<Arc<Lights>, Cancelled> {
    let points = scene.lights.iter().map(|light| described(light, geometry.origin()));
    let objects = (0_u32..).zip(geometry.objects()).zip(&scene.objects);
    let emissions: Vec<Emission> =
        scene.materials.iter().map(|material| lit(emission(scene, images, &material.emission))).collect();
    let environment = scene.environment.as_ref().and_then(|environment| around(environment, sky));
    let mut all: Vec<Light> = points.chain(environment.map(Light::Environment)).collect();
    for ((id, object), described) in objects {
        let emission = described.material.map(|index| &emissions[index]);
        match object {
            Object::Shape(shape) => {
                let light = emission.and_then(|emission| shape_light(shape, emission, id));
                all.extend(light.map(Light::Area));
            }
            Object::Mesh(mesh) => {
                all.extend(mesh_lights(id, mesh, emission, images, token)?.into_iter().map(Light::Area));
            }
        }
    }
    Ok(Arc::new(Lights::new(all, token)?))
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

/// Nothing, where a texture is black all over.
fn lit(emission: Emission) -> Emission {
    match &emission.texture {
        Some(texture) if emission.shines() && texture.texels.is_black() => Emission::NONE,
        Some(_) | None => emission,
    }
}

/// The light that a shape is which emits.
fn shape_light(shape: &Shape, emission: &Emission, object: u32) -> Option<AreaLight> {
    let light = area_light(shape, emission.scale, object).filter(|_| emission.shines())?;
    let light = AreaLight { bounds: of_mean(light.bounds, emission), ..light };
    Some(match &emission.texture {
        Some(texture) => light.with_pattern(Pattern::new(texture, Chart::Shape(*shape))),
        None => light,
    })
}

/// Bounds of a lamp as bright as the mean of its texture.
fn of_mean(bounds: LightBounds, emission: &Emission) -> LightBounds {
    emission.texture.as_ref().map_or(bounds, |texture| bounds.times(texture.mean()))
}

/// Of a mesh whose triangles all emit this; none: what their own materials emit.
fn mesh_lights(
    object: u32,
    mesh: &MeshInstance,
    emission: Option<&Emission>,
    images: &Images,
    token: &CancelToken,
) -> Result<Vec<AreaLight>, Cancelled> {
    let loaded = mesh.tree.loaded();
    let emissions: Vec<(Option<u32>, Emission)> = match emission {
        Some(emission) => vec![(None, emission.clone())],
        None => {
            let of_file = |material| lit(file_emission(images, material));
            (0..).zip(&loaded.materials).map(|(own, material)| (Some(own), of_file(material))).collect()
        }
    };
    let light = |(own, emission): (Option<u32>, Emission)| -> Result<Option<AreaLight>, Cancelled> {
        let triangles = triangles_of(mesh, own).map(|id| (mesh.world_corners(id), id)).collect();
        let Some(emitter) = MeshEmitter::new(triangles, token)? else { return Ok(None) };
        let bounds = of_mean(emitter.bounds().times(emission.scale), &emission);
        let pattern = emission.texture.as_ref().map(|texture| {
            let patch =
                |id| Patch { primitive: id, corners: mesh.world_corners(id), uvs: mesh.corner_uvs(id) };
            let patches = triangles_of(mesh, own).map(patch).collect();
            Box::new(Pattern::new(texture, Chart::Triangles(patches)))
        });
        Ok(Some(AreaLight {
            shape: Emitter::Mesh(emitter),
            radiance: emission.scale,
            pattern,
            object,
            part: Part::Listed,
            bounds,
        }))
    };
    let lights = emissions.into_iter().filter(|(_, emission)| emission.shines()).map(light);
    lights.filter_map(Result::transpose).collect()
}

/// The triangles of one of the mesh file's own materials; none: all.
fn triangles_of(mesh: &MeshInstance, own: Option<u32>) -> impl Iterator<Item = u32> {
    let mesh = &mesh.tree.loaded().mesh;
    let is_meant = move |id: &u32| own.is_none() || mesh.materials.get(*id as usize).copied() == own;
    (0..mesh.triangles.len() as u32).filter(is_meant)
}
