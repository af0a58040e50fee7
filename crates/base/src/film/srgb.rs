//! Table-based sRGB encoding to bytes. Matches the formula exactly, but does not call a power function for
//! each channel.

use std::sync::LazyLock;

use crate::math::color;

/// Values below 2⁻¹³ encode to byte 0. The first step is at 0.5/(255·12.92) ≈ 1.5e-4.
const FIRST_EXPONENT_BITS: u32 = (127 - 13) << 23;
const ONE_BITS: u32 = 127 << 23;
/// Each bucket covers 1/256 of an octave, over which the curve rises by less than one byte.
const BUCKET_SHIFT: u32 = 23 - 8;
const BUCKETS: usize = ((ONE_BITS - FIRST_EXPONENT_BITS) >> BUCKET_SHIFT) as usize;

struct Srgb8Table {
    /// Byte at the start of each bucket.
    start: [u8; BUCKETS],
    /// Bits of the smallest float that encodes to byte `i` or more.
    threshold: [u32; 256],
}

static TABLE: LazyLock<Srgb8Table> = LazyLock::new(|| {
    let mut table = Srgb8Table { start: [0; BUCKETS], threshold: [0; 256] };
    for (byte, threshold) in table.threshold.iter_mut().enumerate() {
        *threshold = smallest_bits_for_byte(byte);
    }
    for (bucket, start) in table.start.iter_mut().enumerate() {
        let bits = FIRST_EXPONENT_BITS + ((bucket as u32) << BUCKET_SHIFT);
        *start = color::linear_to_srgb8(f32::from_bits(bits));
    }
    table
});

/// Bits of the smallest float in [0, 1] that encodes to `byte` or more. Bisects over the bits, which have the
/// same order as the floats.
fn smallest_bits_for_byte(byte: usize) -> u32 {
    let (mut low, mut high) = (0, ONE_BITS);
    while low < high {
        let middle = u32::midpoint(low, high);
        if usize::from(color::linear_to_srgb8(f32::from_bits(middle))) >= byte {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}

/// Encodes a linear component, clamped to [0, 1], as an sRGB byte. NaN becomes 0. Returns the same results as
/// [`color::linear_to_srgb8`] but is several times faster.
pub fn linear_to_srgb8_by_table(linear: f32) -> u8 {
    let bits = linear.to_bits();
    if linear.is_nan() || linear < f32::from_bits(FIRST_EXPONENT_BITS) {
        return 0;
    }
    if bits >= ONE_BITS {
        return 255;
    }
    let byte = TABLE.start[((bits - FIRST_EXPONENT_BITS) >> BUCKET_SHIFT) as usize];
    let step = TABLE.threshold.get(usize::from(byte) + 1).is_some_and(|&next| bits >= next);
    byte + u8::from(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_matches_the_formula() {
        // Every 61st float in [0, 2) and the neighbors of every step.
        let spread = (0..=128 << 23).step_by(61);
        let steps = TABLE.threshold.iter().flat_map(|&bits| bits.saturating_sub(40)..=bits + 40);
        for value in spread.chain(steps).map(f32::from_bits) {
            assert_eq!(linear_to_srgb8_by_table(value), color::linear_to_srgb8(value), "{value:e}");
        }
    }

    #[test]
    fn out_of_range_values_are_clamped() {
        for value in [-0.0, -1e-30, -1.0, f32::NEG_INFINITY, f32::NAN, -f32::NAN, f32::MIN_POSITIVE, 1e-45] {
            assert_eq!(linear_to_srgb8_by_table(value), 0, "{value:e}");
        }
        for value in [1.0, 1.000_1, 1e30, f32::MAX, f32::INFINITY] {
            assert_eq!(linear_to_srgb8_by_table(value), 255, "{value:e}");
        }
    }
}
