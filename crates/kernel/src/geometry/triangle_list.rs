//! Brute-force intersection of ray packets with a few triangles, such as the walls of a room, for any ray
//! directions.
//!
//! Running the watertight test on every triangle and ray would be exact but slow. Instead, the planes of all
//! facets are intersected in single precision to find each ray's nearest candidate, with conservative bounds
//! on all errors. Two triangles that form a flat quadrilateral are a single facet. The watertight test is
//! then run on each ray's nearest candidate. If the hit is not guaranteed to be nearer than the other
//! candidates, the ray is undecided, which is rare and happens near edges. Decided results are therefore
//! bit-identical to tracing each ray separately.
//!
//! Notation for the bounds: ε is the unit roundoff, d a ray's direction, n a plane's unit normal, M the
//! largest coordinate of origins and corners, and R the largest distance along an axis from the ray's origin
//! to any corner. 2A is twice the area of a facet's smaller triangle, and D is that triangle's longest edge.
//!
//! - The intersection with a plane has an error of less than 128 ε M/|n·d| in t: rounding n and n·p
//!   contributes 20, n·d over a distance of 3.5 M contributes 28, and the other triangle of a quadrilateral
//!   4.
//! - If the ray passes a triangle within a quarter of its size, the sheared corners in the watertight test
//!   are within 3 D. Its error in t is therefore less than ε (972 D + 180 R) R D/(2A |n·d|) (*Physically
//!   Based Rendering*, 4th ed., section 6.8.7), where the determinant is 2A |n·d| over the direction's
//!   longest component. Another D times the error of the barycentric coordinates covers hits on needles,
//!   which may be moved to the nearest edge.
//! - Barycentric coordinates of a triangle at a distance of X have an error of less than 204 ε R X |d|/(2A
//!   |n·d|). A ray that passes with a coordinate of −m has X < 2 D (1 + 2 m). It is therefore certain to miss
//!   if m is above 544 ε R D |d|/(2A |n·d|), provided that this bound is small.
//! - A ray is certain to miss, even at grazing angles, if it stays farther from the plane than the sum of the
//!   first two bounds times |n·d|.

use super::packet::{F32x16, HitPacket, PACKET_SIZE, RayPacket};
use super::watertight_packet::ShearedPacket;
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::lanes::{Mask, Simd, TRUE, select, select_u32, set_lane};
use crate::math::{DVec3, Vec3};

/// Maximum number of triangles in a [`BruteForceTriangles`].
pub const MAX_TRIANGLES: usize = 64;

/// Error of the intersection with a plane, relative to the largest coordinate.
const PLANE_ERROR: f32 = 128.0 * UNIT_ROUNDOFF;

/// Error terms of t in the watertight test, relative to R² D/(2A) and R D²/(2A).
const T_ERRORS: [f32; 2] = [256.0 * UNIT_ROUNDOFF, 2048.0 * UNIT_ROUNDOFF];

/// Error of barycentric coordinates in the watertight test, relative to R D/(2A).
const BARYCENTRIC_ERROR: f32 = 1024.0 * UNIT_ROUNDOFF;

/// Maximum coordinate error at which a miss is still certain.
const MAX_CERTAIN_ERROR: f32 = 0.125;

/// Maximum product of a triangle's D/(2A) and the extent of all triangles.
const MAX_SLENDERNESS: f64 = 1e3;

/// Placeholder index that excludes no triangle.
const NONE: u32 = u32::MAX;

/// A triangle, or two triangles that form a flat quadrilateral.
#[derive(Clone, Copy, Debug)]
struct TriangleOrQuad {
    /// Unit normal.
    normal: Vec3,
    /// Dot product of the normal and a point on the plane.
    offset: f32,
    /// Vectors whose dot products with a point, plus `start`, are the point's coordinates. Coordinates
    /// increase by 1 along the edges from the first corner of the first triangle, and are centered between
    /// their minimum and maximum.
    across: [Vec3; 2],
    start: [f32; 2],
    /// Largest absolute values of the centered coordinates.
    half: [f32; 2],
    /// Sum of the coordinates on the edge opposite the first corner, and the maximum by which the sum may
    /// exceed this value.
    diagonal: f32,
    beyond: f32,
    /// Distance of the sum from `diagonal`, in error margins, above which it is certain which triangle is
    /// hit. Negative if there is only one triangle.
    split: f32,
    /// Index of the triangle where the sum of the coordinates is below `diagonal`, and index of the other
    /// triangle. The two indices are equal if there is only one triangle.
    numbers: [u32; 2],
    /// D/(2A), which is at least the length of both vectors in `across`.
    slender: f32,
    /// [`T_ERRORS`] times D/(2A), and [`T_ERRORS`] times D.
    along: [f32; 2],
}

/// The triangles of a small scene.
#[derive(Debug)]
pub struct BruteForceTriangles {
    facets: Vec<TriangleOrQuad>,
    corners: Vec<[Vec3; 3]>,
    /// Bounding box.
    low: Vec3,
    high: Vec3,
}

/// Nearest candidate for each ray in a packet.
struct NearestCandidates {
    /// Lower bound on t of the nearest candidate; ∞ if there is none.
    near: F32x16,
    /// Triangle index of the nearest candidate.
    number: [u32; PACKET_SIZE],
    /// Lower bound on t of all other candidates.
    next: F32x16,
    /// Mask of the rays whose candidates are uncertain.
    doubtful: Mask,
}

/// Error terms for the rays in a packet.
struct ErrorTerms {
    /// Error term with the factor [`PLANE_ERROR`] for each ray.
    plane: F32x16,
    /// R: largest distance along an axis from the ray's origin to a corner.
    far: F32x16,
    /// Error term with the factors [`PLANE_ERROR`] and [`BARYCENTRIC_ERROR`] for each ray, without the ray's
    /// length and D/(2A).
    across: F32x16,
    /// Upper bound on the length of the direction.
    length: F32x16,
    /// Upper bound on t of a hit on any triangle.
    end: F32x16,
}

impl BruteForceTriangles {
    /// Prepares triangles for brute-force tests. Returns `None` if there are too many, if one is too slender
    /// for the error bounds, or if their coordinates or extent are out of range.
    pub fn new(corners: Vec<[Vec3; 3]>) -> Option<Self> {
        let points = || corners.iter().flatten().copied();
        let (low, high) = (points().reduce(Vec3::min)?, points().reduce(Vec3::max)?);
        let size = (high - low).max_element();
        let is_fit = |of: &[Vec3; 3]| slenderness(of)[0] * f64::from(size) <= MAX_SLENDERNESS;
        let is_finite = size.is_finite() && size > 1e-9 && low.abs().max(high.abs()).max_element() < 1e9;
        if corners.len() > MAX_TRIANGLES || !is_finite || !corners.iter().all(is_fit) {
            return None;
        }
        let reach = low.abs().max(high.abs()).max_element();
        let (mut facets, mut is_left) = (Vec::new(), vec![true; corners.len()]);
        for number in 0..corners.len() {
            if !std::mem::replace(&mut is_left[number], false) {
                continue;
            }
            let other = (number + 1..corners.len()).find_map(|other| {
                let pair = is_left[other]
                    .then(|| reorder_triangle_pair_as_quad(&corners[number], &corners[other], reach))??;
                Some((other, pair))
            });
            facets.push(match other {
                Some((other, [first, [.., apex]])) => {
                    is_left[other] = false;
                    let [one, two] = [slenderness(&corners[number]), slenderness(&corners[other])];
                    let most = [one[0].max(two[0]), one[1].max(two[1])];
                    let numbers = [number as u32, other as u32];
                    TriangleOrQuad::from_triangle_and_apex(&first, Some(apex), numbers, most)
                }
                None => {
                    let own = &corners[number];
                    TriangleOrQuad::from_triangle_and_apex(own, None, [number as u32; 2], slenderness(own))
                }
            });
        }
        Some(Self { facets, corners, low, high })
    }

    /// Updates `found` with the nearest hits of the rays in `active`. All other rays must have negative ends.
    /// Returns the mask of undecided rays, whose hits are left unchanged.
    #[inline(always)]
    pub fn update_decided_closest_hits(
        &self,
        rays: &RayPacket,
        (active, ends): (u32, &F32x16),
        found: &mut HitPacket,
        simd: impl Simd,
    ) -> u32 {
        let candidates = self.find_nearest_candidate_per_ray(rays, ends, &[NONE; PACKET_SIZE], simd);
        let NearestCandidateTestResults { hit, undecided, hits } =
            self.test_nearest_candidate_per_ray(rays, &candidates, (active, ends), simd);
        select(&hit, &hits.t, &mut found.t);
        select(&hit, &hits.u, &mut found.u);
        select(&hit, &hits.v, &mut found.v);
        select_u32(&hit, &candidates.number, &mut found.primitive);
        undecided
    }

    /// Returns the mask of the rays in `active` that hit any triangle other than the ray's entry in `except`,
    /// and the mask of undecided rays. All other rays must have negative ends.
    #[inline(always)]
    pub fn any_hit_and_undecided_masks(
        &self,
        rays: &RayPacket,
        (active, ends): (u32, &F32x16),
        except: &[u32; PACKET_SIZE],
        simd: impl Simd,
    ) -> [u32; 2] {
        let candidates = self.find_nearest_candidate_per_ray(rays, ends, except, simd);
        let mut may_hit = candidates.doubtful;
        for i in 0..PACKET_SIZE {
            may_hit[i] |= if candidates.near[i] < f32::INFINITY { TRUE } else { 0 };
        }
        if simd.movemask(&may_hit) & active == 0 {
            return [0; 2];
        }
        let NearestCandidateTestResults { hit, undecided, .. } =
            self.test_nearest_candidate_per_ray(rays, &candidates, (active, ends), simd);
        [simd.movemask(&hit) & active, undecided]
    }

    /// Finds the nearest candidates. Excludes each ray's start triangle and its triangle in `except`.
    #[inline(always)]
    fn find_nearest_candidate_per_ray(
        &self,
        rays: &RayPacket,
        ends: &F32x16,
        except: &[u32; PACKET_SIZE],
        simd: impl Simd,
    ) -> NearestCandidates {
        let ErrorTerms { plane, far, across, length, end } = self.error_terms_for_rays(rays);
        let mut found = NearestCandidates {
            near: [f32::INFINITY; PACKET_SIZE],
            number: [0; PACKET_SIZE],
            next: [f32::INFINITY; PACKET_SIZE],
            doubtful: [0; PACKET_SIZE],
        };
        let [ox, oy, oz] = &rays.origin;
        let [dx, dy, dz] = &rays.direction;
        for facet in &self.facets {
            let TriangleOrQuad {
                normal, offset, across: [first, second], start, half, diagonal, beyond, ..
            } = *facet;
            let (slender, along, split) = (facet.slender, facet.along, facet.split);
            // Select with bit operations. Otherwise, compilers would select between two addresses lane by
            // lane.
            let [one, other] = facet.numbers;
            let between = one ^ other;
            for i in 0..PACKET_SIZE {
                // Intersect the plane.
                let above = simd.mul_add_relaxed(-normal.x, ox[i], offset);
                let above = simd.mul_add_relaxed(-normal.y, oy[i], above);
                let above = simd.mul_add_relaxed(-normal.z, oz[i], above);
                let falls = simd.mul_add_relaxed(
                    normal.x,
                    dx[i],
                    simd.mul_add_relaxed(normal.y, dy[i], normal.z * dz[i]),
                );
                let inverse = 1.0 / falls;
                let t = above * inverse;
                let x = simd.mul_add_relaxed(dx[i], t, ox[i]);
                let y = simd.mul_add_relaxed(dy[i], t, oy[i]);
                let z = simd.mul_add_relaxed(dz[i], t, oz[i]);
                let u = simd.mul_add_relaxed(
                    first.x,
                    x,
                    simd.mul_add_relaxed(first.y, y, simd.mul_add_relaxed(first.z, z, start[0])),
                );
                let v = simd.mul_add_relaxed(
                    second.x,
                    x,
                    simd.mul_add_relaxed(second.y, y, simd.mul_add_relaxed(second.z, z, start[1])),
                );
                // Compute bounds on the errors.
                let size = inverse.abs();
                let distance =
                    simd.mul_add_relaxed(far[i], simd.mul_add_relaxed(far[i], along[0], along[1]), plane[i]);
                let error = distance * size;
                let margin = slender * simd.mul_add_relaxed(size * length[i], across[i], plane[i]);
                // A facet that the ray may hit is a candidate. A NaN bound must not exclude it.
                let least = t - error;
                let over = u + v - diagonal;
                let is_outside = (u.abs() > half[0] + margin)
                    | (v.abs() > half[1] + margin)
                    | (over > simd.mul_add_relaxed(2.0, margin, beyond))
                    | (t + error < 0.0)
                    | (least > ends[i]);
                let is_far = above.abs() > simd.mul_add_relaxed(falls.abs(), end[i], distance);
                let is_sharp = margin < MAX_CERTAIN_ERROR;
                // Decide which of the facet's triangles is hit.
                let number = other ^ (between & if over < 0.0 { TRUE } else { 0 });
                let is_sure = is_sharp & (over.abs() > split * margin);
                let is_left_out = is_sure & ((rays.start[i] == number) | (except[i] == number));
                let is_candidate = !(is_far | is_outside & is_sharp | is_left_out);
                // Keep the nearest candidate.
                let (near, next, nearest) = (found.near[i], found.next[i], found.number[i]);
                let least = if is_candidate { least } else { f32::INFINITY };
                let is_nearer = least < near;
                let farther = if is_nearer { near } else { least };
                found.next[i] = if farther < next { farther } else { next };
                found.near[i] = if is_nearer { least } else { near };
                found.number[i] = if is_nearer { number } else { nearest };
                found.doubtful[i] |= if is_candidate & !is_sure { TRUE } else { 0 };
            }
        }
        found
    }

    /// Tests each ray against its nearest candidate.
    #[inline(always)]
    fn test_nearest_candidate_per_ray(
        &self,
        rays: &RayPacket,
        candidates: &NearestCandidates,
        (active, ends): (u32, &F32x16),
        simd: impl Simd,
    ) -> NearestCandidateTestResults {
        let mut corners = [[[0.0; PACKET_SIZE]; 3]; 3];
        for i in 0..PACKET_SIZE {
            let own = &self.corners[candidates.number[i] as usize];
            for corner in 0..3 {
                set_lane(&mut corners[corner], i, own[corner]);
            }
        }
        let [a, b, c] = &corners;
        let hits = ShearedPacket::new(rays).intersect_triangles_per_ray(&candidates.number, [a, b, c], ends);
        let (mut hit, mut undecided) = ([0; PACKET_SIZE], [0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let is_any = candidates.near[i] < f32::INFINITY;
            let is_hit = (hits.hit[i] != 0) & is_any & (candidates.doubtful[i] == 0);
            let is_nearest = is_hit & (hits.t[i] < candidates.next[i]);
            // Other candidates matter only if they may be hit before the ray's end.
            let has_others = candidates.next[i] <= ends[i];
            let is_open = is_any & !is_nearest & (has_others | (hits.doubtful[i] != 0));
            hit[i] = if is_nearest { TRUE } else { 0 };
            undecided[i] = if is_open | (candidates.doubtful[i] != 0) { TRUE } else { 0 };
        }
        NearestCandidateTestResults { hit, undecided: simd.movemask(&undecided) & active, hits }
    }

    /// Computes the error terms for the rays.
    #[inline(always)]
    fn error_terms_for_rays(&self, rays: &RayPacket) -> ErrorTerms {
        let none = [0.0; PACKET_SIZE];
        let mut errors = ErrorTerms { plane: none, far: none, across: none, length: none, end: none };
        for i in 0..PACKET_SIZE {
            let (mut most, mut far, mut length) = (0.0, 0.0, 0.0);
            for axis in 0..3 {
                let (at, low, high) = (rays.origin[axis][i], self.low[axis], self.high[axis]);
                most = max_or_first_if_nan(
                    most,
                    max_or_first_if_nan(at.abs(), max_or_first_if_nan(low.abs(), high.abs())),
                );
                far = max_or_first_if_nan(far, max_or_first_if_nan((high - at).abs(), (at - low).abs()));
                length += rays.direction[axis][i].abs();
            }
            // Set the bound to NaN for NaN origins. Comparisons with NaN would leave `most` unchanged.
            let sum = rays.origin[0][i] + rays.origin[1][i] + rays.origin[2][i];
            let most = if sum.is_nan() { f32::NAN } else { most };
            errors.plane[i] = PLANE_ERROR * most;
            errors.far[i] = far;
            errors.across[i] = PLANE_ERROR * most + BARYCENTRIC_ERROR * far;
            errors.length[i] = length;
            // Distances are at most 2√3 R, and `length` is at most √3 times the direction's length.
            errors.end[i] = 6.0 * far / length;
        }
        errors
    }

    /// Memory used, in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.facets) + size_of_val(&*self.corners)
    }
}

/// Results of the watertight test on each ray's nearest candidate.
struct NearestCandidateTestResults {
    /// Rays that are certain to hit their candidate before any other candidate.
    hit: Mask,
    /// Mask of the undecided rays.
    undecided: u32,
    hits: super::watertight_packet::TriangleTestResults,
}

impl TriangleOrQuad {
    fn from_triangle_and_apex(
        [a, b, c]: &[Vec3; 3],
        apex: Option<Vec3>,
        numbers: [u32; 2],
        [slender, wide]: [f64; 2],
    ) -> Self {
        let [a, b, c] = [a, b, c].map(|corner| corner.as_dvec3());
        let (u, v) = (b - a, c - a);
        let normal = u.cross(v);
        let squared = normal.length_squared();
        let across = [v.cross(normal) / squared, normal.cross(u) / squared];
        // Center the coordinates.
        let (mut low, mut high, mut beyond) = ([0.0; 2], [1.0_f64; 2], 0.0);
        if let Some(apex) = apex {
            let along = across.map(|across| across.dot(apex.as_dvec3() - a));
            for axis in 0..2 {
                low[axis] = along[axis].min(0.0);
                high[axis] = along[axis].max(1.0);
            }
            beyond = along[0] + along[1] - 1.0;
        }
        let middle = [0, 1].map(|axis| (low[axis] + high[axis]) / 2.0);
        let unit = normal.normalize();
        Self {
            normal: unit.as_vec3(),
            offset: unit.dot(a) as f32,
            across: across.map(|across| across.as_vec3()),
            start: [0, 1].map(|axis| (-across[axis].dot(a) - middle[axis]) as f32),
            half: [0, 1].map(|axis| ((high[axis] - low[axis]) / 2.0) as f32),
            diagonal: (1.0 - middle[0] - middle[1]) as f32,
            beyond: beyond as f32,
            split: if apex.is_some() { 2.0 } else { -1.0 },
            numbers,
            slender: slender as f32,
            along: [T_ERRORS[0] * slender as f32, T_ERRORS[1] * wide as f32],
        }
    }
}

/// Reorders the corners of two triangles that form a flat quadrilateral close to a parallelogram. The first
/// triangle's outer corner becomes its first corner, and the second triangle's outer corner becomes its last.
/// Returns `None` for other triangles.
fn reorder_triangle_pair_as_quad(one: &[Vec3; 3], other: &[Vec3; 3], reach: f32) -> Option<[[Vec3; 3]; 2]> {
    let apart = |of: &[Vec3; 3], from: &[Vec3; 3]| {
        let mut own = (0..3).filter(|&i| !from.contains(&of[i]));
        own.next().filter(|_| own.next().is_none())
    };
    let (first, last) = (apart(one, other)?, apart(other, one)?);
    let [a, b, c] = [0, 1, 2].map(|i| one[(first + i) % 3]);
    let d = other[last];
    let [origin, far_b, far_c, apex] = [a, b, c, d].map(|corner| corner.as_dvec3());
    let (u, v, way) = (far_b - origin, far_c - origin, apex - origin);
    let normal = u.cross(v);
    let squared = normal.length_squared();
    let at = [v.cross(normal), normal.cross(u)].map(|across| across.dot(way) / squared);
    let is_flat = normal.dot(way).abs() <= f64::from(MAX_PLANE_DISTANCE * reach) * squared.sqrt();
    let is_near = at.iter().all(|along| (along - 1.0).abs() <= MAX_CORNER_DEVIATION);
    (is_flat && is_near).then_some([[a, b, c], [b, c, d]])
}

/// Maximum distance of the fourth corner of a flat quadrilateral from the plane of the other three, relative
/// to the largest coordinate.
const MAX_PLANE_DISTANCE: f32 = 4.0 * UNIT_ROUNDOFF;

/// Maximum deviation of the fourth corner from a parallelogram, relative to the edges.
const MAX_CORNER_DEVIATION: f64 = 0.25;

/// D/(2A) and D²/(2A) of a triangle.
fn slenderness([a, b, c]: &[Vec3; 3]) -> [f64; 2] {
    let [a, b, c]: [DVec3; 3] = [a, b, c].map(|corner| corner.as_dvec3());
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let slender = longest / (b - a).cross(c - a).length();
    [slender, slender * longest]
}

/// The larger number, or `a` if either is NaN.
#[inline(always)]
fn max_or_first_if_nan(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}
