//! Photon tracing: photons are traced from the lights bounce by bounce, sixteen at a time. They travel via
//! mirrors and glass to the first non-specular surface, and are scattered from there to the next surface.
//! Photons interact with surfaces, media and lobes in the same way as camera paths.
//!
//! Photons carry basic flux, Φ/n². At a surface whose shading normal Ns differs from its geometric normal Ng,
//! scattering uses the adjoint of its BSDF: f·|wi·Ns|·|wo·Ng|/|wi·Ng| (Veach, *Robust Monte Carlo Methods for
//! Light Transport Simulation*, 1997, section 5.3).

use super::coverage::can_store_photons;
use super::map::Photon;
use crate::control::Canceled;
use crate::geometry::packet::set_bit_lanes;
use crate::geometry::ray::offset_origin;
use crate::geometry::surface_packet::SurfacePacket;
use crate::geometry::{Ray, SurfacePoint};
use crate::integrators::transport::batch::{ALL, UNPERTURBED, VertexBatch};
use crate::integrators::transport::cone::RayCone;
use crate::integrators::transport::crossing::CoincidentSurfaceBuffers;
use crate::integrators::transport::interface::{
    FresnelSplit, diffuser_basic_radiance_transmittance, fresnel_split, reflected_path,
};
use crate::integrators::transport::interiors::{Interior, InteriorList, InteriorListPool, medium_ior};
use crate::integrators::transport::packet_source::PacketSource;
use crate::integrators::transport::ray::{PathHistory, PathRay};
use crate::integrators::transport::scatter::{BounceContinuationRules, BsdfSampler};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::transport::vertex::{ShadingVertex, SpecularLobe, SurfaceVertex};
use crate::integrators::transport::walk::{
    Interaction, Interface, MAX_PASSED_SURFACES, NullInteractionOutcome, OpaqueSurfaceHit, PathStepper,
    opacity_at_path_vertex, walk_to_interaction,
};
use crate::integrators::view::PathAov;
use crate::integrators::{PACKET_SIZE, RayCounters};
use crate::lights::{EmittedPhoton, PhotonEmitter, PhotonOrigin, PhotonRandomNumbers};
use crate::materials::bsdf::LobesToSample;
use crate::materials::{Bsdf, BxdfPoint, Material, NonSpecular, SpecularOverBase, ThinDielectric};
use crate::math::Vec3;
use crate::math::lanes::{Simd, lane, set_lane};
use crate::sampling::{CAMERA_PATH, Dimension, SamplerPacket};
use crate::world::{CompoundSolid, Hit, SimdKernel, World};

/// Squared difference below which directions are considered equal.
const SAME: f32 = 1e-8;

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

    /// Moves the origin of a photon's ray from an infinite light back past any transmissive infinite planes.
    /// Returns `None` if an opaque surface blocks the ray.
    fn move_origin_back_past_infinite_planes(&self, ray: Ray) -> Option<Ray> {
        let world = self.tile.world;
        let mut start = ray.origin;
        for _ in 0..MAX_PASSED_SURFACES {
            let back = Ray::new(start, -ray.direction);
            let Some(hit) = world.geometry.closest_hit(&back) else {
                return Some(Ray::new(start, ray.direction));
            };
            let material = &world.materials[world.material_index(&hit)];
            if material.bsdf.as_dielectric().is_none() && !material.has_null_interaction() {
                return None;
            }
            let SurfacePoint { point, error, normal, .. } = world.geometry.surface(&back, &hit);
            start = offset_origin(point, error, normal, back.direction);
        }
        None
    }

    /// Medium at a photon's starting point.
    fn interiors_at(&self, point: Vec3, emitted: &EmittedPhoton) -> InteriorList {
        let world = self.tile.world;
        let emitter = || Some(world.lights.get(emitted.light).as_area()?.object);
        let around = |glass: &&Interior| world.is_closed_shape_containing(glass.body, point);
        let in_parts = self.bodies.iter().filter(|_| !is_from_infinite_light(emitted)).filter_map(|body| {
            let material = world.glass_material_around_point(body, point, emitter())?;
            Some(Interior { body: body.body, material })
        });
        self.glasses
            .iter()
            .filter(around)
            .copied()
            .chain(in_parts)
            .fold(InteriorList::default(), InteriorList::entered)
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

impl<'a> PathStepper<'a> for PhotonWavefront<'a> {
    fn tile_context(&self) -> &'a TileContext<'a> {
        self.tracing.tile
    }

    fn coincident_surface_buffers(&mut self) -> &mut CoincidentSurfaceBuffers {
        &mut self.crossing
    }

    fn record_surface_crossing(&mut self, _: &PathRay, _: Option<Hit>) {}

    #[inline(always)]
    fn handle_walk_end(&mut self, path: &PathRay, reached: Interaction<'_, 'a>, has_passed: bool) {
        match reached {
            Interaction::Opaque(vertex, _, far) => {
                let lacks_photons = self.depth == 0 && !has_passed;
                self.shade_surface(path, vertex, (far, lacks_photons));
            }
            Interaction::Glass(vertex, _, Interface { far, rough: None }) => {
                self.shade_glass_hit(path, vertex, far);
            }
            // Direct light is found by light samples.
            Interaction::Glass(..) if self.depth == 0 && !has_passed => {}
            Interaction::Glass(vertex, _, Interface { far, rough: Some(rough) }) => {
                self.store_and_scatter(path, vertex, rough.reflection_bxdf(), (far, Some(1.0)));
            }
            Interaction::Nothing | Interaction::Hidden => {}
        }
    }

    fn texture_lookup_counter(&mut self) -> &mut u64 {
        &mut self.counters.texture_lookups
    }

    fn handle_pane(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'a>,
        _: OpaqueSurfaceHit,
        pane: &ThinDielectric,
    ) -> NullInteractionOutcome {
        let reflectance = pane.reflectance(vertex.surface.shading_normal.dot(vertex.wo));
        let tint = vertex.pane_transmittance(path, pane, &mut self.counters.texture_lookups);
        if !self.may_scatter() {
            return NullInteractionOutcome::Passed(tint * (1.0 - reflectance));
        }
        if !self.tracing.tile.chooses_reflection(path, reflectance) {
            return NullInteractionOutcome::Passed(tint);
        }
        let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
        let ray = reflected_path(path, vertex, &shading, Vec3::ONE);
        self.queue_specular_photon(path, vertex, (shading.normal, 1.0), ray);
        NullInteractionOutcome::Ended
    }
}

impl PhotonWavefront<'_> {
    /// Emits the photons.
    fn emit(&mut self, count: u32, rays: &mut Vec<PathRay>) {
        let tracing = self.tracing;
        let tile = tracing.tile;
        let has_planes = tile.world.geometry.has_unbounded();
        for begin in (0..count).step_by(PACKET_SIZE) {
            let numbers =
                tile.world.geometry.instruction_set().run(PhotonRandomNumbersKernel { tile, first: begin });
            for (i, numbers) in numbers.iter().enumerate().take((count - begin) as usize) {
                // Emit a photon, and start it in front of all infinite planes it may pass through.
                let Some(emitted) = tracing.emission.emit(numbers) else { continue };
                let past_planes = is_from_infinite_light(&emitted) && has_planes;
                let ray = emitted.ray();
                let Some(ray) = (if past_planes {
                    tracing.move_origin_back_past_infinite_planes(ray)
                } else {
                    Some(ray)
                }) else {
                    continue;
                };
                let offset = begin as usize + i;
                let path = PathRay {
                    ray,
                    throughput: emitted.flux * tracing.flux_scale,
                    slot: offset as u32,
                    path: CAMERA_PATH + 1,
                    interiors: tracing.interiors_at(ray.origin, &emitted),
                    state: PathHistory::CAMERA,
                    cone: RayCone::default(),
                };
                self.references[offset] = max_flux_component(tile.world, &path);
                rays.push(path);
            }
        }
    }

    /// Whether photons may scatter at the current hits.
    fn may_scatter(&self) -> bool {
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
            row.retain_lanes(row.only_specular_before);
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

    fn shade_surface(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        (far, lacks_photons): (&InteriorList, bool),
    ) {
        if !vertex.scatters() {
            return;
        }
        match &vertex.material.bsdf {
            // Direct light is found by light samples.
            Bsdf::NonSpecular(_) if lacks_photons => {}
            Bsdf::NonSpecular(rough) => {
                self.store_and_scatter_at_rough(path, vertex, rough, (far, Some(1.0)));
            }
            Bsdf::SpecularOverBase(layers) => {
                self.store_and_reflect_at_specular_over_base(path, vertex, layers, (far, lacks_photons));
            }
            Bsdf::Mirror(mirror) if self.may_scatter() => {
                let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
                let reflectance = vertex.mirror_reflectance(mirror, &shading, true, &mut self.counters);
                let ray = reflected_path(path, vertex, &shading, reflectance);
                self.queue_specular_photon(path, vertex, (shading.normal, 1.0), ray);
            }
            Bsdf::Mirror(_) | Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) | Bsdf::Blend(_) => {}
        }
    }

    /// Stores a photon at a surface with a δ lobe and non-specular lobes, and reflects it from the δ lobe.
    /// Caustic photons are randomly reflected by the δ lobe or scattered by the others. All other photons are
    /// reflected, because they never scatter from the other lobes.
    fn store_and_reflect_at_specular_over_base(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        layers: &SpecularOverBase,
        (far, lacks_photons): (&InteriorList, bool),
    ) {
        let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
        let lobe = vertex.specular_lobe(layers, &shading, true, &mut self.counters);
        let SpecularLobe { probability, .. } = lobe;
        let chooses = path.state.only_specular_before && !lacks_photons;
        let is_reflected = !chooses || self.tracing.tile.chooses_reflection(path, probability);
        if !lacks_photons {
            let factor = (!is_reflected).then(|| 1.0 / (1.0 - probability));
            self.store_and_scatter_at_rough(path, vertex, &layers.base, (far, factor));
        }
        if is_reflected && self.may_scatter() {
            let specular = vertex.specular_sample_weight(layers, &lobe, &mut self.counters);
            let part = if chooses { 1.0 } else { probability };
            let ray = reflected_path(path, vertex, &shading, specular * part);
            self.queue_specular_photon(path, vertex, (shading.normal, 1.0), ray);
        }
    }

    /// Stores a photon at a non-specular surface with the medium `far` behind it. If `scattered` is
    /// `Some(factor)`, a caustic photon is also scattered, with its flux multiplied by the factor.
    fn store_and_scatter_at_rough(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        rough: &NonSpecular,
        (far, scattered): (&InteriorList, Option<f32>),
    ) {
        let mut bsdf = rough.evaluate_textures(&vertex.texture_point, &mut self.counters.texture_lookups);
        vertex.tint_bsdf_by_vertex_color(&mut bsdf);
        if !bsdf.is_black() {
            self.store_and_scatter(path, vertex, bsdf, (far, scattered));
        } else if vertex.is_blended() {
            // The photon may be reflected by another part of the blend.
            self.store_at_vertex(path, vertex);
        }
    }

    /// Stores a photon at a vertex. Its flux is scaled up to account for photons that passed through the surface
    /// as a null interaction, or that chose a part of a blend on which no photons are stored.
    fn store_at_vertex(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>) {
        let chance = storage_probability(path, vertex, &mut self.counters.texture_lookups);
        let all = PathRay { throughput: path.throughput / chance, ..*path };
        self.store_photon(&all, vertex.surface.point, vertex.normal);
    }

    /// Like [`PhotonWavefront::store_and_scatter_at_rough`], with the BSDF already evaluated.
    fn store_and_scatter(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        bsdf: BxdfPoint,
        (far, scattered): (&InteriorList, Option<f32>),
    ) {
        let tile = self.tracing.tile;
        self.store_at_vertex(path, vertex);
        let Some(factor) = scattered.filter(|_| path.state.only_specular_before && self.may_scatter()) else {
            return;
        };
        // Queue the photon for scattering.
        let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
        let behind = bsdf.bsdf_for_transmitted_light().map(|bsdf| (bsdf, shading.seen_from_far_side()));
        let interiors = self.interior_lists.push_list(&path.interiors);
        if self.open.used == ALL || self.open.bsdf.kind() != bsdf.kind() {
            self.scatter_queued_vertices();
            self.open.bsdf.set_kind(bsdf.kind());
        }
        let i = self.open.used.trailing_ones() as usize;
        let lit = ShadingVertex { path, interiors: &path.interiors, place: 0, vertex, shading, bsdf: &bsdf };
        self.open.set_vertex(i, tile, &lit, PathAov::ALL, interiors);
        let counts = self.open.adjoint_photon_weight(i, vertex.wo) * factor;
        set_lane(&mut self.open.throughput, i, path.throughput * counts);
        // Queue the transmitted photon. The medium behind the surface changes its basic flux.
        let Some((bsdf, shading)) = behind else { return };
        let part = if vertex.material.bsdf.as_dielectric().is_some() {
            let eta = medium_ior(tile.world, far) / medium_ior(tile.world, &path.interiors);
            1.0 / (eta * eta)
        } else {
            // For a camera path, this is transmission from the other side.
            diffuser_basic_radiance_transmittance(tile.world, far, &path.interiors)
        };
        let interiors = self.interior_lists.push_list(far);
        if self.open_behind.used == ALL || self.open_behind.bsdf.kind() != bsdf.kind() {
            self.scatter_queued_vertices();
            self.open_behind.bsdf.set_kind(bsdf.kind());
        }
        let i = self.open_behind.used.trailing_ones() as usize;
        let lit = ShadingVertex {
            path,
            interiors: far,
            place: 0,
            vertex: &vertex.seen_from_far_side(),
            shading,
            bsdf: &bsdf,
        };
        self.open_behind.set_vertex(i, tile, &lit, PathAov::ALL, interiors);
        set_lane(&mut self.open_behind.throughput, i, path.throughput * (counts * part));
    }

    fn shade_glass_hit(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>, far: &InteriorList) {
        if !self.may_scatter() {
            return;
        }
        let tile = self.tracing.tile;
        let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
        let FresnelSplit { reflectance, refracted } = fresnel_split(tile.world, path, vertex, &shading, far);
        match refracted {
            Some(mut ray) if !tile.chooses_reflection(path, reflectance) => {
                let eta = medium_ior(tile.world, far) / medium_ior(tile.world, &path.interiors);
                ray.throughput *= 1.0 / (eta * eta);
                self.queue_specular_photon(path, vertex, (shading.normal, eta), ray);
            }
            Some(_) | None => {
                let ray = reflected_path(path, vertex, &shading, Vec3::ONE);
                self.queue_specular_photon(path, vertex, (shading.normal, 1.0), ray);
            }
        }
    }

    /// Queues a photon after a specular bounce. If the shading normal differs from the geometric normal, the
    /// photon is weighted by the adjoint BSDF (see the module documentation). `eta` is the index of
    /// refraction on the far side relative to the near side.
    fn queue_specular_photon(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        (shading, eta): (Vec3, f32),
        mut ray: PathRay,
    ) {
        let facet = vertex.normal;
        if shading != facet {
            let (wi, wo) = (vertex.wo, ray.ray.direction);
            let along = |direction: Vec3| direction - shading * direction.dot(shading);
            // Skip this if the geometric normal was used instead of the shading normal.
            if (along(wi) + along(wo) * eta).length_squared() < SAME {
                let (over, under) = (wi.dot(shading) * wo.dot(facet), wi.dot(facet) * wo.dot(shading));
                ray.throughput *= if under == 0.0 { 0.0 } else { (over / under).abs() };
            }
        }
        debug_assert_eq!(path.slot, ray.slot);
        self.next.push(ray);
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
        if !self.may_scatter() || row.used == 0 {
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

    /// Applies Russian roulette based on flux. Surviving photons keep about their initial flux.
    fn apply_roulette_to_queued_photons(&mut self) {
        let tile = self.tracing.tile;
        let mut kept = 0;
        for begin in (0..self.next.len()).step_by(PACKET_SIZE) {
            let end = self.next.len().min(begin + PACKET_SIZE);
            let risks = tile
                .world
                .geometry
                .instruction_set()
                .run(RouletteRandomKernel { tile, rays: &self.next[begin..end] });
            for (place, risk) in (begin..end).zip(risks) {
                let mut ray = self.next[place];
                let flux = max_flux_component(tile.world, &ray);
                let chance = flux / self.references[ray.slot as usize];
                if !(flux > 0.0 && risk < chance) {
                    continue;
                }
                if chance < 1.0 {
                    ray.throughput /= chance;
                }
                self.next[kept] = ray;
                kept += 1;
            }
        }
        self.next.truncate(kept);
    }
}

/// Probability that a photon is stored where it hits a surface.
fn storage_probability(path: &PathRay, vertex: &SurfaceVertex<'_>, lookups: &mut u64) -> f32 {
    if !vertex.is_blended() {
        return opacity_at_path_vertex(path, vertex, lookups);
    }
    let at = vertex.texture_lookup_point(path.state.pdf > 0.0);
    let is_stored = |part: &Material| can_store_photons(part, vertex.is_front);
    vertex.surface_material.presence_probability(&at, &is_stored, lookups)
}

/// Largest component of a photon's flux in W. Unlike basic flux, it does not depend on the medium.
fn max_flux_component(world: &World, path: &PathRay) -> f32 {
    let index = medium_ior(world, &path.interiors);
    path.throughput.max_element() * index * index
}

fn is_from_infinite_light(emitted: &EmittedPhoton) -> bool {
    match emitted.start {
        PhotonOrigin::Beyond(_) => true,
        PhotonOrigin::Point(_) | PhotonOrigin::Surface { .. } => false,
    }
}

/// Draws the random numbers for photon emission.
struct PhotonRandomNumbersKernel<'a> {
    tile: &'a TileContext<'a>,
    first: u32,
}

impl SimdKernel for PhotonRandomNumbersKernel<'_> {
    type Output = [PhotonRandomNumbers; PACKET_SIZE];

    #[inline(always)]
    fn run(self, _: impl Simd) -> Self::Output {
        let slots = std::array::from_fn(|i| self.first + i as u32);
        let (xs, ys, samples) = self.tile.block.pixels_and_samples_of_slots(&slots);
        let sampler = SamplerPacket::new(self.tile.settings.render.seed, &xs, &ys, &samples);
        let pairs = |decision| sampler.pairs(&[CAMERA_PATH; PACKET_SIZE], decision, 0, 1);
        let (light, aim) = (pairs(Dimension::PhotonLight), pairs(Dimension::PhotonTarget));
        let (position, direction) = (pairs(Dimension::PhotonPosition), pairs(Dimension::PhotonDirection));
        std::array::from_fn(|i| PhotonRandomNumbers {
            light: light.map(|row| row[i]),
            aim: aim.map(|row| row[i]),
            position: position.map(|row| row[i]),
            direction: direction.map(|row| row[i]),
        })
    }
}

/// Draws the random numbers for Russian roulette.
struct RouletteRandomKernel<'a> {
    tile: &'a TileContext<'a>,
    rays: &'a [PathRay],
}

impl SimdKernel for RouletteRandomKernel<'_> {
    type Output = [f32; PACKET_SIZE];

    #[inline(always)]
    fn run(self, _: impl Simd) -> Self::Output {
        let (mut slots, mut paths) = ([0; PACKET_SIZE], [0; PACKET_SIZE]);
        for (i, ray) in self.rays.iter().enumerate().take(PACKET_SIZE) {
            (slots[i], paths[i]) = (ray.slot, ray.path);
        }
        let (xs, ys, samples) = self.tile.block.pixels_and_samples_of_slots(&slots);
        let sampler = SamplerPacket::new(self.tile.settings.render.seed, &xs, &ys, &samples);
        let [risks, _] = sampler.pairs(&paths, Dimension::Roulette, 0, 1);
        risks
    }
}
