//! Blocks of samples: a pixel's sum is the sum of its blocks, so that machines which render some blocks each get the same bits.

use super::Film;
use super::sums::{Tile, bytes_needed, is_available};
use super::{FilmError, Rect};
use crate::math::DVec3;

/// Samples of a block.
pub const BLOCK: u32 = 16;

/// Order in which the samples of a pixel are added up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blocks {
    /// One after the other.
    #[default]
    Whole,
    /// In blocks of [`BLOCK`] samples, whose sums are added one after the other.
    Added,
    /// In blocks of [`BLOCK`] samples, whose sums stay apart: so many finished ones at most.
    Apart(usize),
}

impl Blocks {
    /// Sums of finished blocks that each pixel keeps.
    pub fn kept(self) -> usize {
        match self {
            Self::Whole => 0,
            Self::Added => 1,
            Self::Apart(count) => count,
        }
    }

    /// Samples that a pixel of `count` samples lacks to the end of its block.
    pub(super) fn samples_to_end(self, count: u32) -> usize {
        match self {
            Self::Whole => usize::MAX,
            Self::Added | Self::Apart(_) => (BLOCK - count % BLOCK) as usize,
        }
    }

    /// Puts the sum of a pixel's block aside if that has all its samples.
    pub(super) fn close(self, tile: &mut Tile, pixel: usize) {
        let count = tile.counts[pixel];
        let finished = match self {
            Self::Whole => return,
            Self::Added | Self::Apart(_) if count == 0 || count % BLOCK != 0 => return,
            Self::Added => 0,
            Self::Apart(_) => (count / BLOCK - 1) as usize,
        };
        let put = |earlier: &mut [Vec<DVec3>], sums: &mut [DVec3]| {
            if let Some(block) = earlier.get_mut(finished) {
                block[pixel] += std::mem::take(&mut sums[pixel]);
            }
        };
        put(&mut tile.earlier, &mut tile.sums);
        if let Some(negative) = &mut tile.negative {
            put(&mut negative.earlier, &mut negative.sums);
        }
    }
}

impl Film {
    /// The same empty film, whose samples are added up in this order.
    ///
    /// # Errors
    /// There is no memory for the sums of the blocks.
    pub fn in_blocks(mut self, blocks: Blocks) -> Result<Self, FilmError> {
        let (crop, kept) = (self.crop(), blocks.kept());
        let more = crop.area() as u64 * (kept * size_of::<DVec3>()) as u64;
        let (width, height, bytes) = (self.width(), self.height(), self.memory_bytes() + more);
        let lacks = || FilmError::Memory { width, height, bytes, crop_helps: true };
        if !is_available(more) {
            return Err(lacks());
        }
        for tile in 0..self.tile_count() {
            let area = self.tile_rect(tile).map_or(0, |rect| rect.area());
            let mut earlier = Vec::with_capacity(kept);
            for _ in 0..kept {
                let mut sums = Vec::new();
                sums.try_reserve_exact(area).map_err(|_| lacks())?;
                earlier.push(sums);
            }
            self.tile(tile).earlier = earlier;
        }
        self.blocks = blocks;
        Ok(self)
    }

    /// Bytes for the sums of a crop whose samples are added up in this order, and for the finished picture of this size.
    pub fn bytes_of((width, height): (u32, u32), crop: Rect, blocks: Blocks) -> (u64, u64) {
        let more = crop.area() as u64 * (blocks.kept() * size_of::<DVec3>()) as u64;
        let picture = bytes_needed(width, height, Rect { width: 0, height: 0, ..crop });
        (bytes_needed(width, height, crop) - picture + more, picture)
    }

    /// Order in which samples are added up.
    pub fn blocks(&self) -> Blocks {
        self.blocks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Quantity, Rect, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit;

    #[test]
    fn a_sum_is_that_of_its_blocks_however_the_samples_come() {
        let mut next = unit(3);
        let values: Vec<f32> = (0..41).map(|_| next() * 1e3).collect();
        let add = |blocks: Blocks, counts: &[usize]| {
            let film = Film::new(1, 1, None).and_then(|film| film.in_blocks(blocks)).expect("a film");
            let mut rest = &values[..];
            for &count in counts {
                let (some, others) = rest.split_at(count);
                let rect = Rect { x: 0, y: 0, width: 1, height: 1 };
                let radiance = some.iter().map(|value| Vec3::splat(*value)).collect();
                film.add(
                    0,
                    &TileSamples { pixels: rect.into(), samples: count as u32, radiance, negative: None },
                );
                rest = others;
            }
            let mean = film.tile(0).mean(0).expect("samples");
            assert_eq!(film.pixel(Quantity::Samples, 0, 0), Some(Vec3::splat(41.0)));
            mean.x
        };
        let sum = |values: &[f32]| values.iter().fold(0.0, |sum, value| sum + f64::from(*value));
        let exact = ((sum(&values[..16]) + sum(&values[16..32])) + sum(&values[32..])) / 41.0;
        for counts in [&[41][..], &[1; 41], &[16, 16, 9], &[7, 20, 14]] {
            assert_eq!(add(Blocks::Added, counts).to_bits(), exact.to_bits(), "{counts:?}");
            assert_eq!(add(Blocks::Apart(2), counts).to_bits(), exact.to_bits(), "{counts:?}");
            assert_eq!(add(Blocks::Whole, counts).to_bits(), (sum(&values) / 41.0).to_bits());
        }
    }
}
