//! From a world and a tile to radiance. Rays travel in batches: a queue of camera rays, the shadow rays of their hits,
//! the queue of the next bounces.

mod batch;
mod direct;
mod glass;
mod medium;
mod view;
mod views;
mod whitted;

use std::ops::Range;

use batch::{Queues, SampleBlock, Tracer};
pub use view::{FirstHit, Shown, View};

use crate::control::{CancelToken, Cancelled};
use crate::film::{Rect, TileSamples};
use crate::math::{DVec2, Vec3};
use crate::scene::description::Render;
use crate::scene::fingerprint::{Fingerprint, Fingerprinted, Referents};
use crate::world::World;

/// Camera rays that go through the queues together.
const BATCH_SIZE: usize = 1024;

/// Rays between two looks at the token.
const POLL_INTERVAL: usize = 256;

/// How a world is rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// The scene's, with what this run changes of them.
    pub render: Render,
    /// Whether the lens has its aperture; false: a pinhole.
    pub dof: bool,
    /// What is shown.
    pub view: View,
}

impl RenderSettings {
    /// A place in the picture, in pixels from its top left corner, as the camera takes it: from its middle to the right
    /// and up, in halves of its height.
    pub fn from_middle(&self, from_corner: DVec2) -> DVec2 {
        let Render { width, height, .. } = self.render;
        let (half_width, half_height) = (0.5 * f64::from(width), 0.5 * f64::from(height));
        DVec2::new(from_corner.x - half_width, half_height - from_corner.y) / half_height
    }
}

impl Fingerprinted for RenderSettings {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        let Self { render, dof, view } = *self;
        key.add(&render, of).flag(dof).choice(view);
    }
}

/// Rays and look-ups of one tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounters {
    /// Rays from the camera.
    pub camera_rays: u64,
    /// Rays towards lights.
    pub shadow_rays: u64,
    /// Mirrored rays.
    pub reflected_rays: u64,
    /// Refracted rays.
    pub refracted_rays: u64,
    /// Texture look-ups.
    pub texture_lookups: u64,
}

impl std::ops::AddAssign for RayCounters {
    fn add_assign(&mut self, other: Self) {
        self.camera_rays += other.camera_rays;
        self.shadow_rays += other.shadow_rays;
        self.reflected_rays += other.reflected_rays;
        self.refracted_rays += other.refracted_rays;
        self.texture_lookups += other.texture_lookups;
    }
}

/// Samples number `samples` of every pixel of `tile`. A function of its arguments alone: any split of a picture
/// into tiles and of its samples into ranges gives the same radiances.
///
/// # Errors
/// [`Cancelled`] when the token says so; it is polled every few hundred rays.
pub fn render_tile(
    world: &World,
    settings: &RenderSettings,
    tile: Rect,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Cancelled> {
    let block = SampleBlock { tile, samples };
    let (mut radiance, mut arrived) = (vec![Vec3::ZERO; block.len()], vec![Vec3::ZERO; block.len()]);
    let mut counters = RayCounters::default();
    let tracer = Tracer { world, settings, block: &block, token };
    let mut queues = Queues::of_thread();
    for start in (0..block.len()).step_by(BATCH_SIZE) {
        let slots = start as u32..(start + BATCH_SIZE).min(block.len()) as u32;
        tracer.camera_rays(slots, &mut queues.rays);
        counters.camera_rays += queues.rays.len() as u64;
        match settings.view.shown() {
            Shown::FirstHit(number) => {
                views::shade(&tracer, number, &mut queues, &mut radiance, &mut counters)?;
            }
            Shown::Light | Shown::ArrivingShare => {
                whitted::trace(&tracer, &mut queues, &mut radiance, &mut arrived, &mut counters)?;
            }
        }
    }
    queues.leave();
    radiance.iter_mut().zip(arrived).for_each(|(radiance, arrived)| *radiance += arrived);
    Ok((TileSamples { rect: block.tile, samples: block.samples.len() as u32, radiance }, counters))
}
