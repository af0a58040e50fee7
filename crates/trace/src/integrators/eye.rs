//! Camera rays, round by round over queues instead of recursion. In whitted they are split at glass and end at Phong surfaces,
//! which get direct and ambient light (Whitted, *An Improved Illumination Model for Shaded Display*, 1980); a ray in the lobe of
//! microfacets goes on to what the lobe mirrors. In path each ray stays
//! one and goes on from all surfaces (Kajiya, *The Rendering Equation*, 1986); with photons, whitted also goes on from Phong
//! surfaces so.

use std::ops::Range;

use super::RayCounters;
use super::direct::queue::{DirectLightQueue, Lit};
use super::memory::Memory;
use super::method::Behaviour;
use super::photons::PhotonMaps;
use super::photons::gather::Gathering;
use super::transport::accumulator::{Accumulator, Part};
use super::transport::batch::VertexBatch;
use super::transport::camera::CAMERA_ROWS;
use super::transport::crossing::CrossingMemory;
use super::transport::interface::{Interface, interface, reflected, through_sheet};
use super::transport::medium::Medium;
use super::transport::packet::{PacketHits, PacketSource};
use super::transport::ray::PathRay;
use super::transport::scatter::Continuation;
use super::transport::scratch::Scratch;
use super::transport::tile::TileContext;
use super::transport::vertex::{ShadingVertex, Vertex};
use super::transport::walk::{Change, OpaqueHit, Reached, Straight, Walker, walk};
use super::view::Measure;
use crate::control::Cancelled;
use crate::geometry::Ray;
use crate::geometry::rows::{RayRows, lanes};
use crate::geometry::surface_rows::SurfaceRow;
use crate::materials::bsdf::LobeSet;
use crate::materials::{Bsdf, Coated, GlassPoint, Mirror, Pane, Rough, RoughBsdf};
use crate::math::Vec3;
use crate::math::lanes::lane as lane_of;
use crate::scene::description::Shadows;
use crate::world::{Hit, PACKET};

/// Least contribution of the weaker part for which a ray is split in two; below it, one part is chosen at random.
const LEAST_SPLIT: f32 = 0.01;

/// Rays between two polls of the token.
const POLL_INTERVAL: usize = 256;

/// Follows the camera rays of some slots to the end; the accumulator takes the light that they see. `negative` gets the slots of
/// negative weight.
pub fn trace(
    (tile, maps): (&TileContext<'_>, Option<&PhotonMaps>),
    slots: Range<u32>,
    memory: &mut Memory,
    accumulator: Accumulator<'_>,
    counters: &mut RayCounters,
    mut negative: impl FnMut(u32, u32),
) -> Result<(), Cancelled> {
    let Memory { scratch, direct } = memory;
    let Scratch { rays, next, surfaces, crossing, camera, hits, by_object } = scratch;
    next.clear();
    let mut wavefront = Wavefront {
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
        counters,
    };
    wavefront.begin_round();
    wavefront.direct.expect(slots.len(), tile.pixel_spread > 0.0);
    // Make and shade the camera rays, which are the first round.
    for start in slots.clone().step_by(CAMERA_ROWS * PACKET) {
        tile.camera_rows(start..slots.end, camera);
        for (first, row) in (start..).step_by(PACKET).zip(&*camera) {
            negative(first, row.negative);
            let count = (slots.end - first).min(PACKET as u32) as usize;
            wavefront.shade_packet(PacketSource::Camera(row, first, count, first - slots.start))?;
        }
    }
    // Light their vertices, and give the light to the accumulator.
    wavefront.light()?;
    wavefront.direct.settle_run(slots.start, &mut wavefront.accumulator);
    wavefront.next_round(rays);
    // Follow the rays that go on, round by round.
    while !rays.is_empty() {
        wavefront.direct.expect(rays.len(), tile.pixel_spread > 0.0);
        if tile.behaviour.scatters {
            // Find all hits first, so that packets are of one object.
            tile.closest_hits(rays, hits)?;
            by_object.sort(hits);
            for places in by_object.places().chunks(PACKET) {
                wavefront.shade_packet(PacketSource::Traced(rays, hits, places))?;
            }
        } else {
            for (paths, first) in rays.chunks(PACKET).zip((0..).step_by(PACKET)) {
                wavefront.shade_packet(PacketSource::Paths(paths, first))?;
            }
        }
        let slots: &[PathRay] = rays;
        wavefront.light()?;
        wavefront.direct.settle(
            |place| (slots[place].slot, slots[place].state.only_specular_before),
            &mut wavefront.accumulator,
        );
        wavefront.next_round(rays);
    }
    Ok(())
}

/// Work of a path's ray up to its hit.
fn work(tile: &TileContext<'_>, path: &PathRay, hit: Option<Hit>) -> u32 {
    let t_max = hit.map_or(path.ray.t_max, |hit| hit.shape.t);
    tile.world.geometry.work(&Ray { t_max, ..path.ray })
}

/// One round of all rays of a batch.
struct Wavefront<'a, 's> {
    /// Number of scatterings before the hits of this round.
    depth: u32,
    /// Continuation of paths at Phong surfaces. `None` if they end there.
    continuation: Option<Continuation>,
    tile: &'a TileContext<'a>,
    /// Photons of the samples. `None` if none are gathered.
    maps: Option<&'a PhotonMaps>,
    /// Vertices of this round that wait for direct light.
    direct: &'a mut DirectLightQueue,
    /// Surfaces at the hits of the current packet.
    surfaces: &'a mut SurfaceRow,
    accumulator: Accumulator<'s>,
    /// Rays of the next round.
    next: &'a mut Vec<PathRay>,
    /// Place of the current path in the round's queue.
    place: u32,
    crossing: &'a mut CrossingMemory,
    counters: &'a mut RayCounters,
}

impl<'a> Walker<'a> for Wavefront<'a, '_> {
    fn tile(&self) -> &'a TileContext<'a> {
        self.tile
    }

    fn crossing(&mut self) -> &mut CrossingMemory {
        self.crossing
    }

    fn pass(&mut self, path: &PathRay, next: Option<Hit>) {
        if self.accumulator.measure == Measure::Work {
            self.accumulator.add_work(path.slot, work(self.tile, path, next));
        }
    }

    #[inline(always)]
    fn reach(&mut self, path: &PathRay, reached: Reached<'_, 'a>, _has_passed: bool) {
        match reached {
            Reached::Opaque(vertex, hit, far) => {
                if self.arrive(path, vertex, hit) {
                    match &vertex.material.bsdf {
                        Bsdf::Rough(rough) => self.shade_rough(path, vertex, rough, far),
                        Bsdf::Mirror(mirror) => self.shade_mirror(path, vertex, mirror),
                        Bsdf::Coated(coated) => self.shade_coated(path, vertex, coated, far),
                        Bsdf::Glass(_) | Bsdf::Pane(_) => {}
                    }
                }
            }
            Reached::Glass(vertex, hit, Change { far, rough }) => {
                if self.arrive(path, vertex, OpaqueHit::Own(hit)) {
                    match rough {
                        Some(rough) => self.shade_rough_glass(path, vertex, rough, far),
                        None => self.shade_glass(path, vertex, far),
                    }
                }
            }
            Reached::Hidden if self.goes_on() => self.next.push(*path),
            Reached::Hidden => {}
            Reached::Nothing => self.leave(path),
        }
    }

    fn lookups(&mut self) -> &mut u64 {
        &mut self.counters.texture_lookups
    }

    fn meet_pane(&mut self, path: &PathRay, vertex: &Vertex<'a>, hit: OpaqueHit, pane: &Pane) -> Straight {
        let reflectance = pane.reflectance(vertex.surface.shading_normal.dot(vertex.to_eye));
        let tint = vertex.pane_tint(path, pane, &mut self.counters.texture_lookups);
        let left = tint * (1.0 - reflectance);
        // After the last scattering, only what goes straight on finds light.
        if !self.arrive(path, vertex, hit) {
            return Straight::Passes(left);
        }
        let shading = vertex.shading(self.counters);
        let mirrored = |weight: f32| reflected(path, vertex, &shading, Vec3::splat(weight));
        let weaker = reflectance.min(1.0 - reflectance) * path.throughput.abs().max_element();
        let splits = self.tile.behaviour.splits && path.state.only_specular_before;
        if weaker >= LEAST_SPLIT && splits {
            self.push_reflected(mirrored(reflectance));
            Straight::Passes(left)
        } else if self.tile.chooses_reflection(path, reflectance) {
            self.push_reflected(mirrored(1.0));
            Straight::Ends
        } else {
            Straight::Passes(tint)
        }
    }
}

impl Wavefront<'_, '_> {
    fn light(&mut self) -> Result<(), Cancelled> {
        let before = self.next.len();
        let (tile, maps, depth, measure) = (self.tile, self.maps, self.depth, self.accumulator.measure);
        let gather = |row: &VertexBatch| {
            let maps = maps?;
            Some(tile.world.geometry.instructions().run(Gathering { tile, row, maps, depth, measure }))
        };
        let rays = self.direct.light(tile, measure, (self.continuation, depth), gather, self.next)?;
        self.counters.shadow_rays += rays.shadow;
        self.counters.texture_lookups += rays.lookups;
        self.counters.scattered_rays += rays.scattered + (self.next.len() - before) as u64;
        Ok(())
    }

    fn begin_round(&mut self) {
        let continuation = || Continuation::new(self.tile, self.depth, LobeSet::All);
        self.continuation = self.tile.behaviour.scatters.then(continuation);
    }

    /// Makes the found rays those of the next round; the old ones stay as memory.
    fn next_round(&mut self, rays: &mut Vec<PathRay>) {
        std::mem::swap(rays, self.next);
        self.next.clear();
        self.depth += 1;
        self.begin_round();
    }

    /// Shades the hit of one ray of a packet. The path is moved here once: it is large.
    #[inline(never)]
    fn shade(&mut self, mut path: PathRay, (packet, lane): (&PacketHits, usize)) {
        let (tile, bit) = (self.tile, 1 << lane);
        match packet.hit(lane) {
            Some(hit) if packet.plain & bit != 0 => {
                self.add_own_light(&path, &hit, packet.shining & bit != 0);
            }
            Some(hit) => {
                let surface = packet.surface(self.surfaces, lane);
                walk(self, &mut path, (hit, surface));
            }
            None => {
                let sky = tile.world.lights.environment().map(|_| packet.sky(lane));
                self.add_beyond(&path, tile.light_beyond_with(sky, &path));
            }
        }
    }

    /// Shades the hits of a packet's rays.
    fn shade_packet(&mut self, rays: PacketSource<'_>) -> Result<(), Cancelled> {
        let tile = self.tile;
        if (rays.place(0) as usize).is_multiple_of(POLL_INTERVAL) {
            tile.token.check()?;
        }
        let are_lit = self.depth < tile.settings.render.max_depth && self.accumulator.takes_reflected();
        let packet =
            tile.intersect(rays, self.accumulator.measure, are_lit, (self.direct.spare(), self.surfaces));
        self.counters.texture_lookups += packet.lookups;
        // Count the work of the rays, if the view shows it.
        if self.accumulator.measure == Measure::Work {
            for lane in 0..rays.count() {
                let path = packet.path(tile, &rays, lane);
                self.accumulator.add_work(path.slot, work(tile, &path, packet.hit(lane)));
            }
        }
        // Queue the plain vertices for direct light.
        if are_lit {
            self.direct.keep();
            if tile.pixel_spread > 0.0 {
                for (lane, hit) in lanes(packet.plain).filter_map(|lane| Some((lane, packet.hit(lane)?))) {
                    let cone = packet.path(tile, &rays, lane).cone.after(hit.shape.t);
                    self.direct.note_cone(rays.place(lane), cone);
                }
            }
        }
        // Select the rays that find light by themselves, and those that need shading one by one.
        let render = &tile.settings.render;
        let all = ((1_u64 << rays.count()) - 1) as u32;
        let plain = if render.ambient == Vec3::ZERO { packet.shining } else { packet.plain };
        let is_dark_beyond = render.background == Vec3::ZERO && !tile.world.lights.are_beyond();
        let beyond = if is_dark_beyond { 0 } else { all & !packet.any };
        let mut wanted = packet.any & !packet.plain;
        match rays {
            PacketSource::Camera(row, first, ..) => self.add_seen(&row.rays, first, &packet, (plain, beyond)),
            PacketSource::Paths(..) | PacketSource::Traced(..) => wanted |= plain | beyond,
        }
        // Go in the order of the paths, as the contributions to a sample are added in that order.
        for lane in lanes(wanted) {
            self.place = rays.place(lane);
            self.shade(packet.path(tile, &rays, lane), (&packet, lane));
        }
        // Light the queued vertices while their data are in the cache.
        if self.direct.is_full() {
            self.light()?;
        }
        Ok(())
    }

    /// Adds the emission that camera rays see: of plain surfaces, and from beyond everything. It is all that the sample of each ray
    /// gets before lamps.
    fn add_seen(&mut self, rays: &RayRows, first: u32, packet: &PacketHits, (plain, beyond): (u32, u32)) {
        let tile = self.tile;
        let render = &tile.settings.render;
        // Add the emission and ambient light of plain surfaces.
        let mut known = None;
        for lane in lanes(plain) {
            let Some(hit) = packet.hit(lane) else { continue };
            let index = tile.world.material_index(&hit);
            if known.is_none_or(|(own, _)| own != index) {
                known = tile.plain(index).map(|plain| (index, plain));
            }
            let Some((_, (material, _))) = known else { continue };
            let slot = first + lane as u32;
            if packet.shining & 1 << lane != 0 {
                self.accumulator.add(slot, Part::Emitted, material.emission);
            }
            if render.ambient != Vec3::ZERO && self.depth < render.max_depth {
                let Some(ambient) = material.ambient else { continue };
                self.accumulator.add(slot, Part::Ambient, render.ambient * ambient);
            }
        }
        // Add the background and the lights beyond the scene.
        let lights = &tile.world.lights;
        for lane in lanes(beyond) {
            let sky = lights.environment().map(|_| packet.sky(lane));
            let beyond = lights.beyond_with(sky, lane_of(&rays.direction, lane), |_, _| 1.0);
            self.accumulator.add(first + lane as u32, Part::Emitted, render.background + beyond);
        }
    }

    /// Adds the emission and ambient light of a plain surface.
    fn add_own_light(&mut self, path: &PathRay, hit: &Hit, is_shining: bool) {
        let index = self.tile.world.material_index(hit);
        let Some((material, _)) = self.tile.plain(index) else { return };
        if is_shining {
            self.add_emitted(path, material.emission, self.tile.lamp_weight(path, hit));
        }
        let render = &self.tile.settings.render;
        if render.ambient != Vec3::ZERO && self.depth < render.max_depth {
            let Some(ambient) = material.ambient else { return };
            self.accumulator.add_ambient(path, path.throughput * render.ambient * ambient);
        }
    }

    /// Adds the weighted emission that a path meets; light samples find the rest.
    fn add_emitted(&mut self, path: &PathRay, radiance: Vec3, weight: f32) {
        if self.is_gathered(path) {
            return;
        }
        if path.state.only_specular_before {
            self.accumulator.add(path.slot, Part::Emitted, path.throughput * radiance);
        } else {
            self.accumulator.add_met(path, path.throughput * radiance * weight);
        }
    }

    /// Whether another technique finds the light that a path meets: photons, behind mirrors and glass, or light samples alone, for
    /// hard shadows.
    fn is_gathered(&self, path: &PathRay) -> bool {
        let Behaviour { gathers, mirrors, .. } = self.tile.behaviour;
        let is_shared = path.state.density > 0.0;
        let is_soft = self.tile.settings.render.shadows == Shadows::Soft;
        !path.state.only_specular_before && (gathers || mirrors && is_shared) && !(is_shared && is_soft)
    }

    fn leave(&mut self, path: &PathRay) {
        self.add_beyond(path, self.tile.light_beyond(path));
    }

    /// Adds the light that a path meets beyond everything; the background illuminates nothing.
    fn add_beyond(&mut self, path: &PathRay, beyond: Vec3) {
        if path.state.only_specular_before {
            let background = self.tile.settings.render.background;
            self.accumulator.add(path.slot, Part::Emitted, path.throughput * (background + beyond));
        } else if beyond != Vec3::ZERO && !self.is_gathered(path) {
            self.accumulator.add_met(path, path.throughput * beyond);
        }
    }

    /// Whether paths may be scattered at the hits of this round.
    fn goes_on(&self) -> bool {
        self.depth < self.tile.settings.render.max_depth
    }

    /// Adds the emission of an opaque surface; returns whether the path may be scattered there.
    fn arrive(&mut self, path: &PathRay, vertex: &Vertex<'_>, hit: OpaqueHit) -> bool {
        if vertex.emits() {
            let weight = match hit {
                OpaqueHit::Own(hit) => self.tile.lamp_weight(path, &hit),
                OpaqueHit::Touching(hit) => self.tile.touching_lamp_weight(path, &hit),
            };
            let radiance = vertex.emitted(path, self.counters);
            self.add_emitted(path, radiance, weight);
        }
        self.goes_on()
    }

    /// Shades a rough surface before a medium.
    fn shade_rough(&mut self, path: &PathRay, vertex: &Vertex<'_>, rough: &Rough, far: &Medium) {
        let (at, lookups) = (&vertex.texture_point, &mut self.counters.texture_lookups);
        let ambient = self.tile.settings.render.ambient;
        let takes_ambient = ambient != Vec3::ZERO && self.accumulator.takes_ambient(path);
        // Look up no more textures than the picture shows.
        if !self.accumulator.takes_reflected() {
            if takes_ambient {
                let reflectance = vertex.tinted(rough.ambient_at(at, lookups));
                self.accumulator.add_ambient(path, path.throughput * ambient * reflectance);
            }
            return;
        }
        let is_colored = self.accumulator.measure.is_colored();
        let mut bsdf = if is_colored { rough.at(at, lookups) } else { rough.bleached() };
        if is_colored {
            vertex.tint(&mut bsdf);
        }
        if takes_ambient {
            self.accumulator.add_ambient(path, path.throughput * ambient * bsdf.ambient());
        }
        if bsdf.is_black() {
            return;
        }
        self.light_rough(path, vertex, &bsdf, far);
    }

    /// Queues the vertices of a rough surface for direct light, with the medium behind it.
    #[inline(always)]
    fn light_rough(&mut self, path: &PathRay, vertex: &Vertex<'_>, bsdf: &RoughBsdf, far: &Medium) {
        let (tile, place) = (self.tile, self.place);
        let shading = vertex.shading(self.counters);
        let behind = bsdf.behind().map(|bsdf| (bsdf, shading.behind()));
        let measure = self.measure_of(path);
        let lit = ShadingVertex { path, medium: &path.medium, place, vertex, shading, bsdf };
        self.direct.push(tile, &lit, measure, Lit::OneSide { is_dark: false });
        // Light that comes through has a vertex of its own; a share of the light that arrives is that of the viewer's side.
        if let Some((bsdf, shading)) = behind.filter(|_| measure != Measure::ArrivingShare) {
            let throughput = path.throughput * through_sheet(tile.world, &path.medium, far);
            let (path, vertex) = (&PathRay { throughput, ..*path }, &vertex.behind());
            let lit = ShadingVertex { path, medium: far, place, vertex, shading, bsdf: &bsdf };
            self.direct.push(tile, &lit, measure, Lit::OneSide { is_dark: false });
        }
    }

    /// Queues the vertices of rough glass: one for each side, or if light samples find nothing on one of them, a single one.
    fn shade_rough_glass(&mut self, path: &PathRay, vertex: &Vertex<'_>, rough: GlassPoint, far: &Medium) {
        if !self.accumulator.takes_reflected() {
            return;
        }
        let (tile, place) = (self.tile, self.place);
        let shading = vertex.shading(self.counters);
        let measure = self.measure_of(path);
        let near = &path.medium;
        let reflection = RoughBsdf::GlassReflection(rough);
        let transmission = RoughBsdf::GlassTransmission(rough);
        // The share of the light that arrives is that of the viewer's side, and counts what does not arrive.
        if measure == Measure::ArrivingShare {
            let lit = ShadingVertex { path, medium: near, place, vertex, shading, bsdf: &reflection };
            return self.direct.push(tile, &lit, measure, Lit::OneSide { is_dark: false });
        }
        // Without shadows, lamps shine into any body.
        let has_shadows = tile.settings.render.shadows != Shadows::Off;
        let is_dark =
            |medium: &Medium| medium.glass().is_some_and(|inside| tile.world.is_dark_body(inside.body));
        let dark = [near, far].map(|medium| has_shadows && is_dark(medium));
        // Photons land on both sides.
        let is_one = dark != [false; 2] && !tile.behaviour.gathers && vertex.beyond().is_some();
        let is_behind = is_one && dark == [true, false];
        let sides = |vertex: &Vertex<'_>, is_dark: bool, medium| match vertex.beyond() {
            Some(beyond) if is_one => Lit::TwoSides { is_dark, beyond, medium },
            Some(_) | None => Lit::OneSide { is_dark },
        };
        // Queue the viewer's side, unless the vertex of the other one stands for it.
        let behind = (!is_one || is_behind).then(|| (vertex.behind(), shading.behind()));
        if !is_behind {
            let lit = ShadingVertex { path, medium: near, place, vertex, shading, bsdf: &reflection };
            self.direct.push(tile, &lit, measure, sides(vertex, dark[0], far));
        }
        // Queue the other side likewise.
        if let Some((vertex, shading)) = behind {
            let lit =
                ShadingVertex { path, medium: far, place, vertex: &vertex, shading, bsdf: &transmission };
            self.direct.push(tile, &lit, measure, sides(&vertex, dark[1], near));
        }
    }

    /// Part of the light at a path's vertex that the view shows.
    fn measure_of(&self, path: &PathRay) -> Measure {
        if path.state.only_specular_before { self.accumulator.measure } else { Measure::ALL }
    }

    fn shade_mirror(&mut self, path: &PathRay, vertex: &Vertex<'_>, mirror: &Mirror) {
        let shading = vertex.shading(self.counters);
        let is_colored = self.accumulator.measure.is_colored();
        let reflectance = vertex.mirror_reflectance(mirror, &shading, is_colored, self.counters);
        self.push_reflected(reflected(path, vertex, &shading, reflectance));
    }

    /// Splits a path at a smooth coat, or chooses between the coat and its base as often as the coat reflects.
    fn shade_coated(&mut self, path: &PathRay, vertex: &Vertex<'_>, coated: &Coated, far: &Medium) {
        let shading = vertex.shading(self.counters);
        let fresnel = vertex.coat_reflectance(coated, &shading);
        let weaker = fresnel.min(1.0 - fresnel) * path.throughput.abs().max_element();
        let splits = self.tile.behaviour.splits && path.state.only_specular_before;
        let both = weaker >= LEAST_SPLIT && splits;
        let is_coat = !both && self.tile.chooses_reflection(path, fresnel);
        if both || is_coat {
            let lookups = &mut self.counters.texture_lookups;
            let specular = coated.specular(&vertex.texture_point, lookups) * if both { fresnel } else { 1.0 };
            if specular != Vec3::ZERO {
                self.push_reflected(reflected(path, vertex, &shading, specular));
            }
        }
        if !is_coat {
            // The base is found as often as it is not the coat.
            let by_chance = if both { 1.0 } else { 1.0 / (1.0 - fresnel) };
            let mut state = path.state;
            state.roulette_throughput *= by_chance;
            let path = PathRay { throughput: path.throughput * by_chance, state, ..*path };
            self.shade_rough(&path, vertex, &coated.base, far);
        }
    }

    fn shade_glass(&mut self, path: &PathRay, vertex: &Vertex<'_>, far: &Medium) {
        let shading = vertex.shading(self.counters);
        let Interface { reflectance, refracted } = interface(self.tile.world, path, vertex, &shading, far);
        let mirrored = |weight: f32| reflected(path, vertex, &shading, Vec3::splat(weight));
        let Some(refracted) = refracted else { return self.push_reflected(mirrored(1.0)) };
        let weaker = reflectance.min(1.0 - reflectance) * path.throughput.abs().max_element();
        let splits = self.tile.behaviour.splits && path.state.only_specular_before;
        if weaker >= LEAST_SPLIT && splits {
            self.push_reflected(mirrored(reflectance));
            self.push_refracted(refracted, 1.0 - reflectance);
        } else if self.tile.chooses_reflection(path, reflectance) {
            self.push_reflected(mirrored(1.0));
        } else {
            self.push_refracted(refracted, 1.0);
        }
    }

    fn push_reflected(&mut self, ray: PathRay) {
        let Some(ray) = self.russian_roulette(ray) else { return };
        self.counters.reflected_rays += 1;
        self.next.push(ray);
    }

    fn push_refracted(&mut self, mut ray: PathRay, weight: f32) {
        ray.throughput *= weight;
        let Some(ray) = self.russian_roulette(ray) else { return };
        self.counters.refracted_rays += 1;
        self.next.push(ray);
    }

    fn russian_roulette(&self, ray: PathRay) -> Option<PathRay> {
        match self.continuation {
            Some(continuation) if !self.tile.behaviour.splits || !ray.state.only_specular_before => {
                continuation.russian_roulette(self.tile, ray)
            }
            Some(_) | None => Some(ray),
        }
    }
}
