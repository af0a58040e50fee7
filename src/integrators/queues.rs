//! Queues of rays.

use std::cell::RefCell;

use super::camera::CameraRow;
use super::cone::Cone;
use super::crossing::CrossingMemory;
use super::lit_queue::LitQueue;
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
    /// How it came to its direction.
    pub history: History,
    /// The beam that it stands for.
    pub cone: Cone,
}

/// What the light that a path meets depends on beside its ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct History {
    /// Density in sr⁻¹ with which the direction was drawn from the lobes of the last vertex; 0 where that is the camera, a mirror
    /// or glass, or where the path passed through glass since: no light sample finds what it meets then.
    pub density: f32,
    /// The normal that light samples of the last vertex went by, where there is a density.
    pub normal: Vec3,
    /// The path's throughput as roulette sees it: its largest part, of all lobes, whatever the view shows.
    pub carried: f32,
    /// Whether there are but the camera, mirrors and glass before.
    pub is_seen: bool,
}

impl History {
    /// Of rays of the camera.
    pub const CAMERA: Self = Self { density: 0.0, normal: Vec3::ZERO, carried: 1.0, is_seen: true };

    /// After a δ lobe with this part of the radiance.
    pub fn mirrored(self, part: f32) -> Self {
        Self { density: 0.0, carried: self.carried * part, ..self }
    }

    /// After passing surfaces that change nothing but hide what is behind from light samples.
    pub fn hidden(self) -> Self {
        self.mirrored(1.0)
    }
}

impl PathRay {
    /// Number of the path that goes on from here; `branch` tells the ways to go on apart.
    pub fn next_path(&self, branch: u32) -> u32 {
        // By XOR the number 1 would stay 1 at each reflection, and every choice of the path would be the first one again.
        self.path.wrapping_add(branch).wrapping_mul(0x9e37_79b1).rotate_left(15).wrapping_add(branch)
    }
}

/// The memory of batches, used again by each.
#[derive(Default)]
pub struct Queues {
    /// Rays of this round; camera rays at first.
    pub rays: Vec<PathRay>,
    /// Rays of the next round.
    pub next: Vec<PathRay>,
    /// Rays of the camera that are next.
    pub camera: Vec<CameraRow>,
    /// Vertices of this round that are not lit yet.
    pub lit: LitQueue,
    /// What the rays of this round hit.
    pub hits: Vec<Option<Hit>>,
    /// Their order by where they go.
    pub by_direction: ByDirection,
    /// Their order by what they hit.
    pub by_object: ByObject,
    /// What is near to a hit of glass.
    pub crossing: CrossingMemory,
}

/// Places in a queue, those together whose rays go much the same way: so packets of them meet the same boxes, and what they hit is
/// close together. The samples of a pixel, as they come, are as far apart as they can be.
#[derive(Default)]
pub struct ByDirection {
    kinds: Vec<u16>,
    places: Vec<u32>,
}

impl ByDirection {
    /// Steps along each side of the square that directions are mapped to.
    const STEPS: u32 = 1 << 5;

    /// Of these rays; those that are alike in the order of the queue.
    pub fn sort(&mut self, rays: &[PathRay]) {
        self.kinds.clear();
        self.kinds.extend(rays.iter().map(|path| Self::kind(path.ray.direction)));
        sort(
            &self.kinds,
            0..rays.len() as u32,
            Self::STEPS as usize * Self::STEPS as usize,
            &mut self.places,
        );
    }

    /// Number of the cell of a unit direction (Meyer et al., *On Floating-Point Normal Vectors*, 2010, section 3), along a
    /// curve of cells that are close together.
    fn kind(direction: Vec3) -> u16 {
        let [x, y, z] = direction.to_array();
        let scale = 1.0 / (x.abs() + y.abs() + z.abs());
        let (x, y) = (x * scale, y * scale);
        let folded = |a: f32, b: f32| if z < 0.0 { (1.0 - b.abs()).copysign(a) } else { a };
        let step = |x: f32| ((x * 0.5 + 0.5) * Self::STEPS as f32) as u32;
        let spread = |x: u32| {
            let x = x.min(Self::STEPS - 1);
            let x = (x | x << 4) & 0x0f0f;
            let x = (x | x << 2) & 0x3333;
            (x | x << 1) & 0x5555
        };
        (spread(step(folded(x, y))) | spread(step(folded(y, x))) << 1) as u16
    }

    /// Each place once.
    pub fn places(&self) -> &[u32] {
        &self.places
    }
}

/// Sort places in `order` by what kind they are of; those of one kind stay as they were.
fn sort(kinds: &[u16], order: impl Iterator<Item = u32> + Clone, count: usize, places: &mut Vec<u32>) {
    let mut starts = [0_u32; MOST_KINDS + 1];
    for kind in kinds {
        starts[usize::from(*kind) + 1] += 1;
    }
    for i in 1..=count {
        starts[i] += starts[i - 1];
    }
    places.clear();
    places.resize(kinds.len(), 0);
    for place in order {
        let start = &mut starts[usize::from(kinds[place as usize])];
        places[*start as usize] = place;
        *start += 1;
    }
}

/// Kinds that places are sorted by.
const MOST_KINDS: usize = 1 << 10;

/// Places in a queue, those together whose rays hit the same object, so that packets of them are shaded by few loops.
#[derive(Default)]
pub struct ByObject {
    kinds: Vec<u16>,
    places: Vec<u32>,
}

impl ByObject {
    /// Objects are told apart by so many of their last bits.
    const KINDS: usize = 64;

    /// Of these hits; what hits nothing is last, and what is alike as in `order`.
    pub fn sort(&mut self, hits: &[Option<Hit>], order: &[u32]) {
        let kind = |hit: &Option<Hit>| hit.map_or(Self::KINDS, |hit| hit.object as usize % Self::KINDS);
        self.kinds.clear();
        self.kinds.extend(hits.iter().map(|hit| kind(hit) as u16));
        sort(&self.kinds, order.iter().copied(), Self::KINDS + 1, &mut self.places);
    }

    /// Each place once.
    pub fn places(&self) -> &[u32] {
        &self.places
    }
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

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::geometry::ShapeHit;
    use crate::math::random::signed;
    use crate::sampling::CAMERA_PATH;

    #[test]
    fn places_are_together_by_object_and_in_order() {
        let hit = |object: u32| (object != 9).then_some(Hit { shape: ShapeHit::at(1.0), object });
        let hits: Vec<Option<Hit>> = [5, 9, 0, 5, 63, 9, 0, 5].map(hit).to_vec();
        let mut by_object = ByObject::default();
        for _ in 0..2 {
            by_object.sort(&hits, &[0, 1, 2, 3, 4, 5, 6, 7]);
            assert_eq!(by_object.places(), [2, 6, 0, 3, 7, 4, 1, 5]);
            by_object.sort(&hits, &[7, 6, 5, 4, 3, 2, 1, 0]);
            assert_eq!(by_object.places(), [6, 2, 7, 3, 0, 4, 5, 1]);
        }
        by_object.sort(&[], &[]);
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
    fn rays_that_go_the_same_way_are_together() {
        let mut next = signed(3);
        let towards = |direction: Vec3| PathRay { ray: Ray::new(Vec3::ONE, direction), ..numbered(0) };
        let axes = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        let any = (0..1018).map(|_| Vec3::new(next(), next(), next()).normalize());
        let rays: Vec<PathRay> = axes.into_iter().chain(any).map(towards).collect();
        let mut by_direction = ByDirection::default();
        by_direction.sort(&rays);
        let mut once = by_direction.places().to_vec();
        once.sort_unstable();
        assert!(once.into_iter().eq(0..1024));
        // The mean distance of neighbours is far below that of any two, which is 4/3.
        let ends = |pair: &[u32]| {
            let [a, b] = [pair[0], pair[1]].map(|place| rays[place as usize].ray.direction);
            f64::from((a - b).length())
        };
        let mean = by_direction.places().windows(2).map(ends).sum::<f64>() / 1023.0;
        assert!(mean < 0.15, "{mean}");
        by_direction.sort(&[towards(Vec3::NAN), towards(Vec3::ZERO)]);
        assert_eq!(by_direction.places(), [0, 1]);
    }

    #[test]
    fn the_paths_of_a_sample_have_numbers_of_their_own() {
        // All of 12 splits, and a path that is always reflected or always refracted.
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
