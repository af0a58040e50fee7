//! What photons bring to vertices.

use super::super::PACKET;
use super::super::lit_row::LitRow;
use super::super::shot::Shot;
use super::super::view::{Measure, Ways};
use super::PhotonMaps;
use super::map::Photon;
use crate::geometry::rows::lanes;
use crate::materials::lobes::gloss;
use crate::math::Vec3;
use crate::math::lanes::{Folds, Lanes3, lane, set_lane};
use crate::sampling::Decision;
use crate::world::Loops;

/// The chance of a look-up at a vertex that the eye does not see: a path has many of them, and little of its noise is of what they bring.
const LOOKS_UNSEEN: f32 = 0.25;

/// Gathers photons at the vertices of a row.
pub struct Gathering<'a> {
    /// What is rendered.
    pub shot: &'a Shot<'a>,
    /// The vertices.
    pub row: &'a LitRow,
    /// The maps of the samples that are rendered.
    pub maps: &'a PhotonMaps,
    /// Scatterings of the paths before them.
    pub depth: u32,
    /// What is asked for.
    pub measure: Measure,
}

impl Loops for Gathering<'_> {
    type Done = Lanes3;

    /// What arrives there and goes on to the eye, before the throughput of the paths.
    #[inline(always)]
    fn run(self, _: impl Folds) -> Lanes3 {
        let Self { shot, row, maps, depth, measure } = self;
        let mut sums = [[0.0; PACKET]; 3];
        let looks = if row.used & !row.seen == 0 || measure == Measure::Work {
            [0.0; PACKET]
        } else {
            let [looks, _] = row.sampler(shot).pairs(&row.path, Decision::Gather, 0, 1);
            looks
        };
        let Some(most_depth) = shot.settings.render.max_depth.checked_sub(depth + 1) else { return sums };
        let Ways { caustic, indirect, .. } = measure.ways();
        for i in lanes(row.used) {
            let (_, _, sample) = shot.block.place(row.slot[i]);
            let pass = maps.pass(sample);
            let is_seen = row.seen & 1 << i != 0;
            if !is_seen && !(looks[i] < LOOKS_UNSEEN) {
                continue;
            }
            let place = row.place_of(i);
            // At a surface without a glossy lobe photons stand for what comes from a caustic, and the path from there leaves it out.
            let gathers_bounced = row.albedos[1][i] == 0.0;
            let gathers_caustic = if is_seen { caustic } else { indirect && row.from_gloss & 1 << i != 0 };
            let maps = [
                gathers_caustic.then_some(&pass.caustic),
                (indirect && gathers_bounced).then_some(&pass.bounced),
            ];
            let (diffuse, specular) = (lane(&row.diffuse, i), lane(&row.specular, i));
            let (mirrored, shininess) = (lane(&row.mirrored_eye, i), row.shininess[i]);
            let mut sum = Vec3::ZERO;
            for map in maps.into_iter().flatten() {
                if measure == Measure::Work {
                    map.visit(place, most_depth, |_, _| sum += Vec3::ONE);
                    continue;
                }
                map.visit(place, most_depth, |photon: &Photon, density| {
                    let mut f = diffuse;
                    if specular != Vec3::ZERO {
                        f += specular * gloss(mirrored, photon.direction, shininess);
                    }
                    sum += f * photon.flux * (density * row.landed(i, photon.direction));
                });
            }
            let counts = if is_seen || measure == Measure::Work { 1.0 } else { 1.0 / LOOKS_UNSEEN };
            set_lane(&mut sums, i, sum * counts);
        }
        sums
    }
}
