//! The watertight test of mesh triangles in `f32` (Woop, Benthin, Wald, *Watertight Ray/Triangle Intersection*, JCGT
//! 2013): two triangles that share an edge leave no gap for any ray.

use super::ShapeHit;
use crate::math::Vec3;
use crate::math::float::gamma;

/// A ray made ready for many triangles: its longest axis is z and it is sheared to run along it.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    origin: Vec3,
    axes: [usize; 3],
    shear: Vec3,
}

impl ShearedRay {
    /// Prepare it.
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
        Self { origin, axes: [x, y, z], shear: Vec3::new(direction[x] * scale, direction[y] * scale, scale) }
    }

    /// The axes of the world that are its x, y and z.
    pub fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// What is taken from x and y for each unit of z, and t for each unit of z.
    pub fn shear(&self) -> Vec3 {
        self.shear
    }

    /// The hit at a t in (0, `t_max`], from either side. A t within the test's own error of 0 is none
    /// (*Physically Based Rendering*, 4th ed., section 6.8.7).
    #[inline(always)]
    pub fn intersect(&self, corners: &[Vec3; 3], t_max: f32) -> Option<ShapeHit> {
        let [x, y, z] = self.axes;
        let corners = corners.map(|corner| {
            let p = corner - self.origin;
            (p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z], p[z])
        });
        let [(ax, ay, az), (bx, by, bz), (cx, cy, cz)] = corners;
        let mut wa = cx * by - cy * bx;
        let mut wb = ax * cy - ay * cx;
        let mut wc = bx * ay - by * ax;
        if wa == 0.0 || wb == 0.0 || wc == 0.0 {
            let exact = |px: f32, qy: f32, py: f32, qx: f32| {
                (f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)) as f32
            };
            wa = exact(cx, by, cy, bx);
            wb = exact(ax, cy, ay, cx);
            wc = exact(bx, ay, by, ax);
        }
        if (wa < 0.0 || wb < 0.0 || wc < 0.0) && (wa > 0.0 || wb > 0.0 || wc > 0.0) {
            return None;
        }
        let determinant = wa + wb + wc;
        if determinant == 0.0 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let t = (wa * az + wb * bz + wc * cz) * self.shear.z * inverse;
        if !(t > 0.0 && t <= t_max) {
            return None;
        }
        if t <= self.distance_error(&corners, inverse) {
            return None;
        }
        Some(ShapeHit { t, primitive: 0, u: wb * inverse, v: wc * inverse })
    }

    /// Bound on the absolute error of t. The sheared x and y err by lengths, z by units of t, which are the same for unit
    /// directions only.
    fn distance_error(&self, corners: &[(f32, f32, f32); 3], inverse_determinant: f32) -> f32 {
        let greatest = |of: fn(&(f32, f32, f32)) -> f32| corners.iter().map(of).fold(0.0, f32::max);
        let x = greatest(|corner| corner.0.abs());
        let y = greatest(|corner| corner.1.abs());
        let depth = greatest(|corner| corner.2.abs());
        let z = depth * self.shear.z.abs();
        let error_z = gamma(3) * z;
        let (error_x, error_y) = (gamma(5) * (x + depth), gamma(5) * (y + depth));
        let error_edge = 2.0 * (gamma(2) * x * y + error_y * x + error_x * y);
        let edge = 2.0 * x * y;
        3.0 * (gamma(3) * edge * z + error_edge * z + error_z * edge) * inverse_determinant.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_aligned_and_skew_rays_agree_with_the_plane() {
        let triangle = [Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 2.0)];
        let hit = ShearedRay::new(Vec3::new(0.25, 0.5, 0.0), Vec3::Z).intersect(&triangle, f32::INFINITY);
        let hit = hit.expect("straight through the inside");
        assert_eq!((hit.t, hit.u, hit.v), (2.0, 0.25, 0.5));
        let back = ShearedRay::new(Vec3::new(0.25, 0.5, 4.0), Vec3::NEG_Z).intersect(&triangle, 10.0);
        assert_eq!(back.map(|hit| (hit.t, hit.u, hit.v)), Some((2.0, 0.25, 0.5)));
        assert_eq!(ShearedRay::new(Vec3::new(0.25, 0.5, 0.0), Vec3::Z).intersect(&triangle, 1.9), None);
        assert_eq!(ShearedRay::new(Vec3::new(0.9, 0.9, 0.0), Vec3::Z).intersect(&triangle, 10.0), None);
    }

    #[test]
    fn no_number_in_a_ray_or_triangle_gives_a_hit_at_nan() {
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
