//! Runs a benchmark: all scenes, each with its references and methods.

use std::path::Path;
use std::sync::Arc;

use super::measure::MethodMeasurer;
use super::methods::methods_to_measure;
use super::reference::{
    ReferenceBudget, ReferenceFingerprints, ReferenceRenderer, SEEDS, SceneReferences, load_reference_files,
    max_measurable_samples,
};
use super::request::{
    BenchError, BenchEvent, BenchRequest, PartialResultsError, ReferenceSource, StepSchedule,
};
use super::results::{Results, SceneResult, StepResult};
use super::time_budget::TimeBudget;
use crate::control::CancelToken;
use crate::pipeline::headless::HeadlessSession;
use crate::pipeline::not_a_scene_file_error;
use crate::pipeline::protocol::Failure;
use crate::pipeline::settings::Overrides;
use crate::pipeline::words;
use crate::scene;
use crate::scene::description::Scene;

/// Default size of the longer side in pixels.
const LONG_SIDE: u32 = 96;

/// Runs a benchmark. Checks all scenes before measuring the first one.
///
/// # Errors
/// Returns an error if a scene or an argument is invalid, or if the benchmark fails or is canceled. The error
/// contains the results of the completed scenes.
pub fn run(
    request: &BenchRequest,
    token: &CancelToken,
    emit: &dyn Fn(BenchEvent),
) -> Result<Results, Box<PartialResultsError>> {
    let mut budget = TimeBudget::new(request.within, request.scenes.len());
    let mut results =
        Results { glimt: env!("CARGO_PKG_VERSION").to_owned(), threads: 0, seconds: 0.0, scenes: Vec::new() };
    let runs: Vec<SceneRun<'_>> =
        request.scenes.iter().map(|path| SceneRun { request, path, token, emit }).collect();
    let mut measure = || {
        check_seed_overlap(request)?;
        check_scenes(&runs)?;
        for run in &runs {
            results.scenes.push(run.measure(&mut budget, &mut results.threads)?);
            budget.end_scene();
        }
        Ok(())
    };
    let measured = measure();
    results.seconds = budget.elapsed_seconds();
    match measured {
        Ok(()) => Ok(results),
        Err(error) => Err(Box::new(PartialResultsError { error, done: results })),
    }
}

/// Checks all scenes and collects their errors.
fn check_scenes(runs: &[SceneRun<'_>]) -> Result<(), BenchError> {
    let mut wrong = Vec::new();
    for run in runs {
        match run.load_and_validate(&mut HeadlessSession::default()) {
            Ok(_) => {}
            Err(BenchError::Failed(Failure::Scene(diagnostics))) => wrong.extend(diagnostics),
            Err(
                error @ (BenchError::Failed(Failure::Work(_)) | BenchError::Call(_) | BenchError::Canceled),
            ) => {
                return Err(error);
            }
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(BenchError::Failed(Failure::Scene(wrong))) }
}

/// Returns the size of a scene's benchmark images. Computes dimensions missing from `requested` with the
/// scene's aspect ratio and a default size.
pub fn benchmark_image_size(scene: &Scene, requested: (Option<u32>, Option<u32>)) -> (u32, u32) {
    let (width, height) = (f64::from(scene.render.width), f64::from(scene.render.height));
    let side = |length: f64| length.round().clamp(1.0, 65536.0) as u32;
    match requested {
        (Some(width), Some(height)) => (width, height),
        (Some(requested), None) => (requested, side(height * f64::from(requested) / width)),
        (None, Some(requested)) => (side(width * f64::from(requested) / height), requested),
        (None, None) => {
            let scale = (f64::from(LONG_SIDE) / width.max(height)).min(1.0);
            (side(width * scale), side(height * scale))
        }
    }
}

/// Checks that the seeds of images and references do not overlap.
fn check_seed_overlap(request: &BenchRequest) -> Result<(), BenchError> {
    /// Maximum number of steps in the default schedule.
    const MAX_STEPS: u32 = 64;
    let steps = match &request.steps {
        StepSchedule::Climb => MAX_STEPS,
        StepSchedule::Samples(list) => list.len() as u32,
        StepSchedule::Seconds(list) => list.len() as u32,
    };
    let last = u64::from(request.seed) + u64::from(steps) * u64::from(request.seeds);
    if last < u64::from(SEEDS[0]) {
        return Ok(());
    }
    let advice = "the references use the same seeds; choose a smaller --seed";
    Err(BenchError::Call(format!("--seed {} is too large: {advice}", request.seed)))
}

/// A benchmark of one scene.
pub(super) struct SceneRun<'a> {
    pub(super) request: &'a BenchRequest,
    pub(super) path: &'a Path,
    pub(super) token: &'a CancelToken,
    emit: &'a dyn Fn(BenchEvent),
}

/// Error message for a scene that was saved while it was being measured.
fn changed_while_measured_message(scene: &Path) -> String {
    format!("{} or one of its files changed during the measurement; run the benchmark again", scene.display())
}

/// A validated scene, ready to be measured.
struct ValidatedScene {
    scene: Arc<Scene>,
    /// References specified as files.
    given: Option<SceneReferences>,
    /// Overrides shared by all images and the references.
    common: Overrides,
    keys: ReferenceFingerprints,
}

impl SceneRun<'_> {
    /// Reads and validates the scene and its files.
    fn load_and_validate(&self, session: &mut HeadlessSession) -> Result<ValidatedScene, BenchError> {
        let request = self.request;
        self.report_task_begin("reading", None);
        let foreign = not_a_scene_file_error(self.path).map_or(Ok(()), |error| Err(vec![error]));
        let loaded = foreign
            .and_then(|()| scene::load(self.path, &request.common.sets))
            .map_err(|diagnostics| BenchError::Failed(Failure::Scene(diagnostics)))?;
        let given = match &request.reference {
            ReferenceSource::Files(files) => Some(load_reference_files(files)?),
            ReferenceSource::InTime | ReferenceSource::Samples(_) => None,
        };
        let (width, height) = match &given {
            Some(reference) => (
                reference.two.both_references().measured_image().width,
                reference.two.both_references().measured_image().height,
            ),
            None => benchmark_image_size(&loaded.scene, (request.width, request.height)),
        };
        let common = Overrides {
            width: Some(width),
            height: Some(height),
            error: Some(0.0),
            ..request.common.clone()
        };
        let keys = self.reference_renderer(&common).fingerprints_from_test_renders(session)?;
        self.check_output_input_overlap(session)?;
        Ok(ValidatedScene { scene: Arc::clone(&loaded.scene), given, common, keys })
    }

    pub(super) fn reference_renderer<'a>(&'a self, common: &'a Overrides) -> ReferenceRenderer<'a> {
        let requested_samples = match &self.request.reference {
            ReferenceSource::Samples(samples) => Some(*samples),
            ReferenceSource::InTime | ReferenceSource::Files(_) => None,
        };
        ReferenceRenderer {
            scene: self.path,
            common,
            token: self.token,
            cache: self.request.cache.as_deref(),
            requested_samples,
        }
    }

    /// Measures the scene. Prepares it again first, because it may have been saved since the first check.
    fn measure(&self, budget: &mut TimeBudget, threads: &mut usize) -> Result<SceneResult, BenchError> {
        let mut session = HeadlessSession::default();
        let ValidatedScene { scene, given, common, keys } = self.load_and_validate(&mut session)?;
        let methods = methods_to_measure(&scene, &self.request.swept);
        budget.begin_scene(methods.len());
        let reference = match given {
            Some(reference) => reference,
            None => self.load_or_render_references(&mut session, &common, &keys, budget)?,
        };
        drop(session);
        let (width, height) = (
            reference.two.both_references().measured_image().width,
            reference.two.both_references().measured_image().height,
        );
        self.report_references(&reference, width, height);
        let max_samples = max_measurable_samples(reference.result.samples);
        let mut measured = Vec::new();
        for method in &methods {
            budget.begin_method();
            let method = MethodMeasurer {
                run: self,
                common: &common,
                method,
                keys: &keys,
                two: &reference.two,
                max_samples,
            };
            measured.push(method.measure(budget, threads)?);
            budget.end_method();
        }
        let scene = self.path.to_string_lossy().into_owned();
        Ok(SceneResult { scene, width, height, reference: reference.result, methods: measured })
    }

    /// Loads cached references if they are good enough. Otherwise, renders new references.
    fn load_or_render_references(
        &self,
        session: &mut HeadlessSession,
        common: &Overrides,
        keys: &ReferenceFingerprints,
        budget: &TimeBudget,
    ) -> Result<SceneReferences, BenchError> {
        let amount = match &self.request.reference {
            ReferenceSource::Samples(samples) => ReferenceBudget { samples: *samples, seconds: None },
            ReferenceSource::InTime | ReferenceSource::Files(_) => ReferenceBudget::from_time_limit(
                budget.reference_allowance(),
                self.request.steps.max_samples(),
            ),
        };
        let maker = self.reference_renderer(common);
        if let Some(kept) = maker.load_cached(keys, amount) {
            return Ok(kept);
        }
        let begin = |left: usize| {
            let seconds = amount
                .seconds
                .map(|seconds| budget.estimate_seconds_to_end(seconds * left as f64 / 2.0, true));
            self.report_task_begin(&format!("reference {} of 2", 3 - left), seconds);
        };
        let made = maker.render_reference_pair(session, amount, begin)?;
        if made.keys == *keys { Ok(maker.store_in_cache(made)) } else { Err(self.scene_changed_error()) }
    }

    /// Returns the error for a scene that was saved while it was being measured.
    pub(super) fn scene_changed_error(&self) -> BenchError {
        BenchError::Failed(Failure::Work(changed_while_measured_message(self.path)))
    }

    /// Checks that no output file is an input of the scene.
    fn check_output_input_overlap(&self, session: &HeadlessSession) -> Result<(), BenchError> {
        match self.request.targets.iter().find(|target| session.depends_on_file(target)) {
            Some(target) => Err(BenchError::Call(format!(
                "cannot write {}: {} depends on it; choose another file",
                target.display(),
                self.path.display()
            ))),
            None => Ok(()),
        }
    }

    fn report_references(&self, reference: &SceneReferences, width: u32, height: u32) {
        if !reference.warnings.is_empty() {
            (self.emit)(BenchEvent::Warnings(reference.warnings.clone()));
        }
        if let Some(why) = &reference.cache_error {
            self.report_task_done(&format!("could not cache the references: {why}"));
        }
        let result = &reference.result;
        let made = match (result.is_cached, result.seconds) {
            (true, _) => "from the cache".to_owned(),
            (false, Some(seconds)) => format!("rendered in {}", words::format_seconds(seconds)),
            (false, None) => "from files".to_owned(),
        };
        self.report_task_done(&format!(
            "{width}×{height}-pixel references {made}, relMSE {:.1e} each",
            result.noise
        ));
    }

    pub(super) fn report_task_begin(&self, what: &str, left: Option<f64>) {
        let what = format!("{}: {what}", self.path.display());
        (self.emit)(BenchEvent::Begins { what, left });
    }

    pub(super) fn report_step(&self, method: &str, step: &StepResult) {
        let (scene, method) = (self.path.to_string_lossy().into_owned(), method.to_owned());
        (self.emit)(BenchEvent::Point { scene, method, seconds: step.seconds, relmse: step.relmse });
    }

    pub(super) fn report_task_done(&self, what: &str) {
        (self.emit)(BenchEvent::Done(format!("{}: {what}", self.path.display())));
    }
}

impl StepSchedule {
    /// Returns the largest sample count, if known.
    fn max_samples(&self) -> Option<u32> {
        match self {
            Self::Samples(list) => list.iter().max().copied(),
            Self::Climb | Self::Seconds(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_keep_the_aspect_ratio() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/cornell.toml");
        let of = |width, height, requested| {
            let mut scene = Scene::clone(&scene::load(Path::new(file), &[]).expect("a scene").scene);
            (scene.render.width, scene.render.height) = (width, height);
            benchmark_image_size(&scene, requested)
        };
        assert_eq!(of(640, 480, (None, None)), (96, 72));
        assert_eq!(of(480, 640, (None, None)), (72, 96));
        assert_eq!(of(64, 32, (None, None)), (64, 32), "never larger than the scene");
        assert_eq!(of(65536, 1, (None, None)), (96, 1));
        assert_eq!(of(640, 480, (Some(40), None)), (40, 30));
        assert_eq!(of(640, 480, (None, Some(30))), (40, 30));
        assert_eq!(of(640, 480, (Some(7), Some(9))), (7, 9));
    }

    #[test]
    fn errors_keep_results_of_earlier_scenes() {
        let folder = tempfile::tempdir().expect("a folder");
        let request = two_scenes(folder.path());
        // Remove the second scene while measuring the first.
        let emit = |news| match news {
            BenchEvent::Point { .. } => std::fs::remove_file(&request.scenes[1]).unwrap_or_default(),
            BenchEvent::Begins { .. } | BenchEvent::Done(_) | BenchEvent::Warnings(_) => {}
        };
        let Err(unfinished) = run(&request, &CancelToken::new(), &emit) else {
            panic!("expected an error because the scene was removed")
        };
        assert!(matches!(unfinished.error, BenchError::Failed(_)), "{:?}", unfinished.error);
        let done: Vec<_> = unfinished.done.scenes.iter().map(|scene| scene.methods.len()).collect();
        assert_eq!(done, [3]);
    }

    /// Writes two scenes to a folder and returns a request for a quick benchmark that also caches references
    /// there.
    fn two_scenes(folder: &Path) -> BenchRequest {
        let scenes = ["a.toml", "b.toml"].map(|name| folder.join(name));
        // Use different colors, because identical scenes would share references.
        scenes.iter().zip(["1", "2"]).for_each(|(scene, color)| write(scene, color));
        BenchRequest {
            scenes: scenes.into(),
            width: Some(4),
            height: Some(4),
            steps: StepSchedule::Samples(vec![1]),
            seeds: 2,
            seed: 1,
            reference: ReferenceSource::Samples(2),
            within: 10.0,
            cache: Some(folder.join("cache")),
            ..BenchRequest::default()
        }
    }

    /// Writes a scene with a constant environment.
    fn write(scene: &Path, color: &str) {
        let text =
            format!("[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n[environment]\ncolor = {color}\n");
        std::fs::write(scene, text).expect("written");
    }

    #[test]
    fn scenes_saved_before_measurement_are_reloaded() {
        let folder = tempfile::tempdir().expect("a folder");
        let request = two_scenes(folder.path());
        let save = |news| match news {
            BenchEvent::Point { scene, .. } if scene.ends_with("a.toml") => write(&request.scenes[1], "3"),
            BenchEvent::Point { .. }
            | BenchEvent::Begins { .. }
            | BenchEvent::Done(_)
            | BenchEvent::Warnings(_) => {}
        };
        let measured = run(&request, &CancelToken::new(), &save).expect("results of both scenes");
        for method in measured.scenes.iter().flat_map(|scene| &scene.methods) {
            assert_eq!(method.steps[0].relmse, 0.0, "{}: the old version was measured", method.name);
        }
        // Only the second version of the scene has cached references.
        let again = |color| {
            write(&request.scenes[1], color);
            let again = run(&request, &CancelToken::new(), &|_| {}).expect("results of both scenes");
            again.scenes[1].reference.is_cached
        };
        assert!(again("3"));
        assert!(!again("2"));
    }

    #[test]
    fn saving_a_scene_during_measurement_fails() {
        for moment in ["reference 2 of 2", "path, 1 sample, seed 2 of 2"] {
            let folder = tempfile::tempdir().expect("a folder");
            let request = two_scenes(folder.path());
            let save = |news| match news {
                BenchEvent::Begins { what, .. } if what.ends_with(&format!("b.toml: {moment}")) => {
                    write(&request.scenes[1], "3");
                }
                BenchEvent::Point { .. }
                | BenchEvent::Begins { .. }
                | BenchEvent::Done(_)
                | BenchEvent::Warnings(_) => {}
            };
            let Err(unfinished) = run(&request, &CancelToken::new(), &save) else {
                panic!("expected an error: saved at {moment}")
            };
            let BenchError::Failed(Failure::Work(message)) = &unfinished.error else { panic!("{moment}") };
            assert_eq!(*message, changed_while_measured_message(&request.scenes[1]));
            assert_eq!(unfinished.done.scenes.len(), 1);
            // References rendered from different versions are not cached.
            write(&request.scenes[1], "3");
            let again = run(&request, &CancelToken::new(), &|_| {}).expect("results of both scenes");
            assert!(!again.scenes[1].reference.is_cached, "{moment}");
            assert_eq!(again.scenes[1].methods[0].steps[0].relmse, 0.0, "{moment}");
        }
    }

    #[test]
    fn saving_a_scene_during_a_later_method_fails() {
        let folder = tempfile::tempdir().expect("a folder");
        let request = two_scenes(folder.path());
        let text =
            std::fs::read_to_string(&request.scenes[0]).expect("text") + "[render]\nambient = [1, 1, 1]\n";
        let save = |news| match news {
            BenchEvent::Begins { what, .. } if what.ends_with("a.toml: whitted, 1 sample, seed 2 of 2") => {
                std::fs::write(&request.scenes[0], &text).expect("written");
            }
            BenchEvent::Point { .. }
            | BenchEvent::Begins { .. }
            | BenchEvent::Done(_)
            | BenchEvent::Warnings(_) => {}
        };
        let Err(unfinished) = run(&request, &CancelToken::new(), &save) else {
            panic!("expected an error because the scene was saved")
        };
        let BenchError::Failed(Failure::Work(message)) = &unfinished.error else {
            panic!("expected a work error")
        };
        assert_eq!(*message, changed_while_measured_message(&request.scenes[0]));
    }

    #[test]
    fn image_and_reference_seeds_never_overlap() {
        let request = |seed| BenchRequest { seed, seeds: 6, ..BenchRequest::default() };
        assert!(check_seed_overlap(&request(1)).is_ok());
        assert!(check_seed_overlap(&request(u32::MAX - 6 * 64 - 2)).is_ok());
        let Err(BenchError::Call(message)) = check_seed_overlap(&request(u32::MAX - 6 * 64)) else {
            panic!("expected an error")
        };
        assert!(message.contains("--seed"), "{message}");
    }
}
