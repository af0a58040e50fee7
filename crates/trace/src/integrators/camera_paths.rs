//! Paths from the camera, traced bounce by bounce with queues instead of recursion.
//!
//! In `whitted`, paths split at glass and end at diffuse and glossy surfaces, where direct and ambient light
//! is added (Whitted, *An Improved Illumination Model for Shaded Display*, 1980). At microfacet surfaces,
//! they continue in the narrow lobe. In `path`, paths do not split and continue at all surfaces (Kajiya, *The
//! Rendering Equation*, 1986). With photons, paths in `whitted` also continue at diffuse and glossy surfaces.

use std::ops::Range;

use super::RayCounters;
use super::aov::{record_first_hit, record_plain_first_hits, record_vertex};
use super::behavior::PathBehavior;
use super::direct::queue::{DirectLightQueue, ShadingSides};
use super::memory::ThreadMemory;
use super::photons::PhotonMaps;
use super::photons::gather::GatherPhotons;
use super::transport::accumulator::{Accumulator, NonReflectedTerm};
use super::transport::batch::VertexBatch;
use super::transport::camera::CAMERA_ROWS;
use super::transport::crossing::CrossingBuffers;
use super::transport::interface::{
    FresnelSplit, fresnel_split, reflected_path, sheet_transmission_between_media,
};
use super::transport::interiors::InteriorList;
use super::transport::packet::{PacketHits, PacketSource};
use super::transport::ray::PathRay;
use super::transport::scatter::ContinuationPolicy;
use super::transport::scratch::TraceBuffers;
use super::transport::tile::TileContext;
use super::transport::vertex::{ShadingVertex, SurfaceVertex};
use super::transport::walk::{
    Interaction, Interface, NullInteraction, OpaqueHit, PathStepper, walk_to_interaction,
};
use super::view::LightAov;
use crate::control::Cancelled;
use crate::geometry::Ray;
use crate::geometry::packet::{RayPacket, lane_indices};
use crate::geometry::surface_packet::SurfacePacket;
use crate::materials::bsdf::SampledLobes;
use crate::materials::{Bsdf, BxdfPoint, Coated, Mirror, NonSpecular, RoughDielectricPoint, ThinDielectric};
use crate::math::Vec3;
use crate::math::lanes::lane as lane_of;
use crate::scene::description::ShadowMode;
use crate::world::{Hit, PACKET_SIZE};

/// A path splits only if its weaker branch contributes at least this much. Otherwise, one branch is chosen at
/// random.
const MIN_SPLIT: f32 = 0.01;

/// Number of rays traced between checks of the cancel token.
const POLL_INTERVAL: usize = 256;

/// Traces the camera paths for a range of slots and adds their radiance to the accumulator. `negative`
/// receives the first slot of each packet and the mask of samples with a negative filter weight.
pub fn trace_camera_paths(
    (tile, maps): (&TileContext<'_>, Option<&PhotonMaps>),
    slots: Range<u32>,
    memory: &mut ThreadMemory,
    accumulator: Accumulator<'_>,
    counters: &mut RayCounters,
    mut negative: impl FnMut(u32, u32),
) -> Result<(), Cancelled> {
    let ThreadMemory { scratch, direct, .. } = memory;
    let TraceBuffers { rays, next, surfaces, crossing, camera, hits, object_order } = scratch;
    next.clear();
    let mut wavefront = CameraWavefront {
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
    wavefront.prepare_bounce_continuation();
    let has_fractions = match wavefront.accumulator.fractions() {
        Some(fractions) => {
            fractions.begin(slots.len());
            true
        }
        None => false,
    };
    wavefront.direct.begin_bounce(slots.len(), tile.pixel_spread > 0.0, has_fractions);
    // Trace and shade the camera rays, which are the first bounce.
    for start in slots.clone().step_by(CAMERA_ROWS * PACKET_SIZE) {
        tile.generate_camera_packets(start..slots.end, camera);
        for (first, row) in (start..).step_by(PACKET_SIZE).zip(&*camera) {
            negative(first, row.negative);
            let count = (slots.end - first).min(PACKET_SIZE as u32) as usize;
            wavefront.trace_packet(PacketSource::Camera(row, first, count, first - slots.start))?;
        }
    }
    // Compute direct lighting at the vertices, and add it to the accumulator.
    wavefront.add_direct_light()?;
    wavefront.direct.flush_consecutive(slots.start, &mut wavefront.accumulator);
    wavefront.next_bounce(rays);
    // Trace the remaining bounces.
    while !rays.is_empty() {
        wavefront.direct.begin_bounce(rays.len(), tile.pixel_spread > 0.0, has_fractions);
        if tile.behavior.scatters {
            // Find all hits first, so that each packet hits one object.
            tile.closest_hits(rays, hits)?;
            object_order.sort(hits);
            for places in object_order.indices().chunks(PACKET_SIZE) {
                wavefront.trace_packet(PacketSource::Traced(rays, hits, places))?;
            }
        } else {
            for (paths, first) in rays.chunks(PACKET_SIZE).zip((0..).step_by(PACKET_SIZE)) {
                wavefront.trace_packet(PacketSource::Paths(paths, first))?;
            }
        }
        let slots: &[PathRay] = rays;
        wavefront.add_direct_light()?;
        wavefront.direct.flush_to_accumulator(
            |place| (slots[place].slot, slots[place].state.only_specular_before),
            &mut wavefront.accumulator,
        );
        wavefront.next_bounce(rays);
    }
    Ok(())
}

/// Traversal cost of a path's ray up to the hit.
fn count_traversal_cost_to_hit(tile: &TileContext<'_>, path: &PathRay, hit: Option<Hit>) -> u32 {
    let t_max = hit.map_or(path.ray.t_max, |hit| hit.shape.t);
    tile.world.geometry.traversal_cost(&Ray { t_max, ..path.ray })
}

/// One bounce of all paths in a batch.
struct CameraWavefront<'a, 's> {
    /// Number of bounces before the current hits.
    depth: u32,
    /// How paths continue at diffuse and glossy surfaces. `None` if they end at these surfaces.
    continuation: Option<ContinuationPolicy>,
    tile: &'a TileContext<'a>,
    /// Photon maps for the samples. `None` if no photons are gathered.
    maps: Option<&'a PhotonMaps>,
    /// This bounce's vertices that await direct lighting.
    direct: &'a mut DirectLightQueue,
    /// Surfaces at the hits of the current packet.
    surfaces: &'a mut SurfacePacket,
    accumulator: Accumulator<'s>,
    /// Rays of the next bounce.
    next: &'a mut Vec<PathRay>,
    /// Index of the current path in this bounce's queue.
    place: u32,
    /// Whether the layers that show the first hit of the current camera ray are not recorded yet.
    is_first_hit_pending: bool,
    crossing: &'a mut CrossingBuffers,
    counters: &'a mut RayCounters,
}

impl<'a> PathStepper<'a> for CameraWavefront<'a, '_> {
    fn tile(&self) -> &'a TileContext<'a> {
        self.tile
    }

    fn crossing_buffers(&mut self) -> &mut CrossingBuffers {
        self.crossing
    }

    fn record_surface_crossing(&mut self, path: &PathRay, next: Option<Hit>) {
        if self.accumulator.aov == LightAov::TraversalCost {
            self.accumulator
                .add_traversal_cost(path.slot, count_traversal_cost_to_hit(self.tile, path, next));
        }
    }

    #[inline(always)]
    fn interact(&mut self, path: &PathRay, reached: Interaction<'_, 'a>, has_passed: bool) {
        match reached {
            Interaction::Opaque(vertex, hit, far) => {
                if !has_passed && matches!(hit, OpaqueHit::Direct(_)) {
                    self.record_camera_vertex(path, vertex);
                }
                if self.add_emission(path, vertex, hit) {
                    match &vertex.material.bsdf {
                        Bsdf::NonSpecular(rough) => self.shade_rough(path, vertex, rough, far),
                        Bsdf::Mirror(mirror) => self.shade_mirror(path, vertex, mirror),
                        Bsdf::Coated(coated) => self.shade_coated(path, vertex, coated, far),
                        Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) => {}
                    }
                }
            }
            Interaction::Glass(vertex, hit, Interface { far, rough }) => {
                if !has_passed {
                    self.record_camera_vertex(path, vertex);
                }
                if self.add_emission(path, vertex, OpaqueHit::Direct(hit)) {
                    match rough {
                        Some(rough) => self.queue_rough_glass_vertices(path, vertex, rough, far),
                        None => self.shade_glass(path, vertex, far),
                    }
                }
            }
            Interaction::Hidden if self.may_scatter() => self.push_specular(*path),
            Interaction::Hidden => {}
            Interaction::Nothing => self.add_escaped_light(path),
        }
    }

    fn texture_lookup_counter(&mut self) -> &mut u64 {
        &mut self.counters.texture_lookups
    }

    fn handle_pane(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'a>,
        hit: OpaqueHit,
        pane: &ThinDielectric,
    ) -> NullInteraction {
        let reflectance = pane.reflectance(vertex.surface.shading_normal.dot(vertex.wo));
        let tint = vertex.pane_transmittance(path, pane, &mut self.counters.texture_lookups);
        let left = tint * (1.0 - reflectance);
        // After the last bounce, only light that passes straight through the pane is added.
        if !self.add_emission(path, vertex, hit) {
            return NullInteraction::Passed(left);
        }
        let shading = vertex.shading_normals(self.counters);
        let mirrored = |weight: f32| reflected_path(path, vertex, &shading, Vec3::splat(weight));
        let weaker = reflectance.min(1.0 - reflectance) * path.throughput.abs().max_element();
        let splits = self.tile.behavior.splits && path.state.only_specular_before;
        if weaker >= MIN_SPLIT && splits {
            self.roulette_and_push_reflected(mirrored(reflectance));
            NullInteraction::Passed(left)
        } else if self.tile.chooses_reflection(path, reflectance) {
            self.roulette_and_push_reflected(mirrored(1.0));
            NullInteraction::Ended
        } else {
            NullInteraction::Passed(tint)
        }
    }
}

impl CameraWavefront<'_, '_> {
    fn add_direct_light(&mut self) -> Result<(), Cancelled> {
        let before = self.next.len();
        let (tile, maps, depth, aov) = (self.tile, self.maps, self.depth, self.accumulator.aov);
        let gather = |row: &VertexBatch| {
            let maps = maps?;
            Some(tile.world.geometry.instruction_set().run(GatherPhotons { tile, row, maps, depth, aov }))
        };
        let rays = self.direct.compute_direct_light(
            tile,
            aov,
            (self.continuation, depth),
            gather,
            (&mut *self.next, self.accumulator.fractions()),
        )?;
        self.counters.shadow_rays += rays.shadow;
        self.counters.texture_lookups += rays.lookups;
        self.counters.scattered_rays += rays.scattered + (self.next.len() - before) as u64;
        Ok(())
    }

    fn prepare_bounce_continuation(&mut self) {
        let continuation = || ContinuationPolicy::new(self.tile, self.depth, SampledLobes::All);
        self.continuation = self.tile.behavior.scatters.then(continuation);
    }

    /// Starts the next bounce with the rays generated in this bounce, reusing the old queue for output.
    fn next_bounce(&mut self, rays: &mut Vec<PathRay>) {
        std::mem::swap(rays, self.next);
        self.next.clear();
        if let Some(fractions) = self.accumulator.fractions() {
            fractions.next_bounce();
        }
        self.depth += 1;
        self.prepare_bounce_continuation();
    }

    /// Shades the hit of one ray in a packet. The path is large, so it is moved only here.
    #[inline(never)]
    fn shade_ray(&mut self, mut path: PathRay, (packet, lane): (&PacketHits, usize)) {
        let (tile, bit) = (self.tile, 1 << lane);
        match packet.hit(lane) {
            Some(hit) if packet.plain & bit != 0 => {
                self.add_emission_and_ambient(&path, &hit, packet.shining & bit != 0);
            }
            Some(hit) => {
                let surface = packet.surface_unless_plain(self.surfaces, lane);
                let camera_path = (self.depth == 0 && self.accumulator.first_hit_layers().is_some())
                    .then_some(path)
                    .filter(|_| !tile.world.has_see_through());
                self.is_first_hit_pending = camera_path.is_some();
                walk_to_interaction(self, &mut path, (hit, surface));
                if let Some(path) = camera_path.filter(|_| self.is_first_hit_pending)
                    && let Some(values) = self.accumulator.first_hit_layers()
                {
                    // The walk passed through the surface.
                    record_first_hit(tile, (&path, &hit), values, self.counters);
                }
            }
            None => {
                let sky = tile.world.lights.environment().map(|_| packet.sky_radiance(lane));
                self.add_infinite_light(&path, tile.infinite_light_with_sky(sky, &path));
            }
        }
    }

    /// Intersects and shades a packet of rays.
    fn trace_packet(&mut self, rays: PacketSource<'_>) -> Result<(), Cancelled> {
        let tile = self.tile;
        if (rays.queue_index(0) as usize).is_multiple_of(POLL_INTERVAL) {
            tile.token.check()?;
        }
        let are_lit = self.depth < tile.settings.render.max_depth && self.accumulator.accepts_reflected();
        let packet =
            tile.intersect(rays, self.accumulator.aov, are_lit, (self.direct.spare_batch(), self.surfaces));
        self.counters.texture_lookups += packet.lookups;
        // Record the traversal cost, if the view shows it.
        if self.accumulator.aov == LightAov::TraversalCost {
            for lane in 0..rays.count() {
                let path = packet.path(tile, &rays, lane);
                self.accumulator.add_traversal_cost(
                    path.slot,
                    count_traversal_cost_to_hit(tile, &path, packet.hit(lane)),
                );
            }
        }
        // Queue the vertices of plain surfaces for direct lighting.
        if are_lit {
            self.direct.commit_spare_batch();
            if tile.pixel_spread > 0.0 {
                for (lane, hit) in
                    lane_indices(packet.plain).filter_map(|lane| Some((lane, packet.hit(lane)?)))
                {
                    let cone = packet.path(tile, &rays, lane).cone.at_distance(hit.shape.t);
                    self.direct.store_cone(rays.queue_index(lane), cone);
                }
            }
        }
        // Select the rays that hit a light or escape to an infinite light, and the rays that must be shaded
        // one by one.
        let render = &tile.settings.render;
        let all = rays.mask();
        let plain = if render.ambient == Vec3::ZERO { packet.shining } else { packet.plain };
        let is_dark_beyond = render.background == Vec3::ZERO && !tile.world.lights.has_infinite_lights();
        let beyond = if is_dark_beyond { 0 } else { all & !packet.any };
        let mut wanted = packet.any & !packet.plain;
        match rays {
            PacketSource::Camera(row, first, ..) => {
                self.add_visible_emission(&row.rays, first, &packet, (plain, beyond));
                self.record_first_hits(&rays, &packet, first);
            }
            PacketSource::Paths(..) | PacketSource::Traced(..) => wanted |= plain | beyond,
        }
        // Shade in path order because the contributions to a sample are added in this order.
        for lane in lane_indices(wanted) {
            self.place = rays.queue_index(lane);
            self.shade_ray(packet.path(tile, &rays, lane), (&packet, lane));
        }
        // Compute direct lighting at the queued vertices while their data is in the cache.
        if self.direct.is_full() {
            self.add_direct_light()?;
        }
        Ok(())
    }

    /// Records the layers that show the first hits of camera rays, except for the hits that [`Self::interact`]
    /// records.
    fn record_first_hits(&mut self, rays: &PacketSource<'_>, packet: &PacketHits, first: u32) {
        let tile = self.tile;
        let Some(values) = self.accumulator.first_hit_layers() else { return };
        let mut left = record_plain_first_hits(tile, (packet, self.surfaces), first, values);
        // Paths may pass through surfaces that the layers show.
        if tile.world.has_see_through() {
            left |= packet.any & !packet.plain & rays.mask();
        }
        for lane in lane_indices(left) {
            let Some(hit) = packet.hit(lane) else { continue };
            record_first_hit(tile, (&packet.path(tile, rays, lane), &hit), values, self.counters);
        }
    }

    /// Records the layers that show first hits at the vertex where a camera ray's walk ended.
    fn record_camera_vertex(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>) {
        if self.is_first_hit_pending
            && let Some(values) = self.accumulator.first_hit_layers()
        {
            record_vertex(self.tile, path.slot, vertex, values, self.counters);
            self.is_first_hit_pending = false;
        }
    }

    /// Adds the emission visible to camera rays: from plain surfaces, the background and infinite lights. It
    /// can be added directly because each sample's emission precedes its direct light.
    fn add_visible_emission(
        &mut self,
        rays: &RayPacket,
        first: u32,
        packet: &PacketHits,
        (plain, beyond): (u32, u32),
    ) {
        let tile = self.tile;
        let render = &tile.settings.render;
        // Add the emission and ambient light of plain surfaces.
        let mut known = None;
        for lane in lane_indices(plain) {
            let Some(hit) = packet.hit(lane) else { continue };
            let index = tile.world.material_index(&hit);
            if known.is_none_or(|(own, _)| own != index) {
                known = tile.plain_packet_material(index).map(|plain| (index, plain));
            }
            let Some((_, (material, _))) = known else { continue };
            let slot = first + lane as u32;
            if packet.shining & 1 << lane != 0 {
                self.accumulator.add_non_reflected(slot, NonReflectedTerm::Emitted, material.emission);
            }
            if render.ambient != Vec3::ZERO && self.depth < render.max_depth {
                let Some(ambient) = material.ambient else { continue };
                self.accumulator.add_non_reflected(slot, NonReflectedTerm::Ambient, render.ambient * ambient);
            }
        }
        // Add the background and the infinite lights.
        let lights = &tile.world.lights;
        for lane in lane_indices(beyond) {
            let sky = lights.environment().map(|_| packet.sky_radiance(lane));
            let beyond =
                lights.radiance_from_infinity_with_sky(sky, lane_of(&rays.direction, lane), |_, _| 1.0);
            self.accumulator.add_non_reflected(
                first + lane as u32,
                NonReflectedTerm::Emitted,
                render.background + beyond,
            );
        }
    }

    /// Adds a plain surface's emission and ambient light.
    fn add_emission_and_ambient(&mut self, path: &PathRay, hit: &Hit, is_shining: bool) {
        let index = self.tile.world.material_index(hit);
        let Some((material, _)) = self.tile.plain_packet_material(index) else { return };
        if is_shining {
            self.add_weighted_emission(path, material.emission, self.tile.emitter_weight(path, hit));
        }
        let render = &self.tile.settings.render;
        if render.ambient != Vec3::ZERO && self.depth < render.max_depth {
            let Some(ambient) = material.ambient else { return };
            self.accumulator.add_ambient(path, self.place, path.throughput * render.ambient * ambient);
        }
    }

    /// Adds the emission found by a path, multiplied by the path's MIS weight. Light samples contribute the
    /// rest.
    fn add_weighted_emission(&mut self, path: &PathRay, radiance: Vec3, weight: f32) {
        if self.is_light_counted_elsewhere(path) {
            return;
        }
        if path.state.only_specular_before {
            self.accumulator.add_non_reflected(
                path.slot,
                NonReflectedTerm::Emitted,
                path.throughput * radiance,
            );
        } else {
            self.accumulator.add_emitter_hit(path, self.place, path.throughput * radiance * weight);
        }
    }

    /// Whether another technique accounts for the emission found by a path: photons for light via mirrors and
    /// glass, or light samples for hard shadows.
    fn is_light_counted_elsewhere(&self, path: &PathRay) -> bool {
        let PathBehavior { gathers, mirrors, .. } = self.tile.behavior;
        let is_shared = path.state.pdf > 0.0;
        let is_soft = self.tile.settings.render.shadows == ShadowMode::Soft;
        !path.state.only_specular_before && (gathers || mirrors && is_shared) && !(is_shared && is_soft)
    }

    fn add_escaped_light(&mut self, path: &PathRay) {
        self.add_infinite_light(path, self.tile.mis_weighted_infinite_light(path));
    }

    /// Adds light from infinite lights to a path that leaves the scene. The background is visible but does
    /// not illuminate anything.
    fn add_infinite_light(&mut self, path: &PathRay, beyond: Vec3) {
        if path.state.only_specular_before {
            let background = self.tile.settings.render.background;
            self.accumulator.add_non_reflected(
                path.slot,
                NonReflectedTerm::Emitted,
                path.throughput * (background + beyond),
            );
        } else if beyond != Vec3::ZERO && !self.is_light_counted_elsewhere(path) {
            self.accumulator.add_emitter_hit(path, self.place, path.throughput * beyond);
        }
    }

    /// Whether paths may scatter at the current hits.
    fn may_scatter(&self) -> bool {
        self.depth < self.tile.settings.render.max_depth
    }

    /// Adds the emission of a surface and returns whether the path may scatter at the surface.
    fn add_emission(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>, hit: OpaqueHit) -> bool {
        if vertex.emits() {
            let weight = match hit {
                OpaqueHit::Direct(hit) => self.tile.emitter_weight(path, &hit),
                OpaqueHit::Touching(hit) => self.tile.emitter_weight_at_glass(path, &hit),
            };
            let radiance = vertex.emitted_radiance(path, self.counters);
            self.add_weighted_emission(path, radiance, weight);
        }
        self.may_scatter()
    }

    /// Shades a non-specular surface. `far` is the medium behind the surface.
    fn shade_rough(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        rough: &NonSpecular,
        far: &InteriorList,
    ) {
        let (at, lookups) = (&vertex.texture_point, &mut self.counters.texture_lookups);
        let ambient = self.tile.settings.render.ambient;
        let accepts_ambient = ambient != Vec3::ZERO && self.accumulator.accepts_ambient(path);
        // Look up only the textures needed for the displayed quantity.
        if !self.accumulator.accepts_reflected() {
            if accepts_ambient {
                let reflectance = vertex.times_vertex_color(rough.look_up_ambient(at, lookups));
                self.accumulator.add_ambient(path, self.place, path.throughput * ambient * reflectance);
            }
            return;
        }
        let is_colored = self.accumulator.aov.has_surface_colors_applied();
        let mut bsdf =
            if is_colored { rough.evaluate_textures(at, lookups) } else { rough.with_white_textures() };
        if is_colored {
            vertex.tint_by_vertex_color(&mut bsdf);
        }
        if accepts_ambient {
            self.accumulator.add_ambient(
                path,
                self.place,
                path.throughput * ambient * bsdf.ambient_reflectance(),
            );
        }
        if bsdf.is_black() {
            return;
        }
        self.queue_rough(path, vertex, &bsdf, far);
    }

    /// Queues the vertices of a non-specular surface for direct lighting. `far` is the medium behind the
    /// surface.
    #[inline(always)]
    fn queue_rough(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        bsdf: &BxdfPoint,
        far: &InteriorList,
    ) {
        let (tile, place) = (self.tile, self.place);
        let shading = vertex.shading_normals(self.counters);
        let behind = bsdf.transmission_bsdf().map(|bsdf| (bsdf, shading.far_side()));
        let aov = self.light_aov_selection_at_vertex(path);
        let lit = ShadingVertex { path, interiors: &path.interiors, place, vertex, shading, bsdf };
        self.direct.push(tile, &lit, aov, ShadingSides::OneSide { is_dark: false });
        // Transmitted light has its own vertex, except for the lit fraction, which is measured on the
        // viewer's side.
        if let Some((bsdf, shading)) = behind.filter(|_| aov != LightAov::LitFraction) {
            let throughput =
                path.throughput * sheet_transmission_between_media(tile.world, &path.interiors, far);
            let (path, vertex) = (&PathRay { throughput, ..*path }, &vertex.far_side());
            let lit = ShadingVertex { path, interiors: far, place, vertex, shading, bsdf: &bsdf };
            self.direct.push(tile, &lit, aov, ShadingSides::OneSide { is_dark: false });
        }
    }

    /// Queues the vertices for rough glass: one for each side, or a single vertex if light samples cannot
    /// reach one of the sides.
    fn queue_rough_glass_vertices(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        rough: RoughDielectricPoint,
        far: &InteriorList,
    ) {
        if !self.accumulator.accepts_reflected() {
            return;
        }
        let (tile, place) = (self.tile, self.place);
        let shading = vertex.shading_normals(self.counters);
        let aov = self.light_aov_selection_at_vertex(path);
        let near = &path.interiors;
        let reflection = BxdfPoint::DielectricReflection(rough);
        let transmission = BxdfPoint::DielectricTransmission(rough);
        // The lit fraction is measured on the viewer's side. Blocked light is included, so a dark side is
        // sampled like any other.
        if aov == LightAov::LitFraction {
            let lit = ShadingVertex { path, interiors: near, place, vertex, shading, bsdf: &reflection };
            return self.direct.push(tile, &lit, aov, ShadingSides::OneSide { is_dark: false });
        }
        // Without shadows, lights also illuminate the inside of solids.
        let has_shadows = tile.settings.render.shadows != ShadowMode::Off;
        let is_dark = |interiors: &InteriorList| {
            interiors.glass().is_some_and(|inside| tile.world.is_unlit_glass(inside.body))
        };
        let dark = [near, far].map(|interiors| has_shadows && is_dark(interiors));
        // Photons are stored on both sides, so each side needs a vertex.
        let is_one = dark != [false; 2] && !tile.behavior.gathers && vertex.far_origin().is_some();
        let is_behind = is_one && dark == [true, false];
        let sides = |vertex: &SurfaceVertex<'_>, is_dark: bool, interiors| match vertex.far_origin() {
            Some(beyond) if is_one => ShadingSides::TwoSides { is_dark, beyond, interiors },
            Some(_) | None => ShadingSides::OneSide { is_dark },
        };
        // Queue the viewer's side, unless the vertex on the other side represents both sides.
        let behind = (!is_one || is_behind).then(|| (vertex.far_side(), shading.far_side()));
        if !is_behind {
            let lit = ShadingVertex { path, interiors: near, place, vertex, shading, bsdf: &reflection };
            self.direct.push(tile, &lit, aov, sides(vertex, dark[0], far));
        }
        // Queue the other side.
        if let Some((vertex, shading)) = behind {
            let lit =
                ShadingVertex { path, interiors: far, place, vertex: &vertex, shading, bsdf: &transmission };
            self.direct.push(tile, &lit, aov, sides(&vertex, dark[1], near));
        }
    }

    /// The light AOV at a path's vertex. After the first non-specular surface, all light is included.
    fn light_aov_selection_at_vertex(&self, path: &PathRay) -> LightAov {
        if path.state.only_specular_before { self.accumulator.aov } else { LightAov::ALL }
    }

    fn shade_mirror(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>, mirror: &Mirror) {
        let shading = vertex.shading_normals(self.counters);
        let is_colored = self.accumulator.aov.has_surface_colors_applied();
        let reflectance = vertex.mirror_reflectance(mirror, &shading, is_colored, self.counters);
        self.roulette_and_push_reflected(reflected_path(path, vertex, &shading, reflectance));
    }

    /// Splits a path at a smooth coat, or randomly chooses the coat or the base. The probability of choosing
    /// the coat is its Fresnel reflectance.
    fn shade_coated(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        coated: &Coated,
        far: &InteriorList,
    ) {
        let shading = vertex.shading_normals(self.counters);
        let fresnel = vertex.coat_reflectance(coated, &shading);
        let weaker = fresnel.min(1.0 - fresnel) * path.throughput.abs().max_element();
        let splits = self.tile.behavior.splits && path.state.only_specular_before;
        let both = weaker >= MIN_SPLIT && splits;
        let is_coat = !both && self.tile.chooses_reflection(path, fresnel);
        if both || is_coat {
            let lookups = &mut self.counters.texture_lookups;
            let specular =
                coated.specular_factor(&vertex.texture_point, lookups) * if both { fresnel } else { 1.0 };
            if specular != Vec3::ZERO {
                self.roulette_and_push_reflected(reflected_path(path, vertex, &shading, specular));
            }
        }
        if !is_coat {
            // Divide by the probability of choosing the base.
            let by_chance = if both { 1.0 } else { 1.0 / (1.0 - fresnel) };
            let mut state = path.state;
            state.roulette_throughput *= by_chance;
            let path = PathRay { throughput: path.throughput * by_chance, state, ..*path };
            self.shade_rough(&path, vertex, &coated.base, far);
        }
    }

    fn shade_glass(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>, far: &InteriorList) {
        let shading = vertex.shading_normals(self.counters);
        let FresnelSplit { reflectance, refracted } =
            fresnel_split(self.tile.world, path, vertex, &shading, far);
        let mirrored = |weight: f32| reflected_path(path, vertex, &shading, Vec3::splat(weight));
        let Some(refracted) = refracted else { return self.roulette_and_push_reflected(mirrored(1.0)) };
        let weaker = reflectance.min(1.0 - reflectance) * path.throughput.abs().max_element();
        let splits = self.tile.behavior.splits && path.state.only_specular_before;
        if weaker >= MIN_SPLIT && splits {
            self.roulette_and_push_reflected(mirrored(reflectance));
            self.roulette_and_push_refracted(refracted, 1.0 - reflectance);
        } else if self.tile.chooses_reflection(path, reflectance) {
            self.roulette_and_push_reflected(mirrored(1.0));
        } else {
            self.roulette_and_push_refracted(refracted, 1.0);
        }
    }

    fn roulette_and_push_reflected(&mut self, ray: PathRay) {
        let Some(ray) = self.russian_roulette(ray) else { return };
        self.counters.reflected_rays += 1;
        self.push_specular(ray);
    }

    fn roulette_and_push_refracted(&mut self, mut ray: PathRay, weight: f32) {
        ray.throughput *= weight;
        let Some(ray) = self.russian_roulette(ray) else { return };
        self.counters.refracted_rays += 1;
        self.push_specular(ray);
    }

    /// Queues a ray with which the current path continues without a diffuse or glossy vertex.
    fn push_specular(&mut self, ray: PathRay) {
        self.next.push(ray);
        if let Some(fractions) = self.accumulator.fractions() {
            fractions.inherit(self.place);
        }
    }

    fn russian_roulette(&self, ray: PathRay) -> Option<PathRay> {
        match self.continuation {
            Some(continuation) if !self.tile.behavior.splits || !ray.state.only_specular_before => {
                continuation.russian_roulette(self.tile, ray)
            }
            Some(_) | None => Some(ray),
        }
    }
}
