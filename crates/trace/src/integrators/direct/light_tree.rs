//! Next-event estimation for scenes with too many lights to sample all of them at each vertex. Lights are
//! picked from a tree.

use std::ops::Range;

use super::all_lights::SampleAllLights;
use super::light_sums::{LightSums, add_masked_lane_products, add_masked_lanes};
use super::mis::CompetingTechnique;
use super::shadow_rays::ShadowRayQueue;
use crate::geometry::packet::set_bit_lanes;
use crate::integrators::view::PathAov;
use crate::lights::{
    LightCenter, LightSamplePacket, LightSampler, LightSamplingEffort, LightTree, Receiver, ReceiverLobe,
    ReceiverPacket,
};
use crate::materials::bsdf::NarrowLobe;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Simd, lane, set_lane};
use crate::sampling::{Dimension, SamplerPacket};
use crate::scene::description::ShadowMode;
use crate::world::SimdKernel;

/// Samples lights picked from a tree at a packet of vertices.
pub struct SampleLightTree<'a, const MIS: bool> {
    /// The vertices, and how to sample light at them.
    pub lighting: SampleAllLights<'a, MIS>,
    /// The tree, and how to pick from it.
    pub selection: LightSampler<'a>,
    /// Index of the packet, which identifies the packet's shadow rays in the pool.
    pub number: u32,
    /// Receives the shadow rays.
    pub pool: &'a mut ShadowRayQueue,
}

impl SampleAllLights<'_, true> {
    /// Samples the lights, or lights picked from the tree if there is one. Without a competing technique, no
    /// weights are computed. Shadow rays to picked lights are pooled under index `number`.
    pub fn sample_all_or_picked_lights(self, number: u32, pool: &mut ShadowRayQueue) -> LightSums {
        use CompetingTechnique::{Lobes, NarrowPaths, Nothing, Paths};
        let Self { tile, row, used, aov, competing, interior_lists, only_infinite, splits_lobes } = self;
        let plain = SampleAllLights::<false> {
            tile,
            row,
            used,
            aov,
            competing,
            interior_lists,
            only_infinite,
            splits_lobes,
        };
        let instructions = tile.world.geometry.instruction_set();
        match (competing, tile.world.lights.sampler_for_purpose(tile.behavior.receivers)) {
            (Nothing, None) => instructions.run(plain),
            (Nothing, Some(selection)) => {
                instructions.run(SampleLightTree { lighting: plain, selection, number, pool })
            }
            (Paths | NarrowPaths | Lobes(_), None) => instructions.run(self),
            (Paths | NarrowPaths | Lobes(_), Some(selection)) => {
                instructions.run(SampleLightTree { lighting: self, selection, number, pool })
            }
        }
    }
}

/// One picked light per vertex in a packet. The picks for one sample are in tree order so that the shadow
/// rays in a packet are aimed at nearby lights.
#[derive(Clone)]
#[repr(align(64))]
pub struct LightPicks {
    /// Indices of the lights.
    pub lights: [u32; PACKET_SIZE],
    /// Reciprocal of the expected sample count for each vertex's light, or 0 if no light was picked.
    pub shares: F32x16,
    /// Like `shares`, but without glossy lobes. Used for MIS weights, because the vertex's lobe is unknown
    /// when a ray hits the light.
    pub weighed: F32x16,
}

/// Number of samples for which lights are picked together.
const PICK_BLOCK: u32 = 8;

impl<const MIS: bool> SimdKernel for SampleLightTree<'_, MIS> {
    type Output = LightSums;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> LightSums {
        let Self { lighting, selection, number, pool } = self;
        let sampler = lighting.row.sampler_packet(lighting.tile);
        let mut sums = LightSums::ZERO;
        // Sample all infinite lights, if the tree excludes them.
        if selection.samples_infinite {
            sums = simd.call_out_of_line(SampleAllLights { only_infinite: true, ..lighting });
        }
        let samples = lighting.tile.settings.render.shadow_samples;
        let (each, tree) = (selection.picks.count, selection.tree);
        // With many samples, the shadow rays of one packet are already coherent.
        let mut pool = (samples <= PICK_BLOCK).then_some(pool);
        // Pick lights for several samples together, and sample the picked lights.
        for first in (0..samples).step_by(PICK_BLOCK as usize) {
            let picks =
                lighting.pick_lights(selection, &sampler, first..(first + PICK_BLOCK).min(samples), simd);
            for (k, pick) in (first * each..).zip(&picks) {
                let mut sink =
                    SampledLightSink { tree, row: number, pool: pool.as_deref_mut(), sums: &mut sums };
                lighting.sample_picked_lights(pick, &sampler, (k, samples * each), &mut sink, simd);
            }
        }
        sums
    }
}

/// Destination for the sampled light or the pending shadow rays.
struct SampledLightSink<'a> {
    tree: &'a LightTree,
    row: u32,
    /// Pool for the shadow rays, or `None` to trace them immediately.
    pool: Option<&'a mut ShadowRayQueue>,
    sums: &'a mut LightSums,
}

impl LightPicks {
    const EMPTY: Self =
        Self { lights: [0; PACKET_SIZE], shares: [0.0; PACKET_SIZE], weighed: [0.0; PACKET_SIZE] };

    /// Replaces each probability with the reciprocal of the expected sample count, or with 0 if the
    /// probability is 0.
    #[inline(always)]
    fn invert_probabilities(&mut self, count: f32, is_weighed: bool) {
        for i in 0..PACKET_SIZE {
            let is_picked = self.shares[i] > 0.0;
            let [share, weighed] = [self.shares[i], self.weighed[i]].map(|share| 1.0 / (share * count));
            self.shares[i] = if is_picked { share } else { 0.0 };
            self.weighed[i] = if is_picked & is_weighed { weighed } else { 0.0 };
        }
    }

    /// Returns the lights and the mask of vertices that picked a light. Lights in the other lanes are
    /// arbitrary and have no effect.
    #[inline(always)]
    fn lane_lights_and_picked_mask(&self) -> ([u32; PACKET_SIZE], u32) {
        let (mut lights, shares, mut used) = (self.lights, &self.shares, 0);
        for i in 0..PACKET_SIZE {
            used |= u32::from(shares[i] > 0.0) << i;
        }
        let filler = lights[used.trailing_zeros() as usize % PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            lights[i] = if shares[i] > 0.0 { lights[i] } else { filler };
        }
        (lights, used)
    }
}

/// Scale factor that appends the digits of a pair's second random number to the digits of the first.
const LOW_DIGITS: f64 = 1.0 / (1 << 24) as f64;

impl<const MIS: bool> SampleAllLights<'_, MIS> {
    /// Picks lights at each vertex for a range of samples.
    #[inline(always)]
    pub fn pick_lights(
        &self,
        LightSampler { tree, picks: way, .. }: LightSampler<'_>,
        sampler: &SamplerPacket<PACKET_SIZE>,
        samples: Range<u32>,
        simd: impl Simd,
    ) -> Vec<LightPicks> {
        let row = self.row;
        let count = self.tile.settings.render.shadow_samples * way.count;
        let group = way.count as usize;
        let (first, end) = (samples.start * way.count, samples.end * way.count);
        // Sort the random numbers for each group of picks.
        let mut numbers = vec![[0.0; PACKET_SIZE]; (end - first) as usize];
        for k in first..end {
            let u = sampler.pairs(&row.path, Dimension::LightChoice, k, count);
            let place = (k - first) as usize / group * group;
            // Each part of [0, 1) contains one pick per group, so a bucket sort is sufficient. The digits of
            // both numbers in a pair are combined into one number because each of many lights has a small
            // probability.
            let (mut parts, mut digits) = ([0; PACKET_SIZE], [0.0; PACKET_SIZE]);
            for i in 0..PACKET_SIZE {
                let part = (u[0][i] * way.count as f32) as i32 as u32;
                parts[i] = if part < way.count { part } else { way.count - 1 };
                digits[i] = f64::from(u[0][i]) + f64::from(u[1][i]) * LOW_DIGITS;
            }
            for i in 0..PACKET_SIZE {
                numbers[place + parts[i] as usize][i] = digits[i];
            }
        }
        // Pick lights with these numbers.
        let mut picks = vec![LightPicks::EMPTY; numbers.len()];
        if tree.is_single_node() {
            self.pick_from_single_node_tree(tree, &numbers, &mut picks, simd);
        } else {
            self.pick_per_vertex_with_tree_cut(tree, way, &numbers, &mut picks);
        }
        for row in &mut picks {
            row.invert_probabilities(count as f32, MIS);
        }
        picks
    }

    /// Picks lights from a tree with a single node, for all vertices at once.
    #[inline(always)]
    fn pick_from_single_node_tree(
        &self,
        tree: &LightTree,
        numbers: &[[f64; PACKET_SIZE]],
        picks: &mut [LightPicks],
        simd: impl Simd,
    ) {
        let row = self.row;
        // Estimate the light from each source at each vertex, including glossy lobes.
        let plain = ReceiverPacket::with_unknown_lobe(&row.from, &row.normal);
        let mut glossy = plain.clone();
        for i in set_bit_lanes(if row.bsdf.has_narrow_lobes() { self.used } else { 0 }) {
            if let Some(lobe) = self.receiver_lobe(i) {
                glossy.set_lobe(i, &lobe);
            }
        }
        // Normalize the estimates of each vertex.
        let Some(shares) = tree.importance_if_single_node(&glossy, row.bsdf.has_narrow_lobes(), simd) else {
            return;
        };
        let without = (MIS && row.bsdf.has_narrow_lobes())
            .then(|| tree.importance_if_single_node(&plain, false, simd))
            .flatten();
        // Pick lights with each row of numbers.
        for (numbers, pick) in numbers.iter().zip(picks) {
            let picked = shares.pick_packet(numbers);
            pick.lights = picked.lights;
            pick.weighed = match &without {
                Some(without) => without.probabilities_of_picks(&picked),
                None => picked.probabilities,
            };
            pick.shares = picked.probabilities;
            for i in 0..PACKET_SIZE {
                let is_used = self.used & 1 << i != 0;
                pick.shares[i] = if is_used { pick.shares[i] } else { 0.0 };
            }
        }
    }

    /// Picks lights from a tree of any size, one vertex at a time.
    #[inline(always)]
    fn pick_per_vertex_with_tree_cut(
        &self,
        tree: &LightTree,
        way: LightSamplingEffort,
        numbers: &[[f64; PACKET_SIZE]],
        picks: &mut [LightPicks],
    ) {
        let (row, group) = (self.row, way.count as usize);
        let (mut cut, mut without) =
            (way.new_adaptive_tree_cut(tree), MIS.then(|| way.new_adaptive_tree_cut(tree)));
        for i in set_bit_lanes(self.used) {
            let plain = Receiver::with_unknown_lobe(lane(&row.from, i), lane(&row.normal, i));
            let lobe = self.receiver_lobe(i);
            cut.adapt_to_receiver(&Receiver { lobe, ..plain });
            let without = without.as_mut().filter(|_| lobe.is_some()).map(|without| {
                without.adapt_to_receiver(&plain);
                &*without
            });
            for (numbers, picks) in numbers.chunks(group).zip(picks.chunks_mut(group)) {
                cut.pick_sorted_batch(numbers.iter().map(|row| row[i]), |place, light, probability| {
                    let row = &mut picks[place];
                    row.lights[i] = light;
                    row.shares[i] = probability;
                    if MIS {
                        row.weighed[i] = without.map_or(probability, |without| without.probability(light));
                    }
                });
            }
        }
    }

    /// Narrow lobe at a vertex, with its strength relative to the wide lobes.
    #[inline(always)]
    fn receiver_lobe(&self, i: usize) -> Option<ReceiverLobe> {
        let NarrowLobe { axis, exponent, peak, wide } = self.row.bsdf.narrow_lobe_at_lane(i)?;
        let is_both = wide > 0.0;
        Some(ReceiverLobe {
            axis,
            shininess: exponent,
            peak: if is_both { peak / wide } else { 1.0 },
            diffuse: if is_both { 1.0 } else { 0.0 },
        })
    }

    /// Samples one picked light per vertex and adds its light, or queues its shadow rays.
    #[inline(always)]
    fn sample_picked_lights(
        &self,
        pick: &LightPicks,
        sampler: &SamplerPacket<PACKET_SIZE>,
        (number, count): (u32, u32),
        sink: &mut SampledLightSink<'_>,
        simd: impl Simd,
    ) {
        let SampledLightSink { tree, row: row_number, pool, sums } = sink;
        let (row, render) = (self.row, &self.tile.settings.render);
        let (lights, used) = pick.lane_lights_and_picked_mask();
        // Sample a point on each picked light.
        let u = sampler.pairs(&row.path, Dimension::ChosenLight, number, count);
        let at = (&row.from, &row.normal);
        let (mut samples, mut inverse, lookups) =
            self.tile.world.lights.sample_per_lane(&lights, at, used, &u);
        sums.rays.lookups += lookups;
        for i in 0..PACKET_SIZE {
            let weight = lane(&samples.weights, i) * pick.shares[i];
            set_lane(&mut samples.weights, i, weight);
            inverse[i] *= pick.weighed[i];
        }
        // Compute the unoccluded contributions.
        let (mut values, active, response) = self.contributions_before_occlusion(&samples, 1.0, simd);
        let active = active & used;
        let mut fraction = self.splits_lobes.then(|| response.bsdf.wide_fraction());
        if MIS {
            let unweighted = values;
            // Each group of picks has its own pdf and competes with all requested BSDF samples.
            let competing = self.competing.bsdf_rays_per_light_sample(render.shadow_samples)
                * render.shadow_samples as f32;
            values = self.competing.apply_mis_weights(
                row,
                (&samples, &response),
                values,
                (&inverse, competing),
                simd,
            );
            if let Some(fraction) = &mut fraction {
                self.competing.adjust_wide_light_fraction(fraction, &unweighted, &values);
            }
        }
        if active == 0 {
            return;
        }
        for i in 0..PACKET_SIZE {
            let is_active = active & 1 << i != 0;
            sums.total[i] += if is_active { values[0][i] } else { 0.0 };
        }
        match render.shadows {
            // Nothing is traced, so there is no traversal cost.
            ShadowMode::Off if self.aov == PathAov::TraversalCost => return,
            ShadowMode::Off => {
                if let Some(fraction) = &fraction {
                    add_masked_lane_products(active, &values, fraction, &mut sums.diffuse);
                }
                return add_masked_lanes(active, &values, &mut sums.light);
            }
            ShadowMode::Hard => self.aim_samples_at_light_centers(&mut samples, &lights, active),
            ShadowMode::Soft => {}
        }
        // Trace the shadow rays, or queue them with other rays to the same lights.
        let traced = active & !row.below_horizon_mask(&samples.directions, simd);
        let (rays, ends) = self.shadow_rays(&samples, traced);
        match pool {
            Some(pool) if self.aov != PathAov::TraversalCost => {
                sums.rays.shadow += u64::from(traced.count_ones());
                let mut places = [0; PACKET_SIZE];
                for i in 0..PACKET_SIZE {
                    places[i] = tree.tree_order_position(lights[i]);
                }
                let light = (&values, fraction.as_ref());
                pool.push_packet(*row_number, (rays, ends, traced), &samples.sources, light, &places);
            }
            Some(_) | None => {
                self.trace_and_add_light(
                    (&rays, &ends, traced),
                    &samples.sources,
                    (&values, fraction.as_ref()),
                    sums,
                    simd,
                );
            }
        }
    }

    /// Aims rays at the centers of all lights that have a center.
    fn aim_samples_at_light_centers(
        &self,
        samples: &mut LightSamplePacket,
        lights: &[u32; PACKET_SIZE],
        active: u32,
    ) {
        for i in set_bit_lanes(active) {
            let Some((middle, source)) = self.tile.world.lights.get(lights[i]).center_and_geometry() else {
                continue;
            };
            let direction = match middle {
                LightCenter::At(middle) => {
                    set_lane(&mut samples.targets, i, middle);
                    (middle - lane(&self.row.from, i)).try_normalize().unwrap_or(Vec3::ZERO)
                }
                LightCenter::Towards(direction) => direction,
            };
            set_lane(&mut samples.directions, i, direction);
            samples.sources.set_geometry(i, source);
        }
    }
}
