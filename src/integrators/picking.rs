//! Direct light where there are more lights than a vertex samples: it picks some by a tree over all of them. Of those samples rays
//! are sent to a part, chosen by what they bring.

use arrayvec::ArrayVec;

use super::light::{Arrived, Lighting, Sums, add_where};
use super::lit_row::Response;
use super::view::Measure;
use crate::geometry::rows::lanes;
use crate::lights::{Cut, LightRow, LightTree, Lights, Middle};
use crate::math::Vec3;
use crate::math::lanes::{LANES, Lanes, Lanes3, lane, set_lane};
use crate::sampling::{Decision, SamplerRow};
use crate::scene::description::Shadows;
use crate::world::Loops;

/// Lights the vertices of a row by lights that they pick.
pub(super) struct Picking<'a, const WEIGHED: bool> {
    pub(super) lighting: Lighting<'a, WEIGHED>,
    pub(super) tree: &'a LightTree,
}

/// Picks of a vertex for each sample that is asked for.
const PICKS: usize = Lights::PICKS as usize;

/// The picks of a row of vertices, each vertex's in the order of the tree: so rows of rays go to places that are close together.
struct Picks {
    /// Numbers of the lights.
    lights: [[u32; LANES]; PICKS],
    /// One over the expected numbers of samples; 0 where nothing was picked.
    shares: [Lanes; PICKS],
}

/// Samples of lights that a row of vertices picked.
#[derive(Clone)]
struct Sampled {
    samples: LightRow,
    /// What they bring if nothing is in the way.
    values: Lanes3,
    /// A bit for each that brings anything.
    active: u32,
    /// What they bring whatever is shown of it, about: all parts of a picture choose the same rays.
    importance: Lanes,
}

impl Sampled {
    /// A part of the samples of each vertex that is used, chosen in proportion to their importance: numbers u, u + 1, … of steps
    /// over its sum, the samples being in the order of the tree. Their values stand for all.
    #[inline(always)]
    fn chosen(all: &[Self], used: u32, u: &Lanes) -> ArrayVec<Self, TRACED> {
        let mut chosen: ArrayVec<Self, TRACED> = ArrayVec::new();
        for _ in 0..TRACED {
            chosen.push(Self { active: 0, ..all[0].clone() });
        }
        let mut total = [0.0; LANES];
        for one in all {
            for i in 0..LANES {
                total[i] += one.importance[i];
            }
        }
        for i in lanes(used) {
            let step = total[i] * (1.0 / TRACED as f32);
            let (mut sum, mut place) = (0.0, 0);
            for one in all {
                sum += one.importance[i];
                let first = place;
                while place < TRACED && (place as f32 + u[i]) * step < sum {
                    place += 1;
                }
                if place > first {
                    let times = (place - first) as f32 * step / one.importance[i];
                    chosen[first].take(i, one, times);
                }
            }
        }
        chosen
    }

    /// Take a sample of another row, which counts so many times.
    #[inline(always)]
    fn take(&mut self, i: usize, other: &Self, times: f32) {
        self.samples.take(i, &other.samples);
        set_lane(&mut self.values, i, lane(&other.values, i) * times);
        self.active |= other.active & 1 << i;
    }
}

/// Rays of a vertex towards the lights that it picked, for each sample that is asked for.
const TRACED: usize = 8;

impl<const WEIGHED: bool> Loops for Picking<'_, WEIGHED> {
    type Done = Arrived;

    #[inline(always)]
    fn run(self) -> Arrived {
        let Self { lighting, tree } = self;
        let (sampler, mut sums) = (lighting.row.sampler(lighting.shot), Sums::NOTHING);
        for group in 0..lighting.shot.settings.render.shadow_samples {
            let picks = Picks::new(&lighting, tree, &sampler, group);
            lighting.add_picks(&picks, &sampler, group, &mut sums);
        }
        sums.arrived(lighting.measure)
    }
}

impl Picks {
    /// One group of picks for each sample that is asked for.
    #[inline(always)]
    fn new<const WEIGHED: bool>(
        lighting: &Lighting<'_, WEIGHED>,
        tree: &LightTree,
        sampler: &SamplerRow<LANES>,
        group: u32,
    ) -> Self {
        let row = lighting.row;
        let count = lighting.shot.settings.render.shadow_samples * Lights::PICKS;
        let mut numbers = [[0.0; PICKS]; LANES];
        for k in 0..PICKS {
            let u = sampler.pairs(&row.path, Decision::Pick, group * Lights::PICKS + k as u32, count);
            for i in 0..LANES {
                // One of each group is in each part of [0, 1): so they are sorted. Both numbers of a pair are the digits of one:
                // a light among many has a small share.
                let part = (u[0][i] * PICKS as f32) as usize % PICKS;
                numbers[i][part] = f64::from(u[0][i]) + f64::from(u[1][i]) * DIGITS;
            }
        }
        let mut picks = Self { lights: [[0; LANES]; PICKS], shares: [[0.0; LANES]; PICKS] };
        for i in lanes(lighting.used) {
            let cut = Cut::new(tree, lane(&row.from, i), lane(&row.normal, i));
            let own = cut.pick(&numbers[i]);
            for k in 0..PICKS {
                if let Some(pick) = own[k] {
                    picks.lights[k][i] = pick.light;
                    picks.shares[k][i] = 1.0 / (pick.probability * count as f32);
                }
            }
        }
        picks
    }

    /// A row of picks: their lights, one over the expected numbers of samples, and a bit for each vertex that picked one. The
    /// others look at a light as well, which counts nothing.
    #[inline(always)]
    fn row(&self, k: usize) -> ([u32; LANES], &Lanes, u32) {
        let (mut lights, shares, mut used) = (self.lights[k], &self.shares[k], 0);
        for i in 0..LANES {
            used |= u32::from(shares[i] > 0.0) << i;
        }
        let filler = lights[used.trailing_zeros() as usize % LANES];
        for i in 0..LANES {
            lights[i] = if shares[i] > 0.0 { lights[i] } else { filler };
        }
        (lights, shares, used)
    }
}

/// The value of the digits that come after those of a random number.
const DIGITS: f64 = 1.0 / (1 << 24) as f64;

impl<const WEIGHED: bool> Lighting<'_, WEIGHED> {
    #[inline(always)]
    fn add_picks(&self, picks: &Picks, sampler: &SamplerRow<LANES>, group: u32, sums: &mut Sums) {
        let render = &self.shot.settings.render;
        let mut all = ArrayVec::<Sampled, PICKS>::new();
        for k in 0..PICKS {
            let sampled = self.sampled(picks, sampler, group, k);
            for i in 0..LANES {
                let is_active = sampled.active & 1 << i != 0;
                sums.total[i] += if is_active { sampled.values[0][i] } else { 0.0 };
            }
            match render.shadows {
                // Nothing is traced, so there is no work.
                Shadows::Off if self.measure == Measure::Work => {}
                Shadows::Off => add_where(sampled.active, &sampled.values, &mut sums.light),
                Shadows::Hard | Shadows::Soft => all.push(sampled),
            }
        }
        if render.shadows == Shadows::Off {
            return;
        }
        let [u, _] = sampler.pairs(&self.row.path, Decision::Trace, group, render.shadow_samples);
        for sampled in &Sampled::chosen(&all, self.used, &u) {
            if sampled.active != 0 {
                let Sampled { samples, values, active, .. } = sampled;
                let traced = active & !self.row.hidden(&samples.directions);
                let (rays, ends) = self.shadow_rays(samples, traced);
                self.add_seen(&rays, &ends, traced, &samples.sources, values, sums);
            }
        }
    }

    /// Sample a row of picked lights.
    #[inline(always)]
    fn sampled(&self, picks: &Picks, sampler: &SamplerRow<LANES>, group: u32, k: usize) -> Sampled {
        let (row, render) = (self.row, &self.shot.settings.render);
        let (lights, shares, used) = picks.row(k);
        let (number, count) = (group * Lights::PICKS + k as u32, render.shadow_samples * Lights::PICKS);
        let u = sampler.pairs(&row.path, Decision::Picked, number, count);
        let at = (&row.from, &row.normal);
        let (mut samples, mut inverse) = self.shot.world.lights.sample_each(&lights, at, used, &u);
        for i in 0..LANES {
            let weight = lane(&samples.weights, i) * shares[i];
            set_lane(&mut samples.weights, i, weight);
            inverse[i] *= shares[i];
        }
        let (mut values, active) = self.values(&samples, 1.0);
        let Response { cosines, glosses, .. } = row.response(&samples.directions);
        let mut importance = [0.0; LANES];
        for i in 0..LANES {
            let brings =
                lane(&samples.weights, i).max_element() * cosines[i] * row.lobes(i).value(glosses[i]);
            importance[i] = if brings > 0.0 { brings } else { 0.0 };
        }
        if WEIGHED {
            // As many rays in lobes as samples are asked for come on all groups of picks, each of which has its own density.
            let others = self.others.to_each(render.shadow_samples) * render.shadow_samples as f32;
            values = self.others.left(row, &samples, values, (&inverse, others));
        }
        if render.shadows == Shadows::Hard {
            self.aim_at_middles(&mut samples, &lights, active);
        }
        Sampled { samples, values, active: active & used, importance }
    }

    /// Let rays go to the middles of the lights, where these have any.
    fn aim_at_middles(&self, samples: &mut LightRow, lights: &[u32; LANES], active: u32) {
        for i in lanes(active) {
            let Some((middle, source)) = self.shot.world.lights.get(lights[i]).middle() else { continue };
            let direction = match middle {
                Middle::At(middle) => {
                    set_lane(&mut samples.targets, i, middle);
                    (middle - lane(&self.row.from, i)).try_normalize().unwrap_or(Vec3::ZERO)
                }
                Middle::Towards(direction) => direction,
            };
            set_lane(&mut samples.directions, i, direction);
            samples.sources.set(i, source);
        }
    }
}
