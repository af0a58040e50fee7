//! Layers: quantities recorded along with the beauty image, from the same samples.

use std::ops::Range;

use crate::film::{ALL_LAYER_VALUES, LayerSums};
use crate::math::Vec3;
use crate::math::lanes::Simd;
use crate::world::{InstructionSet, SimdKernel};

/// A quantity recorded along with the beauty image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleLayer {
    /// Diffuse reflectance at the first hit.
    Albedo,
    /// Shading normal at the first hit, in world space. Zero without a hit.
    Normal,
    /// Depth of the first hit along the view axis, or 0 without a hit.
    Depth,
    /// Ambient term.
    Ambient,
    /// Light reflected by diffuse lobes.
    Diffuse,
    /// Light reflected by glossy lobes.
    Specular,
    /// Emission of visible surfaces, and the background.
    Emission,
}

impl SampleLayer {
    /// All layers.
    pub const ALL: [Self; 7] = [
        Self::Albedo,
        Self::Normal,
        Self::Depth,
        Self::Ambient,
        Self::Diffuse,
        Self::Specular,
        Self::Emission,
    ];
}

const _: () = assert!(3 * SampleLayer::ALL.len() == ALL_LAYER_VALUES);

/// A set of layers, ordered as in [`SampleLayer::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LayerSet(u8);

impl LayerSet {
    /// No layers.
    pub const NONE: Self = Self(0);

    const FIRST_HIT: Self =
        Self(1 << SampleLayer::Albedo as u8 | 1 << SampleLayer::Normal as u8 | 1 << SampleLayer::Depth as u8);

    /// Whether the set contains a layer.
    pub fn contains(self, layer: SampleLayer) -> bool {
        self.0 & 1 << layer as u8 != 0
    }

    /// Number of layers.
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether there are no layers.
    pub fn is_empty(self) -> bool {
        self == Self::NONE
    }

    /// The layers, in order.
    pub fn iter(self) -> impl Iterator<Item = SampleLayer> {
        SampleLayer::ALL.into_iter().filter(move |layer| self.contains(*layer))
    }

    /// Whether the set contains a quantity at the first hit.
    pub fn has_first_hit(self) -> bool {
        self.0 & Self::FIRST_HIT.0 != 0
    }

    /// Whether the set contains all quantities at the first hit.
    fn has_all_first_hit(self) -> bool {
        self.0 & Self::FIRST_HIT.0 == Self::FIRST_HIT.0
    }

    /// Whether the set contains a component of the light.
    pub fn has_light(self) -> bool {
        self.0 & !Self::FIRST_HIT.0 != 0
    }
}

impl FromIterator<SampleLayer> for LayerSet {
    fn from_iter<I: IntoIterator<Item = SampleLayer>>(layers: I) -> Self {
        Self(layers.into_iter().fold(0, |bits, layer| bits | 1 << layer as u8))
    }
}

/// Layer values of a batch of samples.
#[derive(Default)]
pub struct SampleBatchLayerValues {
    set: LayerSet,
    /// First slot of the batch.
    first: u32,
    /// Number of values per sample.
    size: usize,
    /// Values of one sample after another, with three components per layer.
    values: Vec<f32>,
    /// Index of each layer's first component among the values of a sample, for layers in the set.
    places: [Option<usize>; SampleLayer::ALL.len()],
    /// The tile's most recent results of [`SampleBatchLayerValues::cached_constant_albedo`], by material
    /// index modulo the array length.
    albedos: [Option<(usize, Option<Vec3>)>; 16],
}

impl SampleBatchLayerValues {
    /// Begins a tile.
    pub fn clear_cached_albedos(&mut self) {
        self.albedos = Default::default();
    }

    /// Returns a material's albedo if it is constant. Calls `evaluate` if the result is not cached.
    pub fn cached_constant_albedo(
        &mut self,
        material: usize,
        evaluate: impl FnOnce() -> Option<Vec3>,
    ) -> Option<Vec3> {
        let known = &mut self.albedos[material % 16];
        match *known {
            Some((own, albedo)) if own == material => albedo,
            Some(_) | None => known.insert((material, evaluate())).1,
        }
    }

    /// Begins a batch with zero values.
    pub fn begin_batch(&mut self, set: LayerSet, slots: &Range<u32>) {
        (self.set, self.first, self.size) = (set, slots.start, 3 * set.len());
        self.places = [None; SampleLayer::ALL.len()];
        for (position, layer) in set.iter().enumerate() {
            self.places[layer as usize] = Some(3 * position);
        }
        self.values.clear();
        self.values.resize(slots.len() * self.size, 0.0);
    }

    /// The layers.
    pub fn layer_set(&self) -> LayerSet {
        self.set
    }

    /// Adds a value to a sample. Does nothing if the set does not contain the layer.
    #[inline]
    pub fn add_to_sample(&mut self, layer: SampleLayer, slot: u32, value: Vec3) {
        let Some(place) = self.places[layer as usize] else { return };
        let start = (slot - self.first) as usize * self.size + place;
        if let Some([x, y, z]) = self.values.get_mut(start..).and_then(<[f32]>::first_chunk_mut) {
            (*x, *y, *z) = (*x + value.x, *y + value.y, *z + value.z);
        }
    }

    /// Adds the albedo, normal and depth at the first hit to a sample. Ignores layers that are not in the
    /// set.
    #[inline]
    pub fn add_first_hit(&mut self, slot: u32, values: [Vec3; 3]) {
        // If the set contains all three, they come first.
        let start = (slot - self.first) as usize * self.size;
        match self.values.get_mut(start..).and_then(<[f32]>::first_chunk_mut::<9>) {
            Some(sums) if self.set.has_all_first_hit() => {
                for (sum, value) in sums.iter_mut().zip(values.map(|value| value.to_array()).as_flattened()) {
                    *sum += value;
                }
            }
            Some(_) | None => {
                for (layer, value) in SampleLayer::ALL.into_iter().zip(values) {
                    self.add_to_sample(layer, slot, value);
                }
            }
        }
    }

    /// Adds one value to each sample from a slot onward. Does nothing if the set does not contain the layer.
    #[inline]
    pub fn add_to_consecutive_samples(
        &mut self,
        layer: SampleLayer,
        slot: u32,
        values: impl Iterator<Item = Vec3>,
    ) {
        let Some(place) = self.places[layer as usize] else { return };
        let start = (slot - self.first) as usize * self.size + place;
        let samples = self.values.get_mut(start..).unwrap_or_default().chunks_mut(self.size);
        for (sample, value) in samples.zip(values) {
            if let Some([x, y, z]) = sample.first_chunk_mut() {
                (*x, *y, *z) = (*x + value.x, *y + value.y, *z + value.z);
            }
        }
    }

    /// Multiplies the light components of all samples by `gain`.
    pub fn scale_light(&mut self, gain: f32) {
        let first_hits =
            self.set.iter().filter(|layer| LayerSet::FIRST_HIT.0 & 1 << *layer as u8 != 0).count();
        for sample in self.values.chunks_mut(self.size.max(1)) {
            sample[3 * first_hits..].iter_mut().for_each(|value| *value *= gain);
        }
    }

    /// Ends the batch and adds its values to the sums of the pixels. There are `samples` samples per pixel.
    /// `radiance` and `is_negative` describe the samples of all pixels. Where the radiance is not finite, all
    /// values are replaced with zero, just as the film replaces the radiance.
    pub fn add_to_sums(
        &mut self,
        sums: &mut LayerSums,
        samples: usize,
        (radiance, is_negative): (&[Vec3], Option<&[bool]>),
        instructions: InstructionSet,
    ) {
        if !self.set.is_empty() {
            instructions.run(LayerSumKernel { values: self, sums, samples, radiance, is_negative });
        }
    }
}

/// Kernel of [`SampleBatchLayerValues::add_to_sums`].
struct LayerSumKernel<'a> {
    values: &'a mut SampleBatchLayerValues,
    sums: &'a mut LayerSums,
    samples: usize,
    radiance: &'a [Vec3],
    is_negative: Option<&'a [bool]>,
}

impl SimdKernel for LayerSumKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, _: impl Simd) {
        let Self { values: SampleBatchLayerValues { first, size, values, .. }, sums, samples, .. } = self;
        let begin = *first as usize;
        let end = begin + values.len() / *size;
        let radiance = &self.radiance[begin..end];
        // Test all samples together first, because this is faster.
        if !radiance.iter().fold(true, |all, value| all & value.is_finite()) {
            for (sample, radiance) in values.chunks_mut(*size).zip(radiance) {
                if !radiance.is_finite() {
                    sample.fill(0.0);
                }
            }
        }
        for pixel in begin / samples..end.div_ceil(samples) {
            let slots = begin.max(pixel * samples)..end.min((pixel + 1) * samples);
            let here = (slots.start - begin) * *size..(slots.end - begin) * *size;
            sums.add_pixel_samples(pixel, &values[here], self.is_negative.map(|signs| &signs[slots]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_keep_the_order_of_all_layers() {
        let set: LayerSet = [SampleLayer::Emission, SampleLayer::Depth].into_iter().collect();
        assert_eq!(set.iter().collect::<Vec<_>>(), [SampleLayer::Depth, SampleLayer::Emission]);
        assert!(set.contains(SampleLayer::Emission) && !set.contains(SampleLayer::Albedo));
        assert!(set.has_first_hit() && set.has_light() && set.len() == 2);
        assert_eq!(LayerSet::FIRST_HIT.iter().collect::<Vec<_>>(), SampleLayer::ALL[..3]);
        assert!(!LayerSet::NONE.has_first_hit() && !LayerSet::NONE.has_light() && LayerSet::NONE.is_empty());
    }

    #[test]
    fn non_finite_samples_are_zero_in_all_layers() {
        let set: LayerSet = [SampleLayer::Depth, SampleLayer::Diffuse].into_iter().collect();
        let (mut values, mut sums) = (SampleBatchLayerValues::default(), LayerSums::zero(set.len(), 2));
        for slots in [0..2, 2..4] {
            values.begin_batch(set, &slots);
            for slot in slots {
                SampleLayer::ALL.iter().for_each(|layer| values.add_to_sample(*layer, slot, Vec3::ONE));
            }
            let radiance = [Vec3::ONE, Vec3::new(0.0, f32::NAN, 0.0), Vec3::ONE, Vec3::ONE];
            values.add_to_sums(&mut sums, 3, (&radiance, None), InstructionSet::Portable);
        }
        let mut expected = LayerSums::zero(set.len(), 2);
        expected.add_pixel_samples(0, &[1.0; 12], None);
        expected.add_pixel_samples(1, &[1.0; 6], None);
        assert_eq!(sums, expected);
    }
}
