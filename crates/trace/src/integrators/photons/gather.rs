//! Gathering of photons at vertices.

use super::PhotonMaps;
use super::clip::{Clip, clip};
use super::map::{GatherPoint, PhotonMap};
use super::occlusion::is_occluded;
use super::reservoir::Place;
use super::trials::inverse_part;
use crate::geometry::rows::lanes;
use crate::integrators::PACKET;
use crate::integrators::transport::batch::VertexBatch;
use crate::integrators::transport::tile::TileContext;
use crate::integrators::view::{Measure, Ways};
use crate::math::Vec3;
use crate::math::lanes::{Folds, Lanes3, set_lane};
use crate::sampling::Decision;
use crate::world::Loops;

/// Probability of a look-up at a vertex that the camera does not see: a path has many such vertices, and photons there cause little
/// of its noise.
const LOOKS_UNSEEN: f32 = 0.25;

/// Probability of a look-up of bounced photons at a vertex that the camera sees: they bring little light, and smooth light.
const LOOKS_BOUNCED: f32 = 0.5;

/// Gathers photons at the vertices of a row.
pub struct Gathering<'a> {
    /// Context of the tile.
    pub tile: &'a TileContext<'a>,
    /// The vertices.
    pub row: &'a VertexBatch,
    /// The maps of the samples that are rendered.
    pub maps: &'a PhotonMaps,
    /// Scatterings of the paths before the vertices.
    pub depth: u32,
    /// Measure of light to gather.
    pub measure: Measure,
}

impl Loops for Gathering<'_> {
    type Done = Lanes3;

    /// Gathered light that is reflected towards the camera, before the throughput of the paths.
    #[inline(always)]
    fn run(self, folds: impl Folds) -> Lanes3 {
        let Self { tile, row, maps, depth, measure } = self;
        let mut sums = [[0.0; PACKET]; 3];
        let [looks, choices] = row.sampler(tile).pairs(&row.path, Decision::Gather, 0, 1);
        let Some(most_depth) = tile.settings.render.max_depth.checked_sub(depth + 1) else { return sums };
        let Ways { caustic, indirect, .. } = measure.ways();
        let narrow = row.bsdf.narrow_lobes();
        for i in lanes(row.used) {
            let (_, _, sample) = tile.block.place(row.slot[i]);
            let pass = maps.pass(sample);
            let only_specular_before = row.only_specular_before & 1 << i != 0;
            let (point, normal) = row.place_of(i);
            // Choose the maps that hold light for the vertex.
            let look = GatherPoint { point, normal, most_depth };
            // At a surface without a glossy lobe, photons carry the light from a caustic, and the path from there leaves it out.
            let gathers_bounced = indirect && narrow & 1 << i == 0;
            let gathers_caustic =
                if only_specular_before { caustic } else { indirect && row.after_gloss & 1 << i != 0 };
            // Choose the maps to look up by chance.
            let chances = if measure == Measure::Work {
                [1.0; 2]
            } else if only_specular_before {
                [1.0, LOOKS_BOUNCED]
            } else {
                [LOOKS_UNSEEN; 2]
            };
            // Add their light, if the ways to the photons are free.
            let maps = [(gathers_caustic, &pass.caustic), (gathers_bounced, &pass.bounced)];
            let mut sum = Vec3::ZERO;
            for ((gathers, map), chance) in maps.into_iter().zip(chances) {
                if gathers && looks[i] < chance {
                    // The rest of the random number is random again.
                    let random = [choices[i], looks[i] / chance];
                    let (light, photon) = brought((row, i), (map, &look), measure, random, folds);
                    sum += light * (reached(tile, (row, i), &look, photon, map.radius()) / chance);
                }
            }
            set_lane(&mut sums, i, sum);
        }
        sums
    }
}

/// Factor on the light of the photons of a kernel, given one of them: 0 if that one is behind a wall, else the inverse of the part
/// of the kernel that receives photons, or an estimate of it.
#[inline(never)]
fn reached(
    tile: &TileContext<'_>,
    (row, i): (&VertexBatch, usize),
    look: &GatherPoint,
    photon: Option<Place>,
    radius: f32,
) -> f32 {
    let Some(photon) = photon else { return 1.0 };
    match clip(tile.world, look, radius) {
        Clip::Part(part) => 1.0 / part,
        Clip::Cut | Clip::Crowded if is_occluded(&tile.world.geometry, look, &photon, radius) => 0.0,
        by_trials @ (Clip::Cut | Clip::Crowded) => {
            let sampler = tile.sampler(row.slot[i]);
            let pair = |number| sampler.pair(row.path[i], Decision::Trial(number));
            inverse_part(tile.world, look, radius, by_trials, pair)
        }
    }
}

/// Light of a map's photons at a vertex that is reflected towards the camera, and one of the photons.
#[inline(always)]
fn brought(
    (row, i): (&VertexBatch, usize),
    (map, look): (&PhotonMap, &GatherPoint),
    measure: Measure,
    random: [f32; 2],
    folds: impl Folds,
) -> (Vec3, Option<Place>) {
    if measure == Measure::Work {
        return (Vec3::splat(map.count_around(look, folds) as f32), None);
    }
    let is_flat = row.has_facet & 1 << i == 0;
    match row.bsdf.even(i).filter(|_| is_flat) {
        Some(f) => {
            let (irradiance, photon) = map.irradiance(look, random, folds);
            (f * irradiance, photon)
        }
        None => reflected((row, i), (map, look), random, folds),
    }
}

/// [`Gathering::brought`], with each photon weighted by its direction.
#[inline(always)]
fn reflected(
    (row, i): (&VertexBatch, usize),
    (map, look): (&PhotonMap, &GatherPoint),
    random: [f32; 2],
    folds: impl Folds,
) -> (Vec3, Option<Place>) {
    let (mut sum, mut total, mut left, mut chosen) = (Vec3::ZERO, 0.0, random[0], None);
    map.visit(look, folds, |photon, density| {
        let f = row.bsdf.f_at(i, photon.direction);
        let light = f * photon.flux * (density * row.landed(i, photon.direction));
        sum += light;
        let weight = light.element_sum();
        total += weight;
        // Choose as `Choices` does.
        let part = if weight > 0.0 { weight / total } else { 0.0 };
        if left < part {
            left /= part;
            chosen = Some(Place { point: photon.point, normal: photon.normal });
        } else {
            left = (left - part) / (1.0 - part);
        }
    });
    (sum, chosen)
}
