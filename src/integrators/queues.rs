//! Queues of rays.

use std::cell::RefCell;

use super::crossing::CrossingMemory;
use super::medium::Medium;
use crate::geometry::Ray;
use crate::lights::{LightSamples, Source};
use crate::math::Vec3;
use crate::world::Hit;

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
    /// What is near to a hit of glass.
    pub crossing: CrossingMemory,
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
