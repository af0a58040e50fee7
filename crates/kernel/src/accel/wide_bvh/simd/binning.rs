//! SIMD inner loops for tree construction, with an entire box in each register. The loops compute the same
//! numbers as the scalar code in `build::split`.

use super::InstructionSet;
use crate::accel::reference::{SimdBounds, TriangleReference};
use crate::accel::wide_bvh::build::split::{BinMapping, Histogram};

/// Adds references to a histogram's bins. Returns false and does nothing if the processor lacks AVX2.
pub fn try_add_to_histogram<const N: usize>(
    references: &[TriangleReference],
    bins: &BinMapping,
    into: &mut Histogram<N>,
) -> bool {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::from_environment_or_best() >= InstructionSet::Avx2 {
        // SAFETY: the processor has AVX2.
        unsafe { avx2::add_to_histogram(references, bins, into) };
        return true;
    }
    let _ = (references, bins, into);
    false
}

/// Moves the references below a bin to the front. Returns their number, and the bounding box of the centroids
/// on each side. Returns `None` and does nothing if the processor lacks AVX2.
pub fn try_partition<const AXIS: usize>(
    references: &mut [TriangleReference],
    bin: usize,
    bins: &BinMapping,
) -> Option<(usize, [SimdBounds; 2])> {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::from_environment_or_best() >= InstructionSet::Avx2 {
        // SAFETY: the processor has AVX2.
        return Some(unsafe { avx2::partition::<AXIS>(references, bin, bins) });
    }
    let _ = (references, bin, bins);
    None
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use crate::accel::reference::{SimdBounds, TriangleReference};
    use crate::accel::wide_bvh::build::split::{BINS, BinMapping, Histogram, ROUNDING_OFFSET};
    use crate::math::Vec4;

    /// Loads both corners of a box into one register.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn load_bounds(bounds: &SimdBounds) -> __m256 {
        // SAFETY: a box is eight floats with sufficient alignment.
        unsafe { _mm256_load_ps(std::ptr::from_ref(bounds).cast()) }
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn store_bounds(bounds: __m256, to: &mut SimdBounds) {
        // SAFETY: a box has space for eight floats with sufficient alignment.
        unsafe { _mm256_store_ps(std::ptr::from_mut(to).cast(), bounds) }
    }

    /// SIMD version of [`TriangleReference::centroid`].
    #[target_feature(enable = "avx2")]
    #[inline]
    fn centroid(bounds: __m256) -> __m128 {
        let halves = _mm256_mul_ps(bounds, _mm256_set1_ps(0.5));
        _mm_sub_ps(_mm256_castps256_ps128(halves), _mm256_extractf128_ps::<1>(halves))
    }

    /// SIMD version of `BinMapping::bin_numbers_plus_rounding_offset`.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn bin_numbers_plus_rounding_offset(centroid: __m128, start: __m128, per_length: __m128) -> __m128 {
        let place = _mm_mul_ps(_mm_sub_ps(centroid, start), per_length);
        _mm_add_ps(_mm_sub_ps(place, _mm_set1_ps(0.5)), _mm_set1_ps(ROUNDING_OFFSET))
    }

    #[target_feature(enable = "avx2")]
    pub fn add_to_histogram<const N: usize>(
        references: &[TriangleReference],
        bins: &BinMapping,
        into: &mut Histogram<N>,
    ) {
        let (start, per_length) = (__m128::from(bins.start), __m128::from(bins.per_length));
        for reference in references {
            let bounds = load_bounds(&reference.bounds);
            let places =
                _mm_castps_si128(bin_numbers_plus_rounding_offset(centroid(bounds), start, per_length));
            let places = [
                _mm_extract_epi32::<0>(places),
                _mm_extract_epi32::<1>(places),
                _mm_extract_epi32::<2>(places),
            ];
            for (axis, place) in places.into_iter().enumerate() {
                let bin = place as usize & (BINS - 1);
                let own = &mut into.bounds[bin % N][axis];
                store_bounds(_mm256_min_ps(load_bounds(own), bounds), own);
                into.counts[bin % N][axis] += 1;
            }
        }
    }

    /// Branchless partition, since data-dependent branches would often be mispredicted. Every reference is
    /// swapped with the first one on the right, and then the length of the left side is incremented by 0 or
    /// 1.
    #[target_feature(enable = "avx2")]
    pub fn partition<const AXIS: usize>(
        references: &mut [TriangleReference],
        bin: usize,
        bins: &BinMapping,
    ) -> (usize, [SimdBounds; 2]) {
        let start = _mm_set1_ps(bins.start[AXIS]);
        let per_length = _mm_set1_ps(bins.per_length[AXIS]);
        let first_right = _mm_set1_ps(ROUNDING_OFFSET + bin as f32);
        let nothing = _mm256_set1_ps(f32::INFINITY);
        let minus_high = _mm256_setr_ps(0.0, 0.0, 0.0, 0.0, -0.0, -0.0, -0.0, -0.0);
        let (mut left, mut right) = (nothing, nothing);
        let mut middle = 0;
        for i in 0..references.len() {
            let bounds = load_bounds(&references[i].bounds);
            let other = load_bounds(&references[middle].bounds);
            store_bounds(other, &mut references[i].bounds);
            store_bounds(bounds, &mut references[middle].bounds);
            let centroid = centroid(bounds);
            let along = match AXIS {
                0 => _mm_permute_ps::<0x00>(centroid),
                1 => _mm_permute_ps::<0x55>(centroid),
                _ => _mm_permute_ps::<0xaa>(centroid),
            };
            let is_left =
                _mm_cmplt_ps(bin_numbers_plus_rounding_offset(along, start, per_length), first_right);
            let on_left = _mm256_set_m128(is_left, is_left);
            let both = _mm256_xor_ps(_mm256_set_m128(centroid, centroid), minus_high);
            left = _mm256_min_ps(_mm256_blendv_ps(nothing, both, on_left), left);
            right = _mm256_min_ps(_mm256_blendv_ps(both, nothing, on_left), right);
            middle += (_mm_movemask_ps(is_left) & 1) as usize;
        }
        let corners = |sides: __m256| SimdBounds {
            min: Vec4::from(_mm256_castps256_ps128(sides)),
            minus_max: Vec4::from(_mm256_extractf128_ps::<1>(sides)),
        };
        (middle, [corners(left), corners(right)])
    }
}
