//! Render state stored in addition to the film.

use serde::{Deserialize, Serialize};

use crate::integrators::RayCounters;
use crate::render::film_state::{EarlierProcessWork, FilmState};

/// Render state that is not part of the film.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct NonFilmRenderState {
    /// Sample goals decided for both halves of each cell.
    goals: Vec<[u32; 2]>,
    /// Sample count at which each tile's noise was last evaluated.
    judged: Vec<u32>,
    /// Reference brightness for relative noise.
    brightness: Option<f64>,
    /// Number of rays traced in each cell.
    cell_rays: Vec<u64>,
    /// Counts of camera, shadow, reflected, refracted and scattered rays, followed by the count of texture
    /// lookups.
    rays: [u64; 6],
    /// Render time in seconds.
    pub(super) seconds: f64,
    /// CPU time in seconds.
    processor_seconds: f64,
}

impl NonFilmRenderState {
    pub(super) fn from_film_state(state: &FilmState, rays: RayCounters, seconds: f64) -> Self {
        let RayCounters {
            camera_rays,
            shadow_rays,
            reflected_rays,
            refracted_rays,
            scattered_rays,
            texture_lookups,
        } = rays;
        Self {
            goals: state.goals.decided.clone(),
            judged: state.goals.judged.clone(),
            brightness: state.goals.brightness,
            cell_rays: state.rays.clone(),
            rays: [camera_rays, shadow_rays, reflected_rays, refracted_rays, scattered_rays, texture_lookups],
            seconds,
            processor_seconds: state.seconds,
        }
    }

    /// Returns the number of traced camera rays.
    pub(super) fn camera_rays(&self) -> u64 {
        let [camera_rays, ..] = self.rays;
        camera_rays
    }

    /// Whether the numbers are plausible. Implausible numbers could overflow sums or prevent a render from
    /// ending.
    pub(super) fn is_plausible(&self) -> bool {
        /// Maximum plausible time: about 30,000 years.
        const MAX_SECONDS: f64 = 1e12;
        const MAX_RAYS: u64 = 1 << 56;
        let is_time = |seconds: f64| (0.0..=MAX_SECONDS).contains(&seconds);
        let sum = |rays: &[u64]| rays.iter().try_fold(0_u64, |sum, rays| sum.checked_add(*rays));
        let have_rays = |rays: &[u64]| sum(rays).is_some_and(|sum| sum <= MAX_RAYS);
        is_time(self.seconds)
            && is_time(self.processor_seconds)
            && self.brightness.is_none_or(|brightness| brightness.is_finite() && brightness >= 0.0)
            && have_rays(&self.rays)
            && have_rays(&self.cell_rays)
    }

    /// Whether the state matches the film's size.
    pub(super) fn matches_film_size(&self, state: &FilmState) -> bool {
        self.goals.len() == state.done.len()
            && self.cell_rays.len() == state.done.len()
            && self.judged.len() == state.film.tile_count()
    }

    /// Restores a film's state. If the size does not match, returns `None` without changing anything.
    pub(super) fn restore_into(self, state: &mut FilmState) -> Option<()> {
        if !self.matches_film_size(state) {
            return None;
        }
        let [camera_rays, shadow_rays, reflected_rays, refracted_rays, scattered_rays, texture_lookups] =
            self.rays;
        let rays = RayCounters {
            camera_rays,
            shadow_rays,
            reflected_rays,
            refracted_rays,
            scattered_rays,
            texture_lookups,
        };
        state.goals.decided = self.goals;
        state.goals.judged = self.judged;
        state.goals.brightness = self.brightness;
        state.rays = self.cell_rays;
        state.before = EarlierProcessWork { rays, seconds: self.seconds };
        state.render_seconds = self.seconds;
        state.seconds = self.processor_seconds;
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> NonFilmRenderState {
        NonFilmRenderState {
            goals: vec![[4, 4]],
            judged: vec![2],
            brightness: Some(0.5),
            cell_rays: vec![70],
            rays: [10, 20, 30, 0, 5, 5],
            seconds: 3.5,
            processor_seconds: 7.0,
        }
    }

    #[test]
    fn implausible_numbers_are_detected() {
        assert!(state().is_plausible());
        for seconds in [-1e300, -1e-9, 1e300, f64::NAN, f64::INFINITY] {
            assert!(!NonFilmRenderState { seconds, ..state() }.is_plausible(), "{seconds}");
            assert!(
                !NonFilmRenderState { processor_seconds: seconds, ..state() }.is_plausible(),
                "{seconds}"
            );
        }
        for brightness in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(
                !NonFilmRenderState { brightness: Some(brightness), ..state() }.is_plausible(),
                "{brightness}"
            );
        }
        assert!(!NonFilmRenderState { rays: [u64::MAX, 1, 0, 0, 0, 0], ..state() }.is_plausible());
        assert!(!NonFilmRenderState { cell_rays: vec![1 << 57], ..state() }.is_plausible());
    }
}
