//! A packet whose functions are compiled once per kind of BSDF. The functions of [`BxdfPacket`] are always
//! inlined, so calling them in many places would make the tests compile slowly.

use crate::materials::bsdf::{BsdfValuePacket, LobesToSample, ShownLobes};
use crate::materials::bxdf::{Bxdf, ShadingGeometry};
use crate::materials::bxdf_packet::BxdfPacket;
use crate::math::Vec3;
use crate::math::lanes::{F32x16, Vec3x16};

/// A packet of surfaces, none of them set at first.
pub struct OutOfLineTestPacket<B: Bxdf>(pub BxdfPacket<B>);

impl<B: Bxdf> OutOfLineTestPacket<B> {
    #[inline(never)]
    pub fn empty() -> Self {
        let mut row = BxdfPacket::<B>::default();
        row.prepare_for_reuse();
        Self(row)
    }

    #[inline(never)]
    pub fn set_bsdf(&mut self, i: usize, point: &B::Point, shown: ShownLobes, place: &ShadingGeometry) {
        self.0.set_bsdf(i, point, shown, place);
    }

    #[inline(never)]
    pub fn f(&self, wi: &Vec3x16) -> BsdfValuePacket {
        self.0.f(wi)
    }

    #[inline(never)]
    pub fn lane_f_by_lobe_set(&self, i: usize, wi: Vec3) -> [Vec3; 3] {
        self.0.lane_f_by_lobe_set(i, wi)
    }

    #[inline(never)]
    pub fn pdf(
        &self,
        lobes: LobesToSample,
        normals: &Vec3x16,
        wi: &Vec3x16,
        values: &BsdfValuePacket,
    ) -> F32x16 {
        self.0.pdf(lobes, normals, wi, values)
    }

    #[inline(never)]
    pub fn sample(
        &self,
        lobes: LobesToSample,
        normals: &Vec3x16,
        choices: &F32x16,
        u: &[F32x16; 2],
    ) -> Vec3x16 {
        self.0.sample(lobes, normals, choices, u)
    }

    #[inline(never)]
    pub fn narrow_lobe_mask(&self) -> u32 {
        self.0.narrow_lobe_mask()
    }
}
