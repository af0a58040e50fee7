//! A trait for SIMD vectors of all widths, so that each kernel is written only once.
//!
//! Outside this module, values can only be created by unsafe functions whose callers guarantee the
//! instruction set. Inside it, functions compiled with these instructions can also create values. A value
//! therefore proves that the processor has the instructions, which makes the operators safe.

mod eight;
mod four;
mod pair;
mod sixteen;

use std::ops::{Add, BitAnd, BitOr, Mul, Sub};

pub use eight::SimdF32x8;
pub use four::SimdF32x4;
pub use pair::VectorPair;
pub use sixteen::SimdF32x16;

/// A SIMD vector of floats. Comparisons with NaN are false. `min` and `max` return their argument if either
/// operand is NaN.
pub trait SimdVector: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Number of lanes.
    const COUNT: usize;
    /// One Boolean per lane.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    /// Broadcasts a number to all lanes.
    ///
    /// # Safety
    /// The CPU must support the instruction set of this type.
    unsafe fn splat(x: f32) -> Self;

    /// Loads floats from memory.
    ///
    /// # Safety
    /// The CPU must support the instruction set of this type, and `from` must point to [`SimdVector::COUNT`]
    /// floats.
    unsafe fn load(from: *const f32) -> Self;

    /// Broadcasts a number to all lanes.
    #[inline(always)]
    fn splat_like(self, x: f32) -> Self {
        // SAFETY: a value of this type exists, so the processor has the instructions.
        unsafe { Self::splat(x) }
    }

    /// Loads the first [`SimdVector::COUNT`] floats of a slice.
    #[inline(always)]
    fn load_slice(self, from: &[f32]) -> Self {
        assert!(from.len() >= Self::COUNT);
        // SAFETY: a value of this type exists, so the processor has the instructions. The length was checked.
        unsafe { Self::load(from.as_ptr()) }
    }

    /// Stores the lanes into a slice of at least [`SimdVector::COUNT`] floats.
    fn store(self, to: &mut [f32]);
    /// Lane-wise division by `divisor`.
    fn div(self, divisor: Self) -> Self;
    /// Lane-wise minimum.
    fn min(self, other: Self) -> Self;
    /// Lane-wise maximum.
    fn max(self, other: Self) -> Self;
    /// Lane-wise absolute value.
    fn abs(self) -> Self;
    /// Negates the lanes where the sign bit of `other` is set.
    fn xor_sign(self, other: Self) -> Self;
    /// Lane-wise `self` < `other`.
    fn lt(self, other: Self) -> Self::Mask;
    /// Lane-wise `self` ≤ `other`.
    fn le(self, other: Self) -> Self::Mask;
    /// Lane-wise `self` = `other`.
    fn eq(self, other: Self) -> Self::Mask;
    /// Bitwise selection: `self` where the mask is set, `other` elsewhere.
    fn select(self, mask: Self::Mask, other: Self) -> Self;
    /// Lanes set in `mask` but not in `but`.
    fn mask_difference(mask: Self::Mask, but: Self::Mask) -> Self::Mask;
    /// Converts a mask to bits, one per lane.
    fn movemask(mask: Self::Mask) -> u32;
    /// Converts bits to a mask. `like` proves that the processor has the instructions.
    fn mask_from_bits(bits: u32, like: Self) -> Self::Mask;
    /// Maximum of all lanes.
    fn max_element(self) -> f32;
    /// Minimum of all lanes.
    fn min_element(self) -> f32;
}

/// Implements addition, subtraction, and multiplication for a vector type.
macro_rules! operators {
    ($name:ident, $add:ident, $sub:ident, $mul:ident) => {
        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                // SAFETY: a value of this type exists, so the processor has the instructions.
                Self(unsafe { $add(self.0, other.0) })
            }
        }
        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                // SAFETY: a value of this type exists, so the processor has the instructions.
                Self(unsafe { $sub(self.0, other.0) })
            }
        }
        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                // SAFETY: a value of this type exists, so the processor has the instructions.
                Self(unsafe { $mul(self.0, other.0) })
            }
        }
    };
}

/// Implements `&` and `|` for masks with full-width lanes.
macro_rules! wide_mask {
    ($mask:ident, $and:ident, $or:ident) => {
        impl BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                // SAFETY: a value of this type exists, so the processor has the instructions.
                Self(unsafe { $and(self.0, other.0) })
            }
        }
        impl BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                // SAFETY: a value of this type exists, so the processor has the instructions.
                Self(unsafe { $or(self.0, other.0) })
            }
        }
    };
}

use {operators, wide_mask};
