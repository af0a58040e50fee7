//! A packet's rays in registers, tested against one box or triangle at a time.

use super::rows::RaySoa;
use crate::accel::wide_bvh::node::{TrianglePack, WideNode};
use crate::accel::wide_bvh::simd::triangle;
use crate::accel::wide_bvh::simd::vector::SimdVector;
use crate::geometry::Aabb;
use crate::geometry::aabb::{SLAB_PAD, triangle_margin};
use crate::geometry::watertight::ShearedRay;
use crate::math::Vec3;

/// Rays in registers, preprocessed for box and triangle tests.
pub struct SimdRayPacket<V: SimdVector> {
    /// Origins for near and far planes, offset by the margin.
    near_origin: [V; 3],
    far_origin: [V; 3],
    pub inverse: [V; 3],
    /// Origins, with coordinates in the axis order of the sheared rays.
    sheared_origin: [V; 3],
    shear: [V; 3],
    /// World axes that become the x, y, and z axes of the sheared rays.
    axes: [usize; 3],
    /// Indices of the rays' start triangles, stored as bit patterns.
    start: V,
    /// Rows of a node that contain the near planes.
    pub near: [usize; 3],
    /// Minimum and maximum of the origins along each axis.
    pub origins: [[f32; 2]; 3],
    /// Largest box margin that any ray needs.
    pub margin: f32,
}

impl<V: SimdVector> SimdRayPacket<V> {
    /// Loads a packet, or returns `None` if the rays are not coherent. The directions of coherent rays have
    /// the same signs and the same longest axis.
    #[inline(always)]
    pub fn new(rows: &RaySoa, whole: &Aabb, like: V) -> Option<Self> {
        let axes = ShearedRay::new(rows.first.origin, rows.first.direction).axes();
        let mut own = Self {
            near_origin: [like; 3],
            far_origin: [like; 3],
            inverse: [like; 3],
            sheared_origin: [like; 3],
            shear: [like; 3],
            start: like.load_slice(&rows.start),
            axes,
            near: [0; 3],
            origins: [[0.0; 2]; 3],
            margin: 0.0,
        };
        let (mut origin, mut direction, mut size) = ([like; 3], [like; 3], [like; 3]);
        for (axis, origin) in origin.iter_mut().enumerate() {
            *origin = like.load_slice(&rows.origin[axis]);
            own.origins[axis] = [origin.min_element(), origin.max_element()];
        }
        let corner = |side: usize| Vec3::from_array(own.origins.map(|ends| ends[side]));
        own.margin = triangle_margin(corner(0), whole).max(triangle_margin(corner(1), whole));
        let margin = like.splat_like(own.margin);
        let (zero, one) = (like.splat_like(0.0), like.splat_like(1.0));
        let all = V::movemask(zero.eq(zero));
        for axis in 0..3 {
            direction[axis] = like.load_slice(&rows.direction[axis]);
            size[axis] = direction[axis].abs();
            own.inverse[axis] = one.div(direction[axis]);
            let up = V::movemask(
                zero.lt(own.inverse[axis]) & own.inverse[axis].lt(like.splat_like(f32::INFINITY)),
            );
            let down = V::movemask(
                own.inverse[axis].lt(zero) & like.splat_like(f32::NEG_INFINITY).lt(own.inverse[axis]),
            );
            let finite = V::movemask(origin[axis].abs().lt(like.splat_like(f32::INFINITY)));
            if (up != all && down != all) || finite != all {
                return None;
            }
            let (before, after) = (origin[axis] - margin, origin[axis] + margin);
            own.near_origin[axis] = if down == all { before } else { after };
            own.far_origin[axis] = if down == all { after } else { before };
            own.near[axis] = 2 * axis + usize::from(down == all);
        }
        // Find the longest axis and the shears, as in `ShearedRay::new`.
        let x_over_y = V::movemask(size[1].lt(size[0]));
        let longest = match axes[2] {
            0 => x_over_y & V::movemask(size[2].lt(size[0])),
            1 => !x_over_y & V::movemask(size[2].lt(size[1])),
            _ => {
                !(x_over_y & V::movemask(size[2].lt(size[0])) | !x_over_y & V::movemask(size[2].lt(size[1])))
            }
        };
        if longest & all != all {
            return None;
        }
        let scale = own.inverse[axes[2] % 3];
        own.shear = [direction[axes[0] % 3] * scale, direction[axes[1] % 3] * scale, scale];
        own.sheared_origin = [origin[axes[0] % 3], origin[axes[1] % 3], origin[axes[2] % 3]];
        Some(own)
    }

    /// Whether any ray hits the box in a slot before the ray's end. SIMD version of
    /// `SlabRay::entry_distance`.
    #[inline(always)]
    pub fn any_ray_hits_box(&self, node: &WideNode, slot: usize, end: V) -> bool {
        let pad = end.splat_like(SLAB_PAD);
        let (mut near, mut far) = (end.splat_like(0.0), end);
        for axis in 0..3 {
            let row = self.near[axis] % 6;
            let (to_near, to_far) =
                (end.splat_like(node.rows[row][slot]), end.splat_like(node.rows[row ^ 1][slot]));
            near = ((to_near - self.near_origin[axis]) * self.inverse[axis]).max(near);
            far = ((to_far - self.far_origin[axis]) * self.inverse[axis] * pad).min(far);
        }
        V::movemask(near.le(far)) != 0
    }

    /// Tests the triangle in a lane of a pack against all rays, including rays that start on it.
    #[inline(always)]
    pub fn intersect_triangle(
        &self,
        pack: &TrianglePack,
        lane: usize,
        t_max: V,
    ) -> triangle::TriangleHits<V> {
        let (a, b, c) = (
            self.sheared_corner(pack, 0, lane),
            self.sheared_corner(pack, 3, lane),
            self.sheared_corner(pack, 6, lane),
        );
        triangle::intersect(&[a, b, c], self.shear[2], t_max, false)
    }

    /// Mask of the rays that start on the triangle with this index.
    #[inline(always)]
    pub fn lanes_starting_on(&self, triangle: u32) -> u32 {
        V::movemask(self.start.eq(self.start.splat_like(f32::from_bits(triangle))))
    }

    /// A corner in each ray's sheared coordinates. `row` is the corner's first row.
    #[inline(always)]
    fn sheared_corner(&self, pack: &TrianglePack, row: usize, lane: usize) -> [V; 3] {
        let z = self.relative_coordinate(pack, row, 2, lane);
        let x = self.relative_coordinate(pack, row, 0, lane) - self.shear[0] * z;
        let y = self.relative_coordinate(pack, row, 1, lane) - self.shear[1] * z;
        [x, y, z]
    }

    #[inline(always)]
    fn relative_coordinate(&self, pack: &TrianglePack, row: usize, i: usize, lane: usize) -> V {
        let axis = self.axes[i] % 3;
        self.shear[0].splat_like(pack.rows[row + axis][lane]) - self.sheared_origin[i]
    }
}
