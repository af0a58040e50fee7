//! BSDF sampling at diffuse and glossy surfaces, sixteen at a time, and Russian roulette.

use super::accumulator::PathDiffuseFractions;
use super::batch::{BsdfValuesAndCosines, VertexBatch};
use super::cone::RayCone;
use super::interface::SCATTERED;
use super::interiors::InteriorListPool;
use super::ray::{PathHistory, PathRay};
use super::tile::TileContext;
use crate::geometry::Ray;
use crate::geometry::packet::set_bit_lanes;
use crate::materials::Material;
use crate::materials::bsdf::{DielectricSamplePacket, LobesToSample};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Simd, TRUE, Vec3x16, lane, set_lane};
use crate::sampling::Dimension;
use crate::world::SimdKernel;

/// How paths continue after a bounce.
#[derive(Clone, Copy, Debug)]
pub struct BounceContinuationRules {
    /// Whether paths continue. After the last bounce, they continue only if they may hit a light.
    pub continues: bool,
    /// Whether Russian roulette applies.
    pub uses_roulette: bool,
    /// Lobes from which directions are sampled.
    pub lobes: LobesToSample,
}

impl BounceContinuationRules {
    /// Number of bounces before Russian roulette begins.
    const MIN_DEPTH: u32 = 3;
    /// Reciprocal of the throughput below which Russian roulette may end a path.
    const GAIN: f32 = 2.5;

    /// Determines how paths continue in these lobes after `depth` bounces.
    pub fn new(tile: &TileContext<'_>, depth: u32, lobes: LobesToSample) -> Self {
        let emits = || tile.world.materials.iter().any(Material::is_emissive);
        let max_depth = tile.settings.render.max_depth;
        let shines = || tile.world.lights.escaping_rays_can_hit_light() || emits();
        let continues = depth + 1 < max_depth || depth + 1 == max_depth && shines();
        Self { continues, uses_roulette: depth >= Self::MIN_DEPTH, lobes }
    }

    /// Survival probability of a path, proportional to its throughput so that all surviving paths continue
    /// with the same throughput (Arvo and Kirk, *Particle Transport and Image Synthesis*, 1990). The gain was
    /// chosen empirically (see `benches/README.md`).
    #[inline(always)]
    fn survival_probability(self, roulette_throughput: f32) -> f32 {
        if self.uses_roulette { (roulette_throughput * Self::GAIN).min(1.0) } else { 1.0 }
    }

    /// Applies Russian roulette to a path after a specular bounce. Returns false if the path ends. Otherwise,
    /// divides its throughput by the probability of continuing.
    #[inline]
    pub fn apply_roulette(self, tile: &TileContext<'_>, path: &mut PathRay) -> bool {
        let chance = self.survival_probability(path.state.roulette_throughput);
        if chance < 1.0 {
            if !(tile.sampler_for_slot(path.slot).pair(path.path, Dimension::SpecularRoulette).x < chance) {
                return false;
            }
            path.throughput /= chance;
            path.state.roulette_throughput /= chance;
        }
        true
    }
}

/// Samples the BSDFs of a packet of vertices to continue the paths.
pub struct BsdfSampler<'a> {
    /// Tile context.
    pub tile: &'a TileContext<'a>,
    /// The vertices.
    pub row: &'a VertexBatch,
    /// Mask of vertices whose paths continue.
    pub used: u32,
    /// How the paths continue.
    pub continuation: BounceContinuationRules,
    /// Whether the diffuse fractions of the paths are needed.
    pub has_fractions: bool,
}

/// Sampled directions at a packet of vertices.
#[repr(align(64))]
pub struct ScatteredDirections {
    /// Mask of paths that continue.
    alive: u32,
    /// Unit directions.
    wi: Vec3x16,
    /// [`Ray::start`] of the rays.
    starts: [u32; PACKET_SIZE],
    /// Mask of paths that continue on the other side of their surface.
    beyond: u32,
    /// Mask of vertices with a narrow lobe.
    narrow: u32,
    /// Pdfs of the directions in sr⁻¹.
    pdfs: F32x16,
    /// Throughput factors.
    factors: Vec3x16,
    /// New values of [`PathHistory::roulette_throughput`].
    roulette_throughput: F32x16,
    /// Fractions of `factors` from wide lobes, if they are needed.
    diffuse: Vec3x16,
}

impl BsdfSampler<'_> {
    /// Adds the rays of the next bounce to `next`. `interior_lists` contains the media at the vertices.
    /// `cones` is empty or contains the ray cones at the vertices, indexed by queue index. `fractions` is
    /// required if `has_fractions`.
    pub fn queue_scattered_paths(
        self,
        interior_lists: &InteriorListPool,
        cones: &[RayCone],
        next: &mut Vec<PathRay>,
        fractions: Option<&mut PathDiffuseFractions>,
    ) {
        // Sample the BSDFs of all vertices in the packet.
        let row = self.row;
        let scattered = self.tile.world.geometry.instruction_set().run(self);
        let of_lobe = |pdf: f32| move |cone: &RayCone| cone.scattered(pdf);
        // Queue the paths that continue.
        next.extend(set_bit_lanes(scattered.alive).map(|i| {
            let (from, interiors, normal) = if scattered.beyond & 1 << i == 0 {
                (&row.from, row.interiors[i], lane(&row.normal, i))
            } else {
                (&row.beyond, row.interiors_beyond[i], -lane(&row.normal, i))
            };
            let mut path = PathRay {
                ray: Ray::new(lane(from, i), lane(&scattered.wi, i)).with_start_triangle(scattered.starts[i]),
                throughput: lane(&row.throughput, i) * lane(&scattered.factors, i),
                slot: row.slot[i],
                path: row.path[i],
                interiors: interior_lists.get(interiors),
                state: PathHistory {
                    pdf: scattered.pdfs[i],
                    normal,
                    roulette_throughput: scattered.roulette_throughput[i],
                    only_specular_before: false,
                    one_diffuse_before: row.only_specular_before & 1 << i != 0,
                    is_after_gloss: scattered.narrow & 1 << i != 0,
                },
                cone: cones.get(row.place[i] as usize).map_or(RayCone::default(), of_lobe(scattered.pdfs[i])),
            };
            path.path = path.child_path_number(SCATTERED);
            path
        }));
        if let Some(fractions) = fractions {
            let PathDiffuseFractions { current, next } = fractions;
            next.extend(set_bit_lanes(scattered.alive).map(|i| {
                if row.only_specular_before & 1 << i != 0 {
                    lane(&scattered.diffuse, i)
                } else {
                    current[row.place[i] as usize]
                }
            }));
        }
    }
}

impl SimdKernel for BsdfSampler<'_> {
    type Output = ScatteredDirections;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> ScatteredDirections {
        let Self { tile, row, used, continuation, .. } = self;
        let sampler = row.sampler_packet(tile);
        // Sample a direction at each vertex.
        let u = sampler.pairs(&row.path, Dimension::Direction, 0, 1);
        let [lobe, _] = if row.bsdf.uses_lobe_choices() {
            sampler.pairs(&row.path, Dimension::Lobe, 0, 1)
        } else {
            [[0.0; PACKET_SIZE]; 2]
        };
        let sides = if row.has_two_sides {
            row.bsdf.sample_reflection_or_transmission(&lobe, &u, simd)
        } else {
            None
        };
        let mut scattered = match sides {
            Some(sides) => self.scattered_from_two_sided_samples(&sides, simd),
            None => self.sample_on_viewer_side(&lobe, &u, simd),
        };
        scattered.alive &= used;
        // Apply Russian roulette.
        if continuation.uses_roulette {
            let [risk, _] = sampler.pairs(&row.path, Dimension::Roulette, 0, 1);
            for i in 0..PACKET_SIZE {
                let chance = continuation.survival_probability(scattered.roulette_throughput[i]);
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

impl BsdfSampler<'_> {
    /// Samples directions on the viewer's side of the vertices.
    #[inline(always)]
    fn sample_on_viewer_side(&self, lobe: &F32x16, u: &[F32x16; 2], simd: impl Simd) -> ScatteredDirections {
        let Self { row, continuation, .. } = *self;
        let wi = row.bsdf.sample(continuation.lobes, &row.normal, lobe, u, simd);
        // Evaluate the BSDF and the pdf.
        let BsdfValuesAndCosines { bsdf, cosines } = row.evaluate_bsdf_and_cosines(&wi, simd);
        let pdfs = row.bsdf.pdf(continuation.lobes, &row.normal, &wi, &bsdf, simd);
        let mut roulette_throughput = [0.0; PACKET_SIZE];
        let f = match continuation.lobes {
            LobesToSample::All => bsdf.f(),
            LobesToSample::Narrow => bsdf.narrow,
        };
        let mut factors = f;
        let mut alive = 0_u32;
        for i in 0..PACKET_SIZE {
            let cosine_over_pdf = cosines[i] / pdfs[i];
            roulette_throughput[i] = row.roulette_throughput[i] * bsdf.max[i] * cosine_over_pdf;
            let factor = lane(&f, i) * cosine_over_pdf;
            set_lane(&mut factors, i, factor);
            let contributes = (factor.x > 0.0) | (factor.y > 0.0) | (factor.z > 0.0);
            let bit = 1 << i;
            alive |= if (cosines[i] > 0.0) & (pdfs[i] > 0.0) & contributes { bit } else { 0 };
        }
        let diffuse = match continuation.lobes {
            LobesToSample::All if self.has_fractions => bsdf.wide_fraction(),
            LobesToSample::All | LobesToSample::Narrow => [[0.0; PACKET_SIZE]; 3],
        };
        // Drop directions below the horizon.
        alive &= !row.below_horizon_mask(&wi, simd);
        let starts = row.ray_start_triangles(&wi);
        let narrow = row.bsdf.narrow_lobe_mask();
        ScatteredDirections {
            alive,
            wi,
            starts,
            beyond: 0,
            narrow,
            pdfs,
            factors,
            roulette_throughput,
            diffuse,
        }
    }

    /// Scatters paths in directions sampled on both sides of the surfaces.
    #[inline(always)]
    fn scattered_from_two_sided_samples(
        &self,
        samples: &DielectricSamplePacket,
        simd: impl Simd,
    ) -> ScatteredDirections {
        let row = self.row;
        let DielectricSamplePacket { directions: wi, densities: pdfs, shares, shown, beyond } = samples;
        // Apply the terminator factors for perturbed normals, each on its direction's side.
        let mut sides = [1.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            sides[i] = if beyond[i] == 0 { 1.0 } else { -1.0 };
        }
        let left = row.terminator_factors(wi, &sides);
        let (mut factors, mut roulette_throughput) = ([[0.0; PACKET_SIZE]; 3], [0.0; PACKET_SIZE]);
        let mut alive = 0_u32;
        for i in 0..PACKET_SIZE {
            let share = shares[i] * left[i];
            roulette_throughput[i] = row.roulette_throughput[i] * share;
            let factor = share * shown[i];
            set_lane(&mut factors, i, Vec3::splat(factor));
            alive |= if (pdfs[i] > 0.0) & (factor > 0.0) { 1 << i } else { 0 };
        }
        // Drop directions behind the facets. Two-sided vertices have an offset origin on each side, so their
        // rays do not start on a triangle.
        let mut hidden = [0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let cosine = lane(&row.horizon, i).dot(lane(wi, i)) * sides[i];
            hidden[i] = if cosine > 0.0 { 0 } else { TRUE };
        }
        alive &= !(simd.movemask(&hidden) & row.has_horizon);
        ScatteredDirections {
            alive,
            wi: *wi,
            starts: [Ray::NO_TRIANGLE; PACKET_SIZE],
            beyond: simd.movemask(beyond),
            narrow: row.bsdf.narrow_lobe_mask(),
            pdfs: *pdfs,
            factors,
            roulette_throughput,
            // Rough glass has only narrow lobes.
            diffuse: [[0.0; PACKET_SIZE]; 3],
        }
    }
}
