//! Buffers for queues of rays and hits.

use super::camera::CameraRayPacket;
use super::crossing::CoincidentSurfaceBuffers;
use super::ray::PathRay;
use crate::geometry::surface_packet::SurfacePacket;
use crate::world::Hit;

/// Buffers reused for all batches of a thread.
#[derive(Default)]
pub struct TraceBuffers {
    /// Rays of this bounce, or camera rays for first-hit AOVs.
    pub rays: Vec<PathRay>,
    /// Rays of the next bounce.
    pub next: Vec<PathRay>,
    /// Packets of camera rays.
    pub camera: Vec<CameraRayPacket>,
    /// Surfaces at the hits of a packet.
    pub surfaces: SurfacePacket,
    /// Hits of this bounce's rays.
    pub hits: Vec<Option<Hit>>,
    /// Queue indices of the rays, ordered by the object hit.
    pub object_order: HitsByObject,
    /// Buffers for the search for coincident surfaces.
    pub crossing: CoincidentSurfaceBuffers,
}

/// Queue indices grouped by the object hit, so that shading a packet takes few loop iterations.
#[derive(Default)]
pub struct HitsByObject {
    places: Vec<u32>,
}

impl HitsByObject {
    /// Number of groups. The low bits of an object's index select its group.
    const GROUPS: usize = 64;

    /// Groups the queue indices by the object hit. Rays without a hit are last. Each group keeps the queue
    /// order.
    pub fn group_hits_by_object(&mut self, hits: &[Option<Hit>]) {
        let kind = |hit: &Option<Hit>| hit.map_or(Self::GROUPS, |hit| hit.object as usize % Self::GROUPS);
        let mut starts = [0_u32; Self::GROUPS + 2];
        for hit in hits {
            starts[kind(hit) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        self.places.clear();
        self.places.resize(hits.len(), 0);
        for (place, hit) in (0..).zip(hits) {
            let start = &mut starts[kind(hit)];
            self.places[*start as usize] = place;
            *start += 1;
        }
    }

    /// Returns the grouped queue indices.
    pub fn grouped_queue_indices(&self) -> &[u32] {
        &self.places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ShapeHit;

    #[test]
    fn indices_are_grouped_by_object_in_order() {
        let hit = |object: u32| (object != 9).then_some(Hit { shape: ShapeHit::from_t(1.0), object });
        let hits: Vec<Option<Hit>> = [5, 9, 0, 5, 63, 9, 0, 5].map(hit).to_vec();
        let mut object_order = HitsByObject::default();
        for _ in 0..2 {
            object_order.group_hits_by_object(&hits);
            assert_eq!(object_order.grouped_queue_indices(), [2, 6, 0, 3, 7, 4, 1, 5]);
        }
        object_order.group_hits_by_object(&[]);
        assert!(object_order.grouped_queue_indices().is_empty());
    }
}
