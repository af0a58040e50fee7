//! Errors in displayed values (clamped sRGB without quantization): PSNR of the channels and SSIM of the luma.
//!
//! SSIM follows Z. Wang et al., *Image Quality Assessment: From Error Visibility to Structural Similarity*
//! (2004): a Gaussian window of 11 × 11 pixels with σ = 1.5, K₁ = 0.01, K₂ = 0.03, L = 1. SSIM is averaged
//! over all windows inside the image. If a side has fewer than 11 pixels, windows are clipped and their
//! weights renormalized.

use rayon::prelude::*;

use super::plane::{Plane, normalized_taps, unnormalized_gaussian_taps};
use super::{ImagePair, tiles};
use crate::film::Rect;
use crate::math::Vec3;
use crate::math::color::linear_to_srgb_f64;

const RADIUS: usize = 5;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;
/// Luma weights of red, green and blue (ITU-R BT.709).
const LUMA: [f64; 3] = [0.2126, 0.7152, 0.0722];

pub(super) struct DisplayReferredErrors {
    pub(super) psnr_db: f64,
    pub(super) ssim: f64,
}

#[derive(Clone, Copy, Default)]
struct DisplayReferredErrorSums {
    square: f64,
    ssim: f64,
    windows: u64,
}

impl DisplayReferredErrorSums {
    fn plus(self, other: Self) -> Self {
        Self {
            square: self.square + other.square,
            ssim: self.ssim + other.ssim,
            windows: self.windows + other.windows,
        }
    }
}

pub(super) fn measure(pair: &ImagePair) -> DisplayReferredErrors {
    let (width, height) = (pair.width(), pair.height());
    let window = normalized_taps(&unnormalized_gaussian_taps(SIGMA, RADIUS));
    let band_sums = |band| {
        let sums = tiles::tiles_in_band(band, width, height).map(|tile| tile_error_sums(pair, tile, &window));
        sums.fold(DisplayReferredErrorSums::default(), DisplayReferredErrorSums::plus)
    };
    let bands: Vec<_> = (0..tiles::band_count(height)).into_par_iter().map(band_sums).collect();
    let sums = bands.into_iter().fold(DisplayReferredErrorSums::default(), DisplayReferredErrorSums::plus);
    let mean_square = sums.square / (3 * width * height) as f64;
    DisplayReferredErrors { psnr_db: -10.0 * libm::log10(mean_square), ssim: sums.ssim / sums.windows as f64 }
}

fn tile_error_sums(pair: &ImagePair, tile: Rect, window: &[f64]) -> DisplayReferredErrorSums {
    let (square, [a, b]) = tile_lumas_and_squared_error(pair, tile);
    let mean = |plane: &Plane| plane.filtered(window, window);
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let (mean_aa, mean_bb, mean_ab) = (
        mean(&a.elementwise_product(&a)),
        mean(&b.elementwise_product(&b)),
        mean(&a.elementwise_product(&b)),
    );
    let columns = window_weight_sums(tile.x, tile.width, pair.width(), window);
    let rows = window_weight_sums(tile.y, tile.height, pair.height(), window);
    let mut sums = DisplayReferredErrorSums { square, ..DisplayReferredErrorSums::default() };
    for (y, row) in rows.iter().enumerate() {
        for (x, column) in columns.iter().enumerate() {
            let (Some(row), Some(column)) = (row, column) else { continue };
            let at = |plane: &Plane| plane.values[y * plane.width + x] / (row * column);
            sums.ssim +=
                ssim_from_moments([at(&mean_a), at(&mean_b)], [at(&mean_aa), at(&mean_bb)], at(&mean_ab));
            sums.windows += 1;
        }
    }
    sums
}

/// SSIM (Wang et al., equation 13) computed from the means of a, b, a², b² and ab.
fn ssim_from_moments([a, b]: [f64; 2], [aa, bb]: [f64; 2], ab: f64) -> f64 {
    let (variances, covariance) = (aa - a * a + (bb - b * b), ab - a * b);
    (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (variances + C2))
}

/// Returns the tile's sum of squared differences over all channels, and the luma plane of each image. The
/// planes cover the tile and a margin of [`RADIUS`] pixels on each side. Outside the image, luma is 0.
fn tile_lumas_and_squared_error(pair: &ImagePair, tile: Rect) -> (f64, [Plane; 2]) {
    let side = |length: u32| length as usize + 2 * RADIUS;
    let mut lumas =
        [Plane::zero(side(tile.width), side(tile.height)), Plane::zero(side(tile.width), side(tile.height))];
    let mut square = 0.0;
    let width = side(tile.width);
    for row in 0..side(tile.height) {
        let Some(y) = image_coordinate_if_inside(tile.y, row, pair.height()) else { continue };
        for column in 0..width {
            let Some(x) = image_coordinate_if_inside(tile.x, column, pair.width()) else { continue };
            let [a, b] = pair.pixel_pair(x, y).map(encode_srgb);
            lumas[0].values[row * width + column] = luma(a);
            lumas[1].values[row * width + column] = luma(b);
            if is_coordinate_inside_tile(row, tile.height) && is_coordinate_inside_tile(column, tile.width) {
                square += a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            }
        }
    }
    (square, lumas)
}

/// Converts a coordinate in a tile padded by its margin to an image coordinate. Returns `None` if the result
/// is outside the image.
fn image_coordinate_if_inside(start: u32, offset: usize, length: usize) -> Option<usize> {
    (start as usize + offset).checked_sub(RADIUS).filter(|&position| position < length)
}

fn is_coordinate_inside_tile(offset: usize, length: u32) -> bool {
    (RADIUS..RADIUS + length as usize).contains(&offset)
}

/// Returns, for each position along one side of the tile, the sum of the window's weights inside the image,
/// or `None` if the window is excluded.
fn window_weight_sums(start: u32, count: u32, length: usize, window: &[f64]) -> Vec<Option<f64>> {
    let weight = |position: usize| {
        let is_complete = position >= RADIUS && position + RADIUS < length;
        let taps = (position..).zip(window).filter(|(tap, _)| (RADIUS..RADIUS + length).contains(tap));
        (is_complete || length < window.len()).then(|| taps.map(|(_, weight)| weight).sum())
    };
    (0..count).map(|offset| weight((start + offset) as usize)).collect()
}

fn encode_srgb(color: Vec3) -> [f64; 3] {
    color.to_array().map(|linear| linear_to_srgb_f64(f64::from(linear).clamp(0.0, 1.0)))
}

fn luma(encoded: [f64; 3]) -> f64 {
    encoded.iter().zip(LUMA).map(|(value, weight)| value * weight).sum()
}
