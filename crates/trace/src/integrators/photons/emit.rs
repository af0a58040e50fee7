//! Photon tracing: from the lights over mirrors and glass to the first other surface, and from there to the next one, round by
//! round, sixteen at a time, by the surfaces, media and lobes that camera paths meet.
//!
//! Photons carry basic flux, Φ/n². At a surface whose shading normal Nₛ is not that of its facet N₉, scattering follows the adjoint
//! of its BSDF: f·|wi·Nₛ|·|wo·N₉|/|wi·N₉| (Veach, *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, section 5.3).

use super::map::Photon;
use crate::control::Cancelled;
use crate::geometry::ray::offset_origin;
use crate::geometry::rows::lanes;
use crate::geometry::surface_rows::SurfaceRow;
use crate::geometry::{Ray, SurfacePoint};
use crate::integrators::transport::batch::{ALL, UNBENT, VertexBatch};
use crate::integrators::transport::cone::Cone;
use crate::integrators::transport::crossing::CrossingMemory;
use crate::integrators::transport::interface::{Interface, interface, reflected, through_sheet};
use crate::integrators::transport::medium::{Inside, Media, Medium, ior};
use crate::integrators::transport::packet::PacketSource;
use crate::integrators::transport::ray::{PathRay, PathState};
use crate::integrators::transport::scatter::{BsdfSampling, Continuation};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::transport::vertex::{ShadingVertex, Vertex};
use crate::integrators::transport::walk::{
    Change, MOST_HIDDEN, OpaqueHit, Reached, Straight, Walker, chance, walk,
};
use crate::integrators::view::Measure;
use crate::integrators::{PACKET, RayCounters};
use crate::lights::{Emitted, Numbers, PhotonSource, Start};
use crate::materials::bsdf::LobeSet;
use crate::materials::{Bsdf, Coated, Pane, Rough, RoughBsdf};
use crate::math::Vec3;
use crate::math::lanes::{Folds, lane, set_lane};
use crate::sampling::{CAMERA_PATH, Decision, SamplerRow};
use crate::world::{BodyInParts, Hit, Loops, World};

/// Squared difference of directions that are equal within rounding.
const SAME: f32 = 1e-8;

/// Common data of all photons of a part of a pass.
pub struct PhotonTracing<'a> {
    /// The world, and the numbers of the photons as the samples of a single pixel; their slots count from 0.
    pub tile: &'a TileContext<'a>,
    /// Emission of the lights.
    pub emission: &'a PhotonSource,
    /// The closed shapes of glass that lights may be in, with their materials.
    pub glasses: &'a [Inside],
    /// Other bodies of glass that lights may be in.
    pub bodies: &'a [BodyInParts],
    /// Inverse of the number of photons.
    pub share: f32,
    /// Most scatterings of a photon.
    pub most_depth: u32,
}

/// Photons of one part of a pass.
#[derive(Default)]
pub struct EmittedPhotons {
    /// Caustic photons, which came by mirrors and glass alone, in the order of their numbers within each round.
    pub caustic: Vec<Photon>,
    /// Bounced photons, scattered at a caustic, in the same order.
    pub bounced: Vec<Photon>,
    /// Texture look-ups.
    pub lookups: u64,
}

impl PhotonTracing<'_> {
    /// Traces the photons.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn trace_photons(&self) -> Result<EmittedPhotons, Cancelled> {
        let count = self.tile.block.len() as u32;
        let mut wavefront = PhotonWavefront {
            tracing: self,
            depth: 0,
            references: vec![0.0; count as usize],
            next: Vec::new(),
            open: VertexBatch::EMPTY,
            open_behind: VertexBatch::EMPTY,
            media: Media::default(),
            crossing: CrossingMemory::default(),
            shots: EmittedPhotons::default(),
            counters: RayCounters::default(),
        };
        // Emit the photons, then trace them round by round.
        let mut rays = Vec::new();
        wavefront.start(count, &mut rays);
        let (mut row, mut surfaces) = (VertexBatch::EMPTY, SurfaceRow::EMPTY);
        while !rays.is_empty() {
            for packet in rays.chunks(PACKET) {
                self.tile.token.check()?;
                wavefront.intersect(packet, &mut row, &mut surfaces);
            }
            // Scatter the single vertices, and apply Russian roulette.
            wavefront.scatter_open();
            wavefront.media.clear();
            wavefront.russian_roulette();
            std::mem::swap(&mut rays, &mut wavefront.next);
            wavefront.next.clear();
            wavefront.depth += 1;
        }
        wavefront.shots.lookups += wavefront.counters.texture_lookups;
        Ok(wavefront.shots)
    }

    /// The ray of a photon from beyond all finite objects, started at its hit on planes on the way there that it may pass. `None`
    /// if something opaque is there.
    fn past_planes(&self, ray: Ray) -> Option<Ray> {
        let world = self.tile.world;
        let mut start = ray.origin;
        for _ in 0..MOST_HIDDEN {
            let back = Ray::new(start, -ray.direction);
            let Some(hit) = world.geometry.closest(&back) else {
                return Some(Ray::new(start, ray.direction));
            };
            let material = &world.materials[world.material_index(&hit)];
            if material.bsdf.glass().is_none() && !material.lets_pass() {
                return None;
            }
            let SurfacePoint { point, error, normal, .. } = world.geometry.surface(&back, &hit);
            start = offset_origin(point, error, normal, back.direction);
        }
        None
    }

    /// The glass around the start of a photon.
    fn medium_at(&self, point: Vec3, emitted: &Emitted) -> Medium {
        let world = self.tile.world;
        let emitter = || Some(world.lights.get(emitted.light).as_area()?.object);
        let around = |glass: &&Inside| world.encloses(glass.body, point);
        let in_parts = self.bodies.iter().filter(|_| !is_beyond(emitted)).filter_map(|body| {
            let material = world.material_around(body, point, emitter())?;
            Some(Inside { body: body.body, material })
        });
        self.glasses.iter().filter(around).copied().chain(in_parts).fold(Medium::default(), Medium::entered)
    }
}

/// Some photons under way.
struct PhotonWavefront<'a> {
    tracing: &'a PhotonTracing<'a>,
    /// Scatterings so far.
    depth: u32,
    /// Largest component of each photon at its start, by slot.
    references: Vec<f32>,
    next: Vec<PathRay>,
    /// Row for single vertices.
    open: VertexBatch,
    /// Row for those whose light comes through the surface.
    open_behind: VertexBatch,
    /// Media of the photons at single vertices.
    media: Media,
    crossing: CrossingMemory,
    shots: EmittedPhotons,
    counters: RayCounters,
}

impl<'a> Walker<'a> for PhotonWavefront<'a> {
    fn tile(&self) -> &'a TileContext<'a> {
        self.tracing.tile
    }

    fn crossing(&mut self) -> &mut CrossingMemory {
        &mut self.crossing
    }

    fn pass(&mut self, _: &PathRay, _: Option<Hit>) {}

    #[inline(always)]
    fn reach(&mut self, path: &PathRay, reached: Reached<'_, 'a>, has_passed: bool) {
        match reached {
            Reached::Opaque(vertex, _, far) => {
                let lacks_photons = self.depth == 0 && !has_passed;
                self.shade_surface(path, vertex, (far, lacks_photons));
            }
            Reached::Glass(vertex, _, Change { far, rough: None }) => self.shade_glass(path, vertex, far),
            // Light samples find direct light.
            Reached::Glass(..) if self.depth == 0 && !has_passed => {}
            Reached::Glass(vertex, _, Change { far, rough: Some(rough) }) => {
                self.leave_photon(path, vertex, RoughBsdf::GlassReflection(rough), (far, Some(1.0)));
            }
            Reached::Nothing | Reached::Hidden => {}
        }
    }

    fn lookups(&mut self) -> &mut u64 {
        &mut self.counters.texture_lookups
    }

    fn meet_pane(&mut self, path: &PathRay, vertex: &Vertex<'a>, _: OpaqueHit, pane: &Pane) -> Straight {
        let reflectance = pane.reflectance(vertex.surface.shading_normal.dot(vertex.to_eye));
        let tint = vertex.pane_tint(path, pane, &mut self.counters.texture_lookups);
        if !self.goes_on() {
            return Straight::Passes(tint * (1.0 - reflectance));
        }
        if !self.tracing.tile.chooses_reflection(path, reflectance) {
            return Straight::Passes(tint);
        }
        let shading = vertex.shading(&mut self.counters);
        let ray = reflected(path, vertex, &shading, Vec3::ONE);
        self.push(path, vertex, (shading.normal, 1.0), ray);
        Straight::Ends
    }
}

impl PhotonWavefront<'_> {
    /// Emits photons at the lights.
    fn start(&mut self, count: u32, rays: &mut Vec<PathRay>) {
        let tracing = self.tracing;
        let tile = tracing.tile;
        let has_planes = tile.world.geometry.has_unbounded();
        for begin in (0..count).step_by(PACKET) {
            let numbers = tile.world.geometry.instructions().run(Drawing { tile, first: begin });
            for (i, numbers) in numbers.iter().enumerate().take((count - begin) as usize) {
                // Emit a photon, and start it behind planes of glass on its way.
                let Some(emitted) = tracing.emission.emit(numbers) else { continue };
                let past_planes = is_beyond(&emitted) && has_planes;
                let ray = emitted.ray();
                let Some(ray) = (if past_planes { tracing.past_planes(ray) } else { Some(ray) }) else {
                    continue;
                };
                let offset = begin as usize + i;
                let path = PathRay {
                    ray,
                    throughput: emitted.flux * tracing.share,
                    slot: offset as u32,
                    path: CAMERA_PATH + 1,
                    medium: tracing.medium_at(ray.origin, &emitted),
                    state: PathState::CAMERA,
                    cone: Cone::default(),
                };
                self.references[offset] = flux(tile.world, &path);
                rays.push(path);
            }
        }
    }

    /// Whether photons are scattered at the end of their rays.
    fn goes_on(&self) -> bool {
        self.depth < self.tracing.most_depth
    }

    /// Traces each photon of a packet to its hit.
    fn intersect(&mut self, rays: &[PathRay], row: &mut VertexBatch, surfaces: &mut SurfaceRow) {
        let tile = self.tracing.tile;
        let packet = tile.intersect(PacketSource::Paths(rays, 0), Measure::ALL, true, (row, surfaces));
        self.counters.texture_lookups += packet.lookups;
        // Light samples find direct light.
        if self.depth > 0 {
            for i in lanes(row.used) {
                let (point, normal) = row.place_of(i);
                self.store(&rays[i], point, normal);
            }
            row.keep(row.only_specular_before);
            for i in lanes(row.used & row.has_facet) {
                let counts = row.landed(i, -rays[i].ray.direction);
                set_lane(&mut row.throughput, i, rays[i].throughput * counts);
            }
            self.scatter(row);
        }
        // Shade other surfaces one by one.
        for i in lanes(packet.any & !packet.plain) {
            if let Some(hit) = packet.hit(i) {
                walk(self, &mut { rays[i] }, (hit, packet.surface(surfaces, i)));
            }
        }
    }

    /// Stores a photon where it arrives.
    fn store(&mut self, path: &PathRay, point: Vec3, normal: Vec3) {
        let (direction, flux) = (-path.ray.direction, path.throughput);
        let photon = Photon { point, direction, flux, normal, depth: self.depth };
        let kept =
            if path.state.only_specular_before { &mut self.shots.caustic } else { &mut self.shots.bounced };
        kept.push(photon);
    }

    fn shade_surface(&mut self, path: &PathRay, vertex: &Vertex<'_>, (far, lacks_photons): (&Medium, bool)) {
        match &vertex.material.bsdf {
            // Light samples find direct light.
            Bsdf::Rough(_) if lacks_photons => {}
            Bsdf::Rough(rough) => self.shade_rough(path, vertex, rough, (far, Some(1.0))),
            Bsdf::Coated(coated) => self.shade_coated(path, vertex, coated, (far, lacks_photons)),
            Bsdf::Mirror(mirror) if self.goes_on() => {
                let shading = vertex.shading(&mut self.counters);
                let reflectance = vertex.mirror_reflectance(mirror, &shading, true, &mut self.counters);
                let ray = reflected(path, vertex, &shading, reflectance);
                self.push(path, vertex, (shading.normal, 1.0), ray);
            }
            Bsdf::Mirror(_) | Bsdf::Glass(_) | Bsdf::Pane(_) => {}
        }
    }

    /// Stores a photon at a surface under a smooth coat, and lets the coat reflect it. One that came by mirrors and glass alone is
    /// reflected as often as the coat reflects, and else scattered at the base. Others are scattered nowhere else, so that all of
    /// them are reflected.
    fn shade_coated(
        &mut self,
        path: &PathRay,
        vertex: &Vertex<'_>,
        coated: &Coated,
        (far, lacks_photons): (&Medium, bool),
    ) {
        let shading = vertex.shading(&mut self.counters);
        let fresnel = vertex.coat_reflectance(coated, &shading);
        let chooses = path.state.only_specular_before && !lacks_photons;
        let is_reflected = !chooses || self.tracing.tile.chooses_reflection(path, fresnel);
        if !lacks_photons {
            let by_chance = (!is_reflected).then(|| 1.0 / (1.0 - fresnel));
            self.shade_rough(path, vertex, &coated.base, (far, by_chance));
        }
        if is_reflected && self.goes_on() {
            let specular = coated.specular(&vertex.texture_point, &mut self.counters.texture_lookups);
            let ray = reflected(path, vertex, &shading, specular * if chooses { 1.0 } else { fresnel });
            self.push(path, vertex, (shading.normal, 1.0), ray);
        }
    }

    /// Stores a photon at a rough surface before a medium. If there is a factor on its flux, and it came by mirrors and glass alone,
    /// it is scattered with that factor.
    fn shade_rough(
        &mut self,
        path: &PathRay,
        vertex: &Vertex<'_>,
        rough: &Rough,
        (far, scattered): (&Medium, Option<f32>),
    ) {
        let mut bsdf = rough.at(&vertex.texture_point, &mut self.counters.texture_lookups);
        vertex.tint(&mut bsdf);
        if !bsdf.is_black() {
            self.leave_photon(path, vertex, bsdf, (far, scattered));
        }
    }

    /// [`PhotonWavefront::shade_rough`] with a known BSDF, and the medium behind the surface.
    fn leave_photon(
        &mut self,
        path: &PathRay,
        vertex: &Vertex<'_>,
        bsdf: RoughBsdf,
        (far, scattered): (&Medium, Option<f32>),
    ) {
        let tile = self.tracing.tile;
        // Store the photon; it stands for those that passed the surface as if it were not there.
        let chance = chance(path, vertex, &mut self.counters.texture_lookups);
        let all = PathRay { throughput: path.throughput / chance, ..*path };
        self.store(&all, vertex.surface.point, vertex.normal);
        let Some(by_chance) = scattered.filter(|_| path.state.only_specular_before && self.goes_on()) else {
            return;
        };
        // Let it wait for being scattered.
        let shading = vertex.shading(&mut self.counters);
        let behind = bsdf.behind().map(|bsdf| (bsdf, shading.behind()));
        let medium = self.media.number(&path.medium);
        if self.open.used == ALL || self.open.bsdf.kind() != bsdf.kind() {
            self.scatter_open();
            self.open.bsdf.prepare(bsdf.kind());
        }
        let i = self.open.used.trailing_ones() as usize;
        let lit = ShadingVertex { path, medium: &path.medium, place: 0, vertex, shading, bsdf: &bsdf };
        self.open.put(i, tile, &lit, Measure::ALL, medium);
        let counts = self.open.landed(i, vertex.to_eye) * by_chance;
        set_lane(&mut self.open.throughput, i, path.throughput * counts);
        // It may go on behind the surface, where another medium changes its basic flux.
        let Some((bsdf, shading)) = behind else { return };
        let part = if vertex.material.bsdf.glass().is_some() {
            let eta = ior(tile.world, far) / ior(tile.world, &path.medium);
            1.0 / (eta * eta)
        } else {
            // To the viewer's path, this is the way from the other side.
            through_sheet(tile.world, far, &path.medium)
        };
        let medium = self.media.number(far);
        if self.open_behind.used == ALL || self.open_behind.bsdf.kind() != bsdf.kind() {
            self.scatter_open();
            self.open_behind.bsdf.prepare(bsdf.kind());
        }
        let i = self.open_behind.used.trailing_ones() as usize;
        let lit =
            ShadingVertex { path, medium: far, place: 0, vertex: &vertex.behind(), shading, bsdf: &bsdf };
        self.open_behind.put(i, tile, &lit, Measure::ALL, medium);
        set_lane(&mut self.open_behind.throughput, i, path.throughput * (counts * part));
    }

    fn shade_glass(&mut self, path: &PathRay, vertex: &Vertex<'_>, far: &Medium) {
        if !self.goes_on() {
            return;
        }
        let tile = self.tracing.tile;
        let shading = vertex.shading(&mut self.counters);
        let Interface { reflectance, refracted } = interface(tile.world, path, vertex, &shading, far);
        match refracted {
            Some(mut ray) if !tile.chooses_reflection(path, reflectance) => {
                let eta = ior(tile.world, far) / ior(tile.world, &path.medium);
                ray.throughput *= 1.0 / (eta * eta);
                self.push(path, vertex, (shading.normal, eta), ray);
            }
            Some(_) | None => {
                let ray = reflected(path, vertex, &shading, Vec3::ONE);
                self.push(path, vertex, (shading.normal, 1.0), ray);
            }
        }
    }

    /// Adds a photon after the adjoint of a δ lobe about a shading normal: see the top of this file. `eta` is the ratio of the
    /// index of refraction ahead of the ray to that behind it.
    fn push(&mut self, path: &PathRay, vertex: &Vertex<'_>, (shading, eta): (Vec3, f32), mut ray: PathRay) {
        let facet = vertex.normal;
        if shading != facet {
            let (wi, wo) = (vertex.to_eye, ray.ray.direction);
            let along = |direction: Vec3| direction - shading * direction.dot(shading);
            // Otherwise the facet's own normal replaced the shading normal.
            if (along(wi) + along(wo) * eta).length_squared() < SAME {
                let (over, under) = (wi.dot(shading) * wo.dot(facet), wi.dot(facet) * wo.dot(shading));
                ray.throughput *= if under == 0.0 { 0.0 } else { (over / under).abs() };
            }
        }
        debug_assert_eq!(path.slot, ray.slot);
        self.next.push(ray);
    }

    /// Scatters photons at the single vertices.
    fn scatter_open(&mut self) {
        let mut open = std::mem::replace(&mut self.open, VertexBatch::EMPTY);
        self.scatter(&mut open);
        open.reset();
        self.open = open;
        if self.open_behind.used != 0 {
            let mut open = std::mem::replace(&mut self.open_behind, VertexBatch::EMPTY);
            self.scatter(&mut open);
            open.reset();
            self.open_behind = open;
        }
    }

    /// Scatters photons at the vertices of a row: directions are drawn by the cosine with the facet, as the adjoint has it.
    fn scatter(&mut self, row: &mut VertexBatch) {
        if !self.goes_on() || row.used == 0 {
            return;
        }
        for i in lanes(row.used & row.has_facet) {
            let facet = lane(&row.facet, i);
            set_lane(&mut row.normal, i, facet);
            row.bend[i] = UNBENT;
        }
        let continuation = Continuation { leads_on: true, is_risked: false, lobes: LobeSet::All };
        let used = row.used;
        BsdfSampling { tile: self.tracing.tile, row, used, continuation }.scatter(
            &self.media,
            &[],
            &mut self.next,
        );
    }

    /// Russian roulette by flux: survivors have about the flux that they started with.
    fn russian_roulette(&mut self) {
        let tile = self.tracing.tile;
        let mut kept = 0;
        for begin in (0..self.next.len()).step_by(PACKET) {
            let end = self.next.len().min(begin + PACKET);
            let risks =
                tile.world.geometry.instructions().run(Risking { tile, rays: &self.next[begin..end] });
            for (place, risk) in (begin..end).zip(risks) {
                let mut ray = self.next[place];
                let flux = flux(tile.world, &ray);
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

/// The largest component of the flux of a photon, in W: a medium of higher index changes the basic flux, but not this.
fn flux(world: &World, path: &PathRay) -> f32 {
    let index = ior(world, &path.medium);
    path.throughput.max_element() * index * index
}

fn is_beyond(emitted: &Emitted) -> bool {
    match emitted.start {
        Start::Beyond(_) => true,
        Start::Point(_) | Start::Surface { .. } => false,
    }
}

/// The random numbers of photon emission.
struct Drawing<'a> {
    tile: &'a TileContext<'a>,
    first: u32,
}

impl Loops for Drawing<'_> {
    type Done = [Numbers; PACKET];

    #[inline(always)]
    fn run(self, _: impl Folds) -> Self::Done {
        let slots = std::array::from_fn(|i| self.first + i as u32);
        let (xs, ys, samples) = self.tile.block.places_of(&slots);
        let sampler = SamplerRow::new(self.tile.settings.render.seed, &xs, &ys, &samples);
        let pairs = |decision| sampler.pairs(&[CAMERA_PATH; PACKET], decision, 0, 1);
        let (light, aim) = (pairs(Decision::Lamp), pairs(Decision::Aim));
        let (position, direction) = (pairs(Decision::Start), pairs(Decision::Sent));
        std::array::from_fn(|i| Numbers {
            light: light.map(|row| row[i]),
            aim: aim.map(|row| row[i]),
            position: position.map(|row| row[i]),
            direction: direction.map(|row| row[i]),
        })
    }
}

/// The random numbers of Russian roulette.
struct Risking<'a> {
    tile: &'a TileContext<'a>,
    rays: &'a [PathRay],
}

impl Loops for Risking<'_> {
    type Done = [f32; PACKET];

    #[inline(always)]
    fn run(self, _: impl Folds) -> Self::Done {
        let (mut slots, mut paths) = ([0; PACKET], [0; PACKET]);
        for (i, ray) in self.rays.iter().enumerate().take(PACKET) {
            (slots[i], paths[i]) = (ray.slot, ray.path);
        }
        let (xs, ys, samples) = self.tile.block.places_of(&slots);
        let sampler = SamplerRow::new(self.tile.settings.render.seed, &xs, &ys, &samples);
        let [risks, _] = sampler.pairs(&paths, Decision::Roulette, 0, 1);
        risks
    }
}
