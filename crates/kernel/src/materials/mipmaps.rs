//! Mip levels of a texture. Each has half as many columns and rows as the previous one (Williams, *Pyramidal
//! Parametrics*, 1983).

use std::iter::Sum;
use std::ops::Mul;

use super::texels::{TexelData, Texels};
use crate::math::{Vec3, Vec4};

/// The mip levels of an image in linear color space, not including the image itself. The last level has one
/// texel.
#[derive(Clone, Debug, PartialEq)]
pub struct Mipmaps {
    levels: Vec<Texels>,
}

impl Mipmaps {
    /// Computes each level from the previous one with `halve`.
    ///
    /// # Errors
    /// The first error returned by `halve`.
    pub fn build<E>(texels: &Texels, halve: impl Fn(&Texels) -> Result<Texels, E>) -> Result<Self, E> {
        let mut levels: Vec<Texels> = Vec::new();
        while let last = levels.last().unwrap_or(texels)
            && last.len() > 1
        {
            levels.push(halve(last)?);
        }
        Ok(Self { levels })
    }

    /// Returns level `number` ≥ 1, or the last level if there are fewer.
    pub fn level(&self, number: usize) -> Option<&Texels> {
        self.levels.get(number - 1).or(self.levels.last())
    }

    /// Number of levels, not counting the original image.
    pub fn reduced_level_count(&self) -> usize {
        self.levels.len()
    }

    /// Memory used by the levels, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.levels.iter().map(Texels::memory_bytes).sum()
    }

    /// Memory in bytes that the mip levels of an image of this size need. `has_alpha` is true for images with
    /// alpha.
    pub fn estimate_memory_bytes(width: u32, height: u32, has_alpha: bool) -> u64 {
        let texel_bytes = if has_alpha { size_of::<Vec4>() } else { size_of::<Vec3>() };
        let (mut width, mut height, mut bytes) = (u64::from(width), u64::from(height), 0);
        while width * height > 1 {
            (width, height) = ((width / 2).max(1), (height / 2).max(1));
            bytes += width * height * texel_bytes as u64;
        }
        bytes
    }
}

/// Halves an image row by row.
pub struct ImageHalver<'a> {
    of: &'a Texels,
    width: u32,
    height: u32,
}

impl<'a> ImageHalver<'a> {
    /// Creates a halver for an image.
    pub fn new(of: &'a Texels) -> Self {
        Self { of, width: (of.width / 2).max(1), height: (of.height / 2).max(1) }
    }

    /// Number of rows in the smaller image.
    pub fn halved_height(&self) -> u32 {
        self.height
    }

    /// Creates empty storage for the rows of the smaller image.
    pub fn allocate_halved_rows(&self) -> TexelData {
        let count = self.width as usize * self.height as usize;
        if self.of.has_alpha() {
            TexelData::FloatAlpha(Vec::with_capacity(count))
        } else {
            TexelData::Float(Vec::with_capacity(count))
        }
    }

    /// Appends a row of the smaller image. Each texel is the mean over the area that it covers in the larger
    /// image, which preserves the overall mean even for odd sizes.
    pub fn append_halved_row(&self, y: u32, to: &mut TexelData) {
        let rows = DownsampleTaps::new(y, self.height, self.of.height);
        for x in 0..self.width {
            let columns = DownsampleTaps::new(x, self.width, self.of.width);
            match to {
                TexelData::FloatAlpha(texels) => {
                    let texel = |x: u32, y: u32| {
                        self.of.premultiplied_texel(y as usize * self.of.width as usize + x as usize)
                    };
                    texels.push(rows.mean(|y| columns.mean(|x| texel(x, y))));
                }
                TexelData::Float(texels) => texels.push(rows.mean(|y| columns.mean(|x| self.of.get(x, y)))),
                TexelData::Srgb8(_)
                | TexelData::Linear8(_)
                | TexelData::SrgbAlpha8(_)
                | TexelData::LinearAlpha8(_) => {}
            }
        }
    }

    /// Assembles the smaller image from its rows.
    pub fn assemble_image(&self, rows: TexelData) -> Texels {
        Texels { width: self.width, height: self.height, data: rows, unusable: 0 }
    }
}

/// The texels of the larger image (up to three) that one texel of the smaller image covers along an axis.
struct DownsampleTaps {
    first: u32,
    weights: [f32; 3],
}

impl DownsampleTaps {
    fn new(index: u32, of: u32, from: u32) -> Self {
        // In a common unit of length, a texel of the larger image is `of` wide and a texel of the smaller
        // image is `from` wide.
        let (start, end) = (u64::from(index) * u64::from(from), u64::from(index + 1) * u64::from(from));
        let first = start / u64::from(of);
        let weight = |next: u64| {
            let left = ((first + next) * u64::from(of)).max(start);
            let right = ((first + next + 1) * u64::from(of)).min(end);
            right.saturating_sub(left) as f32 / from as f32
        };
        Self { first: first as u32, weights: [weight(0), weight(1), weight(2)] }
    }

    fn mean<T: Mul<f32, Output = T> + Sum>(&self, of: impl Fn(u32) -> T) -> T {
        let covered = self.weights.iter().zip(self.first..).filter(|(weight, _)| **weight > 0.0);
        covered.map(|(weight, place)| of(place) * *weight).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn halved(of: &Texels) -> Result<Texels, ()> {
        let halving = ImageHalver::new(of);
        let mut rows = halving.allocate_halved_rows();
        (0..halving.halved_height()).for_each(|y| halving.append_halved_row(y, &mut rows));
        Ok(halving.assemble_image(rows))
    }

    fn image(width: u32, height: u32) -> Texels {
        let value = |i: u32| Vec3::new((i * 7 % 11) as f32, (i % 5) as f32, (i * i % 3) as f32);
        let data = TexelData::Float((0..width * height).map(value).collect());
        Texels { width, height, data, unusable: 0 }
    }

    #[test]
    fn every_level_preserves_the_mean() {
        for (width, height) in [(1, 1), (2, 2), (64, 32), (5, 3), (7, 1), (13, 64), (100, 37)] {
            let image = image(width, height);
            let mipmaps = Mipmaps::build(&image, halved).expect("halving succeeds");
            assert_eq!(mipmaps.memory_bytes() as u64, Mipmaps::estimate_memory_bytes(width, height, false));
            for number in 1..=mipmaps.reduced_level_count() {
                let level = mipmaps.level(number).expect("the level exists");
                assert_eq!(
                    (level.width, level.height),
                    ((width >> number).max(1), (height >> number).max(1))
                );
                assert!((level.mean() - image.mean()).length() < 1e-5, "{width}×{height}, level {number}");
            }
            let last = mipmaps.level(99).unwrap_or(&image);
            assert_eq!(last.len(), 1, "{width}×{height}");
        }
    }

    #[test]
    fn odd_sizes_weight_partly_covered_texels() {
        let four = Texels {
            width: 2,
            height: 2,
            data: TexelData::Srgb8(vec![[0; 3], [0; 3], [255; 3], [255; 3]]),
            unusable: 0,
        };
        // The mean is computed in linear light, not from the bytes.
        assert_eq!(halved(&four).expect("halving succeeds").get(0, 0), Vec3::splat(0.5));
        let line = |values: &[f32]| Texels {
            width: values.len() as u32,
            height: 1,
            data: TexelData::Float(values.iter().map(|value| Vec3::splat(*value)).collect()),
            unusable: 0,
        };
        let five = halved(&line(&[10.0, 20.0, 30.0, 40.0, 50.0])).expect("halving succeeds");
        assert_eq!([five.get(0, 0).x, five.get(1, 0).x], [18.0, 42.0]);
    }
}
