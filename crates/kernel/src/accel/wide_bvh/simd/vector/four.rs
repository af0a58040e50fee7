//! Four floats in an SSE register.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

use super::{SimdVector, operators, wide_mask};

/// Vector of four floats.
#[derive(Clone, Copy)]
pub struct SimdF32x4(pub(in crate::accel::wide_bvh::simd) __m128);

/// Mask of four lanes.
#[derive(Clone, Copy)]
pub struct Mask4(__m128);

operators!(SimdF32x4, _mm_add_ps, _mm_sub_ps, _mm_mul_ps);
wide_mask!(Mask4, _mm_and_ps, _mm_or_ps);

impl SimdVector for SimdF32x4 {
    const COUNT: usize = 4;
    type Mask = Mask4;

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: upheld by the caller.
        Self(unsafe { _mm_set1_ps(x) })
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: upheld by the caller.
        Self(unsafe { _mm_loadu_ps(from) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= Self::COUNT);
        // SAFETY: a value of this type exists, and the slice is long enough.
        unsafe { _mm_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn div(self, divisor: Self) -> Self {
        // SAFETY: a value of this type exists, so the processor has the instructions. Also applies below.
        Self(unsafe { _mm_div_ps(self.0, divisor.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), self.0) })
    }

    #[inline(always)]
    fn xor_sign(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_xor_ps(self.0, _mm_and_ps(other.0, _mm_set1_ps(-0.0))) })
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Mask4 {
        // SAFETY: as above.
        Mask4(unsafe { _mm_cmplt_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> Mask4 {
        // SAFETY: as above.
        Mask4(unsafe { _mm_cmple_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn eq(self, other: Self) -> Mask4 {
        // SAFETY: as above.
        Mask4(unsafe { _mm_cmpeq_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn select(self, mask: Mask4, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_or_ps(_mm_and_ps(mask.0, self.0), _mm_andnot_ps(mask.0, other.0)) })
    }

    #[inline(always)]
    fn mask_difference(mask: Mask4, but: Mask4) -> Mask4 {
        // SAFETY: as above.
        Mask4(unsafe { _mm_andnot_ps(but.0, mask.0) })
    }

    #[inline(always)]
    fn movemask(mask: Mask4) -> u32 {
        // SAFETY: as above.
        unsafe { _mm_movemask_ps(mask.0) as u32 }
    }

    #[inline(always)]
    fn mask_from_bits(bits: u32, _like: Self) -> Mask4 {
        // SAFETY: as above.
        unsafe {
            let own = _mm_setr_epi32(1, 2, 4, 8);
            Mask4(_mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(_mm_set1_epi32(bits as i32), own), own)))
        }
    }

    #[inline(always)]
    fn max_element(self) -> f32 {
        let mut lanes = [0.0_f32; 4];
        self.store(&mut lanes);
        lanes[0].max(lanes[1]).max(lanes[2].max(lanes[3]))
    }

    #[inline(always)]
    fn min_element(self) -> f32 {
        let mut lanes = [0.0_f32; 4];
        self.store(&mut lanes);
        lanes[0].min(lanes[1]).min(lanes[2].min(lanes[3]))
    }
}
