//! Dithering with an arbitrary palette.

use super::bayer::bayer_threshold;
use super::recipes::{DitherRecipeCache, SolidOrPatternColor};

/// How strongly dithering favors palette colors close to the target color, for palettes computed from an
/// image.
const CLOSENESS: f32 = 1.0;

/// A ditherer for one palette.
#[derive(Debug)]
pub(crate) struct PaletteDither(DitherRecipeCache);

impl PaletteDither {
    /// Creates a ditherer for these colors.
    pub(crate) fn new(colors: &[[u8; 3]]) -> Self {
        Self(DitherRecipeCache::new(
            colors.iter().copied().map(SolidOrPatternColor::solid).collect(),
            CLOSENESS,
        ))
    }

    /// Returns the index of the palette color to use for `rgb` at this pixel.
    pub(crate) fn index_at(&mut self, rgb: [u8; 3], x: usize, y: usize) -> usize {
        self.0.select_color_index(rgb, bayer_threshold(x, y))
    }
}
