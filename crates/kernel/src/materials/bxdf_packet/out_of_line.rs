//! Wrappers around the large functions of [`BxdfPacket`], which call an out-of-line copy of the function. If
//! [`Bxdf::IS_INLINED`] is set, they inline the function instead.

use super::BxdfPacket;
use crate::materials::bsdf::{BsdfValuePacket, DielectricSamplePacket, LobesToSample, ShownLobes};
use crate::materials::bxdf::{Bxdf, ShadingGeometry};
use crate::materials::rough_dielectric::DielectricBxdf;
use crate::math::lanes::{F32x16, Mask, Simd, SimdKernel, Vec3x16};

impl<B: Bxdf> BxdfPacket<B> {
    /// [`BxdfPacket::set_bsdf`].
    #[inline(always)]
    pub(crate) fn set_bsdf_out_of_line(
        &mut self,
        i: usize,
        point: &B::Point,
        shown: ShownLobes,
        directions: &ShadingGeometry,
    ) {
        #[inline(never)]
        fn set_bsdf<B: Bxdf>(
            packet: &mut BxdfPacket<B>,
            i: usize,
            point: &B::Point,
            shown: ShownLobes,
            directions: &ShadingGeometry,
        ) {
            packet.set_bsdf(i, point, shown, directions);
        }
        if B::IS_INLINED {
            self.set_bsdf(i, point, shown, directions);
        } else {
            set_bsdf(self, i, point, shown, directions);
        }
    }

    /// [`BxdfPacket::evaluate_material_into_lanes`].
    #[inline(always)]
    pub(crate) fn evaluate_material_into_lanes_out_of_line(
        &mut self,
        point: &B::Point,
        colors: Option<&Vec3x16>,
        shown: &[(u32, ShownLobes)],
        simd: impl Simd,
    ) -> u32 {
        if B::IS_INLINED {
            self.evaluate_material_into_lanes(point, colors, shown, simd)
        } else {
            simd.call_out_of_line(MaterialKernel { packet: self, point, colors, shown })
        }
    }

    /// [`BxdfPacket::set_normals_and_ray_directions`].
    #[inline(always)]
    pub(crate) fn set_normals_and_directions_out_of_line(
        &mut self,
        of: Option<&Mask>,
        normals: &mut Vec3x16,
        directions: &Vec3x16,
        simd: impl Simd,
    ) {
        if B::IS_INLINED {
            self.set_normals_and_ray_directions(of, normals, directions);
        } else {
            simd.call_out_of_line(NormalsAndDirectionsKernel { packet: self, of, normals, directions });
        }
    }

    /// [`BxdfPacket::f`].
    #[inline(always)]
    pub(crate) fn f_out_of_line(&self, wi: &Vec3x16, simd: impl Simd) -> BsdfValuePacket {
        if B::IS_INLINED { self.f(wi) } else { simd.call_out_of_line(EvaluationKernel { packet: self, wi }) }
    }

    /// [`BxdfPacket::pdf`].
    #[inline(always)]
    pub(crate) fn pdf_out_of_line(
        &self,
        lobes: LobesToSample,
        normals: &Vec3x16,
        wi: &Vec3x16,
        values: &BsdfValuePacket,
        simd: impl Simd,
    ) -> F32x16 {
        if B::IS_INLINED {
            self.pdf(lobes, normals, wi, values)
        } else {
            simd.call_out_of_line(PdfKernel { packet: self, lobes, normals, wi, values })
        }
    }

    /// [`BxdfPacket::sample`].
    #[inline(always)]
    pub(crate) fn sample_out_of_line(
        &self,
        lobes: LobesToSample,
        normals: &Vec3x16,
        choices: &F32x16,
        u: &[F32x16; 2],
        simd: impl Simd,
    ) -> Vec3x16 {
        if B::IS_INLINED {
            self.sample(lobes, normals, choices, u)
        } else {
            simd.call_out_of_line(SamplingKernel { packet: self, lobes, normals, choices, u })
        }
    }
}

impl<const THROUGH: bool, const BECKMANN: bool> BxdfPacket<DielectricBxdf<THROUGH, BECKMANN>> {
    /// [`BxdfPacket::sample_reflection_or_transmission`].
    #[inline(always)]
    pub(crate) fn sample_reflection_or_transmission_out_of_line(
        &self,
        choices: &F32x16,
        u: &[F32x16; 2],
        simd: impl Simd,
    ) -> DielectricSamplePacket {
        simd.call_out_of_line(EitherSideSamplingKernel { packet: self, choices, u })
    }
}

/// Kernel of [`BxdfPacket::evaluate_material_into_lanes`].
struct MaterialKernel<'a, B: Bxdf> {
    packet: &'a mut BxdfPacket<B>,
    point: &'a B::Point,
    colors: Option<&'a Vec3x16>,
    shown: &'a [(u32, ShownLobes)],
}

impl<B: Bxdf> SimdKernel for MaterialKernel<'_, B> {
    type Output = u32;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> u32 {
        self.packet.evaluate_material_into_lanes(self.point, self.colors, self.shown, simd)
    }
}

/// Kernel of [`BxdfPacket::set_normals_and_ray_directions`].
struct NormalsAndDirectionsKernel<'a, B: Bxdf> {
    packet: &'a mut BxdfPacket<B>,
    of: Option<&'a Mask>,
    normals: &'a mut Vec3x16,
    directions: &'a Vec3x16,
}

impl<B: Bxdf> SimdKernel for NormalsAndDirectionsKernel<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run(self, _: impl Simd) {
        self.packet.set_normals_and_ray_directions(self.of, self.normals, self.directions);
    }
}

/// Kernel of [`BxdfPacket::f`].
struct EvaluationKernel<'a, B: Bxdf> {
    packet: &'a BxdfPacket<B>,
    wi: &'a Vec3x16,
}

impl<B: Bxdf> SimdKernel for EvaluationKernel<'_, B> {
    type Output = BsdfValuePacket;

    #[inline(always)]
    fn run(self, _: impl Simd) -> BsdfValuePacket {
        self.packet.f(self.wi)
    }
}

/// Kernel of [`BxdfPacket::pdf`].
struct PdfKernel<'a, B: Bxdf> {
    packet: &'a BxdfPacket<B>,
    lobes: LobesToSample,
    normals: &'a Vec3x16,
    wi: &'a Vec3x16,
    values: &'a BsdfValuePacket,
}

impl<B: Bxdf> SimdKernel for PdfKernel<'_, B> {
    type Output = F32x16;

    #[inline(always)]
    fn run(self, _: impl Simd) -> F32x16 {
        self.packet.pdf(self.lobes, self.normals, self.wi, self.values)
    }
}

/// Kernel of [`BxdfPacket::sample`].
struct SamplingKernel<'a, B: Bxdf> {
    packet: &'a BxdfPacket<B>,
    lobes: LobesToSample,
    normals: &'a Vec3x16,
    choices: &'a F32x16,
    u: &'a [F32x16; 2],
}

impl<B: Bxdf> SimdKernel for SamplingKernel<'_, B> {
    type Output = Vec3x16;

    #[inline(always)]
    fn run(self, _: impl Simd) -> Vec3x16 {
        self.packet.sample(self.lobes, self.normals, self.choices, self.u)
    }
}

/// Kernel of [`BxdfPacket::sample_reflection_or_transmission`].
struct EitherSideSamplingKernel<'a, const THROUGH: bool, const BECKMANN: bool> {
    packet: &'a BxdfPacket<DielectricBxdf<THROUGH, BECKMANN>>,
    choices: &'a F32x16,
    u: &'a [F32x16; 2],
}

impl<const THROUGH: bool, const BECKMANN: bool> SimdKernel
    for EitherSideSamplingKernel<'_, THROUGH, BECKMANN>
{
    type Output = DielectricSamplePacket;

    #[inline(always)]
    fn run(self, _: impl Simd) -> DielectricSamplePacket {
        self.packet.sample_reflection_or_transmission(self.choices, self.u)
    }
}
