//! Integrators: from a world and a tile to radiance. Rays travel in batches: a queue of camera rays, the shadow rays of their hits,
//! the queue of the next bounces.
//!
//! Each line may use those above it, and no others: `tests/suite/house` compares the sources with this table.
//!
//! ```text
//! view, counters      contents of a picture; counters of rays
//! settings            settings of a render
//! method              behaviour of its rays: the scene's table of methods, as the view and photons let it apply
//! transport           rays of a tile, their hits, vertices in rows; knows the world, neither integrators nor photons
//! direct              light samples, shadow rays, MIS weights
//! photons             emission, photon maps, gathering
//! memory              memory of a thread's batches
//! eye                 the rays of the camera, round by round, in whitted and path
//! aov, bounds         views of first hits; boxes of the trees as lines over the picture
//! ```

mod aov;
mod bounds;
mod counters;
mod direct;
mod eye;
mod memory;
mod method;
mod photons;
mod settings;
mod transport;
mod view;

use std::ops::Range;

use crate::control::{CancelToken, Cancelled};
use crate::film::{NegativeLobes, Pixels, TileSamples};
use crate::math::Vec3;
use crate::world::{PACKET, World};
pub use counters::RayCounters;
use memory::Memory;
use method::Behaviour;
pub use method::receivers;
pub use photons::{Photon, PhotonMap, PhotonMaps, PhotonPass, Photons};
pub use settings::{PhotonSettings, RenderSettings};
use transport::accumulator::Accumulator;
use transport::tile::{SampleBlock, TileContext};
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
    // Prepare the samples and their sums.
    let block = SampleBlock { pixels: pixels.into(), samples };
    let weight = settings.render.filter.negative_weight();
    let mut is_negative = vec![false; if weight.is_some() { block.len() } else { 0 }];
    let mut radiance = vec![Vec3::ZERO; block.len()];
    let mut counters = RayCounters::default();
    // Prepare what all rays have in common.
    let settings = &settings.effective();
    let photons = photons.filter(|_| settings.gathers());
    let behaviour = Behaviour::of(settings, photons.is_some());
    let tile = TileContext::new(world, settings, &block, token, behaviour);
    let clamp = if settings.view.shown().measure() == Measure::Work { 0.0 } else { settings.render.clamp };
    // Render batch by batch.
    let mut memory = Memory::of_thread();
    for start in (0..block.len()).step_by(BATCH_SIZE) {
        let slots = start as u32..(start + BATCH_SIZE).min(block.len()) as u32;
        counters.camera_rays += slots.len() as u64;
        let negative = |first: u32, bits: u32| mark(&mut is_negative, first, bits);
        match settings.view.shown() {
            Shown::FirstHit(number) => {
                tile.camera_rays(slots, &mut memory.scratch.rays, negative);
                aov::shade((&tile, photons), number, &mut memory.scratch, &mut radiance, &mut counters)?;
            }
            shown @ (Shown::Light(_) | Shown::Film(_) | Shown::Bounds) => {
                let accumulator = Accumulator { measure: shown.measure(), radiance: &mut radiance, clamp };
                eye::trace(
                    (&tile, photons),
                    slots.clone(),
                    &mut memory,
                    accumulator,
                    &mut counters,
                    negative,
                )?;
                if shown == Shown::Bounds {
                    tile.camera_rays(slots, &mut memory.scratch.rays, |_, _| {});
                    bounds::draw(&tile, &mut memory.scratch, &mut radiance)?;
                }
            }
        }
    }
    // Hand the samples over.
    memory.leave();
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
