//! Colors mixed from those of any palette.

use super::mix::{Ink, Mixer};
use super::pattern::threshold;

/// Weight of calm among colors that were chosen for the picture.
const CALM: f32 = 1.0;

/// The inks that a picture is mixed from.
#[derive(Debug)]
pub(crate) struct Mixture(Mixer);

impl Mixture {
    /// From these colors.
    pub(crate) fn new(colors: &[[u8; 3]]) -> Self {
        Self(Mixer::new(colors.iter().copied().map(Ink::plain).collect(), CALM))
    }

    /// The number of the color that stands for another one at this place.
    pub(crate) fn index(&mut self, rgb: [u8; 3], x: usize, y: usize) -> usize {
        self.0.ink(rgb, threshold(x, y))
    }
}
