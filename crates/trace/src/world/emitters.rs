//! Builds a scene's lights: point and infinite lights, and one light per emitting surface.

use std::collections::HashSet;
use std::sync::Arc;

use super::distinct_lights::find_duplicate_emissive_triangles;
use super::file_materials::{file_material_emission, file_material_opacity};
use super::lower::{lower_blend_weight, lower_emission, lower_opacity};
use super::{Geometry, Images, MeshInstance, Object};
use crate::assets::FileMaterial;
use crate::control::{CancelToken, Canceled};
use crate::geometry::Shape;
use crate::lights::MeshEmitter;
use crate::lights::infinite::sky::sun::OrientedSunDisk;
use crate::lights::infinite::sky::{Sky, SkyFrame};
use crate::lights::infinite::{
    DirectionalLight, Environment, EnvironmentMap, MapOrientation, MapRowPlacement,
};
use crate::lights::{
    AreaLight, BlendPartWeight, BoundingSphere, EmissionModulation, EmissionTerm, Light, LightBounds, Lights,
    PhotonEmitter, Side, TriangleWithUvs, UvMapping, new_back_area_light, new_front_area_light,
    new_see_through_side_light,
};
use crate::lights::{Emitter, EmittingPart};
use crate::materials::texels::Texels;
use crate::materials::{Emission, EmissionSides, Opacity};
use crate::math::Vec3;
use crate::math::transform::Transform;
use crate::scene::description::{self, MaterialKind, Scene};

/// Sampling tables for the environment map, or `None` if the image is black.
pub fn build_environment_map(texels: &Arc<Texels>, rows: MapRowPlacement) -> Option<Arc<EnvironmentMap>> {
    EnvironmentMap::with_row_placement(Arc::clone(texels), rows).map(Arc::new)
}

/// Evaluates the environment's sky.
pub fn build_sky(sky: &description::Sky) -> Sky {
    Sky::new(&sky.parameters())
}

/// The environment map or the sky.
#[derive(Clone, Debug)]
pub enum EnvironmentSource {
    /// A map.
    Map(Arc<EnvironmentMap>),
    /// A sky.
    Sky(Sky),
}

/// Builds all lights: delta and directional lights first, then the environment and its sun, then emissive
/// objects. A mesh becomes one light per emissive material, and two-sided emission becomes two lights. `sky`
/// is the environment map or the sky, or `None` if there is none or it is black.
///
/// # Errors
/// [`Canceled`] if the token is canceled.
pub fn build_lights(
    scene: &Scene,
    geometry: &Geometry,
    images: &Images,
    sky: Option<EnvironmentSource>,
    token: &CancelToken,
) -> Result<Arc<Lights>, Canceled> {
    let points = scene.lights.iter().filter(|light| light.has_emission());
    let points = points.map(|light| light.to_traced_light(geometry.coordinate_origin()));
    let objects = (0_u32..).zip(geometry.objects()).zip(&scene.objects);
    let emissive = scene.materials.iter().map(|material| {
        let mut terms = SurfaceEmission::default();
        terms.add_material(scene, images, material, &[]);
        terms
    });
    let emissive: Vec<SurfaceEmission> = emissive.collect();
    let environment = scene.environment.as_ref().map(|environment| environment_lights(environment, sky));
    let mut all: Vec<Light> = points.chain(environment.into_iter().flatten()).collect();
    for ((id, object), described) in objects {
        let emissive = described.material.map(|index| &emissive[index]);
        match object {
            Object::Shape(shape) => {
                let frame = described.object_frame(geometry.coordinate_origin());
                let lights = emissive
                    .into_iter()
                    .flat_map(|emissive| area_lights_of_shape(shape, emissive, id, frame));
                all.extend(lights.map(Light::Area));
            }
            Object::Mesh(mesh) => {
                let frame = described.object_frame(geometry.coordinate_origin());
                let lights = mesh_lights_by_material_and_side((id, mesh, &frame), emissive, images, token)?;
                all.extend(lights.into_iter().map(Light::Area));
            }
        }
    }
    Ok(Arc::new(Lights::new(all, token)?))
}

/// Creates a scene's photon source, or returns `None` if no light emits photons.
pub fn scene_photon_emitter(geometry: &Geometry, lights: &Arc<Lights>) -> Option<PhotonEmitter> {
    let emitter_geometry =
        |object: u32| geometry.objects().get(object as usize).map(Object::emitter_geometry);
    let balls: Vec<BoundingSphere> = geometry.objects().iter().filter_map(Object::bounding_sphere).collect();
    PhotonEmitter::new(lights, emitter_geometry, BoundingSphere::enclosing_all_spheres(&balls))
}

/// The environment light and its sun, unless they are black.
fn environment_lights(
    environment: &description::Environment,
    source: Option<EnvironmentSource>,
) -> Vec<Light> {
    if !environment.has_emission() {
        return Vec::new();
    }
    let description::Environment { color, file, sky, orientation, rows: _ } = environment;
    match (sky, file, source) {
        (Some(sky), _, Some(EnvironmentSource::Sky(Sky { dome, sun }))) => {
            let rotation = environment.rotation();
            let frame = SkyFrame::new(rotation * sky.sun, rotation.y_axis);
            let dome = dome.map(|dome| Light::Environment(Environment::Sky { dome, frame }));
            let sun = sun.map(|disk| {
                let disk = OrientedSunDisk { disk, up: frame.up() };
                Light::Directional(DirectionalLight::from_sun(frame.sun(), disk))
            });
            dome.into_iter().chain(sun).collect()
        }
        (None, Some(_), Some(EnvironmentSource::Map(map))) => {
            let orientation = match orientation {
                description::MapOrientation::Turn(degrees) => MapOrientation::from_azimuth_degrees(*degrees),
                description::MapOrientation::Rotation(rotation) => {
                    MapOrientation::Rotation(rotation.as_mat3())
                }
            };
            vec![Light::Environment(Environment::from_map(map, *color, orientation))]
        }
        (None, None, _) => vec![Light::Environment(Environment::Constant(*color))],
        // The map is black.
        (Some(_), _, _) | (None, Some(_), _) => Vec::new(),
    }
}

/// Returns the emission, or [`Emission::NONE`] if its texture is entirely black.
fn emission_unless_texture_black(emission: Emission) -> Emission {
    match &emission.texture {
        Some(texture) if emission.is_emissive() && texture.is_black() => Emission::NONE,
        Some(_) | None => emission,
    }
}

/// Emission of a surface, combined with its opacity.
#[derive(Clone, Default)]
struct SurfaceEmission {
    /// One term per emissive material. [`EmissionTerm::scale`] is the radiance.
    terms: Vec<(EmissionTerm, EmissionSides)>,
    /// Whether light may pass through the surface without changing direction.
    is_sheer: bool,
}

impl SurfaceEmission {
    fn new(emission: Emission, opacity: Option<Opacity>) -> Self {
        let mut terms = Self::default();
        terms.add_term(emission, opacity, &[]);
        terms
    }

    /// Adds the emission of a material, or of all parts of a blend. `weights` are the weights of the blends
    /// that contain the material.
    fn add_material(
        &mut self,
        scene: &Scene,
        images: &Images,
        material: &description::Material,
        weights: &[BlendPartWeight],
    ) {
        if let MaterialKind::Blend { weight, parts } = &material.kind {
            let second = lower_blend_weight(scene, images, material, weight);
            for (part, is_second) in parts.iter().zip([false, true]) {
                let weight = BlendPartWeight { second: second.clone(), is_second };
                self.add_material(scene, images, part, &[weights, &[weight]].concat());
            }
        } else {
            let emission = emission_unless_texture_black(lower_emission(scene, images, material));
            self.add_term(emission, lower_opacity(scene, images, material), weights);
        }
    }

    /// Adds the emission of a material that is not a blend. Constant factors become part of the radiance.
    fn add_term(&mut self, emission: Emission, opacity: Option<Opacity>, weights: &[BlendPartWeight]) {
        self.is_sheer |= opacity.is_some();
        let Emission { mut scale, texture, sides, coat } = emission;
        scale *= opacity.as_ref().and_then(Opacity::as_untextured).unwrap_or(1.0);
        let opacity = opacity.filter(|opacity| opacity.as_untextured().is_none());
        let (constant, weights): (Vec<BlendPartWeight>, Vec<_>) =
            weights.iter().cloned().partition(|weight| weight.second.as_untextured().is_some());
        for weight in constant {
            scale *= weight.part_weight_from_second(weight.second.as_untextured().unwrap_or(1.0));
        }
        if scale != Vec3::ZERO {
            self.terms.push((EmissionTerm { scale, texture, opacity, coat, weights }, sides));
        }
    }

    /// The sides that emit light.
    fn sides(&self) -> &'static [Side] {
        if self.terms.is_empty() {
            &[]
        } else if self.terms.iter().any(|(_, sides)| *sides == EmissionSides::Both) {
            &[Side::Front, Side::Back]
        } else {
            &[Side::Front]
        }
    }

    /// Unmodulated radiance of a side, and the terms that modulate it, with scales relative to this radiance.
    fn radiance_and_terms(&self, side: Side) -> (Vec3, Vec<EmissionTerm>) {
        let of_side = |sides: EmissionSides| side == Side::Front || sides == EmissionSides::Both;
        let terms = self.terms.iter().filter(|(_, sides)| of_side(*sides)).map(|(term, _)| term);
        let radiance: Vec3 = terms.clone().map(|term| term.scale).sum();
        let part = |scale: f32, all: f32| if scale == all { 1.0 } else { scale / all };
        let relative = |scale: Vec3| {
            Vec3::new(part(scale.x, radiance.x), part(scale.y, radiance.y), part(scale.z, radiance.z))
        };
        (radiance, terms.map(|term| EmissionTerm { scale: relative(term.scale), ..term.clone() }).collect())
    }
}

/// Scales light bounds by the mean of the terms that modulate the light.
fn scale_light_bounds_by_term_means(bounds: LightBounds, terms: &[EmissionTerm]) -> LightBounds {
    match terms.iter().any(EmissionTerm::varies_in_space_or_angle) {
        true => bounds.scaled_by(terms.iter().map(EmissionTerm::mean).sum()),
        false => bounds,
    }
}

/// Creates the lights for an emitting shape, one per emitting side. `frame` maps the shape's own coordinates
/// to world coordinates.
fn area_lights_of_shape(
    shape: &Shape,
    emissive: &SurfaceEmission,
    object: u32,
    frame: Transform,
) -> impl Iterator<Item = AreaLight> {
    let of_side = move |side: &Side| {
        let (radiance, terms) = emissive.radiance_and_terms(*side);
        let light = match (emissive.is_sheer, side) {
            (true, side) => new_see_through_side_light(shape, *side, radiance, object)?,
            (false, Side::Front) => new_front_area_light(shape, radiance, object)?,
            (false, Side::Back) => new_back_area_light(shape, radiance, object)?,
        };
        let light = AreaLight { bounds: scale_light_bounds_by_term_means(light.bounds, &terms), ..light };
        Some(match EmissionModulation::from_terms(terms, UvMapping::Shape(shape.clone())) {
            Some(modulation) => light.with_modulation(modulation.with_object_frame(&frame)),
            None => light,
        })
    };
    emissive.sides().iter().filter_map(of_side)
}

/// Creates the lights for a mesh, given its object number, and the map from its own coordinates to world
/// coordinates. If `emissive` is `None`, the triangles use the mesh file's materials.
fn mesh_lights_by_material_and_side(
    (object, mesh, frame): (u32, &MeshInstance, &Transform),
    emissive: Option<&SurfaceEmission>,
    images: &Images,
    token: &CancelToken,
) -> Result<Vec<AreaLight>, Canceled> {
    let loaded = mesh.tree.loaded_mesh();
    let all: Vec<(Option<u32>, SurfaceEmission)> = match emissive {
        Some(emissive) => vec![(None, emissive.clone())],
        None => {
            let of_file = |material| {
                SurfaceEmission::new(
                    emission_unless_texture_black(file_material_emission(images, material)),
                    file_material_opacity(images, material),
                )
            };
            (0..).zip(&loaded.materials).map(|(own, material)| (Some(own), of_file(material))).collect()
        }
    };
    // Rays always hit the first of several duplicate faces, so only that face emits.
    let emits = |id: u32| {
        let own = |index: &u32| loaded.materials.get(*index as usize).is_some_and(FileMaterial::emits);
        emissive.is_some() || loaded.mesh.materials.get(id as usize).is_some_and(own)
    };
    let is_lit = all.iter().any(|(_, emissive)| !emissive.sides().is_empty());
    let repeated: HashSet<u32> = if is_lit {
        find_duplicate_emissive_triangles(&loaded.mesh, emits).map(|(id, _)| id).collect()
    } else {
        HashSet::new()
    };
    let light =
        |(own, emissive, side): (Option<u32>, &SurfaceEmission, Side)| -> Result<Option<AreaLight>, Canceled> {
            let corners = |id| match (mesh.world_corners(id), side) {
                (corners, Side::Front) => corners,
                ([a, b, c], Side::Back) => [a, c, b],
            };
            let distinct = triangles_with_material(mesh, own).filter(|id| !repeated.contains(id));
            let triangles = distinct.map(|id| (corners(id), id)).collect();
            let Some(emitter) = MeshEmitter::new(triangles, token)? else { return Ok(None) };
            let (radiance, terms) = emissive.radiance_and_terms(side);
            let bounds = scale_light_bounds_by_term_means(emitter.light_bounds().scaled_by(radiance), &terms);
            let patches = || {
                let patch = |id| TriangleWithUvs {
                    primitive: id,
                    corners: mesh.world_corners(id),
                    uvs: mesh.corner_uvs(id),
                    second_uvs: mesh.second_set_corner_uvs(id),
                };
                UvMapping::Triangles(triangles_with_material(mesh, own).map(patch).collect())
            };
            let is_varying = terms.iter().any(EmissionTerm::varies_in_space_or_angle);
            let modulation = is_varying.then(|| EmissionModulation::from_terms(terms, patches())).flatten();
            let modulation = modulation.map(|modulation| Box::new(modulation.with_object_frame(frame)));
            let (shape, part) = (Emitter::Mesh(emitter), EmittingPart::Listed);
            Ok(Some(AreaLight { shape, side, radiance, modulation, object, part, bounds }))
        };
    let of_sides = all
        .iter()
        .flat_map(|(own, emissive)| emissive.sides().iter().map(move |&side| (*own, emissive, side)));
    of_sides.map(light).filter_map(Result::transpose).collect()
}

/// Triangles with one of the mesh file's materials, or all triangles if `own` is `None`.
fn triangles_with_material(mesh: &MeshInstance, own: Option<u32>) -> impl Iterator<Item = u32> {
    let mesh = &mesh.tree.loaded_mesh().mesh;
    let has_material = move |id: &u32| own.is_none() || mesh.materials.get(*id as usize).copied() == own;
    (0..mesh.triangles.len() as u32).filter(has_material)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::LoadedMesh;
    use crate::control::CancelToken;
    use crate::geometry::mesh::TriangleMesh;
    use crate::lights::{PhotonOrigin, PhotonRandomNumbers};
    use crate::math::{DVec3, Vec3, random};
    use crate::scene::description::Accel;
    use crate::world::MeshTree;

    #[test]
    fn photons_leave_convex_meshes_of_any_scale() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let mesh = TriangleMesh { positions, triangles, ..TriangleMesh::default() };
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        let token = CancelToken::new();
        let tree = Arc::new(MeshTree::build(loaded, Accel::Bvh, &token).expect("never canceled"));
        let turned = DVec3::new(30.0, -50.0, 80.0);
        for (scale, at) in [
            (DVec3::ONE, DVec3::ZERO),
            (DVec3::new(0.5, -2.0, 1.0), DVec3::new(3.0, -1.0, 2.0)),
            (DVec3::splat(1e-2), DVec3::new(1e3, 20.0, -400.0)),
            (DVec3::new(1e4, 1e4, -1e3), DVec3::new(-1.0, 5.0, 0.0)),
        ] {
            let transform = Transform::scale_rotate_translate(scale, turned, at);
            let mesh = MeshInstance::new(Arc::clone(&tree), transform, false);
            let emissive = SurfaceEmission::new(Emission::from_constant(Vec3::ONE), None);
            let lights = mesh_lights_by_material_and_side(
                (0, &mesh, &Transform::IDENTITY),
                Some(&emissive),
                &Images::default(),
                &CancelToken::new(),
            )
            .expect("never canceled");
            let lights = lights.into_iter().map(Light::Area).collect();
            let lights = Arc::new(Lights::new(lights, &CancelToken::new()).expect("never canceled"));
            let geometry = Geometry::build(vec![Object::Mesh(Box::new(mesh))], &token);
            let geometry = geometry.expect("never canceled");
            let source = scene_photon_emitter(&geometry, &lights).expect("a photon source");
            let mut next = random::unit_generator(1);
            for _ in 0..20_000 {
                let mut pair = || [next(), next()];
                let u =
                    PhotonRandomNumbers { light: pair(), aim: pair(), position: pair(), direction: pair() };
                let photon = source.emit(&u).expect("a photon");
                assert!(matches!(photon.start, PhotonOrigin::Surface { .. }));
                assert_eq!(geometry.closest_hit(&photon.ray()), None, "{scale} {at}: {photon:?}");
            }
        }
    }
}
