//! Places samples where they reduce the image's error most, for renders with a time limit.
//!
//! Each half of a cell has its own sample count. A round doubles the samples of some halves, starting with
//! those whose error decreases most per sample. Sample counts are powers of two. With other counts, a pixel's
//! sample points have gaps, and even a third more samples may not reduce the error.
//!
//! Rare bright samples must not attract more samples to their own half, which would make the image too dark.
//! As in [`super::noise_goals`], the noise of one half determines the samples of the other half. The noise is
//! estimated only from as many samples as every half has, because any further samples depend on the noise of
//! the other half.

use crate::film::Film;

/// Minimum number of samples for noise estimates.
const MIN_SAMPLES: u32 = 16;

/// Minimum number of samples per pixel, as a fraction of the mean. Noise is estimated from these samples.
const MIN_SAMPLES_FRACTION: f64 = 1.0 / 8.0;

/// Work done in a round, relative to all earlier work. Noise is measured again before the next round.
const ROUND_WORK_FRACTION: f64 = 0.4;

/// Overhead per sample beyond tracing its rays, expressed as a number of rays.
const SAMPLE_OVERHEAD: f64 = 1.0;

/// Returns the next sample counts for both halves of each cell, based on their current samples and rays. The
/// counts are at most `most`. Returns `None` if it is too early to decide.
pub(crate) fn next_round_goals(
    film: &Film,
    done: &[[u32; 2]],
    rays: &[u64],
    most: u32,
) -> Option<Vec<[u32; 2]>> {
    let least = done.as_flattened().iter().copied().min().filter(|least| *least >= MIN_SAMPLES.min(most))?;
    // Every half has at least this many samples, regardless of earlier goals.
    let known = 1 << least.ilog2();
    let halves = half_cells_with_costs(film, done, rays, known, most)?;
    let pixels: f64 = halves.iter().map(|half| half.pixels).sum();
    let mean = halves.iter().map(|half| half.pixels * f64::from(half.samples)).sum::<f64>() / pixels;
    let work: f64 = halves.iter().map(|half| half.cost_of_samples(half.samples)).sum();
    let mut order: Vec<(f64, &HalfCell)> =
        halves.iter().map(|half| (half.error_reduction_per_cost(mean), half)).collect();
    order.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let (mut goals, mut to_do) = (done.to_vec(), 0.0);
    for (_, half) in order.into_iter().filter(|(_, half)| half.goal > half.samples) {
        if to_do >= ROUND_WORK_FRACTION * work {
            break;
        }
        goals[half.cell][half.half] = half.goal;
        to_do += half.cost_of_samples(half.goal - half.samples);
    }
    Some(goals)
}

/// One half of a cell.
struct HalfCell {
    cell: usize,
    half: usize,
    pixels: f64,
    samples: u32,
    /// Number of samples after the next round.
    goal: u32,
    /// Sum of the squared errors of all pixels with one sample each.
    error: f64,
    /// Exponent p: the squared error is proportional to the number of samples to the power −p.
    power: f64,
    /// Cost of a sample, measured in rays.
    cost: f64,
}

impl HalfCell {
    fn cost_of_samples(&self, samples: u32) -> f64 {
        self.pixels * f64::from(samples) * self.cost
    }

    /// Returns the decrease in squared error per unit of cost. `mean` is the average number of samples.
    fn error_reduction_per_cost(&self, mean: f64) -> f64 {
        if f64::from(self.samples) < MIN_SAMPLES_FRACTION * mean {
            return f64::INFINITY;
        }
        let left = |samples: u32| libm::pow(f64::from(samples), -self.power);
        self.error * (left(self.samples) - left(self.goal))
            / (f64::from((self.goal - self.samples).max(1)) * self.cost)
    }
}

fn half_cells_with_costs(
    film: &Film,
    done: &[[u32; 2]],
    rays: &[u64],
    known: u32,
    most: u32,
) -> Option<Vec<HalfCell>> {
    let mut halves = Vec::with_capacity(2 * done.len());
    for (cell, done) in done.iter().enumerate().filter(|(cell, _)| film.noise_cell_rect(*cell).is_some()) {
        let errors = [0, 1].map(|half| film.cell_half_relmse_and_exponent(cell, half, known));
        let units: f64 = [0, 1]
            .map(|half| film.cell_half_pixel_count(cell, half) as f64 * f64::from(done[half]))
            .iter()
            .sum();
        let cost = SAMPLE_OVERHEAD + rays[cell] as f64 / units;
        for half in 0..2 {
            // A one-pixel cell has no second half.
            let (error, power) = errors[1 - half].or(errors[half])?;
            let error = error * libm::pow(f64::from(known), power);
            let samples = done[half];
            let goal = samples.saturating_add(1).checked_next_power_of_two().unwrap_or(u32::MAX).min(most);
            let pixels = film.cell_half_pixel_count(cell, half) as f64;
            halves.push(HalfCell {
                cell,
                half,
                pixels,
                samples,
                goal: goal.max(samples),
                error,
                power,
                cost,
            });
        }
    }
    Some(halves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{CELLS, PixelSubset, SelectedPixels, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit_generator;

    /// Width and height of a cell.
    const SIDE: u32 = crate::film::CELL_SIZE;

    /// Adds samples to one half of a cell.
    fn add(film: &Film, (cell, half): (usize, usize), samples: u32, mut sample: impl FnMut() -> f32) {
        let rect = film.noise_cell_rect(cell).expect("a cell");
        let pixels = SelectedPixels { rect, part: PixelSubset::Half(half) };
        let radiance = (0..pixels.count() as u32 * samples).map(|_| Vec3::splat(sample())).collect();
        film.add_samples(
            cell / CELLS,
            TileSamples { pixels, samples, radiance, negative: None, layers: Default::default() },
        );
    }

    /// Creates a row of cells. Each half's samples have a mean of about 1 and a spread from `spreads`.
    fn film(spreads: &[[f32; 2]], samples: u32) -> (Film, Vec<[u32; 2]>) {
        let film = Film::new(SIDE * spreads.len() as u32, SIDE, None).expect("a film");
        let mut next = unit_generator(7);
        let mut done = vec![[u32::MAX; 2]; film.noise_cell_count()];
        for (cell, spreads) in cells(&film).into_iter().zip(spreads) {
            done[cell] = [samples; 2];
            for half in 0..2 {
                add(&film, (cell, half), samples, || 1.0 + spreads[half] * (next() - 0.5));
            }
        }
        (film, done)
    }

    /// Returns the cells that have pixels, from left to right.
    fn cells(film: &Film) -> Vec<usize> {
        (0..film.noise_cell_count()).filter(|cell| film.noise_cell_rect(*cell).is_some()).collect()
    }

    /// Returns the goals for the next round, for the film's cells from left to right.
    fn round(film: &Film, done: &[[u32; 2]], most: u32) -> Option<Vec<[u32; 2]>> {
        let goals = next_round_goals(film, done, &vec![0; done.len()], most)?;
        Some(cells(film).into_iter().map(|cell| goals[cell]).collect())
    }

    #[test]
    fn priority_depends_on_noise_of_other_half() {
        let (film, done) = film(&[[0.2; 2], [1.0, 0.05], [0.2; 2]], 16);
        assert_eq!(round(&film, &done, 1000).expect("a round")[1], [16, 32]);
        assert_eq!(round(&film, &done, 20).expect("a round")[1][1], 20, "at most the requested samples");
    }

    #[test]
    fn round_size_is_a_fraction_of_earlier_work() {
        let (film, done) = film(&[[1.0; 2]; 8], 32);
        let goals = round(&film, &done, 1000).expect("a round");
        let more: u32 = goals.as_flattened().iter().map(|goal| goal - 32).sum();
        assert_eq!(more, 7 * 32, "seven of sixteen halves should be doubled");
    }

    #[test]
    fn cells_with_few_samples_have_priority() {
        let (film, mut done) = film(&[[0.0; 2], [1.0; 2], [1.0; 2]], 16);
        for &cell in &cells(&film)[1..] {
            for half in 0..2 {
                add(&film, (cell, half), 496, || 1.0);
                done[cell][half] = 512;
            }
        }
        assert_eq!(round(&film, &done, 10_000).expect("a round")[0], [32; 2]);
    }

    #[test]
    fn cheaper_cells_have_priority_at_equal_noise() {
        let (film, done) = film(&[[1.0; 2]; 2], 16);
        let expensive = cells(&film)[0];
        let rays: Vec<u64> =
            (0..done.len()).map(|cell| if cell == expensive { 100_000 } else { 10_000 }).collect();
        let goals = next_round_goals(&film, &done, &rays, 1000).expect("a round");
        assert_eq!(cells(&film).into_iter().map(|cell| goals[cell]).collect::<Vec<_>>()[1], [32; 2]);
    }

    #[test]
    fn round_requires_minimum_samples() {
        let (film, done) = film(&[[1.0; 2]; 2], 8);
        assert_eq!(round(&film, &done, 1000), None);
        let (film, done) = self::film(&[[1.0; 2]; 2], 16);
        assert_eq!(
            round(&film, &done, 16),
            Some(vec![[16; 2]; 2]),
            "the goals should equal the current samples"
        );
    }

    /// Returns the mean over many cells with rare bright samples and an expected value of 1. Runs a few
    /// rounds with priorities based on the noise of the other half, or of the same half if `by_own`. With
    /// only a few cells, giving samples to one cell would noticeably reduce the samples in the other cells.
    fn rendered(next: &mut impl FnMut() -> f32, by_own: bool) -> f64 {
        const CHANCE: f64 = 0.002;
        let film = Film::new(64 * SIDE, 1, None).expect("a film");
        // Draw the number of dark samples before the next bright one, instead of one Bernoulli trial per
        // sample.
        let mut gap = || (f64::from(1.0 - next()).ln() / (1.0 - CHANCE).ln()) as usize;
        let mut left = gap();
        let mut sample = || {
            let is_bright = left == 0;
            left = if is_bright { gap() } else { left - 1 };
            if is_bright { 500.0 } else { 0.0 }
        };
        let mut done = vec![[u32::MAX; 2]; film.noise_cell_count()];
        let places: Vec<_> = cells(&film).into_iter().flat_map(|cell| [(cell, 0), (cell, 1)]).collect();
        for &(cell, half) in &places {
            add(&film, (cell, half), 16, &mut sample);
            done[cell][half] = 16;
        }
        let rays = vec![0; done.len()];
        for _ in 0..6 {
            let goals = next_round_goals(&film, &done, &rays, 1 << 20).expect("a round");
            let before = done.clone();
            for &(cell, half) in &places {
                let of = if by_own { 1 - half } else { half };
                // Scale the sample count by the other half's ratio, because the halves may differ.
                let samples = before[cell][half] * (goals[cell][of] / before[cell][of] - 1);
                add(&film, (cell, half), samples, &mut sample);
                done[cell][half] += samples;
            }
        }
        film.mean_luminance().expect("samples")
    }

    #[test]
    fn placement_based_on_other_half_is_unbiased() {
        let mut next = unit_generator(13);
        let mut mean_of = |by_own| {
            const RENDERS: u32 = 1500;
            let means: Vec<f64> = (0..RENDERS).map(|_| rendered(&mut next, by_own)).collect();
            let mean = means.iter().sum::<f64>() / f64::from(RENDERS);
            let variance = means.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / f64::from(RENDERS);
            (mean, (variance / f64::from(RENDERS)).sqrt())
        };
        let (mean, error) = mean_of(false);
        let (own, own_error) = mean_of(true);
        assert!(error.max(own_error) < 0.006, "{error} {own_error}");
        assert!((mean - 1.0).abs() < 0.02, "{mean} ± {error}");
        assert!(own < 0.95, "placement based on a half's own noise should be biased: {own} ± {own_error}");
    }
}
