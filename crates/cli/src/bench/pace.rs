//! Times of a benchmark's parts, and the time left.

use std::time::Instant;

/// The part of a scene's time that its references may take.
const OF_REFERENCES: f64 = 0.75;

/// The time of a whole run.
pub(super) struct Pace {
    begin: Instant,
    within: f64,
    /// Scenes that have not ended.
    scenes: usize,
    methods: usize,
    /// When the scene under way is to end, in seconds from the beginning.
    scene_end: f64,
    /// Seconds of the last scene, and the time at which it began.
    last_scene: Option<f64>,
    scene_begin: f64,
    /// Seconds of this scene's finished methods.
    done: Vec<f64>,
    method_begin: f64,
}

impl Pace {
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

    pub(super) fn seconds(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    pub(super) fn begin_scene(&mut self, methods: usize) {
        let now = self.seconds();
        let left = (self.within - now).max(0.0);
        (self.methods, self.scene_begin) = (methods, now);
        self.scene_end = now + left / self.scenes.max(1) as f64;
        self.done.clear();
    }

    pub(super) fn end_scene(&mut self) {
        self.last_scene = Some(self.seconds() - self.scene_begin);
        self.scenes -= 1;
    }

    /// Seconds that both references may take.
    pub(super) fn of_references(&self) -> f64 {
        (self.scene_end - self.seconds()).max(0.0) * OF_REFERENCES
    }

    pub(super) fn begin_method(&mut self) {
        self.method_begin = self.seconds();
    }

    /// Seconds that the method under way took.
    pub(super) fn of_method(&self) -> f64 {
        self.seconds() - self.method_begin
    }

    /// Seconds that it may take in all.
    pub(super) fn allowance(&self) -> f64 {
        (self.scene_end - self.method_begin).max(0.0) / self.methods.max(1) as f64
    }

    pub(super) fn end_method(&mut self) {
        self.done.push(self.of_method());
        self.methods -= 1;
    }

    /// Seconds until everything is done, with those of the reference or method under way.
    pub(super) fn left(&self, of_this: f64, is_reference: bool) -> f64 {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let to_come = if is_reference { self.methods } else { self.methods.saturating_sub(1) };
        let of_each = if self.done.is_empty() {
            (self.scene_end - self.seconds() - of_this).max(0.0) / to_come.max(1) as f64
        } else {
            mean(&self.done)
        };
        let of_scene = self.last_scene.unwrap_or(self.scene_end - self.scene_begin);
        of_this + to_come as f64 * of_each + self.scenes.saturating_sub(1) as f64 * of_scene
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_shared_among_scenes_references_and_methods() {
        let near =
            |value: f64, expected: f64| assert!((value - expected).abs() < 1.0, "{value}, not {expected}");
        let mut pace = Pace::new(1000.0, 2);
        pace.begin_scene(4);
        near(pace.of_references(), 375.0);
        near(pace.left(375.0, true), 1000.0);
        pace.begin_method();
        near(pace.allowance(), 125.0);
        near(pace.left(20.0, false), 1000.0);
        pace.end_method();
        pace.begin_method();
        near(pace.allowance(), 166.7);
        near(pace.left(20.0, false), 520.0);
        pace.end_method();
        pace.end_scene();
        pace.begin_scene(1);
        near(pace.of_references(), 750.0);
    }
}
