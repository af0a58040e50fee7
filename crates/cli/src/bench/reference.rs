//! Two references of a scene: given, kept from before, or made.

use std::path::{Path, PathBuf};

use super::cache::{self, Cost, Stored};
use super::order::Trouble;
use super::results::ReferenceResult;
use crate::compare::{Pair, TwoReferences};
use crate::control::CancelToken;
use crate::pipeline::BUILD;
use crate::pipeline::session::{Rendered, Session};
use crate::pipeline::settings::Overrides;
use crate::scene::description::Integrator;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::{Fingerprint, Key};

/// Seeds of the two. No picture that is measured has them.
pub(super) const SEEDS: [u32; 2] = [u32::MAX - 1, u32::MAX];

/// More than there is time for.
const NO_END: u32 = 1 << 24;

/// Times the samples of the most that is measured.
const MORE: u32 = 100;
/// The samples that are measured however few the references have.
const LEAST_MEASURED: f64 = 16.0;

/// The most samples that a ladder climbs to.
const MOST_MEASURED: f64 = 65_536.0;

/// The most samples for which references of so many of them can stand; of files nobody knows how many they have.
pub(super) fn most_measured(of_references: Option<f64>) -> f64 {
    let most = of_references.map_or(MOST_MEASURED, |samples| samples / f64::from(MORE));
    most.clamp(LEAST_MEASURED, MOST_MEASURED)
}

/// Quality of the references.
#[derive(Clone, Copy, Debug)]
pub(super) struct Amount {
    pub(super) samples: u32,
    /// Seconds of both.
    pub(super) seconds: Option<f64>,
}

impl Amount {
    /// The best quality that the time allows, but no better than the most samples need.
    pub(super) fn in_time(seconds: f64, most: Option<u32>) -> Self {
        let samples = most.map_or(NO_END, |most| most.saturating_mul(MORE).min(NO_END));
        Self { samples, seconds: Some(seconds) }
    }

    /// Whether what was made before is as good. What had half of the time is.
    fn is_met(self, cost: Cost) -> bool {
        cost.samples >= f64::from(self.samples)
            || self.seconds.is_some_and(|seconds| cost.seconds >= 0.5 * seconds)
    }
}

/// The references of a scene, with remarks about them.
pub(super) struct Reference {
    pub(super) two: TwoReferences,
    pub(super) result: ReferenceResult,
    pub(super) warnings: Vec<Diagnostic>,
    /// Why they could not be kept.
    pub(super) unkept: Option<String>,
}

/// Keys of the two references.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Keys([Key; 2]);

/// References that are not kept yet.
pub(super) struct Made {
    pub(super) keys: Keys,
    stored: Stored,
    warnings: Vec<Diagnostic>,
}

/// Reads both; they may be one file.
pub(super) fn given(files: &[PathBuf; 2]) -> Result<Reference, Trouble> {
    let pair = Pair::load(&files[0], &files[1]).map_err(|errors| {
        Trouble::Call(errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
    })?;
    let mut names: Vec<String> = files.iter().map(|file| file.to_string_lossy().into_owned()).collect();
    names.dedup();
    let two = TwoReferences::new(pair);
    let noise = two.noise();
    let result = ReferenceResult { samples: None, noise, seconds: None, is_cached: false, files: names };
    Ok(Reference { two, result, warnings: Vec::new(), unkept: None })
}

/// Maker of references.
pub(super) struct Maker<'a> {
    pub(super) scene: &'a Path,
    /// Overrides, with the size.
    pub(super) common: &'a Overrides,
    pub(super) token: &'a CancelToken,
    pub(super) cache: Option<&'a Path>,
    /// Samples of the references, if the call sets them.
    pub(super) asked: Option<u32>,
}

impl Maker<'_> {
    fn key(&self, keys: &Keys) -> Key {
        cache_key(BUILD, self.asked, keys)
    }

    /// Pictures of one sample show what the references depend on, and that everything can be read.
    pub(super) fn keys(&self, session: &mut Session) -> Result<Keys, Trouble> {
        let [one, two] = SEEDS
            .map(|seed| self.render(session, seed, Amount { samples: 1, seconds: None }).map(|it| it.key));
        Ok(Keys([one?, two?]))
    }

    /// The stored references, if they are good enough.
    pub(super) fn kept(&self, keys: &Keys, amount: Amount) -> Option<Reference> {
        let stored = cache::load(self.cache?, &self.key(keys)).filter(|stored| amount.is_met(stored.cost))?;
        Some(reference(stored, true, Vec::new(), None))
    }

    /// Renders both; tells `begin` before each how many are left.
    pub(super) fn make(
        &self,
        session: &mut Session,
        amount: Amount,
        mut begin: impl FnMut(usize),
    ) -> Result<Made, Trouble> {
        let half = Amount { seconds: amount.seconds.map(|seconds| seconds / 2.0), ..amount };
        begin(2);
        let first = self.render(session, SEEDS[0], half)?;
        begin(1);
        let second = self.render(session, SEEDS[1], half)?;
        let cost = Cost {
            samples: (first.report.image.samples.mean + second.report.image.samples.mean) / 2.0,
            seconds: first.report.seconds + second.report.seconds,
        };
        let names = ["the first reference", "the second reference"].map(Path::new);
        let pair = Pair::new(names, first.image, second.image).map_err(|errors| {
            Trouble::Call(errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
        })?;
        let keys = Keys([first.key, second.key]);
        Ok(Made { keys, stored: Stored { pair, cost }, warnings: first.warnings })
    }

    /// Stores references for later runs, if there is a folder for them.
    pub(super) fn keep(&self, made: Made) -> Reference {
        let Made { keys, stored, warnings } = made;
        let unkept = self.cache.and_then(|folder| cache::store(folder, &self.key(&keys), &stored).err());
        reference(stored, false, warnings, unkept.map(|error| error.to_string()))
    }

    fn render(&self, session: &mut Session, seed: u32, amount: Amount) -> Result<Rendered, Trouble> {
        let overrides = Overrides {
            integrator: Some(Integrator::Path),
            photons: Some(false),
            clamp: Some(0.0),
            seed: Some(seed),
            samples: Some(amount.samples),
            time_seconds: amount.seconds.map(|seconds| seconds.max(1e-3)),
            ..self.common.clone()
        };
        Ok(session.render(self.scene, &overrides, self.token)?)
    }
}

/// Key of the references in the cache. Builds that may render other bits do not share references, and references with samples that
/// the call sets differ from timed ones.
fn cache_key(build: &str, asked: Option<u32>, Keys(keys): &Keys) -> Key {
    let mut key = Fingerprint::new("references");
    key.text(build).u64(asked.unwrap_or(0).into());
    keys.iter().for_each(|one| {
        key.key(one);
    });
    key.finish()
}

fn reference(
    stored: Stored,
    is_cached: bool,
    warnings: Vec<Diagnostic>,
    unkept: Option<String>,
) -> Reference {
    let Stored { pair, cost } = stored;
    let two = TwoReferences::new(pair);
    let result = ReferenceResult {
        samples: Some(cost.samples),
        noise: two.noise(),
        seconds: Some(cost.seconds),
        is_cached,
        files: Vec::new(),
    };
    Reference { two, result, warnings, unkept }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builds_share_no_references() {
        let keys = || Keys(["a", "b"].map(|name| Fingerprint::new(name).finish()));
        let (common, token) = (Overrides::default(), CancelToken::new());
        let maker = Maker {
            scene: Path::new("a.toml"),
            common: &common,
            token: &token,
            cache: None,
            asked: Some(2),
        };
        let other = BUILD.replace("(build ", "(build 0");
        assert_ne!(maker.key(&keys()), cache_key(&other, maker.asked, &keys()));
        assert_ne!(maker.key(&keys()), cache_key(env!("CARGO_PKG_VERSION"), maker.asked, &keys()));
        assert_eq!(maker.key(&keys()), cache_key(BUILD, maker.asked, &keys()));
    }

    #[test]
    fn references_stand_for_a_hundredth_of_their_samples() {
        assert_eq!(most_measured(Some(25_600.0)), 256.0);
        assert_eq!(most_measured(Some(400.0)), 16.0, "less would show no slope");
        assert_eq!(most_measured(Some(1e9)), 65_536.0);
        assert_eq!(most_measured(None), 65_536.0, "files do not tell theirs");
    }
}
