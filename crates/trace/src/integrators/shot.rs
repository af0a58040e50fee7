//! What all rays of a tile have in common.

use std::array;
use std::ops::Range;

use super::RenderSettings;
use super::photons::PhotonMaps;
use super::view::Measure;
use crate::control::CancelToken;
use crate::film::{Part, Pixels};
use crate::lights::{Environment, Receivers};
use crate::sampling::PixelSampler;
use crate::scene::description::{Integrator, Shadows};
use crate::world::{PACKET, World};

/// A world, how it is rendered, and the samples that are asked for.
pub struct Shot<'a> {
    /// The scene.
    pub world: &'a World,
    /// The settings.
    pub settings: &'a RenderSettings,
    /// The samples.
    pub block: &'a SampleBlock,
    /// Says when to stop.
    pub token: &'a CancelToken,
    /// By how much the beam of a pixel grows with the distance; 0 where nothing asks for it, which are textures with levels.
    pub pixel_spread: f32,
    /// The photons of the samples, where they are gathered.
    pub photons: Option<&'a PhotonMaps>,
    /// Whether paths find light that is the same from all around without samples of it: the ray that goes on anyway is as good as
    /// one of those, or better, as nothing but what is in its way tells one direction from the other.
    pub leaves_sky: bool,
    /// The same of rays in glossy lobes and the light that these reflect.
    pub lobes_find_sky: bool,
}

impl<'a> Shot<'a> {
    /// Of these samples.
    pub fn new(
        world: &'a World,
        settings: &'a RenderSettings,
        block: &'a SampleBlock,
        token: &'a CancelToken,
    ) -> Self {
        let pixel_spread =
            if world.is_mipmapped() { world.camera.pixel_spread(settings.render.height) } else { 0.0 };
        let render = &settings.render;
        let is_even = match world.lights.environment() {
            Some(Environment::Constant(_)) => true,
            Some(Environment::Map { .. }) | None => false,
        };
        let leaves_sky = is_even
            && render.integrator == Integrator::Path
            && settings.view.shown().measure() != Measure::ArrivingShare
            && render.shadows == Shadows::Soft
            && render.shadow_samples == 1
            && render.clamp == 0.0;
        let lobes_find_sky = is_even && world.lights.selection(Receivers::Eye).is_none();
        Self { world, settings, block, token, pixel_spread, photons: None, leaves_sky, lobes_find_sky }
    }

    /// What the samples of lights at its vertices are for.
    pub fn receivers(&self) -> Receivers {
        receivers(self.settings, self.photons.is_some())
    }

    /// The random numbers of a slot.
    pub fn sampler(&self, slot: u32) -> PixelSampler {
        let (x, y, sample) = self.block.place(slot);
        PixelSampler::new(self.settings.render.seed, x, y, sample)
    }
}

/// What samples of lights are for, where photons are gathered or not: the share of it that arrives is asked of all light.
pub fn receivers(settings: &RenderSettings, are_gathered: bool) -> Receivers {
    let goes_on = are_gathered || settings.render.integrator == Integrator::Path;
    let is_share = settings.view.shown().measure() == Measure::ArrivingShare;
    if goes_on && !is_share { Receivers::Paths } else { Receivers::Eye }
}

/// The samples of a tile. A slot is the place of a sample among them: all of the first pixel, all of the next.
pub struct SampleBlock {
    /// The pixels.
    pub pixels: Pixels,
    /// Numbers of the samples of each.
    pub samples: Range<u32>,
}

impl SampleBlock {
    /// Samples in all.
    pub fn len(&self) -> usize {
        self.pixels.count() * self.samples.len()
    }

    /// Pixel and sample number of a slot.
    pub fn place(&self, slot: u32) -> (u32, u32, u32) {
        let samples = self.samples.len() as u32;
        let (pixel, sample) = (slot / samples, slot % samples);
        let (x, y) = self.pixels.place(pixel);
        (x, y, self.samples.start + sample)
    }

    /// Columns, rows and sample numbers of slots; any where there is none.
    #[inline(always)]
    pub fn places_of(&self, slots: &[u32; PACKET]) -> ([u32; PACKET], [u32; PACKET], [u32; PACKET]) {
        let [mut xs, mut ys, mut samples] = [[0; PACKET]; 3];
        let Pixels { rect, part } = self.pixels;
        let (by_samples, by_width) = (Divisor::new(self.samples.len() as u32), Divisor::new(rect.width));
        for lane in 0..PACKET {
            let pixel = by_samples.quotient(slots[lane]);
            let index = part.index(pixel, rect);
            let y = by_width.quotient(index);
            xs[lane] = rect.x.wrapping_add(index.wrapping_sub(y.wrapping_mul(rect.width)));
            ys[lane] = rect.y.wrapping_add(y);
            let first = pixel.wrapping_mul(self.samples.len() as u32);
            samples[lane] = self.samples.start.wrapping_add(slots[lane].wrapping_sub(first));
        }
        (xs, ys, samples)
    }

    /// Columns, rows and sample numbers of the slots from `first` on, also beyond the last.
    #[inline(always)]
    pub fn places(&self, first: u32) -> ([u32; PACKET], [u32; PACKET], [u32; PACKET]) {
        let [mut xs, mut ys, mut samples] = [[0; PACKET]; 3];
        let (mut x, mut y, mut sample) = self.place(first);
        if self.samples.end - sample >= PACKET as u32 {
            for lane in 0..PACKET {
                samples[lane] = sample + lane as u32;
            }
            return ([x; PACKET], [y; PACKET], samples);
        }
        if self.pixels.part != Part::All {
            return self.places_of(&array::from_fn(|lane| first + lane as u32));
        }
        let rect = self.pixels.rect;
        for lane in 0..PACKET {
            (xs[lane], ys[lane], samples[lane]) = (x, y, sample);
            sample += 1;
            if sample == self.samples.end {
                (x, sample) = (x + 1, self.samples.start);
                if x == rect.x + rect.width {
                    (x, y) = (rect.x, y + 1);
                }
            }
        }
        (xs, ys, samples)
    }
}

/// Division of whole numbers by a constant one, in `f64`, as no vector instruction divides integers.
#[derive(Clone, Copy)]
struct Divisor {
    inverse: f64,
}

impl Divisor {
    #[inline(always)]
    fn new(divisor: u32) -> Self {
        Self { inverse: 1.0 / f64::from(divisor) }
    }

    /// ⌊n/d⌋ as (n + ½)/d − ½, rounded by adding 3·2⁵¹: exact for d ≤ 2¹⁹ and n < 2³¹, where rounding errors are less than ½/d.
    #[inline(always)]
    fn quotient(self, number: u32) -> u32 {
        const LARGE: f64 = (3_u64 << 51) as f64;
        ((f64::from(number) + 0.5) * self.inverse - 0.5 + LARGE).to_bits() as u32
    }
}
