//! Convergence estimation: records how pixel means change as the sample count doubles, and predicts their
//! variance from these changes.

use super::CELLS;
use crate::math::DVec3;
use crate::math::color::{LUMINANCE_WEIGHTS, RELMSE_EPSILON};
use crate::system::memory::try_reserve_exact;

/// Relative luminance in double precision, so that sums of squares and squared sums are consistent.
pub(super) fn luminance(radiance: DVec3) -> f64 {
    radiance.dot(LUMINANCE_WEIGHTS.as_dvec3())
}

/// Squared steps of a tile's pixel means: how much each mean changed when the sample count doubled.
///
/// The samples of a pixel are not independent: each doubling fills the gaps between earlier samples. The
/// sample variance therefore overestimates the noise, and splitting the samples into two independently
/// scrambled halves would lose the benefit of stratification. Instead, let M be the mean of 2n samples, A the
/// mean of the first n and B the mean of the others. (A − M)² = (A − B)²/4 has the expected value V(n) −
/// V(2n) for any correlation of A and B, because V(2n) = (V(A) + V(B))/4 + Cov/2 and V(A) = V(B) = V(n).
///
/// The rate at which V falls is measured from the same pixels. The first n samples and the last n each
/// contain another such step, with the expected value V(n/2) − V(n). The rate is the mean of these two inner
/// steps divided by the outer step. A rare bright sample affects all three steps and results in a rate of
/// two, as for independent samples, even if only a few pixels have such a sample.
#[derive(Debug, Default)]
pub(super) struct SquaredMeanChanges {
    /// Luminance of each pixel at its last power-of-two sample count.
    last: Vec<f32>,
    /// Luminance of each pixel at the sample count halfway to the next power of two.
    half_way: Vec<f32>,
    /// Squared steps at 2, 4, 8, … samples, for each half of each cell.
    levels: Vec<[[SquaredStepSums; 2]; CELLS]>,
    /// Change of each pixel's luminance when its sample count last doubled.
    recent: Vec<f32>,
}

/// Sums of squared steps over pixels, at one power-of-two sample count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct SquaredStepSums {
    /// Sum of the squared steps in the mean of all samples.
    outer: f64,
    /// Sum of the squared steps in the mean of the second half of the samples.
    inner: f64,
    /// Sum of the squares of the `outer` terms, used to detect sums dominated by a few pixels.
    outer_squares: f64,
    /// Sum of the `outer` terms, each divided by luminance² + [`RELMSE_EPSILON`].
    relative: f64,
    /// Sum of the `inner` terms, each divided by luminance² + [`RELMSE_EPSILON`].
    relative_inner: f64,
}

/// Squared steps at a power-of-two sample count and one doubling earlier.
#[derive(Clone, Copy, Debug, Default)]
struct SquaredStepPair {
    last: f64,
    /// Mean squared step within the two halves of the samples, or `None` if there are only two samples.
    before: Option<f64>,
}

impl SquaredMeanChanges {
    /// Reserves memory for the steps of `area` pixels. Returns `None` if the allocation fails.
    pub(super) fn try_with_capacity(area: usize) -> Option<Self> {
        let reserved = || {
            let mut values = Vec::new();
            try_reserve_exact(&mut values, area).ok()?;
            Some(values)
        };
        Some(Self { last: reserved()?, half_way: reserved()?, recent: reserved()?, levels: Vec::new() })
    }

    /// Resizes the lists to `area` pixels. Cannot fail if the memory was reserved.
    pub(super) fn resize(&mut self, area: usize) {
        for values in [&mut self.last, &mut self.half_way, &mut self.recent] {
            values.resize(area, 0.0);
        }
    }

    /// Number of doublings with recorded steps.
    pub(super) fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Serializes all numbers as 32-bit words in the order that [`SquaredMeanChanges::from_words`] expects.
    pub(super) fn write_words(&self, put: &mut impl FnMut(u32)) {
        for values in [&self.last, &self.half_way, &self.recent] {
            values.iter().for_each(|value| put(value.to_bits()));
        }
        for sums in self.levels.iter().flatten().flatten() {
            let SquaredStepSums { outer, inner, outer_squares, relative, relative_inner } = *sums;
            for bits in [outer, inner, outer_squares, relative, relative_inner].map(f64::to_bits) {
                put(bits as u32);
                put((bits >> 32) as u32);
            }
        }
    }

    /// Deserializes steps for `area` pixels and `levels` doublings.
    pub(super) fn from_words<E>(
        area: usize,
        levels: usize,
        word: &mut impl FnMut() -> Result<u32, E>,
    ) -> Result<Self, E> {
        let mut steps = Self::default();
        for values in [&mut steps.last, &mut steps.half_way, &mut steps.recent] {
            *values = (0..area).map(|_| word().map(f32::from_bits)).collect::<Result<_, _>>()?;
        }
        steps.levels = vec![[[SquaredStepSums::default(); 2]; CELLS]; levels];
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

    /// Squared change of a pixel's luminance when its sample count last doubled.
    pub(super) fn last_squared_step(&self, pixel: usize) -> f64 {
        self.recent.get(pixel).map_or(0.0, |step| f64::from(*step) * f64::from(*step))
    }

    /// Number of additional samples after which a pixel with `count` samples is recorded again. Pixels are
    /// recorded at powers of two and halfway between them.
    pub(super) fn samples_to_next_record(count: u32) -> usize {
        let count = u64::from(count);
        let power = (count + 1).next_power_of_two();
        let half_way = power / 4 * 3;
        let next = if half_way > count { half_way } else { power };
        (next - count) as usize
    }

    /// Records the luminance of a pixel in the specified cell and half, at a sample count determined by
    /// [`SquaredMeanChanges::samples_to_next_record`].
    pub(super) fn record_luminance_at_count(
        &mut self,
        (pixel, cell, half): (usize, usize, usize),
        count: u32,
        luminance: f64,
    ) {
        let rounded = luminance as f32;
        if !count.is_power_of_two() {
            self.half_way[pixel] = rounded;
            return;
        }
        let level = count.trailing_zeros() as usize;
        if level > 0 {
            self.levels.resize(self.levels.len().max(level), [[SquaredStepSums::default(); 2]; CELLS]);
            let (mean, last, half_way) =
                (f64::from(rounded), f64::from(self.last[pixel]), f64::from(self.half_way[pixel]));
            let outer = (mean - last) * (mean - last);
            // Half the difference between the means of the last two quarters. Two samples have no quarters.
            let step = if level > 1 { 3.0 * half_way - last - 2.0 * mean } else { 0.0 };
            let inner = step * step;
            let scale = 1.0 / (luminance * luminance + RELMSE_EPSILON);
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

    /// Squared steps in a half-cell at 2^`level` samples and one doubling earlier.
    fn squared_step_pair_at_level(
        &self,
        level: usize,
        (cell, half): (usize, usize),
        is_relative: bool,
    ) -> Option<SquaredStepPair> {
        let of = |level: usize| self.levels.get(level.checked_sub(1)?).map(|cells| cells[cell][half]);
        let parts = |sums: SquaredStepSums| match is_relative {
            false => (sums.outer, sums.inner),
            true => (sums.relative, sums.relative_inner),
        };
        let (last, inner) = parts(of(level)?);
        let before = of(level - 1).map(|before| 0.5 * (parts(before).0 + inner));
        Some(SquaredStepPair { last, before })
    }

    /// Squared steps in a half-cell at 2^`level` samples and one, two and three doublings earlier.
    fn last_four_squared_steps(
        &self,
        level: usize,
        at: (usize, usize),
        is_relative: bool,
    ) -> Option<[f64; 4]> {
        let SquaredStepPair { last, before } = self.squared_step_pair_at_level(level, at, is_relative)?;
        let earlier =
            |back: usize| self.squared_step_pair_at_level(level.checked_sub(back)?, at, is_relative)?.before;
        Some([last, before?, earlier(1)?, earlier(2)?])
    }

    /// Factor by which quadrupling the samples to 2^`level` reduced the variance, measured in one half of
    /// every cell, or `None` if it is unknown, as it always is for fewer than 16 samples.
    fn quadrupling_variance_reduction(&self, level: usize, half: usize) -> Option<f64> {
        let mut sums = [0.0; 4];
        for cell in 0..CELLS {
            let steps = self.last_four_squared_steps(level, (cell, half), false)?;
            if steps[0] > 0.0 {
                sums.iter_mut().zip(steps).for_each(|(sum, step)| *sum += step);
            }
        }
        let [last, before, third, fourth] = sums;
        // Compare the last step with the step at a quarter of the samples. For a more conservative estimate,
        // compare the sum of the last two steps with the sum of the previous two.
        let fall = (third / last).max(TRUSTED_FRACTION * (third + fourth) / (last + before));
        Some(fall).filter(|fall| fall.is_finite() && *fall > 0.0)
    }

    /// Expected relative standard deviation of the squared steps at 2^`level` samples, summed over the
    /// specified halves of all cells: 1 if a single pixel dominates, lower if many contribute. Ignores cells
    /// that have not reached this sample count.
    pub(super) fn variance_uncertainty(&self, level: usize, halves: &[usize]) -> f64 {
        let Some(cells) = level.checked_sub(1).and_then(|index| self.levels.get(index)) else { return 1.0 };
        let sums = cells.iter().flat_map(|cell| halves.iter().map(|half| cell[*half]));
        let (sum, squares) =
            sums.fold((0.0, 0.0), |(sum, squares), cell| (sum + cell.outer, squares + cell.outer_squares));
        if sum > 0.0 { squares.sqrt() / sum } else { 0.0 }
    }

    /// Confidence in a measured variance reduction, from 0 to 1.
    fn variance_reduction_confidence(&self, level: usize, halves: &[usize]) -> f64 {
        let spread = self.variance_uncertainty(level, halves);
        1.0 / (1.0 + UNCERTAINTY_PENALTY * spread * spread)
    }

    /// Factor by which doubling the samples to 2^`level` reduced the variance in the specified halves of all
    /// cells, or `None` if unknown. Ignores cells that have not reached this sample count.
    pub(super) fn measured_variance_reduction(&self, level: usize, halves: &[usize]) -> Option<f64> {
        let (mut last, mut before) = (0.0, 0.0);
        for (cell, half) in (0..CELLS).flat_map(|cell| halves.iter().map(move |half| (cell, *half))) {
            let pair = self.squared_step_pair_at_level(level, (cell, half), false)?;
            if pair.last > 0.0 {
                last += pair.last;
                before += pair.before?;
            }
        }
        Some(before / last).filter(|fall| fall.is_finite() && *fall > 0.0)
    }
}

/// Convergence model: how the variance of a pixel's mean falls with its sample count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ConvergenceModel {
    /// Stratified samples, where each doubling fills the gaps between earlier samples. Doubling the samples
    /// divides the variance by 2 for rare light, by 2.8 at edges and in penumbras, and by 4 or more in smooth
    /// regions. The factor is measured by comparing the steps of successive doublings.
    #[default]
    Stratified,
    /// Each sample traces its own photons, shared by all pixels. The variance of camera paths falls quickly
    /// at first, but the photons' variance eventually dominates and falls as for independent samples.
    Photons,
}

/// Factor by which doubling independent samples reduces the variance.
const INDEPENDENT_REDUCTION: f64 = 2.0;

/// Maximum plausible variance reduction per doubling.
const MAX_REDUCTION: f64 = 12.0;

/// Variance reductions up to this value are attributed to independent samples, because a few bright pixels
/// can cause them by chance.
const CHANCE_REDUCTION: f64 = 2.3;

/// Fraction of the variance reduction above [`CHANCE_REDUCTION`] that is expected to continue. The smooth
/// parts of a tile converge first, and the rest converges more slowly.
const LASTING_FRACTION: f64 = 0.65;

/// Penalty for a variance reduction measured from few pixels: the coefficient of the squared
/// [`SquaredMeanChanges::variance_uncertainty`].
const UNCERTAINTY_PENALTY: f64 = 2.0;

/// Trusted fraction of a variance reduction measured over two steps.
const TRUSTED_FRACTION: f64 = 0.8;

/// Factor by which quadrupling independent samples reduces the variance.
const INDEPENDENT_QUADRUPLING_REDUCTION: f64 = 4.0;

/// Like [`CHANCE_REDUCTION`], for quadrupled sample counts.
const CHANCE_QUADRUPLING_REDUCTION: f64 = 5.2;

/// Like [`LASTING_FRACTION`], for quadrupled sample counts.
const LASTING_QUADRUPLING: f64 = 1.2;

/// Maximum variance reduction expected from quadrupling the sample count.
const MAX_QUADRUPLING_REDUCTION: f64 = 40.0;

impl ConvergenceModel {
    /// Typical long-term exponent: the variance falls with this power of the sample count. Does not depend on
    /// the latest steps.
    pub fn typical_variance_exponent(self) -> f64 {
        match self {
            Self::Stratified => 1.432_959_407_276_106_2,
            Self::Photons => 1.0,
        }
    }

    /// Factor by which doubling the samples to 2^`level` reduced the variance in the specified halves of a
    /// tile.
    fn clamped_measured_reduction(steps: &SquaredMeanChanges, level: usize, halves: &[usize]) -> f64 {
        steps
            .measured_variance_reduction(level, halves)
            .map_or(INDEPENDENT_REDUCTION, |fall| fall.clamp(INDEPENDENT_REDUCTION, MAX_REDUCTION))
    }

    /// Factor by which doubling the samples beyond 2^`level` is expected to reduce the variance in the
    /// specified halves of a tile.
    pub(super) fn predicted_variance_reduction(
        steps: &SquaredMeanChanges,
        level: usize,
        halves: &[usize],
    ) -> f64 {
        predict_doubling_variance_reduction(
            Self::clamped_measured_reduction(steps, level, halves),
            steps.variance_reduction_confidence(level, halves),
        )
    }

    /// Variance of the pixel means after `count` samples, summed over the pixels of a half-cell, and the rate
    /// at which it falls.
    ///
    /// The variance is the geometric mean of two predictions. The first is based on doublings: it averages
    /// the last step with a prediction from the two previous steps, because each step is noisy. However,
    /// base-2 sequences are best stratified at powers of 4, so every other doubling gains more. The second
    /// prediction is therefore based on quadrupled sample counts.
    pub(super) fn pixel_variance_sum_and_rate(
        steps: &SquaredMeanChanges,
        (cell, half): (usize, usize),
        count: u32,
        is_relative: bool,
    ) -> Option<(f64, f64)> {
        let level = count.checked_ilog2()? as usize;
        let SquaredStepPair { last, before } =
            steps.squared_step_pair_at_level(level, (cell, half), is_relative)?;
        let fall = Self::clamped_measured_reduction(steps, level, &[half]);
        let step = before.map_or(last, |before| (last + 2.0 * before / fall) / 3.0);
        let rate =
            predict_doubling_variance_reduction(fall, steps.variance_reduction_confidence(level, &[half]));
        let by_two = variance_from_squared_step(step, count, rate);
        let variance = match Self::estimate_variance_from_quadrupling(steps, level, (cell, half), is_relative)
        {
            Some(four) => (by_two * variance_from_squared_step(four, count, 2.0)).sqrt(),
            None => by_two,
        };
        Some((variance, rate))
    }

    /// Variance of the pixel means after 2^`level` samples, summed over the pixels of a half-cell and
    /// predicted from the reduction per quadrupling of the sample count, or `None` for fewer than 16 samples.
    fn estimate_variance_from_quadrupling(
        steps: &SquaredMeanChanges,
        level: usize,
        at: (usize, usize),
        is_relative: bool,
    ) -> Option<f64> {
        let [last, before, ..] = steps.last_four_squared_steps(level, at, is_relative)?;
        let fall =
            steps.quadrupling_variance_reduction(level, at.1).unwrap_or(INDEPENDENT_QUADRUPLING_REDUCTION);
        let lasting = LASTING_QUADRUPLING
            * (fall - CHANCE_QUADRUPLING_REDUCTION).max(0.0)
            * steps.variance_reduction_confidence(level, &[at.1]);
        let rate = (INDEPENDENT_QUADRUPLING_REDUCTION + lasting).min(MAX_QUADRUPLING_REDUCTION);
        Some((last + before) / (rate - 1.0))
    }
}

/// Variance reduction expected from the next doubling. `fall` is the measured reduction, and `trust` is the
/// confidence in this measurement.
fn predict_doubling_variance_reduction(fall: f64, trust: f64) -> f64 {
    INDEPENDENT_REDUCTION + LASTING_FRACTION * (fall - CHANCE_REDUCTION).max(0.0) * trust
}

/// Variance of the mean of `count` ≥ 2 samples, computed from the squared step at the last power of two and
/// the rate at which the variance falls.
pub(super) fn variance_from_squared_step(step: f64, count: u32, rate: f64) -> f64 {
    // Between powers of two, the variance falls as for independent samples.
    let part = f64::from(1_u32 << count.ilog2()) / f64::from(count);
    step / (rate - 1.0) * part
}
