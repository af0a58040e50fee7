//! Pictures of numbers at the first hit. All but distances are display values in [0, 1], not radiance.

use super::photons::{Look, PhotonMaps};
use super::queues::Queues;
use super::shot::Shot;
use super::vertices::Vertex;
use super::{FirstHit, RayCounters};
use crate::control::Cancelled;
use crate::geometry::SurfacePoint;
use crate::math::lanes::PlainFolds;
use crate::math::{DVec2, Vec3};

/// Shows the first hit of each camera ray in the queue; black without a hit.
pub fn shade(
    (shot, maps): (&Shot<'_>, Option<&PhotonMaps>),
    number: FirstHit,
    queues: &mut Queues,
    radiance: &mut [Vec3],
    counters: &mut RayCounters,
) -> Result<(), Cancelled> {
    shot.closest_hits(&queues.rays, &mut queues.hits)?;
    for (path, hit) in queues.rays.iter().zip(&queues.hits) {
        let Some(hit) = hit else { continue };
        let vertex = Vertex::new(shot, path, hit);
        let surface = &vertex.surface;
        let value = match number {
            FirstHit::Normal => (vertex.front_shading_normal(counters) + Vec3::ONE) * 0.5,
            FirstHit::Depth => Vec3::splat(distance(shot, surface)),
            FirstHit::Barycentric => surface.barycentric,
            FirstHit::Photons => {
                Vec3::splat(maps.map_or(0.0, |maps| photons(maps, shot, path.slot, &vertex)))
            }
            FirstHit::Uv => fraction(surface.uv).as_vec2().extend(0.0),
            FirstHit::Albedo => {
                vertex.material.bsdf.albedo(&vertex.texture_point, &mut counters.texture_lookups)
            }
        };
        radiance[path.slot as usize] = value * path.throughput;
    }
    Ok(())
}

/// Photons around a point, of the pass of a sample.
fn photons(maps: &PhotonMaps, shot: &Shot<'_>, slot: u32, vertex: &Vertex<'_>) -> f32 {
    let look = Look { point: vertex.surface.point, normal: vertex.normal, most_depth: u32::MAX };
    let (_, _, sample) = shot.block.place(slot);
    let pass = maps.pass(sample);
    [&pass.caustic, &pass.bounced].map(|map| map.count_around(&look, PlainFolds) as f32).iter().sum()
}

/// Distance along the view axis.
fn distance(shot: &Shot<'_>, surface: &SurfacePoint) -> f32 {
    shot.world.camera.depth_of(surface.point.as_dvec3()).max(0.0) as f32
}

fn fraction(uv: DVec2) -> DVec2 {
    uv - uv.floor()
}
