//! Steps of the pixels' means as their samples double, and the variance that these steps forecast.

use super::CELLS;
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

    /// Number of doublings of which it has steps.
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
    pub(super) fn spread(&self, level: usize, halves: &[usize]) -> f64 {
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
    pub(super) fn fall(&self, level: usize, halves: &[usize]) -> Option<f64> {
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
    pub(super) fn variance(
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
