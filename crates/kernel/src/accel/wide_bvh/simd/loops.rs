//! Plain loops, compiled once more for the vector instructions that the processor has. Nothing is reordered, and
//! fused only where the last bits decide nothing: the results have the same bits.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

use super::Instructions;
pub use crate::math::lanes::Loops;
use crate::math::lanes::PlainFolds;
#[cfg(target_arch = "x86_64")]
use crate::math::lanes::{Folds, LANES, Truths};

impl Instructions {
    /// Does the work by these instructions, or by the best that the processor has.
    #[inline]
    pub fn run<L: Loops>(self, work: L) -> L::Done {
        match self.available() {
            Self::Portable => work.run(PlainFolds),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the processor has what is available.
            Self::Avx2 => unsafe { avx2(work) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx512 => unsafe { avx512(work) },
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => work.run(PlainFolds),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx2,fma")]
fn avx2<L: Loops>(work: L) -> L::Done {
    work.run(Avx2Folds(()))
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512<L: Loops>(work: L) -> L::Done {
    work.run(Avx512Folds(()))
}

/// Proof that the processor has AVX2 and FMA.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
struct Avx2Folds(());

#[cfg(target_arch = "x86_64")]
impl Folds for Avx2Folds {
    #[inline(always)]
    fn bits(self, holds: &Truths) -> u32 {
        // SAFETY: a value is made where the processor has AVX2 and FMA alone.
        unsafe { avx2_bits(holds) }
    }

    #[inline(always)]
    fn about(self, a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }

    #[inline(always)]
    fn call<L: Loops>(self, work: L) -> L::Done {
        // SAFETY: as above.
        unsafe { avx2(work) }
    }
}

/// Proof that the processor has AVX-512F, VL, DQ and BW.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
struct Avx512Folds(());

#[cfg(target_arch = "x86_64")]
impl Folds for Avx512Folds {
    #[inline(always)]
    fn bits(self, holds: &Truths) -> u32 {
        // SAFETY: a value is made where the processor has AVX-512F, VL, DQ and BW alone.
        unsafe { avx512_bits(holds) }
    }

    #[inline(always)]
    fn about(self, a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }

    #[inline(always)]
    fn call<L: Loops>(self, work: L) -> L::Done {
        // SAFETY: as above.
        unsafe { avx512(work) }
    }
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2")]
fn avx2_bits(holds: &Truths) -> u32 {
    let (low, high) = holds.split_at(LANES / 2);
    // SAFETY: eight numbers may be read from each half, at any address.
    let [low, high] = [low, high].map(|half| unsafe { _mm256_loadu_ps(half.as_ptr().cast()) });
    (_mm256_movemask_ps(low) | _mm256_movemask_ps(high) << (LANES / 2)) as u32
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512_bits(holds: &Truths) -> u32 {
    // SAFETY: sixteen numbers may be read, at any address.
    let row = unsafe { _mm512_loadu_epi32(holds.as_ptr().cast()) };
    u32::from(_mm512_movepi32_mask(row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::{Folds, truths};

    struct Folding(u32);

    impl Loops for Folding {
        type Done = u32;

        #[inline(always)]
        fn run(self, folds: impl Folds) -> u32 {
            folds.bits(&truths(self.0))
        }
    }

    #[test]
    fn rows_are_folded_into_their_bits_by_all_instructions() {
        for instructions in Instructions::ALL {
            for bits in 0..1 << 16 {
                assert_eq!(instructions.run(Folding(bits)), bits, "{instructions:?}");
            }
        }
    }
}
