//! The film as it is, at the size of a screen, into the slot.

use std::time::{Duration, Instant};

use rayon::ThreadPool;

use super::film_state::FilmState;
use crate::control::CancelToken;
use crate::film::range_map::RangeMap;
use crate::film::tone::{ToneMapping, develop};
use crate::film::{Previewer, Quantity, RadianceImage, Rect};
use crate::keys;
use crate::plan::Plan;
use crate::protocol::{PreviewSize, PreviewSource, Section, Spot};
use crate::sink::Sink;

/// The longest that a film is taken up without a look at the orders.
const PATIENCE: Duration = Duration::from_millis(4);

/// The screen's preview: what it shows, and where it goes.
#[derive(Clone, Copy)]
pub(crate) struct Screen<'a> {
    /// None: nothing is shown.
    pub(crate) bounds: Option<PreviewSize>,
    pub(crate) plan: &'a Plan,
    pub(crate) sink: &'a Sink,
}

impl Screen<'_> {
    /// Columns and rows of pictures of the whole.
    pub(crate) fn size(&self) -> Option<(u32, u32)> {
        let render = &self.plan.settings.render;
        self.bounds.and_then(|bounds| fit(render.width, render.height, bounds))
    }

    /// The whole film, unless that is cancelled. For when no tile is being rendered, as the pool helps.
    pub(crate) fn show(&self, canvas: &mut FilmState, pool: &ThreadPool, token: &CancelToken) {
        let Some(size) = self.size() else { return };
        if self.say_section(canvas, true) {
            return;
        }
        while !pool.install(|| catch_up(canvas, self.plan.settings.view.quantity(), size)) {
            if token.is_cancelled() {
                return;
            }
        }
        self.say(canvas, true);
    }

    /// The same between two tiles, on this thread and for a short time; what is left is for the next call. Whether a
    /// picture came of it.
    pub(crate) fn show_some(&self, canvas: &mut FilmState) -> bool {
        let Some(size) = self.size() else { return false };
        if self.say_section(canvas, false) {
            return true;
        }
        catch_up(canvas, self.plan.settings.view.quantity(), size);
        let is_whole = canvas.previewer.as_ref().is_some_and(Previewer::is_whole);
        if is_whole {
            self.say(canvas, false);
        }
        is_whole
    }

    fn say(&self, canvas: &FilmState, has_time: bool) {
        if let Some(previewer) = &canvas.previewer {
            // The first coarse picture has none of the numbers about samples.
            let base = canvas.base.as_ref().filter(|_| previewer.quantity() == Quantity::Radiance);
            let image = previewer.picture(base);
            self.send(canvas, &image, &self.tone(canvas, &image, has_time), None);
        }
    }

    /// Shows the image's own pixels, if the front end wants them.
    fn say_section(&self, canvas: &FilmState, has_time: bool) -> bool {
        let Some(rect) = self.section() else { return false };
        let quantity = self.plan.settings.view.quantity();
        let base = canvas.base.as_ref().filter(|_| quantity == Quantity::Radiance);
        let render = &self.plan.settings.render;
        let section = Section::of(rect, (render.width, render.height));
        let image = canvas.film.section(quantity, rect, base);
        self.send(canvas, &image, &self.tone(canvas, &image, has_time), Some(section));
        true
    }

    /// Shows a picture that lacks the light of photons, which are yet to come. It is of colours: no view of numbers gathers
    /// them.
    pub(crate) fn show_without_photons(&self, image: &RadianceImage) {
        self.sink.preview_without_photons(develop(image, &self.plan.tone.resolved_for(image)));
    }

    fn send(&self, canvas: &FilmState, image: &RadianceImage, tone: &ToneMapping, section: Option<Section>) {
        let range = tone.range_map.range().map(|range| range.limits());
        let source = PreviewSource {
            image: keys::image(canvas.key, self.plan, canvas.number),
            is_finished: canvas.is_finished(self.plan),
        };
        self.sink.preview(develop(image, tone), range, section, source);
    }

    /// Tone mapping of a preview. Numbers are stretched by the range of the image that is written, since pixels of a preview
    /// average over gaps. An image with pixels without samples, or a large one while there is no time, is stretched by the range
    /// of the preview.
    fn tone(&self, canvas: &FilmState, image: &RadianceImage, has_time: bool) -> ToneMapping {
        /// Pixels that are looked through in a few milliseconds.
        const QUICK: usize = 1 << 18;
        let tone = self.plan.tone;
        let is_known = canvas.is_covered() && (has_time || canvas.film.crop().area() <= QUICK);
        if tone.range_map == RangeMap::None || !is_known {
            return tone.resolved_for(image);
        }
        tone.resolved_for(&canvas.film.image(self.plan.settings.view.quantity()))
    }

    /// The pixels that are shown one by one.
    fn section(&self) -> Option<Rect> {
        let render = &self.plan.settings.render;
        let PreviewSize { width, height, around } = self.bounds?;
        let Spot { x, y } = around?;
        let along = |middle: f64, length: u32, side: u32| {
            let length = length.min(side);
            let start = (middle * f64::from(side)).max(0.0) as u32;
            (start.saturating_sub(length / 2).min(side - length), length)
        };
        let (x, width) = along(x, width, render.width);
        let (y, height) = along(y, height, render.height);
        Some(Rect { x, y, width, height })
    }
}

/// Take up what changed, for a short time; whether that was all.
fn catch_up(canvas: &mut FilmState, quantity: Quantity, (width, height): (u32, u32)) -> bool {
    canvas.previewer.take_if(|it| it.size() != (width, height) || it.quantity() != quantity);
    let previewer = canvas.previewer.get_or_insert_with(|| Previewer::of(quantity, width, height));
    previewer.update(&canvas.film, Some(Instant::now() + PATIENCE))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preview_keeps_the_aspect_ratio_inside_its_bounds() {
        let bounds = |width, height| PreviewSize { width, height, around: None };
        assert_eq!(fit(640, 480, bounds(80, 48)), Some((64, 48)));
        assert_eq!(fit(640, 480, bounds(64, 100)), Some((64, 48)));
        assert_eq!(fit(10_000, 1, bounds(80, 48)), Some((80, 1)));
        assert_eq!(fit(1, 10_000, bounds(80, 48)), Some((1, 48)));
        assert_eq!(fit(1, 1, bounds(0, 48)), None);
    }
}
