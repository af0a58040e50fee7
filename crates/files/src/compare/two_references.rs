//! Computes errors against two noisy references. A reference is the ground truth plus noise. If the noise of
//! the two references is independent, (x − r₁)(x − r₂) and (x − truth)² have the same expected value, so the
//! references' noise does not bias the error.

use super::ImagePair;
use crate::film::RadianceImage;
use crate::math::color::{LUMINANCE_WEIGHTS, RELMSE_EPSILON};
use crate::math::{DVec3, Vec3};

fn luminance(color: DVec3) -> f64 {
    color.dot(LUMINANCE_WEIGHTS.as_dvec3())
}

/// Two independently rendered references for the same image.
#[derive(Clone, Debug)]
pub struct IndependentReferences {
    pair: ImagePair,
    /// 1/(r² + 0.01), divided by the number of channels and pixels, where r is the mean of the references.
    weights: Vec<DVec3>,
}

impl IndependentReferences {
    /// Creates references from a pair of images.
    pub fn new(pair: ImagePair) -> Self {
        let values = 3.0 * pair.measured_image().pixels.len() as f64;
        let weight = |(a, b): (&Vec3, &Vec3)| {
            let mean = (a.as_dvec3() + b.as_dvec3()) / 2.0;
            1.0 / ((mean * mean + RELMSE_EPSILON) * values)
        };
        let weights = pair.measured_image().pixels.iter().zip(&pair.reference().pixels).map(weight).collect();
        Self { pair, weights }
    }

    /// The two references.
    pub fn both_references(&self) -> &ImagePair {
        &self.pair
    }

    /// Returns an image's relMSE, without bias from the references' noise. It can be negative. The image must
    /// have the same size as the references.
    pub fn unbiased_relmse(&self, x: &RadianceImage) -> f64 {
        self.cross_error_of_two_images(x, x)
    }

    /// Mean of (x − r)(y − r), relative to r². For two images rendered with the same method and independent
    /// noise, the expected value is the squared bias.
    pub fn cross_error_of_two_images(&self, x: &RadianceImage, y: &RadianceImage) -> f64 {
        let pixels = self.weighted_reference_pixels().zip(x.pixels.iter().zip(&y.pixels));
        let sum = pixels.fold(DVec3::ZERO, |sum, ((weight, a, b), (x, y))| {
            let (x, y) = (x.as_dvec3(), y.as_dvec3());
            sum + weight * ((x - a) * (y - b) + (x - b) * (y - a)) / 2.0
        });
        sum.element_sum()
    }

    /// relMSE of one reference: the error that its noise would add if only one reference were used.
    pub fn relmse_of_one_reference(&self) -> f64 {
        let sum = self
            .weighted_reference_pixels()
            .fold(DVec3::ZERO, |sum, (weight, a, b)| sum + weight * (a - b) * (a - b));
        sum.element_sum() / 2.0
    }

    /// Standard error of [`Self::unbiased_relmse`] due to the references' noise, assuming independent pixels
    /// and fully correlated channels.
    pub fn relmse_standard_error(&self, x: &RadianceImage) -> f64 {
        let variances = self.weighted_reference_pixels().zip(&x.pixels).map(|((weight, a, b), x)| {
            let (between, from) = ((a - b) * (a - b), x.as_dvec3() - (a + b) / 2.0);
            let channel_deviation = |channel: usize| {
                // Add the variances of a·b and (x − truth)(a + b). The variance of one reference is half of
                // `between`.
                let variance = between[channel] * (between[channel] / 12.0 + from[channel] * from[channel]);
                weight[channel] * variance.sqrt()
            };
            let deviation = channel_deviation(0) + channel_deviation(1) + channel_deviation(2);
            deviation * deviation
        });
        variances.sum::<f64>().sqrt()
    }

    /// Excess brightness of an image, relative to the references' mean luminance.
    pub fn relative_bias(&self, x: &RadianceImage) -> f64 {
        let sum: f64 = x.pixels.iter().map(|pixel| luminance(pixel.as_dvec3())).sum();
        sum / x.pixels.len() as f64 / self.mean_luminance() - 1.0
    }

    /// Mean luminance of both references.
    pub fn mean_luminance(&self) -> f64 {
        let sum: f64 = self.weighted_reference_pixels().map(|(_, a, b)| luminance((a + b) / 2.0)).sum();
        sum / self.weights.len() as f64
    }

    /// Standard error of [`Self::relative_bias`] due to the references' noise, assuming independent pixels.
    pub fn relative_bias_standard_error(&self) -> f64 {
        let square = |x: f64| x * x;
        let squares = self.weighted_reference_pixels().map(|(_, a, b)| square(luminance((a - b) / 2.0)));
        squares.sum::<f64>().sqrt() / self.weights.len() as f64 / self.mean_luminance()
    }

    fn weighted_reference_pixels(&self) -> impl Iterator<Item = (DVec3, DVec3, DVec3)> {
        let pixels = self.pair.measured_image().pixels.iter().zip(&self.pair.reference().pixels);
        self.weights.iter().zip(pixels).map(|(weight, (a, b))| (*weight, a.as_dvec3(), b.as_dvec3()))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::math::random::hash;

    /// Hashes a number to a uniform value in [−1, 1).
    fn uniform(number: u32) -> f32 {
        (hash(number.into()) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    const SIDE: u32 = 64;

    /// Gray 0.5 plus an offset and noise of ±`noise`.
    fn test_image(seed: u32, noise: f32, offset: f32) -> RadianceImage {
        let value = |i: u32| 0.5 + offset + noise * uniform(seed.wrapping_mul(1 << 20) + i);
        let pixels = (0..SIDE * SIDE).map(|i| Vec3::new(value(3 * i), value(3 * i + 1), value(3 * i + 2)));
        RadianceImage { width: SIDE, height: SIDE, pixels: pixels.collect() }
    }

    fn references(noise: f32) -> IndependentReferences {
        let names = [Path::new("r1"), Path::new("r2")];
        IndependentReferences::new(
            ImagePair::new(names, test_image(1, noise, 0.0), test_image(2, noise, 0.0)).expect("a pair"),
        )
    }

    /// 1/(0.5² + 0.01).
    const WEIGHT: f64 = 1.0 / 0.26;

    #[test]
    fn equal_references_yield_the_standard_relmse() {
        let references = references(0.0);
        assert_eq!(references.relmse_of_one_reference(), 0.0);
        let error = references.unbiased_relmse(&test_image(3, 0.0, 0.1));
        assert!((error - 0.01 * WEIGHT).abs() < 1e-6, "{error}");
        assert_eq!(references.relmse_standard_error(&test_image(3, 0.0, 0.1)), 0.0);
    }

    #[test]
    fn reference_noise_does_not_bias_the_error() {
        let references = references(0.05);
        let noise = 0.05_f64.powi(2) / 3.0 * WEIGHT;
        assert!(
            (references.relmse_of_one_reference() / noise - 1.0).abs() < 0.05,
            "noise is {}, expected {noise}",
            references.relmse_of_one_reference()
        );
        let tested = test_image(3, 0.01, 0.0);
        let truth = 0.01_f64.powi(2) / 3.0 * WEIGHT;
        let (error, uncertainty) =
            (references.unbiased_relmse(&tested), references.relmse_standard_error(&tested));
        assert!((error - truth).abs() < 4.0 * uncertainty, "got {error} ± {uncertainty}, expected {truth}");
        assert!(uncertainty < 0.05 * noise, "{uncertainty}");
        let plain = super::super::linear::measure(
            &ImagePair::new([Path::new("x"), Path::new("r")], tested, test_image(1, 0.05, 0.0))
                .expect("a pair"),
        );
        assert!(plain.relmse > 20.0 * truth, "error with a single reference: {}", plain.relmse);
    }

    #[test]
    fn cross_error_is_the_squared_bias() {
        let references = references(0.02);
        let cross = |offset| {
            references.cross_error_of_two_images(&test_image(5, 0.2, offset), &test_image(6, 0.2, offset))
        };
        assert!((cross(0.1) / (0.01 * WEIGHT) - 1.0).abs() < 0.1, "{}", cross(0.1));
        assert!(
            cross(0.0).abs() < 0.04 * references.unbiased_relmse(&test_image(5, 0.2, 0.0)),
            "{}",
            cross(0.0)
        );
    }
}
