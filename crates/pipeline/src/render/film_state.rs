//! A film with its cache key and render progress.

use std::cmp::Reverse;
use std::ops::Range;
use std::sync::Arc;

use super::forecast::cost::{CellCost, JobCost, PixelShare};
use super::forecast::samples::ExpectedSamples;
use crate::film::{
    CELLS, Convergence, Film, FilmError, PixelSubset, Pixels, Previewer, RadianceImage, Rect, SumOrder,
};
use crate::integrators::RayCounters;
use crate::output::part::Dependency;
use crate::plan::Plan;
use crate::render::noise_goals::Goals;
use crate::render::share::Share;
use crate::scene::fingerprint::Key;
use crate::trace::{Cost, Job};

/// A film with its cache key and render progress.
#[derive(Debug)]
pub(crate) struct FilmState {
    pub(crate) key: Key,
    /// Number of the film in its cache.
    pub(crate) number: u64,
    pub(crate) film: Arc<Film>,
    /// Samples of both halves of each cell. [`u32::MAX`] for cells that get none.
    pub(crate) done: Vec<[u32; 2]>,
    /// Rays of each cell.
    pub(crate) rays: Vec<u64>,
    /// CPU seconds of all rays.
    pub(super) seconds: f64,
    /// Recent cost of the samples in each cell.
    costs: Vec<CellCost>,
    /// Cost of a pixel in a job, apart from its samples.
    pixel_share: PixelShare,
    /// Maximum samples of both halves of each cell.
    pub(crate) goals: Goals,
    /// Expected samples of halves without a goal.
    expected: ExpectedSamples,
    /// First image at the size of the preview, shown for pixels without samples.
    pub(crate) base: Option<RadianceImage>,
    /// The previewer of the last preview.
    pub(crate) previewer: Option<Previewer>,
    /// Whether the render began while the camera was moving.
    pub(crate) is_passing: bool,
    /// The time limit that ended the last render.
    pub(crate) ended_by: Option<f64>,
    /// Render time of all requests in seconds.
    pub(crate) render_seconds: f64,
    /// The share of the image that is rendered. `None` for the whole image.
    pub(crate) share: Option<Share>,
    /// Which tiles belong to the share. `None` for all tiles.
    own: Option<Vec<bool>>,
    /// Work of the process whose checkpoint this render continues.
    pub(crate) before: Before,
    /// Rays of all requests and of the process whose checkpoint this render continues.
    pub(crate) traced: RayCounters,
    /// Whether a checkpoint contains all samples.
    pub(crate) is_kept: bool,
    /// Names and values of everything that the image depends on. `None` until first needed.
    pub(crate) identity: Option<Vec<Dependency>>,
    /// Whether the film was read from a finished part.
    pub(crate) is_finished_part: bool,
}

/// Work of an earlier process.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Before {
    /// Rays and texture lookups.
    pub(crate) rays: RayCounters,
    /// Seconds of the render stage.
    pub(crate) seconds: f64,
}

impl FilmState {
    /// Creates a state without samples. The film may use `most_bytes`.
    ///
    /// # Errors
    /// Not enough memory for the film.
    pub(crate) fn new(
        key: Key,
        plan: &Plan,
        most_bytes: u64,
        convergence: Convergence,
        share: Option<Share>,
    ) -> Result<Self, FilmError> {
        let blocks = match (&share, convergence) {
            (Some(share), _) => share.sums(),
            (None, Convergence::Photons) => SumOrder::Blocked,
            (None, Convergence::Stratified) => SumOrder::Sequential,
        };
        let film =
            Film::within(most_bytes, plan.settings.render.width, plan.settings.render.height, plan.crop)?
                .with_convergence(convergence)
                .with_sum_order(blocks)?;
        let film_cells = film.cell_count();
        let goals = Goals::none(film_cells);
        let own = share.as_ref().map(|share| share.tiles(film.tile_count()));
        let is_own = |cell: usize| own.as_ref().is_none_or(|own| own[cell / CELLS]);
        let none = |cell| if film.cell_rect(cell).is_some() && is_own(cell) { [0; 2] } else { [u32::MAX; 2] };
        let done = (0..film.cell_count()).map(none).collect();
        Ok(Self {
            key,
            number: 0,
            film: Arc::new(film),
            rays: vec![0; film_cells],
            seconds: 0.0,
            costs: vec![CellCost::default(); film_cells],
            pixel_share: PixelShare::default(),
            done,
            goals,
            expected: ExpectedSamples::unknown(film_cells),
            base: None,
            previewer: None,
            is_passing: false,
            ended_by: None,
            render_seconds: 0.0,
            share,
            own,
            before: Before::default(),
            traced: RayCounters::default(),
            is_kept: false,
            identity: None,
            is_finished_part: false,
        })
    }

    /// Whether this process renders a tile.
    fn is_own(&self, tile: usize) -> bool {
        self.own.as_ref().is_none_or(|own| own[tile])
    }

    /// Returns the sample indices in the whole image of the first of these samples that are consecutive there.
    pub(crate) fn numbers(&self, samples: Range<u32>) -> Range<u32> {
        match &self.share {
            Some(share) => share.numbers(samples),
            None => samples,
        }
    }

    /// Returns goals equal to the samples of this film.
    pub(super) fn goals_of_what_is_done(&self) -> Goals {
        Goals { decided: self.done.clone(), ..Goals::none(self.done.len()) }
    }

    /// Updates the sample counts from the film.
    pub(super) fn count_again(&mut self) {
        let halves: Vec<_> = self.halves().collect();
        for (cell, half) in halves {
            self.done[cell][half] = self.film.half_samples(cell, half);
        }
    }

    /// Whether every pixel has this many samples or has reached its goal.
    pub(crate) fn is_complete(&self, samples: u32) -> bool {
        self.is_complete_in(None, samples)
    }

    /// Whether every pixel in the tiles of `part` has this many samples or has reached its goal. `None` for all tiles.
    pub(crate) fn is_complete_in(&self, part: Option<Rect>, samples: u32) -> bool {
        self.halves()
            .filter(|(cell, _)| self.is_in(part, *cell))
            .all(|(tile, half)| self.done[tile][half] >= self.goals.of(tile, half).min(samples))
    }

    /// Whether a plan's image is finished: all samples are done or the time limit was reached.
    pub(crate) fn is_finished(&self, plan: &Plan) -> bool {
        let is_over_time = plan.time_seconds.is_some() && self.ended_by == plan.time_seconds;
        self.is_finished_part || is_over_time || self.is_complete(plan.settings.render.samples)
    }

    /// Whether no pixel has more than this many samples.
    pub(crate) fn has_at_most(&self, samples: u32) -> bool {
        self.halves().all(|(cell, half)| self.done[cell][half] <= samples)
    }

    /// Returns the smallest number of samples of a pixel that needs more, at most `most`.
    pub(crate) fn samples(&self, most: u32) -> u32 {
        self.samples_in(None, most)
    }

    /// Like [`Self::samples`], in the tiles of `part`. `None` for all tiles.
    pub(crate) fn samples_in(&self, part: Option<Rect>, most: u32) -> u32 {
        let of = |(tile, half): (usize, usize)| {
            let done = self.done[tile][half];
            (done < self.goals.of(tile, half).min(most)).then_some(done)
        };
        self.halves().filter(|(cell, _)| self.is_in(part, *cell)).filter_map(of).min().unwrap_or(most)
    }

    /// Whether the tile of a cell overlaps `part`.
    fn is_in(&self, part: Option<Rect>, cell: usize) -> bool {
        part.is_none_or(|part| {
            self.film.tile_rect(cell / CELLS).is_some_and(|rect| rect.intersection(&part).is_some())
        })
    }

    /// Whether any pixel has samples.
    pub(crate) fn is_begun(&self) -> bool {
        self.halves().any(|(cell, half)| self.done[cell][half] > 0)
    }

    /// Whether every pixel has a sample, so that the image may replace another one.
    pub(crate) fn is_covered(&self) -> bool {
        self.halves().all(|(cell, half)| self.done[cell][half] > 0)
    }

    fn halves(&self) -> impl Iterator<Item = (usize, usize)> {
        let halves = (0..self.done.len()).flat_map(|cell| [(cell, 0), (cell, 1)]);
        halves
            .filter(|(cell, half)| self.is_own(cell / CELLS) && self.film.half_pixel_count(*cell, *half) > 0)
    }

    /// Returns the memory size in bytes.
    pub(crate) fn memory_bytes(&self) -> u64 {
        let base = self.base.as_ref().map_or(0, |base| size_of_val(base.pixels.as_slice()) as u64);
        let cells = size_of_val(self.done.as_slice())
            + size_of_val(self.rays.as_slice())
            + size_of_val(self.costs.as_slice())
            + self.goals.memory_bytes()
            + self.expected.memory_bytes();
        self.film.memory_bytes()
            + cells as u64
            + base
            + self.previewer.as_ref().map_or(0, Previewer::memory_bytes)
    }

    /// Returns the jobs that bring both halves of every cell in `part` (`None` for all) to `target` or their goals.
    /// Tiles whose cells need the same samples are one job. Jobs are in the order of the film.
    pub(crate) fn jobs(&self, part: Option<Rect>, target: impl Fn(usize, usize) -> u32) -> Vec<Job> {
        let missing = |cell: usize, half: usize| {
            self.done[cell][half]..self.goals.of(cell, half).min(target(cell, half))
        };
        let mut jobs = Vec::new();
        let is_wanted = |tile: &&usize| self.is_own(**tile) && self.is_in(part, CELLS * **tile);
        for &tile in self.film.tile_order().iter().filter(is_wanted) {
            let cells = (CELLS * tile..CELLS * (tile + 1))
                .filter_map(|cell| Some((cell, self.film.cell_rect(cell)?)));
            let cells = cells.map(|(cell, rect)| (rect, [0, 1].map(|half| missing(cell, half))));
            let cells: Vec<(Rect, [Range<u32>; 2])> = cells.collect();
            let job = |pixels, samples: &Range<u32>| Job { tile, pixels, samples: samples.clone() };
            if let Some((rect, samples)) = self.film.tile_rect(tile).zip(common(&cells)) {
                jobs.push(job(rect.into(), samples));
                continue;
            }
            for (rect, halves) in cells {
                match &halves {
                    [first, other] if first == other => jobs.push(job(rect.into(), first)),
                    halves => jobs.extend(
                        (0..2).map(|half| job(Pixels { rect, part: PixelSubset::Half(half) }, &halves[half])),
                    ),
                }
            }
        }
        jobs.retain(|job| !job.samples.is_empty());
        // Run the longest jobs first, so that all threads end at about the same time.
        jobs.sort_by_key(|job| Reverse(job.samples.len()));
        jobs
    }

    /// Records a finished job and its cost. Returns its pixels times samples.
    pub(crate) fn note(&mut self, job: &Job, cost: &Cost) -> u64 {
        let (rays, seconds) = (cost.rays.all(), cost.seconds / job.pixels.rect.area() as f64);
        for cell in CELLS * job.tile..CELLS * (job.tile + 1) {
            let rect = self.film.cell_rect(cell);
            if let Some(rect) = rect.filter(|rect| rect.intersection(&job.pixels.rect) == Some(*rect)) {
                self.rays[cell] += rays * rect.area() as u64 / job.pixels.rect.area() as u64;
                let seconds = seconds * rect.area() as f64;
                self.seconds += seconds;
                let (pixels, samples) = (job.pixels.part.count(rect.area()) as f64, job.samples.len() as f64);
                self.costs[cell].note(JobCost { seconds, pixels, samples }, &mut self.pixel_share);
                match job.pixels.part {
                    PixelSubset::All => self.done[cell] = [job.samples.end; 2],
                    PixelSubset::Half(half) => self.done[cell][half] = job.samples.end,
                }
            }
        }
        job.pixel_count() * job.samples.len() as u64
    }

    /// Decides which tiles have enough samples, among those with `samples`, a power of two.
    pub(crate) fn judge(&mut self, samples: u32, error: f64) {
        if let Some(judgement) = self.goals.judge(&self.film, &self.done, samples, error) {
            self.expected.predict(&judgement, &self.goals, &self.done);
        }
    }

    /// Returns the number of tiles that reached the sample limit above the noise target, and the noise of the worst.
    pub(crate) fn missed(&self, error: f64) -> Option<(usize, f64)> {
        self.goals.missed(&self.film, error)
    }

    /// Returns the pixels times samples rendered so far.
    pub(crate) fn units(&self) -> u64 {
        self.units_of(|tile, half| self.done[tile][half])
    }

    /// Returns the expected total of pixels times samples, with at most `most` samples.
    pub(crate) fn units_to_come(&self, most: u32) -> u64 {
        self.units_of(|cell, half| self.to_come(cell, half, most))
    }

    /// Returns the CPU seconds spent so far.
    pub(crate) fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Returns the expected CPU seconds of the remaining samples, up to `most`. `jobs` returns the number of jobs
    /// between two sample counts. A sample costs as much as recent ones in its cell, or the mean in cells without
    /// samples.
    pub(crate) fn seconds_to_come(&self, most: u32, jobs: impl Fn(u32, u32) -> u32) -> f64 {
        let (mut seconds, mut known, mut worth, mut others) = (0.0, 0.0, 0.0, 0.0);
        let is_there = |cell: &usize| self.is_own(cell / CELLS) && self.film.cell_rect(*cell).is_some();
        for cell in (0..self.done.len()).filter(is_there) {
            let lacks = |half: usize| {
                let (done, end) = (self.done[cell][half], self.to_come(cell, half, most));
                let pixels = self.film.half_pixel_count(cell, half) as f64;
                let samples = pixels * f64::from(end.saturating_sub(done));
                self.pixel_share.worth(samples, pixels * f64::from(jobs(done, end)))
            };
            let (lacking, cost) = (lacks(0) + lacks(1), &self.costs[cell]);
            if cost.is_unknown() {
                others += lacking;
                continue;
            }
            let of_cell = cost.worth(self.pixel_share);
            seconds += lacking * cost.seconds() / of_cell;
            known += cost.seconds();
            worth += of_cell;
        }
        // Without measurements, all samples cost the same.
        seconds + others * if worth > 0.0 { known / worth } else { 1.0 }
    }

    /// Returns the current and the expected final samples of the pixel with most samples, which are also the numbers of
    /// photon passes.
    pub(crate) fn passes(&self, most: u32) -> [u32; 2] {
        let most_of = |samples: &dyn Fn(usize, usize) -> u32| {
            self.halves().map(|(cell, half)| samples(cell, half)).max().unwrap_or(0)
        };
        [most_of(&|cell, half| self.done[cell][half]), most_of(&|cell, half| self.to_come(cell, half, most))]
    }

    /// Whether the final number of samples can be estimated if noise ends the render.
    pub(crate) fn is_foreseen(&self) -> bool {
        self.halves().all(|(cell, half)| self.to_come(cell, half, u32::MAX) < u32::MAX)
    }

    fn to_come(&self, cell: usize, half: usize, most: u32) -> u32 {
        let (goal, expected) = (self.goals.of(cell, half), self.expected.of(cell, half));
        (if goal < u32::MAX { goal } else { expected }).min(most)
    }

    fn units_of(&self, samples_of: impl Fn(usize, usize) -> u32) -> u64 {
        let units = |(cell, half): (usize, usize)| {
            self.film.half_pixel_count(cell, half) as u64 * u64::from(samples_of(cell, half))
        };
        self.halves().map(units).sum()
    }
}

/// Returns the samples that all halves of all cells need, if they are equal.
fn common(cells: &[(Rect, [Range<u32>; 2])]) -> Option<&Range<u32>> {
    let (_, [first, _]) = cells.first()?;
    cells.iter().all(|(_, halves)| halves.iter().all(|half| half == first)).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::TileSamples;
    use crate::math::Vec3;
    use crate::scene::fingerprint::Fingerprint;

    /// Creates a film of two tiles.
    fn state() -> FilmState {
        let film = Film::new(64, 32, None).expect("a film");
        let cells = film.cell_count();
        FilmState {
            key: Fingerprint::new("test").finish(),
            number: 0,
            film: Arc::new(film),
            done: vec![[0; 2]; cells],
            rays: vec![0; cells],
            seconds: 0.0,
            costs: vec![CellCost::default(); cells],
            pixel_share: PixelShare::default(),
            goals: Goals::none(cells),
            expected: ExpectedSamples::unknown(cells),
            base: None,
            previewer: None,
            is_passing: false,
            ended_by: None,
            render_seconds: 0.0,
            share: None,
            own: None,
            before: Before::default(),
            traced: RayCounters::default(),
            is_kept: false,
            identity: None,
            is_finished_part: false,
        }
    }

    fn in_one(done: u32, end: u32) -> u32 {
        u32::from(done < end)
    }

    /// Adds samples to a tile that took this long.
    fn note(state: &mut FilmState, tile: usize, samples: Range<u32>, seconds: f64) {
        let pixels = Pixels::from(state.film.tile_rect(tile).expect("a tile"));
        let count = samples.end - samples.start;
        let radiance = (0..pixels.count() as u32 * count).map(|i| Vec3::splat((i % 7) as f32)).collect();
        state.film.add(tile, &TileSamples { pixels, samples: count, radiance, negative: None });
        let job = Job { tile, pixels, samples };
        state.note(&job, &Cost { rays: RayCounters::default(), seconds });
    }

    #[test]
    fn remaining_samples_cost_as_before_per_tile() {
        let mut state = state();
        let mut noted = |tile: usize, samples: Range<u32>, seconds: f64| {
            note(&mut state, tile, samples, seconds);
            [state.seconds(), state.seconds_to_come(8, in_one)].map(|seconds| (seconds * 1e6).round() * 1e-6)
        };
        // The second tile is unknown, so it is assumed to cost as much as the first.
        assert_eq!(noted(0, 0..4, 1.0), [1.0, 3.0]);
        assert_eq!(noted(1, 0..2, 10.0), [11.0, 31.0]);
        assert_eq!(noted(1, 2..8, 30.0), [41.0, 1.0]);
        assert_eq!(state.passes(8), [8, 8]);
        assert_eq!(state.passes(16), [8, 16]);
    }

    #[test]
    fn recent_samples_determine_the_cost() {
        let mut state = state();
        for tile in 0..2 {
            note(&mut state, tile, 0..1, 4.0);
            note(&mut state, tile, 1..2, 1.0);
        }
        assert_eq!(state.seconds(), 10.0);
        // A quarter of the first and all of the second job: 2 seconds for 1.25 samples.
        assert!(
            (state.seconds_to_come(12, in_one) - 2.0 * 10.0 * 1.6).abs() < 1e-9,
            "{}",
            state.seconds_to_come(12, in_one)
        );
    }

    #[test]
    fn pixel_cost_counts_for_each_job() {
        let mut state = state();
        // A second per sample, and three for the pixels.
        for (samples, seconds) in [(0..1, 4.0), (1..2, 4.0), (2..4, 5.0)] {
            note(&mut state, 0, samples.clone(), seconds);
            note(&mut state, 1, samples, seconds);
        }
        let to_come = |jobs: u32| state.seconds_to_come(16, |_, _| jobs);
        assert!((to_come(1) - 2.0 * (12.0 + 3.0)).abs() < 1e-9, "{}", to_come(1));
        assert!((to_come(2) - 2.0 * (12.0 + 6.0)).abs() < 1e-9, "{}", to_come(2));
    }

    #[test]
    fn end_is_unknown_before_noise_is_measured() {
        let mut state = state();
        note(&mut state, 0, 0..1, 1.0);
        note(&mut state, 1, 0..1, 1.0);
        state.judge(1, 0.1);
        assert!(!state.is_foreseen(), "one sample has no noise");
        note(&mut state, 0, 1..2, 1.0);
        note(&mut state, 1, 1..2, 1.0);
        state.judge(2, 0.1);
        assert!(state.is_foreseen());
    }
}
