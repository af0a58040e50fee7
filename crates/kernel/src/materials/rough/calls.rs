//! Calls packet functions either inlined or through one copy per instruction set, depending on
//! [`RoughRow::IS_COPIED`].

use crate::materials::bsdf::{BsdfValues, LobeSet, RoughRow};
use crate::math::lanes::{F32x16, Simd, SimdKernel, Vec3x16};

/// Wrappers for the large functions of [`RoughRow`].
pub(super) trait RoughCalls: RoughRow {
    /// [`RoughRow::f`].
    #[inline(always)]
    fn call_f(&self, directions: &Vec3x16, simd: impl Simd) -> BsdfValues {
        if Self::IS_COPIED {
            self.f(directions)
        } else {
            simd.call(EvaluationKernel { row: self, directions })
        }
    }

    /// [`RoughRow::wide_and_narrow`].
    #[inline(always)]
    fn call_wide_and_narrow(
        &self,
        directions: &Vec3x16,
        values: &BsdfValues,
        simd: impl Simd,
    ) -> [Vec3x16; 2] {
        if Self::IS_COPIED {
            self.wide_and_narrow(directions, values)
        } else {
            simd.call(PartsKernel { row: self, directions, values })
        }
    }

    /// [`RoughRow::pdf`].
    #[inline(always)]
    fn call_pdf(
        &self,
        lobes: LobeSet,
        normals: &Vec3x16,
        directions: &Vec3x16,
        values: &BsdfValues,
        simd: impl Simd,
    ) -> F32x16 {
        if Self::IS_COPIED {
            self.pdf(lobes, normals, directions, values)
        } else {
            simd.call(PdfKernel { row: self, lobes, normals, directions, values })
        }
    }

    /// [`RoughRow::sample`].
    #[inline(always)]
    fn call_sample(
        &self,
        lobes: LobeSet,
        normals: &Vec3x16,
        choices: &F32x16,
        u: &[F32x16; 2],
        simd: impl Simd,
    ) -> Vec3x16 {
        if Self::IS_COPIED {
            self.sample(lobes, normals, choices, u)
        } else {
            simd.call(SamplingKernel { row: self, lobes, normals, choices, u })
        }
    }
}

impl<R: RoughRow> RoughCalls for R {}

/// Kernel of [`RoughRow::f`].
struct EvaluationKernel<'a, R> {
    row: &'a R,
    directions: &'a Vec3x16,
}

impl<R: RoughRow> SimdKernel for EvaluationKernel<'_, R> {
    type Output = BsdfValues;

    #[inline(always)]
    fn run(self, _: impl Simd) -> BsdfValues {
        self.row.f(self.directions)
    }
}

/// Kernel of [`RoughRow::wide_and_narrow`].
struct PartsKernel<'a, R> {
    row: &'a R,
    directions: &'a Vec3x16,
    values: &'a BsdfValues,
}

impl<R: RoughRow> SimdKernel for PartsKernel<'_, R> {
    type Output = [Vec3x16; 2];

    #[inline(always)]
    fn run(self, _: impl Simd) -> [Vec3x16; 2] {
        self.row.wide_and_narrow(self.directions, self.values)
    }
}

/// Kernel of [`RoughRow::pdf`].
struct PdfKernel<'a, R> {
    row: &'a R,
    lobes: LobeSet,
    normals: &'a Vec3x16,
    directions: &'a Vec3x16,
    values: &'a BsdfValues,
}

impl<R: RoughRow> SimdKernel for PdfKernel<'_, R> {
    type Output = F32x16;

    #[inline(always)]
    fn run(self, _: impl Simd) -> F32x16 {
        self.row.pdf(self.lobes, self.normals, self.directions, self.values)
    }
}

/// Kernel of [`RoughRow::sample`].
struct SamplingKernel<'a, R> {
    row: &'a R,
    lobes: LobeSet,
    normals: &'a Vec3x16,
    choices: &'a F32x16,
    u: &'a [F32x16; 2],
}

impl<R: RoughRow> SimdKernel for SamplingKernel<'_, R> {
    type Output = Vec3x16;

    #[inline(always)]
    fn run(self, _: impl Simd) -> Vec3x16 {
        self.row.sample(self.lobes, self.normals, self.choices, self.u)
    }
}
