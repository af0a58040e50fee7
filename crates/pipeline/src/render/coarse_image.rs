//! First images, with one sample per preview pixel, which are shown until the first pass is done.

use std::cell::Cell;
use std::time::{Duration, Instant};

use super::preview::PreviewSender;
use crate::film::range_map::DataBrightnessMap;
use crate::film::{RadianceImage, Rect};
use crate::integrators::{LayerSet, PhotonPassesBySample, RenderSettings};
use crate::plan::RenderPlan;
use crate::scene::description::RenderOptions;
use crate::stages::AbortReason;
use crate::trace::{TileJob, Tracer};

/// Time budget for the first image while the camera is moving.
const MOVING_TIME_BUDGET: Duration = Duration::from_millis(6);

/// Renderer for coarse first images.
#[derive(Clone, Copy)]
pub(crate) struct CoarseImageRenderer<'a> {
    pub(crate) tracer: Tracer<'a>,
    pub(crate) plan: &'a RenderPlan,
    /// Whether the camera is being moved.
    pub(crate) is_moved: bool,
    /// Speed at which the most recent first image was rendered, in pixels per second.
    pub(crate) rate: &'a Cell<Option<f64>>,
}

impl<'a> CoarseImageRenderer<'a> {
    /// Returns the sizes of the first images: about the preview's size, preceded by a smaller size if the
    /// camera is being moved. Excludes sizes that would take almost as long as a full pass.
    pub(crate) fn sizes(&self, shown_width: u32, shown_height: u32) -> Vec<(u32, u32)> {
        let (width, height) = self.size_reduced_for_large_scene(shown_width, shown_height);
        let rate = self.rate.get().filter(|_| self.is_moved);
        let hasty = rate.and_then(|rate| size_for_time_budget(width, height, rate));
        let sizes = hasty.into_iter().chain([(width, height)]);
        sizes.filter(|(width, height)| self.is_less_work(*width, *height)).collect()
    }

    /// Returns the preview's size, or a size with half as many pixels if the trees do not fit in the CPU
    /// caches, because tracing rays is then slow.
    fn size_reduced_for_large_scene(&self, width: u32, height: u32) -> (u32, u32) {
        /// Trees with this many triangles take up tens of megabytes.
        const MIN_LARGE_TRIANGLES: u64 = 250_000;
        let side =
            |length: u32| ((f64::from(length) * std::f64::consts::FRAC_1_SQRT_2).round() as u32).max(1);
        if self.tracer.world.triangle_count() < MIN_LARGE_TRIANGLES {
            (width, height)
        } else {
            (side(width), side(height))
        }
    }

    fn is_less_work(&self, width: u32, height: u32) -> bool {
        let RenderOptions { width: full_width, height: full_height, .. } = self.plan.settings.render;
        let pixels = |width: u32, height: u32| u64::from(width) * u64::from(height);
        pixels(width, height) * 2 <= pixels(full_width, full_height)
    }

    /// Traces a first image and records how many pixels per second were rendered. Calls `tick` regularly.
    pub(crate) fn trace_coarse_image(
        &self,
        photons: Option<&PhotonPassesBySample>,
        width: u32,
        height: u32,
        tick: impl Fn(),
    ) -> Result<RadianceImage, AbortReason> {
        let plan = self.plan;
        let full = (plan.settings.render.width, plan.settings.render.height);
        let render = RenderOptions { width, height, ..plan.settings.render };
        let settings = RenderSettings { render, layers: LayerSet::NONE, ..plan.settings };
        let whole = Rect { x: 0, y: 0, width, height };
        let rect = plan.crop.map_or(whole, |rect| scale_rect(rect, full, (width, height)));
        let tracer = Tracer { settings: &settings, photons, ..self.tracer };
        let mut picture = RadianceImage::black(width, height);
        let begin = Instant::now();
        tracer.run_all_jobs_in_parallel(
            &split_into_jobs(rect),
            |_, piece| piece,
            |result| {
                if let Some((_, piece, _)) = result {
                    picture.set_rect(piece.pixels.rect, &piece.radiance);
                }
                tick();
                true
            },
        )?;
        let rate = rect.area() as f64 / begin.elapsed().as_secs_f64().max(1e-6);
        self.rate.set(Some(rate));
        Ok(picture)
    }

    /// Shows a first image before photons are traced. Does nothing if the preview shows a section or if this
    /// would take almost as long as a full pass. Does not change the film. Calls `tick` regularly.
    ///
    /// # Errors
    /// Returns [`AbortReason::Canceled`] if the token is canceled.
    pub(crate) fn show_without_photons(
        &self,
        screen: PreviewSender<'_>,
        tick: impl Fn(),
    ) -> Result<(), AbortReason> {
        let is_whole = screen.bounds.is_some_and(|bounds| bounds.around.is_none());
        // Skip data views, because they depend on the value range of the whole image or show the photons
        // themselves.
        let is_of_light = self.plan.tone_mapping().range_map == DataBrightnessMap::None;
        let Some((shown_width, shown_height)) =
            screen.fitted_image_size().filter(|_| is_whole && is_of_light)
        else {
            return Ok(());
        };
        let Some((width, height)) = self.sizes(shown_width, shown_height).into_iter().next() else {
            return Ok(());
        };
        let picture = self.trace_coarse_image(None, width, height, tick)?;
        screen.send_without_photons(&picture.resized(shown_width, shown_height));
        Ok(())
    }
}

/// Returns an image size that takes [`MOVING_TIME_BUDGET`] to render at `rate` pixels per second, or `None`
/// if rendering at the usual size is about as fast.
fn size_for_time_budget(width: u32, height: u32, rate: f64) -> Option<(u32, u32)> {
    /// Minimum width in pixels.
    const MIN_WIDTH: f64 = 16.0;
    let share = (rate * MOVING_TIME_BUDGET.as_secs_f64() / (f64::from(width) * f64::from(height))).sqrt();
    let side =
        |length: u32| ((f64::from(length) * share.max(MIN_WIDTH / f64::from(width))).round() as u32).max(1);
    (share < 0.8).then(|| (side(width).min(width), side(height).min(height)))
}

/// Splits a rectangle into small jobs so that all threads finish at about the same time.
fn split_into_jobs(rect: Rect) -> Vec<TileJob> {
    const FEW: usize = 5000;
    let side = if rect.area() < FEW { 8 } else { 16 };
    let starts = |start: u32, length: u32| (start..start + length).step_by(side as usize);
    let piece = |(x, y)| Rect { x, y, width: side, height: side }.intersection(&rect);
    let places = starts(rect.y, rect.height).flat_map(|y| starts(rect.x, rect.width).map(move |x| (x, y)));
    let job = |(tile, rect): (usize, Rect)| TileJob { tile, pixels: rect.into(), samples: 0..1 };
    places.filter_map(piece).enumerate().map(job).collect()
}

/// Maps a rectangle in a larger image to the corresponding pixels of a smaller image.
fn scale_rect(rect: Rect, from: (u32, u32), to: (u32, u32)) -> Rect {
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
    fn jobs_cover_each_pixel_once() {
        let rect = Rect { x: 3, y: 5, width: 40, height: 17 };
        let mut seen = vec![0; 64 * 64];
        for job in split_into_jobs(rect) {
            for y in job.pixels.rect.y..job.pixels.rect.y + job.pixels.rect.height {
                for x in job.pixels.rect.x..job.pixels.rect.x + job.pixels.rect.width {
                    seen[(y * 64 + x) as usize] += 1;
                }
            }
        }
        let one = Rect { width: 1, height: 1, ..rect };
        for (i, times) in (0..64 * 64).zip(seen) {
            let is_inside = Rect { x: i % 64, y: i / 64, ..one }.intersection(&rect).is_some();
            assert_eq!(times, i32::from(is_inside), "pixel {i}");
        }
    }

    #[test]
    fn first_image_fits_its_time_budget() {
        let pixels_of = |rate: f64| size_for_time_budget(120, 80, rate / MOVING_TIME_BUDGET.as_secs_f64());
        assert_eq!(pixels_of(9600.0), None, "the usual size should be fast enough");
        assert_eq!(pixels_of(2400.0), Some((60, 40)));
        assert_eq!(pixels_of(1.0), Some((16, 11)), "the size should not fall below the minimum");
        assert_eq!(size_for_time_budget(10, 5, 0.0), Some((10, 5)));
    }

    #[test]
    fn crop_is_scaled_to_smaller_images() {
        let rect = Rect { x: 10, y: 30, width: 5, height: 10 };
        assert_eq!(scale_rect(rect, (100, 100), (10, 10)), Rect { x: 1, y: 3, width: 1, height: 1 });
        let last = Rect { x: 99, y: 99, width: 1, height: 1 };
        assert_eq!(scale_rect(last, (100, 100), (3, 3)), Rect { x: 2, y: 2, width: 1, height: 1 });
    }
}
