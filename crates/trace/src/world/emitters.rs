//! The lights of a scene: those without extent, and the objects that emit.

use std::sync::Arc;

use super::lower::{emission, file_emission};
use super::{Geometry, Images, MeshInstance, Object};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::Shape;
use crate::lights::MeshEmitter;
use crate::lights::{
    AreaLight, Ball, Chart, DirectionalLight, EmissionTexture, Environment, Light, LightBounds, Lights,
    Patch, PhotonSource, PointLight, SkyMap, SpotLight, area_light,
};
use crate::lights::{Emitter, Part};
use crate::materials::Emission;
use crate::materials::texels::Texels;
use crate::math::DVec3;
use crate::scene::description::{self, Scene};

/// The map of the environment, from the texels of its file. `None` if they are black.
pub fn sky(texels: &Arc<Texels>) -> Option<Arc<SkyMap>> {
    SkyMap::new(Arc::clone(texels)).map(Arc::new)
}

/// The lights of a scene with these objects: those without extent first, then the environment, then the objects that emit.
/// A mesh is a light for each of its emitting materials. `sky` is the environment's map, if it has one.
///
/// # Errors
/// [`Cancelled`] if the token is cancelled.
pub fn lights(
    scene: &Scene,
    geometry: &Geometry,
    images: &Images,
    sky: Option<Arc<SkyMap>>,
    token: &CancelToken,
) -> Result<Arc<Lights>, Cancelled> {
    let points = scene.lights.iter().filter(|light| light.sends());
    let points = points.map(|light| described(light, geometry.origin()));
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

/// Source of the photons of a scene with these objects. `None` if no light emits photons.
pub fn photon_source(geometry: &Geometry, lights: &Arc<Lights>) -> Option<PhotonSource> {
    let outline = |object: u32| geometry.objects().get(object as usize).map(Object::outline);
    let balls: Vec<Ball> = geometry.objects().iter().filter_map(Object::ball).collect();
    PhotonSource::new(lights, outline, Ball::around(&balls))
}

/// The environment. `None` if it is black.
fn around(environment: &description::Environment, sky: Option<Arc<SkyMap>>) -> Option<Environment> {
    if !environment.sends() {
        return None;
    }
    let description::Environment { color, file, rotate } = environment;
    match file {
        Some(_) => Some(Environment::map(sky?, *color, *rotate)),
        None => Some(Environment::Constant(*color)),
    }
}

/// A light that is not a shape, in coordinates that start at `origin`.
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

/// The emission; none if its texture is black all over.
fn lit(emission: Emission) -> Emission {
    match &emission.texture {
        Some(texture) if emission.shines() && texture.texels.is_black() => Emission::NONE,
        Some(_) | None => emission,
    }
}

/// The light of a shape that emits.
fn shape_light(shape: &Shape, emission: &Emission, object: u32) -> Option<AreaLight> {
    let light = area_light(shape, emission.scale, object).filter(|_| emission.shines())?;
    let light = AreaLight { bounds: of_mean(light.bounds, emission), ..light };
    Some(match &emission.texture {
        Some(texture) => light.with_texture(EmissionTexture::new(texture, Chart::Shape(*shape))),
        None => light,
    })
}

/// Bounds of a lamp as bright as the mean of its texture.
fn of_mean(bounds: LightBounds, emission: &Emission) -> LightBounds {
    emission.texture.as_ref().map_or(bounds, |texture| bounds.times(texture.mean()))
}

/// Lights of a mesh whose triangles all have this emission. `None` stands for the emission of their own materials.
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
        let texture = emission.texture.as_ref().map(|texture| {
            let patch =
                |id| Patch { primitive: id, corners: mesh.world_corners(id), uvs: mesh.corner_uvs(id) };
            let patches = triangles_of(mesh, own).map(patch).collect();
            Box::new(EmissionTexture::new(texture, Chart::Triangles(patches)))
        });
        Ok(Some(AreaLight {
            shape: Emitter::Mesh(emitter),
            radiance: emission.scale,
            texture,
            object,
            part: Part::Listed,
            bounds,
        }))
    };
    let lights = emissions.into_iter().filter(|(_, emission)| emission.shines()).map(light);
    lights.filter_map(Result::transpose).collect()
}

/// The triangles of one of the mesh file's own materials. `None` stands for all triangles.
fn triangles_of(mesh: &MeshInstance, own: Option<u32>) -> impl Iterator<Item = u32> {
    let mesh = &mesh.tree.loaded().mesh;
    let is_meant = move |id: &u32| own.is_none() || mesh.materials.get(*id as usize).copied() == own;
    (0..mesh.triangles.len() as u32).filter(is_meant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::LoadedMesh;
    use crate::control::CancelToken;
    use crate::geometry::mesh::TriangleMesh;
    use crate::lights::{Numbers, Start};
    use crate::math::transform::Transform;
    use crate::math::{Vec3, random};
    use crate::scene::description::Accel;
    use crate::world::MeshTree;

    #[test]
    fn photons_leave_a_convex_mesh_wherever_it_stands_and_however_large_it_is() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let mesh = TriangleMesh { positions, triangles, ..TriangleMesh::default() };
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        let token = CancelToken::new();
        let tree = Arc::new(MeshTree::build(loaded, Accel::Bvh, &token).expect("nobody cancels"));
        let turned = DVec3::new(30.0, -50.0, 80.0);
        for (scale, at) in [
            (DVec3::ONE, DVec3::ZERO),
            (DVec3::new(0.5, -2.0, 1.0), DVec3::new(3.0, -1.0, 2.0)),
            (DVec3::splat(1e-2), DVec3::new(1e3, 20.0, -400.0)),
            (DVec3::new(1e4, 1e4, -1e3), DVec3::new(-1.0, 5.0, 0.0)),
        ] {
            let transform = Transform::scale_rotate_translate(scale, turned, at);
            let mesh = MeshInstance::new(Arc::clone(&tree), transform, false);
            let emission = Emission::constant(Vec3::ONE);
            let lights = mesh_lights(0, &mesh, Some(&emission), &Images::default(), &CancelToken::new())
                .expect("nobody cancels");
            let lights = lights.into_iter().map(Light::Area).collect();
            let lights = Arc::new(Lights::new(lights, &CancelToken::new()).expect("nobody cancels"));
            let geometry = Geometry::build(vec![Object::Mesh(Box::new(mesh))], &token);
            let geometry = geometry.expect("nobody cancels");
            let source = photon_source(&geometry, &lights).expect("it shines");
            let mut next = random::unit(1);
            for _ in 0..20_000 {
                let mut pair = || [next(), next()];
                let u = Numbers { light: pair(), aim: pair(), position: pair(), direction: pair() };
                let photon = source.emit(&u).expect("a photon");
                assert!(matches!(photon.start, Start::Surface { .. }));
                assert_eq!(geometry.closest(&photon.ray()), None, "{scale} {at}: {photon:?}");
            }
        }
    }
}
