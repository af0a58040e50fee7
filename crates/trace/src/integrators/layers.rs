//! Layers: quantities recorded along with the beauty image, from the same samples.

use std::ops::Range;

use arrayvec::ArrayVec;

use crate::film::LayerSums;
use crate::math::Vec3;

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
pub struct SampleLayerValues {
    set: LayerSet,
    /// First slot of the batch.
    first: u32,
    /// Values of each layer.
    lists: [Vec<Vec3>; SampleLayer::ALL.len()],
    /// Layers with values other than zero.
    used: LayerSet,
    /// The tile's most recent results of [`SampleLayerValues::constant_albedo`], by material index modulo the
    /// array length.
    albedos: [Option<(usize, Option<Vec3>)>; 16],
}

impl SampleLayerValues {
    /// Begins a tile.
    pub fn clear_cached_albedos(&mut self) {
        self.albedos = Default::default();
    }

    /// Returns a material's albedo if it is constant. Calls `evaluate` if the result is not cached.
    pub fn constant_albedo(
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
        (self.set, self.first) = (set, slots.start);
        for layer in SampleLayer::ALL {
            let list = &mut self.lists[layer as usize];
            let count = if set.contains(layer) { slots.len() } else { 0 };
            if self.used.contains(layer) {
                list.fill(Vec3::ZERO);
            }
            list.resize(count, Vec3::ZERO);
        }
        self.used = LayerSet::NONE;
    }

    /// The layers.
    pub fn layer_set(&self) -> LayerSet {
        self.set
    }

    /// Values of a layer from a slot onward, or an empty slice if the set does not contain the layer.
    #[inline]
    pub fn values_from(&mut self, layer: SampleLayer, slot: u32) -> &mut [Vec3] {
        self.used.0 |= 1 << layer as u8;
        self.lists[layer as usize].get_mut((slot - self.first) as usize..).unwrap_or_default()
    }

    /// Adds a value to a sample. Does nothing if the set does not contain the layer.
    #[inline]
    pub fn add(&mut self, layer: SampleLayer, slot: u32, value: Vec3) {
        if let Some(sum) = self.values_from(layer, slot).first_mut() {
            *sum += value;
        }
    }

    /// Ends the batch and adds its values to the sums of the pixels. There are `samples` samples per pixel.
    /// `radiance` and `is_negative` describe the samples of all pixels. Where the radiance is not finite, all
    /// values are replaced with zero, just as the film replaces the radiance.
    pub fn add_to_sums(
        &mut self,
        sums: &mut LayerSums,
        samples: usize,
        radiance: &[Vec3],
        is_negative: Option<&[bool]>,
    ) {
        let Some(count) = self.set.iter().next().map(|layer| self.lists[layer as usize].len()) else {
            return;
        };
        let (begin, end) = (self.first as usize, self.first as usize + count);
        let radiance = &radiance[begin..end];
        // Test all samples together first, because this is faster.
        if !radiance.iter().fold(true, |all, value| all & value.is_finite()) {
            for (slot, _) in radiance.iter().enumerate().filter(|(_, value)| !value.is_finite()) {
                self.lists
                    .iter_mut()
                    .filter_map(|list| list.get_mut(slot))
                    .for_each(|value| *value = Vec3::ZERO);
            }
        }
        let used: ArrayVec<(usize, &[Vec3]), 7> = (self.set.iter().enumerate())
            .filter(|(_, layer)| self.used.contains(*layer))
            .map(|(position, layer)| (position, self.lists[layer as usize].as_slice()))
            .collect();
        for pixel in begin / samples..end.div_ceil(samples) {
            let slots = begin.max(pixel * samples)..end.min((pixel + 1) * samples);
            let here = slots.start - begin..slots.end - begin;
            let values: ArrayVec<_, 7> =
                used.iter().map(|(position, values)| (*position, &values[here.clone()])).collect();
            sums.add_pixel_samples(pixel, &values, is_negative.map(|signs| &signs[slots]));
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
        assert!(!LayerSet::NONE.has_first_hit() && !LayerSet::NONE.has_light() && LayerSet::NONE.is_empty());
    }

    #[test]
    fn non_finite_samples_are_zero_in_all_layers() {
        let set: LayerSet = [SampleLayer::Depth, SampleLayer::Diffuse].into_iter().collect();
        let (mut values, mut sums) = (SampleLayerValues::default(), LayerSums::zero(set.len(), 2));
        for slots in [0..2, 2..4] {
            values.begin_batch(set, &slots);
            for slot in slots {
                SampleLayer::ALL.iter().for_each(|layer| values.add(*layer, slot, Vec3::ONE));
            }
            let radiance = [Vec3::ONE, Vec3::new(0.0, f32::NAN, 0.0), Vec3::ONE, Vec3::ONE];
            values.add_to_sums(&mut sums, 3, &radiance, None);
        }
        let mut expected = LayerSums::zero(set.len(), 2);
        for layer in 0..2 {
            expected.add_pixel_samples(0, &[(layer, &[Vec3::ONE; 2])], None);
            expected.add_pixel_samples(1, &[(layer, &[Vec3::ONE])], None);
        }
        assert_eq!(sums, expected);
    }
}
