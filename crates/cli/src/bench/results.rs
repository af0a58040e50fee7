//! Results: the JSON of `bench --json`, which is also a baseline.

use serde::{Deserialize, Serialize};

use super::bias::Bias;
use super::brightness::Brightness;
use super::slope::{Slope, TimeTo, slope, time_to};
use super::statistics::mean;

/// Errors whose times are reported.
pub const TARGETS: [f64; 3] = [1e-2, 1e-3, 1e-4];

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Version.
    pub glimt: String,
    /// Threads that rendered.
    pub threads: usize,
    /// Seconds of the whole benchmark.
    pub seconds: f64,
    /// In the order of the call.
    pub scenes: Vec<SceneResult>,
}

/// A scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneResult {
    /// The file as named by the caller.
    pub scene: String,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Reference of the pictures.
    pub reference: ReferenceResult,
    /// In the order of the table.
    pub methods: Vec<MethodResult>,
}

/// The references of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceResult {
    /// Samples per pixel of each of the two; none of files.
    pub samples: Option<f64>,
    /// relMSE of one reference, by the difference of both; 0 if one file is both.
    pub noise: f64,
    /// Seconds of rendering both, now or when they were stored.
    pub seconds: Option<f64>,
    /// Whether they were there from before.
    pub is_cached: bool,
    /// Files of the references, if the call names them.
    pub files: Vec<String>,
}

/// A method on a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MethodResult {
    /// Its name in tables.
    pub name: String,
    /// Reading files, building trees, gathering lights.
    pub setup_seconds: f64,
    /// In the order of their times.
    pub steps: Vec<Step>,
    /// Slope of the error over the seconds, by all steps.
    pub slope: Option<Slope>,
    /// Slope of the error over the seconds, by the last two steps.
    pub last_slope: Option<Slope>,
    /// When it reaches the relMSEs that the table asks for, in their order.
    pub time_to: [Option<TimeTo>; TARGETS.len()],
    /// Whether it ends at what the references show.
    pub verdict: Verdict,
}

/// All pictures of one number of samples, or of one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Samples per pixel; the median where a time ended them.
    pub samples: f64,
    /// The time that ended them.
    pub budget: Option<f64>,
    /// Median of the seconds of sending photons and tracing.
    pub seconds: f64,
    /// Median of relMSE.
    pub relmse: f64,
    /// Least and greatest.
    pub spread: [f64; 2],
    /// The standard error that the noise of the references gives each.
    pub uncertainty: f64,
    /// Error that the pictures share. `None` for too few pictures.
    pub bias: Option<Bias>,
    /// Difference in brightness to the references. `None` for too few pictures.
    #[serde(default)]
    pub brightness: Option<Brightness>,
    /// Each.
    pub pictures: Vec<Picture>,
}

/// A picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// Its seed.
    pub seed: u32,
    /// Samples per pixel, on average.
    pub samples: f64,
    /// Seconds of sending photons and tracing.
    pub seconds: f64,
    /// Its error; by chance below 0 if it is smaller than the references can resolve.
    pub relmse: f64,
}

/// Whether a method ends at what the references show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Verdict {
    /// Too few seeds to tell.
    Unknown,
    /// No bias was found.
    NoneFound {
        /// One of this size, squared, would have been.
        bound: f64,
    },
    /// There is a bias that more samples make smaller.
    Falls {
        /// Its square at the last step, as a part of relMSE.
        size: f64,
        /// The part of the error that it is.
        share: f64,
    },
    /// There is a bias that more samples leave as it is: the slope flattens.
    Stays {
        /// Its square at the last step, as a part of relMSE.
        size: f64,
        /// The part of the error that it is.
        share: f64,
    },
}

impl Verdict {
    /// Verdict from the biases of the steps; the error is the mean at the last step.
    pub(super) fn of(steps: &[Step]) -> Self {
        let Some(last) = steps.last() else { return Self::Unknown };
        let Some(bias) = last.bias else { return Self::Unknown };
        if !bias.is_found() {
            return Self::NoneFound { bound: bias.bound };
        }
        let errors: Vec<f64> = last.pictures.iter().map(|picture| picture.relmse).collect();
        let (size, share) = (bias.size, (bias.size / mean(&errors).0).clamp(0.0, 1.0));
        let before = steps.len().checked_sub(2).and_then(|index| steps[index].bias);
        if before.is_some_and(|before| falls(before, bias)) {
            Self::Falls { size, share }
        } else {
            Self::Stays { size, share }
        }
    }
}

/// Whether the later bias is smaller, by more than chance.
fn falls(before: Bias, after: Bias) -> bool {
    /// Least ratio of the bias after four times the samples for a bias that stays. The bias of photons falls to 0.4, one that
    /// stays to 1.
    const STAYS: f64 = 0.8;
    let error = (before.error * before.error + after.error * after.error).sqrt();
    after.size < STAYS * before.size && before.size - after.size > 2.0 * error
}

impl MethodResult {
    pub(super) fn new(name: String, setup_seconds: f64, steps: Vec<Step>) -> Self {
        let middle: Vec<(f64, f64)> = steps.iter().map(|step| (step.seconds, step.relmse)).collect();
        let verdict = Verdict::of(&steps);
        // An error that a bias holds is not expected to fall.
        let is_expected = |time: &TimeTo| time.is_measured || !matches!(verdict, Verdict::Stays { .. });
        Self {
            name,
            setup_seconds,
            slope: slope(&series(&steps)),
            last_slope: slope(&series(&steps[steps.len().saturating_sub(2)..])),
            time_to: TARGETS.map(|target| time_to(target, &middle).filter(is_expected)),
            verdict,
            steps,
        }
    }
}

/// The first picture of every step, the second, …
fn series(steps: &[Step]) -> Vec<Vec<(f64, f64)>> {
    let count = steps.iter().map(|step| step.pictures.len()).min().unwrap_or(0);
    let point = |step: &Step, index: usize| (step.pictures[index].seconds, step.pictures[index].relmse);
    (0..count).map(|index| steps.iter().map(|step| point(step, index)).collect()).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A step of made-up numbers: three pictures around an error.
    pub(crate) fn step(samples: f64, seconds: f64, relmse: f64, bias: f64) -> Step {
        let of = |(number, factor): (u32, f64)| Picture {
            seed: number,
            samples,
            seconds: seconds * factor,
            relmse: relmse * factor,
        };
        let by_chance = if bias > 0.0 { 1e-9 } else { 0.4 };
        Step {
            samples,
            budget: None,
            seconds,
            relmse,
            spread: [relmse * 0.9, relmse * 1.1],
            uncertainty: 1e-9,
            bias: Some(Bias { size: bias, error: bias * 0.01 + 1e-9, by_chance, bound: bias + 1e-8 }),
            brightness: Some(Brightness {
                value: -0.01,
                error: 0.001,
                by_chance: if bias > 0.0 { 1e-9 } else { 0.4 },
            }),
            pictures: [(1, 0.9), (2, 1.0), (3, 1.1)].map(of).to_vec(),
        }
    }

    /// A method whose error halves with the time, on a bias.
    pub(crate) fn method(name: &str, noise: f64, bias: f64) -> MethodResult {
        let steps =
            [1.0, 4.0, 16.0, 64.0].map(|samples| step(samples, samples * 0.01, noise / samples + bias, bias));
        MethodResult::new(name.to_owned(), 0.003, steps.to_vec())
    }

    /// Two scenes with two methods each.
    pub(crate) fn results() -> Results {
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
            methods: vec![method("path", 0.2, 0.0), method("whitted", 0.02, 0.01)],
        };
        Results {
            glimt: "0.1.0".to_owned(),
            threads: 2,
            seconds: 60.0,
            scenes: vec![scene("a.toml"), scene("b & <c>.toml")],
        }
    }

    #[test]
    fn a_bias_that_stays_and_one_that_falls_are_told_apart() {
        let of = |sizes: &[f64]| {
            let steps: Vec<Step> = (0..)
                .zip(sizes)
                .map(|(n, size)| step(f64::from(1 << (2 * n)), 1.0, 0.01 + size, *size))
                .collect();
            Verdict::of(&steps)
        };
        assert!(matches!(of(&[1e-3, 1e-3, 1e-3]), Verdict::Stays { .. }));
        assert!(matches!(of(&[1e-3, 4e-4, 1.6e-4]), Verdict::Falls { .. }));
        assert!(matches!(of(&[1e-3, 9e-4]), Verdict::Stays { .. }), "by less than chance");
        assert!(matches!(of(&[1e-3]), Verdict::Stays { .. }), "nothing says that it falls");
        assert!(matches!(of(&[0.0, 0.0]), Verdict::NoneFound { bound } if bound > 0.0));
        assert_eq!(of(&[]), Verdict::Unknown);
        let Verdict::Stays { size, share } = of(&[0.03]) else { panic!("it stays") };
        assert!((size - 0.03).abs() < 1e-12 && (share - 0.75).abs() < 1e-9, "{size} {share}");
    }

    #[test]
    fn slopes_are_of_all_steps_and_of_the_last_two() {
        let method = method("whitted", 0.02, 0.01);
        let (all, last) = (method.slope.expect("a slope"), method.last_slope.expect("a slope"));
        assert!(all.value < -0.15 && last.value > -0.1, "{all:?} {last:?}");
        assert!((self::method("path", 0.2, 0.0).slope.expect("a slope").value + 1.0).abs() < 1e-9);
    }

    #[test]
    fn results_survive_their_json() {
        let text = serde_json::to_string(&results()).expect("JSON");
        assert_eq!(serde_json::from_str::<Results>(&text).expect("results"), results());
    }
}
