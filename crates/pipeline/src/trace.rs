//! Tiles on a pool: claimed one by one in the order given, kept by the thread that made them, told to the thread that asked.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use rayon::ThreadPool;

use crate::control::{CancelToken, Cancelled};
use crate::film::{Pixels, TILE_SIZE, TileSamples};
use crate::integrators::{PhotonMaps, RayCounters, RenderSettings};
use crate::system::cpu_time::thread_cpu_seconds;
use crate::world::World;

/// The function that renders a tile, with photon maps or without: see [`crate::integrators::render_tile_with_photons`].
pub(super) type Kernel = fn(
    Option<&PhotonMaps>,
    &World,
    &RenderSettings,
    Pixels,
    Range<u32>,
    &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled>;

/// The longest time without a tick.
pub(super) const TICK: Duration = Duration::from_millis(20);

/// Results wait until so much time has passed since the last ones were sent, or the job after them is done: to wake the thread that
/// asked takes longer than the smallest jobs.
const AT_ONCE: Duration = Duration::from_micros(300);

/// Everything that is the same for all tiles.
#[derive(Clone, Copy)]
pub(super) struct Tracer<'a> {
    pub(super) kernel: Kernel,
    pub(super) pool: &'a ThreadPool,
    pub(super) world: &'a World,
    pub(super) settings: &'a RenderSettings,
    pub(super) token: &'a CancelToken,
    /// Photon maps of all jobs' samples, if photons are gathered.
    pub(super) photons: Option<&'a PhotonMaps>,
    /// Number in the whole picture of sample 0 of the jobs.
    pub(super) first: u32,
}

/// Samples of one tile that are to be made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Job {
    pub(super) tile: usize,
    pub(super) pixels: Pixels,
    pub(super) samples: Range<u32>,
}

/// Cost of a job.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cost {
    pub(super) rays: RayCounters,
    /// Processor seconds; the picture does not depend on them.
    pub(super) seconds: f64,
}

impl Job {
    /// Number of pixels.
    pub(super) fn pixel_count(&self) -> u64 {
        self.pixels.count() as u64
    }
}

impl Tracer<'_> {
    fn trace(&self, job: &Job) -> Result<(TileSamples, Cost), Cancelled> {
        let Self { kernel, world, settings, token, photons, first, .. } = *self;
        let samples = first + job.samples.start..first + job.samples.end;
        let begin = thread_cpu_seconds();
        let (samples, rays) = kernel(photons, world, settings, job.pixels, samples, token)?;
        Ok((samples, Cost { rays, seconds: thread_cpu_seconds() - begin }))
    }

    /// Do the jobs. `keep` takes the samples of every job that is finished on the thread that made them, in whose cache
    /// they are; `each` is then told on this one, in the order in which they end, and every now and then nothing; it says whether
    /// to go on. Jobs that have begun are finished.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn run<K: Send>(
        &self,
        jobs: &[Job],
        keep: impl Fn(&Job, TileSamples) -> K + Sync,
        mut each: impl FnMut(Option<(&Job, K, Cost)>) -> bool,
    ) -> Result<(), Cancelled> {
        let (next, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
        let threads = self.pool.current_num_threads();
        // Bounded, so that results do not pile up while a preview is made.
        let (sender, results) = mpsc::sync_channel(2 * threads);
        let (next, stopped, keep) = (&next, &stopped, &keep);
        self.pool.in_place_scope(move |scope| {
            for _ in 0..threads.min(jobs.len()) {
                let sender = sender.clone();
                scope.spawn(move |_| {
                    let _guard = StopOnPanic(stopped);
                    let (mut done, mut since) = (Vec::new(), Instant::now());
                    while !stopped.load(Ordering::Relaxed)
                        && let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed))
                        && let Ok((samples, cost)) = self.trace(job)
                    {
                        done.push((job, keep(job, samples), cost));
                        if since.elapsed() >= AT_ONCE {
                            if sender.send(std::mem::take(&mut done)).is_err() {
                                return;
                            }
                            since = Instant::now();
                        }
                    }
                    // Nobody listens any more where this fails.
                    let _ = sender.send(done);
                });
            }
            drop(sender);
            loop {
                let mut go_on = true;
                match results.recv_timeout(TICK) {
                    Ok(done) => {
                        for one in done {
                            go_on &= each(Some(one));
                        }
                    }
                    Err(RecvTimeoutError::Timeout) => go_on = each(None),
                    Err(RecvTimeoutError::Disconnected) => break,
                }
                stopped.fetch_or(!go_on, Ordering::Relaxed);
            }
        });
        // Not `check`, which would wait here while the work is held, deaf to orders.
        if self.token.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

/// Dropped by a panic, it stops the others: their work would be thrown away.
struct StopOnPanic<'a>(&'a AtomicBool);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// Samples that every pixel has after the next pass: 1, 2, 4, … so that pictures come early, then in steps that
/// keep a tile short, in a picture of so many pixels. Every power of two is the end of a pass, as noise is judged there.
pub(super) fn next_pass(done: u32, total: u32, pixels: usize) -> u32 {
    let longest = longest_pass(pixels);
    let power = done.saturating_add(1).checked_next_power_of_two().unwrap_or(u32::MAX);
    done.saturating_add(done.clamp(1, longest)).min(power).min(total)
}

/// Samples of the longest pass.
fn longest_pass(pixels: usize) -> u32 {
    const LONGEST: usize = 32;
    const TILE: usize = (TILE_SIZE * TILE_SIZE) as usize;
    (LONGEST * (TILE / pixels.clamp(1, TILE))) as u32
}

/// In about how many jobs pixels get from `done` samples to `total` by [`next_pass`], where no job has more than `at_once`.
pub(super) fn jobs_to_come(done: u32, total: u32, pixels: usize, at_once: u32) -> u32 {
    let longest = longest_pass(pixels);
    let (mut reached, mut jobs) = (done, 0);
    while reached < longest.min(total) {
        let end = next_pass(reached, total, pixels);
        jobs += (end - reached).div_ceil(at_once);
        reached = end;
    }
    jobs + total.saturating_sub(reached).div_ceil(longest.min(at_once))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_to_come_are_those_of_the_passes() {
        for (done, total, pixels, at_once) in [
            (0, 1, 5000, 99),
            (0, 100, 5000, 99),
            (3, 100, 5000, 99),
            (0, 200, 512, 99),
            (0, 96, 5000, 8),
            (7, 7, 1, 1),
        ] {
            let (mut reached, mut jobs) = (done, 0);
            while reached < total {
                let end = next_pass(reached, total, pixels);
                jobs += (end - reached).div_ceil(at_once);
                reached = end;
            }
            assert_eq!(jobs_to_come(done, total, pixels, at_once), jobs, "{done} {total} {pixels} {at_once}");
        }
        assert_eq!(jobs_to_come(0, u32::MAX, 5000, u32::MAX), 6 + (u32::MAX - 32).div_ceil(32));
    }

    #[test]
    fn passes_double_and_then_stay_short() {
        let passes = |total, pixels| {
            let mut ends = vec![0];
            while let Some(&last) = ends.last()
                && last < total
            {
                ends.push(next_pass(last, total, pixels));
            }
            ends
        };
        assert_eq!(passes(1, 5000), [0, 1]);
        assert_eq!(passes(100, 5000), [0, 1, 2, 4, 8, 16, 32, 64, 96, 100]);
        // A picture of half a tile takes twice as many at a time.
        assert_eq!(passes(200, 512), [0, 1, 2, 4, 8, 16, 32, 64, 128, 192, 200]);
        assert_eq!(next_pass(100, 1000, 5000), 128);
        assert_eq!(next_pass(u32::MAX - 1, u32::MAX, 0), u32::MAX);
    }
}
