//! How far a film is from the picture of endless samples, judged by its own samples.

use rayon::prelude::*;

use super::{CELLS, Film, Part, Pixels, is_in_pool};
use crate::math::DVec3;
use crate::math::color::{LUMINANCE_WEIGHTS, RELMSE_LEAST};

/// Relative luminance in double precision, so that sums of its squares and squares of its sums agree.
pub(super) fn luminance(radiance: DVec3) -> f64 {
    radiance.dot(LUMINANCE_WEIGHTS.as_dvec3())
}

/// How the pixels of a tile moved from each power of two of samples to the next.
///
/// The samples of a pixel are not independent: each twice as many fill the gaps between those before, so that the variance of
/// single samples tells too much, and two halves scrambled apart would cost what the gaps are worth. But for the mean M of 2n
/// samples, of which the first n have the mean A and the others B, (A − M)² = (A − B)²/4 has the expectation V(n) − V(2n)
/// for any dependence between A and B, as V(2n) = (V(A) + V(B))/4 + Cov/2 and V(A) = V(B) = V(n). These steps and the rate at
/// which V falls give V.
#[derive(Debug, Default)]
pub(super) struct Steps {
    /// Luminance of each pixel at the last power of two of its samples.
    last: Vec<f64>,
    /// Sums over the pixels of both halves of each cell of the squared steps to 2, 4, 8, … samples.
    squares: Vec<[[f64; 2]; CELLS]>,
    /// The same, each over luminance² + [`RELMSE_LEAST`].
    relative: Vec<[[f64; 2]; CELLS]>,
    /// The last step of each pixel.
    recent: Vec<f32>,
}

impl Steps {
    /// With memory for so many pixels, if it can be had.
    pub(super) fn reserved(area: usize) -> Option<Self> {
        let mut last = Vec::new();
        last.try_reserve_exact(area).ok()?;
        let mut recent = Vec::new();
        recent.try_reserve_exact(area).ok()?;
        Some(Self { last, squares: Vec::new(), relative: Vec::new(), recent })
    }

    /// For so many pixels; cannot fail where the memory was reserved.
    pub(super) fn fill(&mut self, area: usize) {
        self.last.resize(area, 0.0);
        self.recent.resize(area, 0.0);
    }

    /// The last step of a pixel, squared.
    pub(super) fn square(&self, pixel: usize) -> f64 {
        self.recent.get(pixel).map_or(0.0, |step| f64::from(*step) * f64::from(*step))
    }

    /// A pixel of a half of a cell has a power of two of samples, which make this luminance.
    pub(super) fn note(&mut self, (pixel, cell, half): (usize, usize, usize), count: u32, luminance: f64) {
        let level = count.trailing_zeros() as usize;
        if level > 0 {
            self.squares.resize(self.squares.len().max(level), [[0.0; 2]; CELLS]);
            let step = luminance - self.last[pixel];
            self.squares[level - 1][cell][half] += step * step;
            self.relative.resize(self.squares.len(), [[0.0; 2]; CELLS]);
            self.relative[level - 1][cell][half] += step * step / (luminance * luminance + RELMSE_LEAST);
            self.recent[pixel] = step as f32;
        }
        self.last[pixel] = luminance;
    }
}

/// How the variance of a pixel's mean is taken to fall with its samples. To measure that by earlier steps does worse, as few bright
/// pixels may decide it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convergence {
    /// The samples of a pixel fill each other's gaps. Twice as many make the variance 2 times smaller where they are as good as
    /// independent, 2.8 times at edges and in penumbras, 4 times where all is smooth: taken for 2.7, the standard error is 0.72,
    /// 1.04 and 1.5 times the true one.
    #[default]
    Stratified,
    /// Each sample has photons of its own: samples are independent.
    Independent,
}

impl Convergence {
    /// How many times smaller the variance gets by twice as many samples.
    fn rate(self) -> f64 {
        match self {
            Self::Stratified => 2.7,
            Self::Independent => 2.0,
        }
    }

    /// The variance falls with this power of the samples: the binary logarithm of the rate.
    pub fn power(self) -> f64 {
        match self {
            Self::Stratified => 1.432_959_407_276_106_2,
            Self::Independent => 1.0,
        }
    }

    /// Samples that bring the standard error of means of `count` samples to a part of itself.
    pub fn samples_to(self, part: f64, count: u32) -> u32 {
        samples_by(self.power(), part, count)
    }

    /// The variance of a mean of `count` ≥ 2 samples by the squared step to the last power of two of them.
    pub(super) fn pixel_variance(self, step: f64, count: u32) -> f64 {
        // Between powers of two as for independent samples.
        let part = f64::from(1_u32 << count.ilog2()) / f64::from(count);
        step / (self.rate() - 1.0) * part
    }

    /// The variance of means of `count` samples, by the sums of squared steps of one half to 2, 4, … of them: that of the last step and
    /// what the one before foretells of it together, as each has a spread.
    fn variance(self, steps: &[[[f64; 2]; CELLS]], (cell, half): (usize, usize), count: u32) -> Option<f64> {
        let level = count.checked_ilog2()? as usize;
        let last = steps.get(level.checked_sub(1)?)?[cell][half];
        let step = match level.checked_sub(2) {
            Some(before) => 0.5 * (last + steps[before][cell][half] / self.rate()),
            None => last,
        };
        Some(self.pixel_variance(step, count))
    }
}

/// Samples that bring the standard error of means of `count` samples to a part of itself, where its square falls with this power of them.
pub fn samples_by(power: f64, part: f64, count: u32) -> u32 {
    (f64::from(count) * libm::pow(part, -2.0 / power)).ceil() as u32
}

/// How much noise there is in a half of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfNoise {
    /// Mean variance of the pixels' luminance.
    pub variance: f64,
    /// Mean luminance.
    pub mean: f64,
    /// Samples of each pixel.
    pub samples: u32,
}

impl Film {
    /// The error to expect of the picture so far, relative to its brightness: the root mean square over the pixels of
    /// the standard error of their luminance, divided by the picture's mean luminance; by what the last samples changed
    /// in it.
    ///
    /// Next to 0 where all samples of each pixel are alike; none where a pixel has fewer than two samples,
    /// of which nothing can be told.
    pub fn relative_error(&self) -> Option<f64> {
        let (variances, means) = self.noise_sums()?;
        let pixels = self.crop().area() as f64;
        let error = (variances / pixels).sqrt();
        // Of a black picture too.
        let relative = if error == 0.0 { 0.0 } else { error / (means / pixels) };
        Some(relative).filter(|relative| relative.is_finite())
    }

    /// The standard error of the mean luminance of a whole picture, whose pixels err apart from each other; none of a part, where
    /// photons make the pixels err together, and where a pixel has fewer than two samples.
    pub fn mean_luminance_error(&self) -> Option<f64> {
        let is_whole = (self.crop().width, self.crop().height) == (self.width(), self.height());
        let is_apart = self.convergence == Convergence::Stratified;
        let (variances, _) = if is_whole && is_apart { self.noise_sums()? } else { return None };
        Some(variances.sqrt() / self.crop().area() as f64).filter(|error| error.is_finite())
    }

    /// Sums over the pixels: of the variance of their luminance, and of their luminance.
    fn noise_sums(&self) -> Option<(f64, f64)> {
        let of_tile = |tile: usize| {
            let (mut variances, mut means) = (0.0, 0.0);
            if self.tile(tile).counts.is_empty() {
                return None;
            }
            let halves = (CELLS * tile..CELLS * (tile + 1)).flat_map(|cell| [(cell, 0), (cell, 1)]);
            for (cell, half) in halves {
                let pixels = self.half_pixel_count(cell, half) as f64;
                if pixels > 0.0 {
                    let HalfNoise { variance, mean, .. } = self.half_noise(cell, half)?;
                    variances += variance * pixels;
                    means += mean * pixels;
                }
            }
            Some((variances, means))
        };
        let add = |(variances, means), sums: Option<(f64, f64)>| {
            sums.map(|(variance, mean)| (variances + variance, means + mean))
        };
        self.of_tiles(of_tile).into_iter().try_fold((0.0, 0.0), add)
    }

    /// What is told of each tile, in their order. In a pool its threads share the work.
    pub fn of_tiles<T: Send>(&self, tell: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        let tiles = 0..self.tile_count();
        if is_in_pool() { tiles.into_par_iter().map(tell).collect() } else { tiles.map(tell).collect() }
    }

    /// The noise in a half of a cell; none where a pixel has fewer than two samples, and where there are no pixels in it.
    pub fn half_noise(&self, number: usize, half: usize) -> Option<HalfNoise> {
        let tile = self.tile(number / CELLS);
        let (mut pixels, mut samples, mut sum) = (0_u32, u32::MAX, 0.0);
        for pixel in self.half_pixels(number, half) {
            sum += luminance(tile.mean(pixel)?);
            samples = samples.min(tile.count(pixel));
            pixels += 1;
        }
        let pixels = Some(f64::from(pixels)).filter(|pixels| *pixels > 0.0)?;
        let variance =
            self.convergence.variance(&tile.steps.squares, (number % CELLS, half), samples)? / pixels;
        Some(HalfNoise { variance, mean: sum / pixels, samples })
    }

    /// How many times smaller the last squared step of the pixels of a tile is than the one before, over the halves of its cells that
    /// have both; none where there are not two steps that tell.
    pub fn tile_fall(&self, tile: usize) -> Option<f64> {
        let squares = &self.tile(tile).steps.squares;
        let [.., before, last] = squares.as_slice() else { return None };
        // A half that has stopped has no last step.
        let pairs = before.as_flattened().iter().zip(last.as_flattened()).filter(|(_, last)| **last > 0.0);
        let (before, last) = pairs.fold((0.0, 0.0), |sums, pair| (sums.0 + pair.0, sums.1 + pair.1));
        Some(before / last).filter(|fall| fall.is_finite() && *fall > 0.0)
    }

    /// The noise in one half of all cells of a tile; none as in [`Film::half_noise`].
    pub fn tile_noise(&self, tile: usize, half: usize) -> Option<HalfNoise> {
        let (mut pixels, mut all) = (0.0, HalfNoise { variance: 0.0, mean: 0.0, samples: u32::MAX });
        for cell in CELLS * tile..CELLS * (tile + 1) {
            let count = self.half_pixel_count(cell, half) as f64;
            if count > 0.0 {
                let HalfNoise { variance, mean, samples } = self.half_noise(cell, half)?;
                all.variance += count * variance;
                all.mean += count * mean;
                all.samples = all.samples.min(samples);
                pixels += count;
            }
        }
        let HalfNoise { variance, mean, samples } = all;
        (pixels > 0.0).then(|| HalfNoise { variance: variance / pixels, mean: mean / pixels, samples })
    }

    /// The error of a half of a cell as it was after the first `count` samples of each of its pixels, a power of two: the mean over the
    /// pixels of the variance of their luminance over luminance² + [`RELMSE_LEAST`]. None for fewer than two samples, for more than
    /// there are, and where there are no pixels.
    pub fn half_error(&self, number: usize, half: usize, count: u32) -> Option<f64> {
        let tile = self.tile(number / CELLS);
        let pixels = self.half_pixel_count(number, half);
        let sum = self.convergence.variance(&tile.steps.relative, (number % CELLS, half), count)?;
        (pixels > 0).then(|| sum / pixels as f64)
    }

    /// How its noise is taken to fall.
    pub fn convergence(&self) -> Convergence {
        self.convergence
    }

    /// How many pixels a half of a cell has.
    pub fn half_pixel_count(&self, cell: usize, half: usize) -> usize {
        self.cell_rect(cell).map_or(0, |rect| Part::Half(half).count(rect.area()))
    }

    /// Places, in its tile, of the pixels of a half of a cell.
    fn half_pixels(&self, cell: usize, half: usize) -> impl Iterator<Item = usize> {
        let (tile, rect) = (self.tile_rect(cell / CELLS), self.cell_rect(cell));
        let part = Part::Half(half);
        tile.zip(rect).into_iter().flat_map(move |(tile, rect)| {
            let place = move |number| Pixels { rect, part }.place(number);
            let index = move |(x, y): (u32, u32)| ((y - tile.y) * tile.width + x - tile.x) as usize;
            (0..part.count(rect.area()) as u32).map(move |number| index(place(number)))
        })
    }

    /// Mean luminance of the picture; none where a pixel has no sample.
    pub fn mean_luminance(&self) -> Option<f64> {
        let of_tile = |tile: usize| {
            let tile = self.tile(tile);
            if tile.counts.is_empty() {
                return None;
            }
            (0..tile.counts.len()).map(|pixel| tile.mean(pixel).map(luminance)).sum::<Option<f64>>()
        };
        let sum: Option<f64> = self.of_tiles(of_tile).into_iter().sum();
        sum.map(|sum| sum / self.crop().area() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Rect, TILE_SIZE, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit;

    const RATE: f64 = 2.7;

    /// A film of one row, each pixel with its grey samples.
    fn film(pixels: &[&[f32]]) -> Film {
        let film = Film::new(pixels.len() as u32, 1, None).expect("a film");
        for (x, values) in pixels.iter().enumerate() {
            let rect = Rect { x: x as u32, y: 0, width: 1, height: 1 };
            let radiance = values.iter().map(|&value| Vec3::splat(value)).collect();
            film.add(
                x / TILE_SIZE as usize,
                &TileSamples { pixels: rect.into(), samples: values.len() as u32, radiance, negative: None },
            );
        }
        film
    }

    #[test]
    fn the_error_is_the_step_to_the_last_power_of_two_over_the_mean_of_the_picture() {
        // Steps of 1 and 0.5; mean luminance 3.
        let error = film(&[&[4.0, 6.0], &[0.5, 1.5]]).relative_error().expect("an estimate");
        assert!((error - (1.25 / 2.0 / (RATE - 1.0)).sqrt() / 3.0).abs() < 1e-12, "{error}");
        // 1, 2, 3, 6: steps from 1 to 1.5 to 3.
        let error = film(&[&[1.0, 2.0, 3.0, 6.0]]).relative_error().expect("an estimate");
        let expected = ((0.5 * 0.5 / RATE + 1.5 * 1.5) / 2.0 / (RATE - 1.0)).sqrt() / 3.0;
        assert!((error - expected).abs() < 1e-12, "{error}");
    }

    #[test]
    fn a_half_that_has_stopped_does_not_tell_how_noise_fell() {
        // Of two pixels, which are a half each, the first has steps of 1 and 0.5, the other one of 3 alone.
        let film = film(&[&[1.0, 3.0, 2.0, 4.0], &[1.0, 7.0]]);
        assert_eq!(film.tile_fall(0), Some(4.0));
        assert_eq!(self::film(&[&[1.0, 3.0], &[1.0, 7.0]]).tile_fall(0), None, "one step");
    }

    #[test]
    fn the_mean_of_a_picture_errs_less_than_its_pixels() {
        // Variances 1/1.7 and 0.25/1.7 of two pixels.
        let film = film(&[&[4.0, 6.0], &[0.5, 1.5]]);
        let error = film.mean_luminance_error().expect("an estimate");
        assert!((error - (1.25 / (RATE - 1.0)).sqrt() / 2.0).abs() < 1e-12, "{error}");
        assert_eq!(
            film.converging(Convergence::Independent).mean_luminance_error(),
            None,
            "photons are shared"
        );
        assert_eq!(self::film(&[&[4.0, 6.0], &[0.5]]).mean_luminance_error(), None);
        let part = Film::new(4, 1, Some(Rect { x: 0, y: 0, width: 2, height: 1 })).expect("a film");
        assert_eq!(part.mean_luminance_error(), None);
    }

    #[test]
    fn samples_that_are_taken_for_independent_have_the_error_that_their_variance_says() {
        let mut next = unit(5);
        for count in [16, 64, 100, 1024] {
            let pixels: Vec<Vec<f32>> = (0..4000).map(|_| (0..count).map(|_| next()).collect()).collect();
            let pixels: Vec<&[f32]> = pixels.iter().map(Vec::as_slice).collect();
            let film = film(&pixels).converging(Convergence::Independent);
            let exact = (1.0 / 12.0 / f64::from(count)).sqrt() / 0.5;
            let error = film.relative_error().expect("an estimate");
            assert!((0.96..1.04).contains(&(error / exact)), "{count} samples: {error} is not {exact}");
        }
    }

    #[test]
    fn independent_samples_have_the_error_that_their_variance_says() {
        // 400 pixels of samples of variance 1/12 by a linear congruential generator.
        let mut next = unit(5);
        for count in [2, 16, 100, 1024] {
            let pixels: Vec<Vec<f32>> = (0..400).map(|_| (0..count).map(|_| next()).collect()).collect();
            let pixels: Vec<&[f32]> = pixels.iter().map(Vec::as_slice).collect();
            let error = film(&pixels).relative_error().expect("an estimate");
            let exact = (1.0 / 12.0 / f64::from(count)).sqrt() / 0.5;
            assert!((0.65..0.9).contains(&(error / exact)), "{count} samples: {error} is not {exact}");
        }
    }

    #[test]
    fn it_does_not_depend_on_brightness() {
        let noise = |scale: f32| {
            let values: Vec<f32> = (0..50).map(|i| scale * (i * 7 % 10) as f32).collect();
            film(&[&values]).relative_error().expect("an estimate")
        };
        assert!((noise(1.0) - noise(1024.0)).abs() < 1e-12);
    }

    #[test]
    fn nothing_is_told_of_single_samples_and_equal_ones_have_no_error() {
        assert_eq!(film(&[&[1.0, 2.0], &[1.0]]).relative_error(), None);
        assert_eq!(Film::new(40, 2, None).expect("a film").relative_error(), None);
        assert_eq!(film(&[&[0.0, 0.0]]).relative_error(), Some(0.0));
        assert!(film(&[&[0.3, 0.3, 0.3]]).relative_error() < Some(1e-7));
    }
}
