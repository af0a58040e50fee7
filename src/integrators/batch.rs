//! Queues of rays, and the rays of the camera.

use std::cell::RefCell;
use std::ops::Range;

use super::RenderSettings;
use super::medium::Medium;
use crate::control::CancelToken;
use crate::film::Rect;
use crate::geometry::Ray;
use crate::lights::{LightSamples, Source};
use crate::math::{DVec2, Vec2, Vec3};
use crate::sampling::{PixelSampler, Purpose, warp};
use crate::world::{Hit, World};

/// The samples of a tile. A slot is the place of a sample among them: all of the first pixel, all of the next.
pub struct SampleBlock {
    /// The pixels.
    pub tile: Rect,
    /// Numbers of the samples of each.
    pub samples: Range<u32>,
}

impl SampleBlock {
    /// Samples in all.
    pub fn len(&self) -> usize {
        self.tile.area() * self.samples.len()
    }

    /// Pixel and sample number of a slot.
    fn place(&self, slot: u32) -> (u32, u32, u32) {
        let samples = self.samples.len() as u32;
        let (pixel, sample) = (slot / samples, slot % samples);
        let (x, y) = (pixel % self.tile.width, pixel / self.tile.width);
        (self.tile.x + x, self.tile.y + y, self.samples.start + sample)
    }

    /// The random numbers of a slot.
    pub fn sampler(&self, seed: u32, slot: u32) -> PixelSampler {
        let (x, y, sample) = self.place(slot);
        PixelSampler::new(seed, x, y, sample)
    }
}

/// A ray on its way.
#[derive(Clone, Copy)]
pub struct PathRay {
    /// The ray; its direction is a unit vector.
    pub ray: Ray,
    /// What radiance that it meets counts in its sample.
    pub throughput: Vec3,
    /// The sample that it belongs to.
    pub slot: u32,
    /// Tells the paths of one sample apart.
    pub path: u32,
    /// The glass that it is in.
    pub medium: Medium,
}

impl PathRay {
    /// Number of the path that goes on from here; `branch` tells the ways to go on apart.
    pub fn next_path(&self, branch: u32) -> u32 {
        (self.path ^ branch).wrapping_mul(0x9e37_79b1).rotate_left(15).wrapping_add(branch)
    }
}

/// Shadow rays that wait to be traced: segments from surfaces to lights, in packets that lie as they are traced.
#[derive(Default)]
pub struct ShadowQueue {
    /// The segments.
    pub rays: Vec<Ray>,
    /// The light that each goes to, which may be hit.
    pub sources: Vec<Source>,
    /// What each brings if nothing is in its way.
    pub arrivals: Vec<Arrival>,
}

/// What a shadow ray brings.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Radiance for the sample.
    pub contribution: Vec3,
    /// The sample.
    pub slot: u32,
}

impl ShadowQueue {
    /// Rays from which on they are traced before more are made, while what they need is in the cache.
    const FULL: usize = 1024;

    /// How many wait.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Whether they are to be traced now.
    pub fn is_full(&self) -> bool {
        self.len() >= Self::FULL
    }

    /// One more.
    pub fn push(&mut self, ray: Ray, source: Source, arrival: Arrival) {
        self.rays.push(ray);
        self.sources.push(source);
        self.arrivals.push(arrival);
    }

    /// Forget all.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.sources.clear();
        self.arrivals.clear();
    }
}

/// The memory of batches, used again by each.
#[derive(Default)]
pub struct Queues {
    /// Rays of this round; camera rays at first.
    pub rays: Vec<PathRay>,
    /// Rays of the next round.
    pub next: Vec<PathRay>,
    /// Shadow rays of this round that are not traced yet.
    pub shadows: ShadowQueue,
    /// Samples of one light for one point.
    pub samples: Vec<LightSamples>,
    /// What the rays of this round hit.
    pub hits: Vec<Option<Hit>>,
}

impl Queues {
    /// What a thread holds between tiles.
    const MOST_SHADOWS: usize = 1 << 18;

    /// Those that this thread left from its last tile; [`Queues::leave`] them for the next.
    pub fn of_thread() -> Self {
        QUEUES.take()
    }

    /// For the next tile of this thread, unless many lights made them very long.
    pub fn leave(self) {
        if self.shadows.rays.capacity() <= Self::MOST_SHADOWS {
            QUEUES.set(self);
        }
    }
}

thread_local! {
    static QUEUES: RefCell<Queues> = RefCell::default();
}

/// What all rays of a tile have in common.
pub struct Tracer<'a> {
    /// The scene.
    pub world: &'a World,
    /// The settings.
    pub settings: &'a RenderSettings,
    /// The samples.
    pub block: &'a SampleBlock,
    /// Says when to stop.
    pub token: &'a CancelToken,
}

impl Tracer<'_> {
    /// Rays through the pixels of some slots, in place of what is in the queue.
    pub fn camera_rays(&self, slots: Range<u32>, queue: &mut Vec<PathRay>) {
        queue.clear();
        queue.extend(slots.map(|slot| self.camera_ray(slot)));
    }

    fn camera_ray(&self, slot: u32) -> PathRay {
        let (x, y, sample) = self.block.place(slot);
        let sampler = PixelSampler::new(self.settings.render.seed, x, y, sample);
        let [fx, fy, lx, ly] = sampler.get4(Purpose::CAMERA);
        let sample = self.settings.render.filter.sample(Vec2::new(fx, fy));
        let place = (sample.offset + Vec2::splat(0.5)).as_dvec2();
        let lens = if self.settings.dof { warp::disk(Vec2::new(lx, ly)) } else { Vec2::ZERO };
        let from_corner = DVec2::new(f64::from(x), f64::from(y)) + place;
        let ray = self.world.camera.ray(self.settings.from_middle(from_corner), lens);
        PathRay { ray, throughput: Vec3::splat(sample.weight), slot, path: 1, medium: Medium::default() }
    }
}
