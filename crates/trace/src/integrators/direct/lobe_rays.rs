//! Rays in narrow lobes, which complement light samples.

use super::all_lights::add_traversal_cost;
use super::light_sums::LightSums;
use super::unshadowed::LobeRayWithoutSoftShadows;
use crate::geometry::packet::{RayPacket, set_bit_lanes};
use crate::integrators::transport::batch::{BsdfValuesAndCosines, VertexBatch};
use crate::integrators::transport::interiors::{InteriorListPool, medium_transmittance};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::view::PathAov;
use crate::materials::bsdf::LobesToSample;
use crate::math::Vec3;
use crate::math::lanes::{PACKET_SIZE, Simd, lane, set_lane};
use crate::sampling::Dimension;
use crate::scene::description::ShadowMode;
use crate::world::{Hit, SimdKernel};

/// Traces rays in the glossy lobes of the vertices in `sharp`, one per light sample, because samples on a
/// large light rarely fall into a narrow lobe.
pub struct LobeRayTracingKernel<'a> {
    /// The tile being rendered.
    pub tile: &'a TileContext<'a>,
    /// The vertices.
    pub row: &'a VertexBatch,
    /// Mask of vertices with narrow lobes.
    pub sharp: u32,
    /// The AOV to compute.
    pub aov: PathAov,
    /// Media at the vertices, or `None` if all vertices are in air.
    pub interior_lists: Option<&'a InteriorListPool>,
    /// Reflected light, to which the kernel adds the light found by the rays.
    pub sums: &'a mut LightSums,
}

impl LobeRayTracingKernel<'_> {
    /// Traces the rays and adds the light they find to `sums`.
    pub fn trace(self) {
        self.tile.world.geometry.instruction_set().run(self);
    }
}

impl SimdKernel for LobeRayTracingKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: impl Simd) {
        let Self { tile, row, sharp, aov, interior_lists, sums } = self;
        let count = tile.settings.render.shadow_samples;
        let sampler = row.sampler_packet(tile);
        let transmittance = |i: usize, distance: f32| {
            interior_lists.map_or(Vec3::ONE, |interior_lists| {
                medium_transmittance(tile.world, &interior_lists.get(row.interiors[i]), distance)
            })
        };
        for repetition in 0..count {
            // Sample a direction in each lobe.
            let u = sampler.pairs(&row.path, Dimension::Direction, repetition, count);
            let mut choices = [0.0; PACKET_SIZE];
            if row.bsdf.extends_narrow_lobe_paths() {
                [choices, _] = sampler.pairs(&row.path, Dimension::Lobe, repetition, count);
            }
            let wi = row.bsdf.sample(LobesToSample::Narrow, &row.normal, &choices, &u, simd);
            let BsdfValuesAndCosines { bsdf, cosines } = row.evaluate_bsdf_and_cosines(&wi, simd);
            let pdfs = row.bsdf.pdf(LobesToSample::Narrow, &row.normal, &wi, &bsdf, simd);
            let narrow = &bsdf.narrow;
            // Select the rays above the horizon.
            let mut sent = sharp & !row.below_horizon_mask(&wi, simd);
            let mut ends = [-1.0; PACKET_SIZE];
            for i in 0..PACKET_SIZE {
                let bit = 1 << i;
                sent &= if (cosines[i] > 0.0) & (pdfs[i] > 0.0) { !0 } else { !bit };
                ends[i] = if sent & bit != 0 { f32::INFINITY } else { -1.0 };
            }
            let rays = RayPacket::from_soa(row.from, wi).with_start_triangles(row.ray_start_triangles(&wi));
            sums.rays.scattered += u64::from(sent.count_ones());
            // Without soft shadows, add the light from every emitter along the rays, even if the emitter is
            // occluded.
            if tile.settings.render.shadows != ShadowMode::Soft {
                // Traversal cost is counted only for the rays to the lights' centers.
                let lit = if aov == PathAov::TraversalCost { 0 } else { sent };
                for i in set_bit_lanes(lit) {
                    let found =
                        LobeRayWithoutSoftShadows { tile, row, lane: i, ray: rays.ray(i), pdf: pdfs[i] };
                    let radiance = found.radiance(|distance| transmittance(i, distance), &mut sums.rays);
                    let value = lane(narrow, i) * radiance * (cosines[i] / (pdfs[i] * count as f32));
                    let sum = lane(&sums.light, i) + value;
                    set_lane(&mut sums.light, i, sum);
                }
                continue;
            }
            let (hits, objects) = tile.world.geometry.closest_hit_packet_simd(&rays, &mut ends, sent, simd);
            // If the view shows the traversal cost, add the cost of the rays.
            if aov == PathAov::TraversalCost {
                for i in set_bit_lanes(sent) {
                    ends[i] = hits.get(i).map_or(f32::INFINITY, |hit| hit.t);
                }
                add_traversal_cost(tile, &rays, &ends, sent, &mut sums.light);
                continue;
            }
            // Add the light found by the rays.
            for i in set_bit_lanes(sent) {
                let pdf = pdfs[i];
                let lookups = &mut sums.rays.lookups;
                let radiance = match hits.get(i) {
                    hit if tile.world.has_null_interaction_surfaces() => {
                        let hit = hit.map(|shape| Hit { shape, object: objects[i] });
                        let (ray, normal) = (rays.ray(i), lane(&row.normal, i));
                        let left = |distance| transmittance(i, distance);
                        tile.radiance_through_null_surfaces((&ray, hit), normal, pdf, left, lookups)
                    }
                    Some(shape) => {
                        let hit = Hit { shape, object: objects[i] };
                        let normal = lane(&row.normal, i);
                        let radiance =
                            tile.lobe_ray_emitter_radiance(&rays.ray(i), normal, &hit, pdf, lookups);
                        radiance * transmittance(i, hit.shape.t)
                    }
                    None => {
                        let radiance =
                            tile.lobe_ray_radiance_from_infinity(&rays.ray(i), lane(&row.normal, i), pdf);
                        radiance * transmittance(i, f32::MAX)
                    }
                };
                let f = lane(narrow, i);
                let value = f * radiance * (cosines[i] / (pdf * count as f32));
                let sum = lane(&sums.light, i) + value;
                set_lane(&mut sums.light, i, sum);
            }
        }
    }
}
