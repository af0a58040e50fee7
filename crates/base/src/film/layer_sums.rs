//! Per-pixel sums of layer values.

use super::sum_order::add_finite_and_count_non_finite;
use crate::math::{DVec3, Vec3};

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

    /// Adds consecutive samples to a pixel. `layers` contains the index of each layer with its sample values.
    /// `is_negative` contains one flag per sample if the filter has negative lobes. Non-finite values are
    /// treated as black.
    pub fn add_pixel_samples(
        &mut self,
        pixel: usize,
        layers: &[(usize, &[Vec3])],
        is_negative: Option<&[bool]>,
    ) {
        let first = pixel * self.count;
        let Some(is_negative) = is_negative else {
            let sums = &mut self.sums[first..first + self.count];
            // Add four layers at a time, because the additions to one sum depend on each other.
            let (groups, rest) = layers.as_chunks::<4>();
            for group in groups {
                add_samples_to_four_layers(sums, group);
            }
            for (layer, values) in rest {
                add_finite_and_count_non_finite(&mut sums[*layer], values);
            }
            return;
        };
        self.negative.resize(self.sums.len(), DVec3::ZERO);
        for (layer, values) in layers {
            for (value, &is_negative) in values.iter().zip(is_negative) {
                let sums = if is_negative { &mut self.negative } else { &mut self.sums };
                add_finite_and_count_non_finite(&mut sums[first + layer], std::slice::from_ref(value));
            }
        }
    }

    /// Resizes the sums to `area` pixels. Cannot fail because the film reserved the memory.
    pub(super) fn resize(&mut self, area: usize) {
        self.sums.resize(area * self.count, DVec3::ZERO);
    }

    /// Replaces the sums of all pixels. Allocates memory only for the sums of negative lobes.
    pub(super) fn replace_all(&mut self, other: &Self) {
        if self.sums.len() == other.sums.len() {
            self.sums.copy_from_slice(&other.sums);
            self.negative.clone_from(&other.negative);
        }
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

/// Adds the samples of four layers at once, with the same result as adding each layer separately.
fn add_samples_to_four_layers(sums: &mut [DVec3], layers: &[(usize, &[Vec3]); 4]) {
    let mut all = layers.map(|(layer, _)| sums[layer]);
    let [a, b, c, d] = layers.map(|(_, values)| values);
    for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
        for (sum, value) in all.iter_mut().zip([a, b, c, d]) {
            *sum += value.as_dvec3();
        }
    }
    for ((layer, values), sum) in layers.iter().zip(all) {
        if sum.is_finite() {
            sums[*layer] = sum;
        } else {
            add_finite_and_count_non_finite(&mut sums[*layer], values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::unit_generator;

    #[test]
    fn non_finite_layer_values_are_black() {
        let values = [Vec3::new(f32::NAN, 1.0, 1.0), Vec3::ONE, Vec3::ONE];
        let mut sums = LayerSums::zero(2, 2);
        sums.add_pixel_samples(1, &[(0, &values)], None);
        assert_eq!(sums.sums, [DVec3::ZERO, DVec3::ZERO, DVec3::splat(2.0), DVec3::ZERO]);
    }

    #[test]
    fn adding_four_layers_is_bit_identical() {
        let mut next = unit_generator(4);
        let mut list = || (0..7).map(|_| Vec3::new(next(), next() * 1e9, next())).collect::<Vec<_>>();
        let mut lists = [list(), list(), list(), list(), list()];
        lists[2][5].y = f32::INFINITY;
        let (mut together, mut separate) = (LayerSums::zero(5, 1), LayerSums::zero(5, 1));
        let layers: Vec<(usize, &[Vec3])> = lists.iter().map(Vec::as_slice).enumerate().collect();
        for _ in 0..2 {
            together.add_pixel_samples(0, &layers, None);
            layers.iter().for_each(|layer| separate.add_pixel_samples(0, &[*layer], None));
        }
        assert_eq!(together, separate);
    }
}
