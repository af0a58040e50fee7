//! First-hit AOVs. All except depth are display values in [0, 1], not radiance.

use super::photons::{GatherPoint, PhotonMaps};
use super::transport::scratch::TraceBuffers;
use super::transport::tile::TileContext;
use super::transport::vertex::SurfaceVertex;
use super::{FirstHitQuantity, RayCounters};
use crate::control::Cancelled;
use crate::geometry::SurfacePoint;
use crate::math::lanes::PortableSimd;
use crate::math::{DVec2, Vec3};

/// Evaluates `quantity` at the first hit of each camera ray in the queue and writes the result, or black if
/// there is no hit.
pub fn shade_aov(
    (tile, maps): (&TileContext<'_>, Option<&PhotonMaps>),
    quantity: FirstHitQuantity,
    scratch: &mut TraceBuffers,
    radiance: &mut [Vec3],
    counters: &mut RayCounters,
) -> Result<(), Cancelled> {
    tile.closest_hits(&scratch.rays, &mut scratch.hits)?;
    for (path, hit) in scratch.rays.iter().zip(&scratch.hits) {
        let Some(hit) = hit else { continue };
        let passed = if tile.world.has_null_interaction_surfaces() {
            Some(tile.first_opaque_path_and_hit(path, hit, counters))
        } else {
            None
        };
        let Some((path, hit)) = passed.unwrap_or(Some((*path, *hit))) else { continue };
        let (path, hit) = (&path, &hit);
        let vertex = SurfaceVertex::new(tile, path, hit);
        let surface = &vertex.surface;
        let value = match quantity {
            FirstHitQuantity::Normal => (vertex.perturbed_front_normal(counters) + Vec3::ONE) * 0.5,
            FirstHitQuantity::Depth => Vec3::splat(view_depth(tile, surface)),
            FirstHitQuantity::Barycentric => surface.barycentric,
            FirstHitQuantity::Photons => {
                Vec3::splat(maps.map_or(0.0, |maps| count_nearby_photons(maps, tile, path.slot, &vertex)))
            }
            FirstHitQuantity::Uv => fractional_uv(surface.uv).as_vec2().extend(0.0),
            FirstHitQuantity::Albedo => {
                let albedo =
                    vertex.material.bsdf.albedo(&vertex.texture_point, &mut counters.texture_lookups);
                vertex.times_vertex_color(albedo)
            }
        };
        radiance[path.slot as usize] = value * path.throughput;
    }
    Ok(())
}

/// Counts the photons within the kernels around a vertex, using the sample's photon pass.
fn count_nearby_photons(
    maps: &PhotonMaps,
    tile: &TileContext<'_>,
    slot: u32,
    vertex: &SurfaceVertex<'_>,
) -> f32 {
    let look = GatherPoint { point: vertex.surface.point, normal: vertex.normal, most_depth: u32::MAX };
    let (_, _, sample) = tile.block.pixel_and_sample(slot);
    let pass = maps.pass_for_sample(sample);
    [&pass.caustic, &pass.bounced].map(|map| map.count_near(&look, PortableSimd) as f32).iter().sum()
}

/// Depth of a surface point along the view axis.
fn view_depth(tile: &TileContext<'_>, surface: &SurfacePoint) -> f32 {
    tile.world.camera.depth_of(surface.point.as_dvec3()).max(0.0) as f32
}

fn fractional_uv(uv: DVec2) -> DVec2 {
    uv - uv.floor()
}
