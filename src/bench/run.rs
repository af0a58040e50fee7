//! Scene after scene, method after method, step after step, seed after seed.

use super::bias::bias;
use super::methods::{Method, methods};
use super::order::{News, Order, ReferenceOrder, Steps, Trouble};
use super::pace::Pace;
use super::reference::{Amount, Maker, Reference, SEEDS, given};
use super::results::{MethodResult, Picture, Results, SceneResult, Step};
use super::statistics::median;
use crate::compare::TwoReferences;
use crate::control::CancelToken;
use crate::film::RadianceImage;
use crate::pipeline::protocol::{Failure, Report, Stage};
use crate::pipeline::session::Session;
use crate::pipeline::settings::Overrides;
use crate::pipeline::words;
use crate::scene;
use crate::scene::description::Scene;

/// Pixels on the longer side where nothing else is said.
const LONG_SIDE: u32 = 128;
/// The most that a ladder without given steps climbs to.
const MOST_SAMPLES: u32 = 1 << 16;
/// From step to step of it.
const FACTOR: u32 = 4;

/// Measure what the order asks for.
///
/// # Errors
/// A scene or the call is wrong, the work failed, or it was told to stop.
pub fn run(order: &Order, token: &CancelToken, tell: &dyn Fn(News)) -> Result<Results, Trouble> {
    check_seeds(order)?;
    let mut pace = Pace::new(order.within, order.scenes.len());
    let mut results = Results { glimt: env!("CARGO_PKG_VERSION").to_owned(), threads: 0, seconds: 0.0, scenes: Vec::new() };
    for path in &order.scenes {
        let scene = Run { order, path, token, tell }.scene(&mut pace, &mut results.threads)?;
        results.scenes.push(scene);
        pace.end_scene();
    }
    results.seconds = pace.seconds();
    Ok(results)
}

/// The size at which a scene is measured.
pub fn size(scene: &Scene, asked: (Option<u32>, Option<u32>)) -> (u32, u32) {
    let (width, height) = (f64::from(scene.render.width), f64::from(scene.render.height));
    let side = |length: f64| length.round().clamp(1.0, 65536.0) as u32;
    match asked {
        (Some(width), Some(height)) => (width, height),
        (Some(asked), None) => (asked, side(height * f64::from(asked) / width)),
        (None, Some(asked)) => (side(width * f64::from(asked) / height), asked),
        (None, None) => {
            let scale = (f64::from(LONG_SIDE) / width.max(height)).min(1.0);
            (side(width * scale), side(height * scale))
        }
    }
}

/// Each picture has a seed of its own, and none that of a reference.
fn check_seeds(order: &Order) -> Result<(), Trouble> {
    /// Steps that a ladder has at most.
    const MOST_STEPS: u32 = 64;
    let steps = match &order.steps {
        Steps::Climb => MOST_STEPS,
        Steps::Samples(list) => list.len() as u32,
        Steps::Seconds(list) => list.len() as u32,
    };
    let last = u64::from(order.seed) + u64::from(steps) * u64::from(order.seeds);
    if last < u64::from(SEEDS[0]) {
        return Ok(());
    }
    let way_out = "the seeds of the pictures would reach those of the references; choose a smaller --seed";
    Err(Trouble::Call(format!("--seed {} is too large: {way_out}", order.seed)))
}

/// What a scene is measured with.
struct Run<'a> {
    order: &'a Order,
    path: &'a std::path::Path,
    token: &'a CancelToken,
    tell: &'a dyn Fn(News),
}

impl Run<'_> {
    fn scene(&self, pace: &mut Pace, threads: &mut usize) -> Result<SceneResult, Trouble> {
        let order = self.order;
        let loaded = scene::load(self.path, &order.common.sets)
            .map_err(|diagnostics| Trouble::Failed(Failure::Scene(diagnostics)))?;
        let methods = methods(&loaded.scene, &order.toggles);
        pace.begin_scene(methods.len());
        let (reference, common) = self.reference(&loaded.scene, pace)?;
        let (width, height) = (reference.two.pair().a().width, reference.two.pair().a().height);
        self.say_reference(&reference, (width, height));
        let mut measured = Vec::new();
        for method in &methods {
            pace.begin_method();
            let method = Measure { run: self, common: &common, method, two: &reference.two };
            measured.push(method.measure(pace, threads)?);
            pace.end_method();
        }
        let scene = self.path.to_string_lossy().into_owned();
        Ok(SceneResult { scene, width, height, reference: reference.result, methods: measured })
    }

    /// The references, and the settings that all pictures share with them.
    fn reference(&self, scene: &Scene, pace: &Pace) -> Result<(Reference, Overrides), Trouble> {
        let order = self.order;
        let of_files = match &order.reference {
            ReferenceOrder::Files(files) => Some(given(files)?),
            ReferenceOrder::InTime | ReferenceOrder::Samples(_) => None,
        };
        let (width, height) = match &of_files {
            Some(reference) => (reference.two.pair().a().width, reference.two.pair().a().height),
            None => size(scene, (order.width, order.height)),
        };
        let common = Overrides {
            width: Some(width),
            height: Some(height),
            error: Some(0.0),
            ..order.common.clone()
        };
        self.begins("reading", None);
        let maker = Maker { scene: self.path, common: &common, token: self.token, cache: order.cache.as_deref() };
        let mut session = Session::default();
        let key = maker.key(&mut session)?;
        self.check_targets(&session)?;
        let amount = match (&order.reference, of_files) {
            (_, Some(reference)) => return Ok((reference, common)),
            (ReferenceOrder::Samples(samples), None) => Amount { samples: *samples, seconds: None },
            (ReferenceOrder::InTime | ReferenceOrder::Files(_), None) => {
                Amount::in_time(pace.of_references(), order.steps.most_samples())
            }
        };
        if let Some(kept) = maker.kept(&key, amount) {
            return Ok((kept, common));
        }
        let begin = |left: usize| {
            let seconds = amount.seconds.map(|seconds| pace.left(seconds * left as f64 / 2.0, true));
            self.begins(&format!("reference {} of 2", 3 - left), seconds);
        };
        Ok((maker.make(&mut session, &key, amount, begin)?, common))
    }

    /// No output may be a file that the scene is made of.
    fn check_targets(&self, session: &Session) -> Result<(), Trouble> {
        match self.order.targets.iter().find(|target| session.reads(target)) {
            Some(target) => Err(Trouble::Call(format!(
                "cannot write {}: it is a file that {} is made of; name another file",
                target.display(),
                self.path.display()
            ))),
            None => Ok(()),
        }
    }

    fn say_reference(&self, reference: &Reference, (width, height): (u32, u32)) {
        if !reference.warnings.is_empty() {
            (self.tell)(News::Warnings(reference.warnings.clone()));
        }
        if let Some(why) = &reference.unkept {
            self.done(&format!("the references are not kept: {why}"));
        }
        let result = &reference.result;
        let made = match (result.is_cached, result.seconds) {
            (true, _) => "kept from before".to_owned(),
            (false, Some(seconds)) => format!("in {}", words::seconds(seconds)),
            (false, None) => "from files".to_owned(),
        };
        self.done(&format!("references of {width}×{height} pixels {made}, relMSE {:.1e} each", result.noise));
    }

    fn begins(&self, what: &str, left: Option<f64>) {
        let what = format!("{}: {what}", self.path.display());
        (self.tell)(News::Begins { what, left });
    }

    fn done(&self, what: &str) {
        (self.tell)(News::Done(format!("{}: {what}", self.path.display())));
    }
}

impl Steps {
    /// The most samples, where that is known.
    fn most_samples(&self) -> Option<u32> {
        match self {
            Self::Samples(list) => list.iter().max().copied(),
            Self::Climb | Self::Seconds(_) => None,
        }
    }
}

/// One step that is to be made.
#[derive(Clone, Copy)]
struct Aim {
    index: u32,
    samples: u32,
    budget: Option<f64>,
}

/// A method on a scene.
struct Measure<'a> {
    run: &'a Run<'a>,
    common: &'a Overrides,
    method: &'a Method,
    two: &'a TwoReferences,
}

impl Measure<'_> {
    fn measure(&self, pace: &Pace, threads: &mut usize) -> Result<MethodResult, Trouble> {
        let mut session = Session::default();
        // What is made once is made here, and the first picture that counts finds warm caches.
        let begin = Aim { index: 0, samples: 1, budget: None };
        let first = self.render(&mut session, SEEDS[0], begin)?;
        *threads = first.1.settings.threads;
        let mut steps: Vec<Step> = Vec::new();
        let mut took = Vec::new();
        while let Some(aim) = self.next(&steps, &took, pace) {
            let before = pace.of_method();
            steps.push(self.step(&mut session, aim, pace, &took)?);
            took.push(pace.of_method() - before);
        }
        Ok(MethodResult::new(self.method.name.clone(), setup(&first.1), steps))
    }

    /// What comes after these steps, which took so many seconds each.
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
                let samples = FACTOR.checked_pow(index).filter(|samples| *samples <= MOST_SAMPLES)?;
                let expected = took.last().map_or(0.0, |seconds| seconds * f64::from(FACTOR));
                let has_time = pace.of_method() + expected <= pace.allowance();
                (index == 0 || has_time).then_some(Aim { index, samples, budget: None })
            }
        }
    }

    fn step(&self, session: &mut Session, aim: Aim, pace: &Pace, took: &[f64]) -> Result<Step, Trouble> {
        let seeds = self.run.order.seeds;
        let (mut pictures, mut images): (Vec<Picture>, Vec<RadianceImage>) = Default::default();
        for number in 0..seeds {
            let seed = self.run.order.seed + aim.index * seeds + number;
            self.say_picture(aim, number, pace, took, &pictures);
            let (image, report) = self.render(session, seed, aim)?;
            let relmse = self.two.error(&image);
            if !relmse.is_finite() {
                let name = &self.method.name;
                return Err(Trouble::Failed(Failure::Work(format!("{name}: the error of seed {seed} is not finite"))));
            }
            pictures.push(Picture { seed, samples: report.image.samples.mean, seconds: rendering(&report), relmse });
            images.push(image);
        }
        let step = summary(aim, pictures, &images, self.two);
        let (seconds, samples) = (words::seconds(step.seconds), step.samples);
        self.run.done(&format!("{}, {samples:.0} samples: {seconds}, relMSE {:.2e}", self.method.name, step.relmse));
        Ok(step)
    }

    fn say_picture(&self, aim: Aim, number: u32, pace: &Pace, took: &[f64], pictures: &[Picture]) {
        let order = self.run.order;
        let amount = match aim.budget {
            Some(seconds) => words::seconds(seconds),
            None => format!("{} samples", aim.samples),
        };
        let what = format!("{}, {amount}, seed {} of {}", self.method.name, number + 1, order.seeds);
        // Of one picture of this step, by those before it or by the step before.
        let each = match (pictures, took.last()) {
            ([.., last], _) => Some(last.seconds),
            ([], Some(step)) => Some(self.growth(aim) * step / f64::from(order.seeds)),
            ([], None) => None,
        };
        let to_come = f64::from(order.seeds - number);
        let left = each.map(|each| pace.left(each * (to_come + f64::from(order.seeds) * self.later(aim)), false));
        self.run.begins(&what, left);
    }

    /// How much longer a step takes than the one before.
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

    fn render(&self, session: &mut Session, seed: u32, aim: Aim) -> Result<(RadianceImage, Box<Report>), Trouble> {
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
        let rendered = session.render(self.run.path, &overrides, self.run.token)?;
        Ok((rendered.image, rendered.report))
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
