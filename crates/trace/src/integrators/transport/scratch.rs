//! Queues of rays.

use super::camera::CameraRow;
use super::crossing::CrossingMemory;
use super::ray::PathRay;
use crate::geometry::surface_rows::SurfaceRow;
use crate::world::Hit;

/// The memory of batches, which each uses again.
#[derive(Default)]
pub struct Scratch {
    /// Rays of this round; camera rays at first.
    pub rays: Vec<PathRay>,
    /// Rays of the next round.
    pub next: Vec<PathRay>,
    /// Next rays of the camera.
    pub camera: Vec<CameraRow>,
    /// Surfaces at the hits of a packet.
    pub surfaces: SurfaceRow,
    /// Hits of the rays of this round.
    pub hits: Vec<Option<Hit>>,
    /// Order of the rays by the objects that they hit.
    pub by_object: ByObject,
    /// Memory for the surfaces near a hit of glass.
    pub crossing: CrossingMemory,
}

/// Places in a queue, grouped by the objects that their rays hit, so that packets of them are shaded by few loops.
#[derive(Default)]
pub struct ByObject {
    places: Vec<u32>,
}

impl ByObject {
    /// Number of groups: the last bits of an object's number choose its group.
    const KINDS: usize = 64;

    /// Groups the places of these hits. Rays without a hit come last; a group keeps the order of the queue.
    pub fn sort(&mut self, hits: &[Option<Hit>]) {
        let kind = |hit: &Option<Hit>| hit.map_or(Self::KINDS, |hit| hit.object as usize % Self::KINDS);
        let mut starts = [0_u32; Self::KINDS + 2];
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

    /// Each place once.
    pub fn places(&self) -> &[u32] {
        &self.places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ShapeHit;

    #[test]
    fn places_are_together_by_object_and_in_order() {
        let hit = |object: u32| (object != 9).then_some(Hit { shape: ShapeHit::at(1.0), object });
        let hits: Vec<Option<Hit>> = [5, 9, 0, 5, 63, 9, 0, 5].map(hit).to_vec();
        let mut by_object = ByObject::default();
        for _ in 0..2 {
            by_object.sort(&hits);
            assert_eq!(by_object.places(), [2, 6, 0, 3, 7, 4, 1, 5]);
        }
        by_object.sort(&[]);
        assert!(by_object.places().is_empty());
    }
}
