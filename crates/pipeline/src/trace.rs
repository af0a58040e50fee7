//! Renders tiles on a thread pool. Threads claim jobs in order, store their samples and report to the calling
//! thread.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use rayon::ThreadPool;

use crate::control::{CancelToken, Canceled};
use crate::film::{Film, SelectedPixels, TILE_SIZE, TileSamples};
use crate::integrators::{PhotonPassesBySample, RayCounters, RenderSettings, render_tile_with_layers};
use crate::system::cpu_time::thread_cpu_seconds;
use crate::world::World;

/// Renders a tile, with or without photon maps. See [`crate::integrators::render_tile_with_photons`].
pub(super) type TileKernel = fn(
    Option<&PhotonPassesBySample>,
    &World,
    &RenderSettings,
    SelectedPixels,
    Range<u32>,
    &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled>;

/// Maximum time between calls to the callback.
pub(super) const TICK: Duration = Duration::from_millis(20);

/// Minimum time between two reports from a thread. Waking the calling thread takes longer than the smallest
/// jobs.
const MIN_REPORT_INTERVAL: Duration = Duration::from_micros(300);

/// State shared by all jobs.
#[derive(Clone, Copy)]
pub(super) struct Tracer<'a> {
    pub(super) kernel: TileKernel,
    pub(super) pool: &'a ThreadPool,
    pub(super) world: &'a World,
    pub(super) settings: &'a RenderSettings,
    pub(super) token: &'a CancelToken,
    /// Photon maps for all jobs' samples, if photons are gathered.
    pub(super) photons: Option<&'a PhotonPassesBySample>,
    /// Index of the jobs' first sample in the entire image.
    pub(super) first: u32,
    /// Film whose layer sums the samples are added to, if there are layers.
    pub(super) layers: Option<&'a Film>,
}

/// Samples to render in one tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TileJob {
    pub(super) tile: usize,
    pub(super) pixels: SelectedPixels,
    pub(super) samples: Range<u32>,
}

/// Cost of a job.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TraceCost {
    pub(super) rays: RayCounters,
    /// CPU seconds. Does not affect the image.
    pub(super) seconds: f64,
}

impl TileJob {
    /// Returns the number of pixels in the job.
    pub(super) fn pixel_count(&self) -> u64 {
        self.pixels.count() as u64
    }
}

impl Tracer<'_> {
    fn trace_tile(&self, job: &TileJob) -> Result<(TileSamples, TraceCost), Canceled> {
        let Self { kernel, world, settings, token, photons, first, layers, .. } = *self;
        let samples = first + job.samples.start..first + job.samples.end;
        let begin = thread_cpu_seconds();
        let (samples, rays) = match layers {
            Some(film) => {
                let sums = film.tile_layer_sums(job.tile, job.pixels);
                render_tile_with_layers(photons, world, settings, (job.pixels, samples), sums, token)?
            }
            None => kernel(photons, world, settings, job.pixels, samples, token)?,
        };
        Ok((samples, TraceCost { rays, seconds: thread_cpu_seconds() - begin }))
    }

    /// Renders the jobs. `keep` stores the samples of each finished job. It runs on the thread that rendered
    /// the samples, because they are in that thread's CPU cache. `each` is called on the current thread for
    /// each finished job, in order of completion, and with `None` whenever no results arrive within [`TICK`].
    /// It returns whether to continue. Jobs that have already started are always finished.
    ///
    /// # Errors
    /// Returns [`Canceled`] if the token is canceled.
    pub(super) fn run_all_jobs_in_parallel<K: Send>(
        &self,
        jobs: &[TileJob],
        keep: impl Fn(&TileJob, TileSamples) -> K + Sync,
        mut each: impl FnMut(Option<(&TileJob, K, TraceCost)>) -> bool,
    ) -> Result<(), Canceled> {
        let (next, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
        let threads = self.pool.current_num_threads();
        // Bound the channel so that results do not pile up while a preview is created.
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
                        && let Ok((samples, cost)) = self.trace_tile(job)
                    {
                        done.push((job, keep(job, samples), cost));
                        if since.elapsed() >= MIN_REPORT_INTERVAL {
                            if sender.send(std::mem::take(&mut done)).is_err() {
                                return;
                            }
                            since = Instant::now();
                        }
                    }
                    // Sending only fails if the receiver has been dropped.
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
        // Do not call `check_pause_and_cancel`. It blocks while work is paused, which would delay commands.
        if self.token.is_canceled() { Err(Canceled) } else { Ok(()) }
    }
}

/// Stops the other threads after a panic, because their work will be discarded.
struct StopOnPanic<'a>(&'a AtomicBool);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// Returns the number of samples per pixel after the next pass. It is 1, 2, 4, … at first, so that an image
/// appears early, and then increases in steps that keep the time per tile short. `pixels` is the image size.
/// A pass ends at every power of two, because noise is evaluated there.
pub(super) fn samples_after_next_pass(done: u32, total: u32, pixels: usize) -> u32 {
    let longest = max_pass_samples(pixels);
    let power = done.saturating_add(1).checked_next_power_of_two().unwrap_or(u32::MAX);
    done.saturating_add(done.clamp(1, longest)).min(power).min(total)
}

/// Returns the number of samples per pixel in the longest pass.
fn max_pass_samples(pixels: usize) -> u32 {
    const MAX_PASS_SAMPLES: usize = 32;
    const TILE: usize = (TILE_SIZE * TILE_SIZE) as usize;
    (MAX_PASS_SAMPLES * (TILE / pixels.clamp(1, TILE))) as u32
}

/// Estimates the number of jobs needed to take a pixel from `done` to `total` samples using
/// [`samples_after_next_pass`]. Each job has at most `at_once` samples.
pub(super) fn estimate_jobs_per_pixel(done: u32, total: u32, pixels: usize, at_once: u32) -> u32 {
    let longest = max_pass_samples(pixels);
    let (mut reached, mut jobs) = (done, 0);
    while reached < longest.min(total) {
        let end = samples_after_next_pass(reached, total, pixels);
        jobs += (end - reached).div_ceil(at_once);
        reached = end;
    }
    jobs + total.saturating_sub(reached).div_ceil(longest.min(at_once))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remaining_jobs_match_passes() {
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
                let end = samples_after_next_pass(reached, total, pixels);
                jobs += (end - reached).div_ceil(at_once);
                reached = end;
            }
            assert_eq!(
                estimate_jobs_per_pixel(done, total, pixels, at_once),
                jobs,
                "{done} {total} {pixels} {at_once}"
            );
        }
        assert_eq!(estimate_jobs_per_pixel(0, u32::MAX, 5000, u32::MAX), 6 + (u32::MAX - 32).div_ceil(32));
    }

    #[test]
    fn pass_length_doubles_up_to_a_limit() {
        let passes = |total, pixels| {
            let mut ends = vec![0];
            while let Some(&last) = ends.last()
                && last < total
            {
                ends.push(samples_after_next_pass(last, total, pixels));
            }
            ends
        };
        assert_eq!(passes(1, 5000), [0, 1]);
        assert_eq!(passes(100, 5000), [0, 1, 2, 4, 8, 16, 32, 64, 96, 100]);
        // An image half the size of a tile has twice as many samples per pass.
        assert_eq!(passes(200, 512), [0, 1, 2, 4, 8, 16, 32, 64, 128, 192, 200]);
        assert_eq!(samples_after_next_pass(100, 1000, 5000), 128);
        assert_eq!(samples_after_next_pass(u32::MAX - 1, u32::MAX, 0), u32::MAX);
    }
}
