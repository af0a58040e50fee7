//! Eight floats in an AVX register.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

use super::{SimdF32x4, SimdVector, operators, wide_mask};

/// Vector of eight floats.
#[derive(Clone, Copy)]
pub struct SimdF32x8(pub(in crate::accel::wide_bvh::simd) __m256);

/// Mask of eight lanes.
#[derive(Clone, Copy)]
pub struct Mask8(__m256);

operators!(SimdF32x8, _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps);
wide_mask!(Mask8, _mm256_and_ps, _mm256_or_ps);

impl SimdVector for SimdF32x8 {
    const COUNT: usize = 8;
    type Mask = Mask8;

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: upheld by the caller.
        Self(unsafe { _mm256_set1_ps(x) })
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: upheld by the caller.
        Self(unsafe { _mm256_loadu_ps(from) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= Self::COUNT);
        // SAFETY: a value of this type exists, and the slice is long enough.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn div(self, divisor: Self) -> Self {
        // SAFETY: a value of this type exists, so the processor has the instructions. Also applies below.
        Self(unsafe { _mm256_div_ps(self.0, divisor.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }

    #[inline(always)]
    fn xor_sign(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(other.0, _mm256_set1_ps(-0.0))) })
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Mask8 {
        // SAFETY: as above.
        Mask8(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> Mask8 {
        // SAFETY: as above.
        Mask8(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn eq(self, other: Self) -> Mask8 {
        // SAFETY: as above.
        Mask8(unsafe { _mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn select(self, mask: Mask8, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_blendv_ps(other.0, self.0, mask.0) })
    }

    #[inline(always)]
    fn mask_difference(mask: Mask8, but: Mask8) -> Mask8 {
        // SAFETY: as above.
        Mask8(unsafe { _mm256_andnot_ps(but.0, mask.0) })
    }

    #[inline(always)]
    fn movemask(mask: Mask8) -> u32 {
        // SAFETY: as above.
        unsafe { _mm256_movemask_ps(mask.0) as u32 }
    }

    #[inline(always)]
    fn mask_from_bits(bits: u32, _like: Self) -> Mask8 {
        // SAFETY: as above.
        unsafe {
            let own = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), own);
            Mask8(_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, own)))
        }
    }

    #[inline(always)]
    fn max_element(self) -> f32 {
        // SAFETY: as above.
        let (low, high) = unsafe { (_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0)) };
        SimdF32x4(low).max(SimdF32x4(high)).max_element()
    }

    #[inline(always)]
    fn min_element(self) -> f32 {
        // SAFETY: as above.
        let (low, high) = unsafe { (_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0)) };
        SimdF32x4(low).min(SimdF32x4(high)).min_element()
    }
}

impl SimdF32x8 {
    /// Computes self · factor − less with a single rounding.
    ///
    /// # Safety
    /// The processor must support fused multiply-add.
    #[inline(always)]
    pub unsafe fn mul_sub(self, factor: Self, less: Self) -> Self {
        // SAFETY: a value of this type exists, and the caller guarantees FMA support.
        Self(unsafe { _mm256_fmsub_ps(self.0, factor.0, less.0) })
    }
}
