//! Brightness prepass: the first samples of a fixed subset of pixels estimate the image's brightness. Noise
//! thresholds are relative to this brightness. All machines that render parts of an image compute the same
//! value.

use super::convergence::luminance;
use super::{Film, FilmQuantity, Rect, TileSamples};
use crate::math::random::hash;

/// Number of prepass pixels, unless the image has fewer pixels.
const PREPASS_PIXELS: u64 = 4096;

/// Samples per prepass pixel.
pub const PREPASS_SAMPLES: u32 = 16;

/// Pixels of the brightness prepass for an image or crop.
#[derive(Clone, Copy, Debug)]
pub struct BrightnessPrepassPixels {
    crop: Rect,
}

impl BrightnessPrepassPixels {
    /// Creates the prepass for the pixels in `crop`.
    pub fn new(crop: Rect) -> Self {
        Self { crop }
    }

    /// Number of prepass pixels.
    pub fn pixel_count(&self) -> u64 {
        PREPASS_PIXELS.min(self.crop.area() as u64)
    }

    /// Column and row of a prepass pixel. The crop's pixels, in row-major order, are divided into as many
    /// equal runs as there are prepass pixels, and one pixel is chosen pseudo-randomly from each run.
    pub fn pixel_position(&self, number: u64) -> (u32, u32) {
        let (area, count) = (self.crop.area() as u64, self.pixel_count().max(1));
        let (start, end) = (number * area / count, (number + 1) * area / count);
        let index = start + hash(number) % (end - start).max(1);
        let width = u64::from(self.crop.width.max(1));
        (self.crop.x + (index % width) as u32, self.crop.y + (index / width) as u32)
    }

    /// Mean luminance of the prepass pixels in a film, or `None` if one of them has no samples.
    pub fn film_mean_luminance(&self, film: &Film) -> Option<f64> {
        self.mean_luminance(|number| {
            let (x, y) = self.pixel_position(number);
            film.pixel(FilmQuantity::Radiance, x, y).map(|radiance| luminance(radiance.as_dvec3()))
        })
    }

    /// Mean of the prepass pixels' luminances.
    pub fn mean_luminance(&self, luminance_of: impl Fn(u64) -> Option<f64>) -> Option<f64> {
        let sum: Option<f64> = (0..self.pixel_count()).map(luminance_of).sum();
        sum.map(|sum| sum / self.pixel_count() as f64)
    }

    /// Luminance of a prepass pixel computed from its samples, with the same rounding as in a film, or `None`
    /// if there are no samples.
    pub fn luminance_from_samples(mut samples: TileSamples) -> Option<f64> {
        let rect = Rect { x: 0, y: 0, width: 1, height: 1 };
        samples.pixels = rect.into();
        let film = Film::new(1, 1, None).ok()?;
        film.add_samples(0, samples);
        film.pixel(FilmQuantity::Radiance, 0, 0).map(|radiance| luminance(radiance.as_dvec3()))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::math::Vec3;

    #[test]
    fn prepass_pixels_are_spread_over_the_image() {
        for crop in [(4096, 2048), (97, 501), (64, 64), (3, 5)] {
            let prepass = BrightnessPrepassPixels::new(Rect { x: 7, y: 9, width: crop.0, height: crop.1 });
            let places: HashSet<_> =
                (0..prepass.pixel_count()).map(|number| prepass.pixel_position(number)).collect();
            assert_eq!(places.len() as u64, u64::from(crop.0 * crop.1).min(4096));
            let inside = |&(x, y): &(u32, u32)| (7..7 + crop.0).contains(&x) && (9..9 + crop.1).contains(&y);
            assert!(places.iter().all(inside));
            let left = places.iter().filter(|(x, _)| x - 7 < crop.0 / 2).count() as f64 / places.len() as f64;
            assert!((left - 0.5).abs() < 0.1 || crop.0 < 10, "{crop:?}: fraction {left} in the left half");
        }
    }

    #[test]
    fn film_and_prepass_brightness_are_equal() {
        let crop = Rect { x: 0, y: 0, width: 40, height: 3 };
        let film = Film::new(40, 3, None).expect("a film");
        let value =
            |x: u32, y: u32, sample: u32| Vec3::new(x as f32 + 0.3, y as f32 * 0.7, sample as f32 / 3.0);
        let samples = |rect: Rect| {
            let pixels = (0..rect.area() as u32).map(|i| (rect.x + i % rect.width, rect.y + i / rect.width));
            let radiance = pixels.flat_map(|(x, y)| (0..16).map(move |sample| value(x, y, sample))).collect();
            TileSamples {
                pixels: rect.into(),
                samples: 16,
                radiance,
                negative: None,
                layers: Default::default(),
            }
        };
        for tile in 0..film.tile_count() {
            film.add_samples(tile, samples(film.tile_rect(tile).expect("a tile")));
        }
        let prepass = BrightnessPrepassPixels::new(crop);
        let apart = prepass.mean_luminance(|number| {
            let (x, y) = prepass.pixel_position(number);
            BrightnessPrepassPixels::luminance_from_samples(samples(Rect { x, y, width: 1, height: 1 }))
        });
        assert_eq!(prepass.film_mean_luminance(&film), apart);
        assert!(
            apart.is_some()
                && BrightnessPrepassPixels::new(crop)
                    .film_mean_luminance(&Film::new(40, 3, None).expect("a film"))
                    .is_none()
        );
    }
}
