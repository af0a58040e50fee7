//! Previews of the current film at screen size.

use std::time::{Duration, Instant};

use rayon::ThreadPool;

use super::film_state::FilmState;
use crate::control::CancelToken;
use crate::film::range_map::DataBrightnessMap;
use crate::film::tone::{ToneMapping, tone_map_to_8_bits};
use crate::film::{FilmQuantity, Previewer, RadianceImage, Rect};
use crate::keys;
use crate::plan::RenderPlan;
use crate::protocol::{NormalizedPosition, NormalizedRect, PreviewBounds, PreviewedImageState};
use crate::sink::EventSink;

/// Maximum time spent on updating a preview before checking for commands.
const UPDATE_TIME_LIMIT: Duration = Duration::from_millis(4);

/// Sender of previews to the front end.
#[derive(Clone, Copy)]
pub(crate) struct PreviewSender<'a> {
    /// Maximum size of previews. `None` disables previews.
    pub(crate) bounds: Option<PreviewBounds>,
    pub(crate) plan: &'a RenderPlan,
    pub(crate) sink: &'a EventSink,
}

impl PreviewSender<'_> {
    /// Returns the size of a preview of the whole image.
    pub(crate) fn fitted_image_size(&self) -> Option<(u32, u32)> {
        let render = &self.plan.settings.render;
        self.bounds.and_then(|bounds| fit_size(render.width, render.height, bounds))
    }

    /// Sends a preview of the whole film unless canceled. Must not be called while tiles are rendering,
    /// because it uses the thread pool.
    pub(crate) fn send_film_preview(&self, state: &mut FilmState, pool: &ThreadPool, token: &CancelToken) {
        let Some((width, height)) = self.fitted_image_size() else { return };
        let quantity = self.plan.settings.view.displayed_film_quantity();
        if self.send_section_if_requested(state, true) {
            return;
        }
        while !pool.install(|| update_previewer_briefly(state, quantity, width, height)) {
            if token.is_canceled() {
                return;
            }
        }
        self.send_current(state, true);
    }

    /// Spends a short time between tiles on updating the preview, on the current thread. Returns whether it
    /// was completed and sent.
    pub(crate) fn advance_and_send_if_complete(&self, state: &mut FilmState) -> bool {
        let Some((width, height)) = self.fitted_image_size() else { return false };
        if self.send_section_if_requested(state, false) {
            return true;
        }
        let quantity = self.plan.settings.view.displayed_film_quantity();
        update_previewer_briefly(state, quantity, width, height);
        let is_whole = state.previewer.as_ref().is_some_and(Previewer::has_processed_all_tiles);
        if is_whole {
            self.send_current(state, false);
        }
        is_whole
    }

    fn send_current(&self, state: &FilmState, has_time: bool) {
        if let Some(previewer) = &state.previewer {
            // The first image contains no sample statistics.
            let base = state.base.as_ref().filter(|_| previewer.quantity() == FilmQuantity::Radiance);
            let image = previewer.build_radiance_image(base);
            self.send(state, &image, &self.choose_tone_mapping(state, &image, has_time), None);
        }
    }

    /// Sends a 1:1 section of the image if the front end requested one. Returns whether a section was
    /// requested.
    fn send_section_if_requested(&self, state: &FilmState, has_time: bool) -> bool {
        let Some(rect) = self.requested_section() else { return false };
        let quantity = self.plan.settings.view.displayed_film_quantity();
        let base = state.base.as_ref().filter(|_| quantity == FilmQuantity::Radiance);
        let render = &self.plan.settings.render;
        let section = NormalizedRect::from_pixels(rect, render.width, render.height);
        let image = state.film.image_in_rect(quantity, rect, base);
        self.send(state, &image, &self.choose_tone_mapping(state, &image, has_time), Some(section));
        true
    }

    /// Sends a radiance image that lacks light from photons.
    pub(crate) fn send_without_photons(&self, image: &RadianceImage) {
        self.sink.send_preview_without_photons(tone_map_to_8_bits(
            image,
            &self.plan.tone_mapping().with_image_range(image),
        ));
    }

    fn send(
        &self,
        state: &FilmState,
        image: &RadianceImage,
        tone: &ToneMapping,
        section: Option<NormalizedRect>,
    ) {
        let range = tone.range_map.range().map(|range| range.limits());
        let source = PreviewedImageState {
            image: keys::developed_image_key(state.key, self.plan, state.number),
            is_finished: state.is_finished(self.plan),
        };
        self.sink.send_preview(tone_map_to_8_bits(image, tone), range, section, source);
    }

    /// Returns the tone mapping for a preview. Because preview pixels are averages, data views use the value
    /// range of the full image. If some pixels have no samples or a large image must be shown quickly, they
    /// use the preview's range instead.
    fn choose_tone_mapping(&self, state: &FilmState, image: &RadianceImage, has_time: bool) -> ToneMapping {
        /// Number of pixels that can be scanned in a few milliseconds.
        const MAX_SCANNED_PIXELS: usize = 1 << 18;
        let tone = self.plan.tone_mapping();
        let is_known = state.has_sampled_all_pixels()
            && (has_time || state.film.crop_rect().area() <= MAX_SCANNED_PIXELS);
        if tone.range_map == DataBrightnessMap::None || !is_known {
            return tone.with_image_range(image);
        }
        tone.with_image_range(&state.film.image(self.plan.settings.view.displayed_film_quantity()))
    }

    /// Returns the pixels of the 1:1 section, if one was requested.
    fn requested_section(&self) -> Option<Rect> {
        let render = &self.plan.settings.render;
        let PreviewBounds { width, height, around } = self.bounds?;
        let NormalizedPosition { x, y } = around?;
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

/// Spends a short time on updating the previewer. Returns whether it is now up to date.
fn update_previewer_briefly(state: &mut FilmState, quantity: FilmQuantity, width: u32, height: u32) -> bool {
    state.previewer.take_if(|it| it.size() != (width, height) || it.quantity() != quantity);
    let previewer = state.previewer.get_or_insert_with(|| Previewer::for_quantity(quantity, width, height));
    previewer.refresh_changed_tiles(&state.film, Some(Instant::now() + UPDATE_TIME_LIMIT))
}

/// Returns the largest size that fits into the bounds and keeps the aspect ratio.
fn fit_size(width: u32, height: u32, bounds: PreviewBounds) -> Option<(u32, u32)> {
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
    fn preview_keeps_the_aspect_ratio() {
        let bounds = |width, height| PreviewBounds { width, height, around: None };
        assert_eq!(fit_size(640, 480, bounds(80, 48)), Some((64, 48)));
        assert_eq!(fit_size(640, 480, bounds(64, 100)), Some((64, 48)));
        assert_eq!(fit_size(10_000, 1, bounds(80, 48)), Some((80, 1)));
        assert_eq!(fit_size(1, 10_000, bounds(80, 48)), Some((1, 48)));
        assert_eq!(fit_size(1, 1, bounds(0, 48)), None);
    }
}
