//! Direct light with more lights than a vertex samples: it picks some by a tree over all lights.

use std::ops::Range;

use super::all_lights::{Lighting, Sums, add_where};
use super::shadow_rays::ShadowRayQueue;
use crate::geometry::rows::lanes;
use crate::integrators::view::Measure;
use crate::lights::{LightRow, LightTree, Lobe, Middle, Picks, Receiver, ReceiverRow, Selection};
use crate::materials::bsdf::NarrowLobe;
use crate::math::Vec3;
use crate::math::lanes::{Folds, LANES, Lanes, lane, set_lane};
use crate::sampling::{Decision, SamplerRow};
use crate::scene::description::Shadows;
use crate::world::Loops;

/// Lights the vertices of a row by picked lights.
pub struct Picking<'a, const WEIGHED: bool> {
    pub lighting: Lighting<'a, WEIGHED>,
    pub selection: Selection<'a>,
    /// Number of the row; then the pool for its rays.
    pub number: u32,
    pub pool: &'a mut ShadowRayQueue,
}

/// One pick for each vertex of a row. The picks of one sample are in the order of the tree, so that rows of rays go to places
/// close together.
#[derive(Clone)]
struct PickRow {
    /// Numbers of the lights.
    lights: [u32; LANES],
    /// Inverse of the expected numbers of samples; 0 without a pick.
    shares: Lanes,
    /// The same for a vertex without a glossy lobe: MIS weights use it, as other rays that find the light know no more.
    weighed: Lanes,
}

/// Samples whose picks are made together.
const TOGETHER: u32 = 8;

impl<const WEIGHED: bool> Loops for Picking<'_, WEIGHED> {
    type Done = Sums;

    #[inline(always)]
    fn run(self, folds: impl Folds) -> Sums {
        let Self { lighting, selection, number, pool } = self;
        let sampler = lighting.row.sampler(lighting.tile);
        let mut sums = Sums::NOTHING;
        // Sample all lights beyond the scene, if the tree leaves them out.
        if selection.leaves_beyond {
            sums = folds.call(Lighting { only_beyond: true, ..lighting });
        }
        let samples = lighting.tile.settings.render.shadow_samples;
        let (each, tree) = (selection.picks.count, selection.tree);
        // With many samples, the rays of one row of picks already go to one place.
        let mut pool = (samples <= TOGETHER).then_some(pool);
        // Pick lights for several samples together, and sample the picked ones.
        for first in (0..samples).step_by(TOGETHER as usize) {
            let picks = lighting.picks(selection, &sampler, first..(first + TOGETHER).min(samples));
            for (k, pick) in (first * each..).zip(&picks) {
                let mut taking = Taking { tree, row: number, pool: pool.as_deref_mut(), sums: &mut sums };
                lighting.add_pick(pick, &sampler, (k, samples * each), &mut taking, folds);
            }
        }
        sums
    }
}

/// Collector of the light that a row picks, or of its rays.
struct Taking<'a> {
    tree: &'a LightTree,
    row: u32,
    /// Pool for the rays. `None` to trace rays at once.
    pool: Option<&'a mut ShadowRayQueue>,
    sums: &'a mut Sums,
}

impl PickRow {
    const NOTHING: Self = Self { lights: [0; LANES], shares: [0.0; LANES], weighed: [0.0; LANES] };

    /// Turns probabilities into shares, 0 for a probability of 0.
    #[inline(always)]
    fn invert(&mut self, count: f32, is_weighed: bool) {
        for i in 0..LANES {
            let is_picked = self.shares[i] > 0.0;
            let [share, weighed] = [self.shares[i], self.weighed[i]].map(|share| 1.0 / (share * count));
            self.shares[i] = if is_picked { share } else { 0.0 };
            self.weighed[i] = if is_picked & is_weighed { weighed } else { 0.0 };
        }
    }

    /// The lights, and a bit for each vertex that picked one. Other vertices get a light as well, without effect.
    #[inline(always)]
    fn lights(&self) -> ([u32; LANES], u32) {
        let (mut lights, shares, mut used) = (self.lights, &self.shares, 0);
        for i in 0..LANES {
            used |= u32::from(shares[i] > 0.0) << i;
        }
        let filler = lights[used.trailing_zeros() as usize % LANES];
        for i in 0..LANES {
            lights[i] = if shares[i] > 0.0 { lights[i] } else { filler };
        }
        (lights, used)
    }
}

/// Value of the digits that follow those of a random number.
const DIGITS: f64 = 1.0 / (1 << 24) as f64;

impl<const WEIGHED: bool> Lighting<'_, WEIGHED> {
    /// The picks of the vertices for some samples.
    #[inline(always)]
    fn picks(
        &self,
        Selection { tree, picks: way, .. }: Selection<'_>,
        sampler: &SamplerRow<LANES>,
        samples: Range<u32>,
    ) -> Vec<PickRow> {
        let row = self.row;
        let count = self.tile.settings.render.shadow_samples * way.count;
        let group = way.count as usize;
        let (first, end) = (samples.start * way.count, samples.end * way.count);
        // Sort the random numbers of each group of picks.
        let mut numbers = vec![[0.0; LANES]; (end - first) as usize];
        for k in first..end {
            let u = sampler.pairs(&row.path, Decision::Pick, k, count);
            let place = (k - first) as usize / group * group;
            // One pick of each group is in each part of [0, 1), so that they are sorted. Both numbers of a pair are the
            // digits of one number: a light among many has a small share.
            let (mut parts, mut digits) = ([0; LANES], [0.0; LANES]);
            for i in 0..LANES {
                let part = (u[0][i] * way.count as f32) as i32 as u32;
                parts[i] = if part < way.count { part } else { way.count - 1 };
                digits[i] = f64::from(u[0][i]) + f64::from(u[1][i]) * DIGITS;
            }
            for i in 0..LANES {
                numbers[place + parts[i] as usize][i] = digits[i];
            }
        }
        // Pick lights by the numbers.
        let mut picks = vec![PickRow::NOTHING; numbers.len()];
        if tree.is_flat() {
            self.pick_flat(tree, &numbers, &mut picks);
        } else {
            self.pick_by_cuts(tree, way, &numbers, &mut picks);
        }
        for row in &mut picks {
            row.invert(count as f32, WEIGHED);
        }
        picks
    }

    /// Picks from a tree of one node, all vertices side by side.
    #[inline(always)]
    fn pick_flat(&self, tree: &LightTree, numbers: &[[f64; LANES]], picks: &mut [PickRow]) {
        let row = self.row;
        // Estimate the light of each lamp at each vertex, with glossy lobes and without.
        let plain = ReceiverRow::plain(&row.from, &row.normal);
        let mut glossy = plain.clone();
        for i in lanes(if row.bsdf.has_narrow_lobes() { self.used } else { 0 }) {
            if let Some(lobe) = self.lobe(i) {
                glossy.set_lobe(i, &lobe);
            }
        }
        // Turn the estimates into probabilities.
        let Some(shares) = tree.flat_shares(&glossy, row.bsdf.has_narrow_lobes()) else { return };
        let without =
            (WEIGHED && row.bsdf.has_narrow_lobes()).then(|| tree.flat_shares(&plain, false)).flatten();
        // Pick by each row of numbers.
        for (numbers, pick) in numbers.iter().zip(picks) {
            let picked = shares.pick(numbers);
            pick.lights = picked.lights;
            pick.weighed = match &without {
                Some(without) => without.probabilities(&picked),
                None => picked.probabilities,
            };
            pick.shares = picked.probabilities;
            for i in 0..LANES {
                let is_used = self.used & 1 << i != 0;
                pick.shares[i] = if is_used { pick.shares[i] } else { 0.0 };
            }
        }
    }

    /// Picks from any tree, one vertex after the other.
    #[inline(always)]
    fn pick_by_cuts(&self, tree: &LightTree, way: Picks, numbers: &[[f64; LANES]], picks: &mut [PickRow]) {
        let (row, group) = (self.row, way.count as usize);
        let (mut cut, mut without) = (way.cut(tree), WEIGHED.then(|| way.cut(tree)));
        for i in lanes(self.used) {
            let plain = Receiver::plain(lane(&row.from, i), lane(&row.normal, i));
            let lobe = self.lobe(i);
            cut.go_to(&Receiver { lobe, ..plain });
            let without = without.as_mut().filter(|_| lobe.is_some()).map(|without| {
                without.go_to(&plain);
                &*without
            });
            for (numbers, picks) in numbers.chunks(group).zip(picks.chunks_mut(group)) {
                cut.pick(numbers.iter().map(|row| row[i]), |place, light, probability| {
                    let row = &mut picks[place];
                    row.lights[i] = light;
                    row.shares[i] = probability;
                    if WEIGHED {
                        row.weighed[i] = without.map_or(probability, |without| without.probability(light));
                    }
                });
            }
        }
    }

    /// The narrow lobe of a vertex, relative to its wide ones.
    #[inline(always)]
    fn lobe(&self, i: usize) -> Option<Lobe> {
        let NarrowLobe { axis, exponent, peak, wide } = self.row.bsdf.narrow_lobe(i)?;
        let is_both = wide > 0.0;
        Some(Lobe {
            axis,
            shininess: exponent,
            peak: if is_both { peak / wide } else { 1.0 },
            diffuse: if is_both { 1.0 } else { 0.0 },
        })
    }

    /// Adds the light of a row of picked lights.
    #[inline(always)]
    fn add_pick(
        &self,
        pick: &PickRow,
        sampler: &SamplerRow<LANES>,
        (number, count): (u32, u32),
        taking: &mut Taking<'_>,
        folds: impl Folds,
    ) {
        let Taking { tree, row: row_number, pool, sums } = taking;
        let (row, render) = (self.row, &self.tile.settings.render);
        let (lights, used) = pick.lights();
        // Sample a point on each picked light.
        let u = sampler.pairs(&row.path, Decision::Picked, number, count);
        let at = (&row.from, &row.normal);
        let (mut samples, mut inverse, lookups) = self.tile.world.lights.sample_each(&lights, at, used, &u);
        sums.rays.lookups += lookups;
        for i in 0..LANES {
            let weight = lane(&samples.weights, i) * pick.shares[i];
            set_lane(&mut samples.weights, i, weight);
            inverse[i] *= pick.weighed[i];
        }
        // Compute what would arrive from it.
        let (mut values, active, response) = self.values(&samples, 1.0, folds);
        let active = active & used;
        if WEIGHED {
            // Each group of picks has its own pdf, and as many rays in lobes as requested samples compete with all groups.
            let competing =
                self.competing.rays_per_sample(render.shadow_samples) * render.shadow_samples as f32;
            values =
                self.competing.weighted(row, (&samples, &response), values, (&inverse, competing), folds);
        }
        if active == 0 {
            return;
        }
        for i in 0..LANES {
            let is_active = active & 1 << i != 0;
            sums.total[i] += if is_active { values[0][i] } else { 0.0 };
        }
        match render.shadows {
            // Nothing is traced, so there is no work.
            Shadows::Off if self.measure == Measure::Work => return,
            Shadows::Off => return add_where(active, &values, &mut sums.light),
            Shadows::Hard => self.aim_at_middles(&mut samples, &lights, active),
            Shadows::Soft => {}
        }
        // Trace shadow rays, or let them wait for others to the same lights.
        let traced = active & !row.hidden(&samples.directions, folds);
        let (rays, ends) = self.shadow_rays(&samples, traced);
        match pool {
            Some(pool) if self.measure != Measure::Work => {
                sums.rays.shadow += u64::from(traced.count_ones());
                let mut places = [0; LANES];
                for i in 0..LANES {
                    places[i] = tree.place_of(lights[i]);
                }
                pool.push(*row_number, (rays, ends, traced), &samples.sources, &values, &places);
            }
            Some(_) | None => self.add_seen((&rays, &ends, traced), &samples.sources, &values, sums, folds),
        }
    }

    /// Aims rays at the middles of the lights that have one.
    fn aim_at_middles(&self, samples: &mut LightRow, lights: &[u32; LANES], active: u32) {
        for i in lanes(active) {
            let Some((middle, source)) = self.tile.world.lights.get(lights[i]).middle() else { continue };
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
