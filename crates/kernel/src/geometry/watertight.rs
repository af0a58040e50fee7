//! Watertight intersection of mesh triangles in `f32` (Woop, Benthin, Wald, *Watertight Ray/Triangle
//! Intersection*, JCGT 2013): no ray passes between two triangles that share an edge.

use super::ShapeHit;
use crate::math::float::gamma;
use crate::math::{DVec3, Vec3};

/// Relative error of t above which a triangle is treated as a needle.
pub const ILL_CONDITIONED: f32 = 1.0 / 32.0;

/// A ray preprocessed for many triangles. The longest axis of its direction becomes z, and a shear aligns the
/// ray with this axis.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    origin: Vec3,
    direction: Vec3,
    axes: [usize; 3],
    shear: Vec3,
}

impl ShearedRay {
    /// Preprocesses a ray.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let size = direction.abs();
        let z = if size.x > size.y {
            if size.x > size.z { 0 } else { 2 }
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        let scale = 1.0 / direction[z];
        Self {
            origin,
            direction,
            axes: [x, y, z],
            shear: Vec3::new(direction[x] * scale, direction[y] * scale, scale),
        }
    }

    /// World axes that become the ray's x, y, and z.
    pub fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// Finds the hit with t in (0, `t_max`], from either side. Recomputes t in double precision if it is
    /// within its error bound of 0 (*Physically Based Rendering*, 4th ed., section 6.8.7).
    #[inline(always)]
    pub fn intersect(&self, corners: &[Vec3; 3], t_max: f32) -> Option<ShapeHit> {
        let [x, y, z] = self.axes;
        let sheared = corners.map(|corner| {
            let p = corner - self.origin;
            (p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z], p[z])
        });
        let [(ax, ay, az), (bx, by, bz), (cx, cy, cz)] = sheared;
        let mut wa = cx * by - cy * bx;
        let mut wb = ax * cy - ay * cx;
        let mut wc = bx * ay - by * ax;
        let is_outside = |[min, max]: [f32; 2]| min < 0.0 && max > 0.0;
        let ends = [
            min_or_second_if_nan(wa, min_or_second_if_nan(wb, wc)),
            max_or_second_if_nan(wa, max_or_second_if_nan(wb, wc)),
        ];
        if is_outside(ends) {
            return None;
        }
        if ends.contains(&0.0) {
            let exact = |px: f32, qy: f32, py: f32, qx: f32| {
                (f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)) as f32
            };
            wa = exact(cx, by, cy, bx);
            wb = exact(ax, cy, ay, cx);
            wc = exact(bx, ay, by, ax);
            if is_outside([
                min_or_second_if_nan(wa, min_or_second_if_nan(wb, wc)),
                max_or_second_if_nan(wa, max_or_second_if_nan(wb, wc)),
            ]) {
                return None;
            }
        }
        let determinant = wa + wb + wc;
        if determinant == 0.0 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let t = (wa * az + wb * bz + wc * cz) * self.shear.z * inverse;
        let (error, reach) = self.distance_error_and_corner_max_t(&sheared, inverse);
        if error > reach * ILL_CONDITIONED {
            return self.intersect_needle(corners, t_max);
        }
        if t.abs() <= error {
            return self.intersect_near_origin(corners, t_max);
        }
        (t > 0.0 && t <= t_max).then_some(ShapeHit { t, primitive: 0, u: wb * inverse, v: wc * inverse })
    }

    /// Finds the hit on a needle: a triangle so thin and so far away that t is uncertain in single precision.
    /// The ray is already known to hit the triangle, which prevents gaps between neighbors. If the ray misses
    /// the triangle in double precision, the nearest point on an edge is used.
    #[cold]
    fn intersect_needle(&self, corners: &[Vec3; 3], t_max: f32) -> Option<ShapeHit> {
        let ([a, b, c], [wa, wb, wc]) = self.corners_and_edge_functions_f64(corners);
        let sum = wa + wb + wc;
        let is_inside = wa * sum >= 0.0 && wb * sum >= 0.0 && wc * sum >= 0.0 && sum != 0.0;
        let (t, u, v) = if is_inside {
            ((wa * a.z + wb * b.z + wc * c.z) / sum, wb / sum, wc / sum)
        } else {
            let edges = [
                ray_segment_closest_approach(a, b),
                ray_segment_closest_approach(b, c),
                ray_segment_closest_approach(c, a),
            ];
            let edge = (0..3).min_by(|&i, &j| edges[i].0.total_cmp(&edges[j].0)).unwrap_or(0);
            let (_, part, t) = edges[edge];
            let [u, v] = [[part, 0.0], [1.0 - part, part], [0.0, 1.0 - part]][edge];
            (t, u, v)
        };
        let t = t as f32;
        (t > 0.0 && t <= t_max).then_some(ShapeHit { t, primitive: 0, u: u as f32, v: v as f32 })
    }

    /// Finds the hit on a triangle whose plane is so close to the origin that the sign of t is uncertain in
    /// single precision. The ray's line is already known to pass through the triangle.
    #[cold]
    fn intersect_near_origin(&self, corners: &[Vec3; 3], t_max: f32) -> Option<ShapeHit> {
        let ([a, b, c], [wa, wb, wc]) = self.corners_and_edge_functions_f64(corners);
        let sum = wa + wb + wc;
        let t = ((wa * a.z + wb * b.z + wc * c.z) / sum) as f32;
        let [u, v] = [wb, wc].map(|weight| (weight / sum).clamp(0.0, 1.0) as f32);
        (t > 0.0 && t <= t_max).then_some(ShapeHit { t, primitive: 0, u, v })
    }

    /// Edge functions and sheared corners in double precision. The z coordinate of a corner is its t along
    /// the ray.
    fn corners_and_edge_functions_f64(&self, corners: &[Vec3; 3]) -> ([DVec3; 3], [f64; 3]) {
        let [x, y, z] = self.axes;
        let direction = self.direction.as_dvec3();
        let shear = direction / direction[z];
        let [a, b, c] = corners.map(|corner| {
            let p = corner.as_dvec3() - self.origin.as_dvec3();
            DVec3::new(p[x] - shear[x] * p[z], p[y] - shear[y] * p[z], p[z] / direction[z])
        });
        let cross = |p: DVec3, q: DVec3| p.x * q.y - p.y * q.x;
        ([a, b, c], [cross(c, b), cross(a, c), cross(b, a)])
    }

    /// Bound on the absolute error of t, and the largest t among the corners. The errors of sheared x and y
    /// are lengths, while the error of z is in units of t. The units differ unless the direction has unit
    /// length.
    fn distance_error_and_corner_max_t(
        &self,
        corners: &[(f32, f32, f32); 3],
        inverse_determinant: f32,
    ) -> (f32, f32) {
        let max = |of: fn(&(f32, f32, f32)) -> f32| corners.iter().map(of).fold(0.0, f32::max);
        let x = max(|corner| corner.0.abs());
        let y = max(|corner| corner.1.abs());
        let depth = max(|corner| corner.2.abs());
        let z = depth * self.shear.z.abs();
        let error_z = gamma(3) * z;
        let (error_x, error_y) = (gamma(5) * (x + depth), gamma(5) * (y + depth));
        let error_edge = 2.0 * (gamma(2) * x * y + error_y * x + error_x * y);
        let edge = 2.0 * x * y;
        let error = 3.0 * (gamma(3) * edge * z + error_edge * z + error_z * edge) * inverse_determinant.abs();
        (error, z)
    }
}

/// The smaller number, or `b` if either is NaN, as with vector instructions.
fn min_or_second_if_nan(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger number, or `b` if either is NaN.
fn max_or_second_if_nan(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Finds the point on the segment from p to q that is nearest to the ray. z coordinates are distances along
/// the ray. Returns the squared distance from the ray, the position on the segment as a fraction, and the
/// distance along the ray.
fn ray_segment_closest_approach(p: DVec3, q: DVec3) -> (f64, f64, f64) {
    let (start, way) = (p.truncate(), (q - p).truncate());
    let part = (-start.dot(way) / way.length_squared()).clamp(0.0, 1.0);
    let part = if part.is_nan() { 0.0 } else { part };
    ((start + way * part).length_squared(), part, p.z + (q.z - p.z) * part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::signed_number_generator;

    #[test]
    fn axis_aligned_and_oblique_rays_hit_the_plane() {
        let triangle = [Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 2.0)];
        let hit = ShearedRay::new(Vec3::new(0.25, 0.5, 0.0), Vec3::Z).intersect(&triangle, f32::INFINITY);
        let hit = hit.expect("the ray should pass through the interior");
        assert_eq!((hit.t, hit.u, hit.v), (2.0, 0.25, 0.5));
        let back = ShearedRay::new(Vec3::new(0.25, 0.5, 4.0), Vec3::NEG_Z).intersect(&triangle, 10.0);
        assert_eq!(back.map(|hit| (hit.t, hit.u, hit.v)), Some((2.0, 0.25, 0.5)));
        assert_eq!(ShearedRay::new(Vec3::new(0.25, 0.5, 0.0), Vec3::Z).intersect(&triangle, 1.9), None);
        assert_eq!(ShearedRay::new(Vec3::new(0.9, 0.9, 0.0), Vec3::Z).intersect(&triangle, 10.0), None);
    }

    #[test]
    fn surfaces_with_needles_have_no_holes() {
        let mut random = signed_number_generator(3);
        for (width, distance) in
            [(3e-4_f32, 200.0_f32), (1e-4, 200.0), (1e-4, 50.0), (1e-6, 3.0), (2e-7, 1e3)]
        {
            // Split a tilted square into three parts: a strip of this width across the middle, and the two
            // remaining parts.
            let point = |x: f32, y: f32| Vec3::new(x, y, 0.3 * x - 0.2 * y);
            let [low, high] = [-width, width].map(|w| 0.5 * w);
            let quad = |a: f32, b: f32| {
                let [p, q, r, s] = [point(-1.0, a), point(1.0, a), point(1.0, b), point(-1.0, b)];
                [[p, q, r], [p, r, s]]
            };
            let sheet: Vec<_> = [quad(-1.0, low), quad(low, high), quad(high, 1.0)].concat();
            for _ in 0..20_000 {
                let eye = Vec3::new(random(), random(), distance);
                let target = point(random() * 0.9, random() * width);
                let ray = ShearedRay::new(eye, target - eye);
                let t =
                    sheet.iter().filter_map(|corners| ray.intersect(corners, f32::INFINITY)).map(|hit| hit.t);
                let t: Vec<f32> = t.collect();
                let nearest = t.iter().copied().fold(f32::INFINITY, f32::min);
                assert!((nearest - 1.0).abs() < 1e-2, "{width} at {distance}: {t:?}");
            }
        }
    }

    #[test]
    fn hit_distances_are_finite() {
        let bad = [f32::NAN, f32::INFINITY, 0.0, -0.0, 1e38, 1e-40];
        for a in bad {
            for b in bad {
                let triangle = [Vec3::new(a, 0.0, b), Vec3::new(1.0, b, 2.0), Vec3::new(0.0, 1.0, a)];
                let hit =
                    ShearedRay::new(Vec3::new(b, 0.1, 0.0), Vec3::new(a, 0.0, b)).intersect(&triangle, 1e30);
                assert!(hit.is_none_or(|hit| hit.t.is_finite()));
            }
        }
    }
}
