//! Error metrics for an image compared with a reference.
//!
//! RMSE, relMSE and the largest difference are computed from linear values, and PSNR, SSIM and FLIP from
//! displayed values (clamped sRGB). Sums use double precision, in an order that does not depend on the number
//! of threads. The work runs in the caller's thread pool.

mod bias;
mod colormap;
mod diff;
mod display;
mod flip;
mod linear;
mod pair;
mod plane;
mod tiles;
mod two_references;

pub use bias::Bias;
pub use diff::{absolute_difference, flip_heat_map};
pub use flip::PIXELS_PER_DEGREE;
pub use pair::{CompareError, ImagePair};
pub use two_references::IndependentReferences;

/// Errors of the first image in a pair, measured against the second. Means are over pixels and channels.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorMetrics {
    /// √mean (a − b)², linear.
    pub rmse: f64,
    /// mean (a − b)²/(b² + 0.01), linear.
    pub relmse: f64,
    /// relMSE, excluding the 0.1 % of pixels (rounded down) with the largest values.
    pub relmse_trimmed: f64,
    /// Number of pixels excluded from the trimmed relMSE.
    pub dropped_pixels: u64,
    /// max |a − b|, linear.
    pub max: f64,
    /// Column and row of the first pixel with the largest difference. (0, 0) is the top left pixel.
    pub max_at: [u32; 2],
    /// Mean luminance of both images, linear.
    pub luminances: [f64; 2],
    /// Peak signal-to-noise ratio of clamped sRGB in dB, infinite for equal images.
    pub psnr_db: f64,
    /// Structural similarity of the luma of clamped sRGB, 1 for equal images.
    pub ssim: f64,
    /// Mean of [`PairMeasurements::flip`], in [0, 1]. 0 for equal images.
    pub flip: f64,
}

/// Measurements of a pair of images.
#[derive(Clone, Debug)]
pub struct PairMeasurements {
    /// Error metrics.
    pub errors: ErrorMetrics,
    /// FLIP of each pixel, in [0, 1], row by row from the top.
    pub flip: Vec<f32>,
}

/// Computes all error metrics of a pair.
pub fn measure(pair: &ImagePair) -> PairMeasurements {
    let linear = linear::measure(pair);
    let display = display::measure(pair);
    let flip = flip::error_map(pair);
    let errors = ErrorMetrics {
        rmse: linear.rmse,
        relmse: linear.relmse,
        relmse_trimmed: linear.relmse_trimmed,
        dropped_pixels: linear.dropped_pixels,
        max: linear.max,
        max_at: linear.max_at,
        luminances: linear.luminances,
        psnr_db: display.psnr_db,
        ssim: display.ssim,
        flip: mean(&flip),
    };
    PairMeasurements { errors, flip }
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests;
