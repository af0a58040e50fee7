//! A film with its cache key and render progress.

use std::cmp::Reverse;
use std::ops::Range;
use std::sync::Arc;

use super::forecast::cost::{CellCost, MeasuredJobCost, PixelOverhead};
use super::forecast::samples::ExpectedSamples;
use crate::film::{
    CELLS, ConvergenceModel, Film, FilmCreationError, PixelSubset, Previewer, RadianceImage, Rect,
    SelectedPixels, SumOrder,
};
use crate::integrators::RayCounters;
use crate::output::part::NamedRenderInput;
use crate::plan::RenderPlan;
use crate::render::noise_goals::CellSampleGoals;
use crate::render::share::Shard;
use crate::scene::fingerprint::Fingerprint;
use crate::trace::{TileJob, TraceCost};

/// A film with its cache key and render progress.
#[derive(Debug)]
pub(crate) struct FilmState {
    pub(crate) key: Fingerprint,
    /// Serial number, assigned by the film cache.
    pub(crate) number: u64,
    pub(crate) film: Arc<Film>,
    /// Number of samples taken so far in each half of each cell, or [`u32::MAX`] for cells that are not
    /// rendered.
    pub(crate) done: Vec<[u32; 2]>,
    /// Number of rays traced in each cell.
    pub(crate) rays: Vec<u64>,
    /// CPU seconds spent on all rays.
    pub(super) seconds: f64,
    /// Cost of recent samples in each cell.
    costs: Vec<CellCost>,
    /// Per-pixel overhead of a job, in addition to the cost of its samples.
    pixel_share: PixelOverhead,
    /// Maximum number of samples for each half of each cell.
    pub(crate) goals: CellSampleGoals,
    /// Expected number of samples for halves without a goal.
    expected: ExpectedSamples,
    /// First image at preview size, shown in place of pixels without samples.
    pub(crate) base: Option<RadianceImage>,
    /// The previewer used for the last preview.
    pub(crate) previewer: Option<Previewer>,
    /// Whether the render started while the camera was moving.
    pub(crate) is_passing: bool,
    /// The time limit that ended the last render.
    pub(crate) ended_by: Option<f64>,
    /// Total render time over all requests, in seconds.
    pub(crate) render_seconds: f64,
    /// Share of the image to render, or `None` for the whole image.
    pub(crate) share: Option<Shard>,
    /// Whether each tile belongs to the share, or `None` if all tiles do.
    own: Option<Vec<bool>>,
    /// Work done by the process whose checkpoint this render resumed from.
    pub(crate) before: EarlierProcessWork,
    /// Rays traced by all requests and by the process whose checkpoint this render resumed from.
    pub(crate) traced: RayCounters,
    /// Whether a checkpoint contains all of the film's samples.
    pub(crate) is_kept: bool,
    /// Names and values of everything that affects the image, or `None` until first needed.
    pub(crate) identity: Option<Vec<NamedRenderInput>>,
    /// Whether the film was loaded from a finished part.
    pub(crate) is_finished_part: bool,
}

/// Work done by an earlier process.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct EarlierProcessWork {
    /// Ray and texture lookup counts.
    pub(crate) rays: RayCounters,
    /// Duration of the render stage in seconds.
    pub(crate) seconds: f64,
}

impl FilmState {
    /// Creates a state without samples. The film may use at most `max_bytes`.
    ///
    /// # Errors
    /// There is not enough memory for the film.
    pub(crate) fn new(
        key: Fingerprint,
        plan: &RenderPlan,
        max_bytes: u64,
        convergence: ConvergenceModel,
        share: Option<Shard>,
    ) -> Result<Self, FilmCreationError> {
        let blocks = match (&share, convergence) {
            (Some(share), _) => share.summation_order(),
            (None, ConvergenceModel::Photons) => SumOrder::Blocked,
            (None, ConvergenceModel::Stratified) => SumOrder::Sequential,
        };
        let film = Film::with_memory_limit(
            max_bytes,
            plan.settings.render.width,
            plan.settings.render.height,
            plan.crop,
        )?
        .with_convergence_model(convergence)
        .with_sum_order(blocks)?
        .with_layer_count(plan.settings.layers.len())?;
        let film_cells = film.noise_cell_count();
        let goals = CellSampleGoals::new_undecided(film_cells);
        let own = share.as_ref().map(|share| share.tile_mask(film.tile_count()));
        let is_own = |cell| own.as_ref().is_none_or(|own| own[cell / CELLS]);
        let exists = |cell| film.noise_cell_rect(cell).is_some();
        let none = |cell: usize| if exists(cell) && is_own(cell) { [0; 2] } else { [u32::MAX; 2] };
        let done = (0..film.noise_cell_count()).map(none).collect();
        Ok(Self {
            key,
            number: 0,
            film: Arc::new(film),
            rays: vec![0; film_cells],
            seconds: 0.0,
            costs: vec![CellCost::default(); film_cells],
            pixel_share: PixelOverhead::default(),
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
            before: EarlierProcessWork::default(),
            traced: RayCounters::default(),
            is_kept: false,
            identity: None,
            is_finished_part: false,
        })
    }

    /// Whether this process renders a tile.
    fn is_tile_in_shard(&self, tile: usize) -> bool {
        self.own.as_ref().is_none_or(|own| own[tile])
    }

    /// Maps this share's samples to sample indices in the whole image. If the indices are not all
    /// consecutive, returns only the first consecutive range.
    pub(crate) fn to_consecutive_global_range(&self, samples: Range<u32>) -> Range<u32> {
        match &self.share {
            Some(share) => share.to_global_sample_range(samples),
            None => samples,
        }
    }

    /// Reads the sample counts from the film.
    pub(super) fn update_sample_counts_from_film(&mut self) {
        let halves: Vec<_> = self.cell_half_indices_in_shard().collect();
        for (cell, half) in halves {
            self.done[cell][half] = self.film.cell_half_samples_per_pixel(cell, half);
        }
    }

    /// Whether every pixel has at least `samples` samples or has reached its goal.
    pub(crate) fn is_complete(&self, samples: u32) -> bool {
        self.is_complete_in_region(None, samples)
    }

    /// Like [`Self::is_complete`], but only for tiles overlapping `part` (`None` for all tiles).
    pub(crate) fn is_complete_in_region(&self, part: Option<Rect>, samples: u32) -> bool {
        self.cell_half_indices_in_shard()
            .filter(|(cell, _)| self.cell_tile_overlaps_rect(part, *cell))
            .all(|(tile, half)| self.done[tile][half] >= self.goals.get(tile, half).min(samples))
    }

    /// Whether a plan's image is finished because it has all samples or because the time limit was reached.
    pub(crate) fn is_finished(&self, plan: &RenderPlan) -> bool {
        let is_over_time = plan.limits.seconds.is_some() && self.ended_by == plan.limits.seconds;
        self.is_finished_part || is_over_time || self.is_complete(plan.settings.render.samples)
    }

    /// Whether no pixel has more than `samples` samples.
    pub(crate) fn has_at_most_samples(&self, samples: u32) -> bool {
        self.cell_half_indices_in_shard().all(|(cell, half)| self.done[cell][half] <= samples)
    }

    /// Returns the lowest sample count among pixels that need more samples, limited to `most`.
    pub(crate) fn min_unfinished_samples(&self, most: u32) -> u32 {
        self.min_unfinished_samples_in(None, most)
    }

    /// Like [`Self::min_unfinished_samples`], but only for tiles overlapping `part` (`None` for all tiles).
    pub(crate) fn min_unfinished_samples_in(&self, part: Option<Rect>, most: u32) -> u32 {
        let of = |(tile, half): (usize, usize)| {
            let done = self.done[tile][half];
            (done < self.goals.get(tile, half).min(most)).then_some(done)
        };
        self.cell_half_indices_in_shard()
            .filter(|(cell, _)| self.cell_tile_overlaps_rect(part, *cell))
            .filter_map(of)
            .min()
            .unwrap_or(most)
    }

    /// Whether a cell's tile overlaps `part`.
    fn cell_tile_overlaps_rect(&self, part: Option<Rect>, cell: usize) -> bool {
        part.is_none_or(|part| {
            self.film.tile_rect(cell / CELLS).is_some_and(|rect| rect.intersection(&part).is_some())
        })
    }

    /// Whether any pixel has samples.
    pub(crate) fn has_samples(&self) -> bool {
        self.cell_half_indices_in_shard().any(|(cell, half)| self.done[cell][half] > 0)
    }

    /// Whether every pixel has a sample. Only then may the image replace another image.
    pub(crate) fn has_sampled_all_pixels(&self) -> bool {
        self.cell_half_indices_in_shard().all(|(cell, half)| self.done[cell][half] > 0)
    }

    fn cell_half_indices_in_shard(&self) -> impl Iterator<Item = (usize, usize)> {
        let halves = (0..self.done.len()).flat_map(|cell| [(cell, 0), (cell, 1)]);
        halves.filter(|(cell, half)| {
            self.is_tile_in_shard(cell / CELLS) && self.film.cell_half_pixel_count(*cell, *half) > 0
        })
    }

    /// Returns the memory used, in bytes.
    pub(crate) fn memory_bytes(&self) -> u64 {
        let base = self.base.as_ref().map_or(0, |base| size_of_val(base.pixels.as_slice()) as u64);
        let cells = size_of_val(self.done.as_slice())
            + size_of_val(self.rays.as_slice())
            + size_of_val(self.costs.as_slice())
            + self.goals.memory_bytes()
            + self.expected.memory_bytes();
        let previewer = self.previewer.as_ref().map_or(0, Previewer::memory_bytes);
        self.film.memory_bytes() + cells as u64 + base + previewer
    }

    /// Returns the jobs that render both halves of every cell in `part` (`None` for all) up to `target` or
    /// their goals. If all cells in a tile need the same samples, the tile is a single job. Longer jobs
    /// precede shorter ones, and jobs of equal length are in the film's tile order.
    pub(crate) fn jobs(&self, part: Option<Rect>, target: impl Fn(usize, usize) -> u32) -> Vec<TileJob> {
        let missing = |cell: usize, half: usize| {
            self.done[cell][half]..self.goals.get(cell, half).min(target(cell, half))
        };
        let mut jobs = Vec::new();
        let is_wanted = |tile: &&usize| {
            self.is_tile_in_shard(**tile) && self.cell_tile_overlaps_rect(part, CELLS * **tile)
        };
        for &tile in self.film.tiles_center_outward().iter().filter(is_wanted) {
            let cells = (CELLS * tile..CELLS * (tile + 1))
                .filter_map(|cell| Some((cell, self.film.noise_cell_rect(cell)?)));
            let cells = cells.map(|(cell, rect)| (rect, [0, 1].map(|half| missing(cell, half))));
            let cells: Vec<(Rect, [Range<u32>; 2])> = cells.collect();
            let job = |pixels, samples: &Range<u32>| TileJob { tile, pixels, samples: samples.clone() };
            if let Some((rect, samples)) = self.film.tile_rect(tile).zip(shared_sample_range_of_cells(&cells))
            {
                jobs.push(job(rect.into(), samples));
                continue;
            }
            for (rect, halves) in cells {
                match &halves {
                    [first, other] if first == other => jobs.push(job(rect.into(), first)),
                    halves => jobs.extend((0..2).map(|half| {
                        job(SelectedPixels { rect, part: PixelSubset::Half(half) }, &halves[half])
                    })),
                }
            }
        }
        jobs.retain(|job| !job.samples.is_empty());
        // Run the longest jobs first so that all threads finish at about the same time.
        jobs.sort_by_key(|job| Reverse(job.samples.len()));
        jobs
    }

    /// Records a finished job and its cost. Returns the job's total sample count over all pixels.
    pub(crate) fn record_finished_job(&mut self, job: &TileJob, cost: &TraceCost) -> u64 {
        let (rays, seconds) = (cost.rays.total_rays(), cost.seconds / job.pixels.rect.area() as f64);
        for cell in CELLS * job.tile..CELLS * (job.tile + 1) {
            let cell_rect = self.film.noise_cell_rect(cell);
            if let Some(rect) = cell_rect.filter(|rect| rect.intersection(&job.pixels.rect) == Some(*rect)) {
                self.rays[cell] += rays * rect.area() as u64 / job.pixels.rect.area() as u64;
                let seconds = seconds * rect.area() as f64;
                self.seconds += seconds;
                let (pixels, samples) = (job.pixels.part.count(rect.area()) as f64, job.samples.len() as f64);
                self.costs[cell].record(MeasuredJobCost { seconds, pixels, samples }, &mut self.pixel_share);
                match job.pixels.part {
                    PixelSubset::All => self.done[cell] = [job.samples.end; 2],
                    PixelSubset::Half(half) => self.done[cell][half] = job.samples.end,
                }
            }
        }
        job.pixel_count() * job.samples.len() as u64
    }

    /// Decides which of the tiles with `samples` samples (a power of two) need no more samples.
    pub(crate) fn decide_tile_sample_goals(&mut self, samples: u32, error: f64) {
        if let Some(judgement) = self.goals.decide_half_goals(&self.film, &self.done, samples, error) {
            self.expected.update_predictions(&judgement, &self.goals, &self.done);
        }
    }

    /// Returns the number of tiles that reached their sample limit but not the noise target, and the highest
    /// noise among them.
    pub(crate) fn count_finished_tiles_above_target(&self, error: f64) -> Option<(usize, f64)> {
        self.goals.count_finished_tiles_above_target(&self.film, error)
    }

    /// Returns the number of samples rendered so far, summed over all pixels.
    pub(crate) fn total_pixel_samples(&self) -> u64 {
        self.sum_pixel_samples(|tile, half| self.done[tile][half])
    }

    /// Returns the expected final number of samples, summed over all pixels, with at most `most` samples per
    /// pixel.
    pub(crate) fn expected_total_samples(&self, most: u32) -> u64 {
        self.sum_pixel_samples(|cell, half| self.expected_final_samples_in_half(cell, half, most))
    }

    /// Returns the CPU seconds spent so far.
    pub(crate) fn cpu_seconds(&self) -> f64 {
        self.seconds
    }

    /// Estimates the CPU seconds needed for the remaining samples, up to `most` per pixel. `jobs` returns the
    /// number of jobs between two sample counts. Assumes that a sample costs as much as recent samples in the
    /// same cell. Uses the mean cost for cells without samples.
    pub(crate) fn remaining_cpu_seconds(&self, most: u32, jobs: impl Fn(u32, u32) -> u32) -> f64 {
        let (mut seconds, mut known, mut worth, mut others) = (0.0, 0.0, 0.0, 0.0);
        let is_there =
            |cell: &usize| self.is_tile_in_shard(cell / CELLS) && self.film.noise_cell_rect(*cell).is_some();
        for cell in (0..self.done.len()).filter(is_there) {
            let remaining_samples = |half: usize| {
                let (done, end) =
                    (self.done[cell][half], self.expected_final_samples_in_half(cell, half, most));
                let pixels = self.film.cell_half_pixel_count(cell, half) as f64;
                let samples = pixels * f64::from(end.saturating_sub(done));
                self.pixel_share.samples_including_overhead(samples, pixels * f64::from(jobs(done, end)))
            };
            let (remaining, cost) = (remaining_samples(0) + remaining_samples(1), &self.costs[cell]);
            if cost.is_unknown() {
                others += remaining;
                continue;
            }
            let of_cell = cost.cost_in_samples_with_overhead(self.pixel_share);
            seconds += remaining * cost.decayed_seconds_sum() / of_cell;
            known += cost.decayed_seconds_sum();
            worth += of_cell;
        }
        // Without measurements, assume that all samples cost the same.
        seconds + others * if worth > 0.0 { known / worth } else { 1.0 }
    }

    /// Returns two sample counts: the highest current count and the highest expected final count of any
    /// pixel. These are also the current and final numbers of photon passes.
    pub(crate) fn current_and_final_photon_passes(&self, most: u32) -> [u32; 2] {
        let max_of = |samples: &dyn Fn(usize, usize) -> u32| {
            self.cell_half_indices_in_shard().map(|(cell, half)| samples(cell, half)).max().unwrap_or(0)
        };
        [
            max_of(&|cell, half| self.done[cell][half]),
            max_of(&|cell, half| self.expected_final_samples_in_half(cell, half, most)),
        ]
    }

    /// Whether the final number of samples can be estimated despite a noise target.
    pub(crate) fn can_predict_samples(&self) -> bool {
        self.cell_half_indices_in_shard()
            .all(|(cell, half)| self.expected_final_samples_in_half(cell, half, u32::MAX) < u32::MAX)
    }

    fn expected_final_samples_in_half(&self, cell: usize, half: usize, most: u32) -> u32 {
        let (goal, expected) = (self.goals.get(cell, half), self.expected.of_cell_half(cell, half));
        (if goal < u32::MAX { goal } else { expected }).min(most)
    }

    fn sum_pixel_samples(&self, samples_of: impl Fn(usize, usize) -> u32) -> u64 {
        let units = |(cell, half): (usize, usize)| {
            self.film.cell_half_pixel_count(cell, half) as u64 * u64::from(samples_of(cell, half))
        };
        self.cell_half_indices_in_shard().map(units).sum()
    }
}

/// Returns the sample range that all halves of all cells need, if it is the same for all of them.
fn shared_sample_range_of_cells(cells: &[(Rect, [Range<u32>; 2])]) -> Option<&Range<u32>> {
    let (_, [first, _]) = cells.first()?;
    cells.iter().all(|(_, halves)| halves.iter().all(|half| half == first)).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::TileSamples;
    use crate::math::Vec3;
    use crate::scene::fingerprint::FingerprintHasher;

    /// Creates a film with two tiles.
    fn state() -> FilmState {
        let film = Film::new(64, 32, None).expect("a film");
        let cells = film.noise_cell_count();
        FilmState {
            key: FingerprintHasher::new("test").finish(),
            number: 0,
            film: Arc::new(film),
            done: vec![[0; 2]; cells],
            rays: vec![0; cells],
            seconds: 0.0,
            costs: vec![CellCost::default(); cells],
            pixel_share: PixelOverhead::default(),
            goals: CellSampleGoals::new_undecided(cells),
            expected: ExpectedSamples::unknown(cells),
            base: None,
            previewer: None,
            is_passing: false,
            ended_by: None,
            render_seconds: 0.0,
            share: None,
            own: None,
            before: EarlierProcessWork::default(),
            traced: RayCounters::default(),
            is_kept: false,
            identity: None,
            is_finished_part: false,
        }
    }

    fn in_one(done: u32, end: u32) -> u32 {
        u32::from(done < end)
    }

    /// Adds samples to a tile and records how long they took.
    fn add_and_record_samples(state: &mut FilmState, tile: usize, samples: Range<u32>, seconds: f64) {
        let pixels = SelectedPixels::from(state.film.tile_rect(tile).expect("a tile"));
        let count = samples.end - samples.start;
        let radiance = (0..pixels.count() as u32 * count).map(|i| Vec3::splat((i % 7) as f32)).collect();
        state.film.add_samples(
            tile,
            TileSamples { pixels, samples: count, radiance, negative: None, layers: Default::default() },
        );
        let job = TileJob { tile, pixels, samples };
        state.record_finished_job(&job, &TraceCost { rays: RayCounters::default(), seconds });
    }

    #[test]
    fn remaining_cost_is_estimated_per_tile() {
        let mut state = state();
        let mut noted = |tile: usize, samples: Range<u32>, seconds: f64| {
            add_and_record_samples(&mut state, tile, samples, seconds);
            [state.cpu_seconds(), state.remaining_cpu_seconds(8, in_one)]
                .map(|seconds| (seconds * 1e6).round() * 1e-6)
        };
        // The second tile's cost is unknown, so it is assumed to equal the first tile's.
        assert_eq!(noted(0, 0..4, 1.0), [1.0, 3.0]);
        assert_eq!(noted(1, 0..2, 10.0), [11.0, 31.0]);
        assert_eq!(noted(1, 2..8, 30.0), [41.0, 1.0]);
        assert_eq!(state.current_and_final_photon_passes(8), [8, 8]);
        assert_eq!(state.current_and_final_photon_passes(16), [8, 16]);
    }

    #[test]
    fn recent_samples_determine_the_cost() {
        let mut state = state();
        for tile in 0..2 {
            add_and_record_samples(&mut state, tile, 0..1, 4.0);
            add_and_record_samples(&mut state, tile, 1..2, 1.0);
        }
        assert_eq!(state.cpu_seconds(), 10.0);
        // The first job has a weight of 1/4 and the second a weight of 1, which gives 2 seconds for 1.25
        // samples.
        assert!(
            (state.remaining_cpu_seconds(12, in_one) - 2.0 * 10.0 * 1.6).abs() < 1e-9,
            "{}",
            state.remaining_cpu_seconds(12, in_one)
        );
    }

    #[test]
    fn pixel_overhead_is_charged_per_job() {
        let mut state = state();
        // One second per sample plus three seconds of pixel overhead per job.
        for (samples, seconds) in [(0..1, 4.0), (1..2, 4.0), (2..4, 5.0)] {
            add_and_record_samples(&mut state, 0, samples.clone(), seconds);
            add_and_record_samples(&mut state, 1, samples, seconds);
        }
        let to_come = |jobs: u32| state.remaining_cpu_seconds(16, |_, _| jobs);
        assert!((to_come(1) - 2.0 * (12.0 + 3.0)).abs() < 1e-9, "{}", to_come(1));
        assert!((to_come(2) - 2.0 * (12.0 + 6.0)).abs() < 1e-9, "{}", to_come(2));
    }

    #[test]
    fn end_is_unknown_until_noise_is_measured() {
        let mut state = state();
        add_and_record_samples(&mut state, 0, 0..1, 1.0);
        add_and_record_samples(&mut state, 1, 0..1, 1.0);
        state.decide_tile_sample_goals(1, 0.1);
        assert!(!state.can_predict_samples(), "noise cannot be estimated from one sample");
        add_and_record_samples(&mut state, 0, 1..2, 1.0);
        add_and_record_samples(&mut state, 1, 1..2, 1.0);
        state.decide_tile_sample_goals(2, 0.1);
        assert!(state.can_predict_samples());
    }
}
