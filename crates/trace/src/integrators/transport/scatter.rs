//! Scattering of paths at diffuse and glossy surfaces, sixteen at a time, and Russian roulette.

use super::batch::{Response, VertexBatch};
use super::cone::Cone;
use super::interface::SCATTERED;
use super::medium::Media;
use super::ray::{PathRay, PathState};
use super::tile::TileContext;
use crate::geometry::Ray;
use crate::geometry::rows::lanes;
use crate::materials::bsdf::{LobeSet, SideSamples};
use crate::math::Vec3;
use crate::math::lanes::{Folds, LANES, Lanes, Lanes3, TRUE, lane, set_lane};
use crate::sampling::Decision;
use crate::world::Loops;

/// Continuation of the paths of a round.
#[derive(Clone, Copy, Debug)]
pub struct Continuation {
    /// Whether paths go on, and would find anything: after the last scattering, only lamps.
    pub leads_on: bool,
    /// Whether Russian roulette applies.
    pub is_risked: bool,
    /// Lobes in which the paths go on.
    pub lobes: LobeSet,
}

impl Continuation {
    /// Scatterings before Russian roulette begins.
    const SURE: u32 = 3;
    /// Reciprocal of the throughput below which Russian roulette may end a path.
    const GAIN: f32 = 2.5;

    /// The continuation in these lobes from vertices after so many scatterings.
    pub fn new(tile: &TileContext<'_>, depth: u32, lobes: LobeSet) -> Self {
        let emits = || tile.world.materials.iter().any(|material| material.emission.shines());
        let max_depth = tile.settings.render.max_depth;
        let shines = || tile.world.lights.are_beyond() || emits();
        let leads_on = depth + 1 < max_depth || depth + 1 == max_depth && shines();
        Self { leads_on, is_risked: depth >= Self::SURE, lobes }
    }

    /// Survival probability of a path: in proportion to its throughput, so that all that were at risk go on with one throughput
    /// (Arvo and Kirk, *Particle Transport and Image Synthesis*, 1990). The gain is measured: see `benches/README.md`.
    #[inline(always)]
    fn chance(self, roulette_throughput: f32) -> f32 {
        if self.is_risked { (roulette_throughput * Self::GAIN).min(1.0) } else { 1.0 }
    }

    /// Russian roulette for a path after a mirror or glass. `None` if it ends; survivors are reweighted.
    pub fn russian_roulette(self, tile: &TileContext<'_>, mut path: PathRay) -> Option<PathRay> {
        let chance = self.chance(path.state.roulette_throughput);
        if chance < 1.0 {
            if !(tile.sampler(path.slot).pair(path.path, Decision::Spared).x < chance) {
                return None;
            }
            path.throughput /= chance;
            path.state.roulette_throughput /= chance;
        }
        Some(path)
    }
}

/// Scatters paths at the vertices of a row.
pub struct BsdfSampling<'a> {
    /// Context of the tile.
    pub tile: &'a TileContext<'a>,
    /// The vertices.
    pub row: &'a VertexBatch,
    /// A bit for each vertex at which paths go on.
    pub used: u32,
    /// Continuation of the paths.
    pub continuation: Continuation,
}

/// Scattered directions at the vertices of a row.
pub struct Scattered {
    /// A bit for each path that goes on.
    alive: u32,
    /// Unit directions.
    directions: Lanes3,
    /// [`Ray::start`] of the rays.
    starts: [u32; LANES],
    /// A bit for each path that goes on at the other side of its surface.
    beyond: u32,
    /// A bit for each vertex with a narrow lobe.
    narrow: u32,
    /// Their pdfs in sr⁻¹.
    densities: Lanes,
    /// Factors on the throughput.
    factors: Lanes3,
    /// Factors on [`PathState::roulette_throughput`].
    roulette_throughput: Lanes,
}

impl BsdfSampling<'_> {
    /// Adds the rays of the next round. `media` are those of the vertices; `cones` are the beams at the vertices, by place, if
    /// beams are requested.
    pub fn scatter(self, media: &Media, cones: &[Cone], next: &mut Vec<PathRay>) {
        // Scatter the vertices side by side.
        let row = self.row;
        let scattered = self.tile.world.geometry.instructions().run(self);
        let of_lobe = |density: f32| move |cone: &Cone| cone.scattered(density);
        // Make a path of each that goes on.
        next.extend(lanes(scattered.alive).map(|i| {
            let (from, medium, normal) = if scattered.beyond & 1 << i == 0 {
                (&row.from, row.medium[i], lane(&row.normal, i))
            } else {
                (&row.beyond, row.medium_beyond[i], -lane(&row.normal, i))
            };
            let mut path = PathRay {
                ray: Ray::new(lane(from, i), lane(&scattered.directions, i)).leaving(scattered.starts[i]),
                throughput: lane(&row.throughput, i) * lane(&scattered.factors, i),
                slot: row.slot[i],
                path: row.path[i],
                medium: media.get(medium),
                state: PathState {
                    density: scattered.densities[i],
                    normal,
                    roulette_throughput: scattered.roulette_throughput[i],
                    only_specular_before: false,
                    one_diffuse_before: row.only_specular_before & 1 << i != 0,
                    is_after_gloss: scattered.narrow & 1 << i != 0,
                },
                cone: cones
                    .get(row.place[i] as usize)
                    .map_or(Cone::default(), of_lobe(scattered.densities[i])),
            };
            path.path = path.next_path(SCATTERED);
            path
        }));
    }
}

impl Loops for BsdfSampling<'_> {
    type Done = Scattered;

    #[inline(always)]
    fn run(self, folds: impl Folds) -> Scattered {
        let Self { tile, row, used, continuation } = self;
        let sampler = row.sampler(tile);
        // Sample a direction for each vertex.
        let u = sampler.pairs(&row.path, Decision::Direction, 0, 1);
        let are_narrow = row.bsdf.has_narrow_lobes();
        let [lobe, _] =
            if are_narrow { sampler.pairs(&row.path, Decision::Lobe, 0, 1) } else { [[0.0; LANES]; 2] };
        let sides = if row.has_two_sides { row.bsdf.sample_sides(&lobe, &u, folds) } else { None };
        let mut scattered = match sides {
            Some(sides) => self.on_either_side(&sides, folds),
            None => self.on_own_side(&lobe, &u, folds),
        };
        scattered.alive &= used;
        // Apply Russian roulette.
        if continuation.is_risked {
            let [risk, _] = sampler.pairs(&row.path, Decision::Roulette, 0, 1);
            for i in 0..LANES {
                let chance = continuation.chance(scattered.roulette_throughput[i]);
                let bit = 1 << i;
                scattered.alive &= if risk[i] < chance { !0 } else { !bit };
                let factor = lane(&scattered.factors, i) / chance;
                set_lane(&mut scattered.factors, i, factor);
                scattered.roulette_throughput[i] /= chance;
            }
        }
        scattered
    }
}

impl BsdfSampling<'_> {
    /// Paths that go on on the sides of the vertices.
    #[inline(always)]
    fn on_own_side(&self, lobe: &Lanes, u: &[Lanes; 2], folds: impl Folds) -> Scattered {
        let Self { row, continuation, .. } = *self;
        let directions = row.bsdf.sample(continuation.lobes, &row.normal, lobe, u, folds);
        // Evaluate the BSDF and the pdf there.
        let Response { bsdf, cosines } = row.response(&directions, folds);
        let densities = row.bsdf.pdf(continuation.lobes, &row.normal, &directions, &bsdf, folds);
        let grey = row.bsdf.grey(&bsdf);
        let mut roulette_throughput = [0.0; LANES];
        let f = match continuation.lobes {
            LobeSet::All => bsdf.f,
            LobeSet::Narrow => row.bsdf.parts(&directions, &bsdf, folds)[1],
        };
        let mut factors = f;
        let mut alive = 0_u32;
        for i in 0..LANES {
            let share = cosines[i] / densities[i];
            roulette_throughput[i] = row.roulette_throughput[i] * grey[i] * share;
            let factor = lane(&f, i) * share;
            set_lane(&mut factors, i, factor);
            let brings = (factor.x > 0.0) | (factor.y > 0.0) | (factor.z > 0.0);
            let bit = 1 << i;
            alive |= if (cosines[i] > 0.0) & (densities[i] > 0.0) & brings { bit } else { 0 };
        }
        // Drop directions that certainly see nothing.
        alive &= !row.hidden(&directions, folds);
        let starts = row.starts(&directions);
        let narrow = row.bsdf.narrow_lobes();
        Scattered { alive, directions, starts, beyond: 0, narrow, densities, factors, roulette_throughput }
    }

    /// Paths that go on on either side of the surfaces.
    #[inline(always)]
    fn on_either_side(&self, samples: &SideSamples, folds: impl Folds) -> Scattered {
        let row = self.row;
        let SideSamples { directions, densities, shares, shown, beyond } = samples;
        // Soften the edges of bent normals, on the side of each direction.
        let mut sides = [1.0; LANES];
        for i in 0..LANES {
            sides[i] = if beyond[i] == 0 { 1.0 } else { -1.0 };
        }
        let left = row.softened(directions, &sides);
        let (mut factors, mut roulette_throughput) = ([[0.0; LANES]; 3], [0.0; LANES]);
        let mut alive = 0_u32;
        for i in 0..LANES {
            let share = shares[i] * left[i];
            roulette_throughput[i] = row.roulette_throughput[i] * share;
            let factor = share * shown[i];
            set_lane(&mut factors, i, Vec3::splat(factor));
            alive |= if (densities[i] > 0.0) & (factor > 0.0) { 1 << i } else { 0 };
        }
        // Drop directions behind the facets; rays between two sides start on none.
        let mut hidden = [0; LANES];
        for i in 0..LANES {
            let cosine = lane(&row.horizon, i).dot(lane(directions, i)) * sides[i];
            hidden[i] = if cosine > 0.0 { 0 } else { TRUE };
        }
        alive &= !(folds.bits(&hidden) & row.is_bounded);
        Scattered {
            alive,
            directions: *directions,
            starts: [Ray::NO_TRIANGLE; LANES],
            beyond: folds.bits(beyond),
            narrow: row.bsdf.narrow_lobes(),
            densities: *densities,
            factors,
            roulette_throughput,
        }
    }
}
