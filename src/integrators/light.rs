//! Direct light at vertices, in rows of sixteen: every light with its own shadow rays.

use super::lit_row::{LitRow, Response};
use super::medium::{Medium, absorption};
use super::shot::Shot;
use super::view::Measure;
use crate::geometry::Ray;
use crate::geometry::rows::{Ends, RayRows, lanes};
use crate::lights::{Light, LightRow, Middle, Source, SourceRow};
use crate::materials::Lobes;
use crate::materials::lobes::gloss;
use crate::math::Vec3;
use crate::math::color::luminance;
use crate::math::lanes::{LANES, Lanes, Lanes3, TRUE, bits, lane, set_lane};
use crate::sampling::{Decision, SamplerRow};
use crate::scene::description::Shadows;
use crate::world::{Hit, Loops};

/// Lights the vertices of a row whose bits are set.
pub(super) struct Lighting<'a> {
    pub(super) shot: &'a Shot<'a>,
    pub(super) row: &'a LitRow,
    pub(super) used: u32,
    pub(super) measure: Measure,
    pub(super) others: Others,
    /// Those that the vertices are in; none where all are in air.
    pub(super) media: Option<&'a [Medium]>,
}

/// What finds light beside samples of the lamps.
#[derive(Clone, Copy)]
pub(super) enum Others {
    /// The rays of paths that go on from the vertices.
    Paths,
    /// Rays in the glossy lobes of the vertices whose bits are set.
    Lobes(u32),
}

/// Rays that the light of vertices took.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightRays {
    /// Towards lamps.
    pub shadow: u64,
    /// In lobes.
    pub scattered: u64,
}

/// What of the light that arrives at the vertices of a row gets to the eye.
pub(super) struct Arrived {
    pub(super) light: Lanes3,
    pub(super) rays: LightRays,
}

/// Sums over the lights.
struct Sums {
    /// Of what arrives.
    light: Lanes3,
    /// Of what could.
    total: Lanes,
    rays: LightRays,
}

/// What a light could send, before one ray tells whether it does.
struct Waiting {
    light: Lanes3,
    active: u32,
}

impl Loops for Lighting<'_> {
    type Done = Arrived;

    #[inline(always)]
    fn run(self) -> Arrived {
        let render = &self.shot.settings.render;
        let mut sampler = None;
        let mut sums = Sums { light: [[0.0; LANES]; 3], total: [0.0; LANES], rays: LightRays::default() };
        for (number, light) in self.shot.world.lights.iter() {
            // Where one ray decides for all of a light, what it could send waits for that.
            let mut waiting = Waiting { light: [[0.0; LANES]; 3], active: 0 };
            let middle = light.middle();
            let waits = match render.shadows {
                Shadows::Soft => false,
                Shadows::Hard => middle.is_some(),
                Shadows::Off => true,
            };
            if light.is_single() {
                let nowhere = [[0.0; LANES]; 2];
                let samples = light.sample_row(&self.row.from, &self.row.normal, self.used, &nowhere);
                let (mut values, active) = self.values(&samples, 1.0);
                self.absorb(&samples, &mut values);
                self.add(&samples, &values, active, &mut sums, waits.then_some(&mut waiting));
            } else {
                let count = render.shadow_samples;
                if sampler.is_none() {
                    sampler = Some(self.sampler());
                }
                let Some(sampler) = &sampler else { continue };
                for repetition in 0..count {
                    let u = sampler.pairs(&self.row.path, Decision::Light(number), repetition, count);
                    let samples = light.sample_row(&self.row.from, &self.row.normal, self.used, &u);
                    let (mut values, active) = self.values(&samples, 1.0 / count as f32);
                    self.absorb(&samples, &mut values);
                    match self.others {
                        Others::Paths => self.weigh(light, &samples, 1.0 / count as f32, &mut values),
                        Others::Lobes(0) => {}
                        Others::Lobes(_) => self.weigh(light, &samples, 1.0, &mut values),
                    }
                    self.add(&samples, &values, active, &mut sums, waits.then_some(&mut waiting));
                }
            }
            if waiting.active != 0 {
                self.add_waiting(middle, &waiting, &mut sums);
            }
        }
        if let Others::Lobes(sharp @ 1..) = self.others {
            self.add_lobes(sharp, &sampler.unwrap_or_else(|| self.sampler()), &mut sums);
        }
        if self.measure == Measure::ArrivingShare {
            for i in 0..LANES {
                let share = if sums.total[i] > 0.0 { sums.light[0][i] / sums.total[i] } else { 0.0 };
                set_lane(&mut sums.light, i, Vec3::splat(share));
            }
        }
        for axis in 0..3 {
            for i in 0..LANES {
                sums.light[axis][i] *= self.row.throughput[axis][i];
            }
        }
        Arrived { light: sums.light, rays: sums.rays }
    }
}

impl Lighting<'_> {
    #[inline(always)]
    fn sampler(&self) -> SamplerRow<LANES> {
        self.row.sampler(self.shot)
    }

    /// Leave of samples what glass around the vertices lets through on the way.
    #[inline(always)]
    fn absorb(&self, samples: &LightRow, values: &mut Lanes3) {
        if self.media.is_none() || self.measure == Measure::ArrivingShare {
            return;
        }
        for i in lanes(self.used) {
            let way = lane(&samples.targets, i) - lane(&self.row.from, i);
            let is_beyond = samples.beyond & 1 << i != 0;
            let distance = if is_beyond { f32::MAX } else { way.length() };
            set_lane(values, i, lane(values, i) * self.transmittance(i, distance));
        }
    }

    /// What glass around a vertex lets through over a distance.
    fn transmittance(&self, i: usize, distance: f32) -> Vec3 {
        self.media.map_or(Vec3::ONE, |media| {
            absorption(self.shot.world, media[self.row.medium[i] as usize], distance)
        })
    }

    /// Leave of samples of one light what rays in the lobes do not bring, of which there are so many for each sample.
    #[inline(always)]
    fn weigh(&self, light: &Light, samples: &LightRow, others: f32, values: &mut Lanes3) {
        let of_light = light.inverse_densities(samples);
        let mut glosses = [0.0; LANES];
        if self.row.is_glossy {
            for i in 0..LANES {
                let mirrored = lane(&self.row.mirrored_eye, i);
                glosses[i] = gloss(mirrored, lane(&samples.directions, i), self.row.shininess[i]);
            }
        }
        for i in 0..LANES {
            let density = self.lobes(i).density(lane(&samples.directions, i), glosses[i]);
            let weight = weight(density * of_light[i] * others);
            let weight = if self.shares(i) { weight } else { 1.0 };
            let left = match self.others {
                Others::Paths => Vec3::splat(weight),
                Others::Lobes(_) => self.left_of_gloss(i, glosses[i], weight),
            };
            set_lane(values, i, lane(values, i) * left);
        }
    }

    /// What is left of the light that a vertex reflects where the glossy part of it counts so much: rays in a lobe bring no other,
    /// so that the parts of a picture add up to it.
    #[inline(always)]
    fn left_of_gloss(&self, i: usize, gloss: f32, weight: f32) -> Vec3 {
        let (diffuse, glossy) = (lane(&self.row.diffuse, i), lane(&self.row.specular, i) * gloss);
        let part = |diffuse: f32, glossy: f32| {
            let all = diffuse + glossy;
            if all > 0.0 { (diffuse + glossy * weight) / all } else { 0.0 }
        };
        Vec3::new(part(diffuse.x, glossy.x), part(diffuse.y, glossy.y), part(diffuse.z, glossy.z))
    }

    /// The lobes in which rays are sent out from a vertex.
    #[inline(always)]
    fn lobes(&self, i: usize) -> Lobes {
        let lobes = self.row.lobes(i);
        match self.others {
            Others::Paths => lobes,
            Others::Lobes(_) => Lobes { diffuse: 0.0, specular: 1.0, ..lobes },
        }
    }

    /// Whether rays are sent out from a vertex.
    #[inline(always)]
    fn shares(&self, i: usize) -> bool {
        match self.others {
            Others::Paths => true,
            Others::Lobes(sharp) => sharp & 1 << i != 0,
        }
    }

    /// Add what rays bring that are sent out in the glossy lobes of the vertices whose bits are set, as many as samples of a lamp:
    /// a narrow lobe finds in a wide lamp what samples of the lamp hardly ever meet.
    #[inline(always)]
    fn add_lobes(&self, sharp: u32, sampler: &SamplerRow<LANES>, sums: &mut Sums) {
        let (row, count) = (self.row, self.shot.settings.render.shadow_samples);
        for repetition in 0..count {
            let u = sampler.pairs(&row.path, Decision::Direction, repetition, count);
            let mut directions = [[0.0; LANES]; 3];
            for i in 0..LANES {
                set_lane(&mut directions, i, self.lobes(i).sample(1.0, [u[0][i], u[1][i]]));
            }
            let Response { cosines, glosses, .. } = row.response(&directions);
            let mut sent = sharp & !row.hidden(&directions);
            let mut ends = [-1.0; LANES];
            for i in 0..LANES {
                let bit = 1 << i;
                sent &= if cosines[i] > 0.0 { !0 } else { !bit };
                ends[i] = if sent & bit != 0 { f32::INFINITY } else { -1.0 };
            }
            let rays = RayRows::of(row.from, directions);
            let (hits, objects) = self.shot.world.geometry.closest_rows(&rays, &mut ends);
            sums.rays.scattered += u64::from(sent.count_ones());
            for i in lanes(sent) {
                let density = self.lobes(i).density(lane(&directions, i), glosses[i]);
                let radiance = match hits.get(i) {
                    Some(shape) => {
                        let hit = Hit { shape, object: objects[i] };
                        let radiance = self.shot.lamp_radiance(&rays.ray(i), &hit, density);
                        radiance * self.transmittance(i, hit.shape.t)
                    }
                    None => {
                        let radiance = self.shot.radiance_beyond(lane(&directions, i), density);
                        radiance * self.transmittance(i, f32::MAX)
                    }
                };
                let f = lane(&row.specular, i) * glosses[i];
                let value = f * radiance * (cosines[i] / (density * count as f32));
                let sum = lane(&sums.light, i) + value;
                set_lane(&mut sums.light, i, sum);
            }
        }
    }

    /// Add what samples of one light bring, if they bring anything; where it waits for one ray, it is put beside.
    #[inline(always)]
    fn add(
        &self,
        samples: &LightRow,
        values: &Lanes3,
        active: u32,
        sums: &mut Sums,
        waiting: Option<&mut Waiting>,
    ) {
        if active == 0 {
            return;
        }
        for i in 0..LANES {
            let is_active = active & 1 << i != 0;
            sums.total[i] += if is_active { values[0][i] } else { 0.0 };
        }
        if let Some(waiting) = waiting {
            waiting.active |= active;
            add_where(active, values, &mut waiting.light);
        } else {
            let (rays, ends) = self.shadow_rays(samples, active & !self.row.hidden(&samples.directions));
            self.add_seen(&rays, &ends, &samples.sources, values, sums);
        }
    }

    /// What waits for one ray to the middle of its light.
    #[inline(always)]
    fn add_waiting(&self, middle: Option<(Middle, Source)>, waiting: &Waiting, sums: &mut Sums) {
        let Some((middle, source)) = middle.filter(|_| self.shot.settings.render.shadows != Shadows::Off)
        else {
            return add_where(waiting.active, &waiting.light, &mut sums.light);
        };
        let (mut direction, mut ends) = ([[0.0; LANES]; 3], [-1.0; LANES]);
        for i in 0..LANES {
            let from = lane(&self.row.from, i);
            let ray = match middle {
                Middle::At(middle) => Ray::segment(from, middle),
                Middle::Towards(direction) => Ray::new(from, direction),
            };
            set_lane(&mut direction, i, ray.direction);
            ends[i] = ray.t_max;
        }
        let traced = waiting.active & !self.row.hidden(&direction);
        for i in 0..LANES {
            ends[i] = if traced & 1 << i != 0 { ends[i] } else { -1.0 };
        }
        let rays = RayRows::of(self.row.from, direction);
        self.add_seen(&rays, &ends, &SourceRow::of(source), &waiting.light, sums);
    }

    /// Add what arrives on rays; those that are not traced end below 0.
    #[inline(always)]
    fn add_seen(&self, rays: &RayRows, ends: &Ends, sources: &SourceRow, values: &Lanes3, sums: &mut Sums) {
        let mut traced = [0; LANES];
        for i in 0..LANES {
            traced[i] = if ends[i] >= 0.0 { TRUE } else { 0 };
        }
        let traced = bits(traced);
        let occluded = self.shot.world.geometry.occluded_rows(rays, ends, sources);
        sums.rays.shadow += u64::from(traced.count_ones());
        add_where(traced & !occluded, values, &mut sums.light);
    }

    /// What each sample brings if nothing is in its way, and a bit for each that brings anything.
    #[inline(always)]
    fn values(&self, samples: &LightRow, share: f32) -> (Lanes3, u32) {
        let Response { f, cosines, .. } = self.row.response(&samples.directions);
        let mut arriving = samples.weights;
        if self.measure == Measure::ArrivingShare {
            for i in 0..LANES {
                let light = Vec3::splat(luminance(lane(&samples.weights, i)));
                set_lane(&mut arriving, i, light);
            }
        }
        let (mut values, mut active) = (f, [0; LANES]);
        for i in 0..LANES {
            let value = lane(&f, i) * lane(&arriving, i) * (cosines[i] * share);
            set_lane(&mut values, i, value);
            let brings = (cosines[i] > 0.0) & ((value.x != 0.0) | (value.y != 0.0) | (value.z != 0.0));
            active[i] = if brings { TRUE } else { 0 };
        }
        (values, bits(active) & self.used)
    }

    /// The rays on which the light of the samples in `active` arrives; the others have no end.
    #[inline(always)]
    fn shadow_rays(&self, samples: &LightRow, active: u32) -> (RayRows, Ends) {
        let (mut direction, mut ends) = (samples.directions, [-1.0; LANES]);
        for i in 0..LANES {
            let ray = Ray::segment(lane(&self.row.from, i), lane(&samples.targets, i));
            set_lane(&mut direction, i, ray.direction);
            ends[i] = if active & 1 << i != 0 { ray.t_max } else { -1.0 };
        }
        for i in lanes(samples.beyond & active) {
            set_lane(&mut direction, i, lane(&samples.directions, i));
            ends[i] = f32::INFINITY;
        }
        (RayRows::of(self.row.from, direction), ends)
    }
}

/// What a sample counts where another way to find the same light has a density so many times as high (the power heuristic:
/// Veach, *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, section 9.2).
#[inline(always)]
pub fn weight(ratio: f32) -> f32 {
    1.0 / (1.0 + ratio * ratio)
}

/// Add the values of the lanes whose bits are set.
#[inline(always)]
fn add_where(bits: u32, values: &Lanes3, sums: &mut Lanes3) {
    for axis in 0..3 {
        for i in 0..LANES {
            let is_added = bits & 1 << i != 0;
            sums[axis][i] += if is_added { values[axis][i] } else { 0.0 };
        }
    }
}
