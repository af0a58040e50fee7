//! Quad lights: rectangles by solid angle, other parallelograms and distant ones by area.

use std::f32::consts::PI;

use super::{LightSample, Source};
use crate::math::{DVec3, Vec3};

/// Below this solid angle in sr the sum of four angles has lost too many digits, and uniform over the area is as good.
const LEAST_SOLID_ANGLE: f32 = 0.02;

/// A parallelogram that shines along u × v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadEmitter {
    corner: DVec3,
    u: Vec3,
    v: Vec3,
    /// Unit normal of the shining side.
    normal: Vec3,
    area: f32,
    /// Lengths and unit directions of the edges, where they are perpendicular.
    rectangle: Option<Rectangle>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Rectangle {
    x: Vec3,
    y: Vec3,
    width: f32,
    height: f32,
}

impl QuadEmitter {
    /// From a corner and two edges that are not parallel.
    pub fn new(corner: DVec3, u: DVec3, v: DVec3) -> Self {
        let normal = u.cross(v);
        let perpendicular = u.dot(v).abs() <= 1e-6 * u.length() * v.length();
        let rectangle = perpendicular.then(|| Rectangle {
            x: u.normalize().as_vec3(),
            y: v.normalize().as_vec3(),
            width: u.length() as f32,
            height: v.length() as f32,
        });
        Self {
            corner,
            u: u.as_vec3(),
            v: v.as_vec3(),
            normal: normal.normalize().as_vec3(),
            area: normal.length() as f32,
            rectangle,
        }
    }

    /// Uniform over the solid angle of a rectangle, over the area of another parallelogram.
    pub fn sample(&self, point: Vec3, u: [f32; 2], radiance: Vec3, source: Source) -> Option<LightSample> {
        let to_corner = (self.corner - point.as_dvec3()).as_vec3();
        if to_corner.dot(self.normal) >= 0.0 {
            return None;
        }
        if let Some(rectangle) = &self.rectangle
            && let Some((offset, solid_angle)) = rectangle.sample(to_corner, self.normal, u)
        {
            let direction = offset.normalize();
            return Some(LightSample {
                target: point + offset,
                direction,
                weight: radiance * solid_angle,
                source,
            });
        }
        let offset = to_corner + self.u * u[0] + self.v * u[1];
        Some(self.by_area(point, offset, radiance, source))
    }

    /// All of it as if it came from the middle.
    pub fn middle(&self, point: Vec3, radiance: Vec3, source: Source) -> Option<LightSample> {
        let offset = (self.corner - point.as_dvec3()).as_vec3() + (self.u + self.v) * 0.5;
        (offset.dot(self.normal) < 0.0).then(|| self.by_area(point, offset, radiance, source))
    }

    fn by_area(&self, point: Vec3, offset: Vec3, radiance: Vec3, source: Source) -> LightSample {
        let distance_squared = offset.length_squared();
        let direction = offset / distance_squared.sqrt();
        let solid_angle = self.area * -direction.dot(self.normal) / distance_squared;
        LightSample { target: point + offset, direction, weight: radiance * solid_angle, source }
    }
}

impl Rectangle {
    /// A point relative to the origin and the solid angle of the whole (Ureña, Fajardo, King, *An Area-Preserving
    /// Parametrization for Spherical Rectangles*, 2013); none where that is too small to be told.
    fn sample(&self, to_corner: Vec3, normal: Vec3, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let (x0, y0, z0) = (to_corner.dot(self.x), to_corner.dot(self.y), to_corner.dot(normal));
        let (x1, y1) = (x0 + self.width, y0 + self.height);
        let z2 = z0 * z0;
        // z components of the unit normals of the four planes through the edges.
        let n0 = -y0 / (z2 + y0 * y0).sqrt();
        let n1 = x1 / (z2 + x1 * x1).sqrt();
        let n2 = y1 / (z2 + y1 * y1).sqrt();
        let n3 = -x0 / (z2 + x0 * x0).sqrt();
        let angle = |a: f32, b: f32| (-a * b).clamp(-1.0, 1.0).acos();
        let (g0, g1, g2, g3) = (angle(n0, n1), angle(n1, n2), angle(n2, n3), angle(n3, n0));
        let solid_angle = (g0 + g1 - PI) + (g2 + g3 - PI);
        if !(solid_angle >= LEAST_SOLID_ANGLE) {
            return None;
        }
        // A slice of the sphere up to x takes its share of the solid angle.
        let (sin, cos) = (u[0] * solid_angle + (2.0 * PI - g2 - g3)).sin_cos();
        let slope = (cos * n0 - n2) / sin;
        let cosine = (slope.hypot(n0).recip().copysign(slope)).clamp(-1.0, 1.0);
        let sine = (1.0 - cosine * cosine).max(f32::MIN_POSITIVE).sqrt();
        let x = (-cosine * z0 / sine).clamp(x0, x1);
        // Along the slice, heights on the unit circle are uniform.
        let d2 = x * x + z2;
        let (h0, h1) = (y0 / (d2 + y0 * y0).sqrt(), y1 / (d2 + y1 * y1).sqrt());
        let h = h0 + u[1] * (h1 - h0);
        let rest = 1.0 - h * h;
        let y = if rest > 0.0 { (h * (d2 / rest).sqrt()).clamp(y0, y1) } else { y1 };
        Some((self.x * x + self.y * y + normal * z0, solid_angle))
    }
}
