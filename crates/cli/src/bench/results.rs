//! Benchmark results, as written by `bench --json` and read by `--baseline`.

use serde::{Deserialize, Serialize};

use super::bias::SquaredBias;
use super::brightness::BrightnessDifference;
use super::slope::{ErrorOverTimeSlope, TimeToError, interpolate_time_to_error, mean_loglog_slope};
use super::statistics::mean_and_standard_error;

/// Target errors. The results include the time needed to reach each of them.
pub const TARGETS: [f64; 3] = [1e-2, 1e-3, 1e-4];

/// Results of a benchmark.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Version of glimt.
    pub glimt: String,
    /// Rendering threads.
    pub threads: usize,
    /// Total time in seconds.
    pub seconds: f64,
    /// The scenes, in argument order.
    pub scenes: Vec<SceneResult>,
}

/// Results of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneResult {
    /// The scene's path as passed by the caller.
    pub scene: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The references.
    pub reference: ReferenceResult,
    /// The methods in table order.
    pub methods: Vec<MethodAnalysis>,
}

/// A scene's references.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceResult {
    /// Samples per pixel of each reference, or `None` if the references are files.
    pub samples: Option<f64>,
    /// relMSE of each reference, estimated from the difference between the two references, or 0 if both are
    /// the same file.
    pub noise: f64,
    /// Seconds spent rendering both references, possibly in an earlier run.
    pub seconds: Option<f64>,
    /// Whether the references were loaded from the cache.
    pub is_cached: bool,
    /// The reference files. Empty if the references were rendered.
    pub files: Vec<String>,
}

/// Results for one method on one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MethodAnalysis {
    /// Name shown in tables.
    pub name: String,
    /// Seconds for reading files, building acceleration structures and preparing lights.
    pub setup_seconds: f64,
    /// The steps in order of time.
    pub steps: Vec<StepResult>,
    /// Slope of error over time on log–log axes, fitted to all steps.
    pub slope: Option<ErrorOverTimeSlope>,
    /// Slope of error over time on log–log axes between the last two steps.
    pub last_slope: Option<ErrorOverTimeSlope>,
    /// Times to reach `TARGETS`.
    pub time_to: [Option<TimeToError>; TARGETS.len()],
    /// Whether the method is biased.
    pub verdict: BiasVerdict,
}

/// Results for one sample count or one time limit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepResult {
    /// Samples per pixel. For a time limit, the median over the images.
    pub samples: f64,
    /// The time limit in seconds.
    pub budget: Option<f64>,
    /// Median time for photon mapping and rendering, in seconds.
    pub seconds: f64,
    /// Median relMSE.
    pub relmse: f64,
    /// Minimum and maximum relMSE.
    pub spread: [f64; 2],
    /// Standard error that reference noise adds to each relMSE.
    pub uncertainty: f64,
    /// The estimated bias, or `None` if there are too few images.
    pub bias: Option<SquaredBias>,
    /// Difference in brightness between the images and the references, or `None` if there are too few images.
    #[serde(default)]
    pub brightness: Option<BrightnessDifference>,
    /// The individual images.
    pub pictures: Vec<ImageMeasurement>,
}

/// Measurement of one image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageMeasurement {
    /// Random seed of the image.
    pub seed: u32,
    /// Average samples per pixel.
    pub samples: f64,
    /// Time for photon mapping and rendering, in seconds.
    pub seconds: f64,
    /// relMSE of the image. May be negative if it is below the noise of the references.
    pub relmse: f64,
}

/// Whether a method is biased.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum BiasVerdict {
    /// Too few seeds to decide.
    Unknown,
    /// No bias was found.
    NoneFound {
        /// Upper confidence bound on the squared bias.
        bound: f64,
    },
    /// There is a bias, which decreases as samples are added.
    Falls {
        /// Squared bias at the last step, as a contribution to relMSE.
        size: f64,
        /// Fraction of the error caused by bias.
        share: f64,
    },
    /// There is a constant bias, which flattens the slope.
    Stays {
        /// Squared bias at the last step, as a contribution to relMSE.
        size: f64,
        /// Fraction of the error caused by bias.
        share: f64,
    },
}

impl BiasVerdict {
    /// Determines the verdict from the biases of the last two steps.
    pub(super) fn from_steps(steps: &[StepResult]) -> Self {
        let Some(last) = steps.last() else { return Self::Unknown };
        let Some(bias) = last.bias else { return Self::Unknown };
        if !bias.is_significant() {
            return Self::NoneFound { bound: bias.bound };
        }
        let errors: Vec<f64> = last.pictures.iter().map(|picture| picture.relmse).collect();
        let (size, share) = (bias.size, (bias.size / mean_and_standard_error(&errors).0).clamp(0.0, 1.0));
        let before = steps.len().checked_sub(2).and_then(|index| steps[index].bias);
        if before.is_some_and(|before| is_bias_decreasing(before, bias)) {
            Self::Falls { size, share }
        } else {
            Self::Stays { size, share }
        }
    }
}

/// Whether the bias decreased significantly.
fn is_bias_decreasing(before: SquaredBias, after: SquaredBias) -> bool {
    /// A bias counts as decreasing if quadrupling the samples scales it by at most this factor. The ratio is
    /// 0.4 for photon mapping and 1 for a constant bias.
    const MAX_RATIO: f64 = 0.8;
    let error = (before.error * before.error + after.error * after.error).sqrt();
    after.size < MAX_RATIO * before.size && before.size - after.size > 2.0 * error
}

impl MethodAnalysis {
    pub(super) fn new(name: String, setup_seconds: f64, steps: Vec<StepResult>) -> Self {
        let middle: Vec<(f64, f64)> = steps.iter().map(|step| (step.seconds, step.relmse)).collect();
        let verdict = BiasVerdict::from_steps(&steps);
        // Do not extrapolate the error if the bias is constant.
        let is_expected =
            |time: &TimeToError| time.is_measured || !matches!(verdict, BiasVerdict::Stays { .. });
        Self {
            name,
            setup_seconds,
            slope: mean_loglog_slope(&error_series_by_image_number(&steps)),
            last_slope: mean_loglog_slope(&error_series_by_image_number(
                &steps[steps.len().saturating_sub(2)..],
            )),
            time_to: TARGETS.map(|target| interpolate_time_to_error(target, &middle).filter(is_expected)),
            verdict,
            steps,
        }
    }
}

/// Groups the results into one series per image number: the first image of every step, the second image of
/// every step, and so on.
fn error_series_by_image_number(steps: &[StepResult]) -> Vec<Vec<(f64, f64)>> {
    let count = steps.iter().map(|step| step.pictures.len()).min().unwrap_or(0);
    let point = |step: &StepResult, index: usize| (step.pictures[index].seconds, step.pictures[index].relmse);
    (0..count).map(|index| steps.iter().map(|step| point(step, index)).collect()).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A synthetic step with three images whose errors are close to `relmse`.
    pub(crate) fn synthetic_step_result(samples: f64, seconds: f64, relmse: f64, bias: f64) -> StepResult {
        let of = |(number, factor): (u32, f64)| ImageMeasurement {
            seed: number,
            samples,
            seconds: seconds * factor,
            relmse: relmse * factor,
        };
        let p_value = if bias > 0.0 { 1e-9 } else { 0.4 };
        StepResult {
            samples,
            budget: None,
            seconds,
            relmse,
            spread: [relmse * 0.9, relmse * 1.1],
            uncertainty: 1e-9,
            bias: Some(SquaredBias { size: bias, error: bias * 0.01 + 1e-9, p_value, bound: bias + 1e-8 }),
            brightness: Some(BrightnessDifference {
                value: -0.01,
                error: 0.001,
                p_value: if bias > 0.0 { 1e-9 } else { 0.4 },
            }),
            pictures: [(1, 0.9), (2, 1.0), (3, 1.1)].map(of).to_vec(),
        }
    }

    /// A synthetic method with noise inversely proportional to time, plus a bias.
    pub(crate) fn synthetic_method(name: &str, noise: f64, bias: f64) -> MethodAnalysis {
        let steps = [1.0, 4.0, 16.0, 64.0]
            .map(|samples| synthetic_step_result(samples, samples * 0.01, noise / samples + bias, bias));
        MethodAnalysis::new(name.to_owned(), 0.003, steps.to_vec())
    }

    /// Two scenes with two methods each.
    pub(crate) fn synthetic_results() -> Results {
        let scene = |name: &str| SceneResult {
            scene: name.to_owned(),
            width: 128,
            height: 96,
            reference: ReferenceResult {
                samples: Some(4096.0),
                noise: 1e-5,
                seconds: Some(20.0),
                is_cached: false,
                files: Vec::new(),
            },
            methods: vec![synthetic_method("path", 0.2, 0.0), synthetic_method("whitted", 0.02, 0.01)],
        };
        Results {
            glimt: "0.1.0".to_owned(),
            threads: 2,
            seconds: 60.0,
            scenes: vec![scene("a.toml"), scene("b & <c>.toml")],
        }
    }

    #[test]
    fn constant_and_decreasing_bias_are_distinguished() {
        let of = |sizes: &[f64]| {
            let steps: Vec<StepResult> = (0..)
                .zip(sizes)
                .map(|(n, size)| synthetic_step_result(f64::from(1 << (2 * n)), 1.0, 0.01 + size, *size))
                .collect();
            BiasVerdict::from_steps(&steps)
        };
        assert!(matches!(of(&[1e-3, 1e-3, 1e-3]), BiasVerdict::Stays { .. }));
        assert!(matches!(of(&[1e-3, 4e-4, 1.6e-4]), BiasVerdict::Falls { .. }));
        assert!(matches!(of(&[1e-3, 9e-4]), BiasVerdict::Stays { .. }), "not significant");
        assert!(matches!(of(&[1e-3]), BiasVerdict::Stays { .. }), "a single step");
        assert!(matches!(of(&[0.0, 0.0]), BiasVerdict::NoneFound { bound } if bound > 0.0));
        assert_eq!(of(&[]), BiasVerdict::Unknown);
        let BiasVerdict::Stays { size, share } = of(&[0.03]) else { panic!("expected a constant bias") };
        assert!((size - 0.03).abs() < 1e-12 && (share - 0.75).abs() < 1e-9, "{size} {share}");
    }

    #[test]
    fn slopes_use_all_steps_and_the_last_two() {
        let method = synthetic_method("whitted", 0.02, 0.01);
        let (all, last) = (method.slope.expect("a slope"), method.last_slope.expect("a slope"));
        assert!(all.value < -0.15 && last.value > -0.1, "{all:?} {last:?}");
        assert!((synthetic_method("path", 0.2, 0.0).slope.expect("a slope").value + 1.0).abs() < 1e-9);
    }

    #[test]
    fn results_round_trip_through_json() {
        let text = serde_json::to_string(&synthetic_results()).expect("JSON");
        assert_eq!(serde_json::from_str::<Results>(&text).expect("results"), synthetic_results());
    }
}
