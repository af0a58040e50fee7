//! The upper levels of a tree, flattened into one packet of boxes. Intervals that bound the coordinates of
//! all rays in a packet are tested against all boxes in one step, which skips the boxes that all rays miss.
//! Rounding is monotonic, so bounds on the inputs of [`SlabRay::entry_distance`] also bound its results: a
//! box that any single ray would hit is never skipped.
//!
//! [`SlabRay::entry_distance`]: crate::geometry::aabb::SlabRay::entry_distance

use super::build::PrimitiveReference;
use super::{BinaryNode, Bvh, ChildRef};
use crate::accel::{F32x16, PACKET_SIZE};
use crate::geometry::Aabb;
use crate::geometry::aabb::SLAB_PAD;
use crate::math::Vec3;
use crate::math::lanes::{PortableSimd, Simd, TRUE};

/// Up to [`PACKET_SIZE`] subtrees that together contain all primitives. They replace the tree's upper levels.
/// Small scenes fit entirely into the top node.
#[derive(Clone, Debug)]
pub(super) struct WideTopNode {
    min: [F32x16; 3],
    max: [F32x16; 3],
    child: [ChildRef; PACKET_SIZE],
    /// Mask of the subtrees in use.
    used: u32,
}

impl WideTopNode {
    /// Top node of an empty tree.
    pub(super) const EMPTY: Self = Self {
        min: [[f32::INFINITY; PACKET_SIZE]; 3],
        max: [[f32::NEG_INFINITY; PACKET_SIZE]; 3],
        child: [ChildRef::NONE; PACKET_SIZE],
        used: 0,
    };

    /// Creates a top node. While slots are free, replaces the largest inner nodes with their children, then
    /// the largest leaves with their primitives.
    pub(super) fn new(
        root: (Aabb, ChildRef),
        nodes: &[BinaryNode],
        references: &[PrimitiveReference],
    ) -> Self {
        let mut open = vec![root];
        while let Some(place) = largest_openable_child(&open, |child, room| child.count == 0 && room > 0) {
            let node = &nodes[open.swap_remove(place).1.first as usize];
            let both = node.bounds.into_iter().zip(node.child);
            open.extend(both.filter(|(bounds, _)| !bounds.is_empty()));
        }
        while let Some(place) =
            largest_openable_child(&open, |child, room| child.count > 1 && room + 1 >= child.count as usize)
        {
            let ChildRef { first, count } = open.swap_remove(place).1;
            let each = |first: u32| (references[first as usize].bounds, ChildRef { first, count: 1 });
            open.extend((first..first + count).map(each));
        }
        let mut top = Self::EMPTY;
        for (i, (bounds, child)) in open.into_iter().enumerate() {
            for axis in 0..3 {
                (top.min[axis][i], top.max[axis][i]) = (bounds.min[axis], bounds.max[axis]);
            }
            top.child[i] = child;
            top.used |= 1 << i;
        }
        top
    }

    /// A subtree and its bounding box.
    #[inline(always)]
    pub(super) fn subtree_bounds_and_child(&self, i: usize) -> (Aabb, ChildRef) {
        let corner = |rows: &[F32x16; 3]| Vec3::new(rows[0][i], rows[1][i], rows[2][i]);
        (Aabb { min: corner(&self.min), max: corner(&self.max) }, self.child[i])
    }

    /// Mask of the subtrees whose boxes overlap `other`.
    #[inline]
    pub(super) fn overlap_mask(&self, other: &Aabb) -> u32 {
        let mut hits = [TRUE; PACKET_SIZE];
        for axis in 0..3 {
            let (least, greatest) = (other.min[axis], other.max[axis]);
            for i in 0..PACKET_SIZE {
                let overlaps = (self.min[axis][i] <= greatest) & (least <= self.max[axis][i]);
                hits[i] = if overlaps { hits[i] } else { 0 };
            }
        }
        PortableSimd.movemask(&hits) & self.used
    }

    /// Mask of the subtrees that the rays in a beam may hit, and lower bounds on the entry distances.
    #[inline(always)]
    pub(super) fn subtree_hits_and_entries(&self, beam: &RayPacketBounds, simd: impl Simd) -> (u32, F32x16) {
        let (mut near, mut far) = ([0.0_f32; PACKET_SIZE], [beam.end * SLAB_PAD; PACKET_SIZE]);
        for axis in 0..3 {
            let [low, high] = beam.inverse[axis];
            let is_up = (low > 0.0) & (high < f32::INFINITY);
            let is_down = (high < 0.0) & (low > f32::NEG_INFINITY);
            if !(is_up | is_down) {
                continue;
            }
            let (first, last) =
                if is_up { (&self.min[axis], &self.max[axis]) } else { (&self.max[axis], &self.min[axis]) };
            let [start, end] = beam.origin[axis];
            let (start, end) = if is_up { (start, end) } else { (end, start) };
            for i in 0..PACKET_SIZE {
                let (to_first, to_last) = (first[i] - end, last[i] - start);
                let (a, b) = (to_first * low, to_first * high);
                let entry = if a < b { a } else { b };
                let (a, b) = (to_last * low, to_last * high);
                let exit = (if a > b { a } else { b }) * SLAB_PAD;
                near[i] = if entry > near[i] { entry } else { near[i] };
                far[i] = if exit < far[i] { exit } else { far[i] };
            }
        }
        let mut hits = [0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            hits[i] = if near[i] <= far[i] { TRUE } else { 0 };
        }
        (simd.movemask(&hits) & self.used, near)
    }
}

/// Index of the largest box that `may_open` accepts for replacement. `may_open` receives the child and the
/// number of free slots.
fn largest_openable_child(
    open: &[(Aabb, ChildRef)],
    may_open: impl Fn(ChildRef, usize) -> bool,
) -> Option<usize> {
    let room = PACKET_SIZE - open.len();
    let each = open.iter().enumerate().filter(|(_, (_, child))| may_open(*child, room));
    each.max_by(|(_, (a, _)), (_, (b, _))| a.half_area().total_cmp(&b.half_area())).map(|(place, _)| place)
}

/// Bounds on the coordinates of several rays.
pub(super) struct RayPacketBounds {
    /// Minimum and maximum coordinates of the origins.
    origin: [[f32; 2]; 3],
    /// Minimum and maximum coordinates of the inverse directions.
    inverse: [[f32; 2]; 3],
    /// Largest end among all rays.
    end: f32,
}

impl RayPacketBounds {
    /// Bounds the rays in the mask `traced`, which must not be empty.
    #[inline(always)]
    pub(super) fn from_ray_packet(
        origin: &[F32x16; 3],
        inverse: &[F32x16; 3],
        (ends, traced): (&F32x16, u32),
        simd: impl Simd,
    ) -> Self {
        let [x, y, z] = origin;
        let origin = [simd.min_max(x, traced), simd.min_max(y, traced), simd.min_max(z, traced)];
        let [x, y, z] = inverse;
        let inverse = [simd.min_max(x, traced), simd.min_max(y, traced), simd.min_max(z, traced)];
        Self { origin, inverse, end: simd.min_max(ends, traced)[1] }
    }
}

impl Bvh {
    /// Whether every subtree of the top node is a single primitive.
    #[cfg(test)]
    pub(super) fn fits_in_top_node(&self) -> bool {
        self.top.child.iter().enumerate().all(|(i, child)| self.top.used >> i & 1 == 0 || child.count == 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{AnyHitCallback, ClosestHitCallback};
    use crate::control::CancelToken;
    use crate::geometry::Ray;
    use crate::geometry::aabb::SlabRay;
    use crate::geometry::packet::{RayPacket, nonnegative_end_mask, set_bit_lanes};
    use crate::math::random::signed_number_generator as random;

    /// Records which primitives are tested against which rays.
    struct TestLog(Vec<u32>);

    impl ClosestHitCallback for TestLog {
        fn intersect_primitive(&mut self, id: u32, active: u32, _: &mut F32x16) {
            self.0[id as usize] |= active;
        }
    }

    impl AnyHitCallback for TestLog {
        fn primitive_hit_mask(&mut self, id: u32, active: u32, _: &F32x16) -> u32 {
            self.0[id as usize] |= active;
            0
        }
    }

    #[test]
    fn packet_tests_every_box_hit_by_its_rays() {
        let mut next = random(11);
        for count in [0, 1, 2, 5, 15, 16, 17, 40, 300] {
            let cell = |next: &mut dyn FnMut() -> f32| {
                let middle = Vec3::new(next(), next(), next()) * 4.0;
                let half = Vec3::new(next(), next(), next()).abs() * 0.8;
                // Some boxes are flat, like quads.
                let half = if next() > 0.5 { half * Vec3::new(1.0, 0.0, 1.0) } else { half };
                Aabb { min: middle - half, max: middle + half }
            };
            let boxes: Vec<Aabb> = (0..count).map(|_| cell(&mut next)).collect();
            let tree = Bvh::build(&boxes, &CancelToken::new()).expect("never canceled");
            assert_eq!(tree.fits_in_top_node(), count <= PACKET_SIZE, "{count}");
            let (mut tested, mut hits) = (0, 0);
            for round in 0..600 {
                let (from, to) = (Vec3::new(next(), next(), next()) * 6.0, Vec3::new(next(), next(), next()));
                let spread = [0.001, 0.1, 4.0][round % 3];
                let mut ray = || {
                    let jitter = Vec3::new(next(), next(), next()) * spread;
                    // Use parallel rays, rays from one point, or rays from many points.
                    match round % 7 {
                        0 => Ray::new(from + jitter, Vec3::NEG_Y),
                        1 | 2 => Ray::new(from + jitter, to - from),
                        _ => Ray::segment_ending_before_point(from, to * 3.0 + jitter),
                    }
                };
                let rays: Vec<Ray> = (0..=round % PACKET_SIZE).map(|_| ray()).collect();
                let (rows, mut ends) = RayPacket::new(&rays);
                // Skip some rays.
                for lane in (0..rays.len()).filter(|lane| round % 5 == 0 && lane % 3 == 1) {
                    ends[lane] = -1.0;
                }
                let (mut closest, mut any) = (TestLog(vec![0; count]), TestLog(vec![0; count]));
                let traced = nonnegative_end_mask(&ends, PortableSimd);
                tree.closest_hit_packet(&rows, &mut ends, traced, &[], &mut closest, PortableSimd);
                tree.any_hit_packet(&rows, &ends, traced, &[], &mut any, PortableSimd);
                for (id, bounds) in boxes.iter().enumerate() {
                    for lane in set_bit_lanes((1 << rays.len()) - 1).filter(|&lane| ends[lane] >= 0.0) {
                        let slabs = SlabRay::new(rays[lane].origin, rays[lane].direction);
                        let is_hit = slabs.entry_distance(bounds.min, bounds.max, ends[lane]).is_some();
                        let seen = [closest.0[id], any.0[id]].map(|seen| seen & 1 << lane != 0);
                        assert!(!is_hit || seen == [true; 2], "{lane} of {rays:?}: {bounds:?} {seen:?}");
                        hits += u32::from(is_hit);
                    }
                    tested += closest.0[id].count_ones();
                }
            }
            assert!(hits > 0 || count == 0, "{count}: no ray hit anything");
            assert!(
                count > PACKET_SIZE || tested == hits,
                "{count}: {tested} tests for {hits} hits; a flat tree needs exactly one test per hit box"
            );
        }
    }
}
