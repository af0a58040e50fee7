//! From a world and a tile to radiance. Rays travel in batches: a queue of camera rays, the shadow rays of their hits,
//! the queue of the next bounces.

mod batch;
mod direct;
mod glass;
mod medium;
mod views;
mod whitted;

use std::ops::Range;

use batch::{Queues, SampleBlock, Tracer};

use crate::control::{CancelToken, Cancelled};
use crate::film::{Rect, TileSamples};
use crate::math::{DVec2, Vec3};
use crate::scene::description::{PixelFilter, Shadows};
use crate::world::World;

/// Camera rays that go through the queues together.
const BATCH_SIZE: usize = 1024;

/// Rays between two looks at the token.
const POLL_INTERVAL: usize = 256;

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum View {
    /// The picture.
    #[default]
    Beauty,
    /// Shading normals, (n + 1)/2.
    Normal,
    /// Distance along the view axis; near is bright.
    Depth,
    /// Barycentric coordinates: a red, b green, c blue.
    Barycentric,
    /// Texture coordinates.
    Uv,
    /// Diffuse reflectance.
    Albedo,
    /// Ambient part of Phong.
    Ambient,
    /// Diffuse part of Phong.
    Diffuse,
    /// Specular part of Phong.
    Specular,
    /// Fraction of the lights' radiance that arrives.
    Shadow,
}

impl View {
    /// All of them, in the order of the key.
    pub const ALL: [Self; 10] = [
        Self::Beauty,
        Self::Normal,
        Self::Depth,
        Self::Barycentric,
        Self::Uv,
        Self::Albedo,
        Self::Ambient,
        Self::Diffuse,
        Self::Specular,
        Self::Shadow,
    ];

    /// Whether it shows numbers about the first hit, which no exposure or tone curve applies to.
    pub fn is_data(self) -> bool {
        matches!(self, Self::Normal | Self::Depth | Self::Barycentric | Self::Uv | Self::Albedo)
    }

    /// Its name on the command line and the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Beauty => "beauty",
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::Barycentric => "barycentric",
            Self::Uv => "uv",
            Self::Albedo => "albedo",
            Self::Ambient => "ambient",
            Self::Diffuse => "diffuse",
            Self::Specular => "specular",
            Self::Shadow => "shadow",
        }
    }
}

/// How a world is rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Pixels across the whole picture.
    pub width: u32,
    /// Pixels down the whole picture.
    pub height: u32,
    /// Scatterings along one path.
    pub max_depth: u32,
    /// Shadows.
    pub shadows: Shadows,
    /// Shadow rays to each light, ≥ 1.
    pub shadow_samples: u32,
    /// Reconstruction filter.
    pub filter: PixelFilter,
    /// Whether the lens has its aperture; false: a pinhole.
    pub dof: bool,
    /// Seed.
    pub seed: u32,
    /// What is shown.
    pub view: View,
}

impl RenderSettings {
    /// A place in the picture, in pixels from its top left corner, as the camera takes it: from its middle to the right
    /// and up, in halves of its height.
    pub fn from_middle(&self, from_corner: DVec2) -> DVec2 {
        let (half_width, half_height) = (0.5 * f64::from(self.width), 0.5 * f64::from(self.height));
        DVec2::new(from_corner.x - half_width, half_height - from_corner.y) / half_height
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
        if settings.view.is_data() {
            views::shade(&tracer, &mut queues, &mut radiance, &mut counters)?;
        } else {
            whitted::trace(&tracer, &mut queues, &mut radiance, &mut arrived, &mut counters)?;
        }
    }
    queues.leave();
    radiance.iter_mut().zip(arrived).for_each(|(radiance, arrived)| *radiance += arrived);
    Ok((TileSamples { rect: block.tile, samples: block.samples.len() as u32, radiance }, counters))
}
