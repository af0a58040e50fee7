//! Partitioning of a cell's references at a plane.

use super::cost::SplitPlane;
use crate::accel::reference::{SimdBounds, TriangleReference};
use crate::math::Vec3;

/// Reusable buffers for partitioning.
#[derive(Default)]
pub struct PartitionBuffers {
    /// References on the left of the plane, followed by stale entries.
    left: Vec<TriangleReference>,
    /// Left and right indices of the references that are on both sides.
    on_both: Vec<[u32; 2]>,
}

impl PartitionBuffers {
    /// Partitions the references from index `first` on. Keeps the references on the right in place and
    /// returns the references on the left. The bounding box of a straddling reference is clipped to each
    /// side. A reference that only touches the plane stays on its side. Preserves the order.
    ///
    /// Branchless, since data-dependent branches would often be mispredicted: every reference is written to
    /// both sides, and then each side's length is incremented by 0 or 1.
    pub fn partition_references(
        &mut self,
        references: &mut Vec<TriangleReference>,
        first: usize,
        plane: &SplitPlane,
        corners: &impl Fn(u32) -> [Vec3; 3],
    ) -> &[TriangleReference] {
        match plane.axis {
            0 => self.partition_along::<0>(references, first, plane, corners),
            1 => self.partition_along::<1>(references, first, plane, corners),
            _ => self.partition_along::<2>(references, first, plane, corners),
        }
    }

    fn partition_along<const AXIS: usize>(
        &mut self,
        references: &mut Vec<TriangleReference>,
        first: usize,
        plane: &SplitPlane,
        corners: &impl Fn(u32) -> [Vec3; 3],
    ) -> &[TriangleReference] {
        let own = &mut references[first..];
        if self.left.len() < own.len() {
            self.left.resize(own.len(), TriangleReference { bounds: SimdBounds::EMPTY });
            self.on_both.resize(own.len(), [0; 2]);
        }
        let at = plane.at;
        let (mut left, mut right, mut on_both) = (0, 0, 0);
        for place in 0..own.len() {
            let reference = own[place];
            let (min, max) =
                (reference.bounds.min.to_array()[AXIS], reference.bounds.max_corner().to_array()[AXIS]);
            let (below, above) = (min < at, max > at);
            let is_planar = !(below | above);
            self.left[left] = reference;
            own[right] = reference;
            self.on_both[on_both] = [left as u32, right as u32];
            left += usize::from(below | (is_planar & !plane.planar_right));
            right += usize::from(above | (is_planar & plane.planar_right));
            on_both += usize::from(below & above);
        }
        for [left, right] in self.on_both[..on_both].iter().map(|both| both.map(|place| place as usize)) {
            let whole = own[right];
            [self.left[left], own[right]] = whole.split(AXIS, at, corners(whole.id()));
        }
        references.truncate(first + right);
        &self.left[..left]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::signed_number_generator as random;

    #[test]
    fn partition_keeps_order_and_straddlers() {
        let mut next = random(29);
        let mut step = || Vec3::new(next(), next(), next()).map(|x| (x * 6.0).round());
        let mesh: Vec<[Vec3; 3]> = (0..200_u32)
            .map(|id| {
                let mut corners = [step(), step(), step()];
                if id % 4 == 3 {
                    let axis = id as usize % 3;
                    let at = corners[0][axis];
                    corners.iter_mut().for_each(|corner| corner[axis] = at);
                }
                corners
            })
            .collect();
        let corners = |id: u32| mesh[id as usize];
        let all: Vec<TriangleReference> =
            (0..200).map(|id| TriangleReference::new(id, corners(id))).collect();
        let mut scratch = PartitionBuffers::default();
        for axis in 0..3 {
            for planar_right in [false, true] {
                let plane = SplitPlane { axis, at: 1.0, planar_right };
                let mut own = all.clone();
                let left = scratch.partition_references(&mut own, 50, &plane, &corners).to_vec();
                let expected = |is_there: &dyn Fn(f32, f32) -> bool| -> Vec<u32> {
                    let reaches = |one: &&TriangleReference| {
                        is_there(one.bounds.min[axis], one.bounds.max_corner()[axis])
                    };
                    all[50..].iter().filter(reaches).map(TriangleReference::id).collect()
                };
                let planar = |min: f32, max: f32| min == 1.0 && max == 1.0;
                let on_left = expected(&|min, max| min < 1.0 || (planar(min, max) && !planar_right));
                let on_right = expected(&|min, max| max > 1.0 || (planar(min, max) && planar_right));
                let ids =
                    |side: &[TriangleReference]| side.iter().map(TriangleReference::id).collect::<Vec<_>>();
                assert_eq!((ids(&left), ids(&own[50..])), (on_left, on_right), "{plane:?}");
                assert_eq!(ids(&own[..50]), ids(&all[..50]), "references of other cells should not change");
                assert!(left.iter().all(|one| one.bounds.max_corner()[axis] <= 1.0), "{plane:?}");
                assert!(own[50..].iter().all(|one| one.bounds.min[axis] >= 1.0), "{plane:?}");
            }
        }
        let in_planes = all.iter().filter(|one| one.bounds.extent().truncate().min_element() == 0.0).count();
        assert!(in_planes > 20, "{in_planes}");
    }
}
