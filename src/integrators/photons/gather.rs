//! What photons bring to vertices.

use super::super::PACKET;
use super::super::lit_row::LitRow;
use super::super::shot::Shot;
use super::super::view::{Measure, Ways};
use super::PhotonMaps;
use super::map::{Photon, Way};
use crate::geometry::rows::lanes;
use crate::materials::lobes::gloss;
use crate::math::Vec3;
use crate::math::lanes::{Lanes3, lane, set_lane};
use crate::world::Loops;

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
    fn run(self) -> Lanes3 {
        let Self { shot, row, maps, depth, measure } = self;
        let mut sums = [[0.0; PACKET]; 3];
        let Some(most_depth) = shot.settings.render.max_depth.checked_sub(depth + 1) else { return sums };
        let Ways { caustic, indirect, .. } = measure.ways();
        for i in lanes(row.used) {
            let (_, _, sample) = shot.block.place(row.slot[i]);
            let pass = maps.pass(sample);
            let is_seen = row.seen & 1 << i != 0;
            let place = row.place_of(i);
            // What comes from a caustic by one more surface arrives nearly everywhere, from a small place: a step would hardly ever find
            // it. At surfaces without a glossy lobe photons stand for it, and the step leaves it out.
            let by_photons = row.albedos[1][i] == 0.0;
            let without_caustics = row.from_gloss & 1 << i == 0;
            let (diffuse, specular) = (lane(&row.diffuse, i), lane(&row.specular, i));
            let maps = if is_seen {
                let bounced = indirect && by_photons;
                [caustic.then_some((&pass.caustic, false)), bounced.then_some((&pass.bounced, false))]
            } else {
                [indirect.then_some((&pass.all, without_caustics)), None]
            };
            let (mirrored, shininess) = (lane(&row.mirrored_eye, i), row.shininess[i]);
            let mut sum = Vec3::ZERO;
            for (map, leaves_caustics_out) in maps.into_iter().flatten() {
                if measure == Measure::Work {
                    map.visit(place, most_depth, |_, _| sum += Vec3::ONE);
                    continue;
                }
                map.visit(place, most_depth, |photon: &Photon, density| {
                    if leaves_caustics_out && photon.way == Way::Caustic {
                        return;
                    }
                    let mut f = diffuse;
                    if specular != Vec3::ZERO {
                        f += specular * gloss(mirrored, photon.direction, shininess);
                    }
                    sum += f * photon.flux * (density * row.landed(i, photon.direction));
                });
            }
            set_lane(&mut sums, i, sum);
        }
        sums
    }
}
