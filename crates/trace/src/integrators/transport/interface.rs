//! Reflection and refraction at mirrors and glass.

use super::cone::Bend;
use super::medium::{Medium, ior};
use super::ray::PathRay;
use super::vertex::{Shading, Vertex};
use crate::materials::fresnel::{dielectric, refract};
use crate::materials::mirror::reflect;
use crate::math::Vec3;
use crate::world::World;

/// Branch number of the continuation, which tells the paths of one sample apart.
const REFLECTED: u32 = 1;
const REFRACTED: u32 = 2;
/// Branch number of scattering by a lobe that is not δ.
pub const SCATTERED: u32 = 3;
/// Branch number of the way straight on.
pub const STRAIGHT: u32 = 4;

/// The mirrored ray. A shading normal that sends it below the surface is replaced by the geometric one.
pub fn reflected(path: &PathRay, vertex: &Vertex<'_>, shading: &Shading, reflectance: Vec3) -> PathRay {
    let incident = path.ray.direction;
    let side = -incident.dot(vertex.normal);
    let mut direction = reflect(incident, shading.normal);
    if !(direction.dot(vertex.normal) * side > 0.0) {
        direction = reflect(incident, vertex.normal);
    }
    PathRay {
        ray: vertex.leaving(direction.normalize()),
        throughput: path.throughput * reflectance,
        path: path.next_path(REFLECTED),
        state: path.state.mirrored(reflectance.max_element()),
        cone: vertex.bent_cone(Bend::Reflected),
        ..*path
    }
}

/// The part of basic radiance that comes through a sheet without thickness from another medium. Light that enters the denser medium
/// spreads over fewer directions, or it would gain energy; the way back is as bright as without a change (Veach, *Robust Monte Carlo
/// Methods for Light Transport Simulation*, 1997, section 5.2).
pub fn through_sheet(world: &World, near: &Medium, far: &Medium) -> f32 {
    let eta = ior(world, far) / ior(world, near);
    (eta * eta).min(1.0)
}

/// Interaction of a ray with the surface of a glass.
pub struct Interface {
    /// Reflectance.
    pub reflectance: f32,
    /// The ray on the other side, with all of its radiance. `None` for total internal reflection.
    pub refracted: Option<PathRay>,
}

/// The interaction of a ray that goes from one medium to another; it is in the first.
pub fn interface(
    world: &World,
    path: &PathRay,
    vertex: &Vertex<'_>,
    shading: &Shading,
    far: &Medium,
) -> Interface {
    let eta = ior(world, far) / ior(world, &path.medium);
    let (reflectance, direction) = boundary(vertex, shading, path.ray.direction, eta);
    // Rays carry basic radiance, L/n², which refraction does not change.
    let refracted = direction.map(|direction| PathRay {
        ray: vertex.leaving(direction),
        path: path.next_path(REFRACTED),
        medium: *far,
        state: path.state.mirrored(1.0),
        cone: vertex.bent_cone(Bend::Refracted(eta)),
        ..*path
    });
    Interface { reflectance, refracted }
}

/// Reflectance and refracted direction by the shading normal. If that normal faces away from the ray, or sends the
/// refracted ray back to its own side, the geometric normal counts: the ray must be where its medium says.
fn boundary(vertex: &Vertex<'_>, shading: &Shading, incident: Vec3, eta: f32) -> (f32, Option<Vec3>) {
    let (shading, geometric) = (shading.normal, vertex.normal);
    let crosses = |direction: &Vec3| direction.dot(geometric) < 0.0;
    let by = |normal: Vec3| {
        let (reflectance, cosine) = dielectric(-normal.dot(incident), eta);
        (reflectance, cosine.map(|cosine| refract(incident, normal, eta, cosine)))
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
