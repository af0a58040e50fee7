//! How far a film is from the picture of endless samples, judged by its own samples.

use super::Film;
use crate::math::DVec3;
use crate::math::color::LUMINANCE_WEIGHTS;

/// Relative luminance in double precision, so that sums of its squares and squares of its sums agree.
pub(super) fn luminance(radiance: DVec3) -> f64 {
    radiance.dot(LUMINANCE_WEIGHTS.as_dvec3())
}

impl Film {
    /// The error to expect of the picture so far, relative to its brightness: the root mean square over the pixels of
    /// the standard error of their luminance, divided by the picture's mean luminance. A pixel's standard error is
    /// the root of s²/n, where s² is the unbiased variance of its n samples.
    ///
    /// This holds for independent samples; those of a pixel are better distributed than that, so that the error is
    /// smaller in fact. Next to 0 where all samples of each pixel are alike; none where a pixel has fewer than two samples,
    /// of which nothing can be told.
    pub fn relative_error(&self) -> Option<f64> {
        let (mut mean_squares, mut means) = (0.0, 0.0);
        for index in 0..self.tile_count() {
            let tile = self.tile(index);
            if tile.counts.is_empty() {
                return None;
            }
            for pixel in 0..tile.counts.len() {
                let count = f64::from(tile.count(pixel));
                let mean = tile.mean(pixel).map(luminance).filter(|_| count >= 2.0)?;
                // Below 0 by rounding only.
                let spread = (tile.squares[pixel] / count - mean * mean).max(0.0);
                mean_squares += spread / (count - 1.0);
                means += mean;
            }
        }
        let pixels = self.crop().area() as f64;
        let (error, mean) = ((mean_squares / pixels).sqrt(), means / pixels);
        match error {
            0.0 => Some(0.0),
            _ => Some(error / mean).filter(|relative| relative.is_finite()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Rect, TileSamples};
    use crate::math::Vec3;

    /// A film of one row, each pixel with its grey samples.
    fn film(pixels: &[&[f32]]) -> Film {
        let film = Film::new(pixels.len() as u32, 1, None).expect("a film");
        for (x, values) in pixels.iter().enumerate() {
            let rect = Rect { x: x as u32, y: 0, width: 1, height: 1 };
            let radiance = values.iter().map(|&value| Vec3::splat(value)).collect();
            film.add(0, &TileSamples { rect, samples: values.len() as u32, radiance });
        }
        film
    }

    #[test]
    fn the_error_is_the_standard_error_of_the_pixels_over_the_mean_of_the_picture() {
        // Variances 2 and 0.5 of two samples each, so squared standard errors 1 and 0.25; mean luminance 3.
        let error = film(&[&[4.0, 6.0], &[0.5, 1.5]]).relative_error().expect("an estimate");
        assert!((error - (1.25_f64 / 2.0).sqrt() / 3.0).abs() < 1e-12, "{error}");
        // 1, 2, 3, 6: mean 3, variance 14/3, its standard error √(14/12).
        let error = film(&[&[1.0, 2.0, 3.0, 6.0]]).relative_error().expect("an estimate");
        assert!((error - (14.0_f64 / 12.0).sqrt() / 3.0).abs() < 1e-12, "{error}");
    }

    #[test]
    fn it_does_not_depend_on_brightness_and_falls_with_the_root_of_the_samples() {
        let noise = |count: u32, scale: f32| {
            let values: Vec<f32> = (0..count).map(|i| scale * (i * 7 % 10) as f32).collect();
            film(&[&values]).relative_error().expect("an estimate")
        };
        assert!((noise(50, 1.0) - noise(50, 1024.0)).abs() < 1e-12);
        let ratio = noise(100, 1.0) / noise(10_000, 1.0);
        assert!((ratio - 10.0).abs() < 0.1, "{ratio}");
    }

    #[test]
    fn nothing_is_told_of_single_samples_and_equal_ones_have_no_error() {
        assert_eq!(film(&[&[1.0, 2.0], &[1.0]]).relative_error(), None);
        assert_eq!(Film::new(40, 2, None).expect("a film").relative_error(), None);
        assert_eq!(film(&[&[0.0, 0.0]]).relative_error(), Some(0.0));
        assert!(film(&[&[0.3, 0.3, 0.3]]).relative_error() < Some(1e-7));
    }
}
