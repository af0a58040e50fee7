//! A film with what it is of, and how far it is.

use std::sync::Arc;

use super::super::plan::Plan;
use super::super::trace::{Job, Rows};
use super::adaptive::Goals;
use crate::film::{Film, FilmError, Previewer, RadianceImage, Rect};
use crate::scene::fingerprint::Key;

/// A film that is being rendered, or that was.
#[derive(Debug)]
pub(in crate::pipeline) struct Canvas {
    pub(in crate::pipeline) key: Key,
    pub(in crate::pipeline) film: Arc<Film>,
    /// Samples that the even and the odd rows of each tile have.
    pub(super) done: Vec<[u32; 2]>,
    /// Samples that they are to have at most.
    pub(super) goals: Goals,
    /// A first picture at the size of the preview, shown where there are no samples yet.
    pub(super) base: Option<RadianceImage>,
    /// What the last preview was made by.
    pub(super) previewer: Option<Previewer>,
    /// Whether it was begun for a camera on its way.
    pub(super) is_passing: bool,
    /// The budget that ended the last render of it.
    pub(super) ended_by: Option<f64>,
}

impl Canvas {
    /// Without samples; its film may take `most_bytes`.
    ///
    /// # Errors
    /// There is no memory for the film.
    pub(super) fn new(key: Key, plan: &Plan, most_bytes: u64) -> Result<Self, FilmError> {
        let film =
            Film::within(most_bytes, plan.settings.render.width, plan.settings.render.height, plan.crop)?;
        let (done, goals) = (vec![[0; 2]; film.tile_count()], Goals::none(film.tile_count()));
        Ok(Self {
            key,
            film: Arc::new(film),
            done,
            goals,
            base: None,
            previewer: None,
            is_passing: false,
            ended_by: None,
        })
    }

    /// Whether every pixel has this many samples, or those that it is to have.
    pub(in crate::pipeline) fn is_complete(&self, samples: u32) -> bool {
        self.is_complete_in(None, samples)
    }

    /// The same of the tiles of a part; none: of all.
    pub(super) fn is_complete_in(&self, part: Option<Rect>, samples: u32) -> bool {
        self.halves()
            .filter(|(tile, _)| self.is_in(part, *tile))
            .all(|(tile, half)| self.done[tile][half] >= self.goals.of(tile, half).min(samples))
    }

    /// Whether no pixel has more samples than these.
    pub(super) fn has_at_most(&self, samples: u32) -> bool {
        self.done.as_flattened().iter().all(|done| *done <= samples)
    }

    /// Samples that every pixel has which is to have more, up to some.
    pub(in crate::pipeline) fn samples(&self, most: u32) -> u32 {
        self.samples_in(None, most)
    }

    /// The same of the tiles of a part; none: of all.
    pub(super) fn samples_in(&self, part: Option<Rect>, most: u32) -> u32 {
        let of = |(tile, half): (usize, usize)| {
            let done = self.done[tile][half];
            (done < self.goals.of(tile, half).min(most)).then_some(done)
        };
        self.halves().filter(|(tile, _)| self.is_in(part, *tile)).filter_map(of).min().unwrap_or(most)
    }

    /// Whether a tile has pixels in a part.
    fn is_in(&self, part: Option<Rect>, tile: usize) -> bool {
        part.is_none_or(|part| {
            self.film.tile_rect(tile).is_some_and(|rect| rect.intersection(&part).is_some())
        })
    }

    /// Whether there are samples.
    pub(super) fn is_begun(&self) -> bool {
        self.done.as_flattened().iter().any(|done| *done > 0)
    }

    /// Whether no pixel is without a sample, so that the picture may take the place of another one.
    pub(in crate::pipeline) fn is_covered(&self) -> bool {
        self.done.as_flattened().iter().all(|done| *done > 0)
    }

    fn halves(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.done.len()).flat_map(|tile| [(tile, 0), (tile, 1)])
    }

    /// Bytes that it takes.
    pub(super) fn memory_bytes(&self) -> u64 {
        let base = self.base.as_ref().map_or(0, |base| size_of_val(base.pixels.as_slice()) as u64);
        let done = 3 * size_of_val(self.done.as_slice()) as u64;
        self.film.memory_bytes() + done + base + self.previewer.as_ref().map_or(0, Previewer::memory_bytes)
    }

    /// What brings every tile of a part (none: of all) to this many samples, or to those that it is to have: the tiles that lack
    /// some, in the film's order.
    pub(super) fn jobs(&self, part: Option<Rect>, target: u32) -> Vec<Job> {
        let mut jobs = Vec::new();
        for &tile in self.film.tile_order().iter().filter(|tile| self.is_in(part, **tile)) {
            let Some(rect) = self.film.tile_rect(tile) else { continue };
            let [even, odd] = [0, 1].map(|half| self.done[tile][half]..self.goals.of(tile, half).min(target));
            if even == odd {
                jobs.push(Job { tile, rect, rows: Rows::All, samples: even });
            } else {
                let of = |(half, samples)| Job { tile, rect, rows: Rows::Half(half), samples };
                jobs.extend([(0, even), (1, odd)].map(of));
            }
        }
        jobs.retain(|job| !job.samples.is_empty());
        jobs
    }

    /// Note that a job is done; pixels times samples that it was.
    pub(super) fn note(&mut self, job: &Job) -> u64 {
        match job.rows {
            Rows::All => self.done[job.tile] = [job.samples.end; 2],
            Rows::Half(half) => self.done[job.tile][half] = job.samples.end,
        }
        job.pixels() * job.samples.len() as u64
    }

    /// Decide which tiles have enough samples, of those that have this power of two of them.
    pub(super) fn judge(&mut self, samples: u32, error: f64) {
        self.goals.judge(&self.film, &self.done, samples, error);
    }

    /// Pixels times samples that there are.
    pub(super) fn units(&self) -> u64 {
        self.units_of(|tile, half| self.done[tile][half])
    }

    /// Pixels times samples that there will be, as far as that is known, of some at most.
    pub(super) fn units_to_come(&self, most: u32) -> u64 {
        self.units_of(|tile, half| self.goals.expected(tile, half).min(most))
    }

    fn units_of(&self, samples_of: impl Fn(usize, usize) -> u32) -> u64 {
        let units = |(tile, half): (usize, usize)| {
            let pixels = |rect| Rows::Half(half).pixels(rect);
            self.film.tile_rect(tile).map_or(0, pixels) * u64::from(samples_of(tile, half))
        };
        self.halves().map(units).sum()
    }
}
