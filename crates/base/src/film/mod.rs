//! Films (sums of samples), tone mapping and finished images.
//!
//! Integrators produce [`TileSamples`], which a [`Film`] sums in f64. Image files contain
//! [`Film::radiance_image`]. [`Previewer`] scales the film to screen size during rendering.
//! [`tone::tone_map_to_8_bits`] converts the radiance or a preview to an [`Srgb8Image`].
//!
//! Large images are processed on all threads of the caller's rayon pool, or on the calling thread outside a
//! pool. The caller chooses the number of threads.

mod block_sums;
mod convergence;
mod curves;
mod layer_sums;
mod layers;
mod noise;
mod pixel_subset;
mod prepass;
mod preview;
mod quantity;
pub mod range_map;
mod resample;
mod section;
mod srgb;
mod stored;
mod sum_order;
mod sums;
pub mod tone;

pub use convergence::ConvergenceModel;
pub use layer_sums::{ALL_LAYER_VALUES, LayerSums};
pub use noise::{HalfNoise, NoiseAndConvergenceRate, total_samples_to_reduce_error};
pub use pixel_subset::{PixelSubset, SelectedPixels};
pub use prepass::{BrightnessPrepassPixels, PREPASS_SAMPLES};
pub use preview::Previewer;
pub use quantity::FilmQuantity;
pub use srgb::linear_to_srgb8_by_table;
pub use stored::{MalformedTile, StoredTile};
pub use sum_order::{BLOCK_SIZE, SumOrder};
pub use sums::{Film, FilmCreationError, SampleCountStats};

use crate::math::Vec3;

/// Tile width and height in pixels: 1024 pixels at 40 bytes each fit in a core's L2 cache.
pub const TILE_SIZE: u32 = 32;

/// Cell width and height in pixels. Each cell of a tile is sampled according to its own noise. With smaller
/// cells, fewer pixels are oversampled merely because they are near an edge.
pub const CELL_SIZE: u32 = 16;

const CELLS_ACROSS: usize = (TILE_SIZE / CELL_SIZE) as usize;

/// Number of cells in a tile. Cells are in row-major order.
pub const CELLS: usize = CELLS_ACROSS * CELLS_ACROSS;

/// Whether the current thread belongs to a rayon pool that can share work.
fn is_in_thread_pool() -> bool {
    rayon::current_thread_index().is_some()
}

/// A rectangle of pixels. (0, 0) is the top left pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rect {
    /// Leftmost column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
}

impl Rect {
    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Pixels in both rectangles, or `None` if they do not overlap.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let (x, width) = intersect_intervals((self.x, self.width), (other.x, other.width))?;
        let (y, height) = intersect_intervals((self.y, self.height), (other.y, other.height))?;
        Some(Self { x, y, width, height })
    }
}

/// Intersection of two intervals (start, length). Uses u64 because start + length may overflow u32.
fn intersect_intervals(a: (u32, u32), b: (u32, u32)) -> Option<(u32, u32)> {
    let end = |(start, length): (u32, u32)| u64::from(start) + u64::from(length);
    let start = a.0.max(b.0);
    let length = end(a).min(end(b)).checked_sub(u64::from(start)).filter(|&length| length > 0)?;
    Some((start, u32::try_from(length).ok()?))
}

/// An integrator's samples for a tile: `samples` consecutive radiances per pixel, in row-major order.
#[derive(Clone, Debug)]
pub struct TileSamples {
    /// Sampled pixels.
    pub pixels: SelectedPixels,
    /// Samples per pixel.
    pub samples: u32,
    /// `pixels.count() · samples` radiances, at positions drawn in proportion to the pixel filter's absolute
    /// value.
    pub radiance: Vec<Vec3>,
    /// Samples in the pixel filter's negative lobes, or `None` if the filter has no negative lobes.
    pub negative: Option<NegativeLobeSamples>,
    /// Sums of the layers in these pixels, including the film's earlier samples; see
    /// [`Film::tile_layer_sums`].
    pub layers: LayerSums,
}

/// Samples in the negative lobes of the pixel filter. A pixel's value is (1 + `weight`) · mean of the other
/// samples − `weight` · mean of the samples in negative lobes. A constant image therefore stays constant
/// regardless of the sample positions.
#[derive(Clone, Debug)]
pub struct NegativeLobeSamples {
    /// Weight of the negative lobes: −∫min(f, 0)/∫f for the filter f.
    pub weight: f64,
    /// Whether each sample is in a negative lobe.
    pub is_negative: Vec<bool>,
}

/// Linear, unexposed radiance in row-major order from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct RadianceImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width·height` pixels.
    pub pixels: Vec<Vec3>,
}

impl RadianceImage {
    /// Creates a black image.
    pub fn black(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![Vec3::ZERO; width as usize * height as usize] }
    }

    /// Replaces the pixels in a rectangle with `pixels`, which are in row-major order. Non-finite values
    /// become black, as in a [`Film`].
    pub fn set_rect(&mut self, rect: Rect, pixels: &[Vec3]) {
        let width = self.width as usize;
        let rows = self.pixels.chunks_exact_mut(width).skip(rect.y as usize);
        for (row, new) in rows.zip(pixels.chunks_exact(rect.width as usize)) {
            let row = row.iter_mut().skip(rect.x as usize);
            for (pixel, new) in row.zip(new) {
                *pixel = if new.is_finite() { *new } else { Vec3::ZERO };
            }
        }
    }

    /// Resizes the image with an exact box filter: each new pixel is the mean of the old pixels it covers,
    /// weighted by area, so the image mean is preserved.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        resample::resized(self, width, height)
    }
}

/// An 8-bit sRGB image for display.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Srgb8Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width·height` pixels.
    pub pixels: Vec<[u8; 3]>,
}

/// A 16-bit sRGB image for files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Srgb16Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width·height` pixels.
    pub pixels: Vec<[u16; 3]>,
}

#[cfg(test)]
mod tests {
    use super::Rect;

    #[test]
    fn rectangles_intersect() {
        let a = Rect { x: 2, y: 3, width: 10, height: 4 };
        let b = Rect { x: 10, y: 0, width: u32::MAX, height: 5 };
        assert_eq!(a.intersection(&b), Some(Rect { x: 10, y: 3, width: 2, height: 2 }));
        assert_eq!(a.intersection(&Rect { x: 12, ..b }), None);
        assert_eq!(a.intersection(&Rect { width: 0, ..a }), None);
    }
}
