//! Gathering of photons at vertices.

use super::super::PACKET;
use super::super::lit_row::LitRow;
use super::super::shot::Shot;
use super::super::view::{Measure, Ways};
use super::PhotonMaps;
use super::chosen::Place;
use super::clip::{Clip, clip};
use super::map::{Look, PhotonMap};
use super::occlusion::is_apart;
use super::trials::inverse_part;
use crate::geometry::rows::lanes;
use crate::materials::lobes::gloss;
use crate::math::Vec3;
use crate::math::lanes::{Folds, Lanes3, lane, set_lane};
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
    pub shot: &'a Shot<'a>,
    /// The vertices.
    pub row: &'a LitRow,
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
        let Self { shot, row, maps, depth, measure } = self;
        let mut sums = [[0.0; PACKET]; 3];
        let [looks, choices] = row.sampler(shot).pairs(&row.path, Decision::Gather, 0, 1);
        let Some(most_depth) = shot.settings.render.max_depth.checked_sub(depth + 1) else { return sums };
        let Ways { caustic, indirect, .. } = measure.ways();
        for i in lanes(row.used) {
            let (_, _, sample) = shot.block.place(row.slot[i]);
            let pass = maps.pass(sample);
            let is_seen = row.seen & 1 << i != 0;
            let (point, normal) = row.place_of(i);
            let look = Look { point, normal, most_depth };
            // At a surface without a glossy lobe, photons carry the light from a caustic, and the path from there leaves it out.
            let gathers_bounced = indirect && row.albedos[1][i] == 0.0;
            let gathers_caustic = if is_seen { caustic } else { indirect && row.from_gloss & 1 << i != 0 };
            let chances = if measure == Measure::Work {
                [1.0; 2]
            } else if is_seen {
                [1.0, LOOKS_BOUNCED]
            } else {
                [LOOKS_UNSEEN; 2]
            };
            let maps = [(gathers_caustic, &pass.caustic), (gathers_bounced, &pass.bounced)];
            let mut sum = Vec3::ZERO;
            for ((gathers, map), chance) in maps.into_iter().zip(chances) {
                if gathers && looks[i] < chance {
                    // The rest of the random number is random again.
                    let random = [choices[i], looks[i] / chance];
                    let (light, photon) = brought((row, i), (map, &look), measure, random, folds);
                    sum += light * (reached(shot, (row, i), &look, photon, map.radius()) / chance);
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
    shot: &Shot<'_>,
    (row, i): (&LitRow, usize),
    look: &Look,
    photon: Option<Place>,
    radius: f32,
) -> f32 {
    let Some(photon) = photon else { return 1.0 };
    match clip(shot.world, look, radius) {
        Clip::Part(part) => 1.0 / part,
        Clip::Cut | Clip::Crowded if is_apart(&shot.world.geometry, look, &photon, radius) => 0.0,
        by_trials @ (Clip::Cut | Clip::Crowded) => {
            let sampler = shot.sampler(row.slot[i]);
            let pair = |number| sampler.pair(row.path[i], Decision::Trial(number));
            inverse_part(shot.world, look, radius, by_trials, pair)
        }
    }
}

/// Light of a map's photons at a vertex that is reflected towards the camera, and one of the photons.
#[inline(always)]
fn brought(
    (row, i): (&LitRow, usize),
    (map, look): (&PhotonMap, &Look),
    measure: Measure,
    random: [f32; 2],
    folds: impl Folds,
) -> (Vec3, Option<Place>) {
    let (diffuse, specular) = (lane(&row.diffuse, i), lane(&row.specular, i));
    if measure == Measure::Work {
        (Vec3::splat(map.count_around(look, folds) as f32), None)
    } else if specular == Vec3::ZERO && row.apart & 1 << i == 0 {
        let (irradiance, photon) = map.irradiance(look, random, folds);
        (diffuse * irradiance, photon)
    } else {
        reflected((row, i), (map, look), random, folds)
    }
}

/// [`Gathering::brought`], with each photon weighted by its direction.
#[inline(always)]
fn reflected(
    (row, i): (&LitRow, usize),
    (map, look): (&PhotonMap, &Look),
    random: [f32; 2],
    folds: impl Folds,
) -> (Vec3, Option<Place>) {
    let (diffuse, specular) = (lane(&row.diffuse, i), lane(&row.specular, i));
    let (mirrored, shininess) = (lane(&row.mirrored_eye, i), row.shininess[i]);
    let (mut sum, mut total, mut left, mut chosen) = (Vec3::ZERO, 0.0, random[0], None);
    map.visit(look, folds, |photon, density| {
        let mut f = diffuse;
        if specular != Vec3::ZERO {
            f += specular * gloss(mirrored, photon.direction, shininess);
        }
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
