//! Scene after scene, method after method, step after step, seed after seed.

use std::path::Path;
use std::sync::Arc;

use super::measure::Measure;
use super::methods::methods;
use super::order::{News, Order, ReferenceOrder, Steps, Trouble, Unfinished};
use super::pace::Pace;
use super::reference::{Amount, Keys, Maker, Reference, SEEDS, given, most_measured};
use super::results::{Results, SceneResult, Step};
use crate::control::CancelToken;
use crate::pipeline::protocol::Failure;
use crate::pipeline::session::Session;
use crate::pipeline::settings::Overrides;
use crate::pipeline::words;
use crate::scene;
use crate::scene::description::Scene;

/// Pixels on the longer side by default.
const LONG_SIDE: u32 = 96;

/// Measure what the order asks for. All scenes are looked at before the first of them is measured.
///
/// # Errors
/// A scene or the call is wrong, the work failed, or a cancel token stopped it; with the scenes that were done by then.
pub fn run(order: &Order, token: &CancelToken, tell: &dyn Fn(News)) -> Result<Results, Box<Unfinished>> {
    let mut pace = Pace::new(order.within, order.scenes.len());
    let mut results =
        Results { glimt: env!("CARGO_PKG_VERSION").to_owned(), threads: 0, seconds: 0.0, scenes: Vec::new() };
    let runs: Vec<Run<'_>> = order.scenes.iter().map(|path| Run { order, path, token, tell }).collect();
    let mut measure = || {
        check_seeds(order)?;
        check_all(&runs)?;
        for run in &runs {
            results.scenes.push(run.scene(&mut pace, &mut results.threads)?);
            pace.end_scene();
        }
        Ok(())
    };
    let measured = measure();
    results.seconds = pace.seconds();
    match measured {
        Ok(()) => Ok(results),
        Err(trouble) => Err(Box::new(Unfinished { trouble, done: results })),
    }
}

/// All that is wrong with any of the scenes.
fn check_all(runs: &[Run<'_>]) -> Result<(), Trouble> {
    let mut wrong = Vec::new();
    for run in runs {
        match run.look(&mut Session::default()) {
            Ok(_) => {}
            Err(Trouble::Failed(Failure::Scene(diagnostics))) => wrong.extend(diagnostics),
            Err(trouble @ (Trouble::Failed(Failure::Work(_)) | Trouble::Call(_) | Trouble::Cancelled)) => {
                return Err(trouble);
            }
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(Trouble::Failed(Failure::Scene(wrong))) }
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

/// Inputs of a scene's measurement.
pub(super) struct Run<'a> {
    pub(super) order: &'a Order,
    pub(super) path: &'a Path,
    pub(super) token: &'a CancelToken,
    tell: &'a dyn Fn(News),
}

/// A scene that can be measured.
struct Looked {
    scene: Arc<Scene>,
    /// References that were given.
    given: Option<Reference>,
    /// The settings that all pictures share with the references.
    common: Overrides,
    keys: Keys,
}

impl Run<'_> {
    /// Reads it and everything that it names.
    fn look(&self, session: &mut Session) -> Result<Looked, Trouble> {
        let order = self.order;
        self.begins("reading", None);
        let loaded = scene::load(self.path, &order.common.sets)
            .map_err(|diagnostics| Trouble::Failed(Failure::Scene(diagnostics)))?;
        let given = match &order.reference {
            ReferenceOrder::Files(files) => Some(given(files)?),
            ReferenceOrder::InTime | ReferenceOrder::Samples(_) => None,
        };
        let (width, height) = match &given {
            Some(reference) => (reference.two.pair().a().width, reference.two.pair().a().height),
            None => size(&loaded.scene, (order.width, order.height)),
        };
        let common =
            Overrides { width: Some(width), height: Some(height), error: Some(0.0), ..order.common.clone() };
        let keys = self.maker(&common).keys(session)?;
        self.check_targets(session)?;
        Ok(Looked { scene: Arc::clone(&loaded.scene), given, common, keys })
    }

    pub(super) fn maker<'a>(&'a self, common: &'a Overrides) -> Maker<'a> {
        let asked = match &self.order.reference {
            ReferenceOrder::Samples(samples) => Some(*samples),
            ReferenceOrder::InTime | ReferenceOrder::Files(_) => None,
        };
        Maker { scene: self.path, common, token: self.token, cache: self.order.cache.as_deref(), asked }
    }

    /// Looks again: a person may have saved the scene since.
    fn scene(&self, pace: &mut Pace, threads: &mut usize) -> Result<SceneResult, Trouble> {
        let mut session = Session::default();
        let Looked { scene, given, common, keys } = self.look(&mut session)?;
        let methods = methods(&scene, &self.order.toggles);
        pace.begin_scene(methods.len());
        let reference = match given {
            Some(reference) => reference,
            None => self.reference(&mut session, &common, &keys, pace)?,
        };
        drop(session);
        let (width, height) = (reference.two.pair().a().width, reference.two.pair().a().height);
        self.say_reference(&reference, (width, height));
        let most_samples = most_measured(reference.result.samples);
        let mut measured = Vec::new();
        for method in &methods {
            pace.begin_method();
            let method = Measure {
                run: self,
                common: &common,
                method,
                keys: &keys,
                two: &reference.two,
                most_samples,
            };
            measured.push(method.measure(pace, threads)?);
            pace.end_method();
        }
        let scene = self.path.to_string_lossy().into_owned();
        Ok(SceneResult { scene, width, height, reference: reference.result, methods: measured })
    }

    /// The references that are kept, if they are good enough, or new ones.
    fn reference(
        &self,
        session: &mut Session,
        common: &Overrides,
        keys: &Keys,
        pace: &Pace,
    ) -> Result<Reference, Trouble> {
        let amount = match &self.order.reference {
            ReferenceOrder::Samples(samples) => Amount { samples: *samples, seconds: None },
            ReferenceOrder::InTime | ReferenceOrder::Files(_) => {
                Amount::in_time(pace.of_references(), self.order.steps.most_samples())
            }
        };
        let maker = self.maker(common);
        if let Some(kept) = maker.kept(keys, amount) {
            return Ok(kept);
        }
        let begin = |left: usize| {
            let seconds = amount.seconds.map(|seconds| pace.left(seconds * left as f64 / 2.0, true));
            self.begins(&format!("reference {} of 2", 3 - left), seconds);
        };
        let made = maker.make(session, amount, begin)?;
        if made.keys == *keys { Ok(maker.keep(made)) } else { Err(self.changed()) }
    }

    /// A person saved the scene, or a file that it names: its figures would be of two scenes.
    pub(super) fn changed(&self) -> Trouble {
        let scene = self.path.display();
        Trouble::Failed(Failure::Work(format!(
            "{scene} or a file that it names changed while it was measured; leave them as they are and measure again"
        )))
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

    pub(super) fn begins(&self, what: &str, left: Option<f64>) {
        let what = format!("{}: {what}", self.path.display());
        (self.tell)(News::Begins { what, left });
    }

    pub(super) fn point(&self, method: &str, step: &Step) {
        let (scene, method) = (self.path.to_string_lossy().into_owned(), method.to_owned());
        (self.tell)(News::Point { scene, method, seconds: step.seconds, relmse: step.relmse });
    }

    pub(super) fn done(&self, what: &str) {
        (self.tell)(News::Done(format!("{}: {what}", self.path.display())));
    }
}

impl Steps {
    /// The most samples, if known.
    fn most_samples(&self) -> Option<u32> {
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
    fn pictures_have_the_aspect_of_the_scene() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/cornell.toml");
        let of = |width, height, asked| {
            let mut scene = Scene::clone(&scene::load(Path::new(file), &[]).expect("a scene").scene);
            (scene.render.width, scene.render.height) = (width, height);
            size(&scene, asked)
        };
        assert_eq!(of(640, 480, (None, None)), (96, 72));
        assert_eq!(of(480, 640, (None, None)), (72, 96));
        assert_eq!(of(64, 32, (None, None)), (64, 32), "none is larger than its scene");
        assert_eq!(of(65536, 1, (None, None)), (96, 1));
        assert_eq!(of(640, 480, (Some(40), None)), (40, 30));
        assert_eq!(of(640, 480, (None, Some(30))), (40, 30));
        assert_eq!(of(640, 480, (Some(7), Some(9))), (7, 9));
    }

    #[test]
    fn scenes_that_were_done_are_given_back_though_a_later_one_fails() {
        let folder = tempfile::tempdir().expect("a folder");
        let order = two_scenes(folder.path());
        // Somebody moves the second one away while the first is measured.
        let tell = |news| match news {
            News::Point { .. } => std::fs::remove_file(&order.scenes[1]).unwrap_or_default(),
            News::Begins { .. } | News::Done(_) | News::Warnings(_) => {}
        };
        let Err(unfinished) = run(&order, &CancelToken::new(), &tell) else { panic!("it is gone") };
        assert!(matches!(unfinished.trouble, Trouble::Failed(_)), "{:?}", unfinished.trouble);
        let done: Vec<_> = unfinished.done.scenes.iter().map(|scene| scene.methods.len()).collect();
        assert_eq!(done, [3]);
    }

    /// Two scenes in a folder, and an order that measures them quickly and keeps references there.
    fn two_scenes(folder: &Path) -> Order {
        let scenes = ["a.toml", "b.toml"].map(|name| folder.join(name));
        // References of equal scenes would be made once.
        scenes.iter().zip(["1", "2"]).for_each(|(scene, color)| write(scene, color));
        Order {
            scenes: scenes.into(),
            width: Some(4),
            height: Some(4),
            steps: Steps::Samples(vec![1]),
            seeds: 2,
            seed: 1,
            reference: ReferenceOrder::Samples(2),
            within: 10.0,
            cache: Some(folder.join("cache")),
            ..Order::default()
        }
    }

    /// A sky of one color.
    fn write(scene: &Path, color: &str) {
        let text =
            format!("[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n[environment]\ncolor = {color}\n");
        std::fs::write(scene, text).expect("written");
    }

    #[test]
    fn a_scene_that_is_saved_before_its_turn_is_measured_as_it_is_then() {
        let folder = tempfile::tempdir().expect("a folder");
        let order = two_scenes(folder.path());
        let save = |news| match news {
            News::Point { scene, .. } if scene.ends_with("a.toml") => write(&order.scenes[1], "3"),
            News::Point { .. } | News::Begins { .. } | News::Done(_) | News::Warnings(_) => {}
        };
        let measured = run(&order, &CancelToken::new(), &save).expect("both");
        for method in measured.scenes.iter().flat_map(|scene| &scene.methods) {
            assert_eq!(method.steps[0].relmse, 0.0, "{}: the sky of another file", method.name);
        }
        // What is kept belongs to the file as it was read: as it was at first, it has no references.
        let again = |color| {
            write(&order.scenes[1], color);
            let again = run(&order, &CancelToken::new(), &|_| {}).expect("both");
            again.scenes[1].reference.is_cached
        };
        assert!(again("3"));
        assert!(!again("2"));
    }

    #[test]
    fn a_scene_that_is_saved_while_it_is_measured_gives_no_figures() {
        for moment in ["reference 2 of 2", "path, 1 sample, seed 2 of 2"] {
            let folder = tempfile::tempdir().expect("a folder");
            let order = two_scenes(folder.path());
            let save = |news| match news {
                News::Begins { what, .. } if what.ends_with(&format!("b.toml: {moment}")) => {
                    write(&order.scenes[1], "3");
                }
                News::Point { .. } | News::Begins { .. } | News::Done(_) | News::Warnings(_) => {}
            };
            let Err(unfinished) = run(&order, &CancelToken::new(), &save) else {
                panic!("saved at {moment}")
            };
            let Trouble::Failed(Failure::Work(message)) = &unfinished.trouble else { panic!("{moment}") };
            assert!(message.contains("b.toml or a file that it names changed"), "{message}");
            assert_eq!(unfinished.done.scenes.len(), 1);
            // References of two skies are not kept.
            write(&order.scenes[1], "3");
            let again = run(&order, &CancelToken::new(), &|_| {}).expect("both");
            assert!(!again.scenes[1].reference.is_cached, "{moment}");
            assert_eq!(again.scenes[1].methods[0].steps[0].relmse, 0.0, "{moment}");
        }
    }

    #[test]
    fn a_save_that_the_references_do_not_heed_is_one_too() {
        let folder = tempfile::tempdir().expect("a folder");
        let order = two_scenes(folder.path());
        let text =
            std::fs::read_to_string(&order.scenes[0]).expect("text") + "[render]\nambient = [1, 1, 1]\n";
        let save = |news| match news {
            News::Begins { what, .. } if what.ends_with("a.toml: whitted, 1 sample, seed 2 of 2") => {
                std::fs::write(&order.scenes[0], &text).expect("written");
            }
            News::Point { .. } | News::Begins { .. } | News::Done(_) | News::Warnings(_) => {}
        };
        let Err(unfinished) = run(&order, &CancelToken::new(), &save) else { panic!("it was saved") };
        let Trouble::Failed(Failure::Work(message)) = &unfinished.trouble else { panic!("of the work") };
        assert!(message.contains("a.toml or a file that it names changed"), "{message}");
    }

    #[test]
    fn no_picture_has_the_seed_of_a_reference() {
        let order = |seed| Order { seed, seeds: 6, ..Order::default() };
        assert!(check_seeds(&order(1)).is_ok());
        assert!(check_seeds(&order(u32::MAX - 6 * 64 - 2)).is_ok());
        let Err(Trouble::Call(message)) = check_seeds(&order(u32::MAX - 6 * 64)) else { panic!("refused") };
        assert!(message.contains("choose a smaller --seed"), "{message}");
    }
}
