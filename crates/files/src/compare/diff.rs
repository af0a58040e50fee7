//! Creates images that show per-pixel errors.

use rayon::prelude::*;

use super::{ImagePair, colormap};
use crate::film::RadianceImage;

/// Returns |a − b| for each channel, in linear values.
pub fn absolute_difference(pair: &ImagePair) -> RadianceImage {
    let pixels =
        pair.measured_image().pixels.par_iter().zip(&pair.reference().pixels).map(|(a, b)| (*a - *b).abs());
    RadianceImage {
        width: pair.measured_image().width,
        height: pair.measured_image().height,
        pixels: pixels.collect(),
    }
}

/// Shows each pixel's FLIP error as a color, from black (0) via purple, red and orange to pale yellow (1).
pub fn flip_heat_map(pair: &ImagePair, flip: &[f32]) -> RadianceImage {
    let pixels = flip.par_iter().map(|&error| colormap::error_color(f64::from(error))).collect();
    RadianceImage { width: pair.measured_image().width, height: pair.measured_image().height, pixels }
}
