//! Transmissive kinds: their BSDFs for transmitted light, and samples on either side of a surface.

use super::{BsdfPacket, BxdfPoint};
use crate::materials::bsdf::DielectricSamplePacket;
use crate::math::lanes::{F32x16, Simd};

impl BxdfPoint {
    /// BSDF for transmitted light, which has a different kind, or `None` if no light is transmitted.
    #[inline(always)]
    pub fn bsdf_for_transmitted_light(&self) -> Option<Self> {
        match self {
            Self::DielectricReflection(glass) | Self::BeckmannReflection(glass) => {
                Some(glass.transmission_bxdf())
            }
            Self::Principled(point) => point.transmits().then_some(Self::PrincipledTransmission(*point)),
            Self::TranslucentPhong(point) => point.transmits().then_some(Self::PhongTransmission(*point)),
            Self::CoatedPrincipled(point) => {
                point.base.transmits().then_some(Self::CoatedPrincipledTransmission(*point))
            }
            Self::CoatedTranslucent(point) => {
                point.base.transmits().then_some(Self::CoatedPhongTransmission(*point))
            }
            Self::Phong(_)
            | Self::PhongTransmission(_)
            | Self::Conductor(_)
            | Self::BrushedConductor(_)
            | Self::BeckmannConductor(_)
            | Self::Plastic(_)
            | Self::BeckmannPlastic(_)
            | Self::DielectricTransmission(_)
            | Self::BeckmannTransmission(_)
            | Self::PrincipledTransmission(_)
            | Self::CoatedPhong(_)
            | Self::CoatedConductor(_)
            | Self::CoatedBeckmannConductor(_)
            | Self::CoatedPlastic(_)
            | Self::CoatedBeckmannPlastic(_)
            | Self::CoatedPhongTransmission(_)
            | Self::CoatedPrincipledTransmission(_) => None,
        }
    }
}

impl BsdfPacket {
    /// Samples a direction on either side of each surface, using the same random numbers as
    /// [`BxdfPacket::sample`](super::super::bxdf_packet::BxdfPacket::sample). Returns `None` for kinds that do not support this.
    #[inline(always)]
    pub fn sample_reflection_or_transmission(
        &self,
        choices: &F32x16,
        u: &[F32x16; 2],
        simd: impl Simd,
    ) -> Option<DielectricSamplePacket> {
        match self {
            Self::DielectricReflection(row) => {
                Some(row.sample_reflection_or_transmission_out_of_line(choices, u, simd))
            }
            Self::DielectricTransmission(row) => {
                Some(row.sample_reflection_or_transmission_out_of_line(choices, u, simd))
            }
            Self::BeckmannReflection(row) => {
                Some(row.sample_reflection_or_transmission_out_of_line(choices, u, simd))
            }
            Self::BeckmannTransmission(row) => {
                Some(row.sample_reflection_or_transmission_out_of_line(choices, u, simd))
            }
            Self::Phong(_)
            | Self::TranslucentPhong(_)
            | Self::PhongTransmission(_)
            | Self::Conductor(_)
            | Self::BrushedConductor(_)
            | Self::BeckmannConductor(_)
            | Self::Plastic(_)
            | Self::BeckmannPlastic(_)
            | Self::Principled(_)
            | Self::PrincipledTransmission(_)
            | Self::CoatedPhong(_)
            | Self::CoatedTranslucent(_)
            | Self::CoatedConductor(_)
            | Self::CoatedBeckmannConductor(_)
            | Self::CoatedPlastic(_)
            | Self::CoatedBeckmannPlastic(_)
            | Self::CoatedPrincipled(_)
            | Self::CoatedPhongTransmission(_)
            | Self::CoatedPrincipledTransmission(_) => None,
        }
    }
}
