//! Per-pixel sums of layer values.

use super::sum_order::add_finite_and_count_non_finite;
use crate::math::{DVec3, Vec3};

/// Number of values per sample if all layers are recorded. [`LayerSums::add_pixel_samples`] is fastest for
/// this number.
pub const ALL_LAYER_VALUES: usize = 21;

/// Sums of the layers' values for a set of pixels, stored pixel by pixel. The sample counts are the image's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LayerSums {
    /// Number of layers.
    pub(super) count: usize,
    pub(super) sums: Vec<DVec3>,
    /// Sums of the samples in the filter's negative lobes, which `sums` excludes. Empty if there are no
    /// such samples.
    pub(super) negative: Vec<DVec3>,
}

impl LayerSums {
    /// Creates sums of zero for `count` layers and `area` pixels.
    pub fn zero(count: usize, area: usize) -> Self {
        Self { count, sums: vec![DVec3::ZERO; count * area], negative: Vec::new() }
    }

    /// Adds consecutive samples to a pixel. Each sample has three values per layer. `is_negative` contains
    /// one flag per sample if the filter has negative lobes. Non-finite values are treated as black.
    #[inline(always)]
    pub fn add_pixel_samples(&mut self, pixel: usize, values: &[f32], is_negative: Option<&[bool]>) {
        let (pixel, size) = (pixel * self.count..(pixel + 1) * self.count, 3 * self.count);
        let Some(is_negative) = is_negative else {
            let sums = &mut self.sums[pixel];
            if !try_add_all_layer_samples(bytemuck::cast_slice_mut(sums), values) {
                values.chunks_exact(size).for_each(|sample| add_finite_layers(sums, sample));
            }
            return;
        };
        self.negative.resize(self.sums.len(), DVec3::ZERO);
        for (sample, &is_negative) in values.chunks_exact(size).zip(is_negative) {
            let sums = if is_negative { &mut self.negative } else { &mut self.sums };
            add_finite_layers(&mut sums[pixel.clone()], sample);
        }
    }

    /// Resizes the sums to `area` pixels. Cannot fail because the film reserved the memory.
    pub(super) fn resize(&mut self, area: usize) {
        self.sums.resize(area * self.count, DVec3::ZERO);
    }

    /// Replaces the sums of all pixels and returns the previous sums. If the sizes differ, does nothing and
    /// returns `other`.
    pub(super) fn replace_if_same_size(&mut self, mut other: Self) -> Self {
        if self.sums.len() == other.sums.len() {
            std::mem::swap(self, &mut other);
        }
        other
    }

    /// Sets the sums to zero for `count` layers and `area` pixels, reusing memory.
    pub(super) fn reset(&mut self, count: usize, area: usize) {
        self.count = count;
        self.sums.clear();
        self.resize(area);
        self.negative.clear();
    }

    /// Copies other sums, reusing memory.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.count = other.count;
        self.sums.clone_from(&other.sums);
        self.negative.clone_from(&other.negative);
    }

    /// Replaces a pixel's sums with those of pixel `from` in `other`.
    pub(super) fn replace_pixel(&mut self, pixel: usize, other: &Self, from: usize) {
        let [to, from] = [pixel, from].map(|pixel| pixel * self.count..(pixel + 1) * self.count);
        let (Some(sums), true) = (other.sums.get(from.clone()), self.count == other.count) else { return };
        self.sums[to.clone()].copy_from_slice(sums);
        if let Some(negative) = other.negative.get(from) {
            self.negative.resize(self.sums.len(), DVec3::ZERO);
            self.negative[to].copy_from_slice(negative);
        }
    }
}

/// Adds the finite layer values of a sample.
fn add_finite_layers(sums: &mut [DVec3], sample: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(sample.as_chunks::<3>().0) {
        add_finite_and_count_non_finite(sum, &[Vec3::from_array(*value)]);
    }
}

/// Adds samples with values of all layers. Because their number is constant, the loops compile to vector
/// instructions. Does nothing and returns false if only some layers are recorded, or if a sum would not be
/// finite.
#[inline(always)]
fn try_add_all_layer_samples(sums: &mut [f64], values: &[f32]) -> bool {
    let Some(sums) = sums.as_mut_array::<ALL_LAYER_VALUES>() else { return false };
    let mut totals = *sums;
    for sample in values.as_chunks::<ALL_LAYER_VALUES>().0 {
        for (total, value) in totals.iter_mut().zip(sample) {
            *total += f64::from(*value);
        }
    }
    let is_finite = totals.iter().fold(true, |all, total| all & total.is_finite());
    if is_finite {
        *sums = totals;
    }
    is_finite
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::unit_generator;

    #[test]
    fn non_finite_layer_values_are_black() {
        for count in [2, ALL_LAYER_VALUES / 3] {
            for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let mut sums = LayerSums::zero(count, 2);
                let mut samples = vec![1.0; 2 * 3 * count];
                samples[1] = value;
                sums.add_pixel_samples(1, &samples, None);
                let (first, second) = sums.sums.split_at(count);
                assert_eq!(first, vec![DVec3::ZERO; count]);
                assert_eq!((second[0], &second[1..]), (DVec3::ONE, &*vec![DVec3::splat(2.0); count - 1]));
            }
        }
    }

    #[test]
    fn samples_are_added_in_sequence() {
        let mut next = unit_generator(4);
        for count in 1..=9 {
            let mut layers =
                || -> Vec<Vec3> { (0..count).map(|_| Vec3::new(next(), next() * 1e9, next())).collect() };
            let samples = [layers(), layers(), layers()];
            let mut sums = LayerSums::zero(count, 1);
            for _ in 0..2 {
                let values: Vec<f32> = samples.iter().flatten().flat_map(Vec3::to_array).collect();
                sums.add_pixel_samples(0, &values, None);
            }
            for layer in 0..count {
                let both = samples.iter().chain(&samples);
                let expected = both.fold(DVec3::ZERO, |sum, layers| sum + layers[layer].as_dvec3());
                assert_eq!(sums.sums[layer], expected, "layer {layer} of {count}");
            }
        }
    }
}
