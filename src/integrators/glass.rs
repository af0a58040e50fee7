//! Rays at the surface of glass.

use super::batch::PathRay;
use super::medium::{Inside, Medium};
use super::whitted::{Wave, leaving, reflected};
use crate::geometry::SurfacePoint;
use crate::materials::fresnel::{dielectric, refract};
use crate::materials::{Glass, Material};
use crate::math::Vec3;
use crate::sampling::Purpose;
use crate::world::World;

/// A ray is split in two while the weaker part counts at least this much of its sample; below, chance takes one of them.
const LEAST_SPLIT: f32 = 0.01;

/// Number of the decision between reflection and refraction.
const CHOICE: u32 = u32::MAX;

/// What glass leaves of radiance along a ray to its hit at `distance`: the innermost glass that it is in, or, for a ray that
/// started inside without knowing, the glass whose back it hits.
pub fn absorption(
    world: &World,
    path: &PathRay,
    distance: f32,
    surface: &SurfacePoint,
    material: &Material,
) -> Vec3 {
    let from_inside = || surface.normal.dot(path.ray.direction) > 0.0;
    let glass = match path.medium.innermost() {
        Some(inside) => glass_of(world, inside),
        None => material.bsdf.glass().filter(|_| from_inside()),
    };
    glass.map_or(Vec3::ONE, |glass| glass.transmittance(distance))
}

fn glass_of(world: &World, inside: Inside) -> Option<&Glass> {
    world.materials[inside.material as usize].bsdf.glass()
}

/// Index of refraction of what a ray is in.
fn ior(world: &World, medium: Medium) -> f32 {
    medium.innermost().and_then(|inside| glass_of(world, inside)).map_or(1.0, |glass| glass.ior)
}

impl Wave<'_> {
    /// At the surface of a glass, which is `part` of an object.
    pub(super) fn shade_glass(
        &mut self,
        path: &PathRay,
        part: Inside,
        surface: &SurfacePoint,
        glass: &Glass,
    ) {
        let world = self.tracer.world;
        let entering = surface.normal.dot(path.ray.direction) < 0.0;
        let (near, far, inside) = if entering {
            (ior(world, path.medium), glass.ior, path.medium.entered(part))
        } else {
            match path.medium.left(part) {
                Some(left) => (ior(world, path.medium), ior(world, left), left),
                None => (glass.ior, ior(world, path.medium), path.medium),
            }
        };
        let eta = far / near;
        let (reflectance, Some(direction)) = boundary(surface, path.ray.direction, eta) else {
            return self.push_reflected(path, surface, 1.0);
        };
        // Radiance over the square of the index is what refraction conserves.
        let refracted = PathRay {
            ray: leaving(surface, direction),
            throughput: path.throughput / (eta * eta),
            path: path.next_path(2),
            medium: inside,
            ..*path
        };
        let weaker = reflectance.min(1.0 - reflectance) * path.throughput.abs().max_element();
        if weaker >= LEAST_SPLIT {
            self.push_reflected(path, surface, reflectance);
            self.push_refracted(refracted, 1.0 - reflectance);
        } else if self.chance(path) < reflectance {
            self.push_reflected(path, surface, 1.0);
        } else {
            self.push_refracted(refracted, 1.0);
        }
    }

    fn chance(&self, path: &PathRay) -> f32 {
        let sampler = self.tracer.block.sampler(self.tracer.settings.render.seed, path.slot);
        sampler.get2(Purpose::at_vertex(path.path, CHOICE)).x
    }

    fn push_reflected(&mut self, path: &PathRay, surface: &SurfacePoint, weight: f32) {
        if weight > 0.0 {
            self.counters.reflected_rays += 1;
            self.next.push(reflected(path, surface, Vec3::splat(weight)));
        }
    }

    fn push_refracted(&mut self, mut refracted: PathRay, weight: f32) {
        if weight > 0.0 {
            self.counters.refracted_rays += 1;
            refracted.throughput *= weight;
            self.next.push(refracted);
        }
    }
}

/// Reflectance and refracted direction by the shading normal. Where that looks away from the ray, or sends the refracted
/// ray back to the side that it came from, by the geometric one: the ray must be where its medium says.
fn boundary(surface: &SurfacePoint, incident: Vec3, eta: f32) -> (f32, Option<Vec3>) {
    let side = if surface.normal.dot(incident) < 0.0 { 1.0 } else { -1.0 };
    let (shading, geometric) = (surface.shading_normal * side, surface.normal * side);
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
