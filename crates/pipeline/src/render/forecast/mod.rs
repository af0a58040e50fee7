//! The forecast of a render: how far is it, when is it done, and how much noise will be left?
//!
//! The door to all predictions. They are shown and decide nothing: where samples go is decided by
//! [`noise_goals`](super::noise_goals) and [`time_budget`](super::time_budget), on which the picture depends.
//!
//! | file | predicts |
//! | --- | --- |
//! | [`samples`] | the samples that each part of the picture will need for the error asked for |
//! | [`cost`] | the processor time of these samples |
//! | [`pace`] | the time that this takes, by the rate so far |
//! | [`noise`] | the noise by then |

pub(crate) mod cost;
mod noise;
mod pace;
pub(crate) mod samples;

use std::time::Instant;

use rayon::ThreadPool;

use self::noise::NoiseForecast;
use self::pace::{Pace, Work};
use super::film_state::FilmState;
use crate::film::Convergence;
use crate::plan::Plan;
use crate::protocol::RenderProgress;
use crate::scene::description::Render;
use crate::stages::photons::PhotonStore;
use crate::trace::jobs_to_come;

/// To add up the work to come takes at most one part in so many of the time: it is a sum over all cells.
const EXPECTATION_SHARE: u32 = 100;

/// The work to come, as it was added up last.
struct Expectation {
    /// Time at which the work is added up again.
    due: Instant,
    /// Processor time of the whole render, in seconds. `None` while nobody knows where the render ends.
    total: Option<f64>,
    /// Passes of photons, now and in the end.
    passes: [u32; 2],
}

/// Progress of one render, and its end as far as it is known.
pub(crate) struct Forecast {
    pace: Pace,
    noise: NoiseForecast,
    expectation: Expectation,
    /// The fraction that was reported last.
    fraction: f64,
    /// Pixels times samples in the end.
    total_units: u64,
    /// Seconds in which photons were sent.
    photon_seconds: f64,
    /// Time at which the photons under way began to be sent. `None` while none are.
    photons_since: Option<f64>,
}

/// A moment of a render.
pub(crate) struct Moment<'a> {
    pub(crate) state: &'a FilmState,
    pub(crate) plan: &'a Plan,
    pub(crate) photons: Option<&'a PhotonStore>,
    /// Seconds since the stage began, without pauses.
    pub(crate) elapsed_seconds: f64,
    /// Pixels times samples so far.
    pub(crate) units: u64,
    /// Whether some pixels have no sample yet.
    pub(crate) is_first: bool,
    /// Whether the render is over.
    pub(crate) is_last: bool,
}

impl Forecast {
    /// Forecast of a render to at most so many samples per pixel.
    pub(crate) fn new(state: &FilmState, most: u32) -> Self {
        Self {
            pace: Pace::new(state.seconds()),
            noise: NoiseForecast::new(),
            expectation: Expectation { due: Instant::now(), total: None, passes: [0; 2] },
            fraction: 0.0,
            total_units: state.units_to_come(most),
            photon_seconds: 0.0,
            photons_since: None,
        }
    }

    /// Adds up the work to come anew: goals have changed.
    pub(crate) fn expect_again(&mut self, state: &FilmState, most: u32) {
        self.total_units = state.units_to_come(most);
        self.expectation.due = Instant::now();
    }

    /// Photons are being sent from now on; `seconds` of the stage's clock.
    pub(crate) fn begin_photons(&mut self, seconds: f64) {
        self.photons_since = Some(seconds);
    }

    /// The photons have been sent.
    pub(crate) fn end_photons(&mut self, seconds: f64) {
        if let Some(since) = self.photons_since.take() {
            self.photon_seconds += seconds - since;
        }
    }

    /// Measures the noise of the film, if it is time for that.
    /// `seconds` of the stage's clock.
    pub(crate) fn look_at_noise(&mut self, state: &FilmState, pool: &ThreadPool, seconds: f64) {
        let least = state.samples(u32::MAX);
        pool.install(|| self.noise.look(&state.film, least, (state.seconds(), seconds)));
    }

    /// Progress at a moment, with the time and the noise that are expected.
    pub(crate) fn progress(&mut self, moment: &Moment<'_>) -> RenderProgress {
        let elapsed_seconds = moment.elapsed_seconds;
        // Predict the end from the work alone.
        let work = self.work(moment);
        let (mut fraction, mut eta_seconds) = self.pace.at(elapsed_seconds, work);
        // End with the budget of time, if that is sooner.
        if let Some(budget) = moment.plan.time_seconds {
            // The first pass is finished whatever the budget is.
            let of_first = eta_seconds.map_or(0.0, |eta| eta * self.share_of_first(moment));
            let left = (budget - elapsed_seconds).max(of_first);
            eta_seconds = Some(eta_seconds.unwrap_or(left).min(left));
            // Time passes even where work stands still.
            fraction = fraction.max(elapsed_seconds / (elapsed_seconds + left)).min(1.0);
        }
        self.fraction = if moment.is_last { 1.0 } else { self.fraction.max(fraction) };
        let pixels = moment.state.film.crop().area() as u64;
        let left = eta_seconds.filter(|_| falls_evenly(moment));
        RenderProgress {
            fraction: self.fraction,
            elapsed_seconds,
            earlier_seconds: moment.state.render_seconds,
            eta_seconds: if moment.is_last { Some(0.0) } else { eta_seconds },
            samples: (moment.units / pixels) as u32,
            mean_samples: moment.units as f64 / pixels as f64,
            total_samples: self.total_units.div_ceil(pixels) as u32,
            is_total_fixed: !(moment.plan.settings.render.error > 0.0) && moment.plan.time_seconds.is_none(),
            noise: self.noise.at(work, self.pace.rate(), left),
        }
    }

    /// Work so far and in all. Where noise ends the render, nobody knows the end before the noise was judged.
    fn work(&mut self, moment: &Moment<'_>) -> Work {
        if Instant::now() >= self.expectation.due {
            self.expectation = expectation(moment);
        }
        let Expectation { total, passes: [passes, all_passes], .. } = self.expectation;
        let done = moment.state.seconds();
        let of_pass = moment.photons.map_or(0.0, PhotonStore::seconds_of_pass);
        let of_this = self.photons_since.map_or(0.0, |since| moment.elapsed_seconds - since);
        let to_come = f64::from(all_passes.saturating_sub(passes)) * of_pass - of_this;
        Work {
            done,
            total: total.map(|total| total.max(done)),
            aside: [self.photon_seconds + of_this, to_come.max(0.0)],
        }
    }

    /// The first pass's part of the work that is left.
    fn share_of_first(&self, moment: &Moment<'_>) -> f64 {
        if !moment.is_first {
            return 0.0;
        }
        let pixels = moment.state.film.crop().area() as u64;
        pixels.saturating_sub(moment.units) as f64
            / self.total_units.saturating_sub(moment.units).max(1) as f64
    }
}

/// Whether noise is known to fall as it did. With `error`, fewer and fewer tiles get samples; the first passes of photons tell
/// little of later ones, whose radius is smaller.
fn falls_evenly(moment: &Moment<'_>) -> bool {
    match moment.state.film.convergence() {
        Convergence::Stratified => !(moment.plan.settings.render.error > 0.0),
        Convergence::Photons => false,
    }
}

/// Adds up the work to come over all cells.
fn expectation(moment: &Moment<'_>) -> Expectation {
    let Moment { state, plan, photons, .. } = moment;
    let Render { samples: most, error, .. } = plan.settings.render;
    let begin = Instant::now();
    let is_known = !(error > 0.0) || state.is_foreseen();
    let pixels = state.film.crop().area();
    let at_once = photons.map_or(u32::MAX, PhotonStore::at_once);
    let jobs = |done, end| jobs_to_come(done, end, pixels, at_once);
    let total = is_known.then(|| state.seconds() + state.seconds_to_come(most, jobs));
    let passes = photons.map_or([0; 2], |_| state.passes(most));
    Expectation { due: Instant::now() + EXPECTATION_SHARE * begin.elapsed(), total, passes }
}
