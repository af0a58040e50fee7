//! Rays in the narrow lobes of vertices that find the light of lamps beside light samples.

use super::all_lights::{Arrived, add_work};
use super::unshadowed::Unshadowed;
use crate::geometry::rows::{RayRows, lanes};
use crate::integrators::transport::batch::{Response, VertexBatch};
use crate::integrators::transport::medium::{Media, absorption};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::view::Measure;
use crate::materials::bsdf::LobeSet;
use crate::math::Vec3;
use crate::math::lanes::{Folds, LANES, lane, set_lane};
use crate::sampling::Decision;
use crate::scene::description::Shadows;
use crate::world::{Hit, Loops};

/// Traces rays in the glossy lobes of the vertices whose bits are set, as many as samples of a lamp: a narrow lobe finds in a
/// wide lamp what light samples hardly ever hit.
pub struct LobeRays<'a> {
    pub tile: &'a TileContext<'a>,
    pub row: &'a VertexBatch,
    pub sharp: u32,
    pub measure: Measure,
    /// Media of the vertices. `None` if all are in air.
    pub media: Option<&'a Media>,
    /// Light to which the rays' light is added.
    pub arrived: Arrived,
}

impl Loops for LobeRays<'_> {
    type Done = Arrived;

    #[inline(always)]
    fn run(self, folds: impl Folds) -> Arrived {
        let Self { tile, row, sharp, measure, media, mut arrived } = self;
        let count = tile.settings.render.shadow_samples;
        let sampler = row.sampler(tile);
        let transmittance = |i: usize, distance: f32| {
            media.map_or(Vec3::ONE, |media| absorption(tile.world, &media.get(row.medium[i]), distance))
        };
        for repetition in 0..count {
            // Sample a direction in each lobe.
            let u = sampler.pairs(&row.path, Decision::Direction, repetition, count);
            let mut choices = [0.0; LANES];
            if row.bsdf.sends_rays() {
                [choices, _] = sampler.pairs(&row.path, Decision::Lobe, repetition, count);
            }
            let directions = row.bsdf.sample(LobeSet::Narrow, &row.normal, &choices, &u, folds);
            let Response { bsdf, cosines } = row.response(&directions, folds);
            let densities = row.bsdf.pdf(LobeSet::Narrow, &row.normal, &directions, &bsdf, folds);
            let [_, narrow] = row.bsdf.parts(&directions, &bsdf, folds);
            // Trace the rays above the surfaces.
            let mut sent = sharp & !row.hidden(&directions, folds);
            let mut ends = [-1.0; LANES];
            for i in 0..LANES {
                let bit = 1 << i;
                sent &= if (cosines[i] > 0.0) & (densities[i] > 0.0) { !0 } else { !bit };
                ends[i] = if sent & bit != 0 { f32::INFINITY } else { -1.0 };
            }
            let rays = RayRows::of(row.from, directions).leaving(row.starts(&directions));
            arrived.rays.scattered += u64::from(sent.count_ones());
            // Without soft shadows, add the light of each lamp on the rays, whatever is before it.
            if tile.settings.render.shadows != Shadows::Soft {
                // Their work is that of the rays to the middles.
                let lit = if measure == Measure::Work { 0 } else { sent };
                for i in lanes(lit) {
                    let found = Unshadowed { tile, row, lane: i, ray: rays.ray(i), density: densities[i] };
                    let radiance = found.radiance(|distance| transmittance(i, distance), &mut arrived.rays);
                    let value = lane(&narrow, i) * radiance * (cosines[i] / (densities[i] * count as f32));
                    let sum = lane(&arrived.light, i) + value;
                    set_lane(&mut arrived.light, i, sum);
                }
                continue;
            }
            let (hits, objects) = tile.world.geometry.closest_rows(&rays, &mut ends, sent, folds);
            // Count the work of the rays, if the view shows it.
            if measure == Measure::Work {
                for i in lanes(sent) {
                    ends[i] = hits.get(i).map_or(f32::INFINITY, |hit| hit.t);
                }
                add_work(tile, &rays, &ends, sent, &mut arrived.light);
                continue;
            }
            // Add the light of lamps that they find.
            for i in lanes(sent) {
                let density = densities[i];
                let lookups = &mut arrived.rays.lookups;
                let radiance = match hits.get(i) {
                    hit if tile.world.has_passable() => {
                        let hit = hit.map(|shape| Hit { shape, object: objects[i] });
                        let (ray, normal) = (rays.ray(i), lane(&row.normal, i));
                        let left = |distance| transmittance(i, distance);
                        tile.radiance_straight_on((&ray, hit), normal, density, left, lookups)
                    }
                    Some(shape) => {
                        let hit = Hit { shape, object: objects[i] };
                        let normal = lane(&row.normal, i);
                        let radiance = tile.lamp_radiance(&rays.ray(i), normal, &hit, density, lookups);
                        radiance * transmittance(i, hit.shape.t)
                    }
                    None => {
                        let radiance = tile.radiance_beyond(&rays.ray(i), lane(&row.normal, i), density);
                        radiance * transmittance(i, f32::MAX)
                    }
                };
                let f = lane(&narrow, i);
                let value = f * radiance * (cosines[i] / (density * count as f32));
                let sum = lane(&arrived.light, i) + value;
                set_lane(&mut arrived.light, i, sum);
            }
        }
        arrived
    }
}
