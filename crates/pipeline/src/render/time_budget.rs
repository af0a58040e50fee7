//! Placement of samples under a budget of time: where they lower the error of the picture most.
//!
//! The parts of a picture are the two halves of each cell. A round doubles the samples of parts, beginning with those whose error
//! falls most for each sample. Between powers of two the points of a pixel leave gaps: there a third more samples may be worth nothing.
//!
//! Rare bright samples must not bring more samples to the place where they were met: the picture would be too dark. As in
//! [`super::noise_goals`], one half goes by the noise of the other half, estimated from the samples alone that every half has: how
//! many more the other half has depends on the first half's noise.

use crate::film::Film;

/// Samples before which noise is not asked for.
const LEAST: u32 = 16;

/// The part of the mean number of samples that every pixel has: these tell of its noise.
const SHARE: f64 = 1.0 / 8.0;

/// Work of a round before noise is measured again, as a part of the work before.
const ROUND: f64 = 0.4;

/// Cost of a sample beside its rays, in rays.
const BESIDE: f64 = 1.0;

/// Samples that the halves of each cell are to have next, at most `most`, by their samples so far and the rays of these. `None`
/// while it is too early to tell.
pub(crate) fn next_round(film: &Film, done: &[[u32; 2]], rays: &[u64], most: u32) -> Option<Vec<[u32; 2]>> {
    let least = done.as_flattened().iter().copied().min().filter(|least| *least >= LEAST.min(most))?;
    // Every half has had these, whatever the goals were.
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
    /// Samples that it is to have next.
    goal: u32,
    /// Sum of the squared errors of its pixels, each with one sample.
    error: f64,
    /// Exponent p: the error falls with the number of samples to the power −p.
    power: f64,
    /// Cost of a sample, in rays.
    cost: f64,
}

impl Half {
    fn work(&self, samples: u32) -> f64 {
        self.pixels * f64::from(samples) * self.cost
    }

    /// Fall of the sum of squared errors per cost of a sample, if pixels have `mean` samples on average.
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

    /// Columns and rows of a cell.
    const SIDE: u32 = crate::film::CELL_SIZE;

    /// Add samples to a half of a cell.
    fn add(film: &Film, (cell, half): (usize, usize), samples: u32, mut sample: impl FnMut() -> f32) {
        let rect = film.cell_rect(cell).expect("a cell");
        let pixels = Pixels { rect, part: PixelSubset::Half(half) };
        let radiance = (0..pixels.count() as u32 * samples).map(|_| Vec3::splat(sample())).collect();
        film.add(cell / CELLS, &TileSamples { pixels, samples, radiance, negative: None });
    }

    /// Some cells in a row, of whose halves each has samples around 1 of a spread.
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

    /// Numbers of the cells that have pixels, from left to right.
    fn cells(film: &Film) -> Vec<usize> {
        (0..film.cell_count()).filter(|cell| film.cell_rect(*cell).is_some()).collect()
    }

    /// Goals of the next round of those.
    fn round(film: &Film, done: &[[u32; 2]], most: u32) -> Option<Vec<[u32; 2]>> {
        let goals = next_round(film, done, &vec![0; done.len()], most)?;
        Some(cells(film).into_iter().map(|cell| goals[cell]).collect())
    }

    #[test]
    fn what_is_noisy_comes_first_by_the_noise_of_the_other_half() {
        let (film, done) = film(&[[0.2; 2], [1.0, 0.05], [0.2; 2]], 16);
        assert_eq!(round(&film, &done, 1000).expect("a round")[1], [16, 32]);
        assert_eq!(round(&film, &done, 20).expect("a round")[1][1], 20, "no more than asked for");
    }

    #[test]
    fn a_round_is_a_part_of_what_was_done() {
        let (film, done) = film(&[[1.0; 2]; 8], 32);
        let goals = round(&film, &done, 1000).expect("a round");
        let more: u32 = goals.as_flattened().iter().map(|goal| goal - 32).sum();
        assert_eq!(more, 7 * 32, "seven of sixteen halves twice as many");
    }

    #[test]
    fn what_has_few_samples_comes_first_though_it_has_no_noise() {
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
    fn of_two_that_are_as_noisy_the_cheaper_one_comes_first() {
        let (film, done) = film(&[[1.0; 2]; 2], 16);
        let dear = cells(&film)[0];
        let rays: Vec<u64> =
            (0..done.len()).map(|cell| if cell == dear { 100_000 } else { 10_000 }).collect();
        let goals = next_round(&film, &done, &rays, 1000).expect("a round");
        assert_eq!(cells(&film).into_iter().map(|cell| goals[cell]).collect::<Vec<_>>()[1], [32; 2]);
    }

    #[test]
    fn nothing_is_told_before_there_are_samples_enough() {
        let (film, done) = film(&[[1.0; 2]; 2], 8);
        assert_eq!(round(&film, &done, 1000), None);
        let (film, done) = self::film(&[[1.0; 2]; 2], 16);
        assert_eq!(round(&film, &done, 16), Some(vec![[16; 2]; 2]), "all is done");
    }

    /// The mean of many cells of rare bright samples, 1 in the long run, after some rounds; or where each half goes by its own noise.
    /// With few cells, samples that one gets would be missing in the others.
    fn rendered(next: &mut impl FnMut() -> f32, by_own: bool) -> f64 {
        const CHANCE: f64 = 0.002;
        let film = Film::new(64 * SIDE, 1, None).expect("a film");
        // The number of dark samples before a bright one has the distribution of Bernoulli trials, without a draw for each of them.
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
                // As many times more, as the halves do not go together then.
                let samples = before[cell][half] * (goals[cell][of] / before[cell][of] - 1);
                add(&film, (cell, half), samples, &mut sample);
                done[cell][half] += samples;
            }
        }
        film.mean_luminance().expect("samples")
    }

    #[test]
    fn samples_that_go_by_the_noise_of_the_other_half_keep_the_mean() {
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
        assert!(own < 0.95, "the samples tell what goes by itself: {own} ± {own_error}");
    }
}
