//! Tracing: pass after pass into a film, with progress and previews on the way.
//!
//! The film is kept: an interrupted render goes on where it was, more samples are added to those that are there,
//! and both give the bits of an uninterrupted one, because every sample is a function of its pixel and number and
//! every pixel's sum has the order of its samples.

use super::photons::PhotonStore;
use super::{Staged, Stop};
use crate::film::Convergence;
use crate::integrators::RayCounters;
use crate::render::film_cache::FilmCache;
use crate::render::film_state::FilmState;
use crate::render::scheduler::{Rendering, Scheduler};
use crate::scene::description::Render;
use crate::scene::fingerprint::Key;

/// Brings the film of this key to the requested samples or error.
///
/// # Errors
/// Cancelled; no memory for the film. The film keeps what it has.
pub(crate) fn render(
    key: Key,
    films: &mut FilmCache,
    rendering: &Rendering<'_>,
) -> Result<Staged<RayCounters>, Stop> {
    let Render { samples: wanted, error, .. } = rendering.plan.settings.render;
    let is_other = films.current().is_some_and(|current| current.key != key);
    films.select(key, |kept| !rendering.force && kept.has_at_most(wanted));
    if films.current().is_none() {
        let convergence = match rendering.photons.is_some_and(PhotonStore::are_sent) {
            true => Convergence::Photons,
            false => Convergence::Stratified,
        };
        let (plan, most_bytes) = (rendering.plan, rendering.most_film_bytes);
        let state = || FilmState::new(key, plan, most_bytes, convergence, rendering.share.clone());
        let empty = films.put(state).map_err(Stop::work)?;
        let is_of_use = match rendering.keeping.filter(|_| !rendering.force) {
            Some(keeping) => keeping.resume(empty, wanted)?,
            None => true,
        };
        if !is_of_use {
            films.put(state).map_err(Stop::work)?;
        }
    }
    let Some(state) = films.current_mut() else { return Err(Stop::work("the film is gone")) };
    let budget = rendering.plan.time_seconds;
    let is_part = state.is_finished_part;
    let finished = state.is_finished(rendering.plan);
    let had = state.samples(wanted);
    let is_resumed = state.before.seconds > 0.0;
    let mut scheduler = Scheduler::new(state, rendering);
    if finished {
        scheduler.show();
        scheduler.state.traced = scheduler.traced();
        let why = match (is_part, is_resumed, is_other) {
            (true, ..) => "the part is finished",
            (false, true, _) => "the checkpoint has all samples",
            (false, false, true) => "its film was kept",
            (false, false, false) => "nothing that it shows changed",
        };
        return Ok(Staged::reused(scheduler.rays, why));
    }
    scheduler.state.ended_by = None;
    scheduler.state.is_passing = rendering.is_moved;
    scheduler.run()?;
    let rays = scheduler.rays;
    Ok(match (!scheduler.state.is_complete(wanted), had) {
        (true, _) => {
            state.ended_by = budget;
            Staged::done(rays, "the time was up")
        }
        (false, _) if state.goals.are_below(wanted) => {
            let missed = state.missed(error.into()).map_or_else(String::new, |(tiles, worst)| {
                format!("; of {tiles}, where few pixels have it, it is up to {worst:.2}")
            });
            Staged::done(rays, format!("the noise of some tiles is below {error}{missed}"))
        }
        (false, 0) => Staged::done(rays, ""),
        (false, _) => Staged::done(rays, format!("went on after {had} samples")),
    })
}
