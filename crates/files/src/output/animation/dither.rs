//! Ordered dithering to a palette (T. Knoll, US patent 6,606,166, expired). The result depends only on a
//! pixel's position and color, so unlike with error diffusion, static parts do not flicker between frames.

use std::collections::HashMap;

use crate::control::{CancelToken, Canceled};
use crate::film::Srgb8Image;

/// Width and height of the pattern.
const SIDE: usize = 4;
/// Number of colors mixed in a pattern.
const COLORS_PER_PATTERN: usize = SIDE * SIDE;

/// Thresholds of the pattern (B. Bayer, 1973).
const RANKS: [usize; COLORS_PER_PATTERN] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// Ordered ditherer for a palette.
pub(super) struct Dither {
    palette: Vec<[i32; 3]>,
}

impl Dither {
    /// Creates a ditherer for a palette of up to 256 colors, three bytes each.
    pub(super) fn new(palette: &[u8]) -> Self {
        Self { palette: palette.as_chunks().0.iter().map(|color: &[u8; 3]| color.map(i32::from)).collect() }
    }

    /// Dithers an image and returns the palette index of each pixel.
    pub(super) fn palette_indices(
        &self,
        picture: &Srgb8Image,
        token: &CancelToken,
    ) -> Result<Vec<u8>, Canceled> {
        let mut known: HashMap<[u8; 3], [u8; COLORS_PER_PATTERN]> = HashMap::new();
        let mut indices = Vec::with_capacity(picture.pixels.len());
        for (y, row) in picture.pixels.chunks(picture.width.max(1) as usize).enumerate() {
            token.check_pause_and_cancel()?;
            for (x, color) in row.iter().enumerate() {
                let mixed = known.entry(*color).or_insert_with(|| self.indices_approximating_color(*color));
                indices.push(mixed[RANKS[y % SIDE * SIDE + x % SIDE]]);
            }
        }
        Ok(indices)
    }

    /// Returns the palette indices of colors whose mean approximates a color, sorted by brightness.
    fn indices_approximating_color(&self, color: [u8; 3]) -> [u8; COLORS_PER_PATTERN] {
        let color = color.map(i32::from);
        let (mut mixed, mut error) = ([0; COLORS_PER_PATTERN], [0; 3]);
        for entry in &mut mixed {
            // Compensate for the accumulated error.
            let aim = [0, 1, 2].map(|channel: usize| color[channel] + error[channel]);
            let index = self.nearest_index(aim);
            *entry = index as u8;
            error = [0, 1, 2].map(|channel: usize| aim[channel] - self.palette[index][channel]);
        }
        let brightness = |index: &u8| {
            let [red, green, blue] = self.palette[usize::from(*index)];
            299 * red + 587 * green + 114 * blue
        };
        mixed.sort_by_key(brightness);
        mixed
    }

    /// Returns the index of the first of the nearest colors. This is a plain loop because tests spend most of
    /// their time here, without optimization.
    fn nearest_index(&self, aim: [i32; 3]) -> usize {
        let (mut nearest, mut least) = (0, i32::MAX);
        for (index, color) in self.palette.iter().enumerate() {
            let (red, green, blue) = (color[0] - aim[0], color[1] - aim[1], color[2] - aim[2]);
            // Approximate the eye's sensitivity to each channel.
            let distance = 2 * red * red + 4 * green * green + blue * blue;
            if distance < least {
                (nearest, least) = (index, distance);
            }
        }
        nearest
    }
}
