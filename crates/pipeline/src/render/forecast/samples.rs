//! Predicts how many samples each part of the image needs to reach the noise target. Each prediction is
//! needed only until the part's goal is decided.

use crate::film::{CELLS, ConvergenceModel, total_samples_to_reduce_error};
use crate::render::noise_goals::{
    AIM, CellSampleGoals, MAX_SAMPLES, MIN_SAMPLES, NoiseMeasurements, TileNoise,
};

/// Assumed factor by which the variance decreases from two to four samples and again from four to eight. This
/// is the median over all tiles in the bundled scenes.
const EARLY_REDUCTION: f64 = 4.0;
/// Range to which measured decreases in variance are clamped.
const REDUCTION_RANGE: [f64; 2] = [2.0, 8.0];

/// Expected number of samples for each half of each cell.
#[derive(Debug)]
pub(crate) struct ExpectedSamples(Vec<[u32; 2]>);

impl ExpectedSamples {
    /// Creates predictions for `cells` cells, all unknown.
    pub(crate) fn unknown(cells: usize) -> Self {
        Self(vec![[u32::MAX; 2]; cells])
    }

    /// Returns the expected number of samples for a half without a goal, or [`u32::MAX`] if unknown.
    pub(crate) fn of_cell_half(&self, cell: usize, half: usize) -> u32 {
        self.0[cell][half]
    }

    /// Returns the memory used, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(self.0.as_slice())
    }

    /// Updates the predictions from the noise in both halves of each tile and the rate at which it decreases.
    /// `judgement.samples` is a power of two. `done` is the number of samples in each half. Predictions for
    /// halves with a goal do not change.
    pub(crate) fn update_predictions(
        &mut self,
        judgement: &NoiseMeasurements,
        goals: &CellSampleGoals,
        done: &[[u32; 2]],
    ) {
        let NoiseMeasurements { noise, samples, aim } = judgement;
        // Collect the tiles without goals and the overall rate at which their noise decreases.
        let open = |(tile, noise): (usize, &Option<TileNoise>)| {
            noise
                .filter(|_| goals.tile_has_undecided_goal_at(tile, done, *samples))
                .map(|noise| (tile, noise))
        };
        let tiles: Vec<(usize, TileNoise)> = noise.iter().enumerate().filter_map(open).collect();
        let falls = tiles.iter().filter_map(|(_, noise)| noise.fall).collect();
        let law = NoiseDecay::fit(aim.convergence, falls, *samples);
        for (tile, TileNoise { halves, fall }) in tiles {
            // Average the noise of both halves of the tile.
            let squares = halves.iter().flatten().map(|half| {
                let noise = aim.noise_relative_to_brightness(half);
                noise * noise
            });
            let mean = squares.sum::<f64>() / halves.iter().flatten().count() as f64;
            if !mean.is_finite() {
                continue;
            }
            // Extrapolate to the noise target.
            let wanted = law.samples_to_reach(AIM * aim.error, mean.sqrt(), fall);
            let cells = self.0.iter_mut().zip(done).enumerate().skip(CELLS * tile).take(CELLS);
            for (cell, (expected, done)) in cells {
                for half in (0..2).filter(|half| goals.get(cell, *half) == u32::MAX) {
                    expected[half] = wanted.max(done[half]).max(MIN_SAMPLES);
                }
            }
        }
    }
}

/// Model of how noise decreases with the number of samples. Smooth parts converge fast, so their noise soon
/// becomes negligible. After that, the noise decreases at the rate typical of edges and penumbras, or more
/// slowly.
#[derive(Clone, Copy, Debug, PartialEq)]
struct NoiseDecay {
    samples: u32,
    /// Number of sample doublings that each reduce the variance by a factor of `fall`. After these doublings,
    /// `power` applies.
    doublings: u32,
    /// Ratio of the variances before and after the last doubling of samples, for all tiles, or `None` below
    /// [`MIN_SAMPLES`] samples, where each tile uses its own ratio.
    fall: Option<f64>,
    /// Exponent p. After the doublings, the variance is proportional to the number of samples to the power
    /// −p.
    power: f64,
}

impl NoiseDecay {
    /// Fits the model to `falls`: for each tile, the variance before the last doubling of samples divided by
    /// the variance after it.
    fn fit(convergence: ConvergenceModel, mut falls: Vec<f64>, samples: u32) -> Self {
        let doublings = (MIN_SAMPLES.ilog2().saturating_sub(samples.ilog2())).max(1);
        if convergence == ConvergenceModel::Photons {
            return Self {
                samples,
                doublings,
                fall: Some(libm::exp2(convergence.typical_variance_exponent())),
                power: convergence.typical_variance_exponent(),
            };
        }
        if samples < MIN_SAMPLES {
            return Self { samples, doublings, fall: None, power: convergence.typical_variance_exponent() };
        }
        falls.sort_by(f64::total_cmp);
        let usual = libm::exp2(convergence.typical_variance_exponent());
        let fall = falls
            .get(falls.len() / 2)
            .map_or(usual, |fall| fall.clamp(REDUCTION_RANGE[0], REDUCTION_RANGE[1]));
        Self {
            samples,
            doublings,
            fall: Some(fall),
            power: libm::log2(fall).min(convergence.typical_variance_exponent()),
        }
    }

    /// Returns the number of samples that a tile needs for its noise to reach `bound`. `fall` is the tile's
    /// ratio of variances at the last doubling.
    fn samples_to_reach(&self, bound: f64, noise: f64, fall: Option<f64>) -> u32 {
        let of_tile = || {
            // Each doubling beyond two samples provides another ratio for the tile.
            let known = fall.map_or(0.0, |_| 1.0 - 1.0 / f64::from(self.samples.ilog2()));
            let fall =
                fall.map_or(EARLY_REDUCTION, |fall| fall.clamp(REDUCTION_RANGE[0], REDUCTION_RANGE[1]));
            libm::pow(fall, known) * libm::pow(EARLY_REDUCTION, 1.0 - known)
        };
        let fall = self.fall.unwrap_or_else(of_tile);
        let noise = noise * libm::pow(fall, -0.5 * f64::from(self.doublings));
        let samples = self.samples.saturating_mul(1 << self.doublings);
        if noise > 0.0 {
            total_samples_to_reduce_error(self.power, bound / noise, samples).min(MAX_SAMPLES)
        } else {
            self.samples
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::noise_goals::tests::one_tile_film;

    fn decided_goals_and_predictions(
        halves: [(f32, f32); 2],
        samples: u32,
        error: f64,
    ) -> (CellSampleGoals, ExpectedSamples) {
        let (mut goals, mut expected) = (CellSampleGoals::new_undecided(1), ExpectedSamples::unknown(1));
        let done = [[samples; 2]];
        let judgement =
            goals.decide_half_goals(&one_tile_film(halves, samples), &done, samples, error).expect("samples");
        expected.update_predictions(&judgement, &goals, &done);
        (goals, expected)
    }

    #[test]
    fn noise_of_both_halves_predicts_samples() {
        // The first half is smooth, but the second is noisy.
        let (goals, expected) = decided_goals_and_predictions([(1.0, 0.0), (1.0, 1.0)], 16, 0.01);
        assert_eq!(goals.get(0, 0), u32::MAX, "no goal should be decided");
        assert!((64..1000).contains(&expected.of_cell_half(0, 0)), "{}", expected.of_cell_half(0, 0));
    }

    #[test]
    fn few_samples_suffice_for_a_prediction() {
        // Reaching the target takes 833 independent samples with a standard deviation of √(1/12). After two
        // samples, the slow decrease in noise is not yet apparent, but each doubling improves the prediction.
        // The expected predictions are 80, 190 and 260. With 64 pixels, their error is about 20 %.
        for (samples, expected) in [(2, 80.0), (4, 190.0), (8, 260.0)] {
            let (goals, expected_samples) = decided_goals_and_predictions([(1.0, 1.0); 2], samples, 0.01);
            assert_eq!(goals.get(0, 0), u32::MAX, "no goal should be decided");
            let ratio = f64::from(expected_samples.of_cell_half(0, 0)) / expected;
            assert!((0.6..1.6).contains(&ratio), "{samples}: {}", expected_samples.of_cell_half(0, 0));
        }
    }

    #[test]
    fn recent_noise_decrease_is_extrapolated() {
        let (stratified, usual) =
            (ConvergenceModel::Stratified, ConvergenceModel::Stratified.typical_variance_exponent());
        let of = |falls: &[f64]| NoiseDecay::fit(stratified, falls.to_vec(), 64);
        for (falls, fall, power) in [
            (vec![], libm::exp2(usual), usual),
            (vec![2.0, 1.0, 2.0], 2.0, 1.0),
            (vec![9.0, 4.0, 3.0], 4.0, usual),
            (vec![100.0, 2.2, 2.3, 2.1, 1e-3], 2.2, libm::log2(2.2)),
        ] {
            assert_eq!(
                of(&falls),
                NoiseDecay { samples: 64, doublings: 1, fall: Some(fall), power },
                "{falls:?}"
            );
        }
        // Predict the sample counts at which the noise is a half and a quarter of its value at 64 samples.
        // The variance decreases either by a factor of 4 in the first doubling and 2.7 in later ones, or as
        // it does with independent samples.
        let near = |samples: u32, of: f64| (f64::from(samples) / of - 1.0).abs() < 0.02;
        assert!(near(of(&[4.0]).samples_to_reach(0.5, 1.0, None), 128.0));
        assert!(near(of(&[4.0]).samples_to_reach(0.25, 1.0, None), 128.0 * libm::pow(4.0, 1.0 / usual)));
        assert!(near(of(&[1.0]).samples_to_reach(0.25, 1.0, None), 16.0 * 64.0));
        assert!(near(
            NoiseDecay::fit(ConvergenceModel::Photons, vec![9.0], 4).samples_to_reach(0.25, 1.0, Some(9.0)),
            64.0
        ));
    }

    #[test]
    fn huge_predictions_differ_from_unknown() {
        for samples in [2, 16, 64] {
            let (goals, expected) = decided_goals_and_predictions([(1.0, 1.0); 2], samples, 1e-12);
            assert_eq!((goals.get(0, 0), expected.of_cell_half(0, 0)), (u32::MAX, MAX_SAMPLES), "{samples}");
        }
    }

    #[test]
    fn smooth_tiles_need_few_samples() {
        let law = NoiseDecay::fit(ConvergenceModel::Stratified, vec![], 4);
        assert_eq!((law.doublings, law.fall), (2, None));
        let [smooth, unknown, rough] =
            [Some(8.0), None, Some(1.0)].map(|fall| law.samples_to_reach(0.2, 1.0, fall));
        assert!(smooth < unknown && unknown < rough, "{smooth} {unknown} {rough}");
        // The variance decreases by factors of √(8 · 4) and √(2 · 4).
        assert!((12..17).contains(&smooth) && (30..55).contains(&rough), "{smooth} {rough}");
    }
}
