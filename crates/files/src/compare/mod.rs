//! The error of a picture against a reference.
//!
//! Linear values give RMSE, relMSE and the largest difference; displayed values, clamped sRGB, give PSNR, SSIM and
//! FLIP. All sums are in double precision, in an order that does not depend on the number of threads. The threads of
//! the caller's pool share the work.

mod bias;
mod colormap;
mod diff;
mod display;
mod flip;
mod linear;
mod pair;
mod plane;
mod tiles;
mod two;

pub use bias::Bias;
pub use diff::{absolute, heat};
pub use flip::PIXELS_PER_DEGREE;
pub use pair::{CompareError, Pair};
pub use two::TwoReferences;

/// Errors of the first picture of a pair against the second, its reference. Means are over pixels and channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Errors {
    /// √mean (a − b)², linear.
    pub rmse: f64,
    /// mean (a − b)²/(b² + 0.01), linear.
    pub relmse: f64,
    /// relMSE without the thousandth of the pixels (rounded down) that have the largest values.
    pub relmse_trimmed: f64,
    /// Number of pixels that it leaves out.
    pub dropped_pixels: u64,
    /// max |a − b|, linear.
    pub max: f64,
    /// Column and row, from 0 at the top left, of the first pixel with the largest difference.
    pub max_at: [u32; 2],
    /// Mean luminance of both, linear.
    pub luminances: [f64; 2],
    /// Peak signal to noise ratio of clamped sRGB, dB; infinite for equal pictures.
    pub psnr_db: f64,
    /// Structural similarity of the luma of clamped sRGB, 1 for equal pictures.
    pub ssim: f64,
    /// Mean of [`Measured::flip`], 0 for equal pictures, at most 1.
    pub flip: f64,
}

/// Measurements of a pair.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The figures.
    pub errors: Errors,
    /// FLIP of every pixel, in [0, 1], rows from the top.
    pub flip: Vec<f32>,
}

/// Measures everything.
pub fn measure(pair: &Pair) -> Measured {
    let linear = linear::measure(pair);
    let display = display::measure(pair);
    let flip = flip::map(pair);
    let errors = Errors {
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
    Measured { errors, flip }
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests;
