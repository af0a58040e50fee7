//! Allocates a film's block sums and fills them as blocks complete.

use super::Rect;
use super::sum_order::SumOrder;
use super::sums::{Film, FilmCreationError, Tile, can_allocate, film_and_image_bytes};
use crate::math::DVec3;
use crate::system::memory::try_reserve_exact;

impl Tile {
    /// Moves a pixel's running sum to its block sum if the block is complete.
    pub(super) fn close_pixel_block_if_complete(&mut self, pixel: usize, blocks: SumOrder) {
        let Some(block) = blocks.finished_block_sum_index(self.counts[pixel]) else { return };
        let put = |earlier: &mut [Vec<DVec3>], sums: &mut [DVec3]| {
            if let Some(block) = earlier.get_mut(block) {
                block[pixel] += std::mem::take(&mut sums[pixel]);
            }
        };
        put(&mut self.earlier, &mut self.sums);
        if let Some(negative) = &mut self.negative {
            put(&mut negative.earlier, &mut negative.sums);
        }
    }
}

impl Film {
    /// Sets the summation order for an empty film.
    ///
    /// # Errors
    /// [`FilmCreationError::Memory`] if there is not enough memory for the block sums.
    pub fn with_sum_order(mut self, blocks: SumOrder) -> Result<Self, FilmCreationError> {
        let (crop, kept) = (self.crop_rect(), blocks.block_sums_per_pixel());
        let more = crop.area() as u64 * (kept * size_of::<DVec3>()) as u64;
        let (width, height, bytes) = (self.width(), self.height(), self.memory_bytes() + more);
        let out_of_memory = || FilmCreationError::Memory { width, height, bytes, crop_helps: true };
        if !can_allocate(more) {
            return Err(out_of_memory());
        }
        for tile in 0..self.tile_count() {
            let area = self.tile_rect(tile).map_or(0, |rect| rect.area());
            let mut earlier = Vec::with_capacity(kept);
            for _ in 0..kept {
                let mut sums = Vec::new();
                try_reserve_exact(&mut sums, area).map_err(|_| out_of_memory())?;
                earlier.push(sums);
            }
            self.lock_tile(tile).earlier = earlier;
        }
        self.blocks = blocks;
        Ok(self)
    }

    /// Bytes of memory for the sums of a crop in this summation order, and bytes for the full-size finished
    /// image.
    pub fn crop_sum_and_image_bytes((width, height): (u32, u32), crop: Rect, blocks: SumOrder) -> (u64, u64) {
        let more = crop.area() as u64 * (blocks.block_sums_per_pixel() * size_of::<DVec3>()) as u64;
        let picture = film_and_image_bytes(width, height, Rect { width: 0, height: 0, ..crop });
        (film_and_image_bytes(width, height, crop) - picture + more, picture)
    }

    /// Summation order of the samples.
    pub fn sum_order(&self) -> SumOrder {
        self.blocks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{FilmQuantity, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit_generator;

    #[test]
    fn sample_grouping_does_not_change_block_sums() {
        let mut next = unit_generator(3);
        let values: Vec<f32> = (0..41).map(|_| next() * 1e3).collect();
        let add = |blocks: SumOrder, counts: &[usize]| {
            let film = Film::new(1, 1, None).and_then(|film| film.with_sum_order(blocks)).expect("a film");
            let mut rest = &values[..];
            for &count in counts {
                let (some, others) = rest.split_at(count);
                let rect = Rect { x: 0, y: 0, width: 1, height: 1 };
                let radiance = some.iter().map(|value| Vec3::splat(*value)).collect();
                film.add_samples(
                    0,
                    TileSamples {
                        pixels: rect.into(),
                        samples: count as u32,
                        radiance,
                        negative: None,
                        layers: Default::default(),
                    },
                );
                rest = others;
            }
            let mean = film.lock_tile(0).mean(0).expect("samples");
            assert_eq!(film.pixel(FilmQuantity::Samples, 0, 0), Some(Vec3::splat(41.0)));
            mean.x
        };
        let sum = |values: &[f32]| values.iter().fold(0.0, |sum, value| sum + f64::from(*value));
        let exact = ((sum(&values[..16]) + sum(&values[16..32])) + sum(&values[32..])) / 41.0;
        for counts in [&[41][..], &[1; 41], &[16, 16, 9], &[7, 20, 14]] {
            assert_eq!(add(SumOrder::Blocked, counts).to_bits(), exact.to_bits(), "{counts:?}");
            assert_eq!(add(SumOrder::SeparateBlocks(2), counts).to_bits(), exact.to_bits(), "{counts:?}");
            assert_eq!(add(SumOrder::Sequential, counts).to_bits(), (sum(&values) / 41.0).to_bits());
        }
    }
}
