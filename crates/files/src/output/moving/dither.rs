//! Ordered dithering to a palette (T. Knoll, US patent 6,606,166, expired): a pixel's place and colour alone decide what stands
//! for it. So what stays in place looks the same in each frame, which error diffusion does not give.

use std::collections::HashMap;

use crate::control::{CancelToken, Cancelled};
use crate::film::Picture;

/// Columns and rows of the pattern.
const SIDE: usize = 4;
/// Colours that a pattern mixes.
const MIXED: usize = SIDE * SIDE;

/// Ranks of the pattern's places (B. Bayer, 1973).
const RANKS: [usize; MIXED] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// Dithering to one palette.
pub(super) struct Dither {
    palette: Vec<[i32; 3]>,
}

impl Dither {
    /// Dithering to a palette of three bytes a colour, at most 256.
    pub(super) fn new(palette: &[u8]) -> Self {
        Self { palette: palette.as_chunks().0.iter().map(|color: &[u8; 3]| color.map(i32::from)).collect() }
    }

    /// The palette's index for each pixel.
    pub(super) fn indices(&self, picture: &Picture, token: &CancelToken) -> Result<Vec<u8>, Cancelled> {
        let mut known: HashMap<[u8; 3], [u8; MIXED]> = HashMap::new();
        let mut indices = Vec::with_capacity(picture.pixels.len());
        for (y, row) in picture.pixels.chunks(picture.width.max(1) as usize).enumerate() {
            token.check()?;
            for (x, color) in row.iter().enumerate() {
                let mixed = known.entry(*color).or_insert_with(|| self.mixed(*color));
                indices.push(mixed[RANKS[y % SIDE * SIDE + x % SIDE]]);
            }
        }
        Ok(indices)
    }

    /// Colours of the palette whose mean is near a colour, from dark to bright.
    fn mixed(&self, color: [u8; 3]) -> [u8; MIXED] {
        let color = color.map(i32::from);
        let (mut mixed, mut error) = ([0; MIXED], [0; 3]);
        for one in &mut mixed {
            // Aim at what all colours so far lack.
            let aim = [0, 1, 2].map(|channel: usize| color[channel] + error[channel]);
            let index = self.nearest(aim);
            *one = index as u8;
            error = [0, 1, 2].map(|channel: usize| aim[channel] - self.palette[index][channel]);
        }
        let brightness = |index: &u8| {
            let [red, green, blue] = self.palette[usize::from(*index)];
            299 * red + 587 * green + 114 * blue
        };
        mixed.sort_by_key(brightness);
        mixed
    }

    fn nearest(&self, aim: [i32; 3]) -> usize {
        let distance = |color: &[i32; 3]| {
            let by = |channel: usize| (color[channel] - aim[channel]).pow(2);
            // Weights of the eye, roughly.
            2 * by(0) + 4 * by(1) + by(2)
        };
        let nearest = self.palette.iter().enumerate().min_by_key(|(_, color)| distance(color));
        nearest.map_or(0, |(index, _)| index)
    }
}
