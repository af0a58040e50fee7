//! Placement of samples within a time limit, where they reduce the error of the image most.
//!
//! The units are the two halves of each cell. A round doubles the samples of halves, starting with those whose error
//! decreases most per sample. Between powers of two the sample points of a pixel have gaps, where a third more samples
//! may be worth nothing.
//!
//! Rare bright samples must not attract more samples to where they occur, which would make the image too dark. As in
//! [`super::noise_goals`], one half follows the noise of the other half, estimated only from the samples that every
//! half has, because any further samples of the other half depend on the first half's noise.

use crate::film::Film;

/// Minimum number of samples for noise estimates.
const LEAST: u32 = 16;

/// Fraction of the mean number of samples that every pixel gets, for estimating its noise.
const SHARE: f64 = 1.0 / 8.0;

/// Work of a round before noise is measured again, relative to all earlier work.
const ROUND: f64 = 0.4;

/// Cost of a sample apart from its rays, in rays.
const BESIDE: f64 = 1.0;

/// Returns the next samples of the halves of each cell, at most `most`, from their current samples and rays. Returns
/// `None` while it is too early to decide.
pub(crate) fn next_round(film: &Film, done: &[[u32; 2]], rays: &[u64], most: u32) -> Option<Vec<[u32; 2]>> {
    let least = done.as_flattened().iter().copied().min().filter(|least| *least >= LEAST.min(most))?;
    // Every half has at least these samples, whatever the goals were.
    let known = 1 << least.ilog2();
    let halves = halves(film, done, rays, (known, most))?;
    let pixels: f64 = halves.iter().map(|half| half.pixels).sum();
    let mean = halves.iter().map(|half| half.pixels * f64::from(half.samples)).sum::<f64>() / pixels;
    let work: f64 = halves.iter().map(|half| half.work(half.samples)).sum();
    let mut order: Vec<(f64, &Half)> = halves.iter().map(|half| (half.urgency(mean), half)).collect();
    order.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let (mut goals, mut to_do) = (done.to_vec(), 0.0);
    for (_, half) in order.into_iter().filter(|(_, half)| half.goal > half.samples) {
        if to_do >= ROUND * work {
            break;
        }
        goals[half.cell][half.half] = half.goal;
        to_do += half.work(half.goal - half.samples);
    }
    Some(goals)
}

/// Half of a cell.
struct Half {
    cell: usize,
    half: usize,
    pixels: f64,
    samples: u32,
    /// Next number of samples.
    goal: u32,
    /// Sum of the squared errors of its pixels with one sample each.
    error: f64,
    /// Exponent p: the error decreases with the number of samples to the power −p.
    power: f64,
    /// Cost of a sample in rays.
    cost: f64,
}

impl Half {
    fn work(&self, samples: u32) -> f64 {
        self.pixels * f64::from(samples) * self.cost
    }

    /// Returns the decrease of the sum of squared errors per cost of a sample. `mean` is the average number of samples.
    fn urgency(&self, mean: f64) -> f64 {
        if f64::from(self.samples) < SHARE * mean {
            return f64::INFINITY;
        }
        let left = |samples: u32| libm::pow(f64::from(samples), -self.power);
        self.error * (left(self.samples) - left(self.goal))
            / (f64::from((self.goal - self.samples).max(1)) * self.cost)
    }
}

fn halves(film: &Film, done: &[[u32; 2]], rays: &[u64], (known, most): (u32, u32)) -> Option<Vec<Half>> {
    let mut halves = Vec::with_capacity(2 * done.len());
    for (cell, done) in done.iter().enumerate().filter(|(cell, _)| film.cell_rect(*cell).is_some()) {
        let errors = [0, 1].map(|half| film.half_error(cell, half, known));
        let units: f64 =
            [0, 1].map(|half| film.half_pixel_count(cell, half) as f64 * f64::from(done[half])).iter().sum();
        let cost = BESIDE + rays[cell] as f64 / units;
        for half in 0..2 {
            // A cell of one pixel has no other half.
            let (error, power) = errors[1 - half].or(errors[half])?;
            let error = error * libm::pow(f64::from(known), power);
            let samples = done[half];
            let goal = samples.saturating_add(1).checked_next_power_of_two().unwrap_or(u32::MAX).min(most);
            let pixels = film.half_pixel_count(cell, half) as f64;
            halves.push(Half { cell, half, pixels, samples, goal: goal.max(samples), error, power, cost });
        }
    }
    Some(halves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{CELLS, PixelSubset, Pixels, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit;

    /// Width and height of a cell.
    const SIDE: u32 = crate::film::CELL_SIZE;

    /// Adds samples to a half of a cell.
    fn add(film: &Film, (cell, half): (usize, usize), samples: u32, mut sample: impl FnMut() -> f32) {
        let rect = film.cell_rect(cell).expect("a cell");
        let pixels = Pixels { rect, part: PixelSubset::Half(half) };
        let radiance = (0..pixels.count() as u32 * samples).map(|_| Vec3::splat(sample())).collect();
        film.add(cell / CELLS, &TileSamples { pixels, samples, radiance, negative: None });
    }

    /// Creates a row of cells whose halves have samples around 1 with a given spread.
    fn film(spreads: &[[f32; 2]], samples: u32) -> (Film, Vec<[u32; 2]>) {
        let film = Film::new(SIDE * spreads.len() as u32, SIDE, None).expect("a film");
        let mut next = unit(7);
        let mut done = vec![[u32::MAX; 2]; film.cell_count()];
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
        (0..film.cell_count()).filter(|cell| film.cell_rect(*cell).is_some()).collect()
    }

    /// Returns the goals of the next round for these cells.
    fn round(film: &Film, done: &[[u32; 2]], most: u32) -> Option<Vec<[u32; 2]>> {
        let goals = next_round(film, done, &vec![0; done.len()], most)?;
        Some(cells(film).into_iter().map(|cell| goals[cell]).collect())
    }

    #[test]
    fn noise_of_the_other_half_decides_the_order() {
        let (film, done) = film(&[[0.2; 2], [1.0, 0.05], [0.2; 2]], 16);
        assert_eq!(round(&film, &done, 1000).expect("a round")[1], [16, 32]);
        assert_eq!(round(&film, &done, 20).expect("a round")[1][1], 20, "at most the requested samples");
    }

    #[test]
    fn round_is_a_fraction_of_earlier_work() {
        let (film, done) = film(&[[1.0; 2]; 8], 32);
        let goals = round(&film, &done, 1000).expect("a round");
        let more: u32 = goals.as_flattened().iter().map(|goal| goal - 32).sum();
        assert_eq!(more, 7 * 32, "seven of sixteen halves are doubled");
    }

    #[test]
    fn cells_with_few_samples_come_first() {
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
    fn cheaper_of_equally_noisy_cells_comes_first() {
        let (film, done) = film(&[[1.0; 2]; 2], 16);
        let expensive = cells(&film)[0];
        let rays: Vec<u64> =
            (0..done.len()).map(|cell| if cell == expensive { 100_000 } else { 10_000 }).collect();
        let goals = next_round(&film, &done, &rays, 1000).expect("a round");
        assert_eq!(cells(&film).into_iter().map(|cell| goals[cell]).collect::<Vec<_>>()[1], [32; 2]);
    }

    #[test]
    fn no_round_without_enough_samples() {
        let (film, done) = film(&[[1.0; 2]; 2], 8);
        assert_eq!(round(&film, &done, 1000), None);
        let (film, done) = self::film(&[[1.0; 2]; 2], 16);
        assert_eq!(round(&film, &done, 16), Some(vec![[16; 2]; 2]), "all samples are done");
    }

    /// Returns the mean of many cells with rare bright samples, whose expected value is 1, after some rounds that
    /// follow the noise of the other half or of the same half (`by_own`). With few cells, samples that one gets would
    /// be missing in the others.
    fn rendered(next: &mut impl FnMut() -> f32, by_own: bool) -> f64 {
        const CHANCE: f64 = 0.002;
        let film = Film::new(64 * SIDE, 1, None).expect("a film");
        // Sample the number of dark samples before a bright one directly, instead of one Bernoulli trial per sample.
        let mut gap = || (f64::from(1.0 - next()).ln() / (1.0 - CHANCE).ln()) as usize;
        let mut left = gap();
        let mut sample = || {
            let is_bright = left == 0;
            left = if is_bright { gap() } else { left - 1 };
            if is_bright { 500.0 } else { 0.0 }
        };
        let mut done = vec![[u32::MAX; 2]; film.cell_count()];
        let places: Vec<_> = cells(&film).into_iter().flat_map(|cell| [(cell, 0), (cell, 1)]).collect();
        for &(cell, half) in &places {
            add(&film, (cell, half), 16, &mut sample);
            done[cell][half] = 16;
        }
        let rays = vec![0; done.len()];
        for _ in 0..6 {
            let goals = next_round(&film, &done, &rays, 1 << 20).expect("a round");
            let before = done.clone();
            for &(cell, half) in &places {
                let of = if by_own { 1 - half } else { half };
                // Multiply the samples, because the halves differ in this mode.
                let samples = before[cell][half] * (goals[cell][of] / before[cell][of] - 1);
                add(&film, (cell, half), samples, &mut sample);
                done[cell][half] += samples;
            }
        }
        film.mean_luminance().expect("samples")
    }

    #[test]
    fn placement_by_the_other_half_is_unbiased() {
        let mut next = unit(13);
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
        assert!(own < 0.95, "following its own noise is biased: {own} ± {own_error}");
    }
}
