//! Photon tracing: from the lights over mirrors and glass to the first other surface, and from there to the next one, round by
//! round, sixteen at a time, by the surfaces, media and lobes that camera paths meet.
//!
//! Photons carry basic flux, Φ/n². At a surface whose shading normal Nₛ is not that of its facet N₉, scattering follows the adjoint
//! of its BSDF: f·|wi·Nₛ|·|wo·N₉|/|wi·N₉| (Veach, *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, section 5.3).

use super::super::cone::Cone;
use super::super::crossing::{Crossing, CrossingMemory};
use super::super::lit_row::{ALL, LitRow, UNBENT};
use super::super::medium::{Inside, Medium, absorption, ior};
use super::super::onward::{Onward, Scattering};
use super::super::packet::Rays;
use super::super::ray::{History, PathRay};
use super::super::shot::Shot;
use super::super::specular::{Interface, interface, reflected};
use super::super::vertices::{LitVertex, Vertex};
use super::super::view::Measure;
use super::super::{PACKET, RayCounters};
use super::map::Photon;
use crate::control::Cancelled;
use crate::geometry::ray::offset_origin;
use crate::geometry::rows::lanes;
use crate::geometry::surface_rows::SurfaceRow;
use crate::geometry::{Ray, SurfacePoint};
use crate::lights::{Emitted, Numbers, PhotonSource, Start};
use crate::materials::Bsdf;
use crate::math::Vec3;
use crate::math::lanes::{Folds, lane, set_lane};
use crate::sampling::{CAMERA_PATH, Decision, SamplerRow};
use crate::world::{Hit, Loops, World};

/// Most surfaces without a change of glass that a photon passes at once.
const MOST_HIDDEN: usize = 64;

/// Squared difference of directions that are equal within rounding.
const SAME: f32 = 1e-8;

/// Common data of all photons of a part of a pass.
pub struct Shooting<'a> {
    /// The world, and the numbers of the photons as the samples of a single pixel; their slots count from 0.
    pub shot: &'a Shot<'a>,
    /// Emission of the lights.
    pub emission: &'a PhotonSource,
    /// The closed shapes of glass that lights may be in, with their materials.
    pub glasses: &'a [Inside],
    /// Inverse of the number of photons.
    pub share: f32,
    /// Most scatterings of a photon.
    pub most_depth: u32,
}

/// Photons of one part of a pass.
#[derive(Default)]
pub struct Shots {
    /// Caustic photons, which came by mirrors and glass alone, in the order of their numbers within each round.
    pub caustic: Vec<Photon>,
    /// Bounced photons, scattered at a caustic, in the same order.
    pub bounced: Vec<Photon>,
    /// Texture look-ups.
    pub lookups: u64,
}

impl Shooting<'_> {
    /// Traces the photons.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn shoot(&self) -> Result<Shots, Cancelled> {
        let count = self.shot.block.len() as u32;
        let mut flight = Flight {
            shooting: self,
            depth: 0,
            references: vec![0.0; count as usize],
            next: Vec::new(),
            open: LitRow::EMPTY,
            media: vec![Medium::default()],
            crossing: CrossingMemory::default(),
            shots: Shots::default(),
            counters: RayCounters::default(),
        };
        // Emit the photons, then trace them round by round.
        let mut rays = Vec::new();
        flight.start(count, &mut rays);
        let (mut row, mut surfaces) = (LitRow::EMPTY, SurfaceRow::EMPTY);
        while !rays.is_empty() {
            for packet in rays.chunks(PACKET) {
                self.shot.token.check()?;
                flight.meet(packet, &mut row, &mut surfaces);
            }
            // Scatter the single vertices, and apply Russian roulette.
            flight.scatter_open();
            flight.media.truncate(1);
            flight.spare();
            std::mem::swap(&mut rays, &mut flight.next);
            flight.next.clear();
            flight.depth += 1;
        }
        flight.shots.lookups += flight.counters.texture_lookups;
        Ok(flight.shots)
    }

    /// The ray of a photon from beyond all finite objects, started at its hit on planes of glass on the way there. `None` if
    /// something opaque is there.
    fn past_planes(&self, ray: Ray) -> Option<Ray> {
        let world = self.shot.world;
        let mut start = ray.origin;
        for _ in 0..MOST_HIDDEN {
            let back = Ray::new(start, -ray.direction);
            let Some(hit) = world.geometry.closest(&back) else {
                return Some(Ray::new(start, ray.direction));
            };
            world.materials[world.material_index(&hit)].bsdf.glass()?;
            let SurfacePoint { point, error, normal, .. } = world.geometry.surface(&back, &hit);
            start = offset_origin(point, error, normal, back.direction);
        }
        None
    }

    /// The glass around a point.
    fn medium_at(&self, point: Vec3) -> Medium {
        let world = self.shot.world;
        let around = |glass: &&Inside| world.encloses(glass.body, point);
        self.glasses.iter().filter(around).copied().fold(Medium::default(), Medium::entered)
    }
}

/// Some photons under way.
struct Flight<'a> {
    shooting: &'a Shooting<'a>,
    /// Scatterings so far.
    depth: u32,
    /// Largest component of each photon at its start, by slot.
    references: Vec<f32>,
    next: Vec<PathRay>,
    /// Row for single vertices.
    open: LitRow,
    /// Media of the photons; the first entry is air.
    media: Vec<Medium>,
    crossing: CrossingMemory,
    shots: Shots,
    counters: RayCounters,
}

impl Flight<'_> {
    /// Emits photons at the lights.
    fn start(&mut self, count: u32, rays: &mut Vec<PathRay>) {
        let shooting = self.shooting;
        let shot = shooting.shot;
        let has_planes = shot.world.geometry.has_unbounded();
        for begin in (0..count).step_by(PACKET) {
            let numbers = shot.world.geometry.instructions().run(Drawing { shot, first: begin });
            for (i, numbers) in numbers.iter().enumerate().take((count - begin) as usize) {
                // Emit a photon, and start it behind planes of glass on its way.
                let Some(emitted) = shooting.emission.emit(numbers) else { continue };
                let past_planes = is_beyond(&emitted) && has_planes;
                let ray = emitted.ray();
                let Some(ray) = (if past_planes { shooting.past_planes(ray) } else { Some(ray) }) else {
                    continue;
                };
                let offset = begin as usize + i;
                let path = PathRay {
                    ray,
                    throughput: emitted.flux * shooting.share,
                    slot: offset as u32,
                    path: CAMERA_PATH + 1,
                    medium: shooting.medium_at(ray.origin),
                    history: History::CAMERA,
                    cone: Cone::default(),
                };
                self.references[offset] = flux(shot.world, &path);
                rays.push(path);
            }
        }
    }

    /// Whether photons are scattered at the end of their rays.
    fn goes_on(&self) -> bool {
        self.depth < self.shooting.most_depth
    }

    /// Traces each photon of a packet to its hit.
    fn meet(&mut self, rays: &[PathRay], row: &mut LitRow, surfaces: &mut SurfaceRow) {
        let shot = self.shooting.shot;
        let met = shot.meet(Rays::Paths(rays, 0), Measure::ALL, true, (row, surfaces));
        self.counters.texture_lookups += met.lookups;
        // Light samples find direct light.
        if self.depth > 0 {
            for i in lanes(row.used) {
                let (point, normal) = row.place_of(i);
                self.store(&rays[i], point, normal);
            }
            row.keep(row.seen);
            for i in lanes(row.used & row.apart) {
                let counts = row.landed(i, -rays[i].ray.direction);
                set_lane(&mut row.throughput, i, rays[i].throughput * counts);
            }
            self.scatter(row);
        }
        // Shade other surfaces one by one.
        for i in lanes(met.any & !met.plain) {
            if let Some(hit) = met.hit(i) {
                self.shade(rays[i], hit, met.surface(surfaces, i));
            }
        }
    }

    /// Stores a photon where it arrives.
    fn store(&mut self, path: &PathRay, point: Vec3, normal: Vec3) {
        let (direction, flux) = (-path.ray.direction, path.throughput);
        let photon = Photon { point, direction, flux, normal, depth: self.depth };
        let kept = if path.history.is_seen { &mut self.shots.caustic } else { &mut self.shots.bounced };
        kept.push(photon);
    }

    /// Shades the first surface that is more than a change between parts of one glass. `surface` is that of the hit, if it is
    /// known.
    fn shade(&mut self, mut path: PathRay, mut hit: Hit, mut surface: Option<SurfacePoint>) {
        let shot = self.shooting.shot;
        let mut lacks_photons = self.depth == 0;
        for _ in 0..MOST_HIDDEN {
            let vertex = match surface.take() {
                Some(surface) => Vertex::on(shot, &path, &hit, surface),
                None => Vertex::to_shade(shot, &path, &hit),
            };
            if vertex.material.bsdf.glass().is_none() {
                path.throughput *= absorption(shot.world, path.medium, hit.shape.t);
                path.medium = shot.without_open(path.medium);
                return self.shade_surface(&path, &vertex, lacks_photons);
            }
            let Crossing { sides, arrived, near, far, opaque } =
                shot.crossing(&path, &vertex, &hit, &mut self.crossing);
            path.throughput *= absorption(shot.world, arrived, hit.shape.t);
            path.medium = near;
            if let Some(touching) = opaque {
                let vertex = Vertex::touching(shot, &path, (sides, &touching), hit.shape.t);
                return self.shade_surface(&path, &vertex, lacks_photons);
            }
            // Reflect or refract at a change of glass.
            if near.glass() != far.glass() {
                return self.shade_glass(&path, &vertex.between(sides), far);
            }
            // Pass on, as nothing changes here.
            (path.medium, path.ray) = (far, Ray::new(sides.beyond, path.ray.direction));
            lacks_photons = false;
            match shot.world.geometry.closest(&path.ray) {
                Some(next) => hit = next,
                None => return,
            }
        }
    }

    fn shade_surface(&mut self, path: &PathRay, vertex: &Vertex<'_>, lacks_photons: bool) {
        let shot = self.shooting.shot;
        match &vertex.material.bsdf {
            // Light samples find direct light.
            Bsdf::Phong(_) if lacks_photons => {}
            Bsdf::Phong(phong) => {
                let bsdf = phong.at(&vertex.texture_point, &mut self.counters.texture_lookups);
                if bsdf.is_black() {
                    return;
                }
                self.store(path, vertex.surface.point, vertex.normal);
                if !(path.history.is_seen && self.goes_on()) {
                    return;
                }
                let shading = vertex.shading(&mut self.counters);
                let mut medium = 0;
                if !path.medium.is_air() {
                    medium = self.media.len() as u32;
                    self.media.push(path.medium);
                }
                if self.open.used == ALL {
                    self.scatter_open();
                }
                let i = self.open.used.trailing_ones() as usize;
                let lit = LitVertex { path, place: 0, vertex, shading, bsdf };
                self.open.put(i, shot, &lit, Measure::ALL, medium);
                let counts = self.open.landed(i, vertex.to_eye);
                set_lane(&mut self.open.throughput, i, path.throughput * counts);
            }
            Bsdf::Mirror(mirror) if self.goes_on() => {
                let shading = vertex.shading(&mut self.counters);
                let ray = reflected(path, vertex, &shading, mirror.reflectance);
                self.push(path, vertex, (shading.normal, 1.0), ray);
            }
            Bsdf::Mirror(_) | Bsdf::Glass(_) => {}
        }
    }

    fn shade_glass(&mut self, path: &PathRay, vertex: &Vertex<'_>, far: Medium) {
        if !self.goes_on() {
            return;
        }
        let shot = self.shooting.shot;
        let shading = vertex.shading(&mut self.counters);
        let Interface { reflectance, refracted } = interface(shot.world, path, vertex, &shading, far);
        let is_reflected =
            |reflectance| shot.sampler(path.slot).pair(path.path, Decision::Choice).x < reflectance;
        match refracted {
            Some(mut ray) if !is_reflected(reflectance) => {
                let eta = ior(shot.world, far) / ior(shot.world, path.medium);
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
        let mut open = std::mem::replace(&mut self.open, LitRow::EMPTY);
        self.scatter(&mut open);
        open.reset();
        self.open = open;
    }

    /// Scatters photons at the vertices of a row: directions are drawn by the cosine with the facet, as the adjoint has it.
    fn scatter(&mut self, row: &mut LitRow) {
        if !self.goes_on() || row.used == 0 {
            return;
        }
        for i in lanes(row.used & row.apart) {
            let facet = lane(&row.facet, i);
            set_lane(&mut row.normal, i, facet);
            row.bend[i] = UNBENT;
        }
        let onward = Onward { leads_on: true, is_risked: false };
        let used = row.used;
        Scattering { shot: self.shooting.shot, row, used, onward }.scatter(&self.media, &[], &mut self.next);
    }

    /// Russian roulette by flux: survivors have about the flux that they started with.
    fn spare(&mut self) {
        let shot = self.shooting.shot;
        let mut kept = 0;
        for begin in (0..self.next.len()).step_by(PACKET) {
            let end = self.next.len().min(begin + PACKET);
            let risks =
                shot.world.geometry.instructions().run(Risking { shot, rays: &self.next[begin..end] });
            for (place, risk) in (begin..end).zip(risks) {
                let mut ray = self.next[place];
                let flux = flux(shot.world, &ray);
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
    let index = ior(world, path.medium);
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
    shot: &'a Shot<'a>,
    first: u32,
}

impl Loops for Drawing<'_> {
    type Done = [Numbers; PACKET];

    #[inline(always)]
    fn run(self, _: impl Folds) -> Self::Done {
        let slots = std::array::from_fn(|i| self.first + i as u32);
        let (xs, ys, samples) = self.shot.block.places_of(&slots);
        let sampler = SamplerRow::new(self.shot.settings.render.seed, &xs, &ys, &samples);
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
    shot: &'a Shot<'a>,
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
        let (xs, ys, samples) = self.shot.block.places_of(&slots);
        let sampler = SamplerRow::new(self.shot.settings.render.seed, &xs, &ys, &samples);
        let [risks, _] = sampler.pairs(&paths, Decision::Roulette, 0, 1);
        risks
    }
}
