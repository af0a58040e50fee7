//! Truth values of sixteen lanes as bits.

use std::hint::black_box;

/// A bit for each of sixteen numbers that are 0 or all ones. Compilers take sums of single bits apart into a test of one lane after
/// the other; the hint has them finish the vector first.
#[inline(always)]
pub fn bits(holds: [u32; 16]) -> u32 {
    gathered(&black_box(holds))
}

/// By packing them to bytes, whose signs are gathered: SSE2, which every x86-64 has.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn gathered(holds: &[u32; 16]) -> u32 {
    use std::arch::x86_64::{__m128i, _mm_loadu_si128, _mm_movemask_epi8, _mm_packs_epi16, _mm_packs_epi32};
    let quarters = holds.as_ptr().cast::<__m128i>();
    // SAFETY: the four quarters of the array are read; they need no alignment.
    let bits = unsafe {
        let quarter = |i: usize| _mm_loadu_si128(quarters.add(i));
        let low = _mm_packs_epi32(quarter(0), quarter(1));
        let high = _mm_packs_epi32(quarter(2), quarter(3));
        _mm_movemask_epi8(_mm_packs_epi16(low, high))
    };
    bits as u32
}

#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
fn gathered(holds: &[u32; 16]) -> u32 {
    portable(holds)
}

/// The same by plain Rust.
#[cfg(any(test, not(target_arch = "x86_64")))]
#[inline(always)]
fn portable(holds: &[u32; 16]) -> u32 {
    holds.iter().enumerate().fold(0, |bits, (i, held)| bits | (held & 1 << i))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bit_for_each_lane() {
        for expected in 0..1_u32 << 16 {
            let holds = std::array::from_fn(|i| if expected >> i & 1 == 1 { u32::MAX } else { 0 });
            assert_eq!((bits(holds), portable(&holds)), (expected, expected));
        }
    }
}
