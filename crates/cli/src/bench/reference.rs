//! A scene's two references, which are read from files, loaded from the cache or rendered.

use std::path::{Path, PathBuf};

use super::cache::{self, ReferenceCost, ReferencesWithCost};
use super::request::BenchError;
use super::results::ReferenceResult;
use crate::compare::{ImagePair, IndependentReferences};
use crate::control::CancelToken;
use crate::pipeline::BUILD;
use crate::pipeline::headless::{HeadlessSession, RenderedImage};
use crate::pipeline::settings::Overrides;
use crate::scene::description::Integrator;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};

/// Seeds of the references, never used for measured images.
pub(super) const SEEDS: [u32; 2] = [u32::MAX - 1, u32::MAX];

/// Sample count too large to be reached within the time limit.
const UNLIMITED_SAMPLES: u32 = 1 << 24;

/// Ratio of the reference sample count to the largest measured sample count.
const REFERENCE_RATIO: u32 = 100;
/// Lower bound on the largest measured sample count, even if the references have few samples.
const MIN_MEASURED: f64 = 16.0;

/// Maximum sample count to measure by default.
const MAX_MEASURED: f64 = 65_536.0;

/// Largest sample count to measure against references with `of_references` samples. `None` means that the
/// references are image files.
pub(super) fn max_measurable_samples(of_references: Option<f64>) -> f64 {
    let most = of_references.map_or(MAX_MEASURED, |samples| samples / f64::from(REFERENCE_RATIO));
    most.clamp(MIN_MEASURED, MAX_MEASURED)
}

/// Requested quality of the references.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReferenceBudget {
    pub(super) samples: u32,
    /// Time limit in seconds for both references together.
    pub(super) seconds: Option<f64>,
}

impl ReferenceBudget {
    /// Requests the best quality possible in this time, but no better than needed to measure `most` samples.
    pub(super) fn from_time_limit(seconds: f64, most: Option<u32>) -> Self {
        let samples = most
            .map_or(UNLIMITED_SAMPLES, |most| most.saturating_mul(REFERENCE_RATIO).min(UNLIMITED_SAMPLES));
        Self { samples, seconds: Some(seconds) }
    }

    /// Whether cached references are good enough: they have enough samples, or rendering them took at least
    /// half of the requested time.
    fn is_met_by_cached_references(self, cost: ReferenceCost) -> bool {
        cost.samples >= f64::from(self.samples)
            || self.seconds.is_some_and(|seconds| cost.seconds >= 0.5 * seconds)
    }
}

/// A scene's references, with the warnings and errors from rendering and caching them.
pub(super) struct SceneReferences {
    pub(super) two: IndependentReferences,
    pub(super) result: ReferenceResult,
    pub(super) warnings: Vec<Diagnostic>,
    /// Error message if the references could not be cached.
    pub(super) cache_error: Option<String>,
}

/// Fingerprints of the two references.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReferenceFingerprints([Fingerprint; 2]);

/// Rendered references that are not cached yet.
pub(super) struct UncachedReferences {
    pub(super) keys: ReferenceFingerprints,
    stored: ReferencesWithCost,
    warnings: Vec<Diagnostic>,
}

/// Loads references from files.
pub(super) fn load_reference_files(files: &[PathBuf; 2]) -> Result<SceneReferences, BenchError> {
    let pair = ImagePair::load(&files[0], &files[1]).map_err(|errors| {
        BenchError::Call(errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
    })?;
    let mut names: Vec<String> = files.iter().map(|file| file.to_string_lossy().into_owned()).collect();
    names.dedup();
    let two = IndependentReferences::new(pair);
    let noise = two.relmse_of_one_reference();
    let result = ReferenceResult { samples: None, noise, seconds: None, is_cached: false, files: names };
    Ok(SceneReferences { two, result, warnings: Vec::new(), cache_error: None })
}

/// Renders references or loads them from the cache.
pub(super) struct ReferenceRenderer<'a> {
    pub(super) scene: &'a Path,
    /// Overrides, including the size.
    pub(super) common: &'a Overrides,
    pub(super) token: &'a CancelToken,
    pub(super) cache: Option<&'a Path>,
    /// Requested samples per pixel of each reference.
    pub(super) requested_samples: Option<u32>,
}

impl ReferenceRenderer<'_> {
    fn reference_cache_key(&self, keys: &ReferenceFingerprints) -> Fingerprint {
        cache_key(BUILD, self.requested_samples, keys)
    }

    /// Renders one sample per pixel to get the fingerprints of the references and to check that all files can
    /// be read.
    pub(super) fn fingerprints_from_test_renders(
        &self,
        session: &mut HeadlessSession,
    ) -> Result<ReferenceFingerprints, BenchError> {
        let [one, two] = SEEDS.map(|seed| {
            self.render_reference(session, seed, ReferenceBudget { samples: 1, seconds: None })
                .map(|it| it.key)
        });
        Ok(ReferenceFingerprints([one?, two?]))
    }

    /// Loads cached references, if they are good enough.
    pub(super) fn load_cached(
        &self,
        keys: &ReferenceFingerprints,
        amount: ReferenceBudget,
    ) -> Option<SceneReferences> {
        let stored = cache::load(self.cache?, &self.reference_cache_key(keys))
            .filter(|stored| amount.is_met_by_cached_references(stored.cost))?;
        Some(scene_references_from_pair(stored, true, Vec::new(), None))
    }

    /// Renders both references. Calls `begin` before each one and passes it the number of references left.
    pub(super) fn render_reference_pair(
        &self,
        session: &mut HeadlessSession,
        amount: ReferenceBudget,
        mut begin: impl FnMut(usize),
    ) -> Result<UncachedReferences, BenchError> {
        let half = ReferenceBudget { seconds: amount.seconds.map(|seconds| seconds / 2.0), ..amount };
        begin(2);
        let first = self.render_reference(session, SEEDS[0], half)?;
        begin(1);
        let second = self.render_reference(session, SEEDS[1], half)?;
        let cost = ReferenceCost {
            samples: (first.report.image.samples.mean + second.report.image.samples.mean) / 2.0,
            seconds: first.report.seconds + second.report.seconds,
        };
        let names = ["the first reference", "the second reference"].map(Path::new);
        let pair = ImagePair::new(names, first.image, second.image).map_err(|errors| {
            BenchError::Call(errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
        })?;
        let keys = ReferenceFingerprints([first.key, second.key]);
        Ok(UncachedReferences { keys, stored: ReferencesWithCost { pair, cost }, warnings: first.warnings })
    }

    /// Stores rendered references in the cache, if it is enabled.
    pub(super) fn store_in_cache(&self, made: UncachedReferences) -> SceneReferences {
        let UncachedReferences { keys, stored, warnings } = made;
        let cache_error = self
            .cache
            .and_then(|folder| cache::store(folder, &self.reference_cache_key(&keys), &stored).err());
        scene_references_from_pair(stored, false, warnings, cache_error.map(|error| error.to_string()))
    }

    fn render_reference(
        &self,
        session: &mut HeadlessSession,
        seed: u32,
        amount: ReferenceBudget,
    ) -> Result<RenderedImage, BenchError> {
        let overrides = Overrides {
            integrator: Some(Integrator::Path),
            photons: Some(false),
            clamp: Some(0.0),
            seed: Some(seed),
            samples: Some(amount.samples),
            time_seconds: amount.seconds.map(|seconds| seconds.max(1e-3)),
            ..self.common.clone()
        };
        Ok(session.render_in_memory(self.scene, &overrides, self.token)?)
    }
}

/// The cache key of the references. It depends on the build, because builds may render differently, and on
/// the requested sample count, which is 0 if time limits the references.
fn cache_key(
    build: &str,
    requested_samples: Option<u32>,
    ReferenceFingerprints(keys): &ReferenceFingerprints,
) -> Fingerprint {
    let mut key = FingerprintHasher::new("references");
    key.add_str(build).add_u64(requested_samples.unwrap_or(0).into());
    keys.iter().for_each(|one| {
        key.add_fingerprint(one);
    });
    key.finish()
}

fn scene_references_from_pair(
    stored: ReferencesWithCost,
    is_cached: bool,
    warnings: Vec<Diagnostic>,
    cache_error: Option<String>,
) -> SceneReferences {
    let ReferencesWithCost { pair, cost } = stored;
    let two = IndependentReferences::new(pair);
    let result = ReferenceResult {
        samples: Some(cost.samples),
        noise: two.relmse_of_one_reference(),
        seconds: Some(cost.seconds),
        is_cached,
        files: Vec::new(),
    };
    SceneReferences { two, result, warnings, cache_error }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builds_do_not_share_references() {
        let keys = || ReferenceFingerprints(["a", "b"].map(|name| FingerprintHasher::new(name).finish()));
        let (common, token) = (Overrides::default(), CancelToken::new());
        let renderer = ReferenceRenderer {
            scene: Path::new("a.toml"),
            common: &common,
            token: &token,
            cache: None,
            requested_samples: Some(2),
        };
        let other = BUILD.replace("(build ", "(build 0");
        assert_ne!(
            renderer.reference_cache_key(&keys()),
            cache_key(&other, renderer.requested_samples, &keys())
        );
        assert_ne!(
            renderer.reference_cache_key(&keys()),
            cache_key(env!("CARGO_PKG_VERSION"), renderer.requested_samples, &keys())
        );
        assert_eq!(
            renderer.reference_cache_key(&keys()),
            cache_key(BUILD, renderer.requested_samples, &keys())
        );
    }

    #[test]
    fn measured_samples_are_limited_to_1_percent() {
        assert_eq!(max_measurable_samples(Some(25_600.0)), 256.0);
        assert_eq!(max_measurable_samples(Some(400.0)), 16.0, "a slope needs at least this many samples");
        assert_eq!(max_measurable_samples(Some(1e9)), 65_536.0);
        assert_eq!(max_measurable_samples(None), 65_536.0, "unknown samples");
    }
}
