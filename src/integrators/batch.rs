//! Queues of rays, and the rays of the camera.

use std::ops::Range;

use super::RenderSettings;
use super::medium::Medium;
use crate::control::CancelToken;
use crate::film::Rect;
use crate::geometry::Ray;
use crate::lights::Source;
use crate::math::{DVec2, Vec2, Vec3};
use crate::sampling::filter::Filter;
use crate::sampling::{PixelSampler, Purpose, warp};
use crate::scene::description::PixelFilter;
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

/// Rays on their way, an array for each of their parts.
#[derive(Default)]
pub struct RayQueue {
    /// The rays; directions are unit vectors.
    pub ray: Vec<Ray>,
    /// What radiance that they meet counts in their sample.
    pub throughput: Vec<Vec3>,
    /// The sample that they belong to.
    pub slot: Vec<u32>,
    /// Tells the paths of one sample apart.
    pub path: Vec<u32>,
    /// The glass that they are in.
    pub medium: Vec<Medium>,
}

/// A ray for the queue.
#[derive(Clone, Copy)]
pub struct PathRay {
    /// The ray.
    pub ray: Ray,
    /// See [`RayQueue::throughput`].
    pub throughput: Vec3,
    /// See [`RayQueue::slot`].
    pub slot: u32,
    /// See [`RayQueue::path`].
    pub path: u32,
    /// See [`RayQueue::medium`].
    pub medium: Medium,
}

impl PathRay {
    /// Number of the path that goes on from here; `branch` tells the ways to go on apart.
    pub fn next_path(&self, branch: u32) -> u32 {
        (self.path ^ branch).wrapping_mul(0x9e37_79b1).rotate_left(15).wrapping_add(branch)
    }
}

impl RayQueue {
    /// Rays in it.
    pub fn len(&self) -> usize {
        self.ray.len()
    }

    /// Put a ray at its end.
    pub fn push(&mut self, ray: PathRay) {
        self.ray.push(ray.ray);
        self.throughput.push(ray.throughput);
        self.slot.push(ray.slot);
        self.path.push(ray.path);
        self.medium.push(ray.medium);
    }

    /// Forget all rays, keep the memory.
    pub fn clear(&mut self) {
        self.ray.clear();
        self.throughput.clear();
        self.slot.clear();
        self.path.clear();
        self.medium.clear();
    }

    /// The ray at a place.
    pub fn get(&self, i: usize) -> PathRay {
        PathRay {
            ray: self.ray[i],
            throughput: self.throughput[i],
            slot: self.slot[i],
            path: self.path[i],
            medium: self.medium[i],
        }
    }
}

/// Shadow rays with what they bring if nothing is in their way.
#[derive(Default)]
pub struct ShadowQueue {
    /// Segments from surfaces to lights.
    pub ray: Vec<Ray>,
    /// Lights that may be hit.
    pub source: Vec<Source>,
    /// Radiance for the sample.
    pub contribution: Vec<Vec3>,
    /// The sample.
    pub slot: Vec<u32>,
}

impl ShadowQueue {
    /// Put a ray at its end.
    pub fn push(&mut self, ray: Ray, source: Source, contribution: Vec3, slot: u32) {
        self.ray.push(ray);
        self.source.push(source);
        self.contribution.push(contribution);
        self.slot.push(slot);
    }

    /// Rays in it.
    pub fn len(&self) -> usize {
        self.ray.len()
    }

    /// Forget all rays, keep the memory.
    pub fn clear(&mut self) {
        self.ray.clear();
        self.source.clear();
        self.contribution.clear();
        self.slot.clear();
    }
}

/// The memory of a tile's batches, used again by each.
#[derive(Default)]
pub struct Queues {
    /// Rays of this round; camera rays at first.
    pub rays: RayQueue,
    /// Rays of the next round.
    pub next: RayQueue,
    /// Shadow rays of this round.
    pub shadows: ShadowQueue,
    /// What the rays of this round hit.
    pub hits: Vec<Option<Hit>>,
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
    pub fn camera_rays(&self, slots: Range<u32>, queue: &mut RayQueue) {
        queue.clear();
        for slot in slots {
            queue.push(self.camera_ray(slot));
        }
    }

    fn camera_ray(&self, slot: u32) -> PathRay {
        let (x, y, _) = self.block.place(slot);
        let [fx, fy, lx, ly] = self.block.sampler(self.settings.seed, slot).get4(Purpose::CAMERA);
        let sample = filter(self.settings.filter).sample(Vec2::new(fx, fy));
        let place = (sample.offset + Vec2::splat(0.5)).as_dvec2();
        let lens = if self.settings.dof { warp::disk(Vec2::new(lx, ly)) } else { Vec2::ZERO };
        let from_corner = DVec2::new(f64::from(x), f64::from(y)) + place;
        let ray = self.world.camera.ray(self.settings.from_middle(from_corner), lens);
        PathRay { ray, throughput: Vec3::splat(sample.weight), slot, path: 1, medium: Medium::default() }
    }
}

fn filter(filter: PixelFilter) -> Filter {
    match filter {
        PixelFilter::Box => Filter::Box,
        PixelFilter::Tent => Filter::Tent,
        PixelFilter::Gaussian => Filter::Gaussian,
        PixelFilter::Mitchell => Filter::Mitchell,
    }
}
