//! Which parts of a picture have enough samples.
//!
//! To stop by the same samples that the picture is the mean of would make it too dark: what is rare and bright ends no sampling
//! where it was not met yet, and goes on where it was. So one half of a tile, which has every other pixel, stops by the noise of the
//! other half, whose samples are others; the noise of both is much the same. A little of the bias is left, as a half
//! that has stopped tells the other no more: a tenth of it, which is a thirtieth of the noise where that is worst.

use crate::film::{CELLS, Convergence, Film, HalfNoise, samples_by};

/// Samples before which noise is not asked for.
pub(super) const LEAST: u32 = 16;

/// The part of the noise asked for that is aimed at, as noise is known by some samples only.
const AIM: f64 = 0.82;

/// The least brightness that noise is held against, as a part of the picture's.
const LEAST_BRIGHTNESS: f64 = 0.01;

/// Samples that the halves of each cell are to have.
#[derive(Debug)]
pub(super) struct Goals {
    /// What is decided; [`u32::MAX`] before.
    decided: Vec<[u32; 2]>,
    /// What is expected to be.
    expected: Vec<[u32; 2]>,
    /// Mean luminance of the picture, when noise was first asked for.
    brightness: Option<f64>,
}

impl Goals {
    /// For so many cells, of which nothing is known.
    pub(super) fn none(cells: usize) -> Self {
        let open = vec![[u32::MAX; 2]; cells];
        Self { decided: open.clone(), expected: open, brightness: None }
    }

    /// Samples that a half of a cell is to have at most.
    pub(super) fn of(&self, cell: usize, half: usize) -> u32 {
        self.decided[cell][half]
    }

    /// Samples that it is expected to get; [`u32::MAX`] where nothing is known.
    pub(super) fn expected(&self, cell: usize, half: usize) -> u32 {
        self.expected[cell][half]
    }

    /// Whether any half gets fewer samples than these.
    pub(super) fn are_below(&self, samples: u32) -> bool {
        self.decided.as_flattened().iter().any(|goal| *goal < samples)
    }

    /// Expect what the samples so far tell, which are a power of two: by the noise of both halves of a tile, and by how it fell in the
    /// tiles that are not decided. What is decided is decided otherwise.
    fn foresee(&mut self, film: &Film, done: &[[u32; 2]], samples: u32, error: f64) {
        let Some(brightness) = self.brightness.or_else(|| film.mean_luminance()) else { return };
        let is_open = |tile: &usize| {
            let cells = self.decided.iter().zip(done).skip(CELLS * tile).take(CELLS);
            cells
                .flat_map(|(goals, done)| goals.iter().zip(done))
                .any(|(goal, done)| *goal == u32::MAX && *done == samples)
        };
        let tiles: Vec<usize> = (0..film.tile_count()).filter(is_open).collect();
        let falls = tiles.iter().filter_map(|tile| film.tile_fall(*tile)).collect();
        let power = power_of(film.convergence(), falls);
        for tile in tiles {
            let noise: Vec<HalfNoise> =
                [0, 1].into_iter().filter_map(|half| film.tile_noise(tile, half)).collect();
            let square = |one: &HalfNoise| {
                let noise = relative(one, brightness);
                noise * noise
            };
            let mean = noise.iter().map(square).sum::<f64>() / noise.len() as f64;
            if !mean.is_finite() {
                continue;
            }
            let wanted = match mean.sqrt() {
                noise if noise > 0.0 => samples_by(power, AIM * error / noise, samples),
                _ => samples,
            };
            let cells = self.expected.iter_mut().zip(&self.decided).zip(done).skip(CELLS * tile).take(CELLS);
            for ((expected, decided), done) in cells {
                for half in (0..2).filter(|half| decided[*half] == u32::MAX) {
                    expected[half] = wanted.max(done[half]).max(LEAST);
                }
            }
        }
    }

    /// Decide for every half that has no goal yet and has now `samples`, a power of two, by the noise of the other one. `done` are
    /// the samples that all of them have. Before all have enough of them for the picture's brightness, nothing is decided.
    pub(super) fn judge(&mut self, film: &Film, done: &[[u32; 2]], samples: u32, error: f64) {
        if samples >= LEAST {
            self.decide(film, done, samples, error);
        }
        self.foresee(film, done, samples, error);
    }

    fn decide(&mut self, film: &Film, done: &[[u32; 2]], samples: u32, error: f64) {
        let open = |goals: &[u32; 2], done: &[u32; 2]| {
            (0..2).any(|half| goals[half] > done[half] && done[half] < LEAST)
        };
        if self.decided.iter().zip(done).any(|(goals, done)| open(goals, done)) {
            return;
        }
        let Some(brightness) = self.brightness.or_else(|| film.mean_luminance()) else { return };
        self.brightness = Some(brightness);
        for (cell, done) in done.iter().enumerate() {
            if (0..2).all(|half| self.decided[cell][half] < u32::MAX || done[half] != samples) {
                continue;
            }
            let [even, odd] = [0, 1].map(|half| film.tile_noise(cell / CELLS, half));
            // A tile of one pixel has no other half.
            let of_others = [odd.or(even), even.or(odd)];
            let was_decided = self.decided[cell].map(|goal| goal < u32::MAX);
            for half in 0..2 {
                let Some(noise) = of_others[half].filter(|_| !was_decided[half]) else { continue };
                let wanted = wanted(&noise, film.convergence(), brightness, error);
                // Where the other half has no more samples to come, nothing more will be known.
                if was_decided[1 - half] || wanted <= done[half].saturating_mul(2) {
                    self.decided[cell][half] = wanted.max(done[half]);
                    self.expected[cell][half] = self.decided[cell][half];
                }
            }
        }
    }
}

/// Samples that bring noise to the error asked for.
fn wanted(noise: &HalfNoise, convergence: Convergence, brightness: f64, error: f64) -> u32 {
    let relative = relative(noise, brightness);
    if !(relative > 0.0) {
        return noise.samples;
    }
    convergence.samples_to(AIM * error / relative, noise.samples)
}

/// Noise over the brightness that it is held against.
fn relative(noise: &HalfNoise, brightness: f64) -> f64 {
    noise.variance.sqrt() / noise.mean.max(LEAST_BRIGHTNESS * brightness)
}

/// The power of the samples with which variance falls: by the median of how it fell, between those of both kinds of samples.
fn power_of(convergence: Convergence, mut falls: Vec<f64>) -> f64 {
    falls.sort_by(f64::total_cmp);
    let power = |fall: &f64| libm::log2(*fall).clamp(1.0, Convergence::Stratified.power());
    falls.get(falls.len() / 2).map_or(convergence.power(), power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Part, Pixels, Rect, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit;

    /// A film of one tile, whose halves have samples of a mean and a spread each.
    fn film(halves: [(f32, f32); 2], samples: u32) -> Film {
        const COLUMNS: u32 = 32;
        let film = Film::new(COLUMNS, 2, None).expect("a film");
        let mut next = unit(3);
        for (half, (mean, spread)) in halves.into_iter().enumerate() {
            let pixels = Pixels { rect: film.crop(), part: Part::Half(half) };
            let sample = |_| Vec3::splat(mean + spread * (next() - 0.5));
            let radiance = (0..COLUMNS * samples).map(sample).collect();
            film.add(0, &TileSamples { pixels, samples, radiance, negative: None });
        }
        film
    }

    fn judged(halves: [(f32, f32); 2], samples: u32, error: f64) -> Goals {
        let mut goals = Goals::none(1);
        goals.judge(&film(halves, samples), &[[samples; 2]], samples, error);
        goals
    }

    #[test]
    fn each_half_stops_by_the_noise_of_the_other() {
        // The first half is smooth, the other one is not.
        let goals = judged([(1.0, 0.0), (1.0, 1.0)], 16, 0.01);
        assert_eq!(goals.of(0, 1), 16, "the other half has no noise");
        assert_eq!(goals.of(0, 0), u32::MAX);
        assert!((64..1000).contains(&goals.expected(0, 0)), "{}", goals.expected(0, 0));
    }

    #[test]
    fn nothing_is_decided_before_there_are_samples_enough() {
        for (samples, is_open) in [(8, true), (16, false)] {
            let goals = judged([(1.0, 0.0); 2], samples, 0.01);
            assert_eq!(goals.of(0, 0) == u32::MAX, is_open, "{samples}");
        }
    }

    #[test]
    fn what_is_within_twice_the_samples_is_decided_and_more_is_asked_for_again() {
        // A standard error of sqrt(1/12/16) = 0.072, by the estimate some 0.72 of it.
        let goals = judged([(1.0, 1.0); 2], 16, 0.05);
        assert!((17..=32).contains(&goals.of(0, 0)), "{}", goals.of(0, 0));
        assert_eq!(judged([(1.0, 1.0); 2], 16, 0.005).of(0, 0), u32::MAX);
    }

    #[test]
    fn a_few_samples_tell_how_many_there_will_be() {
        for samples in [2, 4, 8] {
            let goals = judged([(1.0, 1.0); 2], samples, 0.01);
            assert_eq!(goals.of(0, 0), u32::MAX, "nothing is decided");
            // Independent samples of a standard deviation of √(1/12) take 833; if noise falls as in a film, by two of them 112.
            assert!((60..2000).contains(&goals.expected(0, 0)), "{samples}: {}", goals.expected(0, 0));
        }
    }

    #[test]
    fn how_noise_fell_so_far_tells_how_it_will_fall() {
        let stratified = Convergence::Stratified.power();
        for (falls, power) in [
            (vec![], stratified),
            (vec![2.0, 1.0, 2.0], 1.0),
            (vec![9.0, 4.0, 3.0], stratified),
            (vec![100.0, 2.2, 2.3, 2.1, 1e-3], libm::log2(2.2)),
        ] {
            assert_eq!(power_of(Convergence::Stratified, falls.clone()), power, "{falls:?}");
        }
        assert_eq!(power_of(Convergence::Independent, vec![]), 1.0);
    }

    #[test]
    fn noise_is_held_against_a_hundredth_of_the_picture_where_it_is_dark() {
        // A bright tile beside a dark one, with as much noise for their brightness.
        let film = Film::new(64, 2, None).expect("a film");
        let mut next = unit(9);
        for (tile, mean) in [(0, 1.0), (1, 1e-6)] {
            let rect = Rect { x: 32 * tile, y: 0, width: 32, height: 2 };
            let radiance = (0..64 * 16).map(|_| Vec3::splat(mean * 2.0 * next())).collect();
            film.add(
                tile as usize,
                &TileSamples { pixels: rect.into(), samples: 16, radiance, negative: None },
            );
        }
        let mut goals = Goals::none(2 * CELLS);
        goals.judge(&film, &[[16; 2]; 2 * CELLS], 16, 0.01);
        assert_eq!((goals.of(0, 0), goals.of(CELLS, 0)), (u32::MAX, 16));
    }

    /// The mean of a tile whose samples are rarely bright, 1 in the long run, and which stops by its noise; or where each half stops
    /// by its own.
    fn stopped(next: &mut impl FnMut() -> f32, by_own: bool) -> f64 {
        const MOST: u32 = 256;
        let film = Film::new(4, 4, None).expect("a film");
        let (mut goals, mut done) = (Goals::none(1), [[0; 2]]);
        for target in [16, 32, 64, 128, MOST] {
            for half in 0..2 {
                let goal = goals.of(0, if by_own { 1 - half } else { half }).min(target);
                let samples = goal.saturating_sub(done[0][half]);
                let pixels = Pixels { rect: film.crop(), part: Part::Half(half) };
                let sample = |_| if next() < 0.01 { Vec3::splat(100.0) } else { Vec3::ZERO };
                let radiance = (0..8 * samples).map(sample).collect();
                film.add(0, &TileSamples { pixels, samples, radiance, negative: None });
                done[0][half] += samples;
            }
            goals.judge(&film, &done, target, 0.6);
        }
        film.mean_luminance().expect("samples")
    }

    #[test]
    fn to_stop_by_the_noise_of_the_other_half_is_next_to_no_bias() {
        let mut next = unit(11);
        let mut mean_of = |by_own| {
            const TILES: u32 = 20_000;
            let means: Vec<f64> = (0..TILES).map(|_| stopped(&mut next, by_own)).collect();
            let mean = means.iter().sum::<f64>() / f64::from(TILES);
            let variance = means.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / f64::from(TILES);
            (mean, (variance / f64::from(TILES)).sqrt())
        };
        let (mean, error) = mean_of(false);
        let (own, own_error) = mean_of(true);
        assert!(error.max(own_error) < 0.004, "{error} {own_error}");
        // The noise asked for is 0.6.
        assert!((mean - 1.0).abs() < 0.04 * 0.6, "{mean} ± {error}");
        assert!(own < 0.9, "the samples tell what stops by itself: {own} ± {own_error}");
    }
}
