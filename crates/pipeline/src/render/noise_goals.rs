//! Decides, based on noise, when each part of an image has enough samples.
//!
//! If a tile's own samples decided when to stop, the image would be too dark: sampling would stop early in
//! tiles that missed rare bright samples, and continue in tiles that found them. Each half of a tile (every
//! other pixel) therefore stops based on the noise of the other half, whose samples are independent and about
//! as noisy. A tenth of the bias remains because a half that has stopped provides no new information. In the
//! worst case, this is a thirtieth of the noise.

use crate::film::{
    BrightnessPrepassPixels, CELLS, ConvergenceModel, Film, HalfNoise, PREPASS_SAMPLES,
    total_samples_to_reduce_error,
};

/// Minimum number of samples for noise estimates.
pub(crate) const MIN_SAMPLES: u32 = PREPASS_SAMPLES;

/// Fraction of the noise target to aim for. It is less than 1 because parts whose noise is underestimated
/// stop early.
pub(crate) const AIM: f64 = 0.85;

/// A tile is reported if its noise exceeds the target by more than this factor, which allows for measurement
/// errors.
const TOO_MUCH: f64 = 1.5;

/// Upper limit for the expected number of samples. [`u32::MAX`] means unknown.
pub(crate) const MAX_SAMPLES: u32 = u32::MAX - 1;

/// Minimum reference brightness for relative noise, as a fraction of the image's mean luminance.
const MIN_BRIGHTNESS: f64 = 0.01;

/// Maximum number of samples for each half of each cell.
#[derive(Debug)]
pub(crate) struct CellSampleGoals {
    /// Goal of each half of each cell, or [`u32::MAX`] while undecided.
    pub(super) decided: Vec<[u32; 2]>,
    /// Sample count at which each tile was last evaluated. Tiles are evaluated only once per sample count.
    pub(super) judged: Vec<u32>,
    /// Mean luminance of the [`BrightnessPrepassPixels`], or `None` until noise has been evaluated.
    pub(super) brightness: Option<f64>,
}

impl CellSampleGoals {
    /// Creates undecided goals for `cells` cells.
    pub(crate) fn new_undecided(cells: usize) -> Self {
        Self { decided: vec![[u32::MAX; 2]; cells], judged: vec![0; cells.div_ceil(CELLS)], brightness: None }
    }

    /// Returns the maximum number of samples for one half of a cell.
    pub(crate) fn get(&self, cell: usize, half: usize) -> u32 {
        self.decided[cell][half]
    }

    /// Returns the memory used, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(self.decided.as_slice()) + size_of_val(self.judged.as_slice())
    }

    /// Whether any goal is below `samples`.
    pub(crate) fn has_goal_below(&self, samples: u32) -> bool {
        self.decided.as_flattened().iter().any(|goal| *goal < samples)
    }

    /// Decides the goals of undecided halves with `samples` samples (a power of two), based on the noise in
    /// the other half. `done` is the number of samples in each half. Decides nothing until all halves have
    /// enough samples to estimate the image's brightness. Runs in parallel within a thread pool.
    pub(crate) fn decide_half_goals(
        &mut self,
        film: &Film,
        done: &[[u32; 2]],
        samples: u32,
        error: f64,
    ) -> Option<NoiseMeasurements> {
        let is_time = samples >= MIN_SAMPLES && !self.any_half_below_min_samples(done);
        if is_time && self.brightness.is_none() {
            self.brightness = BrightnessPrepassPixels::new(film.crop_rect()).film_mean_luminance(film);
        }
        let brightness = self.brightness.or_else(|| film.mean_luminance())?;
        let aim = NoiseTarget { error, brightness, convergence: film.convergence_model() };
        let is_open =
            |tile: usize| self.judged[tile] < samples && self.tile_has_undecided_goal_at(tile, done, samples);
        let noise = film.map_tiles(|tile| is_open(tile).then(|| TileNoise::measure(film, tile)));
        if is_time {
            self.decide_goals_within_next_doubling(&noise, done, samples, &aim);
            let judged = self.judged.iter_mut().zip(&noise).filter(|(_, noise)| noise.is_some());
            judged.for_each(|(judged, _)| *judged = samples);
        }
        Some(NoiseMeasurements { noise, samples, aim })
    }

    /// Returns the number of tiles whose noise exceeds [`TOO_MUCH`] times the target although they reached
    /// their goals, and the highest noise among them. Such tiles exist because a half's own noise does not
    /// affect its goal.
    pub(crate) fn count_finished_tiles_above_target(&self, film: &Film, error: f64) -> Option<(usize, f64)> {
        let aim = NoiseTarget { error, brightness: self.brightness?, convergence: film.convergence_model() };
        let noise = film.map_tiles(|tile| {
            let is_decided = |cell: &[u32; 2]| cell.iter().all(|goal| *goal < u32::MAX);
            let halves = || [0, 1].map(|half| film.noise_in_tile_half(tile, half)).into_iter().flatten();
            let count = halves().count() as f64;
            let all =
                halves().fold((0.0, 0.0), |(v, m), one| (v + one.variance / count, m + one.mean / count));
            let whole = halves().next().map(|half| HalfNoise { variance: all.0, mean: all.1, ..half });
            let mut cells = self.decided.iter().skip(CELLS * tile).take(CELLS);
            whole.filter(|_| cells.all(is_decided)).map(|noise| aim.noise_relative_to_brightness(&noise))
        });
        let too_much = || noise.iter().flatten().filter(|noise| **noise > TOO_MUCH * error);
        let worst = too_much().copied().max_by(f64::total_cmp)?;
        Some((too_much().count(), worst))
    }

    /// Whether a tile contains an undecided half with `samples` samples.
    pub(crate) fn tile_has_undecided_goal_at(&self, tile: usize, done: &[[u32; 2]], samples: u32) -> bool {
        let cells = self.decided.iter().zip(done).skip(CELLS * tile).take(CELLS);
        cells
            .flat_map(|(goals, done)| goals.iter().zip(done))
            .any(|(goal, done)| *goal == u32::MAX && *done == samples)
    }

    /// Whether any half that needs more samples has fewer than [`MIN_SAMPLES`].
    fn any_half_below_min_samples(&self, done: &[[u32; 2]]) -> bool {
        let mut halves = self.decided.as_flattened().iter().zip(done.as_flattened());
        halves.any(|(goal, done)| goal > done && *done < MIN_SAMPLES)
    }

    fn decide_goals_within_next_doubling(
        &mut self,
        noise: &[Option<TileNoise>],
        done: &[[u32; 2]],
        samples: u32,
        aim: &NoiseTarget,
    ) {
        for (cell, done) in done.iter().enumerate() {
            let was_decided = self.decided[cell].map(|goal| goal < u32::MAX);
            if (0..2).all(|half| was_decided[half] || done[half] != samples) {
                continue;
            }
            let Some(TileNoise { halves: [even, odd], .. }) = noise[cell / CELLS] else { continue };
            // A one-pixel tile has no second half.
            let of_others = [odd.or(even), even.or(odd)];
            for half in 0..2 {
                let Some(noise) = of_others[half].filter(|_| !was_decided[half]) else { continue };
                let wanted = aim.samples_to_reach(&noise);
                // A finished half provides no further information about the other half.
                if was_decided[1 - half] || wanted <= done[half].saturating_mul(2) {
                    self.decided[cell][half] = wanted.max(done[half]);
                }
            }
        }
    }
}

/// Noise measurements on which goals are based.
#[derive(Debug)]
pub(crate) struct NoiseMeasurements {
    /// Noise of each tile, or `None` for tiles that already have goals or have a different sample count.
    pub(crate) noise: Vec<Option<TileNoise>>,
    /// Sample count of the evaluated tiles.
    pub(crate) samples: u32,
    pub(crate) aim: NoiseTarget,
}

/// A tile's noise, measured from its samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileNoise {
    pub(crate) halves: [Option<HalfNoise>; 2],
    /// Ratio of the variances before and after the last doubling of samples.
    pub(crate) fall: Option<f64>,
}

impl TileNoise {
    fn measure(film: &Film, tile: usize) -> Self {
        let noise = |half| {
            let noise = film.noise_in_tile_half(tile, half)?;
            // Use an upper bound on the noise. If the noise comes from a few bright samples, there may be
            // other bright samples that have not been taken yet.
            Some(HalfNoise {
                variance: noise.variance * (1.0 + film.tile_variance_uncertainty(tile, half)),
                ..noise
            })
        };
        Self { halves: [0, 1].map(noise), fall: film.last_doubling_variance_reduction(tile) }
    }
}

/// Noise target and its reference brightness.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NoiseTarget {
    /// Target for the relative noise.
    pub(crate) error: f64,
    /// Mean luminance of the image.
    brightness: f64,
    pub(crate) convergence: ConvergenceModel,
}

impl NoiseTarget {
    /// Returns the number of samples needed for the noise to reach the target.
    fn samples_to_reach(&self, noise: &HalfNoise) -> u32 {
        let relative = self.noise_relative_to_brightness(noise);
        if !(relative > 0.0) {
            return noise.samples;
        }
        let part = AIM * self.error / relative;
        let doubled = noise.samples.saturating_mul(2);
        // Treat samples up to the next power of two as independent. They reduce the noise faster only once
        // the power of two is reached.
        if 1.0 / (part * part) <= libm::exp2(noise.power) {
            return total_samples_to_reduce_error(1.0, part, noise.samples).min(doubled);
        }
        let power = noise.power.min(self.convergence.typical_variance_exponent());
        total_samples_to_reduce_error(power, part, noise.samples)
            .max(doubled.saturating_add(1))
            .min(MAX_SAMPLES)
    }

    /// Returns the noise relative to the reference brightness.
    pub(crate) fn noise_relative_to_brightness(&self, noise: &HalfNoise) -> f64 {
        noise.variance.sqrt() / noise.mean.max(MIN_BRIGHTNESS * self.brightness)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::film::{PixelSubset, Rect, SelectedPixels, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit_generator;

    /// Creates a one-tile film. `halves` contains the mean and spread of each half's samples.
    pub(crate) fn one_tile_film(halves: [(f32, f32); 2], samples: u32) -> Film {
        const COLUMNS: u32 = 32;
        let film = Film::new(COLUMNS, 2, None).expect("a film");
        let mut next = unit_generator(3);
        for (half, (mean, spread)) in halves.into_iter().enumerate() {
            let pixels = SelectedPixels { rect: film.crop_rect(), part: PixelSubset::Half(half) };
            let sample = |_| Vec3::splat(mean + spread * (next() - 0.5));
            let radiance = (0..COLUMNS * samples).map(sample).collect();
            film.add_samples(
                0,
                TileSamples { pixels, samples, radiance, negative: None, layers: Default::default() },
            );
        }
        film
    }

    fn decided_goals(halves: [(f32, f32); 2], samples: u32, error: f64) -> CellSampleGoals {
        let mut goals = CellSampleGoals::new_undecided(1);
        goals.decide_half_goals(&one_tile_film(halves, samples), &[[samples; 2]], samples, error);
        goals
    }

    #[test]
    fn each_half_stops_based_on_the_other_half() {
        // The first half is smooth, but the second is noisy.
        let goals = decided_goals([(1.0, 0.0), (1.0, 1.0)], 16, 0.01);
        assert_eq!(goals.get(0, 1), 16, "the second half should stop because the first has no noise");
        assert_eq!(goals.get(0, 0), u32::MAX);
    }

    #[test]
    fn tiles_noisy_after_merging_halves_are_counted() {
        let rough = one_tile_film([(1.0, 0.0), (1.0, 1.0)], 16);
        let goals = decided_goals([(1.0, 0.0), (1.0, 1.0)], 16, 0.01);
        assert_eq!(
            goals.count_finished_tiles_above_target(&rough, 0.01),
            None,
            "the first half should continue"
        );
        let clean = decided_goals([(1.0, 0.0); 2], 16, 0.01);
        assert_eq!(clean.count_finished_tiles_above_target(&one_tile_film([(1.0, 0.0); 2], 16), 0.01), None);
        // One of the two halves has a standard error of √(1/12/16).
        let Some((tiles, worst)) = clean.count_finished_tiles_above_target(&rough, 0.01) else {
            panic!("one tile should be reported")
        };
        assert!(tiles == 1 && (worst / 0.051 - 1.0).abs() < 0.3, "{tiles} {worst}");
    }

    #[test]
    fn nothing_is_decided_with_too_few_samples() {
        for (samples, is_open) in [(8, true), (16, false)] {
            let goals = decided_goals([(1.0, 0.0); 2], samples, 0.01);
            assert_eq!(goals.get(0, 0) == u32::MAX, is_open, "{samples}");
        }
    }

    #[test]
    fn goal_within_next_doubling_is_decided() {
        // The standard error is √(1/12/16) = 0.072, or up to 0.082 with so few pixels. Reaching the target
        // takes 24 samples.
        let goals = decided_goals([(1.0, 1.0); 2], 16, 0.08);
        assert!((17..=32).contains(&goals.get(0, 0)), "{}", goals.get(0, 0));
        assert_eq!(decided_goals([(1.0, 1.0); 2], 16, 0.005).get(0, 0), u32::MAX);
    }

    #[test]
    fn reference_brightness_has_a_minimum() {
        // A bright and a dark tile with equal relative noise.
        let film = Film::new(64, 2, None).expect("a film");
        let mut next = unit_generator(9);
        for (tile, mean) in [(0, 1.0), (1, 1e-6)] {
            let rect = Rect { x: 32 * tile, y: 0, width: 32, height: 2 };
            let radiance = (0..64 * 16).map(|_| Vec3::splat(mean * 2.0 * next())).collect();
            film.add_samples(
                tile as usize,
                TileSamples {
                    pixels: rect.into(),
                    samples: 16,
                    radiance,
                    negative: None,
                    layers: Default::default(),
                },
            );
        }
        let mut goals = CellSampleGoals::new_undecided(2 * CELLS);
        goals.decide_half_goals(&film, &[[16; 2]; 2 * CELLS], 16, 0.01);
        assert_eq!((goals.get(0, 0), goals.get(CELLS, 0)), (u32::MAX, 16));
    }

    /// Returns the mean over a tile with rare bright samples and an expected value of 1. Each half stops
    /// based on the noise of the other half, or on its own noise if `by_own`.
    fn mean_of_stopped_tile(next: &mut impl FnMut() -> f32, by_own: bool) -> f64 {
        const MAX_SAMPLES: u32 = 256;
        let film = Film::new(4, 4, None).expect("a film");
        let (mut goals, mut done) = (CellSampleGoals::new_undecided(1), [[0; 2]]);
        for target in [16, 32, 64, 128, MAX_SAMPLES] {
            for half in 0..2 {
                let goal = goals.get(0, if by_own { 1 - half } else { half }).min(target);
                let samples = goal.saturating_sub(done[0][half]);
                let pixels = SelectedPixels { rect: film.crop_rect(), part: PixelSubset::Half(half) };
                let sample = |_| if next() < 0.01 { Vec3::splat(100.0) } else { Vec3::ZERO };
                let radiance = (0..8 * samples).map(sample).collect();
                film.add_samples(
                    0,
                    TileSamples { pixels, samples, radiance, negative: None, layers: Default::default() },
                );
                done[0][half] += samples;
            }
            goals.decide_half_goals(&film, &done, target, 0.6);
        }
        film.mean_luminance().expect("samples")
    }

    #[test]
    fn stopping_on_other_half_is_nearly_unbiased() {
        let mut next = unit_generator(11);
        let mut mean_of = |by_own| {
            const TILES: u32 = 20_000;
            let means: Vec<f64> = (0..TILES).map(|_| mean_of_stopped_tile(&mut next, by_own)).collect();
            let mean = means.iter().sum::<f64>() / f64::from(TILES);
            let variance = means.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / f64::from(TILES);
            (mean, (variance / f64::from(TILES)).sqrt())
        };
        let (mean, error) = mean_of(false);
        let (own, own_error) = mean_of(true);
        assert!(error.max(own_error) < 0.004, "{error} {own_error}");
        // The noise target is 0.6.
        assert!((mean - 1.0).abs() < 0.04 * 0.6, "{mean} ± {error}");
        assert!(own < 0.9, "stopping based on a half's own noise should be biased: {own} ± {own_error}");
    }
}
