//! Divides an image into cache-sized tiles. The division does not depend on the number of threads.

use crate::film::Rect;

/// Width and height of a tile.
pub(super) const SIDE: usize = 128;

/// Number of bands (rows of tiles).
pub(super) fn band_count(height: usize) -> usize {
    height.div_ceil(SIDE)
}

/// Tiles in a band, from left to right.
pub(super) fn tiles_in_band(band: usize, width: usize, height: usize) -> impl Iterator<Item = Rect> {
    let y = band * SIDE;
    (0..width.div_ceil(SIDE)).map(move |column| {
        let x = column * SIDE;
        Rect {
            x: x as u32,
            y: y as u32,
            width: SIDE.min(width - x) as u32,
            height: SIDE.min(height - y) as u32,
        }
    })
}
