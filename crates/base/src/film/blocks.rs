//! Sample blocks: a pixel's sum is the sum of its blocks, so machines that each render some of the blocks
//! produce the same bits.

use crate::math::DVec3;

/// Samples per block.
pub const BLOCK: u32 = 16;

/// Summation order of a pixel's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blocks {
    /// Adds all samples in sequence.
    #[default]
    Whole,
    /// Sums blocks of [`BLOCK`] samples and adds the block sums in sequence.
    Added,
    /// Sums blocks of [`BLOCK`] samples and keeps the sums separate, for at most this number of finished
    /// blocks.
    Apart(usize),
}

impl Blocks {
    /// Number of finished block sums kept per pixel.
    pub fn kept(self) -> usize {
        match self {
            Self::Whole => 0,
            Self::Added => 1,
            Self::Apart(count) => count,
        }
    }

    /// Samples until the current block ends, for a pixel with `count` samples.
    pub(super) fn samples_to_end(self, count: u32) -> usize {
        match self {
            Self::Whole => usize::MAX,
            Self::Added | Self::Apart(_) => (BLOCK - count % BLOCK) as usize,
        }
    }

    /// Index of the block sum that a block ending at `count` samples is added to, or `None` inside a block.
    pub(super) fn finished(self, count: u32) -> Option<usize> {
        let is_end = count > 0 && count.is_multiple_of(BLOCK);
        match self {
            Self::Added if is_end => Some(0),
            Self::Apart(_) if is_end => Some((count / BLOCK - 1) as usize),
            Self::Whole | Self::Added | Self::Apart(_) => None,
        }
    }
}

/// Adds a pixel's finished blocks in order, then the unfinished one.
#[cold]
pub(super) fn total(earlier: &[Vec<DVec3>], sums: &[DVec3], index: usize) -> DVec3 {
    match earlier {
        [] => sums[index],
        [first, others @ ..] => {
            others.iter().fold(first[index], |sum, block| sum + block[index]) + sums[index]
        }
    }
}
