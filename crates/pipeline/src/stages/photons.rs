//! The photons stage, which creates the data shared by all passes and traces the first pass. Later passes are
//! traced during the render, when they are needed. Maps are cached while there is room, so that images with
//! another camera or exposure can reuse them. Images of another size can reuse them if the scene sets the
//! number of photons per pass.

use std::cell::{Cell, RefCell};
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};

use rayon::ThreadPool;

use super::super::cache::Memo;
use super::super::keys;
use super::super::plan::RenderPlan;
use super::super::prepare::ReadyScene;
use super::super::protocol::{PhotonsReport, reasons};
use super::super::sink::EventSink;
use super::super::stopwatch::PausableStopwatch;
use super::super::trace::TICK;
use super::StageResult;
use crate::control::{CancelToken, Canceled, Progress};
use crate::integrators::{
    PhotonPass, PhotonPassTracer, PhotonPassesBySample, PhotonSettings, RenderSettings,
};
use crate::scene::description::RenderOptions;
use crate::scene::fingerprint::Fingerprint;
use crate::world::World;

/// Memory limit for maps cached for later images.
const MAX_KEPT_BYTES: usize = 128 << 20;
/// Memory limit for maps in use at the same time. A single map may exceed it.
const MAX_ALIVE_BYTES: usize = 256 << 20;
/// Maximum number of passes in use at the same time. Using one map at a time makes better use of the CPU
/// caches.
const MAX_ALIVE: u32 = 1;
/// Maximum number of samples rendered at once if no photons are emitted.
const MAX_WITHOUT_TREE: u32 = 4096;

/// Cache of the photons stage: photons for the last scene.
pub(crate) type PhotonCache = Memo<PhotonStore>;

/// Context for tracing photon passes.
#[derive(Clone, Copy)]
pub(crate) struct PhotonContext<'a> {
    pub(crate) world: &'a World,
    pub(crate) plan: &'a RenderPlan,
    pub(crate) pool: &'a ThreadPool,
    pub(crate) token: &'a CancelToken,
    pub(crate) sink: &'a EventSink,
}

/// Photons for a scene.
#[derive(Debug)]
pub(crate) struct PhotonStore {
    photons: PhotonPassTracer,
    /// Cached passes, starting with the first.
    kept: RefCell<Vec<Arc<PhotonPass>>>,
    /// Photon counts of the current request.
    sent: Cell<PhotonCounts>,
}

/// Counts of the photons traced for an image.
#[derive(Clone, Copy, Debug, Default)]
struct PhotonCounts {
    passes: u64,
    emitted: u64,
    stored: u64,
    lookups: u64,
    seconds: f64,
    max_alive_bytes: usize,
}

impl PhotonStore {
    /// Whether any surface causes caustics. If not, no photons are traced.
    pub(crate) fn has_lit_caustic_casters(&self) -> bool {
        self.photons.emits_photons()
    }

    /// Returns how many passes may be in use at the same time, assuming that each is as large as the first.
    pub(crate) fn max_passes_at_once(&self) -> u32 {
        if !self.has_lit_caustic_casters() {
            return MAX_WITHOUT_TREE;
        }
        let size = self.kept.borrow().first().map_or(1, |pass| pass.memory_bytes().max(1));
        ((MAX_ALIVE_BYTES / size) as u32).clamp(1, MAX_ALIVE)
    }

    /// Average number of seconds needed to trace a pass, or 0 if no pass was traced.
    pub(crate) fn mean_seconds_per_pass(&self) -> f64 {
        let PhotonCounts { passes, seconds, .. } = self.sent.get();
        if self.has_lit_caustic_casters() && passes > 0 { seconds / passes as f64 } else { 0.0 }
    }

    /// Returns the maps for the given samples. Calls `tick` regularly.
    ///
    /// # Errors
    /// Returns [`Canceled`] if the token is canceled.
    pub(crate) fn get_or_trace_maps(
        &self,
        samples: Range<u32>,
        sending: PhotonContext<'_>,
        mut tick: impl FnMut(),
    ) -> Result<PhotonPassesBySample, Canceled> {
        let first = samples.start;
        let pass = |number| self.get_or_trace_pass(number, sending, &mut tick);
        let passes = samples.map(pass).collect::<Result<Vec<_>, _>>()?;
        let bytes = passes.iter().map(|pass| pass.memory_bytes()).sum();
        let sent = self.sent.get();
        self.sent.set(PhotonCounts { max_alive_bytes: sent.max_alive_bytes.max(bytes), ..sent });
        Ok(PhotonPassesBySample { first, passes })
    }

    fn get_or_trace_pass(
        &self,
        number: u32,
        sending: PhotonContext<'_>,
        tick: &mut impl FnMut(),
    ) -> Result<Arc<PhotonPass>, Canceled> {
        let number_kept = if self.has_lit_caustic_casters() { number } else { 0 };
        if let Some(pass) = self.kept.borrow().get(number_kept as usize) {
            return Ok(Arc::clone(pass));
        }
        let PhotonContext { world, plan, pool, token, .. } = sending;
        let watch = PausableStopwatch::start(token);
        let photons = &self.photons;
        let settings = plan.settings.without_ineffective_settings();
        let pass = run_with_ticks(pool, tick, || photons.trace_pass(world, &settings, number, token))?;
        let pass = Arc::new(pass);
        let sent = self.sent.get();
        self.sent.set(PhotonCounts {
            passes: sent.passes + 1,
            emitted: sent.emitted + pass.emitted,
            stored: sent.stored + pass.stored_photon_count(),
            lookups: sent.lookups + pass.lookups,
            seconds: sent.seconds + watch.seconds(),
            ..sent
        });
        let has_room = self.cached_bytes() + pass.memory_bytes() <= MAX_KEPT_BYTES;
        let mut kept = self.kept.borrow_mut();
        if number as usize == kept.len() && (has_room || number == 0) {
            kept.push(Arc::clone(&pass));
        }
        Ok(pass)
    }

    fn cached_bytes(&self) -> usize {
        self.kept.borrow().iter().map(|pass| pass.memory_bytes()).sum()
    }

    /// Reports the photons traced since the stage started, and the cached maps.
    pub(crate) fn to_photons_report(&self) -> PhotonsReport {
        let PhotonCounts { passes, emitted, stored, lookups, seconds, max_alive_bytes } = self.sent.get();
        let [caustic, bounced] = self.photons.first_pass_radii();
        PhotonsReport {
            count: self.photons.photons_per_pass(),
            passes,
            emitted,
            stored,
            lookups,
            seconds,
            per_second: if seconds > 0.0 { emitted as f64 / seconds } else { 0.0 },
            caustic_radius: caustic,
            bounced_radius: bounced,
            kept_memory_bytes: self.cached_bytes() as u64,
            used_memory_bytes: max_alive_bytes as u64,
        }
    }
}

/// Runs `work` in the pool while regularly calling `tick` on the current thread.
fn run_with_ticks<T: Send>(
    pool: &ThreadPool,
    tick: &mut impl FnMut(),
    work: impl FnOnce() -> Result<T, Canceled> + Send,
) -> Result<T, Canceled> {
    let (sender, result) = mpsc::sync_channel(1);
    pool.in_place_scope(|scope| {
        // The receiver is not dropped before the result arrives.
        scope.spawn(move |_| drop(sender.send(work())));
        loop {
            match result.recv_timeout(TICK) {
                Ok(result) => return result,
                Err(RecvTimeoutError::Timeout) => tick(),
                Err(RecvTimeoutError::Disconnected) => return Err(Canceled),
            }
        }
    })
}

/// The photons that an image needs, each with the key of the image's photons.
#[derive(Clone, Copy)]
pub(crate) enum SkipReuseOrTracePhotons {
    /// None, for this reason.
    Skip(&'static str),
    /// The cached photons.
    Reuse(Fingerprint),
    /// New photons.
    Trace(Fingerprint, PhotonSettings),
}

impl SkipReuseOrTracePhotons {
    /// Determines the photons for a scene's image. `wanted` comes from the command line.
    pub(crate) fn new(scene: &ReadyScene, wanted: Option<bool>, cache: &PhotonCache) -> Self {
        let ReadyScene { plan, surfaces, origin, .. } = scene;
        let (settings, enabled) = (plan.settings.without_ineffective_settings(), plan.scene.photons.enabled);
        let Some(of_photons) = settings.photons else {
            return Self::Skip(match wanted.unwrap_or(enabled) {
                true => reasons::NOT_USED_BY_PATH,
                false if enabled => reasons::PHOTONS_OVERRIDDEN,
                false => reasons::PHOTONS_OFF,
            });
        };
        if !settings.gathers_photons() {
            let deeper = RenderOptions { max_depth: u32::MAX, ..settings.render };
            return Self::Skip(match (RenderSettings { render: deeper, ..settings }).gathers_photons() {
                true => reasons::TOO_FEW_BOUNCES,
                false => reasons::NOT_NEEDED_FOR_VIEW,
            });
        }
        let key = keys::photons_key(surfaces, *origin, &plan.settings.render, of_photons);
        if cache.get(key).is_some() { Self::Reuse(key) } else { Self::Trace(key, of_photons) }
    }
}

/// Traces an image's first photons unless they are cached. Calls `tick` regularly. Returns the key of the
/// image's photons, if it uses them.
///
/// # Errors
/// Returns [`Canceled`] if the token is canceled.
pub(crate) fn trace_first_photons(
    task: SkipReuseOrTracePhotons,
    cache: &mut PhotonCache,
    sending: PhotonContext<'_>,
    mut tick: impl FnMut(),
) -> Result<StageResult<Option<Fingerprint>>, Canceled> {
    let (key, of_photons) = match task {
        SkipReuseOrTracePhotons::Skip(why) => return Ok(StageResult::skipped(None, why)),
        SkipReuseOrTracePhotons::Reuse(key) => {
            let store = cache.get(key).inspect(|store| store.sent.set(PhotonCounts::default()));
            return Ok(match store.is_some_and(PhotonStore::has_lit_caustic_casters) {
                true => StageResult::reused(Some(key), reasons::UNCHANGED),
                false => StageResult::skipped(Some(key), reasons::NO_SPECULAR_SURFACES),
            });
        }
        SkipReuseOrTracePhotons::Trace(key, of_photons) => (key, of_photons),
    };
    let PhotonContext { world, plan, pool, token, .. } = sending;
    let settings = plan.settings.without_ineffective_settings();
    let watch = PausableStopwatch::start(token);
    let send = |progress: Progress<'_>| {
        run_with_ticks(pool, &mut tick, || {
            PhotonPassTracer::new_and_trace_first_pass(world, &settings, of_photons, progress, token)
        })
    };
    let (photons, first) = sending.sink.load_asset_with_progress("photons", send)?;
    let seconds = watch.seconds();
    let (passes, emitted, stored, lookups) = (1, first.emitted, first.stored_photon_count(), first.lookups);
    let sent = PhotonCounts { passes, emitted, stored, lookups, seconds, max_alive_bytes: 0 };
    let kept = RefCell::new(vec![Arc::new(first)]);
    let emits_photons = photons.emits_photons();
    let store = PhotonStore { photons, kept, sent: Cell::new(sent) };
    cache.set(key, store);
    Ok(if emits_photons {
        StageResult::done(Some(key), "")
    } else {
        StageResult::skipped(Some(key), reasons::NO_SPECULAR_SURFACES)
    })
}
