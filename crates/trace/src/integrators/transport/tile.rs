//! Context shared by all rays of a tile.

use std::array;
use std::ops::Range;

use super::cone::RayCone;
use crate::control::CancelToken;
use crate::film::{PixelSubset, SelectedPixels};
use crate::integrators::RenderSettings;
use crate::integrators::behavior::PathBehavior;
use crate::lights::LightSamplingPurpose;
use crate::lights::infinite::Environment;
use crate::sampling::PixelSampler;
use crate::scene::description::ShadowMode;
use crate::world::{PACKET_SIZE, PixelFootprint, World};

/// Tile context: the world, the settings, and the samples to render.
pub struct TileContext<'a> {
    /// The world to render.
    pub world: &'a World,
    /// The render settings.
    pub settings: &'a RenderSettings,
    /// The samples to render.
    pub block: &'a SampleBlock,
    /// Token that cancels the work.
    pub token: &'a CancelToken,
    /// Ray cones of camera rays, or `None` if ray cones are not needed because there are no mip levels.
    pub camera_cone: Option<RayCone>,
    /// How paths continue at surfaces.
    pub behavior: PathBehavior,
    /// Whether a constant environment is sampled only by BSDF sampling. The continuing ray is then at least
    /// as good as a light sample because directions differ only in occlusion.
    pub paths_find_sky: bool,
    /// Whether rays in glossy lobes account for all environment light reflected by these lobes.
    pub lobes_find_sky: bool,
}

impl<'a> TileContext<'a> {
    /// Creates the context for rendering these samples.
    pub fn new(
        world: &'a World,
        settings: &'a RenderSettings,
        block: &'a SampleBlock,
        token: &'a CancelToken,
        behavior: PathBehavior,
    ) -> Self {
        let camera_cone = world.has_mipmaps().then(|| {
            let PixelFootprint { width, spread } = world.camera.pixel_footprint(settings.render.height);
            RayCone { width, spread }
        });
        let render = &settings.render;
        let is_constant = match world.lights.environment() {
            Some(Environment::Constant(_)) => true,
            Some(Environment::Map { .. } | Environment::Sky { .. }) | None => false,
        };
        let paths_find_sky = is_constant
            && behavior.scatters
            && !behavior.gathers
            && render.shadows == ShadowMode::Soft
            && render.shadow_samples == 1
            && render.clamp == 0.0;
        let lobes_find_sky =
            is_constant && world.lights.sampler_for_purpose(LightSamplingPurpose::Eye).is_none();
        Self { world, settings, block, token, camera_cone, behavior, paths_find_sky, lobes_find_sky }
    }

    /// Sampler for a slot.
    pub fn sampler_for_slot(&self, slot: u32) -> PixelSampler {
        let (x, y, sample) = self.block.pixel_and_sample(slot);
        PixelSampler::new(self.settings.render.seed, x, y, sample)
    }
}

/// The samples in a tile, ordered by pixel. A slot is a sample's index in this order.
pub struct SampleBlock {
    /// The pixels of the tile.
    pub pixels: SelectedPixels,
    /// Range of sample indices for each pixel.
    pub samples: Range<u32>,
    /// Width of the image if it is mirrored. Each pixel then shows the samples of its mirror image.
    pub mirrored_width: Option<u32>,
}

impl SampleBlock {
    /// Number of samples.
    pub fn sample_count(&self) -> usize {
        self.pixels.count() * self.samples.len()
    }

    /// Returns a slot's column, row and sample index, in the image before mirroring.
    pub fn pixel_and_sample(&self, slot: u32) -> (u32, u32, u32) {
        let (x, y, sample) = self.displayed_pixel_and_sample(slot);
        (self.mirrored_width.map_or(x, |width| width - 1 - x), y, sample)
    }

    /// Returns a slot's column, row and sample index, in the image as shown.
    fn displayed_pixel_and_sample(&self, slot: u32) -> (u32, u32, u32) {
        let samples = self.samples.len() as u32;
        let (pixel, sample) = (slot / samples, slot % samples);
        let (x, y) = self.pixels.image_position(pixel);
        (x, y, self.samples.start + sample)
    }

    /// Columns, rows and sample indices of slots in the image before mirroring. Slots without a sample have
    /// arbitrary values.
    #[inline(always)]
    pub fn pixels_and_samples_of_slots(
        &self,
        slots: &[u32; PACKET_SIZE],
    ) -> ([u32; PACKET_SIZE], [u32; PACKET_SIZE], [u32; PACKET_SIZE]) {
        let [mut xs, mut ys, mut samples] = [[0; PACKET_SIZE]; 3];
        let SelectedPixels { rect, part } = self.pixels;
        let (by_samples, by_width) =
            (FastIntDivisor::new(self.samples.len() as u32), FastIntDivisor::new(rect.width));
        // Compute pixel indices within the subset.
        let mut index = [0; PACKET_SIZE];
        for lane in 0..PACKET_SIZE {
            let pixel = by_samples.quotient(slots[lane]);
            index[lane] = pixel;
            let first = pixel.wrapping_mul(self.samples.len() as u32);
            samples[lane] = self.samples.start.wrapping_add(slots[lane].wrapping_sub(first));
        }
        // Map them to indices within the rectangle. This is a separate loop to keep the other loops free of
        // branches.
        if part != PixelSubset::All {
            index = index.map(|pixel| part.nth_pixel_index_in_rect(pixel, rect));
        }
        for lane in 0..PACKET_SIZE {
            let y = by_width.quotient(index[lane]);
            xs[lane] = rect.x.wrapping_add(index[lane].wrapping_sub(y.wrapping_mul(rect.width)));
            ys[lane] = rect.y.wrapping_add(y);
        }
        (self.unmirror_columns(xs), ys, samples)
    }

    /// Converts columns of the image as shown to columns before mirroring.
    #[inline(always)]
    fn unmirror_columns(&self, mut xs: [u32; PACKET_SIZE]) -> [u32; PACKET_SIZE] {
        if let Some(width) = self.mirrored_width {
            for x in &mut xs {
                *x = (width - 1).wrapping_sub(*x);
            }
        }
        xs
    }

    /// Columns, rows and sample indices of the sixteen slots starting at `first` in the image before
    /// mirroring, even if some are past the last slot.
    #[inline(always)]
    pub fn pixels_and_samples_of_consecutive_slots(
        &self,
        first: u32,
    ) -> ([u32; PACKET_SIZE], [u32; PACKET_SIZE], [u32; PACKET_SIZE]) {
        let [mut xs, mut ys, mut samples] = [[0; PACKET_SIZE]; 3];
        let (mut x, mut y, mut sample) = self.displayed_pixel_and_sample(first);
        if self.samples.end - sample >= PACKET_SIZE as u32 {
            for lane in 0..PACKET_SIZE {
                samples[lane] = sample + lane as u32;
            }
            return (self.unmirror_columns([x; PACKET_SIZE]), [y; PACKET_SIZE], samples);
        }
        if self.pixels.part != PixelSubset::All {
            return self.pixels_and_samples_of_slots(&array::from_fn(|lane| first + lane as u32));
        }
        let rect = self.pixels.rect;
        for lane in 0..PACKET_SIZE {
            (xs[lane], ys[lane], samples[lane]) = (x, y, sample);
            sample += 1;
            if sample == self.samples.end {
                (x, sample) = (x + 1, self.samples.start);
                if x == rect.x + rect.width {
                    (x, y) = (rect.x, y + 1);
                }
            }
        }
        (self.unmirror_columns(xs), ys, samples)
    }
}

/// Integer division by a constant, computed in `f64` because there are no vector instructions for integer
/// division.
#[derive(Clone, Copy)]
struct FastIntDivisor {
    inverse: f64,
}

impl FastIntDivisor {
    #[inline(always)]
    fn new(divisor: u32) -> Self {
        Self { inverse: 1.0 / f64::from(divisor) }
    }

    /// ⌊n/d⌋, computed by adding 3·2⁵¹ to (n + ½)/d − ½, which rounds it to an integer. Exact for d ≤ 2¹⁹ and
    /// n < 2³¹, where rounding errors are less than ½/d.
    #[inline(always)]
    fn quotient(self, number: u32) -> u32 {
        const LARGE: f64 = (3_u64 << 51) as f64;
        ((f64::from(number) + 0.5) * self.inverse - 0.5 + LARGE).to_bits() as u32
    }
}
