//! Divides an image among several processes.
//!
//! A share consists of tiles with all their samples. With photons, it instead consists of blocks of samples
//! for all tiles, because photon passes are expensive. If there are more shares than blocks, several shares
//! divide the tiles of a block. Tiles and blocks are assigned in a scrambled order, so that all shares cost
//! about the same. The order is deterministic, so that each process knows its share.

use std::ops::Range;

use crate::film::{BLOCK_SIZE, SumOrder};
use crate::math::random::hash;

/// A share of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// 1-based index of the share.
    pub(crate) index: u32,
    /// Number of shares.
    pub(crate) count: u32,
    /// Samples per pixel in the whole image.
    pub(crate) samples: u32,
    /// Sample blocks in this share, or `None` if the share has all samples of its tiles.
    blocks: Option<Vec<u32>>,
    /// Index and count that divide the tiles among the shares with the same sample blocks.
    of_tiles: (u32, u32),
}

impl Shard {
    /// Creates share `index` of `count` for an image with `samples` samples per pixel. If `has_photons`,
    /// divides the image by photon passes.
    pub(crate) fn new(index: u32, count: u32, has_photons: bool, samples: u32) -> Self {
        let number = index - 1;
        if !has_photons {
            return Self { index, count, samples, blocks: None, of_tiles: (number, count) };
        }
        let order = assignment_order(samples.div_ceil(BLOCK_SIZE));
        let block_count = order.len() as u32;
        let (mut blocks, of_tiles) = if count <= block_count {
            let own = order.iter().skip(number as usize).step_by(count as usize);
            (own.copied().collect::<Vec<_>>(), (0, 1))
        } else {
            let place = number % block_count;
            (vec![order[place as usize]], (number / block_count, (count - place).div_ceil(block_count)))
        };
        blocks.sort_unstable();
        Self { index, count, samples, blocks: Some(blocks), of_tiles }
    }

    /// Returns the number of samples per pixel in this share.
    pub(crate) fn samples_per_pixel(&self) -> u32 {
        match &self.blocks {
            None => self.samples,
            Some(blocks) => blocks.iter().map(|block| self.block_length(*block)).sum(),
        }
    }

    /// Maps this share's samples `own` to sample indices in the whole image, stopping at the end of the
    /// block.
    pub(crate) fn to_global_sample_range(&self, own: Range<u32>) -> Range<u32> {
        let Some(blocks) = &self.blocks else { return own };
        let Some(block) = blocks.get((own.start / BLOCK_SIZE) as usize) else { return own };
        let start = block * BLOCK_SIZE + own.start % BLOCK_SIZE;
        start..(start + (own.end - own.start)).min(block * BLOCK_SIZE + self.block_length(*block))
    }

    /// Returns the order in which samples are summed.
    pub(crate) fn summation_order(&self) -> SumOrder {
        match &self.blocks {
            None => SumOrder::Sequential,
            Some(blocks) => SumOrder::SeparateBlocks(
                blocks.iter().filter(|block| self.block_length(**block) == BLOCK_SIZE).count(),
            ),
        }
    }

    /// Returns this share's sample blocks in sorted order, or no blocks if the share has all samples of its
    /// tiles.
    pub(crate) fn sample_block_indices(&self) -> &[u32] {
        self.blocks.as_deref().unwrap_or_default()
    }

    /// Returns the number of sample blocks in the image, or 0 if shares consist of tiles.
    pub(crate) fn image_sample_block_count(&self) -> u32 {
        if self.blocks.is_some() { self.samples.div_ceil(BLOCK_SIZE) } else { 0 }
    }

    /// Returns, for each of `count` tiles, whether it belongs to this share.
    pub(crate) fn tile_mask(&self, count: usize) -> Vec<bool> {
        let (place, of) = self.of_tiles;
        let mut own = vec![false; count];
        for tile in assignment_order(count as u32).into_iter().skip(place as usize).step_by(of as usize) {
            own[tile as usize] = true;
        }
        own
    }

    /// Returns the number of samples per pixel in a block.
    fn block_length(&self, block: u32) -> u32 {
        (self.samples - block * BLOCK_SIZE).min(BLOCK_SIZE)
    }
}

/// Returns the numbers below `count` in the order of their assignment.
fn assignment_order(count: u32) -> Vec<u32> {
    let mut order: Vec<u32> = (0..count).collect();
    order.sort_by_key(|number| (hash(u64::from(*number)), *number));
    order
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    /// Every sample of every tile must be in exactly one share.
    #[test]
    fn shares_partition_the_samples() {
        for (samples, tiles) in [(1, 1), (16, 6), (250, 7), (256, 40)] {
            for count in [1, 2, 3, 8, 64, 100] {
                for has_photons in [false, true] {
                    let mut seen = HashSet::new();
                    for index in 1..=count {
                        let share = Shard::new(index, count, has_photons, samples);
                        let own = share.tile_mask(tiles);
                        for tile in (0..tiles).filter(|tile| own[*tile]) {
                            let mut done = 0;
                            while done < share.samples_per_pixel() {
                                let numbers = share.to_global_sample_range(done..share.samples_per_pixel());
                                done += numbers.len() as u32;
                                assert!(numbers.clone().all(|number| seen.insert((tile, number))));
                            }
                        }
                    }
                    assert_eq!(
                        seen.len(),
                        tiles * samples as usize,
                        "{samples} {tiles} {count} {has_photons}"
                    );
                }
            }
        }
    }

    #[test]
    fn share_blocks_are_spread_out() {
        let share = Shard::new(1, 2, true, 4096);
        let first = share.sample_block_indices().iter().filter(|block| **block < 128).count();
        assert!((44..=84).contains(&first), "{first} of 128 in the first half");
        assert_eq!(share.summation_order(), SumOrder::SeparateBlocks(128));
        assert_eq!(Shard::new(1, 1, true, 40).summation_order(), SumOrder::SeparateBlocks(2));
        assert_eq!(Shard::new(1, 1, true, 40).image_sample_block_count(), 3);
    }
}
