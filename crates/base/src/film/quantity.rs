//! Quantities that a film can display: mean radiance and sample statistics.

use super::convergence::{ConvergenceModel, variance_from_squared_step};
use super::sums::{Tile, tile_grid, tile_rect};
use super::{Film, RadianceImage, Rect, TILE_SIZE};
use crate::math::{DVec3, Vec3};

/// A film quantity that can be displayed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FilmQuantity {
    /// Mean radiance: the image itself.
    #[default]
    Radiance,
    /// Number of samples per pixel.
    Samples,
    /// Expected standard error of each pixel's luminance.
    Error,
}

/// Half-width, in pixels, of the window in which squared steps are averaged. A single pixel's step is very
/// noisy.
const WINDOW_RADIUS: usize = 2;

impl Film {
    /// Current image: the mean of every pixel's samples, black outside the crop and in pixels without
    /// samples.
    pub fn radiance_image(&self) -> RadianceImage {
        self.image(FilmQuantity::Radiance)
    }

    /// Image of a quantity, such as the sample counts.
    pub fn image(&self, quantity: FilmQuantity) -> RadianceImage {
        let mut image = RadianceImage::black(self.width(), self.height());
        for i in 0..self.tile_count() {
            let rect = tile_rect(self.crop_rect(), i);
            let tile = self.lock_tile(i);
            for row in 0..rect.height {
                let start = (rect.y + row) as usize * self.width() as usize + rect.x as usize;
                let line = &mut image.pixels[start..][..rect.width as usize];
                for (x, pixel) in line.iter_mut().enumerate() {
                    let columns = rect.width as usize;
                    let value = tile.value(quantity, (row as usize * columns + x, columns));
                    *pixel = value.map_or(Vec3::ZERO, DVec3::as_vec3);
                }
            }
        }
        image
    }

    /// One pixel of [`Film::image`], or `None` if it has no samples or is outside the crop.
    pub fn pixel(&self, quantity: FilmQuantity, x: u32, y: u32) -> Option<Vec3> {
        let Rect { x: left, y: top, width, height } = self.crop_rect();
        let (right, down) = (x.checked_sub(left)?, y.checked_sub(top)?);
        if right >= width || down >= height {
            return None;
        }
        let index =
            (down / TILE_SIZE) as usize * tile_grid(self.crop_rect()).0 + (right / TILE_SIZE) as usize;
        let place = (down % TILE_SIZE, right % TILE_SIZE);
        let columns = tile_rect(self.crop_rect(), index).width as usize;
        let index_in_tile = place.0 as usize * columns + place.1 as usize;
        let value = self.lock_tile(index).value(quantity, (index_in_tile, columns));
        value.map(DVec3::as_vec3)
    }
}

impl Tile {
    /// Value of a quantity at pixel `index` of a tile with `columns` columns, or `None` if the pixel has no
    /// samples.
    pub(super) fn value(&self, quantity: FilmQuantity, (index, columns): (usize, usize)) -> Option<DVec3> {
        match quantity {
            FilmQuantity::Radiance => self.mean(index),
            FilmQuantity::Samples => {
                (self.sample_count(index) > 0).then(|| DVec3::splat(f64::from(self.sample_count(index))))
            }
            FilmQuantity::Error => self.standard_error(index, columns).map(DVec3::splat),
        }
    }

    /// Standard error of a pixel's luminance: 0 for a single sample, which is not enough for an estimate, and
    /// `None` without samples.
    fn standard_error(&self, index: usize, columns: usize) -> Option<f64> {
        let count = self.sample_count(index);
        let rows = self.counts.len() / columns.max(1);
        let around =
            |at: usize, end: usize| at.saturating_sub(WINDOW_RADIUS)..(at + WINDOW_RADIUS + 1).min(end);
        let (mut sum, mut pixels) = (0.0, 0_u32);
        for y in around(index / columns, rows) {
            for x in around(index % columns, columns) {
                let place = y * columns + x;
                if self.sample_count(place) > 1 {
                    sum += self.steps.last_squared_step(place);
                    pixels += 1;
                }
            }
        }
        let variance = if count > 1 && pixels > 0 {
            let rate =
                ConvergenceModel::predicted_variance_reduction(&self.steps, count.ilog2() as usize, &[0, 1]);
            variance_from_squared_step(sum / f64::from(pixels), count, rate)
        } else {
            0.0
        };
        (count > 0).then(|| variance.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::TileSamples;
    use crate::math::random::unit_generator;

    /// A 20 × 20 pixel film with `count` gray samples per pixel.
    fn film(count: u32, mut next: impl FnMut(u32) -> f32) -> Film {
        let film = Film::new(20, 20, None).expect("a film");
        let rect = Rect { x: 0, y: 0, width: 20, height: 20 };
        let radiance = (0..400 * count).map(|i| Vec3::splat(next(i / count))).collect();
        film.add_samples(
            0,
            TileSamples {
                pixels: rect.into(),
                samples: count,
                radiance,
                negative: None,
                layers: Default::default(),
            },
        );
        film
    }

    #[test]
    fn pixel_error_matches_the_exact_error() {
        let mut next = unit_generator(9);
        for count in [2, 16, 100] {
            let errors = film(count, |_| next()).image(FilmQuantity::Error).pixels;
            let exact = (1.0 / 12.0 / f64::from(count)).sqrt();
            let mean = (errors.iter().map(|error| f64::from(error.x).powi(2)).sum::<f64>() / 400.0).sqrt();
            assert!((0.9..1.15).contains(&(mean / exact)), "{count}: {mean} {exact}");
            let spread = errors.iter().filter(|error| f64::from(error.x) < 0.25 * exact).count();
            assert!(spread < 20, "{count}: the error is far too small in {spread} pixels");
        }
    }

    #[test]
    fn noisy_pixels_do_not_affect_distant_pixels() {
        let mut next = unit_generator(3);
        // The right half is noisy.
        let half = film(16, |pixel| if pixel % 20 < 10 { 0.4 } else { next() });
        let errors = half.image(FilmQuantity::Error).pixels;
        for (i, error) in errors.iter().enumerate() {
            match i % 20 {
                0..8 => assert!(error.x < 1e-6, "{i}: {error}"),
                8..12 => {}
                _ => assert!(error.x > 0.01, "{i}: {error}"),
            }
        }
        assert_eq!(half.image(FilmQuantity::Samples).pixels, [Vec3::splat(16.0); 400]);
        assert_eq!(film(1, |_| 0.5).image(FilmQuantity::Error).pixels, [Vec3::ZERO; 400]);
        assert_eq!(
            Film::new(2, 1, None).expect("a film").image(FilmQuantity::Samples).pixels,
            [Vec3::ZERO; 2]
        );
    }
}
