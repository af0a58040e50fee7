//! Recompiles portable loops for several x86-64 instruction sets. Operations are never reordered, and they
//! are fused only where the different rounding cannot affect the final result. Therefore, results are
//! bit-identical on all instruction sets.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

use super::InstructionSet;
use crate::math::lanes::PortableSimd;
pub use crate::math::lanes::SimdKernel;
#[cfg(target_arch = "x86_64")]
use crate::math::lanes::{F32x16, Mask, PACKET_SIZE, Simd};

impl InstructionSet {
    /// Runs a kernel with this instruction set, or with the fastest supported one if the processor lacks it.
    #[inline]
    pub fn run<L: SimdKernel>(self, work: L) -> L::Output {
        match self.or_best_if_unsupported() {
            Self::Portable => PortableSimd.call_out_of_line(work),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `or_best_if_unsupported` returns an instruction set that the processor supports.
            Self::Avx2 => unsafe { run_avx2(work) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx512 => unsafe { run_avx512(work) },
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => PortableSimd.call_out_of_line(work),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<L: SimdKernel>(work: L) -> L::Output {
    work.run(Avx2Simd(()))
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn run_avx512<L: SimdKernel>(work: L) -> L::Output {
    work.run(Avx512Simd(()))
}

/// Proof that the processor supports AVX2 and FMA.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
struct Avx2Simd(());

#[cfg(target_arch = "x86_64")]
impl Simd for Avx2Simd {
    #[inline(always)]
    fn movemask(self, mask: &Mask) -> u32 {
        // SAFETY: values are only created if the processor supports AVX2 and FMA.
        unsafe { avx2_movemask(mask) }
    }

    #[inline(always)]
    fn min_max(self, row: &F32x16, of: u32) -> [f32; 2] {
        // SAFETY: as above.
        unsafe { avx2_min_max_of_lanes(row, of) }
    }

    #[inline(always)]
    fn reciprocals(self, row: &F32x16) -> F32x16 {
        // SAFETY: as above.
        unsafe { avx2_reciprocals(row) }
    }

    #[inline(always)]
    fn mul_add_relaxed(self, a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }

    #[inline(always)]
    fn call_out_of_line<L: SimdKernel>(self, work: L) -> L::Output {
        // SAFETY: as above.
        unsafe { run_avx2(work) }
    }
}

/// Proof that the processor supports AVX-512F, VL, DQ, and BW.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
struct Avx512Simd(());

#[cfg(target_arch = "x86_64")]
impl Simd for Avx512Simd {
    #[inline(always)]
    fn movemask(self, mask: &Mask) -> u32 {
        // SAFETY: values are only created if the processor supports AVX-512F, VL, DQ, and BW.
        unsafe { avx512_movemask(mask) }
    }

    #[inline(always)]
    fn min_max(self, row: &F32x16, of: u32) -> [f32; 2] {
        // SAFETY: as above.
        unsafe { avx512_min_max_of_lanes(row, of) }
    }

    #[inline(always)]
    fn reciprocals(self, row: &F32x16) -> F32x16 {
        // SAFETY: as above.
        unsafe { avx512_reciprocals(row) }
    }

    #[inline(always)]
    fn mul_add_relaxed(self, a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }

    #[inline(always)]
    fn call_out_of_line<L: SimdKernel>(self, work: L) -> L::Output {
        // SAFETY: as above.
        unsafe { run_avx512(work) }
    }
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2")]
fn avx2_movemask(mask: &Mask) -> u32 {
    let (low, high) = mask.split_at(PACKET_SIZE / 2);
    // SAFETY: reads eight numbers from each half; no alignment is required.
    let [low, high] = [low, high].map(|half| unsafe { _mm256_loadu_ps(half.as_ptr().cast()) });
    (_mm256_movemask_ps(low) | _mm256_movemask_ps(high) << (PACKET_SIZE / 2)) as u32
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512_movemask(mask: &Mask) -> u32 {
    // SAFETY: reads 16 numbers; no alignment is required.
    let row = unsafe { _mm512_loadu_epi32(mask.as_ptr().cast()) };
    u32::from(_mm512_movepi32_mask(row))
}

/// [`Simd::min_max`] for two halves, combined in the same order as the portable implementation.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2")]
fn horizontal_min_max(low: __m256, high: __m256) -> [f32; 2] {
    let (min, max) = (_mm256_min_ps(high, low), _mm256_max_ps(high, low));
    let halves = |row: __m256| (_mm256_castps256_ps128(row), _mm256_extractf128_ps::<1>(row));
    let ((low, high), (below, above)) = (halves(min), halves(max));
    let (min, max) = (_mm_min_ps(high, low), _mm_max_ps(above, below));
    let min = _mm_min_ps(_mm_movehl_ps(min, min), min);
    let max = _mm_max_ps(_mm_movehl_ps(max, max), max);
    let min = _mm_min_ss(_mm_movehdup_ps(min), min);
    let max = _mm_max_ss(_mm_movehdup_ps(max), max);
    [_mm_cvtss_f32(min), _mm_cvtss_f32(max)]
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2")]
fn avx2_min_max_of_lanes(row: &F32x16, of: u32) -> [f32; 2] {
    let other = _mm256_set1_ps(row[of.trailing_zeros() as usize % PACKET_SIZE]);
    let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    let (low, high) = row.split_at(PACKET_SIZE / 2);
    let [low, high] = [(low, of), (high, of >> (PACKET_SIZE / 2))].map(|(half, of)| {
        let own = _mm256_and_si256(_mm256_set1_epi32(of as i32), lanes);
        let mask = _mm256_castsi256_ps(_mm256_cmpeq_epi32(own, lanes));
        // SAFETY: reads eight numbers; no alignment is required.
        _mm256_blendv_ps(other, unsafe { _mm256_loadu_ps(half.as_ptr()) }, mask)
    });
    horizontal_min_max(low, high)
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512_min_max_of_lanes(row: &F32x16, of: u32) -> [f32; 2] {
    let other = _mm512_set1_ps(row[of.trailing_zeros() as usize % PACKET_SIZE]);
    // SAFETY: reads 16 numbers; no alignment is required.
    let row = unsafe { _mm512_mask_loadu_ps(other, of as u16, row.as_ptr()) };
    horizontal_min_max(_mm512_castps512_ps256(row), _mm512_extractf32x8_ps::<1>(row))
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2")]
fn avx2_reciprocals(row: &F32x16) -> F32x16 {
    let mut inverse = [0.0; PACKET_SIZE];
    for (own, row) in inverse.chunks_exact_mut(8).zip(row.chunks_exact(8)) {
        // SAFETY: reads and writes eight numbers; no alignment is required.
        unsafe {
            let row = _mm256_loadu_ps(row.as_ptr());
            _mm256_storeu_ps(own.as_mut_ptr(), _mm256_div_ps(_mm256_set1_ps(1.0), row));
        }
    }
    inverse
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512_reciprocals(row: &F32x16) -> F32x16 {
    let mut inverse = [0.0; PACKET_SIZE];
    // SAFETY: reads and writes 16 numbers; no alignment is required.
    unsafe {
        let row = _mm512_loadu_ps(row.as_ptr());
        _mm512_storeu_ps(inverse.as_mut_ptr(), _mm512_div_ps(_mm512_set1_ps(1.0), row));
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::{Simd, mask_from_bits};
    use crate::math::random::signed_number_generator;

    struct MovemaskKernel(u32);

    impl SimdKernel for MovemaskKernel {
        type Output = u32;

        #[inline(always)]
        fn run(self, simd: impl Simd) -> u32 {
            simd.movemask(&mask_from_bits(self.0))
        }
    }

    #[test]
    fn movemask_is_equal_on_all_instruction_sets() {
        for instructions in InstructionSet::ALL {
            for bits in 0..1 << 16 {
                assert_eq!(instructions.run(MovemaskKernel(bits)), bits, "{instructions:?}");
            }
        }
    }

    struct ReductionKernel<'a>(&'a F32x16, u32);

    impl SimdKernel for ReductionKernel<'_> {
        type Output = ([f32; 2], F32x16);

        #[inline(always)]
        fn run(self, simd: impl Simd) -> Self::Output {
            (simd.min_max(self.0, self.1), simd.reciprocals(self.0))
        }
    }

    #[test]
    fn reductions_are_equal_on_all_instruction_sets() {
        let mut next = signed_number_generator(21);
        let odd = [0.0, -0.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e-45, f32::MAX];
        for round in 0..20_000_u32 {
            let mut row: F32x16 = std::array::from_fn(|_| next());
            for i in 0..round as usize % 4 {
                row[(round as usize * 7 + i * 5) % PACKET_SIZE] = odd[(round as usize / 4 + i) % odd.len()];
            }
            let of = (next().to_bits() >> 3 & 0xffff) | 1 << (round % 16);
            let each = InstructionSet::ALL.map(|instructions| instructions.run(ReductionKernel(&row, of)));
            let bits =
                |(span, inverse): ([f32; 2], F32x16)| (span.map(f32::to_bits), inverse.map(f32::to_bits));
            assert!(each.iter().all(|one| bits(*one) == bits(each[0])), "{row:?} {of:b} {each:?}");
            // Without NaN, these are the minimum and the maximum.
            let lanes = || (0..PACKET_SIZE).filter(|i| of >> i & 1 == 1).map(|i| row[i]);
            if !lanes().any(f32::is_nan) {
                let ([min, max], inverse) = each[0];
                assert_eq!(lanes().fold(f32::INFINITY, f32::min), min, "{row:?} {of:b}");
                assert_eq!(lanes().fold(f32::NEG_INFINITY, f32::max), max, "{row:?} {of:b}");
                assert_eq!(inverse[3].to_bits(), (1.0 / row[3]).to_bits());
            }
        }
    }
}
