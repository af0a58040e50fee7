//! Packets of sixteen vertices that await direct lighting, stored as a struct of arrays.

use super::tile::TileContext;
use super::vertex::{ScatteringGeometry, ShadingVertex};
use crate::geometry::Ray;
use crate::geometry::packet::set_bit_lanes;
use crate::integrators::view::{PathAov, RadianceComponentMask};
use crate::materials::bsdf::BsdfValuePacket;
use crate::materials::bxdf::ShadingGeometry;
use crate::materials::{BsdfPacket, BxdfKind};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Simd, TRUE, Vec3x16, lane, mask_from_bits, set_lane};
use crate::math::soa::Soa;
use crate::sampling::SamplerPacket;
use crate::scene::description::ShadowMode;
use glimt_base::soa;

soa! {
    /// A vertex that awaits direct lighting.
    pub struct BatchVertex in VertexBatch {
        /// Origin of light samples and shadow rays.
        pub from: Vec3 = Vec3::ZERO,
        /// Triangle at the origin; see [`VertexBatch::ray_start_triangles`].
        pub start: u32 = Ray::NO_TRIANGLE,
        /// Horizon normal, if `has_horizon`. Light from behind it is occluded.
        pub horizon: Vec3 = Vec3::ZERO,
        /// Whether the surface has a horizon normal.
        pub has_horizon: bool = false,
        /// Origin lifted above the facet, from which lights in all directions are visible. Only valid if
        /// `may_lift` and if the ray from the facet to this point is unoccluded.
        pub lifted: Vec3 = Vec3::ZERO,
        /// `t_max` of the ray from the facet to `lifted`.
        pub lift_end: f32 = 0.0,
        /// Whether the origin may be lifted to `lifted`.
        pub may_lift: bool = false,
        /// The surface point, if `has_facet`. Otherwise, `from` is used.
        pub point: Vec3 = Vec3::ZERO,
        /// The geometric normal oriented toward the viewer, if `has_facet`. Otherwise, `normal` is used.
        pub facet: Vec3 = Vec3::ZERO,
        /// Whether `point` and `facet` are set.
        pub has_facet: bool = false,
        /// Whether the camera sees the vertex, directly or through mirrors and glass.
        pub only_specular_before: bool = false,
        /// Whether the path's previous surface has a glossy lobe.
        pub after_gloss: bool = false,
        /// Shading normal.
        pub normal: Vec3 = Vec3::ZERO,
        /// Interpolated normal before perturbation.
        pub smooth_normal: Vec3 = Vec3::ZERO,
        /// Cosine between `smooth_normal` and the perturbed normal, or [`UNPERTURBED`] if they are equal.
        pub shading_normal_cosine: f32 = UNPERTURBED,
        /// Path throughput.
        pub throughput: Vec3 = Vec3::ZERO,
        /// Sample slot.
        pub slot: u32 = 0,
        /// Path number.
        pub path: u32 = 0,
        /// Path index in the bounce's queue.
        pub place: u32 = 0,
        /// [`PathHistory::roulette_throughput`](super::ray::PathHistory::roulette_throughput) of the path.
        pub roulette_throughput: f32 = 0.0,
        /// Index of the vertex's interior list.
        pub interiors: u32 = 0,
        /// Ray origin on the other side of the surface. Only valid if `has_two_sides`.
        pub beyond: Vec3 = Vec3::ZERO,
        /// Index of the interior list at `beyond`.
        pub interiors_beyond: u32 = 0,
    }
    with {
        /// Mask of lanes with a vertex.
        pub used: u32 = 0,
        /// BSDFs, all of the same kind.
        pub bsdf: BsdfPacket = BsdfPacket::default(),
        /// Whether any vertex has a perturbed normal.
        pub is_perturbed: bool = false,
        /// Whether no light samples are visible from any of the vertices.
        pub is_dark: bool = false,
        /// Whether the vertices represent both sides of their surfaces.
        pub has_two_sides: bool = false,
    }
}

/// Placeholder for the cosine if the shading normal is not perturbed.
pub const UNPERTURBED: f32 = -2.0;

impl VertexBatch {
    /// Minimum exponent α at which lobe rays are worth tracing for lights of any size.
    const MIN_SHARP_EXPONENT: f32 = 100.0;

    /// Lobe rays are also worth tracing if infinite lights are at least this many times as wide as the lobe.
    const MIN_WIDTH_RATIO: f32 = 1.5;

    /// Mask of vertices whose highlights are too narrow for reliable light sampling.
    pub fn sharp_lobe_mask(&self, tile: &TileContext<'_>, aov: PathAov) -> u32 {
        let shows = match aov {
            PathAov::Radiance(RadianceComponentMask { specular, .. }) => specular,
            PathAov::LitFraction => false,
            PathAov::TraversalCost => true,
        };
        let is_soft = tile.settings.render.shadows == ShadowMode::Soft;
        if !(self.bsdf.has_narrow_lobes() && shows && is_soft && tile.world.lights.can_be_hit()) {
            return 0;
        }
        // A lobe's solid angle is about 2π/(α + 1) sr.
        let filled = Self::MIN_WIDTH_RATIO * std::f32::consts::TAU
            / tile.world.lights.max_infinite_light_solid_angle()
            - 1.0;
        let least = filled.min(Self::MIN_SHARP_EXPONENT);
        self.bsdf.mask_of_lanes_narrower_than(self.used, least)
    }

    /// Returns the vertices' samplers.
    #[inline(always)]
    pub fn sampler_packet(&self, tile: &TileContext<'_>) -> SamplerPacket<PACKET_SIZE> {
        let (block, slots) = (tile.block, &self.slot);
        let mut is_run = true;
        for i in 0..PACKET_SIZE {
            is_run &= slots[i] == slots[0] + i as u32;
        }
        let (xs, ys, samples) = if is_run {
            block.pixels_and_samples_of_consecutive_slots(slots[0])
        } else {
            block.pixels_and_samples_of_slots(slots)
        };
        SamplerPacket::new(tile.settings.render.seed, &xs, &ys, &samples)
    }

    /// Creates a packet without vertices.
    pub fn empty() -> Self {
        BatchVertex::default().splat()
    }

    /// Empties the packet and marks all normals as unperturbed.
    #[inline(always)]
    pub fn reset(&mut self) {
        (self.used, self.has_horizon, self.may_lift) = (0, 0, 0);
        (self.has_facet, self.only_specular_before, self.after_gloss) = (0, 0, 0);
        (self.is_perturbed, self.is_dark, self.has_two_sides) = (false, false, false);
        self.bsdf.prepare_for_reuse();
        self.shading_normal_cosine = [UNPERTURBED; PACKET_SIZE];
    }

    /// Whether the packet accepts vertices with this kind of BSDF and these values of `is_dark` and
    /// `has_two_sides`.
    #[inline(always)]
    pub fn has_kind_and_flags(&self, kind: BxdfKind, (is_dark, has_two_sides): (bool, bool)) -> bool {
        self.bsdf.kind() == kind && self.is_dark == is_dark && self.has_two_sides == has_two_sides
    }

    /// Keeps only the vertices in the mask `these`.
    pub fn clear_lanes_outside(&mut self, these: u32) {
        let Self { used, has_horizon, may_lift, has_facet, only_specular_before, after_gloss, .. } = self;
        for bits in [used, has_horizon, may_lift, has_facet, only_specular_before, after_gloss] {
            *bits &= these;
        }
    }

    /// Copies a vertex from another packet with the same kind of BSDF. Neither packet may be two-sided.
    pub fn copy_vertex_from(&mut self, i: usize, other: &Self, from: usize) {
        BatchVertex::get(other, from).set(self, i);
        self.bsdf.copy_lane(i, &other.bsdf, from);
        self.is_perturbed |= other.is_perturbed;
        self.used |= 1 << i;
    }

    /// Stores a vertex. Its BSDF must be of the packet's kind.
    pub fn set_vertex(
        &mut self,
        i: usize,
        tile: &TileContext<'_>,
        lit: &ShadingVertex<'_>,
        aov: PathAov,
        interiors: u32,
    ) {
        let ShadingVertex { path, place, vertex, shading, bsdf, .. } = lit;
        let ScatteringGeometry { origin, facet, wo, tangent } =
            vertex.scattering_geometry(tile, path.state.only_specular_before);
        let normal = bsdf.lobe_shading_normal(shading.normal, wo);
        let (point, facet_normal) = facet.unwrap_or((Vec3::ZERO, Vec3::ZERO));
        BatchVertex {
            from: origin.point,
            start: origin.start,
            horizon: origin.horizon.unwrap_or(Vec3::ZERO),
            has_horizon: origin.horizon.is_some(),
            lifted: origin.lift.map_or(Vec3::ZERO, |lift| lift.to),
            lift_end: origin.lift.map_or(0.0, |lift| lift.end),
            may_lift: origin.lift.is_some(),
            point,
            facet: facet_normal,
            has_facet: facet.is_some(),
            only_specular_before: path.state.only_specular_before,
            after_gloss: path.state.is_after_gloss,
            normal,
            smooth_normal: shading.smooth_normal,
            shading_normal_cosine: shading.shading_normal_cosine.unwrap_or(UNPERTURBED),
            throughput: path.throughput,
            slot: path.slot,
            path: path.path,
            place: *place,
            roulette_throughput: path.state.roulette_throughput,
            interiors,
            ..BatchVertex::default()
        }
        .set(self, i);
        let directions = ShadingGeometry { normal, wo, tangent };
        self.bsdf.set_bsdf(i, bsdf, aov.lobes(), &directions);
        self.is_perturbed |= shading.shading_normal_cosine.is_some();
        self.used |= 1 << i;
    }

    /// Stores the ray origin on the far side of a vertex's surface, and the index of the interior list there.
    pub fn set_far_side_origin(&mut self, i: usize, beyond: Vec3, interiors: u32) {
        set_lane(&mut self.beyond, i, beyond);
        self.interiors_beyond[i] = interiors;
    }

    /// Evaluates the BSDFs and cosines for light from the directions `wi`.
    #[inline(always)]
    pub fn evaluate_bsdf_and_cosines(&self, wi: &Vec3x16, simd: impl Simd) -> BsdfValuesAndCosines {
        let mut cosines = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            cosines[i] = lane(&self.normal, i).dot(lane(wi, i));
        }
        if self.is_perturbed {
            for i in 0..PACKET_SIZE {
                let smooth = lane(&self.smooth_normal, i).dot(lane(wi, i));
                cosines[i] *= terminator_factor(cosines[i], smooth, self.shading_normal_cosine[i]);
            }
        }
        BsdfValuesAndCosines { bsdf: self.bsdf.f(wi, simd), cosines }
    }

    /// Shadow-terminator factors for light from the directions `wi`, on the viewer's side in lanes where
    /// `sides` is 1 and on the other side where it is −1. The factor is not positive if the light is on the
    /// wrong side of a normal.
    #[inline(always)]
    pub fn terminator_factors(&self, wi: &Vec3x16, sides: &F32x16) -> F32x16 {
        let mut left = [1.0; PACKET_SIZE];
        if self.is_perturbed {
            for i in 0..PACKET_SIZE {
                let direction = lane(wi, i) * sides[i];
                let cosine = lane(&self.normal, i).dot(direction);
                let smooth = lane(&self.smooth_normal, i).dot(direction);
                left[i] = terminator_factor(cosine, smooth, self.shading_normal_cosine[i]);
            }
        }
        left
    }

    /// [`Ray::start`] values for rays from the vertices in the directions `wi`, or [`Ray::NO_TRIANGLE`] for
    /// rays that point behind their facet.
    #[inline(always)]
    pub fn ray_start_triangles(&self, wi: &Vec3x16) -> [u32; PACKET_SIZE] {
        // Vertices on analytic shapes are not on triangles.
        if self.start.iter().fold(!0, |all, start| all & start) == Ray::NO_TRIANGLE {
            return self.start;
        }
        let apart = mask_from_bits(self.has_facet);
        let mut starts = self.start;
        for i in 0..PACKET_SIZE {
            let (facet, normal) = (lane(&self.facet, i), lane(&self.normal, i));
            let choose = |facet: f32, normal: f32| if apart[i] != 0 { facet } else { normal };
            let Vec3 { x, y, z } = lane(wi, i);
            let height =
                choose(facet.x, normal.x) * x + choose(facet.y, normal.y) * y + choose(facet.z, normal.z) * z;
            starts[i] = if height > 0.0 { starts[i] } else { Ray::NO_TRIANGLE };
        }
        starts
    }

    /// Like [`VertexBatch::ray_start_triangles`], for a single vertex.
    pub fn ray_start_triangle(&self, i: usize, direction: Vec3) -> u32 {
        let normal = if self.has_facet & 1 << i != 0 { &self.facet } else { &self.normal };
        if lane(normal, i).dot(direction) > 0.0 { self.start[i] } else { Ray::NO_TRIANGLE }
    }

    /// Whether a direction is below the horizon of a vertex.
    pub fn is_direction_below_horizon(&self, i: usize, direction: Vec3) -> bool {
        self.has_horizon & 1 << i != 0 && !(lane(&self.horizon, i).dot(direction) > 0.0)
    }

    /// Surface point of a vertex, and its geometric normal oriented toward the viewer.
    #[inline(always)]
    pub fn surface_point_and_normal(&self, i: usize) -> (Vec3, Vec3) {
        if self.has_facet & 1 << i != 0 {
            (lane(&self.point, i), lane(&self.facet, i))
        } else {
            (lane(&self.from, i), lane(&self.normal, i))
        }
    }

    /// Weight of a photon at a vertex: the cosine at the shading normal times the terminator factor, divided
    /// by the cosine at the geometric normal.
    #[inline(always)]
    pub fn adjoint_photon_weight(&self, i: usize, direction: Vec3) -> f32 {
        if self.has_facet & 1 << i == 0 {
            return 1.0;
        }
        let cosine = lane(&self.normal, i).dot(direction);
        let smooth = lane(&self.smooth_normal, i).dot(direction);
        let left = cosine * terminator_factor(cosine, smooth, self.shading_normal_cosine[i]);
        let arriving = lane(&self.facet, i).dot(direction);
        if (left > 0.0) & (arriving > 0.0) { left / arriving } else { 0.0 }
    }

    /// Multiplies the light at each vertex by the path's throughput.
    #[inline(always)]
    pub fn times_throughput(&self, light: &Vec3x16) -> Vec3x16 {
        let mut radiance = *light;
        for axis in 0..3 {
            for i in 0..PACKET_SIZE {
                radiance[axis][i] = light[axis][i] * self.throughput[axis][i];
            }
        }
        radiance
    }

    /// Returns the first vertex's queue index, or `None` unless every lane has a vertex and the indices are
    /// consecutive.
    #[inline(always)]
    pub fn first_consecutive_queue_index(&self) -> Option<u32> {
        let mut is_run = self.used == ALL;
        for i in 0..PACKET_SIZE {
            is_run &= self.place[i] == self.place[0].wrapping_add(i as u32);
        }
        is_run.then_some(self.place[0])
    }

    /// Whether any vertex is in glass.
    pub fn has_vertex_in_glass(&self) -> bool {
        set_bit_lanes(self.used).any(|i| self.interiors[i] != 0)
    }

    /// Mask of lanes whose direction is below the vertex's horizon.
    #[inline(always)]
    pub fn below_horizon_mask(&self, wi: &Vec3x16, simd: impl Simd) -> u32 {
        let mut hidden = [0; PACKET_SIZE];
        if self.has_horizon != 0 {
            for i in 0..PACKET_SIZE {
                let cosine = lane(&self.horizon, i).dot(lane(wi, i));
                hidden[i] = if cosine > 0.0 { 0 } else { TRUE };
            }
        }
        simd.movemask(&hidden) & self.has_horizon
    }
}

/// BSDF values and cosines for a packet of vertices and one direction per vertex.
#[repr(align(64))]
pub struct BsdfValuesAndCosines {
    /// BSDF values.
    pub bsdf: BsdfValuePacket,
    /// Cosines times the terminator factors. Not positive if the light is on the wrong side of a normal.
    pub cosines: F32x16,
}

/// Mask of all lanes.
pub const ALL: u32 = ((1_u64 << PACKET_SIZE) - 1) as u32;

/// Shadow-terminator factor, which softens the shadow edge of surfaces with perturbed normals. It is 0 behind
/// the unperturbed surface and 1 without perturbation (Chiang, Li, Burley, *Taming the Shadow Terminator*,
/// 2019).
#[inline(always)]
fn terminator_factor(cosine: f32, smooth: f32, shading_normal_cosine: f32) -> f32 {
    let g = smooth / (cosine * shading_normal_cosine);
    let g = if g < 1.0 { g } else { 1.0 };
    // Light behind the shading normal must not contribute. Clamp g to 0, because for g < 0 the polynomial and
    // the cosine are both negative and their product would be positive.
    let g = if g > 0.0 { g } else { 0.0 };
    let soft = if shading_normal_cosine > 0.0 { -g * g * g + g * g + g } else { 1.0 };
    if (smooth > 0.0) | (shading_normal_cosine == UNPERTURBED) { soft } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaced_lanes_have_no_stale_bits() {
        // A packet with all bits set, including the bits of unused lanes.
        let noisy = VertexBatch {
            used: ALL,
            has_horizon: ALL,
            may_lift: ALL,
            has_facet: ALL,
            only_specular_before: ALL,
            after_gloss: ALL,
            ..VertexBatch::empty()
        };
        let plain = VertexBatch { used: ALL, ..VertexBatch::empty() };
        let mut row = noisy;
        row.clear_lanes_outside(0b11);
        row.copy_vertex_from(2, &plain, 7);
        row.copy_vertex_from(3, &VertexBatch { only_specular_before: 1 << 9, ..plain.clone() }, 9);
        let bits = [
            row.used,
            row.has_horizon,
            row.may_lift,
            row.has_facet,
            row.only_specular_before,
            row.after_gloss,
        ];
        assert_eq!(bits, [0b1111, 0b11, 0b11, 0b11, 0b1011, 0b11]);
    }
}
