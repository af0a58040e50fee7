//! Photon maps. The stage makes what all passes have in common and the first of them; the others are sent during the render, when
//! their samples are due. Maps are kept while there is room: pictures that differ in the camera or the exposure alone find them
//! again, and those of another size if the scene says how many photons a pass has.

use std::cell::{Cell, RefCell};
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};

use rayon::ThreadPool;

use super::super::cache::Memo;
use super::super::pace::Stopwatch;
use super::super::plan::Plan;
use super::super::protocol::PhotonsReport;
use super::super::sink::Sink;
use super::super::trace::TICK;
use super::{Staged, Stop};
use crate::control::{CancelToken, Cancelled, Progress};
use crate::integrators::{PhotonMaps, PhotonPass, PhotonSettings, Photons, RenderSettings};
use crate::scene::description::Render;
use crate::scene::fingerprint::Key;
use crate::world::World;

/// Memory for maps that are kept from picture to picture.
const MOST_KEPT_BYTES: usize = 128 << 20;
/// Memory for maps that are in use at once beside those, unless one alone takes more.
const MOST_ALIVE_BYTES: usize = 256 << 20;
/// Passes in use at once: looks into one at a time find more of it in the processor's caches.
const MOST_ALIVE: u32 = 1;
/// Samples at once where no photons are sent.
const MAX_WITHOUT_TREE: u32 = 4096;

/// Why no photons are sent.
const NOTHING_THROWS_LIGHT: &str = "no mirror or glass throws light";

/// What the stage keeps: the photons of the last scene.
pub(crate) type PhotonCache = Memo<PhotonStore>;

/// What passes are sent by.
#[derive(Clone, Copy)]
pub(crate) struct Sending<'a> {
    pub(crate) world: &'a World,
    pub(crate) plan: &'a Plan,
    pub(crate) pool: &'a ThreadPool,
    pub(crate) token: &'a CancelToken,
    pub(crate) sink: &'a Sink,
}

/// The photons of a scene.
#[derive(Debug)]
pub(crate) struct PhotonStore {
    photons: Photons,
    /// The first passes.
    kept: RefCell<Vec<Arc<PhotonPass>>>,
    /// What this request sent.
    sent: Cell<Sent>,
}

/// What was sent for a picture.
#[derive(Clone, Copy, Debug, Default)]
struct Sent {
    passes: u64,
    emitted: u64,
    stored: u64,
    lookups: u64,
    seconds: f64,
    most_alive_bytes: usize,
}

impl PhotonStore {
    /// Whether each pass has photons: something throws light.
    pub(crate) fn are_sent(&self) -> bool {
        self.photons.emits_photons()
    }

    /// Passes that may be in use at once, of the size of the first.
    pub(crate) fn at_once(&self) -> u32 {
        if !self.are_sent() {
            return MAX_WITHOUT_TREE;
        }
        let size = self.kept.borrow().first().map_or(1, |pass| pass.memory_bytes().max(1));
        ((MOST_ALIVE_BYTES / size) as u32).clamp(1, MOST_ALIVE)
    }

    /// Seconds that a pass takes to send; 0 where none was sent.
    pub(crate) fn seconds_of_pass(&self) -> f64 {
        let Sent { passes, seconds, .. } = self.sent.get();
        if self.are_sent() && passes > 0 { seconds / passes as f64 } else { 0.0 }
    }

    /// The maps of some samples; `tick` is called every now and then.
    ///
    /// # Errors
    /// Cancelled.
    pub(crate) fn maps(
        &self,
        samples: Range<u32>,
        sending: Sending<'_>,
        mut tick: impl FnMut(),
    ) -> Result<PhotonMaps, Cancelled> {
        let first = samples.start;
        let pass = |number| self.pass(number, sending, &mut tick);
        let passes = samples.map(pass).collect::<Result<Vec<_>, _>>()?;
        let bytes = passes.iter().map(|pass| pass.memory_bytes()).sum();
        let sent = self.sent.get();
        self.sent.set(Sent { most_alive_bytes: sent.most_alive_bytes.max(bytes), ..sent });
        Ok(PhotonMaps { first, passes })
    }

    fn pass(
        &self,
        number: u32,
        sending: Sending<'_>,
        tick: &mut impl FnMut(),
    ) -> Result<Arc<PhotonPass>, Cancelled> {
        let number_kept = if self.are_sent() { number } else { 0 };
        if let Some(pass) = self.kept.borrow().get(number_kept as usize) {
            return Ok(Arc::clone(pass));
        }
        let Sending { world, plan, pool, token, .. } = sending;
        let watch = Stopwatch::start(token);
        let photons = &self.photons;
        let settings = plan.settings.effective();
        let pass = ticking(pool, tick, || photons.pass(world, &settings, number, token))?;
        let pass = Arc::new(pass);
        let sent = self.sent.get();
        self.sent.set(Sent {
            passes: sent.passes + 1,
            emitted: sent.emitted + pass.emitted,
            stored: sent.stored + pass.stored(),
            lookups: sent.lookups + pass.lookups,
            seconds: sent.seconds + watch.seconds(),
            ..sent
        });
        let has_room = self.kept_bytes() + pass.memory_bytes() <= MOST_KEPT_BYTES;
        let mut kept = self.kept.borrow_mut();
        if number as usize == kept.len() && (has_room || number == 0) {
            kept.push(Arc::clone(&pass));
        }
        Ok(pass)
    }

    fn kept_bytes(&self) -> usize {
        self.kept.borrow().iter().map(|pass| pass.memory_bytes()).sum()
    }

    /// What was sent since the stage began, and what is kept.
    pub(crate) fn report(&self) -> PhotonsReport {
        let Sent { passes, emitted, stored, lookups, seconds, most_alive_bytes } = self.sent.get();
        let [caustic, bounced] = self.photons.radii();
        PhotonsReport {
            count: self.photons.count(),
            passes,
            emitted,
            stored,
            lookups,
            seconds,
            per_second: if seconds > 0.0 { emitted as f64 / seconds } else { 0.0 },
            caustic_radius: caustic,
            bounced_radius: bounced,
            kept_memory_bytes: self.kept_bytes() as u64,
            used_memory_bytes: most_alive_bytes as u64,
        }
    }
}

/// Do work in a pool, and `tick` on this thread.
fn ticking<T: Send>(
    pool: &ThreadPool,
    tick: &mut impl FnMut(),
    work: impl FnOnce() -> Result<T, Cancelled> + Send,
) -> Result<T, Cancelled> {
    let (sender, result) = mpsc::sync_channel(1);
    pool.in_place_scope(|scope| {
        // Its receiver is there until the result is.
        scope.spawn(move |_| drop(sender.send(work())));
        loop {
            match result.recv_timeout(TICK) {
                Ok(result) => return result,
                Err(RecvTimeoutError::Timeout) => tick(),
                Err(RecvTimeoutError::Disconnected) => return Err(Cancelled),
            }
        }
    })
}

/// Make the first maps for a picture that gathers photons. `wanted` is what the command line says, `enabled` what the scene says;
/// `tick` is called every now and then, `before` where photons have to be traced, before they are.
///
/// # Errors
/// Cancelled; those of `before`.
pub(crate) fn photons(
    (enabled, wanted): (bool, Option<bool>),
    key: impl FnOnce(PhotonSettings) -> Key,
    cache: &mut PhotonCache,
    sending: Sending<'_>,
    mut tick: impl FnMut(),
    before: impl FnOnce() -> Result<(), Stop>,
) -> Result<Staged<()>, Stop> {
    let settings = sending.plan.settings.effective();
    let skipped = |why: &str| Ok(Staged::skipped((), why));
    let Some(of_photons) = settings.photons else {
        return match wanted.unwrap_or(enabled) {
            true => skipped("path needs none"),
            false if enabled => skipped("switched off for this run"),
            false => skipped("the scene does not enable photons"),
        };
    };
    if !settings.gathers() {
        let deeper = Render { max_depth: u32::MAX, ..settings.render };
        return skipped(match (RenderSettings { render: deeper, ..settings }).gathers() {
            true => "max_depth 1 leaves no light to them",
            false => "this view shows nothing of them",
        });
    }
    let key = key(of_photons);
    if let Some(store) = cache.get(key) {
        store.sent.set(Sent::default());
        return Ok(match store.photons.emits_photons() {
            true => Staged::reused((), "nothing that they meet changed"),
            false => Staged::skipped((), NOTHING_THROWS_LIGHT),
        });
    }
    before()?;
    let Sending { world, pool, token, .. } = sending;
    let watch = Stopwatch::start(token);
    let send = |progress: Progress<'_>| {
        ticking(pool, &mut tick, || Photons::new(world, &settings, of_photons, progress, token))
    };
    let (photons, first) = sending.sink.asset("photons", send)?;
    let seconds = watch.seconds();
    let (passes, emitted, stored, lookups) = (1, first.emitted, first.stored(), first.lookups);
    let sent = Sent { passes, emitted, stored, lookups, seconds, most_alive_bytes: 0 };
    let kept = RefCell::new(vec![Arc::new(first)]);
    let are_sent = photons.emits_photons();
    let store = PhotonStore { photons, kept, sent: Cell::new(sent) };
    cache.set(key, store);
    Ok(if are_sent { Staged::done((), "") } else { Staged::skipped((), NOTHING_THROWS_LIGHT) })
}
