//! A ray broadcast to SIMD registers. Preprocessing is branchless because the signs of random rays are
//! unpredictable.

use std::arch::x86_64::*;

use super::triangle::{self, TriangleHits};
use super::vector::{SimdF32x4, SimdF32x8, SimdVector};
use crate::accel::wide_bvh::node::{TrianglePack, WideNode};
use crate::geometry::aabb::{FAR_PAD, TRIANGLE_ERROR};
use crate::geometry::{Aabb, Ray};

/// Minimum absolute direction component, as a fraction of the largest component.
const MIN_RELATIVE_COMPONENT: f32 = 1.0 / (1_u64 << 40) as f32;

/// A ray preprocessed for testing the boxes in nodes and the triangles in packs.
pub struct SimdRay {
    /// Inverse direction.
    to_near: [SimdF32x8; 3],
    /// Inverse direction, padded so that no distance to a far plane is too short.
    to_far: [SimdF32x8; 3],
    /// Origins for near and far planes, offset by the margin and multiplied by the inverse direction.
    from_near: [SimdF32x8; 3],
    from_far: [SimdF32x8; 3],
    /// For each axis, the row of a node that contains the near planes.
    near: [usize; 3],
    /// Origin, with coordinates in the axis order of the sheared ray.
    origin: [SimdF32x4; 3],
    shear: [SimdF32x4; 3],
    axes: [usize; 3],
    /// [`Ray::start`].
    start: u32,
}

/// Axes of a sheared ray, indexed by whether |x| > |y|, |x| > |z|, and |y| > |z| for its direction, and by
/// the signs of x, y, and z. See `ShearedRay::new`.
const AXES: [[i32; 4]; 64] = {
    let mut table = [[0; 4]; 64];
    let mut case = 0;
    while case < 64 {
        let (x_over_y, x_over_z, y_over_z) = (case & 1 != 0, case & 2 != 0, case & 4 != 0);
        let z = if x_over_y {
            if x_over_z { 0 } else { 2 }
        } else if y_over_z {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        table[case] = if case & 8 << z != 0 { [y, x, z, z] } else { [x, y, z, z] };
        case += 1;
    }
    table
};

/// Loads the origin and the direction of a ray. The last lane of each contains the next float in memory.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn load_origin_and_direction(ray: &Ray) -> (__m128, __m128) {
    const _: () = assert!(size_of::<Ray>() == 32 && std::mem::offset_of!(Ray, direction) == 12);
    let floats: *const f32 = std::ptr::from_ref(ray).cast();
    // SAFETY: reads floats 0–3 and 3–6 of a ray's seven floats.
    unsafe { (_mm_loadu_ps(floats), _mm_loadu_ps(floats.add(3))) }
}

/// Whether the ray is finite and its direction is nonzero.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub fn is_traceable(ray: &Ray) -> bool {
    let (origin, direction) = load_origin_and_direction(ray);
    let unsigned = _mm_castsi128_ps(_mm_set1_epi32(i32::MAX));
    let (origin, direction) = (_mm_and_ps(origin, unsigned), _mm_and_ps(direction, unsigned));
    let finite = _mm_and_ps(
        _mm_cmplt_ps(origin, _mm_set1_ps(f32::INFINITY)),
        _mm_cmplt_ps(direction, _mm_set1_ps(f32::INFINITY)),
    );
    let goes = _mm_cmplt_ps(_mm_setzero_ps(), direction);
    _mm_movemask_ps(finite) & 0b111 == 0b111 && _mm_movemask_ps(goes) & 0b111 != 0
}

/// Loads both corners of a box. The last lane of each contains an unrelated float.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn load_box_min_and_max(bounds: &Aabb) -> (__m128, __m128) {
    const _: () = assert!(size_of::<Aabb>() == 24 && std::mem::offset_of!(Aabb, max) == 12);
    let floats: *const f32 = std::ptr::from_ref(bounds).cast();
    // SAFETY: reads the first four and the last four of a box's six floats.
    let (min, max) = unsafe { (_mm_loadu_ps(floats), _mm_loadu_ps(floats.add(2))) };
    (min, _mm_permute_ps::<0b00_11_10_01>(max))
}

/// Mask of the lanes that are ∞ or −∞.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn infinite_lane_mask(v: __m128) -> __m128 {
    let unsigned = _mm_and_ps(v, _mm_castsi128_ps(_mm_set1_epi32(i32::MAX)));
    _mm_cmpeq_ps(unsigned, _mm_set1_ps(f32::INFINITY))
}

/// Broadcasts the maximum of the first three lanes, which must be nonnegative.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn broadcast_max_of_xyz(v: __m128) -> __m128 {
    let v = _mm_max_ps(v, _mm_permute_ps::<0b11_01_00_10>(v));
    _mm_permute_ps::<0>(_mm_max_ps(v, _mm_permute_ps::<0b01>(v)))
}

/// Broadcasts each of the first three lanes to eight lanes.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn broadcast_xyz_to_eight(v: __m128) -> [SimdF32x8; 3] {
    let [x, y, z] = broadcast_xyz_to_four(v);
    [
        SimdF32x8(_mm256_broadcastss_ps(x.0)),
        SimdF32x8(_mm256_broadcastss_ps(y.0)),
        SimdF32x8(_mm256_broadcastss_ps(z.0)),
    ]
}

/// Broadcasts each of the first three lanes to four lanes.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn broadcast_xyz_to_four(v: __m128) -> [SimdF32x4; 3] {
    [
        SimdF32x4(_mm_permute_ps::<0x00>(v)),
        SimdF32x4(_mm_permute_ps::<0x55>(v)),
        SimdF32x4(_mm_permute_ps::<0xaa>(v)),
    ]
}

impl SimdRay {
    /// Preprocesses a ray for testing triangles inside the box `whole`.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    pub fn new(ray: &Ray, whole: &Aabb) -> Self {
        let (origin, direction) = load_origin_and_direction(ray);
        let (min, max) = load_box_min_and_max(whole);
        let unsigned = _mm_castsi128_ps(_mm_set1_epi32(i32::MAX));
        // Margin between boxes and their triangles: `triangle_margin`, plus the additional error of fused
        // products.
        let below = _mm_and_ps(_mm_sub_ps(min, origin), unsigned);
        let above = _mm_and_ps(_mm_sub_ps(max, origin), unsigned);
        let farthest = broadcast_max_of_xyz(_mm_max_ps(below, above));
        let margin = _mm_mul_ps(farthest, _mm_set1_ps(TRIANGLE_ERROR));
        let reach = _mm_add_ps(margin, _mm_mul_ps(_mm_and_ps(origin, unsigned), _mm_set1_ps(f32::EPSILON)));
        // Prepare the box tests. Near-zero direction components are increased slightly, which moves the ray
        // by less than the margin inside the boxes. This keeps the inverse finite unless the direction is
        // extremely short.
        let size = _mm_and_ps(direction, unsigned);
        let least = _mm_mul_ps(broadcast_max_of_xyz(size), _mm_set1_ps(MIN_RELATIVE_COMPONENT));
        let moving = _mm_or_ps(_mm_max_ps(size, least), _mm_andnot_ps(unsigned, direction));
        let inverse = _mm_div_ps(_mm_set1_ps(1.0), moving);
        let is_down = _mm_cmplt_ps(inverse, _mm_setzero_ps());
        let (before, after) = (_mm_sub_ps(origin, reach), _mm_add_ps(origin, reach));
        let padded = _mm_mul_ps(inverse, _mm_set1_ps(FAR_PAD));
        let downs = _mm_movemask_ps(is_down) as usize;
        // Prepare the triangle tests.
        let larger = _mm_cmplt_ps(_mm_permute_ps::<0b10_10_01>(size), _mm_permute_ps::<0b01_00_00>(size));
        let signs = _mm_movemask_ps(_mm_cmplt_ps(direction, _mm_setzero_ps())) as usize;
        let axes = &AXES[(_mm_movemask_ps(larger) as usize & 7) | (signs & 7) << 3];
        // SAFETY: reads four numbers.
        let places = unsafe { _mm_loadu_si128(axes.as_ptr().cast()) };
        let scale = _mm_permute_ps::<0xaa>(_mm_permutevar_ps(inverse, places));
        let shear = _mm_mul_ps(_mm_permutevar_ps(direction, places), scale);
        let [shear_x, shear_y, _] = broadcast_xyz_to_four(shear);
        // Ignore the planes of an axis if the arithmetic overflows.
        let (endless, minus_endless) = (_mm_set1_ps(f32::INFINITY), _mm_set1_ps(f32::NEG_INFINITY));
        let from_near = _mm_mul_ps(inverse, _mm_blendv_ps(after, before, is_down));
        let from_far = _mm_mul_ps(padded, _mm_blendv_ps(before, after, is_down));
        Self {
            from_near: broadcast_xyz_to_eight(_mm_blendv_ps(
                from_near,
                endless,
                infinite_lane_mask(from_near),
            )),
            from_far: broadcast_xyz_to_eight(_mm_blendv_ps(
                from_far,
                minus_endless,
                infinite_lane_mask(from_far),
            )),
            to_near: broadcast_xyz_to_eight(inverse),
            to_far: broadcast_xyz_to_eight(padded),
            near: [downs & 1, 2 + (downs >> 1 & 1), 4 + (downs >> 2 & 1)],
            origin: broadcast_xyz_to_four(_mm_permutevar_ps(origin, places)),
            shear: [shear_x, shear_y, SimdF32x4(scale)],
            axes: [axes[0] as usize, axes[1] as usize, axes[2] as usize],
            start: ray.start,
        }
    }

    /// Distances at which the ray enters the eight boxes, and the mask of the boxes that it hits before
    /// `end`. NaN distances do not affect the interval, as in `SlabRay::entry_distance`.
    #[inline(always)]
    pub fn box_entries(&self, node: &WideNode, end: SimdF32x8) -> (SimdF32x8, u32) {
        let (mut near, mut far) = (end.splat_like(0.0), end);
        for axis in 0..3 {
            // SAFETY: values of this type exist, so the processor has the instructions. Both rows exist: they
            // are a row with an even index and the next one.
            let (to_near, to_far) = unsafe {
                let row = node.rows.as_ptr().add(self.near[axis]);
                let other = node.rows.as_ptr().add(self.near[axis] ^ 1);
                (
                    SimdF32x8::load(row.cast()).mul_sub(self.to_near[axis], self.from_near[axis]),
                    SimdF32x8::load(other.cast()).mul_sub(self.to_far[axis], self.from_far[axis]),
                )
            };
            near = to_near.max(near);
            far = to_far.min(far);
        }
        (near, SimdF32x8::movemask(near.le(far)))
    }

    /// Tests the triangles of a pack, except the ray's start triangle.
    #[inline(always)]
    pub fn intersect_triangles(&self, pack: &TrianglePack, t_max: f32) -> TriangleHits<SimdF32x4> {
        let corners =
            [self.sheared_corner(pack, 0), self.sheared_corner(pack, 3), self.sheared_corner(pack, 6)];
        let hits = triangle::intersect(&corners, self.shear[2], self.shear[2].splat_like(t_max), true);
        let others = !self.start_triangle_lane_mask(pack);
        TriangleHits { hit: hits.hit & others, doubtful: hits.doubtful & others, ..hits }
    }

    /// Mask of the lane that contains the ray's start triangle.
    #[inline(always)]
    fn start_triangle_lane_mask(&self, pack: &TrianglePack) -> u32 {
        // SAFETY: values of `SimdF32x4` exist, so the processor has the instructions. Reads four numbers.
        unsafe {
            let ids = _mm_loadu_si128(pack.ids.as_ptr().cast());
            let is_own = _mm_cmpeq_epi32(ids, _mm_set1_epi32(self.start.cast_signed()));
            _mm_movemask_ps(_mm_castsi128_ps(is_own)) as u32
        }
    }

    /// One corner of each triangle, in the ray's coordinates. `row` is the corner's first row.
    #[inline(always)]
    fn sheared_corner(&self, pack: &TrianglePack, row: usize) -> [SimdF32x4; 3] {
        let z = self.relative_corner_coordinates(pack, row, 2);
        [
            self.relative_corner_coordinates(pack, row, 0) - self.shear[0] * z,
            self.relative_corner_coordinates(pack, row, 1) - self.shear[1] * z,
            z,
        ]
    }

    #[inline(always)]
    fn relative_corner_coordinates(&self, pack: &TrianglePack, row: usize, axis: usize) -> SimdF32x4 {
        // SAFETY: values of this type exist, so the processor has the instructions. There are nine rows,
        // `row` is 0, 3, or 6, and axes are less than 3.
        let row = unsafe { SimdF32x4::load(pack.rows.as_ptr().add(row + self.axes[axis]).cast()) };
        row - self.origin[axis]
    }
}
