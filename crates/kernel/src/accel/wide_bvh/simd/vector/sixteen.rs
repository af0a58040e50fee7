//! Sixteen floats in an AVX-512 register.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

use super::{SimdVector, operators};

/// Vector of 16 floats.
#[derive(Clone, Copy)]
pub struct SimdF32x16(pub(in crate::accel::wide_bvh::simd) __m512);

/// Mask of 16 lanes with one bit each.
#[derive(Clone, Copy)]
pub struct Mask16(u16);

operators!(SimdF32x16, _mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps);

impl BitAnd for Mask16 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOr for Mask16 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl SimdVector for SimdF32x16 {
    const COUNT: usize = 16;
    type Mask = Mask16;

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: upheld by the caller.
        Self(unsafe { _mm512_set1_ps(x) })
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: upheld by the caller.
        Self(unsafe { _mm512_loadu_ps(from) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= Self::COUNT);
        // SAFETY: a value of this type exists, and the slice is long enough.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn div(self, divisor: Self) -> Self {
        // SAFETY: a value of this type exists, so the processor has the instructions. Also applies below.
        Self(unsafe { _mm512_div_ps(self.0, divisor.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm512_abs_ps(self.0) })
    }

    #[inline(always)]
    fn xor_sign(self, other: Self) -> Self {
        // SAFETY: as above.
        unsafe {
            let signs = _mm512_and_si512(_mm512_castps_si512(other.0), _mm512_set1_epi32(i32::MIN));
            Self(_mm512_castsi512_ps(_mm512_xor_si512(_mm512_castps_si512(self.0), signs)))
        }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Mask16 {
        // SAFETY: as above.
        Mask16(unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> Mask16 {
        // SAFETY: as above.
        Mask16(unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn eq(self, other: Self) -> Mask16 {
        // SAFETY: as above.
        Mask16(unsafe { _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn select(self, mask: Mask16, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm512_mask_blend_ps(mask.0, other.0, self.0) })
    }

    #[inline(always)]
    fn mask_difference(mask: Mask16, but: Mask16) -> Mask16 {
        Mask16(mask.0 & !but.0)
    }

    #[inline(always)]
    fn movemask(mask: Mask16) -> u32 {
        u32::from(mask.0)
    }

    #[inline(always)]
    fn mask_from_bits(bits: u32, _like: Self) -> Mask16 {
        Mask16(bits as u16)
    }

    #[inline(always)]
    fn max_element(self) -> f32 {
        // SAFETY: as above.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }

    #[inline(always)]
    fn min_element(self) -> f32 {
        // SAFETY: as above.
        unsafe { _mm512_reduce_min_ps(self.0) }
    }
}
