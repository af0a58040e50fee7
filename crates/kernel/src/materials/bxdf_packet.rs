//! Packets of 16 non-specular BSDFs of the same kind. All functions must be called inside a SIMD kernel.

mod out_of_line;

use super::bsdf::{BsdfValuePacket, DielectricSamplePacket, LobesToSample, NarrowLobe, ShownLobes};
use super::bxdf::{Bxdf, BxdfFlags, LobesWithNormal, ShadingGeometry};
use super::microfacet::tilt_to_face_viewer_branchless;
use super::rough_dielectric::DielectricBxdf;
use super::shown_lobe_factors::{LobeFactorsPacket, ShownLobeFactors};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Simd, TRUE, Vec3x16, lane, mask_from_bits, set_lane};
use crate::math::soa::Soa;

/// A packet of BSDFs.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct BxdfPacket<B: Bxdf> {
    bsdf: B::Packet,
    view: <B::View as Soa>::Packet,
    shown: LobeFactorsPacket,
    /// Flags that at least one of the BSDFs has.
    any: BxdfFlags,
    /// Whether all lobes of all BSDFs are shown.
    shows_all: bool,
}

impl<B: Bxdf> Default for BxdfPacket<B> {
    fn default() -> Self {
        Self {
            bsdf: B::default().splat(),
            view: B::View::default().splat(),
            shown: ShownLobeFactors::default().splat(),
            any: B::ALWAYS,
            shows_all: true,
        }
    }
}

/// Flags in which the compiler knows the value of [`BxdfFlags::NARROW`], so it can remove code from loops.
#[inline(always)]
fn flags_with_const_narrow<const NARROW: bool>(any: BxdfFlags) -> BxdfFlags {
    if NARROW { any.union(BxdfFlags::NARROW) } else { any.without(BxdfFlags::NARROW) }
}

impl<B: Bxdf> BxdfPacket<B> {
    /// Prepares the packet for reuse with other surfaces.
    #[inline(always)]
    pub fn prepare_for_reuse(&mut self) {
        (self.any, self.shows_all) = (B::ALWAYS, true);
    }

    /// Sets the surface in a lane.
    #[inline(always)]
    pub fn set_bsdf(&mut self, i: usize, point: &B::Point, shown: ShownLobes, directions: &ShadingGeometry) {
        let bsdf = B::new(point, directions.tangent);
        self.any = self.any.union(bsdf.flags());
        self.shows_all &= shown == ShownLobes::ALL;
        bsdf.compute_view_terms(directions, self.any).set(&mut self.view, i);
        bsdf.set(&mut self.bsdf, i);
        ShownLobeFactors::from(shown).set(&mut self.shown, i);
    }

    /// Copies a surface from a lane of another packet.
    #[inline(always)]
    pub fn copy_lane(&mut self, i: usize, other: &Self, from: usize) {
        B::get(&other.bsdf, from).set(&mut self.bsdf, i);
        B::View::get(&other.view, from).set(&mut self.view, i);
        ShownLobeFactors::get(&other.shown, from).set(&mut self.shown, i);
        self.any = self.any.union(other.any);
        self.shows_all &= other.shows_all;
    }

    /// Sets the surfaces of some lanes to a material with these values. `colors` contains the colors looked
    /// up in the material's texture, if it has one. Later entries of `shown` override earlier ones. Returns a
    /// mask of surfaces that reflect nothing.
    #[inline(always)]
    pub fn evaluate_material_into_lanes(
        &mut self,
        point: &B::Point,
        colors: Option<&Vec3x16>,
        shown: &[(u32, ShownLobes)],
        simd: impl Simd,
    ) -> u32 {
        let bsdf = B::new(point, Vec3::X);
        let mut filled = bsdf.splat();
        if let Some(colors) = colors {
            for i in 0..PACKET_SIZE {
                let mut bsdf = bsdf;
                bsdf.set_looked_up_color(point, lane(colors, i));
                bsdf.set(&mut filled, i);
            }
        }
        for &(of, shown) in shown {
            let of = mask_from_bits(of);
            B::select(&of, &filled, &mut self.bsdf);
            ShownLobeFactors::select(&of, &ShownLobeFactors::from(shown).splat(), &mut self.shown);
            self.shows_all &= shown == ShownLobes::ALL;
        }
        self.any = self.any.union(bsdf.flags());
        let mut black = [0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            black[i] = if B::get(&filled, i).is_black() { TRUE } else { 0 };
        }
        simd.movemask(&black)
    }

    /// Sets the shading normals (on the viewer's side) and the directions of the incoming rays, for the lanes
    /// in `of` or for all lanes. Replaces `normals` with the normals rotated by
    /// [`lobe_shading_normal`](super::bxdf::lobe_shading_normal).
    #[inline(always)]
    pub fn set_normals_and_ray_directions(
        &mut self,
        of: Option<&Mask>,
        normals: &mut Vec3x16,
        directions: &Vec3x16,
    ) {
        if B::TURNS_NORMALS {
            for i in 0..PACKET_SIZE {
                let turned = tilt_to_face_viewer_branchless(lane(normals, i), -lane(directions, i));
                set_lane(normals, i, turned);
            }
        }
        // Write to a separate packet, because the loop is not vectorized if it reads and writes the same
        // packet.
        let mut view = B::View::default().splat();
        for i in 0..PACKET_SIZE {
            let (normal, wo) = (lane(normals, i), -lane(directions, i));
            let directions = ShadingGeometry { normal, wo, tangent: Vec3::X };
            B::get(&self.bsdf, i).compute_view_terms(&directions, self.any).set(&mut view, i);
        }
        match of {
            Some(of) => B::View::select(of, &view, &mut self.view),
            None => self.view = view,
        }
    }

    /// Whether any surface may have a narrow lobe.
    #[inline(always)]
    pub fn any_has_narrow_lobe(&self) -> bool {
        B::ALWAYS.contains(BxdfFlags::NARROW) || self.any.contains(BxdfFlags::NARROW)
    }

    /// Whether [`BxdfPacket::sample`] uses `choices`.
    #[inline(always)]
    pub fn uses_lobe_choices(&self) -> bool {
        B::CHOOSES_SIDE || self.any_has_narrow_lobe()
    }

    /// Whether any surface may have wide lobes.
    #[inline(always)]
    pub fn any_has_wide_lobe(&self) -> bool {
        B::ALWAYS.contains(BxdfFlags::WIDE) || self.any.contains(BxdfFlags::WIDE)
    }

    /// Evaluates the lobes for light from the directions `wi`.
    #[inline(always)]
    pub fn f(&self, wi: &Vec3x16) -> BsdfValuePacket {
        let mut values = BsdfValuePacket::ZERO;
        if self.any_has_wide_lobe() {
            for i in 0..PACKET_SIZE {
                let bsdf = B::get(&self.bsdf, i);
                let value = bsdf.wide_lobe_value(&B::View::get(&self.view, i), lane(wi, i), self.any);
                set_lane(&mut values.wide, i, value.f);
                values.max[i] = value.max;
            }
        }
        if self.any_has_narrow_lobe() {
            if self.any.contains(B::SPLITS_NARROW) {
                self.add_narrow_lobe_values(wi, &mut values, self.any.union(B::SPLITS_NARROW));
            } else {
                self.add_narrow_lobe_values(wi, &mut values, self.any.without(B::SPLITS_NARROW));
            }
        }
        if !self.shows_all {
            for i in 0..PACKET_SIZE {
                let shown = ShownLobeFactors::get(&self.shown, i);
                let wide = lane(&values.wide, i) * shown.wide + Vec3::splat(shown.unit);
                let narrow = lane(&values.narrow, i) * shown.narrow;
                set_lane(&mut values.wide, i, wide);
                set_lane(&mut values.narrow, i, narrow);
            }
        }
        values
    }

    /// Adds the narrow lobes to `values`.
    #[inline(always)]
    fn add_narrow_lobe_values(&self, wi: &Vec3x16, values: &mut BsdfValuePacket, any: BxdfFlags) {
        for i in 0..PACKET_SIZE {
            let bsdf = B::get(&self.bsdf, i);
            let value = bsdf.narrow_lobe_value(&B::View::get(&self.view, i), lane(wi, i), any);
            set_lane(&mut values.narrow, i, value.f);
            values.max[i] += value.max;
            values.shape[i] = value.shape;
        }
    }

    /// Pdfs in sr⁻¹ of directions sampled from these lobes. Cosine lobes are centered on `normals`. `values`
    /// is the result of [`BxdfPacket::f`].
    #[inline(always)]
    pub fn pdf(
        &self,
        lobes: LobesToSample,
        normals: &Vec3x16,
        wi: &Vec3x16,
        values: &BsdfValuePacket,
    ) -> F32x16 {
        if self.any_has_narrow_lobe() {
            self.pdf_with_const_narrow::<true>(lobes, normals, wi, values)
        } else {
            self.pdf_with_const_narrow::<false>(lobes, normals, wi, values)
        }
    }

    #[inline(always)]
    fn pdf_with_const_narrow<const NARROW: bool>(
        &self,
        lobes: LobesToSample,
        normals: &Vec3x16,
        wi: &Vec3x16,
        values: &BsdfValuePacket,
    ) -> F32x16 {
        let any = flags_with_const_narrow::<NARROW>(self.any);
        let mut pdfs = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let bsdf = B::get(&self.bsdf, i);
            let view = B::View::get(&self.view, i);
            let from = LobesWithNormal { lobes, normal: lane(normals, i) };
            pdfs[i] = bsdf.pdf(&view, from, lane(wi, i), values.shape[i], any);
        }
        pdfs
    }

    /// Samples a unit direction for each surface. Cosine lobes are centered on `normals`. `choices` selects
    /// the lobes, and `u` the directions within them. All random numbers are in [0, 1).
    #[inline(always)]
    pub fn sample(
        &self,
        lobes: LobesToSample,
        normals: &Vec3x16,
        choices: &F32x16,
        u: &[F32x16; 2],
    ) -> Vec3x16 {
        if self.any_has_narrow_lobe() {
            self.sample_with_const_narrow::<true>(lobes, normals, choices, u)
        } else {
            self.sample_with_const_narrow::<false>(lobes, normals, choices, u)
        }
    }

    #[inline(always)]
    fn sample_with_const_narrow<const NARROW: bool>(
        &self,
        lobes: LobesToSample,
        normals: &Vec3x16,
        choices: &F32x16,
        u: &[F32x16; 2],
    ) -> Vec3x16 {
        let any = flags_with_const_narrow::<NARROW>(self.any);
        let mut wi = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let bsdf = B::get(&self.bsdf, i);
            let view = B::View::get(&self.view, i);
            let from = LobesWithNormal { lobes, normal: lane(normals, i) };
            set_lane(&mut wi, i, bsdf.sample(&view, from, [choices[i], u[0][i], u[1][i]], any));
        }
        wi
    }

    /// Flags of the surface in lane `i`.
    #[inline(always)]
    fn lane_flags(&self, i: usize) -> BxdfFlags {
        B::get(&self.bsdf, i).flags().union(B::ALWAYS)
    }

    /// Mask of surfaces that have a narrow lobe, even if it is not shown.
    #[inline(always)]
    pub fn narrow_lobe_mask(&self) -> u32 {
        let mut narrow = 0;
        for i in 0..PACKET_SIZE {
            narrow |= u32::from(self.lane_flags(i).contains(BxdfFlags::NARROW)) << i;
        }
        narrow
    }

    /// The narrow lobe of a surface, if it has one.
    #[inline(always)]
    pub fn narrow_lobe_at_lane(&self, i: usize) -> Option<NarrowLobe> {
        if !self.lane_flags(i).contains(BxdfFlags::NARROW) {
            return None;
        }
        B::get(&self.bsdf, i).narrow_lobe(&B::View::get(&self.view, i))
    }

    /// Mask of the surfaces in `of` whose narrow lobe is at least as narrow as a cosine raised to the power
    /// `exponent`.
    #[inline(always)]
    pub fn mask_of_lanes_narrower_than(&self, of: u32, exponent: f32) -> u32 {
        let mut narrow = 0;
        for i in 0..PACKET_SIZE {
            narrow |= u32::from(B::get(&self.bsdf, i).narrow_lobe_exponent() >= exponent) << i;
        }
        narrow & self.narrow_lobe_mask() & of
    }

    /// Returns f of a surface's shown lobes in sr⁻¹ if all of the surface's lobes are constant over all
    /// directions.
    #[inline(always)]
    pub fn constant_f(&self, i: usize) -> Option<Vec3> {
        let is_constant = B::HAS_CONSTANT_WIDE && !self.lane_flags(i).contains(BxdfFlags::NARROW);
        is_constant.then(|| self.lane_f_by_lobe_set(i, Vec3::Z)[0])
    }

    /// f in sr⁻¹ for light that reaches a surface from a direction. Returns f of the shown lobes, f of the
    /// shown wide lobes, and f of all lobes.
    #[inline]
    pub fn lane_f_by_lobe_set(&self, i: usize, wi: Vec3) -> [Vec3; 3] {
        let (bsdf, view) = (B::get(&self.bsdf, i), B::View::get(&self.view, i));
        let (shown, flags) = (ShownLobeFactors::get(&self.shown, i), self.lane_flags(i));
        let (mut f, mut all) = (Vec3::splat(shown.unit), Vec3::ZERO);
        if flags.contains(BxdfFlags::WIDE) {
            let wide = bsdf.wide_lobe_value(&view, wi, self.any).f;
            f += wide * shown.wide;
            all += wide;
        }
        let shown_wide = f;
        if flags.contains(BxdfFlags::NARROW) {
            let narrow = bsdf.narrow_lobe_value(&view, wi, self.any).f;
            f += narrow * shown.narrow;
            all += narrow;
        }
        [f, shown_wide, all]
    }
}

impl<const THROUGH: bool, const BECKMANN: bool> BxdfPacket<DielectricBxdf<THROUGH, BECKMANN>> {
    /// Samples a direction on either side of each surface.
    #[inline(always)]
    pub fn sample_reflection_or_transmission(
        &self,
        choices: &F32x16,
        u: &[F32x16; 2],
    ) -> DielectricSamplePacket {
        let (mut wi, mut beyond) = ([[0.0; PACKET_SIZE]; 3], [0; PACKET_SIZE]);
        let (mut pdfs, mut weights) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let bsdf = DielectricBxdf::<THROUGH, BECKMANN>::get(&self.bsdf, i);
            let view = Soa::get(&self.view, i);
            let sample = bsdf.sample_reflection_or_transmission(&view, choices[i], [u[0][i], u[1][i]]);
            set_lane(&mut wi, i, sample.wi);
            (pdfs[i], weights[i]) = (sample.pdf, sample.weight);
            beyond[i] = if sample.is_beyond { TRUE } else { 0 };
        }
        DielectricSamplePacket {
            directions: wi,
            densities: pdfs,
            shares: weights,
            shown: self.shown.narrow,
            beyond,
        }
    }
}
