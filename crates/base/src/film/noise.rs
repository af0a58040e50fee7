//! Noise of a film: its distance from the converged image, estimated by its own samples.

use rayon::prelude::*;

use super::{CELLS, Film, Part, Pixels, is_in_pool};
use crate::math::DVec3;
use crate::math::color::{LUMINANCE_WEIGHTS, RELMSE_LEAST};

/// Relative luminance in double precision, so that sums of its squares and squares of its sums agree.
pub(super) fn luminance(radiance: DVec3) -> f64 {
    radiance.dot(LUMINANCE_WEIGHTS.as_dvec3())
}

/// Squared steps of a tile's pixel means: the changes of each mean when its samples doubled.
///
/// The samples of a pixel are not independent: each doubling fills the gaps between the samples before. Therefore the variance
/// of single samples overestimates the noise, and two halves with separate scrambles would lose what the gaps are worth. But
/// let M be the mean of 2n samples, A the mean of the first n and B that of the others. (A − M)² = (A − B)²/4 has the
/// expectation V(n) − V(2n) for any dependence between A and B, as V(2n) = (V(A) + V(B))/4 + Cov/2 and V(A) = V(B) = V(n).
///
/// The same pixels measure the rate at which V falls: the first n samples and the others each contain one more such step, with
/// the expectation V(n/2) − V(n). The mean of these two over the first step is the rate. A bright sample that comes once is in
/// all three steps: it says a rate of two, as rare light does, however few pixels meet it.
#[derive(Debug, Default)]
pub(super) struct Steps {
    /// Luminance of each pixel at the last power of two of its samples.
    last: Vec<f32>,
    /// Luminance of each pixel half way from there to the next power of two.
    half_way: Vec<f32>,
    /// Squared steps to 2, 4, 8, … samples, for each half of each cell.
    levels: Vec<[[LevelSums; 2]; CELLS]>,
    /// The last step of each pixel.
    recent: Vec<f32>,
}

/// Sums over pixels of their squared steps to one power of two of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct LevelSums {
    /// Steps of the mean of all samples.
    outer: f64,
    /// Steps within the second half of the samples.
    inner: f64,
    /// Squares of the `outer` steps, which tell how few pixels the sum hangs on.
    outer_squares: f64,
    /// Sum of the `outer` steps, each divided by luminance² + [`RELMSE_LEAST`].
    relative: f64,
    /// Sum of the `inner` steps, each divided by luminance² + [`RELMSE_LEAST`].
    relative_inner: f64,
}

/// Squared steps to a power of two, and those one doubling earlier.
#[derive(Clone, Copy, Debug, Default)]
struct StepPair {
    last: f64,
    /// Mean of the steps in both halves of the samples; `None` for two samples.
    before: Option<f64>,
}

impl Steps {
    /// Empty steps with memory reserved for so many pixels. `None` if the memory cannot be had.
    pub(super) fn reserved(area: usize) -> Option<Self> {
        let reserved = || {
            let mut values = Vec::new();
            values.try_reserve_exact(area).ok()?;
            Some(values)
        };
        Some(Self { last: reserved()?, half_way: reserved()?, recent: reserved()?, levels: Vec::new() })
    }

    /// Makes room for so many pixels; cannot fail if the memory was reserved.
    pub(super) fn fill(&mut self, area: usize) {
        for values in [&mut self.last, &mut self.half_way, &mut self.recent] {
            values.resize(area, 0.0);
        }
    }

    /// Number of doublings that pixels had.
    pub(super) fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Gives all numbers as words of 32 bits, in the order in which [`Steps::read`] takes them.
    pub(super) fn words(&self, put: &mut impl FnMut(u32)) {
        for values in [&self.last, &self.half_way, &self.recent] {
            values.iter().for_each(|value| put(value.to_bits()));
        }
        for sums in self.levels.iter().flatten().flatten() {
            let LevelSums { outer, inner, outer_squares, relative, relative_inner } = *sums;
            for bits in [outer, inner, outer_squares, relative, relative_inner].map(f64::to_bits) {
                put(bits as u32);
                put((bits >> 32) as u32);
            }
        }
    }

    /// The steps of these words, for so many pixels and doublings.
    pub(super) fn read<E>(
        area: usize,
        levels: usize,
        word: &mut impl FnMut() -> Result<u32, E>,
    ) -> Result<Self, E> {
        let mut steps = Self::default();
        for values in [&mut steps.last, &mut steps.half_way, &mut steps.recent] {
            *values = (0..area).map(|_| word().map(f32::from_bits)).collect::<Result<_, _>>()?;
        }
        steps.levels = vec![[[LevelSums::default(); 2]; CELLS]; levels];
        for sums in steps.levels.iter_mut().flatten().flatten() {
            let mut number = || {
                let low = u64::from(word()?);
                Ok(f64::from_bits(low | u64::from(word()?) << 32))
            };
            sums.outer = number()?;
            sums.inner = number()?;
            sums.outer_squares = number()?;
            sums.relative = number()?;
            sums.relative_inner = number()?;
        }
        Ok(steps)
    }

    /// Square of a pixel's last step.
    pub(super) fn square(&self, pixel: usize) -> f64 {
        self.recent.get(pixel).map_or(0.0, |step| f64::from(*step) * f64::from(*step))
    }

    /// Samples that a pixel of `count` samples lacks to the next count that is noted: a power of two, or half way to the next one.
    pub(super) fn samples_to_next(count: u32) -> usize {
        let count = u64::from(count);
        let power = (count + 1).next_power_of_two();
        let half_way = power / 4 * 3;
        let next = if half_way > count { half_way } else { power };
        (next - count) as usize
    }

    /// Notes the luminance of a pixel (with its cell and half) at a count that [`Steps::samples_to_next`] leads to.
    pub(super) fn note(&mut self, (pixel, cell, half): (usize, usize, usize), count: u32, luminance: f64) {
        let rounded = luminance as f32;
        if !count.is_power_of_two() {
            self.half_way[pixel] = rounded;
            return;
        }
        let level = count.trailing_zeros() as usize;
        if level > 0 {
            self.levels.resize(self.levels.len().max(level), [[LevelSums::default(); 2]; CELLS]);
            let (mean, last, half_way) =
                (f64::from(rounded), f64::from(self.last[pixel]), f64::from(self.half_way[pixel]));
            let outer = (mean - last) * (mean - last);
            // Half the difference of the last two quarters. Two samples have no quarters.
            let step = if level > 1 { 3.0 * half_way - last - 2.0 * mean } else { 0.0 };
            let inner = step * step;
            let scale = 1.0 / (luminance * luminance + RELMSE_LEAST);
            let sums = &mut self.levels[level - 1][cell][half];
            sums.outer += outer;
            sums.outer_squares += outer * outer;
            sums.inner += inner;
            sums.relative += outer * scale;
            sums.relative_inner += inner * scale;
            self.recent[pixel] = (mean - last) as f32;
        }
        self.last[pixel] = rounded;
    }

    /// Steps of a half of a cell to 2^`level` samples.
    fn pair(&self, level: usize, (cell, half): (usize, usize), is_relative: bool) -> Option<StepPair> {
        let of = |level: usize| self.levels.get(level.checked_sub(1)?).map(|cells| cells[cell][half]);
        let parts = |sums: LevelSums| match is_relative {
            false => (sums.outer, sums.inner),
            true => (sums.relative, sums.relative_inner),
        };
        let (last, inner) = parts(of(level)?);
        let before = of(level - 1).map(|before| 0.5 * (parts(before).0 + inner));
        Some(StepPair { last, before })
    }

    /// Steps of a half of a cell to 2^`level` samples, and those one, two and three doublings earlier.
    fn last_four(&self, level: usize, at: (usize, usize), is_relative: bool) -> Option<[f64; 4]> {
        let StepPair { last, before } = self.pair(level, at, is_relative)?;
        let earlier = |back: usize| self.pair(level.checked_sub(back)?, at, is_relative)?.before;
        Some([last, before?, earlier(1)?, earlier(2)?])
    }

    /// Factor by which four times as many samples reduced the variance, at 2^`level` samples, over this half of all cells. `None`
    /// as in [`Steps::fall`], which gives the factor for twice as many.
    fn fourfold_fall(&self, level: usize, half: usize) -> Option<f64> {
        let mut sums = [0.0; 4];
        for cell in 0..CELLS {
            let steps = self.last_four(level, (cell, half), false)?;
            if steps[0] > 0.0 {
                sums.iter_mut().zip(steps).for_each(|(sum, step)| *sum += step);
            }
        }
        let [last, before, third, fourth] = sums;
        // Compare with the same step at four times fewer samples, and carefully with two steps together.
        let fall = (third / last).max(CAREFUL * (third + fourth) / (last + before));
        Some(fall).filter(|fall| fall.is_finite() && *fall > 0.0)
    }

    /// Relative spread to expect of the sum of the steps to 2^`level` samples, over these halves of all cells: 1 if a single pixel
    /// decides it, less the more pixels share it. Cells that have fewer samples do not count.
    fn spread(&self, level: usize, halves: &[usize]) -> f64 {
        let Some(cells) = level.checked_sub(1).and_then(|index| self.levels.get(index)) else { return 1.0 };
        let sums = cells.iter().flat_map(|cell| halves.iter().map(|half| cell[*half]));
        let (sum, squares) =
            sums.fold((0.0, 0.0), |(sum, squares), cell| (sum + cell.outer, squares + cell.outer_squares));
        if sum > 0.0 { squares.sqrt() / sum } else { 0.0 }
    }

    /// Trust in a fall, from 0 to 1.
    fn trust(&self, level: usize, halves: &[usize]) -> f64 {
        let spread = self.spread(level, halves);
        1.0 / (1.0 + DOUBT * spread * spread)
    }

    /// Factor by which the doubling to 2^`level` samples reduced the variance, over these halves of all cells. `None` if it is not
    /// known. Cells that have fewer samples do not count.
    fn fall(&self, level: usize, halves: &[usize]) -> Option<f64> {
        let (mut last, mut before) = (0.0, 0.0);
        for (cell, half) in (0..CELLS).flat_map(|cell| halves.iter().map(move |half| (cell, *half))) {
            let pair = self.pair(level, (cell, half), false)?;
            if pair.last > 0.0 {
                last += pair.last;
                before += pair.before?;
            }
        }
        Some(before / last).filter(|fall| fall.is_finite() && *fall > 0.0)
    }
}

/// Convergence: the law by which the variance of a pixel's mean falls with its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convergence {
    /// The samples of a pixel fill each other's gaps. Twice as many divide the variance by 2 in places of rare light, by 2.8 at
    /// edges and in penumbras, by 4 and more in smooth places. The steps between pairs of doublings measure it.
    #[default]
    Stratified,
    /// Each sample has photons of its own, which the pixels share. In the end the photons' variance falls as that of independent
    /// samples, while that of the camera paths falls faster at first.
    Photons,
}

/// Factor by which twice as many independent samples reduce the variance.
const INDEPENDENT_RATE: f64 = 2.0;

/// Largest fall by a doubling that is believed.
const MOST_FALL: f64 = 12.0;

/// Largest fall that is taken for that of independent samples: by chance, few bright pixels seem to fall as fast.
const CHANCE_FALL: f64 = 2.3;

/// Part of a fall beyond [`CHANCE_FALL`] that is expected of the next doubling: the smooth parts of a tile converge first, and the
/// rest falls slower.
const LASTING: f64 = 0.65;

/// Distrust in a fall that few pixels decide, per square of its [`Steps::spread`].
const DOUBT: f64 = 2.0;

/// Part of the fall by two steps together that is believed.
const CAREFUL: f64 = 0.8;

/// Factor by which four times as many independent samples reduce the variance; then the fall up to which chance is taken for the
/// cause, the part of a fall beyond it that goes on, and the largest rate.
const FOURFOLD_RATE: f64 = 4.0;
const FOURFOLD_CHANCE: f64 = 5.2;
const FOURFOLD_LASTING: f64 = 1.2;
const FOURFOLD_MOST: f64 = 40.0;

impl Convergence {
    /// Power of the samples with which the variance of most pictures falls in the long run, whatever the last steps say.
    pub fn usual_power(self) -> f64 {
        match self {
            Self::Stratified => 1.432_959_407_276_106_2,
            Self::Photons => 1.0,
        }
    }

    /// Factor by which the doubling to 2^`level` samples reduced the variance, in these halves of a tile.
    fn fall(steps: &Steps, level: usize, halves: &[usize]) -> f64 {
        steps.fall(level, halves).map_or(INDEPENDENT_RATE, |fall| fall.clamp(INDEPENDENT_RATE, MOST_FALL))
    }

    /// Factor by which twice as many samples as 2^`level` are expected to reduce the variance, in these halves of a tile.
    pub(super) fn rate(steps: &Steps, level: usize, halves: &[usize]) -> f64 {
        rate_after(Self::fall(steps, level, halves), steps.trust(level, halves))
    }

    /// Variance of the means of `count` samples of one half of a cell, summed over its pixels, and the rate at which it falls.
    ///
    /// The variance is the geometric mean of two forecasts. One goes by doublings: by the last step, and by the forecast from the
    /// two steps before it, as each has a spread. But points in base 2 fill squares at powers of 4, so that every other doubling
    /// gains more. The other forecast therefore goes by four times as many samples.
    fn variance(
        steps: &Steps,
        (cell, half): (usize, usize),
        count: u32,
        is_relative: bool,
    ) -> Option<(f64, f64)> {
        let level = count.checked_ilog2()? as usize;
        let StepPair { last, before } = steps.pair(level, (cell, half), is_relative)?;
        let fall = Self::fall(steps, level, &[half]);
        let step = before.map_or(last, |before| (last + 2.0 * before / fall) / 3.0);
        let rate = rate_after(fall, steps.trust(level, &[half]));
        let by_two = pixel_variance(step, count, rate);
        let variance = match Self::by_four(steps, level, (cell, half), is_relative) {
            Some(four) => (by_two * pixel_variance(four, count, 2.0)).sqrt(),
            None => by_two,
        };
        Some((variance, rate))
    }

    /// Variance of the means of 2^`level` samples of one half of a cell, summed over its pixels, by its fall with four times as
    /// many samples. `None` for fewer than 16 samples.
    fn by_four(steps: &Steps, level: usize, at: (usize, usize), is_relative: bool) -> Option<f64> {
        let [last, before, ..] = steps.last_four(level, at, is_relative)?;
        let fall = steps.fourfold_fall(level, at.1).unwrap_or(FOURFOLD_RATE);
        let lasting = FOURFOLD_LASTING * (fall - FOURFOLD_CHANCE).max(0.0) * steps.trust(level, &[at.1]);
        let rate = (FOURFOLD_RATE + lasting).min(FOURFOLD_MOST);
        Some((last + before) / (rate - 1.0))
    }
}

/// Rate to expect after a fall with this trust.
fn rate_after(fall: f64, trust: f64) -> f64 {
    INDEPENDENT_RATE + LASTING * (fall - CHANCE_FALL).max(0.0) * trust
}

/// Variance of a mean of `count` ≥ 2 samples, from the squared step to the last power of two of them and the rate at which it
/// falls.
pub(super) fn pixel_variance(step: f64, count: u32, rate: f64) -> f64 {
    // Between powers of two it falls as for independent samples.
    let part = f64::from(1_u32 << count.ilog2()) / f64::from(count);
    step / (rate - 1.0) * part
}

/// Number of samples that reduces the standard error of means of `count` samples to this part of itself, if its square falls with
/// this power of the samples.
pub fn samples_by(power: f64, part: f64, count: u32) -> u32 {
    (f64::from(count) * libm::pow(part, -2.0 / power)).ceil() as u32
}

/// Noise in a half of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfNoise {
    /// Mean variance of the pixels' luminance.
    pub variance: f64,
    /// Mean luminance.
    pub mean: f64,
    /// Samples of each pixel.
    pub samples: u32,
    /// Power of the samples with which the variance is expected to fall.
    pub power: f64,
}

/// Noise in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureNoise {
    /// Relative standard error: [`Film::relative_error`].
    pub relative_error: f64,
    /// Power of the samples with which the square of that error is expected to fall.
    pub power: f64,
}

/// Sums over pixels for the noise of a picture.
#[derive(Clone, Copy, Debug, Default)]
struct NoiseSums {
    variance: f64,
    /// Variance that twice as many samples are expected to leave.
    left: f64,
    mean: f64,
}

impl NoiseSums {
    /// Power of the samples with which the variance falls by the next doubling; without noise, that of independent samples.
    fn power(self) -> f64 {
        if self.left > 0.0 { libm::log2(self.variance / self.left) } else { 1.0 }
    }

    fn add(&mut self, noise: &HalfNoise, pixels: f64) {
        self.variance += pixels * noise.variance;
        self.left += pixels * noise.variance * libm::exp2(-noise.power);
        self.mean += pixels * noise.mean;
    }
}

impl Film {
    /// Expected error of the picture so far, relative to its brightness: the root mean square over the pixels of the
    /// standard error of their luminance, divided by the picture's mean luminance. The changes by the last samples give
    /// the estimate.
    ///
    /// Next to 0 if all samples of each pixel are alike. `None` if a pixel has fewer than two samples.
    pub fn relative_error(&self) -> Option<f64> {
        self.noise().map(|noise| noise.relative_error)
    }

    /// [`Film::relative_error`], and the power of the samples with which it falls.
    pub fn noise(&self) -> Option<PictureNoise> {
        let sums @ NoiseSums { variance, mean, .. } = self.noise_sums()?;
        let pixels = self.crop().area() as f64;
        let error = (variance / pixels).sqrt();
        // A black picture without error has a relative error of 0 too.
        let relative_error = if error == 0.0 { 0.0 } else { error / (mean / pixels) };
        Some(PictureNoise { relative_error, power: sums.power() })
            .filter(|noise| noise.relative_error.is_finite())
    }

    /// Standard error of the mean luminance of a whole picture, whose pixels' errors are independent. `None` for a crop, for
    /// photons, which make the pixels' errors dependent, and if a pixel has fewer than two samples.
    pub fn mean_luminance_error(&self) -> Option<f64> {
        let is_whole = (self.crop().width, self.crop().height) == (self.width(), self.height());
        let is_apart = self.convergence == Convergence::Stratified;
        let sums = if is_whole && is_apart { self.noise_sums()? } else { return None };
        Some(sums.variance.sqrt() / self.crop().area() as f64).filter(|error| error.is_finite())
    }

    /// Sums over all pixels.
    fn noise_sums(&self) -> Option<NoiseSums> {
        let of_tile = |tile: usize| {
            let mut sums = NoiseSums::default();
            if self.tile(tile).counts.is_empty() {
                return None;
            }
            let halves = (CELLS * tile..CELLS * (tile + 1)).flat_map(|cell| [(cell, 0), (cell, 1)]);
            for (cell, half) in halves {
                let pixels = self.half_pixel_count(cell, half) as f64;
                if pixels > 0.0 {
                    sums.add(&self.half_noise(cell, half)?, pixels);
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
        self.of_tiles(of_tile).into_iter().try_fold(NoiseSums::default(), add)
    }

    /// Calls `tell` for each tile and returns the answers in the tiles' order. In a pool its threads share the work.
    pub fn of_tiles<T: Send>(&self, tell: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        let tiles = 0..self.tile_count();
        if is_in_pool() { tiles.into_par_iter().map(tell).collect() } else { tiles.map(tell).collect() }
    }

    /// Noise in a half of a cell. `None` if the half has no pixels, or one with fewer than two samples.
    pub fn half_noise(&self, number: usize, half: usize) -> Option<HalfNoise> {
        let tile = self.tile(number / CELLS);
        let (mut pixels, mut samples, mut sum) = (0_u32, u32::MAX, 0.0);
        for pixel in self.half_pixels(number, half) {
            sum += luminance(tile.mean(pixel)?);
            samples = samples.min(tile.count(pixel));
            pixels += 1;
        }
        let pixels = Some(f64::from(pixels)).filter(|pixels| *pixels > 0.0)?;
        let (variance, rate) = Convergence::variance(&tile.steps, (number % CELLS, half), samples, false)?;
        Some(HalfNoise { variance: variance / pixels, mean: sum / pixels, samples, power: libm::log2(rate) })
    }

    /// Factor by which the last doubling reduced the variance of a tile's pixels, over the halves of its cells that had it. `None`
    /// if there are not enough steps.
    pub fn tile_fall(&self, tile: usize) -> Option<f64> {
        let tile = self.tile(tile);
        tile.steps.fall(tile.steps.levels.len(), &[0, 1])
    }

    /// Relative spread to expect of the variance that one half of all cells of a tile measures: 1 if a single pixel decides it,
    /// less the more pixels share it. Cells that have fewer samples than others do not count.
    pub fn tile_spread(&self, tile: usize, half: usize) -> f64 {
        let tile = self.tile(tile);
        tile.steps.spread(tile.steps.levels.len(), &[half])
    }

    /// Noise in one half of all cells of a tile. `None` as in [`Film::half_noise`].
    pub fn tile_noise(&self, tile: usize, half: usize) -> Option<HalfNoise> {
        let (mut pixels, mut samples, mut sums) = (0.0, u32::MAX, NoiseSums::default());
        for cell in CELLS * tile..CELLS * (tile + 1) {
            let count = self.half_pixel_count(cell, half) as f64;
            if count > 0.0 {
                let noise = self.half_noise(cell, half)?;
                sums.add(&noise, count);
                samples = samples.min(noise.samples);
                pixels += count;
            }
        }
        let (variance, mean, power) = (sums.variance / pixels, sums.mean / pixels, sums.power());
        (pixels > 0.0).then_some(HalfNoise { variance, mean, samples, power })
    }

    /// Error of a half of a cell after the first `count` samples of each of its pixels, a power of two: the mean over the pixels of
    /// the variance of their luminance over luminance² + [`RELMSE_LEAST`], and the power of the samples with which it falls. `None`
    /// for fewer than two samples, for more than the pixels have, and if the half has no pixels.
    pub fn half_error(&self, number: usize, half: usize, count: u32) -> Option<(f64, f64)> {
        let tile = self.tile(number / CELLS);
        let pixels = self.half_pixel_count(number, half);
        let (sum, rate) = Convergence::variance(&tile.steps, (number % CELLS, half), count, true)?;
        (pixels > 0).then(|| (sum / pixels as f64, libm::log2(rate)))
    }

    /// Convergence of this film's noise.
    pub fn convergence(&self) -> Convergence {
        self.convergence
    }

    /// Number of pixels in a half of a cell.
    pub fn half_pixel_count(&self, cell: usize, half: usize) -> usize {
        self.cell_rect(cell).map_or(0, |rect| Part::Half(half).count(rect.area()))
    }

    /// Indices, in its tile, of the pixels of a half of a cell.
    fn half_pixels(&self, cell: usize, half: usize) -> impl Iterator<Item = usize> {
        let (tile, rect) = (self.tile_rect(cell / CELLS), self.cell_rect(cell));
        let part = Part::Half(half);
        tile.zip(rect).into_iter().flat_map(move |(tile, rect)| {
            let place = move |number| Pixels { rect, part }.place(number);
            let index = move |(x, y): (u32, u32)| ((y - tile.y) * tile.width + x - tile.x) as usize;
            (0..part.count(rect.area()) as u32).map(move |number| index(place(number)))
        })
    }

    /// Mean luminance of the picture. `None` if a pixel has no sample.
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
    fn the_error_is_that_of_the_last_steps_over_the_mean_of_the_picture() {
        // Steps of 1 and 0.5, which leave a variance as large; mean luminance 3.
        let error = film(&[&[4.0, 6.0], &[0.5, 1.5]]).relative_error().expect("an estimate");
        assert!((error - (1.25_f64 / 2.0).sqrt() / 3.0).abs() < 1e-6, "{error}");
        // 1, 2, 3, 6: steps from 1 to 1.5 to 3, and one from 3 to 4.5 in the second half.
        let error = film(&[&[1.0, 2.0, 3.0, 6.0]]).relative_error().expect("an estimate");
        let before = 0.5 * (0.5 * 0.5 + 1.5 * 1.5);
        let expected = ((1.5_f64 * 1.5 + before) / 3.0).sqrt() / 3.0;
        assert!((error - expected).abs() < 1e-6, "{error} {expected}");
    }

    #[test]
    fn a_half_that_has_stopped_does_not_tell_how_noise_fell() {
        // Of two pixels, each a half of its own, the first has steps of 1 and 0.5, the other a single one of 3.
        let film = film(&[&[1.0, 3.0, 2.0, 4.0], &[1.0, 7.0]]);
        assert_eq!(film.tile_fall(0), Some(4.0));
        assert_eq!(self::film(&[&[1.0, 3.0], &[1.0, 7.0]]).tile_fall(0), None, "one step");
    }

    #[test]
    fn what_few_pixels_tell_is_known_to_be_unsure() {
        let one: &[f32] = &[0.0, 8.0];
        let none: &[f32] = &[1.0, 1.0];
        // The halves take turns along a row.
        let of = |pixels: &[&[f32]]| film(pixels).tile_spread(0, 0);
        assert_eq!(of(&[one, one, none, none, none, none, none, none]), 1.0);
        assert_eq!(of(&[one; 8]), 0.5);
        assert_eq!(of(&[none; 8]), 0.0);
    }

    #[test]
    fn the_mean_of_a_picture_errs_less_than_its_pixels() {
        // Variances 1 and 0.25 of two pixels.
        let film = film(&[&[4.0, 6.0], &[0.5, 1.5]]);
        let error = film.mean_luminance_error().expect("an estimate");
        assert!((error - 1.25_f64.sqrt() / 2.0).abs() < 1e-6, "{error}");
        assert_eq!(film.converging(Convergence::Photons).mean_luminance_error(), None, "photons are shared");
        assert_eq!(self::film(&[&[4.0, 6.0], &[0.5]]).mean_luminance_error(), None);
        let part = Film::new(4, 1, Some(Rect { x: 0, y: 0, width: 2, height: 1 })).expect("a film");
        assert_eq!(part.mean_luminance_error(), None);
    }

    #[test]
    fn independent_samples_have_the_error_that_their_variance_says_whatever_they_are_taken_for() {
        // Falls that may be chance are believed a little.
        let mut next = unit(5);
        for count in [16, 64, 100, 1024] {
            let pixels: Vec<Vec<f32>> = (0..4000).map(|_| (0..count).map(|_| next()).collect()).collect();
            let pixels: Vec<&[f32]> = pixels.iter().map(Vec::as_slice).collect();
            let exact = (1.0 / 12.0 / f64::from(count)).sqrt() / 0.5;
            for convergence in [Convergence::Stratified, Convergence::Photons] {
                let error = film(&pixels).converging(convergence).relative_error().expect("an estimate");
                assert!((0.9..1.04).contains(&(error / exact)), "{count} samples: {error} is not {exact}");
            }
        }
    }

    /// A film of 64 × 64 pixels and the true root mean square error of their means. `sample` makes the sample of a number for a
    /// pixel with random bits of its own; `truth` is the mean of all samples.
    fn square(count: u32, truth: f64, mut sample: impl FnMut(u32, u32) -> f32) -> (Film, f64) {
        const SIDE: u32 = 64;
        let film = Film::new(SIDE, SIDE, None).expect("a film");
        let mut next = unit(11);
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
            film.add(tile, &TileSamples { pixels: rect.into(), samples: count, radiance, negative: None });
        }
        (film, (square / f64::from(SIDE * SIDE)).sqrt() / truth)
    }

    /// The ratio of the estimate to the truth.
    fn reported(count: u32, truth: f64, sample: impl FnMut(u32, u32) -> f32) -> f64 {
        let (film, exact) = square(count, truth, sample);
        film.relative_error().expect("an estimate") / exact
    }

    /// Points of a van der Corput sequence, shifted for each pixel: each doubling fills the gaps.
    fn filling(number: u32, bits: u32) -> f32 {
        ((number.reverse_bits() >> 8) ^ bits) as f32 / 16_777_216.0
    }

    #[test]
    fn the_error_is_true_for_noise_that_falls_fast_or_slowly() {
        for count in [16, 64, 256] {
            let mut next = unit(5);
            let independent = reported(count, 0.5, |_, _| next());
            assert!((0.95..1.15).contains(&independent), "{count} independent samples: {independent}");
            let smooth = reported(count, 0.5, filling);
            assert!((0.9..1.35).contains(&smooth), "{count} samples that fill gaps: {smooth}");
        }
    }

    #[test]
    fn the_error_is_true_where_few_samples_are_bright() {
        for count in [16, 64, 256] {
            let mut next = unit(17);
            let rare = |number, bits| if next() < 1e-3 { 100.0 } else { filling(number, bits) };
            let ratio = reported(count, 0.1 + 0.5 * 0.999, rare);
            assert!((0.95..1.15).contains(&ratio), "{count}: {ratio}");
        }
    }

    #[test]
    fn how_noise_will_fall_is_told_too() {
        let power =
            |sample: &mut dyn FnMut(u32, u32) -> f32| square(64, 0.5, sample).0.noise().expect("noise").power;
        let mut next = unit(5);
        let independent = power(&mut |_, _| next());
        assert!((1.0..1.1).contains(&independent), "{independent}");
        assert!(power(&mut filling) > 1.5, "{}", power(&mut filling));
    }

    #[test]
    fn it_does_not_depend_on_brightness() {
        let noise = |scale: f32| {
            let values: Vec<f32> = (0..50).map(|i| scale * (i * 7 % 10) as f32).collect();
            film(&[&values]).relative_error().expect("an estimate")
        };
        assert!((noise(1.0) - noise(1024.0)).abs() < 1e-6);
    }

    #[test]
    fn nothing_is_told_of_single_samples_and_equal_ones_have_no_error() {
        assert_eq!(film(&[&[1.0, 2.0], &[1.0]]).relative_error(), None);
        assert_eq!(Film::new(40, 2, None).expect("a film").relative_error(), None);
        assert_eq!(film(&[&[0.0, 0.0]]).relative_error(), Some(0.0));
        assert!(film(&[&[0.3, 0.3, 0.3]]).relative_error() < Some(1e-7));
    }
}
