//! Blocks of samples: a pixel's sum is the sum of its blocks, so that machines which render some blocks each get the same bits.

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

    /// Number of the sum that a pixel's block is added to when it ends at `count` samples. `None` in the middle of a block.
    pub(super) fn finished(self, count: u32) -> Option<usize> {
        let is_end = count > 0 && count.is_multiple_of(BLOCK);
        match self {
            Self::Added if is_end => Some(0),
            Self::Apart(_) if is_end => Some((count / BLOCK - 1) as usize),
            Self::Whole | Self::Added | Self::Apart(_) => None,
        }
    }
}

/// Sum over a pixel's finished blocks, in their order, and the one that is not finished.
#[cold]
pub(super) fn total(earlier: &[Vec<DVec3>], sums: &[DVec3], index: usize) -> DVec3 {
    match earlier {
        [] => sums[index],
        [first, others @ ..] => {
            others.iter().fold(first[index], |sum, block| sum + block[index]) + sums[index]
        }
    }
}
