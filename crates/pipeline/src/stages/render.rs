//! The render stage: traces passes into a film, with progress and previews.
//!
//! The film is kept, so that an interrupted render can resume where it stopped and more samples can be added
//! to a finished render. In both cases, the result is bit-identical to an uninterrupted render, because every
//! sample is a function of its pixel and index, and each pixel sums its samples in order.

use super::photons::PhotonStore;
use super::{AbortReason, StageResult};
use crate::film::ConvergenceModel;
use crate::integrators::RayCounters;
use crate::protocol::reasons;
use crate::render::film_cache::FilmCache;
use crate::render::film_state::FilmState;
use crate::render::scheduler::{FilmToRender, RenderStageInputs, Scheduler};
use crate::scene::description::RenderOptions;

/// Renders the requested film until it has the requested number of samples or reaches the noise target.
///
/// # Errors
/// The token is canceled, or there is not enough memory for the film. The film keeps its samples.
pub(crate) fn render(
    films: &mut FilmCache,
    rendering: &RenderStageInputs<'_>,
) -> Result<StageResult<RayCounters>, AbortReason> {
    let RenderOptions { samples: wanted, error, .. } = rendering.plan.settings.render;
    let FilmToRender { key, ref share, force, max_bytes } = rendering.film;
    let is_other_image = films.current().is_some_and(|current| current.key != key);
    films.switch_to_cached(key, |kept| !force && kept.has_at_most_samples(wanted));
    if films.current().is_none() {
        let convergence = match rendering.photons.is_some_and(PhotonStore::has_lit_caustic_casters) {
            true => ConvergenceModel::Photons,
            false => ConvergenceModel::Stratified,
        };
        let state = || FilmState::new(key, rendering.plan, max_bytes, convergence, share.clone());
        let empty = films.replace_current_with_retry(state).map_err(AbortReason::from_work_error)?;
        let is_usable = match rendering.checkpointer.filter(|_| !force) {
            Some(checkpointer) => checkpointer.resume(empty, wanted)?,
            None => true,
        };
        if !is_usable {
            films.replace_current_with_retry(state).map_err(AbortReason::from_work_error)?;
        }
    }
    let Some(state) = films.current_mut() else {
        return Err(AbortReason::from_work_error("the film is missing"));
    };
    let budget = rendering.plan.limits.seconds;
    let is_part = state.is_finished_part;
    let finished = state.is_finished(rendering.plan);
    let had = state.min_unfinished_samples(wanted);
    let is_resumed = state.before.seconds > 0.0;
    let mut scheduler = Scheduler::new(state, rendering);
    if finished {
        scheduler.show();
        scheduler.state.traced = scheduler.rays_of_all_requests();
        let why = match (is_part, is_resumed, is_other_image) {
            (true, ..) => reasons::PART_COMPLETE,
            (false, true, _) => reasons::CHECKPOINT_COMPLETE,
            (false, false, true) => reasons::CACHED,
            (false, false, false) => reasons::UNCHANGED,
        };
        return Ok(StageResult::reused(scheduler.rays, why));
    }
    scheduler.state.ended_by = None;
    scheduler.state.is_passing = rendering.display.is_moved;
    scheduler.run()?;
    let rays = scheduler.rays;
    Ok(match (!scheduler.state.is_complete(wanted), had) {
        (true, _) => {
            state.ended_by = budget;
            StageResult::done(rays, reasons::TIME_LIMIT_REACHED)
        }
        (false, _) if state.goals.has_goal_below(wanted) => {
            let missed = state
                .count_finished_tiles_above_target(error.into())
                .map_or_else(String::new, |(tiles, worst)| {
                    format!("; {tiles} with a few noisy pixels (noise up to {worst:.2})")
                });
            StageResult::done(rays, format!("{}{missed}", reasons::NOISE_TARGET_REACHED))
        }
        (false, 0) => StageResult::done(rays, ""),
        (false, _) => StageResult::done(rays, reasons::continued_from_samples_reason(had)),
    })
}
