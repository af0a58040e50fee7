//! A film with what it is of, and how far it is.

use std::sync::Arc;

use super::super::plan::Plan;
use super::super::trace::Job;
use crate::film::{Film, FilmError, Previewer, RadianceImage};
use crate::scene::fingerprint::Key;

/// A film that is being rendered, or that was.
#[derive(Debug)]
pub(in crate::pipeline) struct Canvas {
    pub(in crate::pipeline) key: Key,
    pub(in crate::pipeline) film: Arc<Film>,
    /// Samples that each tile has.
    pub(super) done: Vec<u32>,
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
        let done = vec![0; film.tile_count()];
        Ok(Self {
            key,
            film: Arc::new(film),
            done,
            base: None,
            previewer: None,
            is_passing: false,
            ended_by: None,
        })
    }

    /// Whether every pixel has this many samples.
    pub(in crate::pipeline) fn is_complete(&self, samples: u32) -> bool {
        self.done.iter().all(|done| *done == samples)
    }

    /// Samples that every pixel has.
    pub(in crate::pipeline) fn samples(&self) -> u32 {
        self.done.iter().copied().min().unwrap_or(0)
    }

    /// Whether no pixel is without a sample, so that the picture may take the place of another one.
    pub(in crate::pipeline) fn is_covered(&self) -> bool {
        self.done.iter().all(|done| *done > 0)
    }

    /// Bytes that it takes.
    pub(super) fn memory_bytes(&self) -> u64 {
        let base = self.base.as_ref().map_or(0, |base| size_of_val(base.pixels.as_slice()) as u64);
        let done = size_of_val(self.done.as_slice()) as u64;
        self.film.memory_bytes() + done + base + self.previewer.as_ref().map_or(0, Previewer::memory_bytes)
    }

    /// What brings every tile to this many samples: the tiles that lack some, in the film's order.
    pub(super) fn jobs(&self, target: u32) -> Vec<Job> {
        let of = |&tile: &usize| {
            Some(Job { tile, rect: self.film.tile_rect(tile)?, samples: self.done[tile]..target })
        };
        self.film.tile_order().iter().filter_map(of).filter(|job| !job.samples.is_empty()).collect()
    }

    /// Pixels times samples.
    pub(super) fn units(&self, samples_of: impl Fn(usize) -> u32) -> u64 {
        let area = |tile| self.film.tile_rect(tile).map_or(0, |rect| rect.area() as u64);
        (0..self.done.len()).map(|tile| area(tile) * u64::from(samples_of(tile))).sum()
    }
}
