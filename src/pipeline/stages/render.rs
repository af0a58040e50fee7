//! Tracing: pass after pass into a film, with progress and previews on the way.
//!
//! The film is kept: an interrupted render goes on where it was, more samples are added to those that are there,
//! and both give the bits of an uninterrupted one, because every sample is a function of its pixel and number and
//! every pixel's sum has the order of its samples.

use std::time::{Duration, Instant};

use super::super::fingerprint::Key;
use super::super::pace::{Clock, Pace};
use super::super::plan::Plan;
use super::super::protocol::{PreviewSize, RenderProgress};
use super::super::sink::Sink;
use super::super::trace::{Job, Tracer, next_pass};
use super::{Staged, Stop};
use crate::film::{Film, Previewer, RadianceImage, Rect, tone::develop};
use crate::integrators::{RayCounters, RenderSettings};

/// At most this often.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(60);
/// At most this often.
const PREVIEW_INTERVAL: Duration = Duration::from_millis(66);
/// A preview may take this part of the time at most.
const PREVIEW_SHARE: u32 = 10;
/// The longest that a film is taken up into a preview without a look at the orders.
const PREVIEW_PATIENCE: Duration = Duration::from_millis(4);

/// A film with what it is of.
#[derive(Debug)]
pub(in crate::pipeline) struct Canvas {
    pub(in crate::pipeline) key: Key,
    pub(in crate::pipeline) film: Film,
    /// Samples that each tile has.
    done: Vec<u32>,
    /// A first picture at the size of the preview, shown where there are no samples yet.
    base: Option<RadianceImage>,
    /// What the last preview was made by.
    previewer: Option<Previewer>,
    /// The budget that ended the last render of it.
    ended_by: Option<f64>,
}

impl Canvas {
    fn new(key: Key, plan: &Plan) -> Result<Self, Stop> {
        let film = Film::new(plan.settings.width, plan.settings.height, plan.crop).map_err(Stop::work)?;
        let done = vec![0; film.tile_count()];
        Ok(Self { key, film, done, base: None, previewer: None, ended_by: None })
    }

    /// Whether every pixel has this many samples.
    pub(in crate::pipeline) fn is_complete(&self, samples: u32) -> bool {
        self.done.iter().all(|done| *done == samples)
    }

    /// Samples that every pixel has.
    pub(in crate::pipeline) fn samples(&self) -> u32 {
        self.done.iter().copied().min().unwrap_or(0)
    }

    fn jobs(&self, target: u32) -> Vec<Job> {
        jobs(&self.film, |tile| self.done[tile]..target)
    }

    /// Take up in a preview of this size what changed, for a short time; whether that was all.
    fn catch_up(&mut self, (width, height): (u32, u32)) -> bool {
        self.previewer.take_if(|previewer| previewer.size() != (width, height));
        let previewer = self.previewer.get_or_insert_with(|| Previewer::new(width, height));
        previewer.update(&self.film, Some(Instant::now() + PREVIEW_PATIENCE))
    }

    /// Pixels times samples.
    fn units(&self, samples_of: impl Fn(usize) -> u32) -> u64 {
        let area = |tile| self.film.tile_rect(tile).map_or(0, |rect| rect.area() as u64);
        (0..self.done.len()).map(|tile| area(tile) * u64::from(samples_of(tile))).sum()
    }
}

/// What the stage is given.
pub(in crate::pipeline) struct Order<'a> {
    pub(in crate::pipeline) tracer: Tracer<'a>,
    pub(in crate::pipeline) plan: &'a Plan,
    pub(in crate::pipeline) preview: Option<PreviewSize>,
    /// Start from an empty film whatever is kept.
    pub(in crate::pipeline) force: bool,
    pub(in crate::pipeline) sink: &'a Sink,
    /// Called often with the film as it is, for orders that come during the render.
    pub(in crate::pipeline) pulse: &'a dyn Fn(&Canvas),
}

/// Bring the canvas to what is asked for.
///
/// # Errors
/// Cancelled; no memory for the film. The canvas keeps what it has.
pub(in crate::pipeline) fn render(
    key: Key,
    canvas: &mut Option<Canvas>,
    order: &Order<'_>,
) -> Result<Staged<RayCounters>, Stop> {
    let wanted = order.plan.samples;
    let usable =
        |kept: &Canvas| !order.force && kept.key == key && kept.done.iter().all(|done| *done <= wanted);
    if !canvas.as_ref().is_some_and(usable) {
        // The old film goes first: there may not be memory for two.
        *canvas = None;
    }
    let canvas = match canvas {
        Some(kept) => kept,
        none => none.insert(Canvas::new(key, order.plan)?),
    };
    let budget = order.plan.time_seconds;
    let finished = canvas.is_complete(wanted) || (budget.is_some() && canvas.ended_by == budget);
    let had = canvas.samples();
    let mut painter = Painter::new(canvas, order);
    if finished {
        painter.show();
        return Ok(Staged::reused(RayCounters::default(), "nothing that it shows changed"));
    }
    painter.canvas.ended_by = None;
    painter.paint()?;
    let rays = painter.rays;
    Ok(match (!painter.canvas.is_complete(wanted), had) {
        (true, _) => {
            canvas.ended_by = budget;
            Staged::done(rays, "the time was up")
        }
        (false, 0) => Staged::done(rays, ""),
        (false, _) => Staged::done(rays, format!("went on after {had} samples")),
    })
}

/// One run of the stage.
struct Painter<'a> {
    canvas: &'a mut Canvas,
    order: &'a Order<'a>,
    clock: Clock,
    pace: Pace,
    units: u64,
    rays: RayCounters,
    is_over_time: bool,
    next_progress: Instant,
    next_preview: Instant,
}

impl<'a> Painter<'a> {
    fn new(canvas: &'a mut Canvas, order: &'a Order<'a>) -> Self {
        let units = canvas.units(|tile| canvas.done[tile]);
        let total = canvas.units(|_| order.plan.samples);
        Self {
            canvas,
            order,
            clock: Clock::start(),
            pace: Pace::new(units, total),
            units,
            rays: RayCounters::default(),
            is_over_time: false,
            next_progress: Instant::now(),
            next_preview: Instant::now(),
        }
    }

    fn paint(&mut self) -> Result<(), Stop> {
        self.say_progress(false);
        if self.canvas.samples() == 0 {
            self.coarse()?;
        }
        while !self.canvas.is_complete(self.order.plan.samples) && !self.is_over_time {
            let first = self.canvas.samples() == 0;
            self.pass(next_pass(self.canvas.samples(), self.order.plan.samples))?;
            if first {
                self.canvas.base = None;
                self.show();
            }
        }
        self.show();
        self.say_progress(true);
        Ok(())
    }

    /// All tiles that have fewer samples than `target`.
    fn pass(&mut self, target: u32) -> Result<(), Stop> {
        let jobs = self.canvas.jobs(target);
        let tracer = self.order.tracer;
        tracer.run(&jobs, |result| {
            if let Some((job, samples, rays)) = result {
                self.canvas.film.add(job.tile, &samples);
                self.canvas.done[job.tile] = job.samples.end;
                self.units += job.rect.area() as u64 * job.samples.len() as u64;
                self.rays += rays;
            }
            self.tick();
            !self.is_over_time
        })?;
        Ok(())
    }

    /// What is due between two tiles.
    fn tick(&mut self) {
        let now = Instant::now();
        if now >= self.next_progress {
            self.next_progress = now + PROGRESS_INTERVAL;
            self.say_progress(false);
        }
        if now >= self.next_preview {
            self.show_some(now);
        }
        (self.order.pulse)(self.canvas);
        let seconds = self.clock.seconds(self.order.tracer.token.is_paused());
        self.is_over_time = self.order.plan.time_seconds.is_some_and(|budget| seconds >= budget);
    }

    fn say_progress(&mut self, is_last: bool) {
        let elapsed_seconds = self.clock.seconds(self.order.tracer.token.is_paused());
        let (mut fraction, mut eta_seconds) = self.pace.at(elapsed_seconds, self.units);
        if let Some(budget) = self.order.plan.time_seconds {
            let left = (budget - elapsed_seconds).max(0.0);
            eta_seconds = Some(eta_seconds.unwrap_or(left).min(left));
            // Time passes even where work stands still, and neither falls.
            fraction = fraction.max((elapsed_seconds / budget).min(1.0));
        }
        if is_last {
            (fraction, eta_seconds) = (1.0, Some(0.0));
        }
        self.order.sink.progress(RenderProgress {
            fraction,
            elapsed_seconds,
            eta_seconds,
            samples: (self.units / self.canvas.film.crop().area() as u64) as u32,
            total_samples: self.order.plan.samples,
        });
    }

    /// The film as it is, into the slot. For when no tile is being rendered: the pool's threads are asked to help.
    fn show(&mut self) {
        let (order, size) = (self.order, self.preview_size());
        let Some(size) = size else { return };
        show(self.canvas, size, order);
        self.next_preview = Instant::now() + PREVIEW_INTERVAL;
    }

    /// The same between two tiles, on this thread and for a short time: what is left is taken up at the next tick.
    fn show_some(&mut self, now: Instant) {
        let Some(size) = self.preview_size() else { return };
        self.canvas.catch_up(size);
        if self.canvas.previewer.as_ref().is_some_and(Previewer::is_whole) {
            say_picture(self.canvas, self.order);
            self.next_preview = Instant::now() + PREVIEW_INTERVAL.max(now.elapsed() * PREVIEW_SHARE);
        }
    }

    fn preview_size(&self) -> Option<(u32, u32)> {
        let settings = &self.order.plan.settings;
        self.order.preview.and_then(|bounds| fit(settings.width, settings.height, bounds))
    }

    /// A first picture with one sample at the preview's own resolution, where that is much less work than one pass.
    fn coarse(&mut self) -> Result<(), Stop> {
        let plan = self.order.plan;
        let (full_width, full_height) = (plan.settings.width, plan.settings.height);
        let Some((width, height)) = self.preview_size() else { return Ok(()) };
        let pixels = |width: u32, height: u32| u64::from(width) * u64::from(height);
        if pixels(width, height) * 2 > pixels(full_width, full_height) {
            return Ok(());
        }
        let settings = RenderSettings { width, height, ..plan.settings };
        let crop = plan.crop.map(|rect| scale(rect, (full_width, full_height), (width, height)));
        let film = Film::new(width, height, crop).map_err(Stop::work)?;
        let jobs = jobs(&film, |_| 0..1);
        let tracer = Tracer { settings: &settings, ..self.order.tracer };
        tracer.run(&jobs, |result| {
            if let Some((job, samples, _)) = result {
                film.add(job.tile, &samples);
            }
            true
        })?;
        self.canvas.base = Some(film.radiance());
        self.show();
        Ok(())
    }
}

/// The whole film into the slot, unless that is cancelled meanwhile.
fn show(canvas: &mut Canvas, size: (u32, u32), order: &Order<'_>) {
    let Tracer { pool, token, .. } = order.tracer;
    while !pool.install(|| canvas.catch_up(size)) {
        if token.is_cancelled() {
            return;
        }
    }
    say_picture(canvas, order);
}

/// What the previewer took up, into the slot.
fn say_picture(canvas: &Canvas, order: &Order<'_>) {
    if let Some(previewer) = &canvas.previewer {
        let image = previewer.picture(canvas.base.as_ref());
        order.sink.preview(develop(&image, &order.plan.tone));
    }
}

/// The tiles that lack samples, in the film's order.
fn jobs(film: &Film, samples_of: impl Fn(usize) -> std::ops::Range<u32>) -> Vec<Job> {
    let job = |&tile: &usize| Some(Job { tile, rect: film.tile_rect(tile)?, samples: samples_of(tile) });
    film.tile_order().iter().filter_map(job).filter(|job| !job.samples.is_empty()).collect()
}

/// The largest picture of this aspect ratio inside the bounds.
fn fit(width: u32, height: u32, bounds: PreviewSize) -> Option<(u32, u32)> {
    if bounds.width == 0 || bounds.height == 0 {
        return None;
    }
    let (w, h) = (u64::from(width), u64::from(height));
    let (bound_w, bound_h) = (u64::from(bounds.width), u64::from(bounds.height));
    let rounded = |a: u64, b: u64| ((2 * a + b) / (2 * b)).max(1);
    let (w, h) = if w * bound_h >= h * bound_w {
        (bound_w, rounded(h * bound_w, w).min(bound_h))
    } else {
        (rounded(w * bound_h, h).min(bound_w), bound_h)
    };
    Some((w as u32, h as u32))
}

/// The pixels of a smaller picture that lie under a rectangle of a larger one.
fn scale(rect: Rect, from: (u32, u32), to: (u32, u32)) -> Rect {
    let along = |start: u32, len: u32, from: u32, to: u32| {
        let at = |pixel: u32| u64::from(pixel) * u64::from(to) / u64::from(from);
        let begin = (at(start) as u32).min(to - 1);
        let end = ((u64::from(start) + u64::from(len)) * u64::from(to)).div_ceil(u64::from(from)) as u32;
        (begin, end.clamp(begin + 1, to) - begin)
    };
    let (x, width) = along(rect.x, rect.width, from.0, to.0);
    let (y, height) = along(rect.y, rect.height, from.1, to.1);
    Rect { x, y, width, height }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preview_keeps_the_aspect_ratio_inside_its_bounds() {
        let bounds = |width, height| PreviewSize { width, height };
        assert_eq!(fit(640, 480, bounds(80, 48)), Some((64, 48)));
        assert_eq!(fit(640, 480, bounds(64, 100)), Some((64, 48)));
        assert_eq!(fit(10_000, 1, bounds(80, 48)), Some((80, 1)));
        assert_eq!(fit(1, 10_000, bounds(80, 48)), Some((1, 48)));
        assert_eq!(fit(1, 1, bounds(0, 48)), None);
    }

    #[test]
    fn a_crop_covers_its_part_of_a_smaller_picture() {
        let rect = Rect { x: 10, y: 30, width: 5, height: 10 };
        assert_eq!(scale(rect, (100, 100), (10, 10)), Rect { x: 1, y: 3, width: 1, height: 1 });
        let last = Rect { x: 99, y: 99, width: 1, height: 1 };
        assert_eq!(scale(last, (100, 100), (3, 3)), Rect { x: 2, y: 2, width: 1, height: 1 });
    }
}
