//! Queues of rays.

use std::cell::RefCell;

use super::crossing::CrossingMemory;
use super::light::LitQueue;
use super::medium::Medium;
use crate::geometry::Ray;
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

/// The memory of batches, used again by each.
#[derive(Default)]
pub struct Queues {
    /// Rays of this round; camera rays at first.
    pub rays: Vec<PathRay>,
    /// Rays of the next round.
    pub next: Vec<PathRay>,
    /// Vertices of this round that are not lit yet.
    pub lit: LitQueue,
    /// What the rays of this round hit.
    pub hits: Vec<Option<Hit>>,
    /// What is near to a hit of glass.
    pub crossing: CrossingMemory,
}

impl Queues {
    /// Those that this thread left from its last tile; [`Queues::leave`] them for the next.
    pub fn of_thread() -> Self {
        QUEUES.take()
    }

    /// For the next tile of this thread.
    pub fn leave(self) {
        QUEUES.set(self);
    }
}

thread_local! {
    static QUEUES: RefCell<Queues> = RefCell::default();
}
