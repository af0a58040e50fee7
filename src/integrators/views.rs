//! Pictures of numbers at the first hit. Their values are meant as display values in [0, 1], not as radiance.

use super::batch::{Queues, Tracer};
use super::whitted::closest_hits;
use super::{FirstHit, RayCounters};
use crate::control::Cancelled;
use crate::geometry::SurfacePoint;
use crate::materials::Material;
use crate::math::{Vec2, Vec3};

/// Show what each camera ray in the queue hits; black where nothing.
pub fn shade(
    tracer: &Tracer<'_>,
    number: FirstHit,
    queues: &mut Queues,
    radiance: &mut [Vec3],
    counters: &mut RayCounters,
) -> Result<(), Cancelled> {
    closest_hits(tracer, queues)?;
    for (path, hit) in queues.rays.iter().zip(&queues.hits) {
        let Some(hit) = hit else { continue };
        let surface = tracer.world.geometry.surface(&path.ray, hit);
        let material = &tracer.world.materials[tracer.world.material_index(hit)];
        let value = match number {
            FirstHit::Normal => (normal(&surface, material, counters) + Vec3::ONE) * 0.5,
            FirstHit::Depth => Vec3::splat(nearness(tracer, &surface)),
            FirstHit::Barycentric => surface.barycentric,
            FirstHit::Uv => fraction(surface.uv).extend(0.0),
            FirstHit::Albedo => material.bsdf.albedo(surface.uv, &mut counters.texture_lookups),
        };
        radiance[path.slot as usize] = value * path.throughput;
    }
    Ok(())
}

fn normal(surface: &SurfacePoint, material: &Material, counters: &mut RayCounters) -> Vec3 {
    let Some(map) = &material.normal_map else { return surface.shading_normal };
    counters.texture_lookups += 1;
    map.bend(surface.uv, surface.shading_normal, surface.dpdu, surface.dpdv)
}

/// 1 at the eye, ½ at the distance in focus, towards 0 far away.
fn nearness(tracer: &Tracer<'_>, surface: &SurfacePoint) -> f32 {
    let camera = &tracer.world.camera;
    let depth = camera.depth_of(surface.point.as_dvec3()).max(0.0);
    (camera.focus / (camera.focus + depth)) as f32
}

fn fraction(uv: Vec2) -> Vec2 {
    uv - uv.floor()
}
