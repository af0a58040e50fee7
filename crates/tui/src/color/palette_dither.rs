//! Dithering with an arbitrary palette.

use super::bayer::threshold;
use super::recipes::{Ink, Mixer};

/// Preference for near colors in a palette made for the image.
const CALM: f32 = 1.0;

/// Ditherer for one palette.
#[derive(Debug)]
pub(crate) struct PaletteDither(Mixer);

impl PaletteDither {
    /// A ditherer for these colors.
    pub(crate) fn new(colors: &[[u8; 3]]) -> Self {
        Self(Mixer::new(colors.iter().copied().map(Ink::plain).collect(), CALM))
    }

    /// Index of the palette color that shows `rgb` at this pixel.
    pub(crate) fn index(&mut self, rgb: [u8; 3], x: usize, y: usize) -> usize {
        self.0.ink(rgb, threshold(x, y))
    }
}
