//! Next-event estimation that samples every light at each vertex in a packet.

use super::light_sums::{LightSums, add_masked_lane_products, add_masked_lanes};
use super::mis::CompetingTechnique;
use crate::geometry::Ray;
use crate::geometry::packet::{F32x16, RayPacket, set_bit_lanes};
use crate::integrators::transport::batch::{BsdfValuesAndCosines, VertexBatch};
use crate::integrators::transport::interiors::{InteriorListPool, medium_transmittance};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::view::PathAov;
use crate::lights::{
    EmissionModulation, GeometryOfLight, GeometryOfLightPacket, Light, LightCenter, LightSamplePacket,
};
use crate::materials::bsdf::divide_lanes_or_zero;
use crate::math::Vec3;
use crate::math::color::luminance;
use crate::math::lanes::{PACKET_SIZE, Simd, TRUE, Vec3x16, lane, set_lane};
use crate::sampling::Dimension;
use crate::scene::description::ShadowMode;
use crate::world::SimdKernel;

/// Samples all lights at the vertices in `used`. `MIS` is false if lights are found only by light samples, in
/// which case no weights are computed.
pub struct SampleAllLights<'a, const MIS: bool> {
    /// The tile being rendered.
    pub tile: &'a TileContext<'a>,
    /// The packet of vertices.
    pub row: &'a VertexBatch,
    /// Mask of vertices to light.
    pub used: u32,
    /// The AOV to compute.
    pub aov: PathAov,
    /// Technique that competes with light samples. Unused if `MIS` is false.
    pub competing: CompetingTechnique,
    /// Media at the vertices, or `None` if all vertices are in air.
    pub interior_lists: Option<&'a InteriorListPool>,
    /// Whether to sample only infinite lights.
    pub only_infinite: bool,
    /// Whether to sum the light from wide lobes separately.
    pub splits_lobes: bool,
}

/// Light from one source whose visibility is determined by a single shadow ray.
#[repr(align(64))]
struct PendingLight {
    light: Vec3x16,
    /// The part of `light` from wide lobes, if it was requested.
    diffuse: Vec3x16,
    active: u32,
}

impl<const MIS: bool> SimdKernel for SampleAllLights<'_, MIS> {
    type Output = LightSums;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> LightSums {
        let mut sums = LightSums::ZERO;
        self.sample_all(&mut sums, simd);
        sums
    }
}

impl<const MIS: bool> SampleAllLights<'_, MIS> {
    /// Adds the reflected light from all lights.
    #[inline(always)]
    fn sample_all(&self, sums: &mut LightSums, simd: impl Simd) {
        let render = &self.tile.settings.render;
        let is_sampled = |light: &Light| !self.only_infinite || light.is_infinite();
        let mut sampler = None;
        for (number, light) in self.tile.world.lights.iter().filter(|(_, light)| is_sampled(light)) {
            if MIS && self.tile.paths_find_sky && light.is_environment() {
                continue;
            }
            // If a single shadow ray determines the visibility of the whole light, defer the sum until the
            // ray is traced.
            let mut pending =
                PendingLight { light: [[0.0; PACKET_SIZE]; 3], diffuse: [[0.0; PACKET_SIZE]; 3], active: 0 };
            let is_deferred = match render.shadows {
                ShadowMode::Soft => false,
                ShadowMode::Hard => light.center_and_geometry().is_some(),
                ShadowMode::Off => true,
            };
            // If only one sample is possible, take one. Otherwise, take the requested number.
            let is_single = light.has_no_angular_extent();
            let count = if is_single { 1 } else { render.shadow_samples };
            if !is_single && sampler.is_none() {
                sampler = Some(self.row.sampler_packet(self.tile));
            }
            for repetition in 0..count {
                let u = match &sampler {
                    Some(sampler) if !is_single => {
                        sampler.pairs(&self.row.path, Dimension::Light(number), repetition, count)
                    }
                    Some(_) | None => [[0.0; PACKET_SIZE]; 2],
                };
                let samples =
                    light.sample_unmodulated_packet(&self.row.from, &self.row.normal, self.used, &u);
                let (mut values, active, response) =
                    self.contributions_before_occlusion(&samples, 1.0 / count as f32, simd);
                // Multiply by the emission texture.
                if let Some(pattern) = light.emission_modulation() {
                    values = self.apply_emission_modulation(pattern, &samples, active, values);
                    sums.rays.lookups += u64::from(active.count_ones());
                }
                let mut fraction = self.splits_lobes.then(|| response.bsdf.wide_fraction());
                // Apply the MIS weight, unless the light has no extent and is found only by light samples.
                if MIS && !is_single {
                    let leaves_gloss = self.tile.lobes_find_sky && light.is_environment();
                    let of_light = if leaves_gloss && self.competing.uses_glossy_lobe_rays() {
                        // Use a light-sampling pdf close to 0 so that lobe rays account for all of the light.
                        [f32::MAX; PACKET_SIZE]
                    } else {
                        light.inverse_pdfs_of_samples(&samples)
                    };
                    let competing = self.competing.bsdf_rays_per_light_sample(count);
                    let unweighted = values;
                    values = self.competing.apply_mis_weights(
                        self.row,
                        (&samples, &response),
                        values,
                        (&of_light, competing),
                        simd,
                    );
                    if let Some(fraction) = &mut fraction {
                        self.competing.adjust_wide_light_fraction(fraction, &unweighted, &values);
                    }
                }
                self.add_or_defer_samples(
                    &samples,
                    (&values, fraction.as_ref()),
                    active,
                    sums,
                    is_deferred.then_some(&mut pending),
                    simd,
                );
            }
            // Trace the single ray to the light's center.
            if pending.active != 0 {
                self.trace_and_add_pending_light(light.center_and_geometry(), &pending, sums, simd);
            }
        }
    }

    /// Multiplies values by the transmittance of the media between the vertices and the samples.
    #[cold]
    #[inline(never)]
    fn attenuate_by_media(
        &self,
        interior_lists: &InteriorListPool,
        samples: &LightSamplePacket,
        mut values: Vec3x16,
    ) -> Vec3x16 {
        for i in set_bit_lanes(self.used) {
            let way = lane(&samples.targets, i) - lane(&self.row.from, i);
            let is_beyond = samples.beyond & 1 << i != 0;
            let distance = if is_beyond { f32::MAX } else { way.length() };
            let left =
                medium_transmittance(self.tile.world, &interior_lists.get(self.row.interiors[i]), distance);
            let value = lane(&values, i) * left;
            set_lane(&mut values, i, value);
        }
        values
    }

    /// Multiplies values by the emission modulation at the sampled points.
    #[cold]
    #[inline(never)]
    fn apply_emission_modulation(
        &self,
        pattern: &EmissionModulation,
        samples: &LightSamplePacket,
        active: u32,
        mut values: Vec3x16,
    ) -> Vec3x16 {
        for i in set_bit_lanes(active) {
            let (target, direction) = (lane(&samples.targets, i), lane(&samples.directions, i));
            let color = pattern.radiance_factor(target, samples.sources.part[i], direction);
            let color = match self.aov {
                PathAov::Radiance(_) => color,
                PathAov::LitFraction => Vec3::splat(luminance(color)),
                PathAov::TraversalCost => Vec3::ONE,
            };
            let value = lane(&values, i) * color;
            set_lane(&mut values, i, value);
        }
        values
    }

    /// Adds the contributions of one light's samples. With `pending`, defers them until the light's shadow
    /// ray is traced.
    #[inline(always)]
    fn add_or_defer_samples(
        &self,
        samples: &LightSamplePacket,
        (values, fraction): (&Vec3x16, Option<&Vec3x16>),
        active: u32,
        sums: &mut LightSums,
        pending: Option<&mut PendingLight>,
        simd: impl Simd,
    ) {
        if active == 0 {
            return;
        }
        for i in 0..PACKET_SIZE {
            let is_active = active & 1 << i != 0;
            sums.total[i] += if is_active { values[0][i] } else { 0.0 };
        }
        if let Some(pending) = pending {
            pending.active |= active;
            add_masked_lanes(active, values, &mut pending.light);
            if let Some(fraction) = fraction {
                add_masked_lane_products(active, values, fraction, &mut pending.diffuse);
            }
        } else {
            let traced = active & !self.row.below_horizon_mask(&samples.directions, simd);
            let (rays, ends) = self.shadow_rays(samples, traced);
            let light = (values, fraction);
            self.trace_and_add_light((&rays, &ends, traced), &samples.sources, light, sums, simd);
        }
    }

    /// Adds deferred light after tracing one shadow ray to the light's center.
    #[inline(always)]
    fn trace_and_add_pending_light(
        &self,
        middle: Option<(LightCenter, GeometryOfLight)>,
        pending: &PendingLight,
        sums: &mut LightSums,
        simd: impl Simd,
    ) {
        let is_untraced = self.tile.settings.render.shadows == ShadowMode::Off;
        if is_untraced && self.aov == PathAov::TraversalCost {
            return;
        }
        // Without shadows, all light is unoccluded.
        let Some((middle, source)) = middle.filter(|_| !is_untraced) else {
            add_masked_lanes(pending.active, &pending.diffuse, &mut sums.diffuse);
            return add_masked_lanes(pending.active, &pending.light, &mut sums.light);
        };
        let fraction = self.splits_lobes.then(|| divide_lanes_or_zero(&pending.diffuse, &pending.light));
        // Aim a ray at the light's center.
        let (mut direction, mut ends) = ([[0.0; PACKET_SIZE]; 3], [-1.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let from = lane(&self.row.from, i);
            let ray = match middle {
                LightCenter::At(middle) => Ray::segment_ending_before_point(from, middle),
                LightCenter::Towards(direction) => Ray::new(from, direction),
            };
            set_lane(&mut direction, i, ray.direction);
            ends[i] = ray.t_max;
        }
        let traced = pending.active & !self.row.below_horizon_mask(&direction, simd);
        for i in 0..PACKET_SIZE {
            ends[i] = if traced & 1 << i != 0 { ends[i] } else { -1.0 };
        }
        let rays = RayPacket::from_soa(self.row.from, direction)
            .with_start_triangles(self.row.ray_start_triangles(&direction));
        self.trace_and_add_light(
            (&rays, &ends, traced),
            &GeometryOfLightPacket::splat(source),
            (&pending.light, fraction.as_ref()),
            sums,
            simd,
        );
    }

    /// Traces the shadow rays in `traced` and adds the light that arrives along the unoccluded rays. Rays
    /// that are not traced have a `t_max` below 0.
    #[inline(always)]
    pub fn trace_and_add_light(
        &self,
        (rays, ends, traced): (&RayPacket, &F32x16, u32),
        sources: &GeometryOfLightPacket,
        (values, fraction): (&Vec3x16, Option<&Vec3x16>),
        sums: &mut LightSums,
        simd: impl Simd,
    ) {
        sums.rays.shadow += u64::from(traced.count_ones());
        if self.aov == PathAov::TraversalCost {
            return add_traversal_cost(self.tile, rays, ends, traced, &mut sums.light);
        }
        if self.tile.world.has_null_interaction_surfaces() {
            return self.add_attenuated_light((rays, ends, traced), sources, (values, fraction), sums);
        }
        let occluded = self.tile.world.geometry.occluded_ray_mask(rays, ends, traced, sources, simd);
        add_masked_lanes(traced & !occluded, values, &mut sums.light);
        if let Some(fraction) = fraction {
            add_masked_lane_products(traced & !occluded, values, fraction, &mut sums.diffuse);
        }
    }

    /// Like [`SampleAllLights::trace_and_add_light`], for scenes with null interactions, where shadow
    /// rays have a transmittance.
    #[cold]
    #[inline(never)]
    fn add_attenuated_light(
        &self,
        (rays, ends, traced): (&RayPacket, &F32x16, u32),
        sources: &GeometryOfLightPacket,
        (values, fraction): (&Vec3x16, Option<&Vec3x16>),
        sums: &mut LightSums,
    ) {
        let weakened = self.tile.world.transmittance_packet(rays, ends, traced, sources);
        sums.rays.lookups += weakened.lookups;
        let mut values = *values;
        let arriving = traced & !weakened.occluded;
        for i in set_bit_lanes(arriving) {
            let value = lane(&values, i) * convert_transmittance_for_aov(lane(&weakened.left, i), self.aov);
            set_lane(&mut values, i, value);
        }
        add_masked_lanes(arriving, &values, &mut sums.light);
        if let Some(fraction) = fraction {
            add_masked_lane_products(arriving, &values, fraction, &mut sums.diffuse);
        }
    }

    /// Returns the unoccluded contribution of each sample, the mask of nonzero contributions, and the
    /// vertices' BSDF responses.
    #[inline(always)]
    pub fn contributions_before_occlusion(
        &self,
        samples: &LightSamplePacket,
        share: f32,
        simd: impl Simd,
    ) -> (Vec3x16, u32, BsdfValuesAndCosines) {
        let response = self.row.evaluate_bsdf_and_cosines(&samples.directions, simd);
        let BsdfValuesAndCosines { bsdf, cosines } = &response;
        let f = bsdf.f();
        let mut arriving = samples.weights;
        if self.aov == PathAov::LitFraction {
            for i in 0..PACKET_SIZE {
                let light = Vec3::splat(luminance(lane(&samples.weights, i)));
                set_lane(&mut arriving, i, light);
            }
        }
        let (mut values, mut active) = (f, [0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let value = lane(&f, i) * lane(&arriving, i) * (cosines[i] * share);
            set_lane(&mut values, i, value);
            let contributes = (cosines[i] > 0.0) & ((value.x != 0.0) | (value.y != 0.0) | (value.z != 0.0));
            active[i] = if contributes { TRUE } else { 0 };
        }
        if let Some(interior_lists) = self.interior_lists.filter(|_| self.aov != PathAov::LitFraction) {
            values = self.attenuate_by_media(interior_lists, samples, values);
        }
        (values, simd.movemask(&active) & self.used, response)
    }

    /// Returns shadow rays to the samples in `active`. In other lanes, `t_max` is below 0.
    #[inline(always)]
    pub fn shadow_rays(&self, samples: &LightSamplePacket, active: u32) -> (RayPacket, F32x16) {
        let (mut direction, mut ends) = (samples.directions, [-1.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let ray = Ray::segment_ending_before_point(lane(&self.row.from, i), lane(&samples.targets, i));
            set_lane(&mut direction, i, ray.direction);
            ends[i] = if active & 1 << i != 0 { ray.t_max } else { -1.0 };
        }
        for i in set_bit_lanes(samples.beyond & active) {
            set_lane(&mut direction, i, lane(&samples.directions, i));
            ends[i] = f32::INFINITY;
        }
        (
            RayPacket::from_soa(self.row.from, direction)
                .with_start_triangles(self.row.ray_start_triangles(&direction)),
            ends,
        )
    }
}

/// Adds the traversal cost of the rays in `traced` up to their ends.
#[cold]
#[inline(never)]
pub fn add_traversal_cost(
    tile: &TileContext<'_>,
    rays: &RayPacket,
    ends: &F32x16,
    traced: u32,
    sums: &mut Vec3x16,
) {
    for i in set_bit_lanes(traced) {
        let work = tile.world.geometry.ray_traversal_cost(&Ray { t_max: ends[i], ..rays.ray(i) });
        let sum = lane(sums, i) + Vec3::splat(work as f32);
        set_lane(sums, i, sum);
    }
}

/// Converts the transmittance of null interactions to its luminance if the light AOV needs only luminance.
pub fn convert_transmittance_for_aov(left: Vec3, aov: PathAov) -> Vec3 {
    match aov {
        PathAov::Radiance(_) | PathAov::TraversalCost => left,
        PathAov::LitFraction => Vec3::splat(luminance(left)),
    }
}
