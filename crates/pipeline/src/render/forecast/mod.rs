//! Forecasts a render's progress, remaining time and final noise.
//!
//! Predictions are only displayed and never affect the image. [`noise_goals`](super::noise_goals) and
//! [`time_budget`](super::time_budget) decide which samples are rendered.
//!
//! | file | predicts |
//! | --- | --- |
//! | [`samples`] | the samples that each part of the image needs to reach the noise target |
//! | [`cost`] | the CPU time of these samples |
//! | [`work_rate`] | the remaining time, from the rate so far |
//! | [`noise`] | the noise after that time |

pub(crate) mod cost;
mod noise;
pub(crate) mod samples;
mod work_rate;

use std::time::Instant;

use rayon::ThreadPool;

use self::noise::NoiseTracker;
use self::work_rate::{WorkAmount, WorkRate};
use super::film_state::FilmState;
use crate::film::ConvergenceModel;
use crate::plan::RenderPlan;
use crate::protocol::RenderProgress;
use crate::scene::description::RenderOptions;
use crate::stages::photons::PhotonStore;
use crate::trace::estimate_jobs_per_pixel;

/// Estimating the remaining work requires a sum over all cells, which may take at most `1/EXPECTATION_SHARE`
/// of the time.
const EXPECTATION_SHARE: u32 = 100;

/// The most recent estimate of the total work.
struct TotalWorkEstimate {
    /// Time of the next estimate.
    due: Instant,
    /// CPU seconds for the whole render, or `None` while the end is unknown.
    total: Option<f64>,
    /// Current and total number of photon passes.
    passes: [u32; 2],
}

/// Progress and forecast of a render.
pub(crate) struct Forecast {
    rate: WorkRate,
    noise: NoiseTracker,
    expectation: TotalWorkEstimate,
    /// Last reported fraction.
    fraction: f64,
    /// Expected final number of samples, summed over all pixels.
    total_units: u64,
    /// Seconds spent on photons.
    photon_seconds: f64,
    /// Start time of the current photon pass, or `None` outside of passes.
    photons_since: Option<f64>,
}

/// Snapshot of a render's state.
pub(crate) struct RenderSnapshot<'a> {
    pub(crate) state: &'a FilmState,
    pub(crate) plan: &'a RenderPlan,
    pub(crate) photons: Option<&'a PhotonStore>,
    /// Seconds since the render stage started, excluding pauses.
    pub(crate) elapsed_seconds: f64,
    /// Number of samples so far, summed over all pixels.
    pub(crate) units: u64,
    /// Whether any pixels lack samples.
    pub(crate) is_first: bool,
    /// Whether the render is over.
    pub(crate) is_last: bool,
}

impl Forecast {
    /// Creates a forecast for a render with at most `most` samples per pixel.
    pub(crate) fn new(state: &FilmState, most: u32) -> Self {
        Self {
            rate: WorkRate::new(state.cpu_seconds()),
            noise: NoiseTracker::new(),
            expectation: TotalWorkEstimate { due: Instant::now(), total: None, passes: [0; 2] },
            fraction: 0.0,
            total_units: state.expected_total_samples(most),
            photon_seconds: 0.0,
            photons_since: None,
        }
    }

    /// Updates the total work after goals have changed.
    pub(crate) fn update_total_work(&mut self, state: &FilmState, most: u32) {
        self.total_units = state.expected_total_samples(most);
        self.expectation.due = Instant::now();
    }

    /// Begins a photon pass. `seconds` is the time since the stage started.
    pub(crate) fn begin_photons_at(&mut self, seconds: f64) {
        self.photons_since = Some(seconds);
    }

    /// Ends a photon pass.
    pub(crate) fn end_photons_at(&mut self, seconds: f64) {
        if let Some(since) = self.photons_since.take() {
            self.photon_seconds += seconds - since;
        }
    }

    /// Measures the film's noise if a measurement is due. `seconds` is the time since the stage started.
    pub(crate) fn measure_noise_if_due(&mut self, state: &FilmState, pool: &ThreadPool, seconds: f64) {
        let least = state.min_unfinished_samples(u32::MAX);
        pool.install(|| self.noise.measure_if_due(&state.film, least, state.cpu_seconds(), seconds));
    }

    /// Returns the progress, including the predicted time and noise.
    pub(crate) fn progress_and_predictions(&mut self, moment: &RenderSnapshot<'_>) -> RenderProgress {
        let elapsed_seconds = moment.elapsed_seconds;
        // Predict the time left from the remaining work.
        let work = self.done_and_total_work(moment);
        let (mut fraction, mut eta_seconds) = self.rate.update_fraction_and_time_left(elapsed_seconds, work);
        // Apply the time limit if it ends the render earlier.
        if let Some(budget) = moment.plan.limits.seconds {
            // The first pass always completes, even after the time limit.
            let of_first = eta_seconds.map_or(0.0, |eta| eta * self.first_pass_share_of_remaining(moment));
            let left = (budget - elapsed_seconds).max(of_first);
            eta_seconds = Some(eta_seconds.unwrap_or(left).min(left));
            // Elapsed time counts as progress even if no work was done.
            fraction = fraction.max(elapsed_seconds / (elapsed_seconds + left)).min(1.0);
        }
        self.fraction = if moment.is_last { 1.0 } else { self.fraction.max(fraction) };
        let pixels = moment.state.film.crop_rect().area() as u64;
        let left = eta_seconds.filter(|_| has_predictable_convergence(moment));
        RenderProgress {
            fraction: self.fraction,
            elapsed_seconds,
            earlier_seconds: moment.state.render_seconds,
            eta_seconds: if moment.is_last { Some(0.0) } else { eta_seconds },
            samples: (moment.units / pixels) as u32,
            mean_samples: moment.units as f64 / pixels as f64,
            total_samples: self.total_units.div_ceil(pixels) as u32,
            is_total_fixed: !(moment.plan.settings.render.error > 0.0)
                && moment.plan.limits.seconds.is_none(),
            noise: self.noise.noise_and_next_level(work, self.rate.rate(), left),
        }
    }

    /// Returns the current and the total amount of work. With a noise target, the total is unknown until the
    /// noise has been evaluated.
    fn done_and_total_work(&mut self, moment: &RenderSnapshot<'_>) -> WorkAmount {
        if Instant::now() >= self.expectation.due {
            self.expectation = estimate_total_cpu_work(moment);
        }
        let TotalWorkEstimate { total, passes: [passes, all_passes], .. } = self.expectation;
        let done = moment.state.cpu_seconds();
        let of_pass = moment.photons.map_or(0.0, PhotonStore::mean_seconds_per_pass);
        let of_this = self.photons_since.map_or(0.0, |since| moment.elapsed_seconds - since);
        let to_come = f64::from(all_passes.saturating_sub(passes)) * of_pass - of_this;
        WorkAmount {
            done,
            total: total.map(|total| total.max(done)),
            aside: [self.photon_seconds + of_this, to_come.max(0.0)],
        }
    }

    /// Returns the first pass's share of the remaining work.
    fn first_pass_share_of_remaining(&self, moment: &RenderSnapshot<'_>) -> f64 {
        if !moment.is_first {
            return 0.0;
        }
        let pixels = moment.state.film.crop_rect().area() as u64;
        pixels.saturating_sub(moment.units) as f64
            / self.total_units.saturating_sub(moment.units).max(1) as f64
    }
}

/// Whether future noise can be predicted from past noise. This is impossible with `error`, because fewer and
/// fewer tiles receive samples, and with photons, because the radius shrinks from pass to pass.
fn has_predictable_convergence(moment: &RenderSnapshot<'_>) -> bool {
    match moment.state.film.convergence_model() {
        ConvergenceModel::Stratified => !(moment.plan.settings.render.error > 0.0),
        ConvergenceModel::Photons => false,
    }
}

/// Estimates the total work as a sum over all cells.
fn estimate_total_cpu_work(moment: &RenderSnapshot<'_>) -> TotalWorkEstimate {
    let RenderSnapshot { state, plan, photons, .. } = moment;
    let RenderOptions { samples: most, error, .. } = plan.settings.render;
    let begin = Instant::now();
    let is_known = !(error > 0.0) || state.can_predict_samples();
    let pixels = state.film.crop_rect().area();
    let at_once = photons.map_or(u32::MAX, PhotonStore::max_passes_at_once);
    let jobs = |done, end| estimate_jobs_per_pixel(done, end, pixels, at_once);
    let total = is_known.then(|| state.cpu_seconds() + state.remaining_cpu_seconds(most, jobs));
    let passes = photons.map_or([0; 2], |_| state.current_and_final_photon_passes(most));
    TotalWorkEstimate { due: Instant::now() + EXPECTATION_SHARE * begin.elapsed(), total, passes }
}
