//! Vectors of floats as one type for every width, so that a kernel is written once.
//!
//! A value can be made by unsafe functions alone, whose caller answers for the instructions, or in this folder from a
//! register of a function that has them; where there is a value the instructions are there, which is why its operators are
//! safe.

mod eight;
mod four;
mod pair;
mod sixteen;

use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

pub use eight::F8;
pub use four::F4;
pub use pair::Pair;
pub use sixteen::F16;

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
    /// The least of all.
    fn least(self) -> f32;
}

/// Sums, differences and products of a type around a vector.
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

use {operators, wide_mask};
