//! One method on a scene: step after step, seed after seed.

use super::bias::bias;
use super::brightness::brightness;
use super::methods::Method;
use super::order::{Steps, Trouble};
use super::pace::Pace;
use super::reference::{Keys, SEEDS};
use super::results::{MethodResult, Picture, Step};
use super::run::Run;
use super::statistics::median;
use super::table::{error, samples};
use crate::compare::TwoReferences;
use crate::film::RadianceImage;
use crate::pipeline::protocol::{Failure, Report, Stage};
use crate::pipeline::session::{Rendered, Session};
use crate::pipeline::settings::Overrides;
use crate::pipeline::words;

/// From step to step of a ladder that is not given.
const FACTOR: u32 = 4;

/// One step that is to be made.
#[derive(Clone, Copy)]
struct Aim {
    index: u32,
    samples: u32,
    budget: Option<f64>,
}

/// A method on a scene.
pub(super) struct Measure<'a> {
    pub(super) run: &'a Run<'a>,
    /// Overrides that all pictures share with the references.
    pub(super) common: &'a Overrides,
    pub(super) method: &'a Method,
    /// Keys of the references.
    pub(super) keys: &'a Keys,
    pub(super) two: &'a TwoReferences,
    /// To which a ladder without given steps climbs.
    pub(super) most_samples: f64,
}

impl Measure<'_> {
    /// Measures it; notes how many threads rendered.
    pub(super) fn measure(&self, pace: &Pace, threads: &mut usize) -> Result<MethodResult, Trouble> {
        let mut session = Session::default();
        // What is made once is made here, and the first picture that counts finds warm caches.
        let begin = Aim { index: 0, samples: 1, budget: None };
        let first = self.render(&mut session, SEEDS[0], begin)?;
        *threads = first.report.settings.threads;
        let mut steps: Vec<Step> = Vec::new();
        let mut took = Vec::new();
        while let Some(aim) = self.next(&steps, &took, pace) {
            let before = pace.of_method();
            steps.push(self.step(&mut session, aim, pace, &took)?);
            took.push(pace.of_method() - before);
        }
        let last = self.render(&mut session, SEEDS[0], begin)?;
        if last.key != first.key || self.run.maker(self.common).keys(&mut session)? != *self.keys {
            return Err(self.run.changed());
        }
        Ok(MethodResult::new(self.method.name.clone(), setup(&first.report), steps))
    }

    /// The next step after these, which took so many seconds each.
    fn next(&self, steps: &[Step], took: &[f64], pace: &Pace) -> Option<Aim> {
        let index = steps.len() as u32;
        match &self.run.order.steps {
            Steps::Samples(list) => {
                list.get(steps.len()).map(|&samples| Aim { index, samples, budget: None })
            }
            Steps::Seconds(list) => {
                let aim = |&seconds| Aim { index, samples: u32::MAX, budget: Some(seconds) };
                list.get(steps.len()).map(aim)
            }
            Steps::Climb => {
                let samples =
                    FACTOR.checked_pow(index).filter(|samples| f64::from(*samples) <= self.most_samples)?;
                let expected = took.last().map_or(0.0, |seconds| seconds * f64::from(FACTOR));
                let has_time = pace.of_method() + expected <= pace.allowance();
                (index == 0 || has_time).then_some(Aim { index, samples, budget: None })
            }
        }
    }

    fn step(&self, session: &mut Session, aim: Aim, pace: &Pace, took: &[f64]) -> Result<Step, Trouble> {
        let seeds = self.run.order.seeds;
        let (mut pictures, mut images): (Vec<Picture>, Vec<RadianceImage>) = Default::default();
        let mut are_pixels_apart = true;
        for number in 0..seeds {
            let seed = self.run.order.seed + aim.index * seeds + number;
            self.say_picture(aim, number, pace, took, &pictures);
            let Rendered { image, report, .. } = self.render(session, seed, aim)?;
            let relmse = self.two.error(&image);
            are_pixels_apart &= report.photons.is_none();
            if !relmse.is_finite() {
                let name = &self.method.name;
                return Err(Trouble::Failed(Failure::Work(format!(
                    "{name}: the error of seed {seed} is not finite"
                ))));
            }
            pictures.push(Picture {
                seed,
                samples: report.image.samples.mean,
                seconds: rendering(&report),
                relmse,
            });
            images.push(image);
        }
        let brightness = brightness(self.two, &images, are_pixels_apart);
        let step = Step { brightness, ..summary(aim, pictures, &images, self.two) };
        let (name, seconds) = (&self.method.name, words::seconds(step.seconds));
        self.run.done(&format!(
            "{name}, {}: {seconds}, relMSE {}",
            samples(step.samples),
            error(step.relmse)
        ));
        self.run.point(name, &step);
        Ok(step)
    }

    fn say_picture(&self, aim: Aim, number: u32, pace: &Pace, took: &[f64], pictures: &[Picture]) {
        let order = self.run.order;
        let amount = match aim.budget {
            Some(seconds) => words::seconds(seconds),
            None => samples(aim.samples.into()),
        };
        let what = format!("{}, {amount}, seed {} of {}", self.method.name, number + 1, order.seeds);
        // Of one picture of this step, by those before it or by the step before.
        let each = match (pictures, took.last()) {
            ([.., last], _) => Some(last.seconds),
            ([], Some(step)) => Some(self.growth(aim) * step / f64::from(order.seeds)),
            ([], None) => None,
        };
        let to_come = f64::from(order.seeds - number);
        let left =
            each.map(|each| pace.left(each * (to_come + f64::from(order.seeds) * self.later(aim)), false));
        self.run.begins(&what, left);
    }

    /// Factor of a step's time over the step before.
    fn growth(&self, aim: Aim) -> f64 {
        let index = aim.index as usize;
        match &self.run.order.steps {
            Steps::Climb => f64::from(FACTOR),
            Steps::Samples(list) => f64::from(list[index]) / f64::from(list[index - 1]),
            Steps::Seconds(list) => list[index] / list[index - 1],
        }
    }

    /// The steps after this one, in times of it.
    fn later(&self, aim: Aim) -> f64 {
        let index = aim.index as usize;
        match &self.run.order.steps {
            Steps::Climb => 0.0,
            Steps::Samples(list) => {
                let sum: f64 = list[index + 1..].iter().map(|samples| f64::from(*samples)).sum();
                sum / f64::from(list[index])
            }
            Steps::Seconds(list) => list[index + 1..].iter().sum::<f64>() / list[index],
        }
    }

    fn render(&self, session: &mut Session, seed: u32, aim: Aim) -> Result<Rendered, Trouble> {
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
        Ok(session.render(self.run.path, &overrides, self.run.token)?)
    }
}

fn summary(aim: Aim, pictures: Vec<Picture>, images: &[RadianceImage], two: &TwoReferences) -> Step {
    let of = |value: fn(&Picture) -> f64| pictures.iter().map(value).collect::<Vec<f64>>();
    let errors = of(|picture| picture.relmse);
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    let most = errors.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Step {
        samples: median(&of(|picture| picture.samples)),
        budget: aim.budget,
        seconds: median(&of(|picture| picture.seconds)),
        relmse: median(&errors),
        spread: [least, most],
        uncertainty: images.first().map_or(0.0, |image| two.uncertainty(image)),
        bias: bias(two, images),
        brightness: None,
        pictures,
    }
}

/// Seconds of what every picture takes: its photons and its rays.
fn rendering(report: &Report) -> f64 {
    [Stage::Photons, Stage::Render].map(|stage| report.stages[stage as usize].seconds).iter().sum()
}

/// Seconds of what is done once: all before.
fn setup(report: &Report) -> f64 {
    report.stages[..Stage::Photons as usize].iter().map(|stage| stage.seconds).sum()
}
