//! Pairs of vectors.

use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

use super::SimdVector;

/// Two vectors used as a single vector of twice the width.
#[derive(Clone, Copy)]
pub struct VectorPair<V>(V, V);

impl<V: SimdVector> Add for VectorPair<V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
}

impl<V: SimdVector> Sub for VectorPair<V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0, self.1 - other.1)
    }
}

impl<V: SimdVector> Mul for VectorPair<V> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0, self.1 * other.1)
    }
}

impl<M: BitAnd<Output = M>> BitAnd for VectorPair<M> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0, self.1 & other.1)
    }
}

impl<M: BitOr<Output = M>> BitOr for VectorPair<M> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0, self.1 | other.1)
    }
}

impl<V: SimdVector> SimdVector for VectorPair<V> {
    const COUNT: usize = 2 * V::COUNT;
    type Mask = VectorPair<V::Mask>;

    #[inline(always)]
    unsafe fn splat(x: f32) -> Self {
        // SAFETY: upheld by the caller.
        unsafe { Self(V::splat(x), V::splat(x)) }
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: upheld by the caller. A pair contains twice as many floats.
        unsafe { Self(V::load(from), V::load(from.add(V::COUNT))) }
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        let (low, high) = to.split_at_mut(V::COUNT);
        self.0.store(low);
        self.1.store(high);
    }

    #[inline(always)]
    fn div(self, divisor: Self) -> Self {
        Self(self.0.div(divisor.0), self.1.div(divisor.1))
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
    fn xor_sign(self, other: Self) -> Self {
        Self(self.0.xor_sign(other.0), self.1.xor_sign(other.1))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        VectorPair(self.0.lt(other.0), self.1.lt(other.1))
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        VectorPair(self.0.le(other.0), self.1.le(other.1))
    }

    #[inline(always)]
    fn eq(self, other: Self) -> Self::Mask {
        VectorPair(self.0.eq(other.0), self.1.eq(other.1))
    }

    #[inline(always)]
    fn select(self, mask: Self::Mask, other: Self) -> Self {
        Self(self.0.select(mask.0, other.0), self.1.select(mask.1, other.1))
    }

    #[inline(always)]
    fn mask_difference(mask: Self::Mask, but: Self::Mask) -> Self::Mask {
        VectorPair(V::mask_difference(mask.0, but.0), V::mask_difference(mask.1, but.1))
    }

    #[inline(always)]
    fn movemask(mask: Self::Mask) -> u32 {
        V::movemask(mask.0) | V::movemask(mask.1) << V::COUNT
    }

    #[inline(always)]
    fn mask_from_bits(bits: u32, like: Self) -> Self::Mask {
        VectorPair(V::mask_from_bits(bits, like.0), V::mask_from_bits(bits >> V::COUNT, like.1))
    }

    #[inline(always)]
    fn max_element(self) -> f32 {
        self.0.max(self.1).max_element()
    }

    #[inline(always)]
    fn min_element(self) -> f32 {
        self.0.min(self.1).min_element()
    }
}
