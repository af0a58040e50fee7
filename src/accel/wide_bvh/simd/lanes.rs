//! Vectors of floats as one type for every width, so that a kernel is written once.
//!
//! A value can be made by unsafe functions alone, whose caller answers for the instructions; where there is a value the
//! instructions are there, which is why its operators are safe.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

/// Floats side by side. Comparisons with NaN are false; `min` and `max` return their argument where either is NaN.
pub trait Lanes: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// How many.
    const COUNT: usize;
    /// A truth value for each.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    /// The same in all.
    ///
    /// # Safety
    /// The processor has the instructions of this type.
    unsafe fn splat(x: f32) -> Self;

    /// From memory.
    ///
    /// # Safety
    /// The processor has the instructions of this type, and `from` points to [`Lanes::COUNT`] floats.
    unsafe fn load(from: *const f32) -> Self;

    /// The same in all lanes.
    #[inline(always)]
    fn like(self, x: f32) -> Self {
        // SAFETY: there is a value of this type.
        unsafe { Self::splat(x) }
    }

    /// From an array of at least as many.
    #[inline(always)]
    fn gather(self, from: &[f32]) -> Self {
        assert!(from.len() >= Self::COUNT);
        // SAFETY: there is a value of this type; the length was checked.
        unsafe { Self::load(from.as_ptr()) }
    }

    /// Into an array of at least as many.
    fn store(self, to: &mut [f32]);
    /// Quotients.
    fn over(self, divisor: Self) -> Self;
    /// The lesser ones.
    fn min(self, other: Self) -> Self;
    /// The greater ones.
    fn max(self, other: Self) -> Self;
    /// Without sign.
    fn abs(self) -> Self;
    /// self < other.
    fn lt(self, other: Self) -> Self::Mask;
    /// self ≤ other.
    fn le(self, other: Self) -> Self::Mask;
    /// self = other.
    fn eq(self, other: Self) -> Self::Mask;
    /// `self` where the mask holds, else `other`, bit for bit.
    fn or_else(self, mask: Self::Mask, other: Self) -> Self;
    /// Where `mask` holds and `but` does not.
    fn without(mask: Self::Mask, but: Self::Mask) -> Self::Mask;
    /// A bit for each lane.
    fn bits(mask: Self::Mask) -> u32;
    /// The other way round; `like` says that the instructions are there.
    fn mask(bits: u32, like: Self) -> Self::Mask;
    /// The greatest of all.
    fn greatest(self) -> f32;
}

macro_rules! operators {
    ($name:ident, $add:ident, $sub:ident, $mul:ident) => {
        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                // SAFETY: there is a value of this type.
                Self(unsafe { $add(self.0, other.0) })
            }
        }
        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                // SAFETY: there is a value of this type.
                Self(unsafe { $sub(self.0, other.0) })
            }
        }
        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                // SAFETY: there is a value of this type.
                Self(unsafe { $mul(self.0, other.0) })
            }
        }
    };
}

/// Masks that are as wide as the vectors.
macro_rules! wide_mask {
    ($mask:ident, $and:ident, $or:ident) => {
        impl BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                // SAFETY: there is a value of this type.
                Self(unsafe { $and(self.0, other.0) })
            }
        }
        impl BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                // SAFETY: there is a value of this type.
                Self(unsafe { $or(self.0, other.0) })
            }
        }
    };
}

/// Four floats.
#[derive(Clone, Copy)]
pub struct F4(pub __m128);

/// Four truth values.
#[derive(Clone, Copy)]
pub struct Mask4(__m128);

operators!(F4, _mm_add_ps, _mm_sub_ps, _mm_mul_ps);
wide_mask!(Mask4, _mm_and_ps, _mm_or_ps);

impl Lanes for F4 {
    const COUNT: usize = 4;
    type Mask = Mask4;

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: the caller's.
        Self(unsafe { _mm_set1_ps(x) })
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller's.
        Self(unsafe { _mm_loadu_ps(from) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= Self::COUNT);
        // SAFETY: there is a value of this type, and room.
        unsafe { _mm_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        // SAFETY: there is a value of this type; so below.
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
    fn or_else(self, mask: Mask4, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm_or_ps(_mm_and_ps(mask.0, self.0), _mm_andnot_ps(mask.0, other.0)) })
    }

    #[inline(always)]
    fn without(mask: Mask4, but: Mask4) -> Mask4 {
        // SAFETY: as above.
        Mask4(unsafe { _mm_andnot_ps(but.0, mask.0) })
    }

    #[inline(always)]
    fn bits(mask: Mask4) -> u32 {
        // SAFETY: as above.
        unsafe { _mm_movemask_ps(mask.0) as u32 }
    }

    #[inline(always)]
    fn mask(bits: u32, _like: Self) -> Mask4 {
        // SAFETY: as above.
        unsafe {
            let own = _mm_setr_epi32(1, 2, 4, 8);
            Mask4(_mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(_mm_set1_epi32(bits as i32), own), own)))
        }
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        let mut lanes = [0.0_f32; 4];
        self.store(&mut lanes);
        lanes[0].max(lanes[1]).max(lanes[2].max(lanes[3]))
    }
}

/// Eight floats.
#[derive(Clone, Copy)]
pub struct F8(pub __m256);

/// Eight truth values.
#[derive(Clone, Copy)]
pub struct Mask8(__m256);

operators!(F8, _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps);
wide_mask!(Mask8, _mm256_and_ps, _mm256_or_ps);

impl Lanes for F8 {
    const COUNT: usize = 8;
    type Mask = Mask8;

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: the caller's.
        Self(unsafe { _mm256_set1_ps(x) })
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller's.
        Self(unsafe { _mm256_loadu_ps(from) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= Self::COUNT);
        // SAFETY: there is a value of this type, and room.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        // SAFETY: there is a value of this type; so below.
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
    fn or_else(self, mask: Mask8, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm256_blendv_ps(other.0, self.0, mask.0) })
    }

    #[inline(always)]
    fn without(mask: Mask8, but: Mask8) -> Mask8 {
        // SAFETY: as above.
        Mask8(unsafe { _mm256_andnot_ps(but.0, mask.0) })
    }

    #[inline(always)]
    fn bits(mask: Mask8) -> u32 {
        // SAFETY: as above.
        unsafe { _mm256_movemask_ps(mask.0) as u32 }
    }

    #[inline(always)]
    fn mask(bits: u32, _like: Self) -> Mask8 {
        // SAFETY: as above.
        unsafe {
            let own = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), own);
            Mask8(_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, own)))
        }
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        // SAFETY: as above.
        let (low, high) = unsafe { (_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0)) };
        F4(low).max(F4(high)).greatest()
    }
}

/// Sixteen floats in one register.
#[derive(Clone, Copy)]
pub struct F16(pub __m512);

/// Sixteen truth values, a bit each.
#[derive(Clone, Copy)]
pub struct Mask16(u16);

operators!(F16, _mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps);

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

impl Lanes for F16 {
    const COUNT: usize = 16;
    type Mask = Mask16;

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: the caller's.
        Self(unsafe { _mm512_set1_ps(x) })
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller's.
        Self(unsafe { _mm512_loadu_ps(from) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= Self::COUNT);
        // SAFETY: there is a value of this type, and room.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        // SAFETY: there is a value of this type; so below.
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
    fn or_else(self, mask: Mask16, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { _mm512_mask_blend_ps(mask.0, other.0, self.0) })
    }

    #[inline(always)]
    fn without(mask: Mask16, but: Mask16) -> Mask16 {
        Mask16(mask.0 & !but.0)
    }

    #[inline(always)]
    fn bits(mask: Mask16) -> u32 {
        u32::from(mask.0)
    }

    #[inline(always)]
    fn mask(bits: u32, _like: Self) -> Mask16 {
        Mask16(bits as u16)
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        // SAFETY: as above.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }
}

/// Two vectors as one of twice as many floats.
#[derive(Clone, Copy)]
pub struct Pair<V>(V, V);

impl<V: Lanes> Add for Pair<V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
}

impl<V: Lanes> Sub for Pair<V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0, self.1 - other.1)
    }
}

impl<V: Lanes> Mul for Pair<V> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0, self.1 * other.1)
    }
}

impl<M: BitAnd<Output = M>> BitAnd for Pair<M> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0, self.1 & other.1)
    }
}

impl<M: BitOr<Output = M>> BitOr for Pair<M> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0, self.1 | other.1)
    }
}

impl<V: Lanes> Lanes for Pair<V> {
    const COUNT: usize = 2 * V::COUNT;
    type Mask = Pair<V::Mask>;

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: the caller's.
        unsafe { Self(V::splat(x), V::splat(x)) }
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller's: there are twice as many.
        unsafe { Self(V::load(from), V::load(from.add(V::COUNT))) }
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        let (low, high) = to.split_at_mut(V::COUNT);
        self.0.store(low);
        self.1.store(high);
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        Self(self.0.over(divisor.0), self.1.over(divisor.1))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0), self.1.max(other.1))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs(), self.1.abs())
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        Pair(self.0.lt(other.0), self.1.lt(other.1))
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        Pair(self.0.le(other.0), self.1.le(other.1))
    }

    #[inline(always)]
    fn eq(self, other: Self) -> Self::Mask {
        Pair(self.0.eq(other.0), self.1.eq(other.1))
    }

    #[inline(always)]
    fn or_else(self, mask: Self::Mask, other: Self) -> Self {
        Self(self.0.or_else(mask.0, other.0), self.1.or_else(mask.1, other.1))
    }

    #[inline(always)]
    fn without(mask: Self::Mask, but: Self::Mask) -> Self::Mask {
        Pair(V::without(mask.0, but.0), V::without(mask.1, but.1))
    }

    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        V::bits(mask.0) | V::bits(mask.1) << V::COUNT
    }

    #[inline(always)]
    fn mask(bits: u32, like: Self) -> Self::Mask {
        Pair(V::mask(bits, like.0), V::mask(bits >> V::COUNT, like.1))
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        self.0.max(self.1).greatest()
    }
}
