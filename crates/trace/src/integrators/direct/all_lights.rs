//! Direct light (next-event estimation) at vertices, in rows of sixteen: every light with its own shadow rays.

use super::mis::CompetingTechnique;
use crate::geometry::Ray;
use crate::geometry::rows::{Ends, RayRows, lanes};
use crate::integrators::transport::batch::{Response, VertexBatch};
use crate::integrators::transport::medium::{Media, absorption};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::view::Measure;
use crate::lights::{EmissionTexture, Light, LightRow, Middle, Source, SourceRow};
use crate::materials::bsdf::BsdfValues;
use crate::math::Vec3;
use crate::math::color::luminance;
use crate::math::lanes::{Folds, LANES, Lanes, Lanes3, TRUE, lane, set_lane, truths};
use crate::sampling::Decision;
use crate::scene::description::Shadows;
use crate::world::Loops;

/// Lights the vertices of a row whose bits are set. It is compiled without MIS weights for cases in which only light
/// samples find lamps.
pub struct Lighting<'a, const WEIGHED: bool> {
    pub tile: &'a TileContext<'a>,
    pub row: &'a VertexBatch,
    pub used: u32,
    pub measure: Measure,
    /// Competing technique; unused if nothing is weighted.
    pub competing: CompetingTechnique,
    /// Media of the vertices. `None` if all are in air.
    pub media: Option<&'a Media>,
    /// Whether to take only the lights from beyond the scene.
    pub only_beyond: bool,
}

/// Rays for the direct light of vertices.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightRays {
    /// Shadow rays.
    pub shadow: u64,
    /// Rays in lobes.
    pub scattered: u64,
    /// Look-ups of emission textures.
    pub lookups: u64,
}

impl std::ops::AddAssign for LightRays {
    fn add_assign(&mut self, other: Self) {
        self.shadow += other.shadow;
        self.scattered += other.scattered;
        self.lookups += other.lookups;
    }
}

/// Light that arrives at the vertices of a row and is reflected towards the camera.
pub struct Arrived {
    /// Reflected light, before the throughput of the paths.
    pub light: Lanes3,
    pub rays: LightRays,
}

/// Sums over the lights.
pub struct Sums {
    /// Sum of the light that arrives.
    pub light: Lanes3,
    /// Sum of the light that could arrive.
    pub total: Lanes,
    pub rays: LightRays,
}

impl Sums {
    pub const NOTHING: Self = Self {
        light: [[0.0; LANES]; 3],
        total: [0.0; LANES],
        rays: LightRays { shadow: 0, scattered: 0, lookups: 0 },
    };

    /// The result of the sums.
    #[inline(always)]
    pub fn arrived(mut self, measure: Measure) -> Arrived {
        if measure == Measure::ArrivingShare {
            for i in 0..LANES {
                let share = if self.total[i] > 0.0 { self.light[0][i] / self.total[i] } else { 0.0 };
                set_lane(&mut self.light, i, Vec3::splat(share));
            }
        }
        Arrived { light: self.light, rays: self.rays }
    }
}

/// Unoccluded light of a lamp, which waits for one shadow ray.
struct Waiting {
    light: Lanes3,
    active: u32,
}

impl<const WEIGHED: bool> Loops for Lighting<'_, WEIGHED> {
    type Done = Sums;

    #[inline(always)]
    fn run(self, folds: impl Folds) -> Sums {
        let mut sums = Sums::NOTHING;
        self.add_all(&mut sums, folds);
        sums
    }
}

impl<const WEIGHED: bool> Lighting<'_, WEIGHED> {
    /// Adds the light of the lights.
    #[inline(always)]
    fn add_all(&self, sums: &mut Sums, folds: impl Folds) {
        let render = &self.tile.settings.render;
        let takes = |light: &Light| !self.only_beyond || light.is_beyond();
        let mut sampler = None;
        for (number, light) in self.tile.world.lights.iter().filter(|(_, light)| takes(light)) {
            if WEIGHED && self.tile.leaves_sky && light.is_from_all_around() {
                continue;
            }
            // If one ray decides for the whole light, its light waits for that ray.
            let mut waiting = Waiting { light: [[0.0; LANES]; 3], active: 0 };
            let waits = match render.shadows {
                Shadows::Soft => false,
                Shadows::Hard => light.middle().is_some(),
                Shadows::Off => true,
            };
            // Take the only direction, or the requested number of samples.
            let is_single = light.is_single();
            let count = if is_single { 1 } else { render.shadow_samples };
            if !is_single && sampler.is_none() {
                sampler = Some(self.row.sampler(self.tile));
            }
            for repetition in 0..count {
                let u = match &sampler {
                    Some(sampler) if !is_single => {
                        sampler.pairs(&self.row.path, Decision::Light(number), repetition, count)
                    }
                    Some(_) | None => [[0.0; LANES]; 2],
                };
                let samples = light.sample_row(&self.row.from, &self.row.normal, self.used, &u);
                let (mut values, active, response) = self.values(&samples, 1.0 / count as f32, folds);
                // Multiply by the emission texture.
                if let Some(pattern) = light.emission_texture() {
                    values = self.tinted(pattern, &samples, active, values);
                    sums.rays.lookups += u64::from(active.count_ones());
                }
                // Weight against the competing technique, which finds no light without extent.
                if WEIGHED && !is_single {
                    let leaves_gloss = self.tile.lobes_find_sky && light.is_from_all_around();
                    let of_light = if leaves_gloss && self.competing.are_lobes() {
                        // Pretend that light samples hardly ever come, so that lobes bring all.
                        [f32::MAX; LANES]
                    } else {
                        light.inverse_densities(&samples)
                    };
                    let competing = self.competing.rays_per_sample(count);
                    values = self.competing.weighted(
                        self.row,
                        (&samples, &response),
                        values,
                        (&of_light, competing),
                        folds,
                    );
                }
                self.add(&samples, &values, active, sums, waits.then_some(&mut waiting), folds);
            }
            // Trace the one ray to the middle of the light.
            if waiting.active != 0 {
                self.add_waiting(light.middle(), &waiting, sums, folds);
            }
        }
    }

    /// Multiplies values by the transmittance of glass around the vertices on the way to the samples.
    #[cold]
    #[inline(never)]
    fn left_by_glass(&self, media: &Media, samples: &LightRow, mut values: Lanes3) -> Lanes3 {
        for i in lanes(self.used) {
            let way = lane(&samples.targets, i) - lane(&self.row.from, i);
            let is_beyond = samples.beyond & 1 << i != 0;
            let distance = if is_beyond { f32::MAX } else { way.length() };
            let left = absorption(self.tile.world, &media.get(self.row.medium[i]), distance);
            let value = lane(&values, i) * left;
            set_lane(&mut values, i, value);
        }
        values
    }

    /// Multiplies values by the emission texture at the sampled points.
    #[cold]
    #[inline(never)]
    fn tinted(
        &self,
        pattern: &EmissionTexture,
        samples: &LightRow,
        active: u32,
        mut values: Lanes3,
    ) -> Lanes3 {
        for i in lanes(active) {
            let (target, direction) = (lane(&samples.targets, i), lane(&samples.directions, i));
            let color = pattern.at(target, samples.sources.part[i], direction);
            let color = match self.measure {
                Measure::Radiance(_) => color,
                Measure::ArrivingShare => Vec3::splat(luminance(color)),
                Measure::Work => Vec3::ONE,
            };
            let value = lane(&values, i) * color;
            set_lane(&mut values, i, value);
        }
        values
    }

    /// Adds the contributions of samples of one light, if there are any; values that wait for one ray go to `waiting`.
    #[inline(always)]
    fn add(
        &self,
        samples: &LightRow,
        values: &Lanes3,
        active: u32,
        sums: &mut Sums,
        waiting: Option<&mut Waiting>,
        folds: impl Folds,
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
            let traced = active & !self.row.hidden(&samples.directions, folds);
            let (rays, ends) = self.shadow_rays(samples, traced);
            self.add_seen((&rays, &ends, traced), &samples.sources, values, sums, folds);
        }
    }

    /// Adds the light that waits for one ray to the middle of its light.
    #[inline(always)]
    fn add_waiting(
        &self,
        middle: Option<(Middle, Source)>,
        waiting: &Waiting,
        sums: &mut Sums,
        folds: impl Folds,
    ) {
        let is_untraced = self.tile.settings.render.shadows == Shadows::Off;
        if is_untraced && self.measure == Measure::Work {
            return;
        }
        // Without shadows, all of it arrives.
        let Some((middle, source)) = middle.filter(|_| !is_untraced) else {
            return add_where(waiting.active, &waiting.light, &mut sums.light);
        };
        // Aim a ray at the middle of the light.
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
        let traced = waiting.active & !self.row.hidden(&direction, folds);
        for i in 0..LANES {
            ends[i] = if traced & 1 << i != 0 { ends[i] } else { -1.0 };
        }
        let rays = RayRows::of(self.row.from, direction).leaving(self.row.starts(&direction));
        self.add_seen((&rays, &ends, traced), &SourceRow::of(source), &waiting.light, sums, folds);
    }

    /// Adds the unoccluded light on the rays of `traced`; the others end below 0.
    #[inline(always)]
    pub fn add_seen(
        &self,
        (rays, ends, traced): (&RayRows, &Ends, u32),
        sources: &SourceRow,
        values: &Lanes3,
        sums: &mut Sums,
        folds: impl Folds,
    ) {
        sums.rays.shadow += u64::from(traced.count_ones());
        if self.measure == Measure::Work {
            return add_work(self.tile, rays, ends, traced, &mut sums.light);
        }
        if self.tile.world.has_passable() {
            return self.add_weakened((rays, ends, traced), sources, values, sums);
        }
        let occluded = self.tile.world.geometry.occluded_rows(rays, ends, traced, sources, folds);
        add_where(traced & !occluded, values, &mut sums.light);
    }

    /// [`Lighting::add_seen`], where light may pass surfaces straight on.
    #[cold]
    #[inline(never)]
    fn add_weakened(
        &self,
        (rays, ends, traced): (&RayRows, &Ends, u32),
        sources: &SourceRow,
        values: &Lanes3,
        sums: &mut Sums,
    ) {
        let weakened = self.tile.world.weakened_rows(rays, ends, traced, sources);
        sums.rays.lookups += weakened.lookups;
        let mut values = *values;
        let arriving = traced & !weakened.occluded;
        for i in lanes(arriving) {
            let value = lane(&values, i) * passed(lane(&weakened.left, i), self.measure);
            set_lane(&mut values, i, value);
        }
        add_where(arriving, &values, &mut sums.light);
    }

    /// Contribution of each sample if it is not occluded, a bit for each that is not 0, and the response of its vertex.
    #[inline(always)]
    pub fn values(&self, samples: &LightRow, share: f32, folds: impl Folds) -> (Lanes3, u32, Response) {
        let response = self.row.response(&samples.directions, folds);
        let Response { bsdf: BsdfValues { f, .. }, cosines } = &response;
        let mut arriving = samples.weights;
        if self.measure == Measure::ArrivingShare {
            for i in 0..LANES {
                let light = Vec3::splat(luminance(lane(&samples.weights, i)));
                set_lane(&mut arriving, i, light);
            }
        }
        let (mut values, mut active) = (*f, [0; LANES]);
        for i in 0..LANES {
            let value = lane(f, i) * lane(&arriving, i) * (cosines[i] * share);
            set_lane(&mut values, i, value);
            let brings = (cosines[i] > 0.0) & ((value.x != 0.0) | (value.y != 0.0) | (value.z != 0.0));
            active[i] = if brings { TRUE } else { 0 };
        }
        if let Some(media) = self.media.filter(|_| self.measure != Measure::ArrivingShare) {
            values = self.left_by_glass(media, samples, values);
        }
        (values, folds.bits(&active) & self.used, response)
    }

    /// The shadow rays of the samples in `active`; the other lanes have no end.
    #[inline(always)]
    pub fn shadow_rays(&self, samples: &LightRow, active: u32) -> (RayRows, Ends) {
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
        (RayRows::of(self.row.from, direction).leaving(self.row.starts(&direction)), ends)
    }
}

/// Adds the work of the rays whose bits are set: what they visit in the trees, up to their ends.
#[cold]
#[inline(never)]
pub fn add_work(tile: &TileContext<'_>, rays: &RayRows, ends: &Ends, traced: u32, sums: &mut Lanes3) {
    for i in lanes(traced) {
        let work = tile.world.geometry.work(&Ray { t_max: ends[i], ..rays.ray(i) });
        let sum = lane(sums, i) + Vec3::splat(work as f32);
        set_lane(sums, i, sum);
    }
}

/// Adds the values of the lanes whose bits are set, which are chosen by bits as in [`take`](crate::math::lanes::take).
#[inline(always)]
pub fn add_where(bits: u32, values: &Lanes3, sums: &mut Lanes3) {
    let of = truths(bits);
    for axis in 0..3 {
        for i in 0..LANES {
            sums[axis][i] += f32::from_bits(values[axis][i].to_bits() & of[i]);
        }
    }
}

/// The part of light that passed surfaces straight on, for a measure of light.
pub fn passed(left: Vec3, measure: Measure) -> Vec3 {
    match measure {
        Measure::Radiance(_) | Measure::Work => left,
        Measure::ArrivingShare => Vec3::splat(luminance(left)),
    }
}
