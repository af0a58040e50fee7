//! Detects images that are brighter or darker than the references on average. A bias shared by all pixels is
//! small in relMSE, but large compared with the noise of the mean.

use serde::{Deserialize, Serialize};

use super::bias::{FALSE_POSITIVE_RATE, MIN_SEEDS};
use super::statistics::{mean_and_standard_error, student_t_tail};
use crate::compare::IndependentReferences;
use crate::film::RadianceImage;
use crate::math::DVec3;
use crate::math::color::LUMINANCE_WEIGHTS;

/// Relative difference in brightness between images and references.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BrightnessDifference {
    /// The difference, relative to the mean luminance of the references.
    pub value: f64,
    /// Standard error of `value`.
    pub error: f64,
    /// Two-sided p-value for the null hypothesis of no bias.
    #[serde(rename = "by_chance")]
    pub p_value: f64,
}

impl BrightnessDifference {
    /// Whether the bias is significant.
    pub fn is_biased(&self) -> bool {
        self.p_value < FALSE_POSITIVE_RATE
    }
}

/// Compares the mean brightness of images, each rendered with a different seed, to the mean brightness of the
/// references. `are_pixels_independent` must be false with photons, because they correlate pixel errors.
/// Returns `None` for fewer than [`MIN_SEEDS`] images or for black references.
pub fn compare_brightness(
    references: &IndependentReferences,
    pictures: &[RadianceImage],
    are_pixels_independent: bool,
) -> Option<BrightnessDifference> {
    if pictures.len() < MIN_SEEDS || !(references.mean_luminance() > 0.0) {
        return None;
    }
    let values: Vec<f64> = pictures.iter().map(|picture| references.relative_bias(picture)).collect();
    let (value, by_seeds) = mean_and_standard_error(&values);
    let seeds = pictures.len() as f64 - 1.0;
    let (of_pictures, freedom) = if are_pixels_independent {
        // Estimate the noise from all pixels, not just from a few seeds.
        (
            mean_luminance_standard_error(pictures) / references.mean_luminance(),
            seeds * pictures[0].pixels.len() as f64,
        )
    } else {
        (by_seeds, seeds)
    };
    let of_references = references.relative_bias_standard_error();
    let error = (of_pictures * of_pictures + of_references * of_references).sqrt();
    let p_value = match error > 0.0 {
        true => 2.0 * student_t_tail(value.abs() / error, freedom),
        false => f64::from(u8::from(value == 0.0)),
    };
    Some(BrightnessDifference { value, error, p_value })
}

/// Standard error of the images' mean luminance, from the variance of each pixel.
fn mean_luminance_standard_error(pictures: &[RadianceImage]) -> f64 {
    let count = pictures.len() as f64;
    let weights: DVec3 = LUMINANCE_WEIGHTS.as_dvec3();
    let pixels = pictures[0].pixels.len();
    let variance = |pixel: usize| {
        let values = || pictures.iter().map(move |picture| picture.pixels[pixel].as_dvec3().dot(weights));
        let mean = values().sum::<f64>() / count;
        values().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0) / count
    };
    (0..pixels).map(variance).sum::<f64>().sqrt() / pixels as f64
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::bench::bias::estimate_squared_bias;
    use crate::compare::ImagePair;
    use crate::math::Vec3;
    use crate::math::random::unit_generator;

    /// Width and height of the images.
    const SIDE: u32 = 64;

    /// Returns an image with gray value 0.5 · (1 + `brighter`), independent noise per pixel, and an offset
    /// shared by all pixels.
    fn picture(next: &mut impl FnMut() -> f32, brighter: f32, noise: f32, shared: f32) -> RadianceImage {
        sized_picture(SIDE, next, brighter, noise, shared)
    }

    fn sized_picture(
        side: u32,
        next: &mut impl FnMut() -> f32,
        brighter: f32,
        noise: f32,
        shared: f32,
    ) -> RadianceImage {
        let all = shared * (2.0 * next() - 1.0);
        let pixels = (0..side * side)
            .map(|_| Vec3::splat(0.5 * (1.0 + brighter) + all + noise * (2.0 * next() - 1.0)));
        RadianceImage { width: side, height: side, pixels: pixels.collect() }
    }

    fn references(side: u32, next: &mut impl FnMut() -> f32) -> IndependentReferences {
        let pair = [Path::new("r1"), Path::new("r2")];
        let [a, b] = [(); 2].map(|()| sized_picture(side, next, 0.0, 0.02, 0.0));
        IndependentReferences::new(ImagePair::new(pair, a, b).expect("a pair"))
    }

    #[test]
    fn one_percent_darkening_is_detected() {
        const SEEDS: u32 = 40;
        let (mut off, mut missed) = (Vec::new(), 0);
        for seed in 1..=SEEDS {
            let mut next = unit_generator(seed.into());
            let references = references(SIDE, &mut next);
            let pictures: Vec<_> = (0..3).map(|_| picture(&mut next, -0.01, 0.2, 0.0)).collect();
            let found = compare_brightness(&references, &pictures, true).expect("enough seeds");
            missed += u32::from(!found.is_biased());
            off.push((found.value + 0.01) / found.error);
            let by_relmse = estimate_squared_bias(&references, &pictures).expect("enough seeds");
            assert!(!by_relmse.is_significant(), "seed {seed}: the bias should be undetectable in relMSE");
        }
        // One percent is 4.7 standard errors, and the threshold is 3.3. The test therefore misses 8 % of the
        // seeds, or 3.3 out of 40 on average. Allow 8.
        assert!(missed <= 8, "{missed}");
        // The normalized errors have mean 0 and standard deviation 1.
        let count = f64::from(SEEDS);
        let mean = off.iter().sum::<f64>() / count;
        let spread = (off.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt();
        assert!(mean.abs() < 3.0 / count.sqrt(), "{mean}");
        assert!((0.7..1.4).contains(&spread), "{spread}");
    }

    #[test]
    fn noise_is_not_mistaken_for_bias() {
        for (noise, shared) in [(0.2, 0.0), (0.02, 0.02)] {
            let mut next = unit_generator(5);
            let alarms = (0..200).filter(|_| {
                let references = references(32, &mut next);
                let pictures: Vec<_> =
                    (0..4).map(|_| sized_picture(32, &mut next, 0.0, noise, shared)).collect();
                compare_brightness(&references, &pictures, shared == 0.0).expect("enough seeds").is_biased()
            });
            // The expected count is 0.2. The probability of 4 or more is 1e-4.
            let alarms = alarms.count();
            assert!(alarms <= 3, "{noise} {shared}: {alarms} false alarms in 200 trials");
        }
    }

    #[test]
    fn too_few_images_or_black_references_give_none() {
        let mut next = unit_generator(7);
        let references = references(SIDE, &mut next);
        let pictures: Vec<_> = (0..2).map(|_| picture(&mut next, 0.0, 0.1, 0.0)).collect();
        assert_eq!(compare_brightness(&references, &pictures, true), None);
        let black = || RadianceImage::black(2, 2);
        let dark = ImagePair::new([Path::new("a"), Path::new("b")], black(), black()).expect("a pair");
        assert_eq!(
            compare_brightness(&IndependentReferences::new(dark), &[black(), black(), black()], true),
            None
        );
    }
}
