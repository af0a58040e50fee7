//! Measures one method on a scene, for all steps and seeds.

use super::bias::estimate_squared_bias;
use super::brightness::compare_brightness;
use super::methods::Method;
use super::reference::{ReferenceFingerprints, SEEDS};
use super::request::{BenchError, StepSchedule};
use super::results::{ImageMeasurement, MethodAnalysis, StepResult};
use super::run::SceneRun;
use super::statistics::median;
use super::table::{format_error_or_near_zero, format_samples_with_unit};
use super::time_budget::TimeBudget;
use crate::compare::IndependentReferences;
use crate::film::RadianceImage;
use crate::pipeline::headless::{HeadlessSession, RenderedImage};
use crate::pipeline::protocol::{Failure, Report, Stage};
use crate::pipeline::settings::Overrides;
use crate::pipeline::words;

/// Default ratio between the sample counts of consecutive steps.
const SAMPLE_RATIO: u32 = 4;

/// Sample count or time limit of one step.
#[derive(Clone, Copy)]
struct StepTarget {
    index: u32,
    samples: u32,
    budget: Option<f64>,
}

/// Measures a method on a scene.
pub(super) struct MethodMeasurer<'a> {
    pub(super) run: &'a SceneRun<'a>,
    /// Overrides shared by all images and the references.
    pub(super) common: &'a Overrides,
    pub(super) method: &'a Method,
    /// Fingerprints of the references.
    pub(super) keys: &'a ReferenceFingerprints,
    pub(super) two: &'a IndependentReferences,
    /// Default maximum number of samples per step.
    pub(super) max_samples: f64,
}

impl MethodMeasurer<'_> {
    /// Measures the method and sets `threads` to the number of rendering threads.
    pub(super) fn measure(
        &self,
        budget: &TimeBudget,
        threads: &mut usize,
    ) -> Result<MethodAnalysis, BenchError> {
        let mut session = HeadlessSession::default();
        // Warm the caches before measuring.
        let begin = StepTarget { index: 0, samples: 1, budget: None };
        let first = self.render_step_image(&mut session, SEEDS[0], begin)?;
        *threads = first.report.settings.threads;
        let mut steps: Vec<StepResult> = Vec::new();
        let mut took = Vec::new();
        while let Some(aim) = self.choose_next_step(&steps, &took, budget) {
            let before = budget.method_elapsed_seconds();
            steps.push(self.measure_step(&mut session, aim, budget, &took)?);
            took.push(budget.method_elapsed_seconds() - before);
        }
        let last = self.render_step_image(&mut session, SEEDS[0], begin)?;
        if last.key != first.key
            || self.run.reference_renderer(self.common).fingerprints_from_test_renders(&mut session)?
                != *self.keys
        {
            return Err(self.run.scene_changed_error());
        }
        Ok(MethodAnalysis::new(self.method.name.clone(), seconds_before_photons(&first.report), steps))
    }

    /// Chooses the next step from the previous steps and their durations in seconds.
    fn choose_next_step(
        &self,
        steps: &[StepResult],
        took: &[f64],
        budget: &TimeBudget,
    ) -> Option<StepTarget> {
        let index = steps.len() as u32;
        match &self.run.request.steps {
            StepSchedule::Samples(list) => {
                list.get(steps.len()).map(|&samples| StepTarget { index, samples, budget: None })
            }
            StepSchedule::Seconds(list) => {
                let aim = |&seconds| StepTarget { index, samples: u32::MAX, budget: Some(seconds) };
                list.get(steps.len()).map(aim)
            }
            StepSchedule::Climb => {
                let samples = SAMPLE_RATIO
                    .checked_pow(index)
                    .filter(|samples| f64::from(*samples) <= self.max_samples)?;
                let expected = took.last().map_or(0.0, |seconds| seconds * f64::from(SAMPLE_RATIO));
                let has_time = budget.method_elapsed_seconds() + expected <= budget.method_allowance();
                (index == 0 || has_time).then_some(StepTarget { index, samples, budget: None })
            }
        }
    }

    fn measure_step(
        &self,
        session: &mut HeadlessSession,
        aim: StepTarget,
        budget: &TimeBudget,
        took: &[f64],
    ) -> Result<StepResult, BenchError> {
        let seeds = self.run.request.seeds;
        let (mut pictures, mut images): (Vec<ImageMeasurement>, Vec<RadianceImage>) = Default::default();
        let mut are_pixels_independent = true;
        for number in 0..seeds {
            let seed = self.run.request.seed + aim.index * seeds + number;
            self.report_image_start(aim, number, budget, took, &pictures);
            let RenderedImage { image, report, .. } = self.render_step_image(session, seed, aim)?;
            let relmse = self.two.unbiased_relmse(&image);
            are_pixels_independent &= report.photons.is_none();
            if !relmse.is_finite() {
                let name = &self.method.name;
                return Err(BenchError::Failed(Failure::Work(format!(
                    "{name}: the error of seed {seed} is not finite"
                ))));
            }
            pictures.push(ImageMeasurement {
                seed,
                samples: report.image.samples.mean,
                seconds: photon_and_render_seconds(&report),
                relmse,
            });
            images.push(image);
        }
        let brightness = compare_brightness(self.two, &images, are_pixels_independent);
        let step = StepResult { brightness, ..summarize_step(aim, pictures, &images, self.two) };
        let (name, seconds) = (&self.method.name, words::format_seconds(step.seconds));
        self.run.report_task_done(&format!(
            "{name}, {}: {seconds}, relMSE {}",
            format_samples_with_unit(step.samples),
            format_error_or_near_zero(step.relmse)
        ));
        self.run.report_step(name, &step);
        Ok(step)
    }

    fn report_image_start(
        &self,
        aim: StepTarget,
        number: u32,
        budget: &TimeBudget,
        took: &[f64],
        pictures: &[ImageMeasurement],
    ) {
        let request = self.run.request;
        let amount = match aim.budget {
            Some(seconds) => words::format_seconds(seconds),
            None => format_samples_with_unit(aim.samples.into()),
        };
        let what = format!("{}, {amount}, seed {} of {}", self.method.name, number + 1, request.seeds);
        // Estimate the time per image from the previous image or step.
        let each = match (pictures, took.last()) {
            ([.., last], _) => Some(last.seconds),
            ([], Some(step)) => Some(self.expected_step_time_ratio(aim) * step / f64::from(request.seeds)),
            ([], None) => None,
        };
        let remaining = f64::from(request.seeds - number);
        let left = each.map(|each| {
            budget.estimate_seconds_to_end(
                each * (remaining + f64::from(request.seeds) * self.later_steps_time_ratio(aim)),
                false,
            )
        });
        self.run.report_task_begin(&what, left);
    }

    /// Returns the expected ratio of this step's time to the previous step's time.
    fn expected_step_time_ratio(&self, aim: StepTarget) -> f64 {
        let index = aim.index as usize;
        match &self.run.request.steps {
            StepSchedule::Climb => f64::from(SAMPLE_RATIO),
            StepSchedule::Samples(list) => f64::from(list[index]) / f64::from(list[index - 1]),
            StepSchedule::Seconds(list) => list[index] / list[index - 1],
        }
    }

    /// Returns the expected total time of all later steps, as a multiple of this step's time.
    fn later_steps_time_ratio(&self, aim: StepTarget) -> f64 {
        let index = aim.index as usize;
        match &self.run.request.steps {
            StepSchedule::Climb => 0.0,
            StepSchedule::Samples(list) => {
                let sum: f64 = list[index + 1..].iter().map(|samples| f64::from(*samples)).sum();
                sum / f64::from(list[index])
            }
            StepSchedule::Seconds(list) => list[index + 1..].iter().sum::<f64>() / list[index],
        }
    }

    fn render_step_image(
        &self,
        session: &mut HeadlessSession,
        seed: u32,
        aim: StepTarget,
    ) -> Result<RenderedImage, BenchError> {
        let Overrides { integrator, photons, shadows, clamp, accel, .. } = self.method.overrides.clone();
        let overrides = Overrides {
            integrator,
            photons,
            shadows,
            clamp,
            accel,
            seed: Some(seed),
            samples: Some(aim.samples),
            time_seconds: aim.budget,
            ..self.common.clone()
        };
        Ok(session.render_in_memory(self.run.path, &overrides, self.run.token)?)
    }
}

fn summarize_step(
    aim: StepTarget,
    pictures: Vec<ImageMeasurement>,
    images: &[RadianceImage],
    two: &IndependentReferences,
) -> StepResult {
    let of = |value: fn(&ImageMeasurement) -> f64| pictures.iter().map(value).collect::<Vec<f64>>();
    let errors = of(|picture| picture.relmse);
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    let most = errors.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    StepResult {
        samples: median(&of(|picture| picture.samples)),
        budget: aim.budget,
        seconds: median(&of(|picture| picture.seconds)),
        relmse: median(&errors),
        spread: [least, most],
        uncertainty: images.first().map_or(0.0, |image| two.relmse_standard_error(image)),
        bias: estimate_squared_bias(two, images),
        brightness: None,
        pictures,
    }
}

/// Seconds spent on photon mapping and rendering for one image.
fn photon_and_render_seconds(report: &Report) -> f64 {
    [Stage::Photons, Stage::Render].map(|stage| report.stages[stage as usize].seconds).iter().sum()
}

/// Seconds spent on the stages before photon mapping, which run once for all images.
fn seconds_before_photons(report: &Report) -> f64 {
    report.stages[..Stage::Photons as usize].iter().map(|stage| stage.seconds).sum()
}
