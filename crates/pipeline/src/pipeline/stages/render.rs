//! Tracing: pass after pass into a film, with progress and previews on the way.
//!
//! The film is kept: an interrupted render goes on where it was, more samples are added to those that are there,
//! and both give the bits of an uninterrupted one, because every sample is a function of its pixel and number and
//! every pixel's sum has the order of its samples.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::super::pace::{Clock, Pace, Work};
use super::super::plan::Plan;
use super::super::protocol::{PreviewSize, RenderProgress, Section};
use super::super::sink::Sink;
use super::super::trace::{Job, Tracer, jobs_to_come, next_pass};
use super::adaptive::LEAST;
use super::canvas::Canvas;
use super::coarse::Coarse;
use super::films::Films;
use super::outlook::Outlook;
use super::photons::{PhotonStore, Sending};
use super::preview::Screen;
use super::spread::next_round;
use super::{Staged, Stop};
use crate::film::{Convergence, Rect, TILE_SIZE, TileSamples};
use crate::integrators::{PhotonMaps, RayCounters};
use crate::scene::description::Render;
use crate::scene::fingerprint::Key;

/// At most this often.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(60);
/// At most this often.
const PREVIEW_INTERVAL: Duration = Duration::from_millis(66);
/// A preview may take this part of the time at most.
const PREVIEW_SHARE: u32 = 10;
/// To see what is to come may take this part of it: it is a sum over all cells.
const FORESIGHT_SHARE: u32 = 100;

/// What the stage is given.
pub(in crate::pipeline) struct Rendering<'a> {
    pub(in crate::pipeline) tracer: Tracer<'a>,
    pub(in crate::pipeline) plan: &'a Plan,
    /// Where photons are gathered: those of the scene.
    pub(in crate::pipeline) photons: Option<&'a PhotonStore>,
    pub(in crate::pipeline) preview: Option<PreviewSize>,
    pub(in crate::pipeline) most_film_bytes: u64,
    /// Start from an empty film whatever is kept.
    pub(in crate::pipeline) force: bool,
    /// What gets its samples before the rest.
    pub(in crate::pipeline) first: Option<Section>,
    pub(in crate::pipeline) sink: &'a Sink,
    /// Called often with the film as it is, for orders that come during the render; and whether every pixel of it
    /// has a sample.
    pub(in crate::pipeline) pulse: &'a dyn Fn(&Canvas, bool),
    /// Takes an order for another size of the previews.
    pub(in crate::pipeline) take_preview: &'a dyn Fn() -> Option<Option<PreviewSize>>,
    /// Whether somebody is moving the camera: the first picture must come soon, however small it is.
    pub(in crate::pipeline) is_moved: bool,
    /// Pixels of first pictures that are traced in a second, as the last one was.
    pub(in crate::pipeline) coarse_rate: &'a Cell<Option<f64>>,
}

/// Bring the film of this key to what is asked for.
///
/// # Errors
/// Cancelled; no memory for the film. The film keeps what it has.
pub(in crate::pipeline) fn render(
    key: Key,
    films: &mut Films,
    rendering: &Rendering<'_>,
) -> Result<Staged<RayCounters>, Stop> {
    let Render { samples: wanted, error, .. } = rendering.plan.settings.render;
    let is_other = films.current().is_some_and(|current| current.key != key);
    films.select(key, |kept| !rendering.force && kept.has_at_most(wanted));
    if films.current().is_none() {
        let convergence = match rendering.photons.is_some_and(PhotonStore::are_sent) {
            true => Convergence::Photons,
            false => Convergence::Stratified,
        };
        let canvas = || Canvas::new(key, rendering.plan, rendering.most_film_bytes, convergence);
        films.put(canvas).map_err(Stop::work)?;
    }
    let Some(canvas) = films.current_mut() else { return Err(Stop::work("the film is gone")) };
    let budget = rendering.plan.time_seconds;
    let finished = canvas.is_complete(wanted) || (budget.is_some() && canvas.ended_by == budget);
    let had = canvas.samples(wanted);
    let mut painter = Painter::new(canvas, rendering);
    if finished {
        painter.show();
        let why = if is_other { "its film was kept" } else { "nothing that it shows changed" };
        return Ok(Staged::reused(RayCounters::default(), why));
    }
    painter.canvas.ended_by = None;
    painter.canvas.is_passing = rendering.is_moved;
    painter.paint()?;
    let rays = painter.rays;
    Ok(match (!painter.canvas.is_complete(wanted), had) {
        (true, _) => {
            canvas.ended_by = budget;
            Staged::done(rays, "the time was up")
        }
        (false, _) if canvas.goals.are_below(wanted) => {
            let missed = canvas.missed(error.into()).map_or_else(String::new, |(tiles, worst)| {
                format!("; of {tiles}, where few pixels have it, it is up to {worst:.2}")
            });
            Staged::done(rays, format!("the noise of some tiles is below {error}{missed}"))
        }
        (false, 0) => Staged::done(rays, ""),
        (false, _) => Staged::done(rays, format!("went on after {had} samples")),
    })
}

/// What is known of the end.
struct Foresight {
    /// When it is to be seen again.
    due: Instant,
    /// Seconds of a processor in all.
    total: Option<f64>,
    /// Of photons, now and in the end.
    passes: [u32; 2],
}

/// One run of the stage.
struct Painter<'a> {
    canvas: &'a mut Canvas,
    rendering: &'a Rendering<'a>,
    screen: Screen<'a>,
    clock: Clock,
    pace: Pace,
    outlook: Outlook,
    fraction: f64,
    units: u64,
    /// Of an earlier render.
    units_before: u64,
    total_units: u64,
    foresight: Foresight,
    /// Seconds in which photons were sent.
    sending_seconds: f64,
    /// When the last of them began to be sent, while they are.
    sending_since: Option<f64>,
    rays: RayCounters,
    /// Whether some pixels have no sample yet: until they have, nothing but a cancel ends the render.
    is_first: bool,
    is_over_time: bool,
    next_progress: Instant,
    next_preview: Instant,
}

impl<'a> Painter<'a> {
    fn new(canvas: &'a mut Canvas, rendering: &'a Rendering<'a>) -> Self {
        let units = canvas.units();
        let total_units = canvas.units_to_come(rendering.plan.settings.render.samples);
        let bounds = (rendering.take_preview)().unwrap_or(rendering.preview);
        let done = canvas.seconds();
        Self {
            is_first: !canvas.is_covered(),
            canvas,
            rendering,
            screen: Screen { bounds, plan: rendering.plan, sink: rendering.sink },
            clock: Clock::start(),
            pace: Pace::new(done),
            sending_seconds: 0.0,
            sending_since: None,
            outlook: Outlook::new(),
            fraction: 0.0,
            units,
            units_before: units,
            total_units,
            foresight: Foresight { due: Instant::now(), total: None, passes: [0; 2] },
            rays: RayCounters::default(),
            is_over_time: false,
            next_progress: Instant::now(),
            next_preview: Instant::now(),
        }
    }

    fn paint(&mut self) -> Result<(), Stop> {
        self.say_progress(false);
        if self.is_first {
            if self.canvas.base.is_none() {
                self.coarse()?;
            }
            let first = self.first();
            if first.is_some() {
                self.pass(first, 1)?;
            }
            self.pass(None, 1)?;
            self.is_first = false;
            self.canvas.base = None;
            self.show();
            self.tick();
        }
        let Render { samples, error, .. } = self.rendering.plan.settings.render;
        if let Some(first) = self.first() {
            // Noise is held against the brightness of the whole picture, which is known then.
            let of_all = if error > 0.0 { LEAST.min(samples) } else { 1 };
            self.passes(None, of_all)?;
            self.passes(Some(first), samples)?;
        }
        self.passes(None, samples)?;
        self.show();
        self.say_progress(true);
        Ok(())
    }

    /// The pixels that come before the rest.
    fn first(&self) -> Option<Rect> {
        let Render { width, height, .. } = self.rendering.plan.settings.render;
        self.rendering.first.map(|section| section.pixels((width, height)))
    }

    /// Pass after pass until a part (none: all) has so many samples, or those that it is to have.
    fn passes(&mut self, part: Option<Rect>, samples: u32) -> Result<(), Stop> {
        let Render { samples: most, error, .. } = self.rendering.plan.settings.render;
        while !self.canvas.is_complete_in(part, samples) && !self.is_over_time {
            if let Some(goals) = self.next_round().filter(|_| part.is_none()) {
                self.round(&goals)?;
                self.look();
                continue;
            }
            let pixels = self.canvas.film.crop().area();
            let target = next_pass(self.canvas.samples_in(part, samples), samples, pixels);
            self.pass(part, target)?;
            if target.is_power_of_two() {
                self.look();
            }
            if error > 0.0 && target.is_power_of_two() && !self.is_over_time {
                self.rendering.tracer.pool.install(|| self.canvas.judge(target, error.into()));
                self.total_units = self.canvas.units_to_come(most);
                self.foresight.due = Instant::now();
            }
        }
        Ok(())
    }

    /// At the noise, where it is time.
    fn look(&mut self) {
        let least = self.canvas.samples(u32::MAX);
        let (film, seconds) = (&self.canvas.film, self.canvas.seconds());
        self.rendering.tracer.pool.install(|| self.outlook.look(film, least, seconds));
    }

    /// All tiles of a part that have fewer samples than `target`.
    fn pass(&mut self, part: Option<Rect>, target: u32) -> Result<(), Stop> {
        let Some(photons) = self.rendering.photons else { return self.pass_by(part, |_, _| target, None) };
        while !self.canvas.is_complete_in(part, target) && !self.is_over_time {
            let samples = self.canvas.samples_in(part, target);
            let end = target.min(samples.saturating_add(photons.at_once()));
            // Photons that no time is left for are not sent, nor gathered.
            self.tick();
            if self.is_over_time {
                break;
            }
            let maps = self.maps(photons, samples..end)?;
            if self.is_over_time {
                break;
            }
            self.pass_by(part, |_, _| end, Some(&maps))?;
        }
        Ok(())
    }

    /// The photons of some samples; orders are heard while they are sent.
    fn maps(&mut self, photons: &PhotonStore, samples: Range<u32>) -> Result<PhotonMaps, Stop> {
        let Rendering { plan, sink, tracer, .. } = *self.rendering;
        let Tracer { pool, world, token, .. } = tracer;
        let begin = self.clock.seconds(token.is_paused());
        self.sending_since = Some(begin);
        let maps = photons.maps(samples, Sending { world, plan, pool, token, sink }, || self.tick())?;
        self.sending_since = None;
        self.sending_seconds += self.clock.seconds(token.is_paused()) - begin;
        Ok(maps)
    }

    /// Samples that the halves of each cell are to have next, where there is a budget of time: some where they lower the error most.
    /// Photons cost as much for the samples of one cell as for those of all, and an error asked for tells by itself where samples go.
    fn next_round(&self) -> Option<Vec<[u32; 2]>> {
        let Rendering { plan, photons, .. } = *self.rendering;
        let Render { samples, error, .. } = plan.settings.render;
        if plan.time_seconds.is_none() || photons.is_some() || error > 0.0 {
            return None;
        }
        next_round(&self.canvas.film, &self.canvas.done, &self.canvas.rays, samples)
    }

    /// Bring the halves of all cells to these samples, in steps that are short.
    fn round(&mut self, goals: &[[u32; 2]]) -> Result<(), Stop> {
        const STEP: Duration = Duration::from_millis(30);
        /// Pixels of half a tile.
        const PIXELS: f64 = (TILE_SIZE * TILE_SIZE / 2) as f64;
        let seconds = self.clock.seconds(self.rendering.tracer.token.is_paused());
        let threads = self.rendering.tracer.pool.current_num_threads() as f64;
        let rate = (self.units - self.units_before) as f64 / seconds / threads;
        let most = ((rate * STEP.as_secs_f64() / PIXELS) as u32).max(16);
        while !self.is_over_time {
            let done = self.canvas.done.clone();
            if done == goals {
                break;
            }
            self.pass_by(
                None,
                |cell, half| goals[cell][half].min(done[cell][half].saturating_add(most)),
                None,
            )?;
        }
        Ok(())
    }

    fn pass_by(
        &mut self,
        part: Option<Rect>,
        target: impl Fn(usize, usize) -> u32,
        photons: Option<&PhotonMaps>,
    ) -> Result<(), Stop> {
        let jobs = self.canvas.jobs(part, target);
        let tracer = Tracer { photons, ..self.rendering.tracer };
        let film = Arc::clone(&self.canvas.film);
        let keep = |job: &Job, samples: TileSamples| film.add(job.tile, &samples);
        tracer.run(&jobs, keep, |result| {
            if let Some((job, (), cost)) = result {
                self.units += self.canvas.note(job, &cost);
                self.rays += cost.rays;
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
        if let Some(bounds) = (self.rendering.take_preview)() {
            (self.screen.bounds, self.next_preview) = (bounds, now);
        }
        if now >= self.next_preview && self.screen.show_some(self.canvas) {
            self.next_preview = Instant::now() + PREVIEW_INTERVAL.max(now.elapsed() * PREVIEW_SHARE);
        }
        (self.rendering.pulse)(self.canvas, !self.is_first);
        let seconds = self.clock.seconds(self.rendering.tracer.token.is_paused());
        let budget = self.rendering.plan.time_seconds;
        self.is_over_time = !self.is_first && budget.is_some_and(|budget| seconds >= budget);
    }

    fn say_progress(&mut self, is_last: bool) {
        let elapsed_seconds = self.clock.seconds(self.rendering.tracer.token.is_paused());
        let work = self.work(elapsed_seconds);
        let (mut fraction, mut eta_seconds) = self.pace.at(elapsed_seconds, work);
        if let Some(budget) = self.rendering.plan.time_seconds {
            // The first pass is finished whatever the budget is.
            let of_first = eta_seconds.map_or(0.0, |eta| eta * self.share_of_first());
            let left = (budget - elapsed_seconds).max(of_first);
            eta_seconds = Some(eta_seconds.unwrap_or(left).min(left));
            // Time passes even where work stands still.
            fraction = fraction.max(elapsed_seconds / (elapsed_seconds + left)).min(1.0);
        }
        self.fraction = if is_last { 1.0 } else { self.fraction.max(fraction) };
        let pixels = self.canvas.film.crop().area() as u64;
        self.rendering.sink.progress(RenderProgress {
            fraction: self.fraction,
            elapsed_seconds,
            eta_seconds: if is_last { Some(0.0) } else { eta_seconds },
            samples: (self.units / pixels) as u32,
            total_samples: self.total_units.div_ceil(pixels) as u32,
            noise: self.outlook.at(work, self.pace.rate()),
        });
    }

    /// How far all is after some seconds; nobody knows to where before noise was judged, where it decides that.
    fn work(&mut self, elapsed_seconds: f64) -> Work {
        if Instant::now() >= self.foresight.due {
            self.foresee();
        }
        let Foresight { total, passes: [passes, all_passes], .. } = self.foresight;
        let done = self.canvas.seconds();
        let of_pass = self.rendering.photons.map_or(0.0, PhotonStore::seconds_of_pass);
        let of_this = self.sending_since.map_or(0.0, |since| elapsed_seconds - since);
        let to_come = f64::from(all_passes.saturating_sub(passes)) * of_pass - of_this;
        Work {
            done,
            total: total.map(|total| total.max(done)),
            aside: [self.sending_seconds + of_this, to_come.max(0.0)],
        }
    }

    fn foresee(&mut self) {
        let Render { samples: most, error, .. } = self.rendering.plan.settings.render;
        let begin = Instant::now();
        let is_known = !(error > 0.0) || self.canvas.is_foreseen();
        let pixels = self.canvas.film.crop().area();
        let at_once = self.rendering.photons.map_or(u32::MAX, PhotonStore::at_once);
        let jobs = |done, end| jobs_to_come(done, end, pixels, at_once);
        let total = is_known.then(|| self.canvas.seconds() + self.canvas.seconds_to_come(most, jobs));
        let passes = self.rendering.photons.map_or([0; 2], |_| self.canvas.passes(most));
        let due = Instant::now() + FORESIGHT_SHARE * begin.elapsed();
        self.foresight = Foresight { due, total, passes };
    }

    /// Of the work that is left, the part that the first pass is.
    fn share_of_first(&self) -> f64 {
        if !self.is_first {
            return 0.0;
        }
        let pixels = self.canvas.film.crop().area() as u64;
        pixels.saturating_sub(self.units) as f64 / self.total_units.saturating_sub(self.units).max(1) as f64
    }

    fn show(&mut self) {
        let Tracer { pool, token, .. } = self.rendering.tracer;
        self.screen.show(self.canvas, pool, token);
        self.next_preview = Instant::now() + PREVIEW_INTERVAL;
    }

    /// First pictures with one sample, where they are much less work than one pass.
    fn coarse(&mut self) -> Result<(), Stop> {
        let Some(shown) = self.screen.size() else { return Ok(()) };
        let coarse = Coarse::of(self.rendering);
        for size in coarse.sizes(shown) {
            let maps = match self.rendering.photons {
                Some(photons) => Some(self.maps(photons, 0..1)?),
                None => None,
            };
            let picture = coarse.picture(maps.as_ref(), size, || {})?;
            self.canvas.base = Some(picture.resized(shown.0, shown.1));
            self.show();
        }
        Ok(())
    }
}
