//! Sums of samples, tone mapping, pictures.
//!
//! Integrators make [`TileSamples`]; a [`Film`] sums them in f64. [`Film::radiance`] is what files hold. [`Previewer`]
//! shrinks it for the screen while it grows. [`tone::develop`] turns either into a [`Picture`].
//!
//! All threads of the caller's pool work on large pictures; outside of a pool the caller works alone. The caller
//! chooses the number of threads.

mod block_sums;
mod blocks;
mod curves;
mod noise;
mod part;
mod pilot;
mod preview;
mod quantity;
mod resample;
mod section;
mod srgb;
mod steps;
mod stored;
pub mod stretch;
mod sums;
pub mod tone;

pub use blocks::{BLOCK, Blocks};
pub use noise::{HalfNoise, PictureNoise, samples_by};
pub use part::{Part, Pixels};
pub use pilot::{PILOT_SAMPLES, Pilot};
pub use preview::Previewer;
pub use quantity::Quantity;
pub use srgb::linear_to_srgb8;
pub use steps::Convergence;
pub use stored::{Malformed, StoredTile};
pub use sums::{Film, FilmError, SampleStats};

use crate::math::Vec3;

/// Pixels along a tile's side: 1024 pixels of 40 bytes stay in a core's second-level cache.
pub const TILE_SIZE: u32 = 32;

/// Pixels along the side of a cell of a tile. Each cell gets the samples that its own noise needs. The smaller the cells, the fewer
/// pixels share the samples of an edge.
pub const CELL_SIZE: u32 = 16;

const CELLS_ACROSS: usize = (TILE_SIZE / CELL_SIZE) as usize;

/// Cells of a tile, in rows.
pub const CELLS: usize = CELLS_ACROSS * CELLS_ACROSS;

/// Whether this thread belongs to a pool, whose threads can share work.
fn is_in_pool() -> bool {
    rayon::current_thread_index().is_some()
}

/// A rectangle of pixels; (0, 0) is the top left one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns, ≥ 1.
    pub width: u32,
    /// Rows, ≥ 1.
    pub height: u32,
}

impl Rect {
    /// Pixels in it.
    pub fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The pixels in both, if there are any.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let (x, width) = overlap((self.x, self.width), (other.x, other.width))?;
        let (y, height) = overlap((self.y, self.height), (other.y, other.height))?;
        Some(Self { x, y, width, height })
    }
}

/// Intersection of two spans (start, length). In u64, as a start and a length may add up to more than u32 holds.
fn overlap(a: (u32, u32), b: (u32, u32)) -> Option<(u32, u32)> {
    let end = |(start, length): (u32, u32)| u64::from(start) + u64::from(length);
    let start = a.0.max(b.0);
    let length = end(a).min(end(b)).checked_sub(u64::from(start)).filter(|&length| length > 0)?;
    Some((start, u32::try_from(length).ok()?))
}

/// Samples that an integrator took in a tile: `samples` radiances for each pixel, one after the other in rows.
#[derive(Clone, Debug)]
pub struct TileSamples {
    /// The pixels.
    pub pixels: Pixels,
    /// Samples for each.
    pub samples: u32,
    /// `pixels.count() · samples` radiances, at places drawn in proportion to the reconstruction filter.
    pub radiance: Vec<Vec3>,
    /// Samples that lie where the filter is negative. `None` if the filter is negative nowhere.
    pub negative: Option<NegativeLobes>,
}

/// Samples where the reconstruction filter is negative. A pixel's value is (1 + `weight`) · mean of the other
/// samples − `weight` · mean of these. A constant image therefore stays constant, wherever the samples fall.
#[derive(Clone, Debug)]
pub struct NegativeLobes {
    /// −∫min(f, 0)/∫f.
    pub weight: f64,
    /// Whether each radiance lies where the filter is negative.
    pub is_negative: Vec<bool>,
}

/// Linear radiance, rows from the top, unexposed.
#[derive(Clone, Debug, PartialEq)]
pub struct RadianceImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width·height` pixels.
    pub pixels: Vec<Vec3>,
}

impl RadianceImage {
    /// A picture without light.
    pub fn black(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![Vec3::ZERO; width as usize * height as usize] }
    }

    /// Takes over the pixels of a rectangle, in rows. Pixels that are not finite become black, as in a [`Film`].
    pub fn put(&mut self, rect: Rect, pixels: &[Vec3]) {
        let width = self.width as usize;
        let rows = self.pixels.chunks_exact_mut(width).skip(rect.y as usize);
        for (row, new) in rows.zip(pixels.chunks_exact(rect.width as usize)) {
            let row = row.iter_mut().skip(rect.x as usize);
            for (pixel, new) in row.zip(new) {
                *pixel = if new.is_finite() { *new } else { Vec3::ZERO };
            }
        }
    }

    /// The same picture at another size: every new pixel is the mean over its area of the old ones, exact for
    /// any ratio, so that the mean of the whole stays.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        resample::resized(self, width, height)
    }
}

/// An sRGB picture for eyes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width·height` pixels.
    pub pixels: Vec<[u8; 3]>,
}

/// An sRGB picture of 16 bits a channel, for files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture16 {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width·height` pixels.
    pub pixels: Vec<[u16; 3]>,
}

#[cfg(test)]
mod tests {
    use super::Rect;

    #[test]
    fn intersections() {
        let a = Rect { x: 2, y: 3, width: 10, height: 4 };
        let b = Rect { x: 10, y: 0, width: u32::MAX, height: 5 };
        assert_eq!(a.intersection(&b), Some(Rect { x: 10, y: 3, width: 2, height: 2 }));
        assert_eq!(a.intersection(&Rect { x: 12, ..b }), None);
        assert_eq!(a.intersection(&Rect { width: 0, ..a }), None);
    }
}
