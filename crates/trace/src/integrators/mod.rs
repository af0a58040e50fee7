//! Integrators, which render a world's samples for one tile. Rays are processed in batches, as in a wavefront
//! renderer: first a queue of camera rays, then the shadow rays from their hits, then the queue of the next
//! bounce.
//!
//! Each module may only use the modules above it. `tests/suite/architecture` checks the sources against this
//! table.
//!
//! ```text
//! view, counters      AOVs; ray counters
//! layers              quantities recorded along with the beauty image
//! settings            render settings
//! behavior            how paths continue at surfaces, from the integrator, the view and photon mapping
//! transport           rays, hits, vertex packets; depends on the world, not on integrators or photons
//! direct              next-event estimation: light samples, shadow rays, MIS weights
//! photons             photon emission, photon maps, density estimation
//! memory              reused per-thread buffers
//! aov                 first-hit AOVs
//! path                paths from the camera, bounce by bounce, for whitted and path
//! bounds              bounding-box overlay
//! ```

mod aov;
pub mod behavior;
mod bounds;
mod counters;
pub mod direct;
mod layers;
mod memory;
mod path;
mod photons;
mod settings;
pub mod transport;
mod view;

use std::mem::take;
use std::ops::Range;

use crate::control::{CancelToken, Canceled};
use crate::film::{LayerSums, NegativeLobeSamples, SelectedPixels, TileSamples};
use crate::math::Vec3;
use crate::world::{PACKET_SIZE, World};
use behavior::PathBehavior;
pub use behavior::light_sampling_purpose;
pub use counters::RayCounters;
pub use layers::{LayerSet, SampleLayer};
use memory::ThreadMemory;
pub use photons::{Photon, PhotonMap, PhotonPass, PhotonPassTracer, PhotonPassesBySample};
pub use settings::{PhotonSettings, RenderSettings};
use transport::accumulator::{Accumulator, LayerAccumulator};
use transport::tile::{SampleBlock, TileContext};
pub use view::{AovSource, FirstHitQuantity, PathAov, RadianceComponentMask, ViewMode};

/// Number of camera rays in a batch.
const BATCH_SIZE: usize = 1024;

/// Renders the samples with indices `samples` for every pixel in `pixels`. The result depends only on the
/// arguments, so it does not matter how an image is divided into tiles or its samples into ranges.
///
/// # Errors
/// [`Canceled`] if the token is canceled. The token is checked every few hundred rays.
pub fn render_tile(
    world: &World,
    settings: &RenderSettings,
    pixels: impl Into<SelectedPixels>,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    render_tile_with_photons(None, world, settings, pixels, samples, token)
}

/// Like [`render_tile`], but also gathers photons if the samples have photon maps.
///
/// # Errors
/// [`Canceled`] if the token is canceled.
pub fn render_tile_with_photons(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: impl Into<SelectedPixels>,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    let pixels = pixels.into();
    let layers = LayerSums::zero(settings.layers.len(), pixels.count());
    render_tile_with_layers(photons, world, settings, (pixels, samples), layers, token)
}

/// Like [`render_tile_with_photons`], but adds the values of the layers to the sums `layers` of the pixels.
///
/// # Errors
/// [`Canceled`] if the token is canceled.
pub fn render_tile_with_layers(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    (pixels, samples): (SelectedPixels, Range<u32>),
    mut layers: LayerSums,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    // Allocate the samples.
    let mirrored_width = world.camera.is_mirrored().then_some(settings.render.width);
    let block = SampleBlock { pixels, samples, mirrored_width };
    let weight = settings.render.filter.negative_weight();
    let mut is_negative = vec![false; if weight.is_some() { block.sample_count() } else { 0 }];
    let mut radiance = vec![Vec3::ZERO; block.sample_count()];
    let mut counters = RayCounters::default();
    // Prepare the context shared by all rays.
    let settings = &settings.without_ineffective_settings();
    let photons = photons.filter(|_| settings.gathers_photons());
    let behavior = PathBehavior::from_settings(settings, photons.is_some());
    let tile = TileContext::new(world, settings, &block, token, behavior);
    let clamp = if settings.view.aov_source().light_transport_aov_or_all() == PathAov::TraversalCost {
        0.0
    } else {
        settings.render.clamp
    };
    let gain = match settings.view.aov_source().light_transport_aov_or_all() {
        PathAov::Radiance(_) => settings.render.gain,
        PathAov::LitFraction | PathAov::TraversalCost => 1.0,
    };
    // Render one batch after another.
    let mut memory = ThreadMemory::take_from_thread();
    let (mut fractions, mut values) = (take(&mut memory.fractions), take(&mut memory.layers));
    values.clear_cached_albedos();
    for start in (0..block.sample_count()).step_by(BATCH_SIZE) {
        let slots = start as u32..(start + BATCH_SIZE).min(block.sample_count()) as u32;
        counters.camera_rays += slots.len() as u64;
        let negative = |first: u32, bits: u32| unpack_mask_bits(&mut is_negative, first, bits);
        match settings.view.aov_source() {
            AovSource::FirstHit(number) => {
                tile.replace_queue_with_camera_rays(slots, &mut memory.scratch.rays, negative);
                aov::shade_first_hit_aov(
                    (&tile, photons),
                    number,
                    &mut memory.scratch,
                    &mut radiance,
                    &mut counters,
                )?;
            }
            shown @ (AovSource::Light(_) | AovSource::Film(_) | AovSource::Bounds) => {
                values.begin_batch(settings.layers, &slots);
                let recorded = (!settings.layers.is_empty()).then(|| LayerAccumulator {
                    values: &mut values,
                    fractions: settings.layers.has_light().then_some(&mut fractions),
                });
                let accumulator = Accumulator {
                    aov: shown.light_transport_aov_or_all(),
                    radiance: &mut radiance,
                    clamp,
                    layers: recorded,
                };
                path::trace_camera_paths(
                    (&tile, photons),
                    slots.clone(),
                    &mut memory,
                    accumulator,
                    &mut counters,
                    negative,
                )?;
                if gain != 1.0 {
                    radiance[start..slots.end as usize].iter_mut().for_each(|radiance| *radiance *= gain);
                    values.scale_light(gain);
                }
                if shown == AovSource::Bounds {
                    tile.replace_queue_with_camera_rays(slots, &mut memory.scratch.rays, |_, _| {});
                    bounds::draw_box_edges(&tile, &mut memory.scratch, &mut radiance)?;
                }
                let is_negative = weight.map(|_| is_negative.as_slice());
                let instructions = world.geometry.instruction_set();
                values.add_to_sums(&mut layers, block.samples.len(), (&radiance, is_negative), instructions);
            }
        }
    }
    // Return the samples.
    (memory.fractions, memory.layers) = (fractions, values);
    memory.return_to_thread();
    let negative = weight.map(|weight| NegativeLobeSamples { weight, is_negative });
    let samples = block.samples.len() as u32;
    Ok((TileSamples { pixels: block.pixels, samples, radiance, negative, layers }, counters))
}

/// Copies the bits of a mask to `marked`, starting at slot `first`.
fn unpack_mask_bits(marked: &mut [bool], first: u32, bits: u32) {
    for (lane, marked) in marked.iter_mut().skip(first as usize).take(PACKET_SIZE).enumerate() {
        *marked = bits & 1 << lane != 0;
    }
}
