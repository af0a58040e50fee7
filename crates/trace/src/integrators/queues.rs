//! Queues of rays.

use std::cell::RefCell;

use super::camera::CameraRow;
use super::cone::Cone;
use super::crossing::CrossingMemory;
use super::lit_queue::LitQueue;
use super::medium::Medium;
use super::view::Ways;
use crate::geometry::Ray;
use crate::geometry::surface_rows::SurfaceRow;
use crate::math::Vec3;
use crate::world::Hit;

/// A path's ray.
#[derive(Clone, Copy)]
pub struct PathRay {
    /// The ray; its direction is a unit vector.
    pub ray: Ray,
    /// Throughput: the factor on the radiance that the ray meets.
    pub throughput: Vec3,
    /// The sample that it belongs to.
    pub slot: u32,
    /// Number that tells the paths of one sample apart.
    pub path: u32,
    /// The glass around it.
    pub medium: Medium,
    /// Events before this ray.
    pub history: History,
    /// The beam around it.
    pub cone: Cone,
}

/// State of a path, beside its ray, that determines the weight of the light which it meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct History {
    /// Pdf in sr⁻¹ of the direction at the last vertex's lobes. 0 after the camera, a mirror or glass, and if the path passed
    /// through glass since: then no light sample finds what it meets.
    pub density: f32,
    /// The normal at the last vertex, by which its light samples went, if there is a pdf.
    pub normal: Vec3,
    /// Throughput for Russian roulette: the largest component, of all lobes, whatever the view shows.
    pub carried: f32,
    /// Whether only the camera, mirrors and glass come before.
    pub is_seen: bool,
    /// Whether exactly one diffuse or glossy surface comes before.
    pub is_step: bool,
    /// Whether the last such surface had a glossy lobe.
    pub is_from_gloss: bool,
}

impl History {
    /// The state of camera rays.
    pub const CAMERA: Self = Self {
        density: 0.0,
        normal: Vec3::ZERO,
        carried: 1.0,
        is_seen: true,
        is_step: false,
        is_from_gloss: false,
    };

    /// The state after a δ lobe that keeps this part of the radiance.
    pub fn mirrored(self, part: f32) -> Self {
        Self { density: 0.0, carried: self.carried * part, ..self }
    }

    /// Whether the view shows light that reaches the first diffuse or glossy surface by this path.
    pub fn shows(&self, ways: Ways) -> bool {
        match (self.is_step, self.density > 0.0) {
            (true, true) => ways.direct,
            (true, false) => ways.caustic,
            (false, _) => ways.indirect,
        }
    }

    /// The state after surfaces that change nothing, but hide from light samples what is behind them.
    pub fn hidden(self) -> Self {
        self.mirrored(1.0)
    }
}

impl PathRay {
    /// Number of the path that goes on from here; `branch` tells its continuations apart.
    pub fn next_path(&self, branch: u32) -> u32 {
        // With XOR, the number 1 would stay 1 at each reflection, and every choice of the path would repeat the first
        // one.
        self.path.wrapping_add(branch).wrapping_mul(0x9e37_79b1).rotate_left(15).wrapping_add(branch)
    }
}

/// The memory of batches, which each uses again.
#[derive(Default)]
pub struct Queues {
    /// Rays of this round; camera rays at first.
    pub rays: Vec<PathRay>,
    /// Rays of the next round.
    pub next: Vec<PathRay>,
    /// Next rays of the camera.
    pub camera: Vec<CameraRow>,
    /// Vertices of this round that wait for direct light.
    pub lit: LitQueue,
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

impl Queues {
    /// The queues that this thread left after its last tile; [`Queues::leave`] keeps them for the next.
    pub fn of_thread() -> Self {
        QUEUES.take()
    }

    /// Keeps the queues for the next tile of this thread.
    pub fn leave(self) {
        QUEUES.set(self);
    }
}

thread_local! {
    static QUEUES: RefCell<Queues> = RefCell::default();
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::geometry::ShapeHit;
    use crate::sampling::CAMERA_PATH;

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

    fn numbered(path: u32) -> PathRay {
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        PathRay {
            ray,
            throughput: Vec3::ONE,
            slot: 0,
            path,
            medium: Medium::default(),
            history: History::CAMERA,
            cone: Cone::default(),
        }
    }

    #[test]
    fn the_paths_of_a_sample_have_numbers_of_their_own() {
        // Follow all paths of 12 splits, and one that is always reflected or always refracted.
        let (mut round, mut seen) = (vec![CAMERA_PATH + 1], HashSet::from([CAMERA_PATH, CAMERA_PATH + 1]));
        for _ in 0..12 {
            round = round.iter().flat_map(|&path| [1, 2].map(|way| numbered(path).next_path(way))).collect();
            assert!(round.iter().all(|&path| seen.insert(path)));
        }
        for way in [1, 2] {
            let (mut path, mut seen) = (CAMERA_PATH + 1, HashSet::from([CAMERA_PATH]));
            for length in 0..10_000 {
                assert!(seen.insert(path), "way {way} comes back to itself after {length}");
                path = numbered(path).next_path(way);
            }
        }
    }
}
