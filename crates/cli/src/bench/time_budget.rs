//! Divides a benchmark's time limit among scenes, references and methods, and estimates the time left.

use std::time::Instant;

/// Fraction of a scene's time reserved for its references.
const REFERENCE_SHARE: f64 = 0.75;

/// A benchmark's time budget.
pub(super) struct TimeBudget {
    begin: Instant,
    within: f64,
    /// Number of unfinished scenes.
    scenes: usize,
    methods: usize,
    /// Planned end of the current scene, in seconds since the start of the benchmark.
    scene_end: f64,
    /// Duration of the previous scene in seconds.
    last_scene: Option<f64>,
    /// Start of the current scene, in seconds since the start of the benchmark.
    scene_begin: f64,
    /// Durations of this scene's finished methods, in seconds.
    done: Vec<f64>,
    method_begin: f64,
}

impl TimeBudget {
    pub(super) fn new(within: f64, scenes: usize) -> Self {
        Self {
            begin: Instant::now(),
            within,
            scenes,
            methods: 0,
            scene_end: 0.0,
            last_scene: None,
            scene_begin: 0.0,
            done: Vec::new(),
            method_begin: 0.0,
        }
    }

    pub(super) fn elapsed_seconds(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    pub(super) fn begin_scene(&mut self, methods: usize) {
        let now = self.elapsed_seconds();
        let left = (self.within - now).max(0.0);
        (self.methods, self.scene_begin) = (methods, now);
        self.scene_end = now + left / self.scenes.max(1) as f64;
        self.done.clear();
    }

    pub(super) fn end_scene(&mut self) {
        self.last_scene = Some(self.elapsed_seconds() - self.scene_begin);
        self.scenes -= 1;
    }

    /// Time available for both references, in seconds.
    pub(super) fn reference_allowance(&self) -> f64 {
        (self.scene_end - self.elapsed_seconds()).max(0.0) * REFERENCE_SHARE
    }

    pub(super) fn begin_method(&mut self) {
        self.method_begin = self.elapsed_seconds();
    }

    /// Time spent on the current method so far, in seconds.
    pub(super) fn method_elapsed_seconds(&self) -> f64 {
        self.elapsed_seconds() - self.method_begin
    }

    /// Time available for the current method, in seconds.
    pub(super) fn method_allowance(&self) -> f64 {
        (self.scene_end - self.method_begin).max(0.0) / self.methods.max(1) as f64
    }

    pub(super) fn end_method(&mut self) {
        self.done.push(self.method_elapsed_seconds());
        self.methods -= 1;
    }

    /// Estimated seconds until the benchmark ends. `of_this` is the time left for the current reference or
    /// method.
    pub(super) fn estimate_seconds_to_end(&self, of_this: f64, is_reference: bool) -> f64 {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let remaining = if is_reference { self.methods } else { self.methods.saturating_sub(1) };
        let of_each = if self.done.is_empty() {
            (self.scene_end - self.elapsed_seconds() - of_this).max(0.0) / remaining.max(1) as f64
        } else {
            mean(&self.done)
        };
        let of_scene = self.last_scene.unwrap_or(self.scene_end - self.scene_begin);
        of_this + remaining as f64 * of_each + self.scenes.saturating_sub(1) as f64 * of_scene
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_divided_among_scenes_and_methods() {
        let near =
            |value: f64, expected: f64| assert!((value - expected).abs() < 1.0, "{value}, not {expected}");
        let mut budget = TimeBudget::new(1000.0, 2);
        budget.begin_scene(4);
        near(budget.reference_allowance(), 375.0);
        near(budget.estimate_seconds_to_end(375.0, true), 1000.0);
        budget.begin_method();
        near(budget.method_allowance(), 125.0);
        near(budget.estimate_seconds_to_end(20.0, false), 1000.0);
        budget.end_method();
        budget.begin_method();
        near(budget.method_allowance(), 166.7);
        near(budget.estimate_seconds_to_end(20.0, false), 520.0);
        budget.end_method();
        budget.end_scene();
        budget.begin_scene(1);
        near(budget.reference_allowance(), 750.0);
    }
}
