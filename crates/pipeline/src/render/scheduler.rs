//! Schedules a render: first image, first pass, later passes, and rounds if there is a time limit.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::checkpointer::Checkpointer;
use super::coarse_image::CoarseImageRenderer;
use super::commands::PendingCommandRunner;
use super::film_state::{EarlierProcessWork, FilmState};
use super::forecast::{Forecast, RenderSnapshot};
use super::noise_goals::MIN_SAMPLES;
use super::preview::PreviewSender;
use super::share::Shard;
use super::time_budget::next_round_goals;
use crate::film::{BrightnessPrepassPixels, PREPASS_SAMPLES, Rect, TILE_SIZE, TileSamples};
use crate::integrators::{PhotonPassesBySample, RayCounters};
use crate::plan::RenderPlan;
use crate::protocol::{Event, NormalizedRect};
use crate::scene::description::RenderOptions;
use crate::scene::fingerprint::Fingerprint;
use crate::stages::AbortReason;
use crate::stages::photons::{PhotonContext, PhotonStore};
use crate::stopwatch::PausableClock;
use crate::trace::{TileJob, Tracer, samples_after_next_pass};

/// Minimum time between two progress reports.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(60);
/// Minimum time between two previews.
const PREVIEW_INTERVAL: Duration = Duration::from_millis(66);
/// Previews may take at most `1/PREVIEW_SHARE` of the time.
const PREVIEW_SHARE: u32 = 10;

/// Inputs of the render stage.
pub(crate) struct RenderStageInputs<'a> {
    pub(crate) film: FilmToRender,
    pub(crate) tracer: Tracer<'a>,
    pub(crate) plan: &'a RenderPlan,
    /// The scene's photons, if the image uses them.
    pub(crate) photons: Option<&'a PhotonStore>,
    pub(crate) display: PreviewOptions<'a>,
    pub(crate) commands: &'a PendingCommandRunner<'a>,
    /// Checkpointer, if the render uses checkpoints.
    pub(crate) checkpointer: Option<&'a Checkpointer<'a>>,
}

/// The film to render.
pub(crate) struct FilmToRender {
    pub(crate) key: Fingerprint,
    /// Share of the image to render, or `None` for the whole image.
    pub(crate) share: Option<Shard>,
    /// Whether to start with an empty film even if a film is cached.
    pub(crate) force: bool,
    /// Maximum size of the film in bytes.
    pub(crate) max_bytes: u64,
}

/// How a render is displayed.
#[derive(Clone, Copy)]
pub(crate) struct PreviewOptions<'a> {
    /// Sender of previews, with their size when the render starts.
    pub(crate) screen: PreviewSender<'a>,
    /// Section to render first.
    pub(crate) first: Option<NormalizedRect>,
    /// Whether the camera is being moved. If so, the first image must appear quickly, even if it is small.
    pub(crate) is_moved: bool,
    /// Speed of the first, coarse image of the most recent render, in pixels per second.
    pub(crate) coarse_rate: &'a Cell<Option<f64>>,
}

/// Runs passes and rounds over a film. Reports progress and sends previews between tiles.
pub(crate) struct Scheduler<'s, 'a> {
    pub(crate) state: &'s mut FilmState,
    rendering: &'s RenderStageInputs<'a>,
    screen: PreviewSender<'a>,
    clock: PausableClock,
    forecast: Forecast,
    /// Number of samples so far, summed over all pixels.
    units: u64,
    /// Number of samples from earlier renders, summed over all pixels.
    units_before: u64,
    pub(crate) rays: RayCounters,
    /// Seconds spent by the process whose checkpoint this render resumed from.
    seconds_before: f64,
    /// Whether any pixels lack samples. While this is true, only cancellation ends the render.
    is_first: bool,
    is_over_time: bool,
    next_progress: Instant,
    next_preview: Instant,
}

impl<'s, 'a> Scheduler<'s, 'a> {
    pub(crate) fn new(state: &'s mut FilmState, rendering: &'s RenderStageInputs<'a>) -> Self {
        let units = state.total_pixel_samples();
        let screen = rendering.display.screen;
        let bounds = rendering.commands.pending.take_preview_resize().unwrap_or(screen.bounds);
        let forecast = Forecast::new(state, rendering.plan.settings.render.samples);
        let EarlierProcessWork { rays, seconds: seconds_before } = std::mem::take(&mut state.before);
        Self {
            is_first: !state.has_sampled_all_pixels(),
            state,
            rendering,
            screen: PreviewSender { bounds, ..screen },
            clock: PausableClock::start(),
            forecast,
            units,
            units_before: units,
            rays,
            seconds_before,
            is_over_time: false,
            next_progress: Instant::now(),
            next_preview: Instant::now(),
        }
    }

    /// Renders the film until it reaches the requested number of samples or the noise target.
    ///
    /// # Errors
    /// Returns [`AbortReason::Canceled`] if the token is canceled. The film keeps its samples.
    pub(crate) fn run(&mut self) -> Result<(), AbortReason> {
        self.state.is_kept = false;
        let ran = self.run_passes_to_end();
        let (traced, seconds) = (self.rays_of_all_requests(), self.seconds_across_requests());
        if let (Some(checkpointer), Err(AbortReason::Canceled)) = (self.rendering.checkpointer, &ran) {
            let interruption = self.rendering.commands.pending.interruption();
            self.state.is_kept = checkpointer.save_if_canceled(self.state, traced, seconds, interruption);
        }
        self.state.traced = traced;
        ran
    }

    /// Returns the number of rays traced for this film by all requests.
    pub(crate) fn rays_of_all_requests(&self) -> RayCounters {
        let mut traced = self.state.traced;
        traced += self.rays;
        traced
    }

    /// Returns the number of seconds that all requests have spent on this film.
    fn seconds_across_requests(&mut self) -> f64 {
        self.state.render_seconds + self.clock.update_active_seconds(self.rendering.tracer.token.is_paused())
    }

    /// Returns the render time in seconds, including time spent by the process whose checkpoint this render
    /// resumed from.
    pub(crate) fn total_render_seconds(&mut self) -> f64 {
        self.seconds_before + self.clock.update_active_seconds(self.rendering.tracer.token.is_paused())
    }

    fn run_passes_to_end(&mut self) -> Result<(), AbortReason> {
        self.report_progress(false);
        if self.is_first {
            if self.state.base.is_none() {
                self.trace_coarse_images()?;
            }
            let first = self.priority_rect();
            if first.is_some() {
                self.run_pass(first, 1)?;
            }
            self.run_pass(None, 1)?;
            self.is_first = false;
            self.state.base = None;
            self.show();
            self.run_due_tasks();
        }
        let RenderOptions { samples, error, .. } = self.rendering.plan.settings.render;
        if error > 0.0 && samples >= MIN_SAMPLES && self.state.share.is_some() {
            self.estimate_brightness_for_noise()?;
        }
        if let Some(first) = self.priority_rect() {
            // Noise is relative to the brightness of the whole image, so sample the whole image first.
            let of_all = if error > 0.0 { MIN_SAMPLES.min(samples) } else { 1 };
            self.run_passes(None, of_all)?;
            self.run_passes(Some(first), samples)?;
        }
        self.run_passes(None, samples)?;
        self.show();
        self.report_progress(true);
        Ok(())
    }

    /// Returns the pixels to render first.
    fn priority_rect(&self) -> Option<Rect> {
        let RenderOptions { width, height, .. } = self.rendering.plan.settings.render;
        self.rendering.display.first.map(|section| section.to_pixel_rect(width, height))
    }

    /// Renders a prepass over the whole image, even if this process renders only a share of it.
    fn estimate_brightness_for_noise(&mut self) -> Result<(), AbortReason> {
        if self.state.goals.brightness.is_some() {
            return Ok(());
        }
        let pilot = BrightnessPrepassPixels::new(self.state.film.crop_rect());
        let job = |number: u64| {
            let (x, y) = pilot.pixel_position(number);
            let pixels = Rect { x, y, width: 1, height: 1 }.into();
            // Store the job's index as the tile number.
            TileJob { tile: number as usize, pixels, samples: 0..PREPASS_SAMPLES }
        };
        let jobs: Vec<TileJob> = (0..pilot.pixel_count()).map(job).collect();
        let mut luminances = vec![None; jobs.len()];
        let keep =
            |_: &TileJob, samples: TileSamples| BrightnessPrepassPixels::luminance_from_samples(samples);
        self.rendering.tracer.run_all_jobs_in_parallel(&jobs, keep, |result| {
            if let Some((job, luminance, cost)) = result {
                luminances[job.tile] = luminance;
                self.rays += cost.rays;
            }
            true
        })?;
        self.state.goals.brightness = pilot.mean_luminance(|number| luminances[number as usize]);
        Ok(())
    }

    /// Evaluates the noise of existing samples from a checkpoint or a canceled request.
    fn decide_goals_from_existing(&mut self, part: Option<Rect>) {
        let RenderOptions { samples, error, .. } = self.rendering.plan.settings.render;
        let done = self.state.min_unfinished_samples_in(part, samples);
        // With fewer samples, no goals are decided.
        if error > 0.0 && (MIN_SAMPLES..samples).contains(&done) && done.is_power_of_two() {
            self.rendering.tracer.pool.install(|| self.state.decide_tile_sample_goals(done, error.into()));
        }
    }

    /// Runs passes until every pixel in `part` (`None` for all) has `samples` samples or has reached its
    /// goal.
    fn run_passes(&mut self, part: Option<Rect>, samples: u32) -> Result<(), AbortReason> {
        let RenderOptions { samples: most, error, .. } = self.rendering.plan.settings.render;
        self.decide_goals_from_existing(part);
        while !self.state.is_complete_in_region(part, samples) && !self.is_over_time {
            if let Some(goals) = self.next_round_goals().filter(|_| part.is_none()) {
                self.run_round(&goals)?;
                self.measure_noise_if_due();
                continue;
            }
            let pixels = self.state.film.crop_rect().area();
            let target =
                samples_after_next_pass(self.state.min_unfinished_samples_in(part, samples), samples, pixels);
            self.run_pass(part, target)?;
            if target.is_power_of_two() {
                self.measure_noise_if_due();
            }
            if error > 0.0 && target.is_power_of_two() && !self.is_over_time {
                self.rendering
                    .tracer
                    .pool
                    .install(|| self.state.decide_tile_sample_goals(target, error.into()));
                self.forecast.update_total_work(self.state, most);
            }
        }
        Ok(())
    }

    fn measure_noise_if_due(&mut self) {
        let Tracer { pool, token, .. } = self.rendering.tracer;
        let seconds = self.clock.update_active_seconds(token.is_paused());
        self.forecast.measure_noise_if_due(self.state, pool, seconds);
    }

    /// Renders all tiles in `part` that have fewer than `target` samples.
    fn run_pass(&mut self, part: Option<Rect>, target: u32) -> Result<(), AbortReason> {
        let Some(photons) = self.rendering.photons else {
            return self.render_to_sample_targets(part, |_, _| target, None, 0);
        };
        while !self.state.is_complete_in_region(part, target) && !self.is_over_time {
            let samples = self.state.min_unfinished_samples_in(part, target);
            let at_once = samples..target.min(samples.saturating_add(photons.max_passes_at_once()));
            let numbers = self.state.to_consecutive_global_range(at_once);
            let end = samples + numbers.len() as u32;
            // Do not trace or gather photons if there is no time left.
            self.run_due_tasks();
            if self.is_over_time {
                break;
            }
            let maps = self.trace_photons(photons, numbers.clone())?;
            if self.is_over_time {
                break;
            }
            self.render_to_sample_targets(part, |_, _| end, Some(&maps), numbers.start - samples)?;
        }
        Ok(())
    }

    /// Traces photons for the given samples while handling commands.
    fn trace_photons(
        &mut self,
        photons: &PhotonStore,
        samples: Range<u32>,
    ) -> Result<PhotonPassesBySample, AbortReason> {
        let RenderStageInputs { plan, tracer, .. } = *self.rendering;
        let Tracer { pool, world, token, .. } = tracer;
        let sink = self.screen.sink;
        let begin = self.clock.update_active_seconds(token.is_paused());
        self.forecast.begin_photons_at(begin);
        let maps =
            photons.get_or_trace_maps(samples, PhotonContext { world, plan, pool, token, sink }, || {
                self.run_due_tasks();
            })?;
        self.forecast.end_photons_at(self.clock.update_active_seconds(token.is_paused()));
        Ok(maps)
    }

    /// Returns the next sample count for each half of each cell if there is a time limit. Adds samples where
    /// they reduce the error most. Returns `None` with photons, whose cost does not depend on the number of
    /// cells, and with a noise target, which determines the sample placement instead.
    fn next_round_goals(&self) -> Option<Vec<[u32; 2]>> {
        let RenderStageInputs { plan, photons, .. } = *self.rendering;
        let RenderOptions { samples, error, .. } = plan.settings.render;
        if plan.limits.seconds.is_none() || photons.is_some() || error > 0.0 {
            return None;
        }
        next_round_goals(&self.state.film, &self.state.done, &self.state.rays, samples)
    }

    /// Renders both halves of every cell in short steps until they reach their goals.
    fn run_round(&mut self, goals: &[[u32; 2]]) -> Result<(), AbortReason> {
        const STEP: Duration = Duration::from_millis(30);
        /// Number of pixels in half a tile.
        const PIXELS: f64 = (TILE_SIZE * TILE_SIZE / 2) as f64;
        let seconds = self.clock.update_active_seconds(self.rendering.tracer.token.is_paused());
        let threads = self.rendering.tracer.pool.current_num_threads() as f64;
        let rate = (self.units - self.units_before) as f64 / seconds / threads;
        let most = ((rate * STEP.as_secs_f64() / PIXELS) as u32).max(16);
        while !self.is_over_time {
            let done = self.state.done.clone();
            if done == goals {
                break;
            }
            self.render_to_sample_targets(
                None,
                |cell, half| goals[cell][half].min(done[cell][half].saturating_add(most)),
                None,
                0,
            )?;
        }
        Ok(())
    }

    fn render_to_sample_targets(
        &mut self,
        part: Option<Rect>,
        target: impl Fn(usize, usize) -> u32,
        photons: Option<&PhotonPassesBySample>,
        first: u32,
    ) -> Result<(), AbortReason> {
        let jobs = self.state.jobs(part, target);
        let film = Arc::clone(&self.state.film);
        let layers = Some(&*film).filter(|_| !self.rendering.plan.settings.layers.is_empty());
        let tracer = Tracer { photons, first, layers, ..self.rendering.tracer };
        let keep = |job: &TileJob, samples: TileSamples| film.add_samples(job.tile, samples);
        tracer.run_all_jobs_in_parallel(&jobs, keep, |result| {
            if let Some((job, (), cost)) = result {
                self.units += self.state.record_finished_job(job, &cost);
                self.rays += cost.rays;
            }
            self.run_due_tasks();
            !self.is_over_time
        })?;
        Ok(())
    }

    /// Handles everything that is due between tiles: progress, previews, commands, checkpoints and the time
    /// limit.
    fn run_due_tasks(&mut self) {
        let now = Instant::now();
        if now >= self.next_progress {
            self.next_progress = now + PROGRESS_INTERVAL;
            self.report_progress(false);
        }
        if let Some(bounds) = self.rendering.commands.pending.take_preview_resize() {
            (self.screen.bounds, self.next_preview) = (bounds, now);
        }
        if now >= self.next_preview && self.screen.advance_and_send_if_complete(self.state) {
            self.next_preview = Instant::now() + PREVIEW_INTERVAL.max(now.elapsed() * PREVIEW_SHARE);
        }
        self.rendering.commands.run_pending(Some(self.state), !self.is_first);
        let seconds = self.total_render_seconds();
        if let Some(checkpointer) = self.rendering.checkpointer {
            let rendered = self.seconds_across_requests();
            checkpointer.save_if_due(self.state, self.rays_of_all_requests(), rendered);
        }
        let budget = self.rendering.plan.limits.seconds;
        self.is_over_time = !self.is_first && budget.is_some_and(|budget| seconds >= budget);
    }

    pub(crate) fn show(&mut self) {
        let Tracer { pool, token, .. } = self.rendering.tracer;
        self.screen.send_film_preview(self.state, pool, token);
        self.next_preview = Instant::now() + PREVIEW_INTERVAL;
    }

    /// Reports the render's progress and expected end.
    fn report_progress(&mut self, is_last: bool) {
        let elapsed_seconds = self.clock.update_active_seconds(self.rendering.tracer.token.is_paused());
        let RenderStageInputs { plan, photons, .. } = *self.rendering;
        let (state, units, is_first) = (&*self.state, self.units, self.is_first);
        let moment = RenderSnapshot { state, plan, photons, elapsed_seconds, units, is_first, is_last };
        let (sink, progress) = (self.screen.sink, self.forecast.progress_and_predictions(&moment));
        sink.send(Event::Progress { generation: sink.generation, progress });
    }

    fn coarse_image_renderer(&self) -> CoarseImageRenderer<'a> {
        let RenderStageInputs { tracer, plan, .. } = *self.rendering;
        let PreviewOptions { is_moved, coarse_rate: rate, .. } = self.rendering.display;
        CoarseImageRenderer { tracer, plan, is_moved, rate }
    }

    /// Traces first images with one sample per pixel, unless they take almost as long as a full pass.
    fn trace_coarse_images(&mut self) -> Result<(), AbortReason> {
        let Some((shown_width, shown_height)) = self.screen.fitted_image_size() else { return Ok(()) };
        let coarse = self.coarse_image_renderer();
        for (width, height) in coarse.sizes(shown_width, shown_height) {
            let maps = match self.rendering.photons {
                Some(photons) => Some(self.trace_photons(photons, 0..1)?),
                None => None,
            };
            let picture = coarse.trace_coarse_image(maps.as_ref(), width, height, || {})?;
            self.state.base = Some(picture.resized(shown_width, shown_height));
            self.show();
        }
        Ok(())
    }
}
