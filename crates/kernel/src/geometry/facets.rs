//! Few triangles, such as the walls of a room, against the rays of a packet, whatever their directions.
//!
//! A watertight test of every triangle with every ray would be exact, but dear. So each ray first finds its nearest candidate: the
//! planes of all facets are cut in single precision, and what lies within a bound on all errors may be hit. Two triangles that make
//! a flat quadrilateral are one facet. Then each ray takes the watertight test of its own candidate. A ray whose hit is not certainly
//! nearer than its other candidates stays undecided; few do, near edges. So every ray gets the bits that it gets alone.
//!
//! Bounds, with the unit roundoff ε, the direction d of a ray, the unit normal n of a plane, the greatest coordinate M of origins and
//! corners, and R the greatest distance along an axis from the ray's origin to any corner; and of a facet's lesser triangle the
//! double area 2A and the longest edge D:
//!
//! - The cut of a plane errs by less than 128 ε M/|n·d| in t: rounding n and n·p takes 20, n·d over a way of 3.5 M takes 28, and
//!   the other triangle of a quadrilateral 4.
//! - The watertight test of a triangle that the ray passes within a quarter of its size has sheared corners within 3 D. So it errs
//!   in t by less than ε (972 D + 180 R) R D/(2A |n·d|) (*Physically Based Rendering*, 4th ed., section 6.8.7), where its determinant
//!   is 2A |n·d| over the direction's longest component. One more D times the error of barycentric coordinates makes up for hits of
//!   needles, which may be those of the nearest edge.
//! - Barycentric coordinates of a triangle at a distance of X err by less than 204 ε R X |d|/(2A |n·d|). A ray that passes with a
//!   coordinate of −m has X < 2 D (1 + 2 m), so that it misses for certain if m is above 544 ε R D |d|/(2A |n·d|), and that is small.
//! - A ray that stays farther from a plane than the first two bounds, times |n·d|, misses for certain, however flat it comes.

use super::rows::{Ends, HitRows, PACKET, RayRows, Row};
use super::watertight_rows::ShearedRows;
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::lanes::{Folds, TRUE, Truths, set_lane, take, take_u32};
use crate::math::{DVec3, Vec3};

/// Most triangles.
pub const MOST: usize = 64;

/// Error of the cut of a plane, by the greatest coordinate.
const PLANE: f32 = 128.0 * UNIT_ROUNDOFF;

/// Errors of t by the watertight test: by R² D/(2A), and by R D²/(2A).
const ALONG: [f32; 2] = [256.0 * UNIT_ROUNDOFF, 2048.0 * UNIT_ROUNDOFF];

/// Error of barycentric coordinates by the watertight test, by R D/(2A).
const ACROSS: f32 = 1024.0 * UNIT_ROUNDOFF;

/// Greatest error of coordinates at which a facet can be missed for certain.
const BLUNT: f32 = 0.125;

/// Most of D/(2A), by the size of all triangles.
const MOST_SLENDER: f64 = 1e3;

/// Number of no triangle.
const NONE: u32 = u32::MAX;

/// A triangle, or two that make a flat quadrilateral.
#[derive(Clone, Copy, Debug)]
struct Facet {
    /// Unit normal.
    normal: Vec3,
    /// Product of the normal and a point of the plane.
    offset: f32,
    /// Vectors whose products with a point, plus `start`, are its coordinates: 0 in the middle between the least and the greatest.
    /// Along the edges at the first corner of the first triangle, they grow by 1.
    across: [Vec3; 2],
    start: [f32; 2],
    /// Greatest coordinates.
    half: [f32; 2],
    /// Sum of the coordinates on the edge across from the first corner, and the most by which it may be exceeded.
    diagonal: f32,
    beyond: f32,
    /// Distance of the sum from `diagonal`, in margins, beyond which it is certain which triangle it is; below 0 if there is one.
    split: f32,
    /// Number of the triangle where the sum of the coordinates is below 1, and of that beyond; the same if there is one.
    numbers: [u32; 2],
    /// D/(2A), which is not less than the length of either vector of `across`.
    slender: f32,
    /// [`ALONG`] times D/(2A), and times D.
    along: [f32; 2],
}

/// Triangles of a small scene.
#[derive(Debug)]
pub struct Facets {
    facets: Vec<Facet>,
    corners: Vec<[Vec3; 3]>,
    /// The box around them.
    low: Vec3,
    high: Vec3,
}

/// Nearest candidates of the rays of a packet.
struct Candidates {
    /// Lower bound on t of the nearest candidate; infinite if there is none.
    near: Row,
    /// Its number.
    number: [u32; PACKET],
    /// Lower bound on t of the others.
    next: Row,
    /// Rays of which this tells nothing.
    doubtful: Truths,
}

/// The rays of a packet with the errors of their tests.
struct Errors {
    /// [`PLANE`], for each ray.
    plane: Row,
    /// R.
    far: Row,
    /// [`PLANE`] and [`ACROSS`], for each ray, but for its length and D/(2A).
    across: Row,
    /// Bound on the length of the direction.
    length: Row,
    /// Bound on t of a hit of any triangle.
    end: Row,
}

impl Facets {
    /// Facets of these triangles; `None` if there are too many, or one is too slender for the bounds.
    pub fn new(corners: Vec<[Vec3; 3]>) -> Option<Self> {
        let points = || corners.iter().flatten().copied();
        let (low, high) = (points().reduce(Vec3::min)?, points().reduce(Vec3::max)?);
        let size = (high - low).max_element();
        let is_fit = |of: &[Vec3; 3]| slender(of)[0] * f64::from(size) <= MOST_SLENDER;
        let is_finite = size.is_finite() && size > 1e-9 && low.abs().max(high.abs()).max_element() < 1e9;
        if corners.len() > MOST || !is_finite || !corners.iter().all(is_fit) {
            return None;
        }
        let reach = low.abs().max(high.abs()).max_element();
        let (mut facets, mut is_left) = (Vec::new(), vec![true; corners.len()]);
        for number in 0..corners.len() {
            if !std::mem::replace(&mut is_left[number], false) {
                continue;
            }
            let other = (number + 1..corners.len()).find_map(|other| {
                let pair = is_left[other].then(|| paired(&corners[number], &corners[other], reach))??;
                Some((other, pair))
            });
            facets.push(match other {
                Some((other, [first, [.., apex]])) => {
                    is_left[other] = false;
                    let [one, two] = [slender(&corners[number]), slender(&corners[other])];
                    let most = [one[0].max(two[0]), one[1].max(two[1])];
                    Facet::new(&first, Some(apex), [number as u32, other as u32], most)
                }
                None => {
                    let own = &corners[number];
                    Facet::new(own, None, [number as u32; 2], slender(own))
                }
            });
        }
        Some(Self { facets, corners, low, high })
    }

    /// Takes the nearest hits of the rays in `met`; the others end below 0. Returns a bit for each that is undecided, whose hit stays
    /// as it was.
    #[inline(always)]
    pub fn closest(
        &self,
        rays: &RayRows,
        (met, ends): (u32, &Ends),
        found: &mut HitRows,
        folds: impl Folds,
    ) -> u32 {
        let candidates = self.candidates(rays, ends, &[NONE; PACKET], folds);
        let Tested { hit, undecided, hits } = self.test(rays, &candidates, (met, ends), folds);
        take(&hit, &hits.t, &mut found.t);
        take(&hit, &hits.u, &mut found.u);
        take(&hit, &hits.v, &mut found.v);
        take_u32(&hit, &candidates.number, &mut found.primitive);
        undecided
    }

    /// A bit for each ray in `met` that hits any triangle but its own of `except`, and one for each that is undecided; the others
    /// end below 0.
    #[inline(always)]
    pub fn any(
        &self,
        rays: &RayRows,
        (met, ends): (u32, &Ends),
        except: &[u32; PACKET],
        folds: impl Folds,
    ) -> [u32; 2] {
        let candidates = self.candidates(rays, ends, except, folds);
        let mut is_met = candidates.doubtful;
        for i in 0..PACKET {
            is_met[i] |= if candidates.near[i] < f32::INFINITY { TRUE } else { 0 };
        }
        if folds.bits(&is_met) & met == 0 {
            return [0; 2];
        }
        let Tested { hit, undecided, .. } = self.test(rays, &candidates, (met, ends), folds);
        [folds.bits(&hit) & met, undecided]
    }

    /// The nearest candidates; never the triangle on which a ray starts, nor that of `except`.
    #[inline(always)]
    fn candidates(
        &self,
        rays: &RayRows,
        ends: &Ends,
        except: &[u32; PACKET],
        folds: impl Folds,
    ) -> Candidates {
        let Errors { plane, far, across, length, end } = self.errors(rays);
        let mut found = Candidates {
            near: [f32::INFINITY; PACKET],
            number: [0; PACKET],
            next: [f32::INFINITY; PACKET],
            doubtful: [0; PACKET],
        };
        let [ox, oy, oz] = &rays.origin;
        let [dx, dy, dz] = &rays.direction;
        for facet in &self.facets {
            let Facet { normal, offset, across: [first, second], start, half, diagonal, beyond, .. } = *facet;
            let (slender, along, split) = (facet.slender, facet.along, facet.split);
            // By bits, as compilers would choose between two places in memory, one lane after the other.
            let [one, other] = facet.numbers;
            let between = one ^ other;
            for i in 0..PACKET {
                // Cut the plane.
                let above = folds.about(-normal.x, ox[i], offset);
                let above = folds.about(-normal.y, oy[i], above);
                let above = folds.about(-normal.z, oz[i], above);
                let falls = folds.about(normal.x, dx[i], folds.about(normal.y, dy[i], normal.z * dz[i]));
                let inverse = 1.0 / falls;
                let t = above * inverse;
                let x = folds.about(dx[i], t, ox[i]);
                let y = folds.about(dy[i], t, oy[i]);
                let z = folds.about(dz[i], t, oz[i]);
                let u = folds.about(first.x, x, folds.about(first.y, y, folds.about(first.z, z, start[0])));
                let v =
                    folds.about(second.x, x, folds.about(second.y, y, folds.about(second.z, z, start[1])));
                // Bound the errors.
                let size = inverse.abs();
                let distance = folds.about(far[i], folds.about(far[i], along[0], along[1]), plane[i]);
                let error = distance * size;
                let margin = slender * folds.about(size * length[i], across[i], plane[i]);
                // A facet that the ray may hit is a candidate, also if a bound is NaN.
                let least = t - error;
                let over = u + v - diagonal;
                let is_outside = (u.abs() > half[0] + margin)
                    | (v.abs() > half[1] + margin)
                    | (over > folds.about(2.0, margin, beyond))
                    | (t + error < 0.0)
                    | (least > ends[i]);
                let is_far = above.abs() > folds.about(falls.abs(), end[i], distance);
                let is_sharp = margin < BLUNT;
                // Decide which of the two triangles it is.
                let number = other ^ (between & if over < 0.0 { TRUE } else { 0 });
                let is_sure = is_sharp & (over.abs() > split * margin);
                let is_left_out = is_sure & ((rays.start[i] == number) | (except[i] == number));
                let is_candidate = !(is_far | is_outside & is_sharp | is_left_out);
                // Keep the nearest.
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

    /// Tests each ray with its nearest candidate.
    #[inline(always)]
    fn test(
        &self,
        rays: &RayRows,
        candidates: &Candidates,
        (met, ends): (u32, &Ends),
        folds: impl Folds,
    ) -> Tested {
        let mut corners = [[[0.0; PACKET]; 3]; 3];
        for i in 0..PACKET {
            let own = &self.corners[candidates.number[i] as usize];
            for corner in 0..3 {
                set_lane(&mut corners[corner], i, own[corner]);
            }
        }
        let [a, b, c] = &corners;
        let hits = ShearedRows::new(rays).hits(&candidates.number, [a, b, c], ends);
        let (mut hit, mut undecided) = ([0; PACKET], [0; PACKET]);
        for i in 0..PACKET {
            let is_any = candidates.near[i] < f32::INFINITY;
            let is_hit = (hits.hit[i] != 0) & is_any & (candidates.doubtful[i] == 0);
            let is_nearest = is_hit & (hits.t[i] < candidates.next[i]);
            // Other candidates count if they may be hit before the end.
            let has_others = candidates.next[i] <= ends[i];
            let is_open = is_any & !is_nearest & (has_others | (hits.doubtful[i] != 0));
            hit[i] = if is_nearest { TRUE } else { 0 };
            undecided[i] = if is_open | (candidates.doubtful[i] != 0) { TRUE } else { 0 };
        }
        Tested { hit, undecided: folds.bits(&undecided) & met, hits }
    }

    /// The errors of tests of the rays.
    #[inline(always)]
    fn errors(&self, rays: &RayRows) -> Errors {
        let none = [0.0; PACKET];
        let mut errors = Errors { plane: none, far: none, across: none, length: none, end: none };
        for i in 0..PACKET {
            let (mut most, mut far, mut length) = (0.0, 0.0, 0.0);
            for axis in 0..3 {
                let (at, low, high) = (rays.origin[axis][i], self.low[axis], self.high[axis]);
                most = greater(most, greater(at.abs(), greater(low.abs(), high.abs())));
                far = greater(far, greater((high - at).abs(), (at - low).abs()));
                length += rays.direction[axis][i].abs();
            }
            // For an origin of NaN there is no bound; comparisons with it would leave `most` as it was.
            let sum = rays.origin[0][i] + rays.origin[1][i] + rays.origin[2][i];
            let most = if sum.is_nan() { f32::NAN } else { most };
            errors.plane[i] = PLANE * most;
            errors.far[i] = far;
            errors.across[i] = PLANE * most + ACROSS * far;
            errors.length[i] = length;
            // The way is 2√3 R, and `length` at most √3 times that of the direction.
            errors.end[i] = 6.0 * far / length;
        }
        errors
    }

    /// Bytes that they take.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.facets) + size_of_val(&*self.corners)
    }
}

/// Results of the watertight tests of candidates.
struct Tested {
    /// Rays that certainly hit their candidate before all others.
    hit: Truths,
    /// A bit for each ray that is undecided.
    undecided: u32,
    hits: super::watertight_rows::Hits,
}

impl Facet {
    fn new([a, b, c]: &[Vec3; 3], apex: Option<Vec3>, numbers: [u32; 2], [slender, wide]: [f64; 2]) -> Self {
        let [a, b, c] = [a, b, c].map(|corner| corner.as_dvec3());
        let (u, v) = (b - a, c - a);
        let normal = u.cross(v);
        let squared = normal.length_squared();
        let across = [v.cross(normal) / squared, normal.cross(u) / squared];
        // Take the middle of the coordinates as their 0.
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
            along: [ALONG[0] * slender as f32, ALONG[1] * wide as f32],
        }
    }
}

/// Two triangles that make a flat quadrilateral, near a parallelogram: both with the corners of the common edge in the middle and
/// their own at the ends.
fn paired(one: &[Vec3; 3], other: &[Vec3; 3], reach: f32) -> Option<[[Vec3; 3]; 2]> {
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
    let is_flat = normal.dot(way).abs() <= f64::from(FLAT * reach) * squared.sqrt();
    let is_near = at.iter().all(|along| (along - 1.0).abs() <= ASKEW);
    (is_flat && is_near).then_some([[a, b, c], [b, c, d]])
}

/// Distance of the fourth corner of a flat quadrilateral from its plane, by the greatest coordinate.
const FLAT: f32 = 4.0 * UNIT_ROUNDOFF;

/// Greatest distance of the fourth corner from that of a parallelogram, by the edges.
const ASKEW: f64 = 0.25;

/// D/(2A) of a triangle, and that times D.
fn slender([a, b, c]: &[Vec3; 3]) -> [f64; 2] {
    let [a, b, c]: [DVec3; 3] = [a, b, c].map(|corner| corner.as_dvec3());
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let slender = longest / (b - a).cross(c - a).length();
    [slender, slender * longest]
}

/// The greater number; `a` if `b` is NaN.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}
