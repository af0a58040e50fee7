//! From rays in queues to what they meet.

use super::queues::{PathRay, ShadowQueue};
use super::shot::Shot;
use super::sink::Sink;
use crate::control::Cancelled;
use crate::geometry::Ray;
use crate::scene::description::Shadows;
use crate::world::{Hit, PACKET};

/// Rays between two looks at the token.
const POLL_INTERVAL: usize = 256;

impl Shot<'_> {
    /// The nearest hit of every ray in a queue, in place of what is in `hits`.
    pub fn closest_hits(&self, rays: &[PathRay], hits: &mut Vec<Option<Hit>>) -> Result<(), Cancelled> {
        hits.clear();
        hits.resize(rays.len(), None);
        for (paths, hits) in rays.chunks(POLL_INTERVAL).zip(hits.chunks_mut(POLL_INTERVAL)) {
            self.token.check()?;
            for (paths, hits) in paths.chunks(PACKET).zip(hits.chunks_mut(PACKET)) {
                let rays: [Ray; PACKET] = std::array::from_fn(|lane| paths[lane.min(paths.len() - 1)].ray);
                self.world.geometry.closest_packet(&rays[..paths.len()], hits);
            }
        }
        Ok(())
    }

    /// Give the sink what arrives by the shadow rays in a queue, in their order, and empty it; how many were traced.
    pub fn trace_shadows(&self, queue: &mut ShadowQueue, sink: &mut Sink<'_>) -> Result<u64, Cancelled> {
        let is_traced = self.settings.render.shadows != Shadows::Off;
        let ShadowQueue { rays, sources, arrivals } = &*queue;
        let packets = rays.chunks(PACKET).zip(sources.chunks(PACKET)).zip(arrivals.chunks(PACKET));
        for (number, ((rays, sources), arrivals)) in packets.enumerate() {
            if number.is_multiple_of(POLL_INTERVAL / PACKET) {
                self.token.check()?;
            }
            let geometry = &self.world.geometry;
            let occluded = if is_traced { geometry.occluded_packet(rays, sources) } else { 0 };
            for (lane, arrival) in arrivals.iter().enumerate() {
                if occluded & 1 << lane == 0 {
                    sink.add_arrived(arrival.slot, arrival.contribution);
                }
            }
        }
        let count = if is_traced { queue.len() as u64 } else { 0 };
        queue.clear();
        Ok(count)
    }
}
