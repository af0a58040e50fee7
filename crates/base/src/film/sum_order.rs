//! Sample blocks: a pixel's sum is the sum of its blocks, so the result has the same bits even if different
//! machines render different blocks.

use crate::math::{DVec3, Vec3};

/// Samples per block.
pub const BLOCK_SIZE: u32 = 16;

/// Summation order for a pixel's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SumOrder {
    /// Adds all samples in sequence.
    #[default]
    Sequential,
    /// Sums blocks of [`BLOCK_SIZE`] samples and adds the block sums in sequence.
    Blocked,
    /// Keeps a separate sum for each block of [`BLOCK_SIZE`] samples, for up to this many finished blocks.
    SeparateBlocks(usize),
}

impl SumOrder {
    /// Number of finished block sums kept per pixel.
    pub fn block_sums_per_pixel(self) -> usize {
        match self {
            Self::Sequential => 0,
            Self::Blocked => 1,
            Self::SeparateBlocks(count) => count,
        }
    }

    /// Number of samples until the current block ends, for a pixel with `count` samples.
    pub(super) fn samples_to_block_end(self, count: u32) -> usize {
        match self {
            Self::Sequential => usize::MAX,
            Self::Blocked | Self::SeparateBlocks(_) => (BLOCK_SIZE - count % BLOCK_SIZE) as usize,
        }
    }

    /// Index of the block sum that receives the block ending at `count` samples, or `None` if no block ends
    /// there.
    pub(super) fn finished_block_sum_index(self, count: u32) -> Option<usize> {
        let is_end = count > 0 && count.is_multiple_of(BLOCK_SIZE);
        match self {
            Self::Blocked if is_end => Some(0),
            Self::SeparateBlocks(_) if is_end => Some((count / BLOCK_SIZE - 1) as usize),
            Self::Sequential | Self::Blocked | Self::SeparateBlocks(_) => None,
        }
    }
}

/// Adds a pixel's finished blocks in order, followed by the unfinished block.
#[cold]
pub(super) fn pixel_sum_over_sample_blocks(earlier: &[Vec<DVec3>], sums: &[DVec3], index: usize) -> DVec3 {
    match earlier {
        [] => sums[index],
        [first, others @ ..] => {
            others.iter().fold(first[index], |sum, block| sum + block[index]) + sums[index]
        }
    }
}

/// Adds the finite radiances and returns the number of non-finite radiances.
pub(super) fn add_finite_and_count_non_finite(sum: &mut DVec3, radiances: &[Vec3]) -> u64 {
    let all = radiances.iter().fold(*sum, |sum, radiance| sum + radiance.as_dvec3());
    if all.is_finite() {
        *sum = all;
        return 0;
    }
    let mut non_finite = 0;
    for radiance in radiances {
        if radiance.is_finite() {
            *sum += radiance.as_dvec3();
        } else {
            non_finite += 1;
        }
    }
    non_finite
}
