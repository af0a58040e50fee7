//! First-hit AOVs. All except depth are display values in [0, 1], not radiance.

use super::layers::{SampleBatchLayerValues, SampleLayer};
use super::photons::{GatherPoint, PhotonPassesBySample};
use super::transport::packet::PacketHits;
use super::transport::ray::PathRay;
use super::transport::scratch::TraceBuffers;
use super::transport::tile::TileContext;
use super::transport::vertex::SurfaceVertex;
use super::{FirstHitQuantity, RayCounters};
use crate::control::Canceled;
use crate::geometry::packet::set_bit_lanes;
use crate::geometry::surface_packet::SurfacePacket;
use crate::materials::TexturePoint;
use crate::math::lanes::PortableSimd;
use crate::math::{DVec2, Vec3};
use crate::world::Hit;

/// Evaluates `quantity` at the first hit of each camera ray in the queue and writes the result, or black if
/// there is no hit.
pub fn shade_first_hit_aov(
    (tile, maps): (&TileContext<'_>, Option<&PhotonPassesBySample>),
    quantity: FirstHitQuantity,
    scratch: &mut TraceBuffers,
    radiance: &mut [Vec3],
    counters: &mut RayCounters,
) -> Result<(), Canceled> {
    tile.closest_hits_of_queue(&scratch.rays, &mut scratch.hits)?;
    for (path, hit) in scratch.rays.iter().zip(&scratch.hits) {
        let Some(hit) = hit else { continue };
        let Some((path, hit)) = first_opaque_hit(tile, path, hit, counters) else { continue };
        let vertex = SurfaceVertex::new(tile, &path, &hit);
        let surface = &vertex.surface;
        radiance[path.slot as usize] = match quantity {
            FirstHitQuantity::Normal => (vertex.unflipped_perturbed_normal(counters) + Vec3::ONE) * 0.5,
            FirstHitQuantity::Depth => Vec3::splat(view_depth(tile, surface.point)),
            FirstHitQuantity::Barycentric => surface.barycentric,
            FirstHitQuantity::Photons => {
                Vec3::splat(maps.map_or(0.0, |maps| count_nearby_photons(maps, tile, path.slot, &vertex)))
            }
            FirstHitQuantity::Uv => fractional_uv(surface.uv).as_vec2().extend(0.0),
            FirstHitQuantity::Albedo => vertex_albedo(&vertex, counters),
        };
    }
    Ok(())
}

/// Records the first-hit layers of the plain surfaces in a packet of camera rays that starts at slot `first`.
/// Returns the mask of lanes whose surfaces are left to [`record_first_hit_of_ray`].
pub fn record_first_hits_on_plain_surfaces(
    tile: &TileContext<'_>,
    (packet, surfaces): (&PacketHits, &SurfacePacket),
    first: u32,
    values: &mut SampleBatchLayerValues,
) -> u32 {
    let mut left = 0;
    let mut known = None;
    for lane in set_bit_lanes(packet.plain) {
        let Some(hit) = packet.hit(lane) else { continue };
        let index = tile.world.material_index(&hit);
        if known.is_none_or(|(own, _)| own != index) {
            known = Some((index, values.cached_constant_albedo(index, || constant_albedo(tile, index))));
        }
        let Some(albedo) = known.and_then(|(_, albedo)| albedo) else {
            left |= 1 << lane;
            continue;
        };
        let (point, normal) = packet.point_and_shading_normal(surfaces, lane);
        let depth = Vec3::splat(view_depth(tile, point));
        values.add_first_hit(first + lane as u32, [albedo, normal, depth]);
    }
    left
}

/// Returns the albedo of a material if its albedo and shading normals are constant over each surface and the
/// same on both sides, and if it has no null interactions.
fn constant_albedo(tile: &TileContext<'_>, index: usize) -> Option<Vec3> {
    let material = &tile.world.materials[index];
    let is_constant = !tile.world.material_needs_uvs_or_tangents(index)
        && !material.has_null_interaction()
        && !material.may_be_black_from_behind();
    is_constant.then(|| material.bsdf.main_color(&TexturePoint::from_uv(DVec2::ZERO), &mut 0))
}

/// Records the first-hit layers of a camera ray, given its first hit.
pub fn record_first_hit_of_ray(
    tile: &TileContext<'_>,
    (path, hit): (&PathRay, &Hit),
    values: &mut SampleBatchLayerValues,
    counters: &mut RayCounters,
) {
    if let Some((path, hit)) = first_opaque_hit(tile, path, hit, counters) {
        let vertex = SurfaceVertex::from_hit_with_needed_attributes(tile, &path, &hit);
        record_vertex(tile, path.slot, &vertex, values, counters);
    }
}

/// Records the first-hit layers at a vertex.
pub fn record_vertex(
    tile: &TileContext<'_>,
    slot: u32,
    vertex: &SurfaceVertex<'_>,
    values: &mut SampleBatchLayerValues,
    counters: &mut RayCounters,
) {
    let set = values.layer_set();
    // Look up only the textures needed for the layers.
    let albedo = if set.contains(SampleLayer::Albedo) { vertex_albedo(vertex, counters) } else { Vec3::ZERO };
    let normal = if set.contains(SampleLayer::Normal) {
        vertex.unflipped_perturbed_normal(counters)
    } else {
        Vec3::ZERO
    };
    let depth = Vec3::splat(view_depth(tile, vertex.surface.point));
    values.add_first_hit(slot, [albedo, normal, depth]);
}

/// Returns the first opaque hit along a camera ray, starting at `hit`, and the path that reaches it. Returns
/// `None` if there is no opaque surface.
fn first_opaque_hit(
    tile: &TileContext<'_>,
    path: &PathRay,
    hit: &Hit,
    counters: &mut RayCounters,
) -> Option<(PathRay, Hit)> {
    if tile.world.has_null_interaction_surfaces() {
        tile.first_opaque_path_and_hit(path, hit, counters)
    } else {
        Some((*path, *hit))
    }
}

/// Diffuse reflectance at a vertex.
fn vertex_albedo(vertex: &SurfaceVertex<'_>, counters: &mut RayCounters) -> Vec3 {
    if !vertex.scatters() {
        return Vec3::ZERO;
    }
    let albedo = vertex.material.bsdf.main_color(&vertex.texture_point, &mut counters.texture_lookups);
    vertex.times_vertex_color(albedo)
}

/// Counts the photons within the kernels around a vertex, using the sample's photon pass.
fn count_nearby_photons(
    maps: &PhotonPassesBySample,
    tile: &TileContext<'_>,
    slot: u32,
    vertex: &SurfaceVertex<'_>,
) -> f32 {
    let look = GatherPoint { point: vertex.surface.point, normal: vertex.normal, max_depth: u32::MAX };
    let (_, _, sample) = tile.block.pixel_and_sample(slot);
    let pass = maps.pass_for_sample(sample);
    [&pass.caustic, &pass.bounced].map(|map| map.count_near(&look, PortableSimd) as f32).iter().sum()
}

/// Depth of a surface point as seen from the camera.
fn view_depth(tile: &TileContext<'_>, point: Vec3) -> f32 {
    tile.world.camera.depth_of(point.as_dvec3()).max(0.0) as f32
}

fn fractional_uv(uv: DVec2) -> DVec2 {
    uv - uv.floor()
}
