//! Specular reflection and refraction.

use super::cone::SpecularEvent;
use super::interiors::{InteriorList, medium_ior};
use super::ray::PathRay;
use super::vertex::{PerturbedAndSmoothNormals, SurfaceVertex};
use crate::materials::fresnel::{fresnel_dielectric, refract_given_transmitted_cosine};
use crate::materials::mirror::reflect;
use crate::math::Vec3;
use crate::world::World;

/// Branch numbers for specular reflection and refraction, which distinguish a path's continuations.
const REFLECTED: u32 = 1;
const REFRACTED: u32 = 2;
/// Branch number for scattering by a non-specular lobe.
pub const SCATTERED: u32 = 3;
/// Branch number for a null interaction.
pub const PASSED: u32 = 4;

/// Path after specular reflection. If the shading normal would reflect the path below the surface, the
/// geometric normal is used.
pub fn reflected_path(
    path: &PathRay,
    vertex: &SurfaceVertex<'_>,
    shading: &PerturbedAndSmoothNormals,
    reflectance: Vec3,
) -> PathRay {
    let incident = path.ray.direction;
    let side = -incident.dot(vertex.normal);
    let mut direction = reflect(incident, shading.normal);
    if !(direction.dot(vertex.normal) * side > 0.0) {
        direction = reflect(incident, vertex.normal);
    }
    PathRay {
        ray: vertex.spawn_ray(direction.normalize()),
        throughput: path.throughput * reflectance,
        path: path.child_path_number(REFLECTED),
        state: path.state.after_specular(reflectance.max_element()),
        cone: vertex.cone_after_specular(SpecularEvent::Reflected),
        ..*path
    }
}

/// Fraction of basic radiance L/n² that passes through an infinitely thin diffusing sheet between two media.
/// In the denser medium, light spreads over fewer directions and would gain energy without this factor. In
/// the opposite direction, radiance is unchanged (Veach, *Robust Monte Carlo Methods for Light Transport
/// Simulation*, 1997, section 5.2).
pub fn diffuser_basic_radiance_transmittance(world: &World, near: &InteriorList, far: &InteriorList) -> f32 {
    let eta = medium_ior(world, far) / medium_ior(world, near);
    (eta * eta).min(1.0)
}

/// Fresnel reflectance at a glass boundary, and the refracted path.
pub struct FresnelSplit {
    /// Fresnel reflectance.
    pub reflectance: f32,
    /// The refracted path, not weighted by the transmittance, or `None` for total internal reflection.
    pub refracted: Option<PathRay>,
}

/// Computes the reflection and refraction of a path at the boundary between its medium and `far`.
pub fn fresnel_split(
    world: &World,
    path: &PathRay,
    vertex: &SurfaceVertex<'_>,
    shading: &PerturbedAndSmoothNormals,
    far: &InteriorList,
) -> FresnelSplit {
    let eta = medium_ior(world, far) / medium_ior(world, &path.interiors);
    let (reflectance, direction) = reflectance_and_refraction(vertex, shading, path.ray.direction, eta);
    // Path throughput applies to basic radiance, L/n², which refraction does not change.
    let refracted = direction.map(|direction| PathRay {
        ray: vertex.spawn_ray(direction),
        path: path.child_path_number(REFRACTED),
        interiors: *far,
        state: path.state.after_specular(1.0),
        cone: vertex.cone_after_specular(SpecularEvent::Refracted(eta)),
        ..*path
    });
    FresnelSplit { reflectance, refracted }
}

/// Computes the reflectance and refracted direction with the shading normal. If this normal faces away from
/// the ray or would refract the ray to the incident side, the geometric normal is used, because the refracted
/// ray must be in the medium on the far side.
fn reflectance_and_refraction(
    vertex: &SurfaceVertex<'_>,
    shading: &PerturbedAndSmoothNormals,
    incident: Vec3,
    eta: f32,
) -> (f32, Option<Vec3>) {
    let (shading, geometric) = (shading.normal, vertex.normal);
    let crosses = |direction: &Vec3| direction.dot(geometric) < 0.0;
    let by = |normal: Vec3| {
        let (reflectance, cosine) = fresnel_dielectric(-normal.dot(incident), eta);
        (reflectance, cosine.map(|cosine| refract_given_transmitted_cosine(incident, normal, eta, cosine)))
    };
    let shaded = if shading.dot(incident) < 0.0 { by(shading) } else { by(geometric) };
    match shaded {
        (_, Some(direction)) if !crosses(&direction) => {
            let (reflectance, direction) = by(geometric);
            (reflectance, direction.filter(crosses))
        }
        _ => shaded,
    }
}
