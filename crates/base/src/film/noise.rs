//! Film noise: the error relative to the converged image, estimated from the film's own samples.

use rayon::prelude::*;

use super::convergence::{ConvergenceModel, luminance};
use super::{CELLS, Film, PixelSubset, SelectedPixels, is_in_thread_pool};

/// Sample count at which the standard error drops to `part` times its value at `count` samples, if the
/// variance is proportional to the sample count raised to −`power`.
pub fn total_samples_to_reduce_error(power: f64, part: f64, count: u32) -> u32 {
    (f64::from(count) * libm::pow(part, -2.0 / power)).ceil() as u32
}

/// Noise in one half of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfNoise {
    /// Mean variance of the pixels' luminance.
    pub variance: f64,
    /// Mean luminance.
    pub mean: f64,
    /// Samples per pixel.
    pub samples: u32,
    /// Expected exponent: the variance falls with this power of the sample count.
    pub power: f64,
}

/// An image's noise level and convergence rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseAndConvergenceRate {
    /// Relative standard error: [`Film::relative_error`].
    pub relative_error: f64,
    /// Expected exponent: the squared error falls with this power of the sample count.
    pub power: f64,
}

/// Sums over pixels for computing an image's noise.
#[derive(Clone, Copy, Debug, Default)]
struct NoiseSums {
    variance: f64,
    /// Expected variance after doubling the samples.
    left: f64,
    mean: f64,
}

impl NoiseSums {
    /// Expected exponent for the next doubling, or the exponent for independent samples if there is no noise.
    fn squared_error_decay_exponent(self) -> f64 {
        if self.left > 0.0 { libm::log2(self.variance / self.left) } else { 1.0 }
    }

    fn add_cell_half(&mut self, noise: &HalfNoise, pixels: f64) {
        self.variance += pixels * noise.variance;
        self.left += pixels * noise.variance * libm::exp2(-noise.power);
        self.mean += pixels * noise.mean;
    }
}

impl Film {
    /// Estimates the error of the current image relative to its brightness: the root mean square of the
    /// pixels' luminance standard errors, divided by the image's mean luminance. The estimate is based on the
    /// changes caused by the latest samples.
    ///
    /// The result is about 0 if all samples of each pixel are equal, and `None` if a pixel has fewer than two
    /// samples.
    pub fn relative_error(&self) -> Option<f64> {
        self.noise_and_convergence().map(|noise| noise.relative_error)
    }

    /// Returns [`Film::relative_error`] and its convergence exponent.
    pub fn noise_and_convergence(&self) -> Option<NoiseAndConvergenceRate> {
        let sums @ NoiseSums { variance, mean, .. } = self.noise_sums()?;
        let pixels = self.crop_rect().area() as f64;
        let error = (variance / pixels).sqrt();
        // A black image without error has a relative error of 0.
        let relative_error = if error == 0.0 { 0.0 } else { error / (mean / pixels) };
        Some(NoiseAndConvergenceRate { relative_error, power: sums.squared_error_decay_exponent() })
            .filter(|noise| noise.relative_error.is_finite())
    }

    /// Standard error of a complete image's mean luminance, assuming independent pixel errors.
    /// Returns `None` for crops, for photons (because they correlate the pixels' errors), and if a pixel has
    /// fewer than two samples.
    pub fn mean_luminance_standard_error(&self) -> Option<f64> {
        let is_whole = (self.crop_rect().width, self.crop_rect().height) == (self.width(), self.height());
        let is_apart = self.convergence == ConvergenceModel::Stratified;
        let sums = if is_whole && is_apart { self.noise_sums()? } else { return None };
        Some(sums.variance.sqrt() / self.crop_rect().area() as f64).filter(|error| error.is_finite())
    }

    /// Sums the noise over all pixels.
    fn noise_sums(&self) -> Option<NoiseSums> {
        let of_tile = |tile: usize| {
            let mut sums = NoiseSums::default();
            if self.lock_tile(tile).counts.is_empty() {
                return None;
            }
            let halves = (CELLS * tile..CELLS * (tile + 1)).flat_map(|cell| [(cell, 0), (cell, 1)]);
            for (cell, half) in halves {
                let pixels = self.cell_half_pixel_count(cell, half) as f64;
                if pixels > 0.0 {
                    sums.add_cell_half(&self.noise_in_cell_half(cell, half)?, pixels);
                }
            }
            Some(sums)
        };
        let add = |sums: NoiseSums, other: Option<NoiseSums>| {
            other.map(|other| NoiseSums {
                variance: sums.variance + other.variance,
                left: sums.left + other.left,
                mean: sums.mean + other.mean,
            })
        };
        self.map_tiles(of_tile).into_iter().try_fold(NoiseSums::default(), add)
    }

    /// Calls `f` for every tile and returns the results in tile order. Runs in parallel inside a rayon pool.
    pub fn map_tiles<T: Send>(&self, f: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        let tiles = 0..self.tile_count();
        if is_in_thread_pool() { tiles.into_par_iter().map(f).collect() } else { tiles.map(f).collect() }
    }

    /// Noise in one half of a cell, or `None` if the half has no pixels or if a pixel has fewer than two
    /// samples.
    pub fn noise_in_cell_half(&self, number: usize, half: usize) -> Option<HalfNoise> {
        let tile = self.lock_tile(number / CELLS);
        let (mut pixels, mut samples, mut sum) = (0_u32, u32::MAX, 0.0);
        for pixel in self.pixel_indices_in_noise_cell_half(number, half) {
            sum += luminance(tile.mean(pixel)?);
            samples = samples.min(tile.sample_count(pixel));
            pixels += 1;
        }
        let pixels = Some(f64::from(pixels)).filter(|pixels| *pixels > 0.0)?;
        let (variance, rate) = ConvergenceModel::pixel_variance_sum_and_rate(
            &tile.steps,
            (number % CELLS, half),
            samples,
            false,
        )?;
        Some(HalfNoise { variance: variance / pixels, mean: sum / pixels, samples, power: libm::log2(rate) })
    }

    /// Factor by which the last doubling reduced a tile's variance, measured in the half-cells that have
    /// completed that doubling, or `None` if there are not enough steps.
    pub fn last_doubling_variance_reduction(&self, tile: usize) -> Option<f64> {
        let tile = self.lock_tile(tile);
        tile.steps.measured_variance_reduction(tile.steps.level_count(), &[0, 1])
    }

    /// Expected relative standard deviation of a tile's variance, measured in one half of each cell: 1 if a
    /// single pixel dominates, lower if many pixels contribute. Ignores cells that have not completed the
    /// last doubling.
    pub fn tile_variance_uncertainty(&self, tile: usize, half: usize) -> f64 {
        let tile = self.lock_tile(tile);
        tile.steps.variance_uncertainty(tile.steps.level_count(), &[half])
    }

    /// Combined noise in one half of every cell in a tile. Returns `None` under the same conditions as
    /// [`Film::noise_in_cell_half`].
    pub fn noise_in_tile_half(&self, tile: usize, half: usize) -> Option<HalfNoise> {
        let (mut pixels, mut samples, mut sums) = (0.0, u32::MAX, NoiseSums::default());
        for cell in CELLS * tile..CELLS * (tile + 1) {
            let count = self.cell_half_pixel_count(cell, half) as f64;
            if count > 0.0 {
                let noise = self.noise_in_cell_half(cell, half)?;
                sums.add_cell_half(&noise, count);
                samples = samples.min(noise.samples);
                pixels += count;
            }
        }
        let (variance, mean, power) =
            (sums.variance / pixels, sums.mean / pixels, sums.squared_error_decay_exponent());
        (pixels > 0.0).then_some(HalfNoise { variance, mean, samples, power })
    }

    /// Relative mean squared error of a half-cell after the first `count` samples per pixel, and its
    /// convergence exponent. `count` must be a power of two. The error is luminance variance / (luminance² +
    /// [`RELMSE_EPSILON`](crate::math::color::RELMSE_EPSILON)), averaged over the pixels. Returns `None` if
    /// `count` is less than two or exceeds the pixels' sample count, or if the half has no pixels.
    pub fn cell_half_relmse_and_exponent(
        &self,
        number: usize,
        half: usize,
        count: u32,
    ) -> Option<(f64, f64)> {
        let tile = self.lock_tile(number / CELLS);
        let pixels = self.cell_half_pixel_count(number, half);
        let (sum, rate) =
            ConvergenceModel::pixel_variance_sum_and_rate(&tile.steps, (number % CELLS, half), count, true)?;
        (pixels > 0).then(|| (sum / pixels as f64, libm::log2(rate)))
    }

    /// Convergence model for this film's noise.
    pub fn convergence_model(&self) -> ConvergenceModel {
        self.convergence
    }

    /// Number of pixels in one half of a cell.
    pub fn cell_half_pixel_count(&self, cell: usize, half: usize) -> usize {
        self.noise_cell_rect(cell).map_or(0, |rect| PixelSubset::Half(half).count(rect.area()))
    }

    /// Tile-relative indices of the pixels in a half-cell.
    fn pixel_indices_in_noise_cell_half(&self, cell: usize, half: usize) -> impl Iterator<Item = usize> {
        let (tile, rect) = (self.tile_rect(cell / CELLS), self.noise_cell_rect(cell));
        let part = PixelSubset::Half(half);
        tile.zip(rect).into_iter().flat_map(move |(tile, rect)| {
            let place = move |number| SelectedPixels { rect, part }.image_position(number);
            let index = move |(x, y): (u32, u32)| ((y - tile.y) * tile.width + x - tile.x) as usize;
            (0..part.count(rect.area()) as u32).map(move |number| index(place(number)))
        })
    }

    /// Mean luminance of the image, or `None` if a pixel has no samples.
    pub fn mean_luminance(&self) -> Option<f64> {
        let of_tile = |tile: usize| {
            let tile = self.lock_tile(tile);
            if tile.counts.is_empty() {
                return None;
            }
            (0..tile.counts.len()).map(|pixel| tile.mean(pixel).map(luminance)).sum::<Option<f64>>()
        };
        let sum: Option<f64> = self.map_tiles(of_tile).into_iter().sum();
        sum.map(|sum| sum / self.crop_rect().area() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Rect, TILE_SIZE, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit_generator;

    /// A single-row film with these gray samples for each pixel.
    fn film(pixels: &[&[f32]]) -> Film {
        let film = Film::new(pixels.len() as u32, 1, None).expect("a film");
        for (x, values) in pixels.iter().enumerate() {
            let rect = Rect { x: x as u32, y: 0, width: 1, height: 1 };
            let radiance = values.iter().map(|&value| Vec3::splat(value)).collect();
            film.add_samples(
                x / TILE_SIZE as usize,
                TileSamples {
                    pixels: rect.into(),
                    samples: values.len() as u32,
                    radiance,
                    negative: None,
                    layers: Default::default(),
                },
            );
        }
        film
    }

    #[test]
    fn error_is_computed_from_the_last_steps() {
        // The steps are 1 and 0.5, and the variances are their squares. The mean luminance is 3.
        let error = film(&[&[4.0, 6.0], &[0.5, 1.5]]).relative_error().expect("an estimate");
        assert!((error - (1.25_f64 / 2.0).sqrt() / 3.0).abs() < 1e-6, "{error}");
        // Samples 1, 2, 3, 6: the mean changes from 1 to 1.5 to 3, and the mean of the second half changes
        // from 3 to 4.5.
        let error = film(&[&[1.0, 2.0, 3.0, 6.0]]).relative_error().expect("an estimate");
        let before = 0.5 * (0.5 * 0.5 + 1.5 * 1.5);
        let expected = ((1.5_f64 * 1.5 + before) / 3.0).sqrt() / 3.0;
        assert!((error - expected).abs() < 1e-6, "{error} {expected}");
    }

    #[test]
    fn halves_with_fewer_samples_are_ignored() {
        // Two pixels in different halves: one with steps of 1 and 0.5, the other with a single step of 3.
        let film = film(&[&[1.0, 3.0, 2.0, 4.0], &[1.0, 7.0]]);
        assert_eq!(film.last_doubling_variance_reduction(0), Some(4.0));
        assert_eq!(
            self::film(&[&[1.0, 3.0], &[1.0, 7.0]]).last_doubling_variance_reduction(0),
            None,
            "one step"
        );
    }

    #[test]
    fn uncertainty_is_large_for_few_pixels() {
        let one: &[f32] = &[0.0, 8.0];
        let none: &[f32] = &[1.0, 1.0];
        // Pixels in a row alternate between the halves.
        let of = |pixels: &[&[f32]]| film(pixels).tile_variance_uncertainty(0, 0);
        assert_eq!(of(&[one, one, none, none, none, none, none, none]), 1.0);
        assert_eq!(of(&[one; 8]), 0.5);
        assert_eq!(of(&[none; 8]), 0.0);
    }

    #[test]
    fn image_mean_has_a_smaller_error_than_pixels() {
        // Two pixels with variances 1 and 0.25.
        let film = film(&[&[4.0, 6.0], &[0.5, 1.5]]);
        let error = film.mean_luminance_standard_error().expect("an estimate");
        assert!((error - 1.25_f64.sqrt() / 2.0).abs() < 1e-6, "{error}");
        assert_eq!(
            film.with_convergence_model(ConvergenceModel::Photons).mean_luminance_standard_error(),
            None,
            "photons correlate pixel errors"
        );
        assert_eq!(self::film(&[&[4.0, 6.0], &[0.5]]).mean_luminance_standard_error(), None);
        let part = Film::new(4, 1, Some(Rect { x: 0, y: 0, width: 2, height: 1 })).expect("a film");
        assert_eq!(part.mean_luminance_standard_error(), None);
    }

    #[test]
    fn independent_samples_have_the_expected_error() {
        // Variance reductions that may be due to chance are only partly trusted.
        let mut next = unit_generator(5);
        for count in [16, 64, 100, 1024] {
            let pixels: Vec<Vec<f32>> = (0..4000).map(|_| (0..count).map(|_| next()).collect()).collect();
            let pixels: Vec<&[f32]> = pixels.iter().map(Vec::as_slice).collect();
            let exact = (1.0 / 12.0 / f64::from(count)).sqrt() / 0.5;
            for convergence in [ConvergenceModel::Stratified, ConvergenceModel::Photons] {
                let error =
                    film(&pixels).with_convergence_model(convergence).relative_error().expect("an estimate");
                assert!(
                    (0.9..1.04).contains(&(error / exact)),
                    "{count} samples: got {error}, expected {exact}"
                );
            }
        }
    }

    /// A 64 × 64 pixel film and the true relative root-mean-square error of its pixel means. `sample` maps a
    /// sample index and the pixel's random bits to a sample value. `truth` is the expected value.
    fn square(count: u32, truth: f64, mut sample: impl FnMut(u32, u32) -> f32) -> (Film, f64) {
        const SIDE: u32 = 64;
        let film = Film::new(SIDE, SIDE, None).expect("a film");
        let mut next = unit_generator(11);
        let mut square = 0.0;
        for tile in 0..film.tile_count() {
            let rect = film.tile_rect(tile).expect("a tile");
            let mut radiance = Vec::new();
            for _ in 0..rect.area() {
                let bits = (next() * 16_777_216.0) as u32;
                let values: Vec<f32> = (0..count).map(|number| sample(number, bits)).collect();
                let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / f64::from(count);
                square += (mean - truth) * (mean - truth);
                radiance.extend(values.into_iter().map(Vec3::splat));
            }
            film.add_samples(
                tile,
                TileSamples {
                    pixels: rect.into(),
                    samples: count,
                    radiance,
                    negative: None,
                    layers: Default::default(),
                },
            );
        }
        (film, (square / f64::from(SIDE * SIDE)).sqrt() / truth)
    }

    /// Ratio of the estimated error to the true error.
    fn reported(count: u32, truth: f64, sample: impl FnMut(u32, u32) -> f32) -> f64 {
        let (film, exact) = square(count, truth, sample);
        film.relative_error().expect("an estimate") / exact
    }

    /// A van der Corput sequence with a random XOR per pixel. Each doubling fills the gaps between earlier
    /// numbers.
    fn filling(number: u32, bits: u32) -> f32 {
        ((number.reverse_bits() >> 8) ^ bits) as f32 / 16_777_216.0
    }

    #[test]
    fn error_is_accurate_for_any_convergence_rate() {
        for count in [16, 64, 256] {
            let mut next = unit_generator(5);
            let independent = reported(count, 0.5, |_, _| next());
            assert!((0.95..1.15).contains(&independent), "{count} independent samples: {independent}");
            let smooth = reported(count, 0.5, filling);
            assert!((0.9..1.35).contains(&smooth), "{count} stratified samples: {smooth}");
        }
    }

    #[test]
    fn error_is_accurate_for_rare_bright_samples() {
        for count in [16, 64, 256] {
            let mut next = unit_generator(17);
            let rare = |number, bits| if next() < 1e-3 { 100.0 } else { filling(number, bits) };
            let ratio = reported(count, 0.1 + 0.5 * 0.999, rare);
            assert!((0.95..1.15).contains(&ratio), "{count}: {ratio}");
        }
    }

    #[test]
    fn convergence_rate_is_estimated() {
        let power = |sample: &mut dyn FnMut(u32, u32) -> f32| {
            square(64, 0.5, sample).0.noise_and_convergence().expect("noise").power
        };
        let mut next = unit_generator(5);
        let independent = power(&mut |_, _| next());
        assert!((1.0..1.1).contains(&independent), "{independent}");
        assert!(power(&mut filling) > 1.5, "{}", power(&mut filling));
    }

    #[test]
    fn error_is_independent_of_brightness() {
        let noise = |scale: f32| {
            let values: Vec<f32> = (0..50).map(|i| scale * (i * 7 % 10) as f32).collect();
            film(&[&values]).relative_error().expect("an estimate")
        };
        assert!((noise(1.0) - noise(1024.0)).abs() < 1e-6);
    }

    #[test]
    fn single_samples_give_no_estimate() {
        assert_eq!(film(&[&[1.0, 2.0], &[1.0]]).relative_error(), None);
        assert_eq!(Film::new(40, 2, None).expect("a film").relative_error(), None);
        assert_eq!(film(&[&[0.0, 0.0]]).relative_error(), Some(0.0));
        assert!(film(&[&[0.3, 0.3, 0.3]]).relative_error() < Some(1e-7));
    }
}
