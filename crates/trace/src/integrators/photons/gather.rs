//! Density estimation: gathers photons at vertices.

use super::PhotonPassesBySample;
use super::coverage::{KernelCoverage, kernel_coverage};
use super::map::{GatherPoint, PhotonMap};
use super::occlusion::is_photon_occluded;
use super::reservoir::PhotonPositionAndNormal;
use super::trials::inverse_coverage;
use crate::geometry::packet::set_bit_lanes;
use crate::integrators::PACKET_SIZE;
use crate::integrators::transport::batch::VertexBatch;
use crate::integrators::transport::tile::TileContext;
use crate::integrators::view::{PathAov, PathClasses};
use crate::math::Vec3;
use crate::math::lanes::{Simd, Vec3x16, set_lane};
use crate::sampling::Dimension;
use crate::world::SimdKernel;

/// Probability of a lookup at a vertex that the camera does not see. A path has many such vertices, and
/// photon lookups at them contribute little noise.
const INDIRECT_LOOKUP_PROBABILITY: f32 = 0.25;

/// Probability of looking up bounced photons at a vertex that the camera sees. Bounced light is weak and
/// smooth.
const BOUNCED_LOOKUP_PROBABILITY: f32 = 0.5;

/// Gathers photons at a packet of vertices that their paths reach after `depth` bounces. Returns the light
/// reflected toward the viewer, before multiplication by the path throughput, and the part from wide lobes,
/// which is 0 unless `splits_lobes`.
pub fn gather_photons(
    tile: &TileContext<'_>,
    row: &VertexBatch,
    maps: &PhotonPassesBySample,
    depth: u32,
    (aov, splits_lobes): (PathAov, bool),
) -> [Vec3x16; 2] {
    let kernel = GatherPhotonsKernel { tile, row, maps, depth, aov, splits_lobes };
    tile.world.geometry.instruction_set().run(kernel)
}

/// Kernel of [`gather_photons`].
struct GatherPhotonsKernel<'a> {
    tile: &'a TileContext<'a>,
    row: &'a VertexBatch,
    maps: &'a PhotonPassesBySample,
    depth: u32,
    aov: PathAov,
    splits_lobes: bool,
}

impl SimdKernel for GatherPhotonsKernel<'_> {
    type Output = [Vec3x16; 2];

    #[inline(always)]
    fn run(self, simd: impl Simd) -> [Vec3x16; 2] {
        let Self { tile, row, maps, depth, aov, splits_lobes } = self;
        let mut sums = [[[0.0; PACKET_SIZE]; 3]; 2];
        let [looks, choices] = row.sampler_packet(tile).pairs(&row.path, Dimension::Gather, 0, 1);
        let Some(max_depth) = tile.settings.render.max_depth.checked_sub(depth + 1) else { return sums };
        let PathClasses { caustic, indirect, .. } = aov.path_classes();
        let narrow = row.bsdf.narrow_lobe_mask();
        for i in set_bit_lanes(row.used) {
            let (_, _, sample) = tile.block.pixel_and_sample(row.slot[i]);
            let pass = maps.pass_for_sample(sample);
            let only_specular_before = row.only_specular_before & 1 << i != 0;
            let (point, normal) = row.surface_point_and_normal(i);
            // Select the maps that contribute at the vertex.
            let look = GatherPoint { point, normal, max_depth };
            // Without a glossy lobe, bounced photons account for light from caustics, and continuing paths
            // ignore it.
            let gathers_bounced = indirect && narrow & 1 << i == 0;
            let gathers_caustic =
                if only_specular_before { caustic } else { indirect && row.after_gloss & 1 << i != 0 };
            // Determine the lookup probabilities.
            let chances = if aov == PathAov::TraversalCost {
                [1.0; 2]
            } else if only_specular_before {
                [1.0, BOUNCED_LOOKUP_PROBABILITY]
            } else {
                [INDIRECT_LOOKUP_PROBABILITY; 2]
            };
            // Add the photons' light, unless it is occluded.
            let maps = [(gathers_caustic, &pass.caustic), (gathers_bounced, &pass.bounced)];
            let mut sum = [Vec3::ZERO; 2];
            for ((gathers, map), chance) in maps.into_iter().zip(chances) {
                if gathers && looks[i] < chance {
                    // Rescale the random number for reuse.
                    let random = [choices[i], looks[i] / chance];
                    let (light, photon) =
                        gather_reflected_light((row, i), (map, &look), (aov, splits_lobes), random, simd);
                    let factor = coverage_factor(tile, (row, i), &look, photon, map.radius()) / chance;
                    sum[0] += light[0] * factor;
                    if splits_lobes {
                        sum[1] += light[1] * factor;
                    }
                }
            }
            set_lane(&mut sums[0], i, sum[0]);
            if splits_lobes {
                set_lane(&mut sums[1], i, sum[1]);
            }
        }
        sums
    }
}

/// Coverage correction factor for the light in a kernel. `photon` is one of the kernel's photons. If the
/// coverage p is known, the factor is 1/p. Otherwise, it is 0 if the photon is occluded and an estimate of
/// 1/p if it is not.
#[inline(never)]
fn coverage_factor(
    tile: &TileContext<'_>,
    (row, i): (&VertexBatch, usize),
    look: &GatherPoint,
    photon: Option<PhotonPositionAndNormal>,
    radius: f32,
) -> f32 {
    let Some(photon) = photon else { return 1.0 };
    match kernel_coverage(tile.world, look, radius) {
        KernelCoverage::Fraction(part) => 1.0 / part,
        KernelCoverage::Clipped | KernelCoverage::Crowded
            if is_photon_occluded(&tile.world.geometry, look, &photon, radius) =>
        {
            0.0
        }
        by_trials @ (KernelCoverage::Clipped | KernelCoverage::Crowded) => {
            let sampler = tile.sampler_for_slot(row.slot[i]);
            let pair = |number| sampler.pair(row.path[i], Dimension::Trial(number));
            inverse_coverage(tile.world, look, radius, by_trials, pair)
        }
    }
}

/// Returns the light from a map's photons that a vertex reflects toward the viewer, the part of this light
/// that is from wide lobes (arbitrary unless `splits_lobes`), and one of the photons.
#[inline(always)]
fn gather_reflected_light(
    (row, i): (&VertexBatch, usize),
    (map, look): (&PhotonMap, &GatherPoint),
    (aov, splits_lobes): (PathAov, bool),
    random: [f32; 2],
    simd: impl Simd,
) -> ([Vec3; 2], Option<PhotonPositionAndNormal>) {
    if aov == PathAov::TraversalCost {
        return ([Vec3::splat(map.count_near(look, simd) as f32); 2], None);
    }
    let is_flat = row.has_facet & 1 << i == 0;
    match row.bsdf.constant_f(i).filter(|_| is_flat) {
        Some(f) => {
            let (irradiance, photon) = map.irradiance_and_chosen_photon(look, random, simd);
            ([f * irradiance; 2], photon)
        }
        None => gather_with_bsdf_per_photon((row, i), (map, look), splits_lobes, random, simd),
    }
}

/// Like [`gather_reflected_light`], but evaluates the BSDF for each photon's direction.
#[inline(always)]
fn gather_with_bsdf_per_photon(
    (row, i): (&VertexBatch, usize),
    (map, look): (&PhotonMap, &GatherPoint),
    splits_lobes: bool,
    random: [f32; 2],
    simd: impl Simd,
) -> ([Vec3; 2], Option<PhotonPositionAndNormal>) {
    let (mut sum, mut total, mut left, mut chosen) = ([Vec3::ZERO; 2], 0.0, random[0], None);
    map.visit_weighted_photons(look, simd, |photon, density| {
        let [shown, wide, all] = row.bsdf.lane_f_by_lobe_set(i, photon.direction);
        let scale = density * row.adjoint_photon_weight(i, photon.direction);
        sum[0] += shown * photon.flux * scale;
        if splits_lobes {
            sum[1] += wide * photon.flux * scale;
        }
        // Choose the same photon whichever lobes are shown, so that the AOVs sum to the beauty image.
        let weight = (all * photon.flux * scale).element_sum();
        total += weight;
        // Choose a photon by reservoir sampling, as in `ReservoirPacket`.
        let part = if weight > 0.0 { weight / total } else { 0.0 };
        if left < part {
            left /= part;
            chosen = Some(PhotonPositionAndNormal { point: photon.point, normal: photon.normal });
        } else {
            left = (left - part) / (1.0 - part);
        }
    });
    (sum, chosen)
}
