//! Intersection of queued rays.

use super::ray::PathRay;
use super::tile::TileContext;
use crate::control::Cancelled;
use crate::geometry::Ray;
use crate::world::{Hit, PACKET_SIZE};

/// Number of rays between checks of the cancel token.
const POLL_INTERVAL: usize = 256;

impl TileContext<'_> {
    /// Finds the closest hit of every ray in a queue, replacing the content of `hits`.
    pub fn closest_hits(&self, rays: &[PathRay], hits: &mut Vec<Option<Hit>>) -> Result<(), Cancelled> {
        hits.clear();
        hits.resize(rays.len(), None);
        for (paths, hits) in rays.chunks(POLL_INTERVAL).zip(hits.chunks_mut(POLL_INTERVAL)) {
            self.token.check_pause_and_cancel()?;
            for (paths, hits) in paths.chunks(PACKET_SIZE).zip(hits.chunks_mut(PACKET_SIZE)) {
                let rays: [Ray; PACKET_SIZE] =
                    std::array::from_fn(|lane| paths[lane.min(paths.len() - 1)].ray);
                self.world.geometry.closest_hit_packet(&rays[..paths.len()], hits);
            }
        }
        Ok(())
    }
}
