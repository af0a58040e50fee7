//! Vectors of floats as one type for every width, so that a kernel is written once.
//!
//! Only unsafe functions make a value, whose caller answers for the instructions, or functions of this folder from a
//! register of a function that has the instructions. A value therefore proves that the processor has them, and its
//! operators are safe.

mod eight;
mod four;
mod pair;
mod sixteen;

use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

pub use eight::F8;
pub use four::F4;
pub use pair::Pair;
pub use sixteen::F16;

/// Floats side by side. Comparisons with NaN are false; `min` and `max` return their argument if either is NaN.
pub trait Lanes: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Number of lanes.
    const COUNT: usize;
    /// A truth value for each lane.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    /// The same number in all lanes.
    ///
    /// # Safety
    /// The processor has the instructions of this type.
    unsafe fn splat(x: f32) -> Self;

    /// Loads floats from memory.
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

    /// Loads from an array of at least as many floats.
    #[inline(always)]
    fn gather(self, from: &[f32]) -> Self {
        assert!(from.len() >= Self::COUNT);
        // SAFETY: there is a value of this type; the length was checked.
        unsafe { Self::load(from.as_ptr()) }
    }

    /// Stores into an array of at least as many floats.
    fn store(self, to: &mut [f32]);
    /// Quotients.
    fn over(self, divisor: Self) -> Self;
    /// Lesser of the two numbers in each lane.
    fn min(self, other: Self) -> Self;
    /// Greater of the two numbers in each lane.
    fn max(self, other: Self) -> Self;
    /// Absolute values.
    fn abs(self) -> Self;
    /// Numbers, negated where `other` is below 0 or −0.
    fn signed_by(self, other: Self) -> Self;
    /// self < other.
    fn lt(self, other: Self) -> Self::Mask;
    /// self ≤ other.
    fn le(self, other: Self) -> Self::Mask;
    /// self = other.
    fn eq(self, other: Self) -> Self::Mask;
    /// `self` where the mask holds, else `other`, bit for bit.
    fn or_else(self, mask: Self::Mask, other: Self) -> Self;
    /// Lanes in which `mask` holds and `but` does not.
    fn without(mask: Self::Mask, but: Self::Mask) -> Self::Mask;
    /// A bit for each lane in which the mask holds.
    fn bits(mask: Self::Mask) -> u32;
    /// The mask of these bits; `like` proves that the processor has the instructions.
    fn mask(bits: u32, like: Self) -> Self::Mask;
    /// Greatest of all lanes.
    fn greatest(self) -> f32;
    /// Least of all lanes.
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
