//! Camera paths, traced bounce by bounce with queues instead of recursion. This is the main loop of
//! `whitted` and `path`: intersect the rays, add the emission they find, sample lights and BSDFs at the
//! surfaces, and apply Russian roulette.
//!
//! In `whitted`, paths split at glass and end at diffuse and glossy surfaces, where direct and ambient light
//! is added (Whitted, *An Improved Illumination Model for Shaded Display*, 1980). At microfacet surfaces,
//! they continue in the narrow lobe. In `path`, paths do not split and continue at all surfaces (Kajiya, *The
//! Rendering Equation*, 1986). With photons, paths in `whitted` also continue at diffuse and glossy surfaces.
//!
//! - `emission`: emission and ambient light at the hits.
//! - `interactions`: surfaces that are shaded one by one, such as mirrors and smooth glass.
//! - `vertices`: diffuse and glossy surfaces.

mod emission;
mod interactions;
mod vertices;

use std::ops::Range;

use super::RayCounters;
use super::direct::queue::DirectLightVertexQueue;
use super::memory::ThreadMemory;
use super::photons::PhotonPassesBySample;
use super::photons::gather::gather_photons;
use super::transport::accumulator::Accumulator;
use super::transport::batch::VertexBatch;
use super::transport::camera::CAMERA_ROWS;
use super::transport::crossing::CoincidentSurfaceBuffers;
use super::transport::packet::POLL_INTERVAL;
use super::transport::packet_source::PacketSource;
use super::transport::ray::PathRay;
use super::transport::scatter::{BounceContinuationRules, BsdfSampler};
use super::transport::scratch::TraceBuffers;
use super::transport::tile::TileContext;
use super::view::PathAov;
use crate::control::Canceled;
use crate::geometry::packet::set_bit_lanes;
use crate::geometry::surface_packet::SurfacePacket;
use crate::materials::bsdf::LobesToSample;
use crate::scene::description::ShadowMode;
use crate::world::PACKET_SIZE;

/// Traces the camera paths for a range of slots and adds their radiance to the accumulator. `negative`
/// receives the first slot of each packet and the mask of samples with a negative filter weight.
pub fn trace_camera_paths(
    (tile, maps): (&TileContext<'_>, Option<&PhotonPassesBySample>),
    slots: Range<u32>,
    memory: &mut ThreadMemory,
    accumulator: Accumulator<'_>,
    counters: &mut RayCounters,
    mut negative: impl FnMut(u32, u32),
) -> Result<(), Canceled> {
    let ThreadMemory { scratch, direct, .. } = memory;
    let TraceBuffers { rays, next, surfaces, crossing, camera, hits, object_order } = scratch;
    let mut paths = CameraPathWavefront {
        depth: 0,
        continuation: None,
        tile,
        maps,
        direct,
        surfaces,
        accumulator,
        next,
        crossing,
        place: 0,
        is_first_hit_pending: false,
        counters,
    };
    // Trace the camera rays.
    paths.next.clear();
    if let Some(fractions) = paths.accumulator.diffuse_fractions() {
        fractions.begin_camera_paths(slots.len());
    }
    paths.prepare_bounce(slots.len());
    for start in slots.clone().step_by(CAMERA_ROWS * PACKET_SIZE) {
        tile.fill_camera_packets(start..slots.end, camera);
        for (first, row) in (start..).step_by(PACKET_SIZE).zip(&*camera) {
            negative(first, row.negative);
            let count = (slots.end - first).min(PACKET_SIZE as u32) as usize;
            paths.intersect_and_queue_packet(PacketSource::Camera(row, first, count, first - slots.start))?;
        }
    }
    paths.shade_queued_vertices()?;
    paths.direct.accumulate_arrived_light_in_slots(slots.start, &mut paths.accumulator);
    paths.advance_to_next_bounce(rays);
    // Trace the remaining bounces.
    while !rays.is_empty() {
        paths.prepare_bounce(rays.len());
        if tile.behavior.scatters {
            // Find all hits first, to group the rays by the object that they hit.
            tile.closest_hits_of_queue(rays, hits)?;
            object_order.group_hits_by_object(hits);
            for places in object_order.grouped_queue_indices().chunks(PACKET_SIZE) {
                paths.intersect_and_queue_packet(PacketSource::Traced(rays, hits, places))?;
            }
        } else {
            for (packet, first) in rays.chunks(PACKET_SIZE).zip((0..).step_by(PACKET_SIZE)) {
                paths.intersect_and_queue_packet(PacketSource::Paths(packet, first))?;
            }
        }
        paths.shade_queued_vertices()?;
        paths.direct.accumulate_arrived_light(rays, &mut paths.accumulator);
        paths.advance_to_next_bounce(rays);
    }
    Ok(())
}

/// One bounce of all paths in a batch.
struct CameraPathWavefront<'a, 's> {
    /// Number of bounces before the current hits.
    depth: u32,
    /// How paths continue at diffuse and glossy surfaces, or `None` if they end there.
    continuation: Option<BounceContinuationRules>,
    tile: &'a TileContext<'a>,
    /// Photon maps for the samples, or `None` if no photons are gathered.
    maps: Option<&'a PhotonPassesBySample>,
    /// This bounce's diffuse and glossy vertices.
    direct: &'a mut DirectLightVertexQueue,
    /// Surfaces at the hits of the current packet.
    surfaces: &'a mut SurfacePacket,
    accumulator: Accumulator<'s>,
    /// Rays of the next bounce.
    next: &'a mut Vec<PathRay>,
    /// Index of the current path in this bounce's queue.
    place: u32,
    /// Whether the first-hit layers of the current camera ray have yet to be recorded.
    is_first_hit_pending: bool,
    crossing: &'a mut CoincidentSurfaceBuffers,
    counters: &'a mut RayCounters,
}

impl CameraPathWavefront<'_, '_> {
    /// Intersects a packet of rays, adds the emission they find, and queues the vertices at which the paths
    /// may scatter.
    fn intersect_and_queue_packet(&mut self, rays: PacketSource<'_>) -> Result<(), Canceled> {
        let tile = self.tile;
        if (rays.queue_index(0) as usize).is_multiple_of(POLL_INTERVAL) {
            tile.token.check_pause_and_cancel()?;
        }
        // Intersect the rays. The vertices of plain surfaces are ready for the queue.
        let are_lit = self.is_below_max_depth() && self.accumulator.accepts_reflected();
        let aov = self.accumulator.aov;
        let buffers = (self.direct.spare_batch(), &mut *self.surfaces);
        let packet = tile.intersect_packet(rays, aov, are_lit, buffers);
        self.counters.texture_lookups += packet.lookups;
        if aov == PathAov::TraversalCost {
            self.add_traversal_costs(&rays, &packet);
        }
        if are_lit {
            self.direct.commit_spare_vertices();
            self.store_plain_surface_cones(&rays, &packet);
        }
        // Add the emission found by camera rays, which needs no MIS weights.
        let (plain, escaped) = self.emitting_and_escaped_masks(&rays, &packet);
        let mut unfinished = packet.any & !packet.plain;
        match rays {
            PacketSource::Camera(row, first, ..) => {
                self.add_camera_ray_emission(&row.rays, first, &packet, (plain, escaped));
            }
            PacketSource::Paths(..) | PacketSource::Traced(..) => unfinished |= plain | escaped,
        }
        // Add the emission found by the other rays and shade the surfaces that are not plain, in path order.
        let mut pending = 0;
        for lane in set_bit_lanes(unfinished) {
            self.place = rays.queue_index(lane);
            self.shade_ray(rays.path(tile, lane), (&packet, lane));
            pending |= u32::from(std::mem::take(&mut self.is_first_hit_pending)) << lane;
        }
        self.record_first_hits(&rays, &packet, pending);
        // Scatter at the queued vertices while their data is in the cache.
        if self.direct.is_full() {
            self.shade_queued_vertices()?;
        }
        Ok(())
    }

    /// Adds the light reflected at the queued vertices, continues their paths, and empties the queue.
    fn shade_queued_vertices(&mut self) -> Result<(), Canceled> {
        let (tile, aov, depth) = (self.tile, self.accumulator.aov, self.depth);
        let shares_with_paths = self.paths_compete_with_light_samples();
        for vertices in self.direct.jointly_sampled_packet_ranges(tile) {
            // Sample lights.
            self.direct.sample_group_lights(vertices.clone(), tile, aov, shares_with_paths)?;
            for (index, number) in vertices.clone().enumerate() {
                let packet = (index, number);
                let light = self.direct.add_lobe_ray_light(packet, tile, aov, shares_with_paths);
                light.rays.add_to(self.counters);
                // Gather photons.
                if let Some(maps) = self.maps {
                    let row = self.direct.batch_at_index(number);
                    let splits_lobes = self.direct.splits_lobes(row);
                    let gathered = gather_photons(tile, row, maps, depth, (aov, splits_lobes));
                    self.direct.add_to_packet_sums(packet, &gathered, splits_lobes);
                }
                self.direct.add_packet_light_to_paths(packet, aov);
            }
            // Sample BSDFs, with Russian roulette.
            for number in vertices {
                let row = self.direct.batch_at_index(number);
                let Some(continuation) = self.continuation_rules_at_vertices(row) else { continue };
                let fractions = self.accumulator.diffuse_fractions();
                let has_fractions = fractions.is_some() && row.only_specular_before != 0;
                let before = self.next.len();
                BsdfSampler { tile, row, used: row.used, continuation, has_fractions }.queue_scattered_paths(
                    self.direct.interior_lists(),
                    self.direct.cones_by_path_index(),
                    self.next,
                    fractions,
                );
                self.counters.scattered_rays += (self.next.len() - before) as u64;
            }
        }
        self.direct.clear();
        Ok(())
    }

    /// How the paths continue at a packet of vertices, or `None` if they end there.
    fn continuation_rules_at_vertices(&self, row: &VertexBatch) -> Option<BounceContinuationRules> {
        let extends_narrow = row.bsdf.extends_narrow_lobe_paths() && self.tile.behavior.mirrors;
        let narrow = || BounceContinuationRules::new(self.tile, self.depth, LobesToSample::Narrow);
        let policy = self.continuation.or_else(|| extends_narrow.then(narrow));
        policy.filter(|policy| policy.continues)
    }

    /// Whether continuing paths compete with light samples. Hard shadows are computed only with light
    /// samples.
    fn paths_compete_with_light_samples(&self) -> bool {
        let is_soft = self.tile.settings.render.shadows == ShadowMode::Soft;
        self.continuation.is_some() && (!self.tile.behavior.gathers || is_soft)
    }

    /// Begins a bounce of `paths` paths.
    fn prepare_bounce(&mut self, paths: usize) {
        let policy = || BounceContinuationRules::new(self.tile, self.depth, LobesToSample::All);
        self.continuation = self.tile.behavior.scatters.then(policy);
        let has_fractions = self.accumulator.diffuse_fractions().is_some();
        self.direct.begin_bounce(paths, self.tile.camera_cone.is_some(), has_fractions);
    }

    /// Starts the next bounce with the rays generated in this bounce, reusing the old queue for output.
    fn advance_to_next_bounce(&mut self, rays: &mut Vec<PathRay>) {
        std::mem::swap(rays, self.next);
        self.next.clear();
        if let Some(fractions) = self.accumulator.diffuse_fractions() {
            fractions.advance_to_next_bounce();
        }
        self.depth += 1;
    }
}
