//! SIMD vectors of all widths behind one trait, so that kernels are written once.
//!
//! Values are created only by unsafe functions, whose callers guarantee the instruction set, or inside this
//! module from a register of a function compiled with the instructions. A value therefore proves that the
//! processor has the instructions, and its operators are safe.

mod eight;
mod four;
mod pair;
mod sixteen;

use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

pub use eight::F8;
pub use four::F4;
pub use pair::VectorPair;
pub use sixteen::F16;

/// A SIMD vector of floats. Comparisons with NaN are false; `min` and `max` return their argument if either
/// is NaN.
pub trait SimdVector: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Number of lanes.
    const COUNT: usize;
    /// One truth value per lane.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    /// Broadcasts a number to all lanes.
    ///
    /// # Safety
    /// The processor must have the instructions of this type.
    unsafe fn splat(x: f32) -> Self;

    /// Loads floats from memory.
    ///
    /// # Safety
    /// The processor must have the instructions of this type, and `from` must point to [`SimdVector::COUNT`]
    /// floats.
    unsafe fn load(from: *const f32) -> Self;

    /// Broadcasts a number to all lanes.
    #[inline(always)]
    fn like(self, x: f32) -> Self {
        // SAFETY: a value of this type exists.
        unsafe { Self::splat(x) }
    }

    /// Loads from a slice with at least [`SimdVector::COUNT`] floats.
    #[inline(always)]
    fn gather(self, from: &[f32]) -> Self {
        assert!(from.len() >= Self::COUNT);
        // SAFETY: a value of this type exists; the length was checked.
        unsafe { Self::load(from.as_ptr()) }
    }

    /// Stores into a slice with at least [`SimdVector::COUNT`] floats.
    fn store(self, to: &mut [f32]);
    /// Divides by `divisor`.
    fn over(self, divisor: Self) -> Self;
    /// Smaller number of each lane.
    fn min(self, other: Self) -> Self;
    /// Larger number of each lane.
    fn max(self, other: Self) -> Self;
    /// Absolute value of each lane.
    fn abs(self) -> Self;
    /// Negates the lanes in which `other` has its sign bit set.
    fn signed_by(self, other: Self) -> Self;
    /// self < other.
    fn lt(self, other: Self) -> Self::Mask;
    /// self ≤ other.
    fn le(self, other: Self) -> Self::Mask;
    /// self = other.
    fn eq(self, other: Self) -> Self::Mask;
    /// Selects `self` where the mask is set and `other` elsewhere, bit for bit.
    fn or_else(self, mask: Self::Mask, other: Self) -> Self;
    /// Lanes set in `mask` but not in `but`.
    fn without(mask: Self::Mask, but: Self::Mask) -> Self::Mask;
    /// Packs a mask into bits, one per lane.
    fn movemask(mask: Self::Mask) -> u32;
    /// Expands bits into a mask; `like` proves that the processor has the instructions.
    fn mask(bits: u32, like: Self) -> Self::Mask;
    /// Maximum of all lanes.
    fn greatest(self) -> f32;
    /// Minimum of all lanes.
    fn least(self) -> f32;
}

/// Implements addition, subtraction and multiplication for a vector type.
macro_rules! operators {
    ($name:ident, $add:ident, $sub:ident, $mul:ident) => {
        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                // SAFETY: a value of this type exists.
                Self(unsafe { $add(self.0, other.0) })
            }
        }
        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                // SAFETY: a value of this type exists.
                Self(unsafe { $sub(self.0, other.0) })
            }
        }
        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                // SAFETY: a value of this type exists.
                Self(unsafe { $mul(self.0, other.0) })
            }
        }
    };
}

/// Implements `&` and `|` for masks as wide as their vectors.
macro_rules! wide_mask {
    ($mask:ident, $and:ident, $or:ident) => {
        impl BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                // SAFETY: a value of this type exists.
                Self(unsafe { $and(self.0, other.0) })
            }
        }
        impl BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                // SAFETY: a value of this type exists.
                Self(unsafe { $or(self.0, other.0) })
            }
        }
    };
}

use {operators, wide_mask};
