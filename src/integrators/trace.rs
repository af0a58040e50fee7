//! From rays in queues to what they meet.

use super::queues::PathRay;
use super::shot::Shot;
use crate::control::Cancelled;
use crate::geometry::Ray;
use crate::world::{Hit, PACKET};

/// Rays between two looks at the token.
const POLL_INTERVAL: usize = 256;

impl Shot<'_> {
    /// The nearest hit of every ray in a queue, in place of what is in `hits`.
    pub fn closest_hits(&self, rays: &[PathRay], hits: &mut Vec<Option<Hit>>) -> Result<(), Cancelled> {
        self.closest_hits_of(rays, |number| number, hits)
    }

    /// The same, those together that are in an order of all places.
    pub fn closest_hits_in(
        &self,
        order: &[u32],
        rays: &[PathRay],
        hits: &mut Vec<Option<Hit>>,
    ) -> Result<(), Cancelled> {
        self.closest_hits_of(rays, |number| order[number] as usize, hits)
    }

    /// The same by the place of each number.
    fn closest_hits_of(
        &self,
        rays: &[PathRay],
        place: impl Fn(usize) -> usize,
        hits: &mut Vec<Option<Hit>>,
    ) -> Result<(), Cancelled> {
        hits.clear();
        hits.resize(rays.len(), None);
        for first in (0..rays.len()).step_by(PACKET) {
            if first.is_multiple_of(POLL_INTERVAL) {
                self.token.check()?;
            }
            let count = (rays.len() - first).min(PACKET);
            let packet: [Ray; PACKET] =
                std::array::from_fn(|lane| rays[place(first + lane.min(count - 1))].ray);
            let mut found = [None; PACKET];
            self.world.geometry.closest_packet(&packet[..count], &mut found[..count]);
            for (lane, hit) in found.into_iter().enumerate().take(count) {
                hits[place(first + lane)] = hit;
            }
        }
        Ok(())
    }
}
