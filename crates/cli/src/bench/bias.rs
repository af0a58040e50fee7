//! Bias of a method: the error shared by images with different seeds, but not by the references.
//!
//! The mean of (xᵢ − r₁)(xⱼ − r₂) over all pairs of different seeds estimates the squared bias because the
//! noise in all four images is independent. The standard error of this estimate combines the noise of the
//! references with the variance over pairs or the jackknife variance over seeds, whichever is larger.

use serde::{Deserialize, Serialize};

use super::statistics::{student_t_tail, student_t_upper_quantile};
use crate::compare::IndependentReferences;
use crate::film::RadianceImage;

/// Significance level of the test for bias.
pub const FALSE_POSITIVE_RATE: f64 = 0.001;
/// Minimum number of seeds needed to estimate a bias.
pub const MIN_SEEDS: usize = 3;

/// Estimated squared bias of a method, with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SquaredBias {
    /// Squared bias, as a contribution to relMSE. May be negative due to noise.
    pub size: f64,
    /// Standard error of `size`.
    pub error: f64,
    /// One-sided p-value for the null hypothesis of no bias.
    #[serde(rename = "by_chance")]
    pub p_value: f64,
    /// Upper confidence bound on `size`.
    pub bound: f64,
}

impl SquaredBias {
    /// Whether the bias is significant.
    pub fn is_significant(&self) -> bool {
        self.p_value < FALSE_POSITIVE_RATE
    }
}

/// Estimates the squared bias from images with different seeds, or returns `None` if there are fewer than
/// [`MIN_SEEDS`].
pub fn estimate_squared_bias(
    references: &IndependentReferences,
    pictures: &[RadianceImage],
) -> Option<SquaredBias> {
    if pictures.len() < MIN_SEEDS {
        return None;
    }
    let pairs = PairwiseErrorProducts::from_images(references, pictures);
    let by_references = references.relmse_standard_error(&mean_image(pictures));
    let by_seeds = pairs.variance_of_mean_if_unbiased().max(pairs.jackknife_variance_of_mean());
    let (size, error) = (pairs.mean(), (by_seeds + by_references * by_references).sqrt());
    let freedom = pictures.len() as f64 - 1.0;
    let p_value =
        if error > 0.0 { student_t_tail(size / error, freedom) } else { f64::from(u8::from(size <= 0.0)) };
    Some(SquaredBias {
        size,
        error,
        p_value,
        bound: size.max(0.0) + student_t_upper_quantile(FALSE_POSITIVE_RATE, freedom) * error,
    })
}

/// Error products of all pairs of images.
struct PairwiseErrorProducts {
    count: usize,
    /// The indices of two images and the product of their errors.
    products: Vec<(usize, usize, f64)>,
}

impl PairwiseErrorProducts {
    fn from_images(references: &IndependentReferences, pictures: &[RadianceImage]) -> Self {
        let count = pictures.len();
        let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
        let products = pairs
            .map(|(i, j)| (i, j, references.cross_error_of_two_images(&pictures[i], &pictures[j])))
            .collect();
        Self { count, products }
    }

    fn mean(&self) -> f64 {
        self.mean_without_image(usize::MAX)
    }

    fn mean_without_image(&self, seed: usize) -> f64 {
        let kept = self.products.iter().filter(|(i, j, _)| *i != seed && *j != seed);
        let (sum, count) =
            kept.fold((0.0, 0.0), |(sum, count), (_, _, product)| (sum + product, count + 1.0));
        sum / count
    }

    /// Returns the variance of the mean, assuming no bias. In that case, the products of different pairs are
    /// uncorrelated.
    fn variance_of_mean_if_unbiased(&self) -> f64 {
        let (mean, count) = (self.mean(), self.products.len() as f64);
        let squares: f64 =
            self.products.iter().map(|(_, _, product)| (product - mean) * (product - mean)).sum();
        squares / (count - 1.0) / count
    }

    /// Jackknife estimate of the variance of the mean.
    fn jackknife_variance_of_mean(&self) -> f64 {
        let (mean, count) = (self.mean(), self.count as f64);
        let squares = (0..self.count).map(|seed| self.mean_without_image(seed) - mean);
        squares.map(|difference| difference * difference).sum::<f64>() * (count - 1.0) / count
    }
}

fn mean_image(pictures: &[RadianceImage]) -> RadianceImage {
    let mut mean = RadianceImage::black(pictures[0].width, pictures[0].height);
    let part = 1.0 / pictures.len() as f32;
    for picture in pictures {
        mean.pixels.iter_mut().zip(&picture.pixels).for_each(|(sum, pixel)| *sum += *pixel * part);
    }
    mean
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::compare::ImagePair;
    use crate::math::Vec3;
    use crate::math::random::TestRandom;

    /// Generates noisy square images.
    struct NoisyImages {
        random: TestRandom,
        side: u32,
    }

    impl NoisyImages {
        fn new(seed: u64) -> Self {
            Self { random: TestRandom::new(seed), side: 32 }
        }

        /// Returns an image with gray value 0.5 + `offset`, plus noise. Each block of `block`² pixels shares
        /// one noise value, like pixels lit by the same photon.
        fn picture(&mut self, noise: f32, offset: f32, block: u32) -> RadianceImage {
            let side = self.side;
            let mut picture = RadianceImage::black(side, side);
            for y in (0..side).step_by(block as usize) {
                for x in (0..side).step_by(block as usize) {
                    let value = Vec3::splat(0.5 + offset + noise * self.random.signed_f32());
                    for row in y..y + block {
                        picture.pixels[(row * side + x) as usize..][..block as usize].fill(value);
                    }
                }
            }
            picture
        }

        fn found(&mut self, seeds: usize, offset: f32, block: u32) -> SquaredBias {
            let names = [Path::new("r1"), Path::new("r2")];
            let pair = ImagePair::new(names, self.picture(0.02, 0.0, 1), self.picture(0.02, 0.0, 1));
            let references = IndependentReferences::new(pair.expect("a pair"));
            let pictures: Vec<_> = (0..seeds).map(|_| self.picture(0.2, offset, block)).collect();
            estimate_squared_bias(&references, &pictures).expect("enough seeds")
        }
    }

    #[test]
    fn false_positive_rate_is_as_specified() {
        // From 256 independent values per image down to 4.
        for (seeds, block) in [(3, 1), (6, 1), (6, 2), (6, 8)] {
            let random = TestRandom::new(seeds as u64 * 1000 + u64::from(block));
            let mut noise = NoisyImages { random, side: 16 };
            let alarms = (0..1000).filter(|_| noise.found(seeds, 0.0, block).is_significant()).count();
            // The expected count is 1. A Poisson variable with this mean exceeds 6 with probability 1e-4.
            assert!(alarms <= 6, "{seeds} seeds, blocks of {block}: {alarms} false alarms in 1000 trials");
        }
    }

    #[test]
    fn known_bias_is_estimated_correctly() {
        let mut noise = NoisyImages::new(7);
        let truth = 0.06_f64.powi(2) / 0.26;
        let mut sizes = Vec::new();
        for _ in 0..50 {
            let found = noise.found(6, 0.06, 1);
            assert!(found.is_significant() && found.bound > truth, "{found:?}");
            sizes.push(found.size);
        }
        let (mean, error) = super::super::statistics::mean_and_standard_error(&sizes);
        assert!(
            (mean - truth).abs() < 4.0 * error && error < 0.02 * truth,
            "got {mean} ± {error}, expected {truth}"
        );
    }

    #[test]
    fn standard_error_matches_repeated_trials() {
        let mut noise = NoisyImages::new(11);
        for offset in [0.0, 0.04] {
            let tries: Vec<SquaredBias> = (0..200).map(|_| noise.found(6, offset, 1)).collect();
            let sizes: Vec<f64> = tries.iter().map(|found| found.size).collect();
            let (_, error) = super::super::statistics::mean_and_standard_error(&sizes);
            let actual = error * (sizes.len() as f64).sqrt();
            let estimated = tries.iter().map(|found| found.error).sum::<f64>() / tries.len() as f64;
            assert!(
                estimated > 0.85 * actual && estimated < 2.0 * actual,
                "{offset}: estimated {estimated}, actual {actual}"
            );
        }
    }

    #[test]
    fn noise_free_images_have_exact_bias() {
        let mut noise = NoisyImages::new(1);
        let pair = ImagePair::new(
            [Path::new("a"), Path::new("b")],
            noise.picture(0.0, 0.0, 1),
            noise.picture(0.0, 0.0, 1),
        );
        let references = IndependentReferences::new(pair.expect("a pair"));
        let of = |picture: RadianceImage| {
            estimate_squared_bias(&references, &vec![picture; 3]).expect("enough seeds")
        };
        assert!(!of(noise.picture(0.0, 0.0, 1)).is_significant());
        assert!(of(noise.picture(0.0, 0.1, 1)).is_significant());
        assert_eq!(estimate_squared_bias(&references, &[noise.picture(0.0, 0.0, 1)]), None);
    }
}
