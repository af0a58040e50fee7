//! Photon tracing: photons are traced from the lights bounce by bounce, sixteen at a time. They travel via
//! mirrors and glass to the first non-specular surface, and are scattered from there to the next surface.
//! Photons interact with surfaces, media and lobes in the same way as camera paths.
//!
//! Photons carry basic flux, Φ/n². At a surface whose shading normal Ns differs from its geometric normal Ng,
//! scattering uses the adjoint of its BSDF: f·|wi·Ns|·|wo·Ng|/|wi·Ng| (Veach, *Robust Monte Carlo Methods for
//! Light Transport Simulation*, 1997, section 5.3).

mod initial_rays;
mod interactions;
mod roulette;

use super::map::Photon;
use crate::control::Canceled;
use crate::geometry::packet::set_bit_lanes;
use crate::geometry::surface_packet::SurfacePacket;
use crate::integrators::transport::batch::{UNPERTURBED, VertexBatch};
use crate::integrators::transport::crossing::CoincidentSurfaceBuffers;
use crate::integrators::transport::interiors::{Interior, InteriorListPool, medium_ior};
use crate::integrators::transport::packet_source::PacketSource;
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::scatter::{BounceContinuationRules, BsdfSampler};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::transport::walk::walk_to_interaction;
use crate::integrators::view::PathAov;
use crate::integrators::{PACKET_SIZE, RayCounters};
use crate::lights::PhotonEmitter;
use crate::materials::bsdf::LobesToSample;
use crate::math::Vec3;
use crate::math::lanes::{lane, set_lane};
use crate::world::{CompoundSolid, World};

/// Context shared by all photons in one chunk of a pass.
pub struct PhotonTracer<'a> {
    /// Tile context. Photons are numbered as samples of a single pixel, with slots starting at 0.
    pub tile: &'a TileContext<'a>,
    /// Photon source, which represents all lights.
    pub emission: &'a PhotonEmitter,
    /// Closed glass shapes that may contain lights, with their materials.
    pub glasses: &'a [Interior],
    /// Other glass solids that may contain lights.
    pub bodies: &'a [CompoundSolid],
    /// Reciprocal of the number of photons.
    pub flux_scale: f32,
    /// Maximum number of bounces per photon.
    pub max_depth: u32,
}

/// Photons stored by one chunk of a pass.
#[derive(Default)]
pub struct StoredPhotonChunk {
    /// Caustic photons, scattered only by mirrors and glass, in emission order within each bounce.
    pub caustic: Vec<Photon>,
    /// Bounced photons, scattered once at a caustic, in the same order.
    pub bounced: Vec<Photon>,
    /// Number of texture lookups.
    pub lookups: u64,
}

impl PhotonTracer<'_> {
    /// Traces this chunk's photons.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn trace_photons(&self) -> Result<StoredPhotonChunk, Canceled> {
        let count = self.tile.block.sample_count() as u32;
        let mut wavefront = PhotonWavefront {
            tracing: self,
            depth: 0,
            references: vec![0.0; count as usize],
            next: Vec::new(),
            open: VertexBatch::empty(),
            open_behind: VertexBatch::empty(),
            interior_lists: InteriorListPool::default(),
            crossing: CoincidentSurfaceBuffers::default(),
            stored: StoredPhotonChunk::default(),
            counters: RayCounters::default(),
        };
        // Emit the photons, then trace them bounce by bounce.
        let mut rays = Vec::new();
        wavefront.emit(count, &mut rays);
        let (mut row, mut surfaces) = (VertexBatch::empty(), SurfacePacket::EMPTY);
        while !rays.is_empty() {
            for packet in rays.chunks(PACKET_SIZE) {
                self.tile.token.check_pause_and_cancel()?;
                wavefront.trace_and_shade_packet(packet, &mut row, &mut surfaces);
            }
            // Scatter the individually queued vertices, and apply Russian roulette.
            wavefront.scatter_queued_vertices();
            wavefront.interior_lists.clear();
            wavefront.apply_roulette_to_queued_photons();
            std::mem::swap(&mut rays, &mut wavefront.next);
            wavefront.next.clear();
            wavefront.depth += 1;
        }
        wavefront.stored.lookups += wavefront.counters.texture_lookups;
        Ok(wavefront.stored)
    }
}

/// The photons in flight.
struct PhotonWavefront<'a> {
    tracing: &'a PhotonTracer<'a>,
    /// Number of bounces so far.
    depth: u32,
    /// Largest component of each photon's initial flux, indexed by slot.
    references: Vec<f32>,
    next: Vec<PathRay>,
    /// Packet for individually queued vertices.
    open: VertexBatch,
    /// Vertex packet for transmitted photons.
    open_behind: VertexBatch,
    /// Media at the individually queued vertices.
    interior_lists: InteriorListPool,
    crossing: CoincidentSurfaceBuffers,
    stored: StoredPhotonChunk,
    counters: RayCounters,
}

impl PhotonWavefront<'_> {
    /// Whether photons may scatter at the current hits.
    fn is_below_max_depth(&self) -> bool {
        self.depth < self.tracing.max_depth
    }

    /// Traces a packet of photons to their hits, where they are stored and scattered.
    fn trace_and_shade_packet(
        &mut self,
        rays: &[PathRay],
        row: &mut VertexBatch,
        surfaces: &mut SurfacePacket,
    ) {
        let tile = self.tracing.tile;
        let packet = tile.intersect_packet(PacketSource::Paths(rays, 0), PathAov::ALL, true, (row, surfaces));
        self.counters.texture_lookups += packet.lookups;
        // Direct light is found by light samples.
        if self.depth > 0 {
            for i in set_bit_lanes(row.used) {
                let (point, normal) = row.surface_point_and_normal(i);
                self.store_photon(&rays[i], point, normal);
            }
            row.clear_lanes_outside(row.only_specular_before);
            for i in set_bit_lanes(row.used & row.has_facet) {
                let counts = row.adjoint_photon_weight(i, -rays[i].ray.direction);
                set_lane(&mut row.throughput, i, rays[i].throughput * counts);
            }
            self.scatter(row);
        }
        // Shade other surfaces one by one.
        for i in set_bit_lanes(packet.any & !packet.plain) {
            if let Some(hit) = packet.hit(i) {
                walk_to_interaction(
                    self,
                    &mut { rays[i] },
                    (hit, packet.non_plain_surface_of_lane(surfaces, i)),
                );
            }
        }
    }

    /// Stores a photon at its hit point.
    fn store_photon(&mut self, path: &PathRay, point: Vec3, normal: Vec3) {
        let (direction, flux) = (-path.ray.direction, path.throughput);
        let photon = Photon { point, direction, flux, normal, depth: self.depth };
        let kept =
            if path.state.only_specular_before { &mut self.stored.caustic } else { &mut self.stored.bounced };
        kept.push(photon);
    }

    /// Scatters photons at the individually queued vertices.
    fn scatter_queued_vertices(&mut self) {
        let mut open = std::mem::replace(&mut self.open, VertexBatch::empty());
        self.scatter(&mut open);
        open.reset();
        self.open = open;
        if self.open_behind.used != 0 {
            let mut open = std::mem::replace(&mut self.open_behind, VertexBatch::empty());
            self.scatter(&mut open);
            open.reset();
            self.open_behind = open;
        }
    }

    /// Scatters photons at a packet of vertices. Directions are sampled in proportion to the cosine at the
    /// geometric normal, as required by the adjoint.
    fn scatter(&mut self, row: &mut VertexBatch) {
        if !self.is_below_max_depth() || row.used == 0 {
            return;
        }
        for i in set_bit_lanes(row.used & row.has_facet) {
            let facet = lane(&row.facet, i);
            set_lane(&mut row.normal, i, facet);
            row.shading_normal_cosine[i] = UNPERTURBED;
        }
        let continuation =
            BounceContinuationRules { continues: true, uses_roulette: false, lobes: LobesToSample::All };
        let used = row.used;
        BsdfSampler { tile: self.tracing.tile, row, used, continuation, has_fractions: false }
            .queue_scattered_paths(&self.interior_lists, &[], &mut self.next, None);
    }
}

/// Largest component of a photon's flux in W. Unlike basic flux, it does not depend on the medium.
fn max_flux_component(world: &World, path: &PathRay) -> f32 {
    let index = medium_ior(world, &path.interiors);
    path.throughput.max_element() * index * index
}
