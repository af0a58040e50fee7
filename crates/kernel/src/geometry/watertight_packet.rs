//! Watertight intersection of mesh triangles with packets of rays in arbitrary directions. Performs the
//! operations of [`ShearedRay::intersect`](super::watertight::ShearedRay::intersect) in the same order, so
//! the results are bit-identical.

use super::packet::{F32x16, PACKET_SIZE, RayPacket};
use super::watertight::ILL_CONDITIONED;
use crate::math::float::gamma;
use crate::math::lanes::{Mask, TRUE, Vec3x16};

/// A packet of rays, preprocessed for triangle tests.
pub struct ShearedPacket<'a> {
    rays: &'a RayPacket,
    /// Mask of the rays whose longest axis is x, and mask of the rays whose longest axis is y.
    longest: [Mask; 2],
    /// Mask of the rays with a negative direction along their longest axis. The scalar test then swaps the
    /// other two axes, which only negates the edge functions.
    is_down: Mask,
    /// Shears of the two axes that follow the longest axis, and scale of the longest axis.
    shear: Vec3x16,
}

/// Results of testing each ray in a packet against one triangle.
pub struct TriangleTestResults {
    /// Lanes with a hit.
    pub hit: Mask,
    /// Lanes that need the scalar test.
    pub doubtful: Mask,
    /// Distance of each hit.
    pub t: F32x16,
    /// Barycentric coordinate of the second corner at each hit.
    pub u: F32x16,
    /// Barycentric coordinate of the third corner.
    pub v: F32x16,
}

impl<'a> ShearedPacket<'a> {
    /// Preprocesses a packet.
    #[inline(always)]
    pub fn new(rays: &'a RayPacket) -> Self {
        let (mut longest, mut is_down) = ([[0; PACKET_SIZE]; 2], [0; PACKET_SIZE]);
        let mut shear = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let [x, y, z] = [rays.direction[0][i], rays.direction[1][i], rays.direction[2][i]];
            let [size_x, size_y, size_z] = [x.abs(), y.abs(), z.abs()];
            let is_x = (size_x > size_y) & (size_x > size_z);
            let is_y = !(size_x > size_y) & (size_y > size_z);
            let along = if is_x {
                x
            } else if is_y {
                y
            } else {
                z
            };
            let first = if is_x {
                y
            } else if is_y {
                z
            } else {
                x
            };
            let second = if is_x {
                z
            } else if is_y {
                x
            } else {
                y
            };
            let scale = 1.0 / along;
            longest[0][i] = if is_x { TRUE } else { 0 };
            longest[1][i] = if is_y { TRUE } else { 0 };
            is_down[i] = if along < 0.0 { TRUE } else { 0 };
            shear[0][i] = first * scale;
            shear[1][i] = second * scale;
            shear[2][i] = scale;
        }
        Self { rays, longest, is_down, shear }
    }

    /// A corner in each ray's sheared coordinates.
    #[inline(always)]
    fn shear_corner(&self, corner: &Vec3x16) -> Vec3x16 {
        let mut seen = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let [x, y, z] = [0, 1, 2].map(|axis| corner[axis][i] - self.rays.origin[axis][i]);
            let (is_x, is_y) = (self.longest[0][i] != 0, self.longest[1][i] != 0);
            let along = if is_x {
                x
            } else if is_y {
                y
            } else {
                z
            };
            let first = if is_x {
                y
            } else if is_y {
                z
            } else {
                x
            };
            let second = if is_x {
                z
            } else if is_y {
                x
            } else {
                y
            };
            seen[0][i] = first - self.shear[0][i] * along;
            seen[1][i] = second - self.shear[1][i] * along;
            seen[2][i] = along;
        }
        seen
    }

    /// [`ShearedRay::intersect`](super::watertight::ShearedRay::intersect) for a packet in which each ray has
    /// its own triangle. Rays that start on their triangle do not hit it.
    #[inline(always)]
    pub fn intersect_triangles_per_ray(
        &self,
        numbers: &[u32; PACKET_SIZE],
        corners: [&Vec3x16; 3],
        ends: &F32x16,
    ) -> TriangleTestResults {
        let [a, b, c] =
            [self.shear_corner(corners[0]), self.shear_corner(corners[1]), self.shear_corner(corners[2])];
        let mut hits = TriangleTestResults {
            hit: [0; PACKET_SIZE],
            doubtful: [0; PACKET_SIZE],
            t: [0.0; PACKET_SIZE],
            u: [0.0; PACKET_SIZE],
            v: [0.0; PACKET_SIZE],
        };
        for i in 0..PACKET_SIZE {
            let ([ax, ay, az], [bx, by, bz]) = ([a[0][i], a[1][i], a[2][i]], [b[0][i], b[1][i], b[2][i]]);
            let [cx, cy, cz] = [c[0][i], c[1][i], c[2][i]];
            let (wa, wb, wc) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
            let (is_left, is_right) =
                ((wa < 0.0) | (wb < 0.0) | (wc < 0.0), (wa > 0.0) | (wb > 0.0) | (wc > 0.0));
            let is_on_edge = (wa == 0.0) | (wb == 0.0) | (wc == 0.0);
            let inverse = 1.0 / (wa + wb + wc);
            let shear_z = self.shear[2][i];
            let t = (wa * az + wb * bz + wc * cz) * shear_z * inverse;
            // Compute the error bound as in `ShearedRay::distance_error_and_corner_max_t`.
            let first = max_abs_of_three([ax, bx, cx]);
            let second = max_abs_of_three([ay, by, cy]);
            let depth = max_abs_of_three([az, bz, cz]);
            let is_down = self.is_down[i] != 0;
            let (x, y) = (if is_down { second } else { first }, if is_down { first } else { second });
            let z = depth * shear_z.abs();
            let error_z = gamma(3) * z;
            let (error_x, error_y) = (gamma(5) * (x + depth), gamma(5) * (y + depth));
            let error_edge = 2.0 * (gamma(2) * x * y + error_y * x + error_x * y);
            let edge = 2.0 * x * y;
            let error = 3.0 * (gamma(3) * edge * z + error_edge * z + error_z * edge) * inverse.abs();
            let is_doubtful = (error > z * ILL_CONDITIONED) | (t.abs() <= error) | is_on_edge;
            let is_inside = !(is_left & is_right) & (self.rays.start[i] != numbers[i]);
            let is_hit = is_inside & !is_doubtful & (t > 0.0) & (t <= ends[i]);
            hits.doubtful[i] = if is_inside & is_doubtful { TRUE } else { 0 };
            hits.hit[i] = if is_hit { TRUE } else { 0 };
            hits.t[i] = t;
            hits.u[i] = wb * inverse;
            hits.v[i] = wc * inverse;
        }
        hits
    }
}

/// Maximum of the absolute values of three numbers.
#[inline(always)]
fn max_abs_of_three([a, b, c]: [f32; 3]) -> f32 {
    let (a, b, c) = (a.abs(), b.abs(), c.abs());
    let most = if a > b { a } else { b };
    if most > c { most } else { c }
}
