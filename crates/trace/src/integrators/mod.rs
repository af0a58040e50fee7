//! Integrators: from a world and a tile to radiance. Rays travel in batches: a queue of camera rays, the shadow rays of their hits,
//! the queue of the next bounces.
//!
//! Modules, from below:
//! - `shot`: the common data of all rays of a tile; `queues`: the rays, with their beams (`cone`) and the
//!   glass around them (`medium`).
//! - `trace`: rays to hits; `packet`: packets of rays to hits and rows of plain surfaces.
//! - `vertices`: all data of a hit for shading; `crossing`: surfaces that touch it; `specular`: reflection and refraction.
//! - `lit_row`, `lit_queue`: vertices that wait for direct light; `light`: that light; `picking`, `pool`: that of picked lights;
//!   `beside`: other techniques that find lamps, and MIS weights.
//! - `sink`: accumulates the parts of light that the view shows.
//! - `wave`: the rays round by round, for both methods. Paths are scattered `onward` at diffuse and glossy surfaces; in whitted
//!   they end there.
//! - `views`: views of first hits; `bounds`: the boxes of the trees as lines over the picture.

mod beside;
mod bounds;
mod camera;
mod cone;
mod counters;
mod crossing;
mod light;
mod lit_queue;
mod lit_row;
mod lobe_rays;
mod medium;
mod onward;
mod packet;
mod photons;
mod picking;
mod pool;
mod queues;
mod ray;
mod settings;
mod shot;
mod sink;
mod specular;
mod trace;
mod vertices;
mod view;
mod views;
mod wave;

use std::ops::Range;

use crate::control::{CancelToken, Cancelled};
use crate::film::{NegativeLobes, Pixels, TileSamples};
use crate::math::Vec3;
use crate::world::{PACKET, World};
pub use counters::RayCounters;
pub use photons::{Photon, PhotonMap, PhotonMaps, PhotonPass, Photons};
use queues::Queues;
pub use settings::{PhotonSettings, RenderSettings};
pub use shot::receivers;
use shot::{SampleBlock, Shot};
use sink::Sink;
pub use view::{FirstHit, Measure, Parts, Shown, View};

/// Camera rays that go through the queues together.
const BATCH_SIZE: usize = 1024;

/// Renders samples number `samples` of every pixel of `tile`. The result depends on the arguments alone: any split of a
/// picture into tiles and of its samples into ranges gives the same radiances.
///
/// # Errors
/// [`Cancelled`] if the token is cancelled; it is polled every few hundred rays.
pub fn render_tile(
    world: &World,
    settings: &RenderSettings,
    pixels: impl Into<Pixels>,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    render_tile_by(None, world, settings, pixels, samples, token)
}

/// [`render_tile`] with the photon maps of the samples. Without maps, nothing is gathered.
///
/// # Errors
/// [`Cancelled`].
pub fn render_tile_by(
    photons: Option<&PhotonMaps>,
    world: &World,
    settings: &RenderSettings,
    pixels: impl Into<Pixels>,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    let block = SampleBlock { pixels: pixels.into(), samples };
    let weight = settings.render.filter.negative_weight();
    let mut is_negative = vec![false; if weight.is_some() { block.len() } else { 0 }];
    let mut radiance = vec![Vec3::ZERO; block.len()];
    let mut counters = RayCounters::default();
    let settings = &settings.heeded();
    let photons = photons.filter(|_| settings.gathers());
    let shot = Shot { gathers: photons.is_some(), ..Shot::new(world, settings, &block, token) };
    let clamp = if settings.view.shown().measure() == Measure::Work { 0.0 } else { settings.render.clamp };
    let mut queues = Queues::of_thread();
    for start in (0..block.len()).step_by(BATCH_SIZE) {
        let slots = start as u32..(start + BATCH_SIZE).min(block.len()) as u32;
        counters.camera_rays += slots.len() as u64;
        let negative = |first: u32, bits: u32| mark(&mut is_negative, first, bits);
        match settings.view.shown() {
            Shown::FirstHit(number) => {
                shot.camera_rays(slots, &mut queues.rays, negative);
                views::shade((&shot, photons), number, &mut queues, &mut radiance, &mut counters)?;
            }
            shown @ (Shown::Light(_) | Shown::Film(_) | Shown::Bounds) => {
                let sink = Sink { measure: shown.measure(), radiance: &mut radiance, clamp };
                wave::trace((&shot, photons), slots.clone(), &mut queues, sink, &mut counters, negative)?;
                if shown == Shown::Bounds {
                    shot.camera_rays(slots, &mut queues.rays, |_, _| {});
                    bounds::draw(&shot, &mut queues, &mut radiance)?;
                }
            }
        }
    }
    queues.leave();
    let negative = weight.map(|weight| NegativeLobes { weight, is_negative });
    let samples = block.samples.len() as u32;
    Ok((TileSamples { pixels: block.pixels, samples, radiance, negative }, counters))
}

/// Marks the slots from `first` on whose bits are set.
fn mark(marked: &mut [bool], first: u32, bits: u32) {
    for (lane, marked) in marked.iter_mut().skip(first as usize).take(PACKET).enumerate() {
        *marked = bits & 1 << lane != 0;
    }
}
