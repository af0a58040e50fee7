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

    /// The light as seen from a point; none from behind.
    pub fn seen_from(&self, point: Vec3) -> Option<SeenQuad<'_>> {
        let to_corner = (self.corner - point.as_dvec3()).as_vec3();
        (to_corner.dot(self.normal) < 0.0).then(|| SeenQuad {
            quad: self,
            point,
            to_corner,
            spherical: self
                .rectangle
                .as_ref()
                .and_then(|rectangle| rectangle.seen_from(to_corner, self.normal)),
        })
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

/// A quad and a point that sees its front.
#[derive(Clone, Copy, Debug)]
pub struct SeenQuad<'a> {
    quad: &'a QuadEmitter,
    point: Vec3,
    to_corner: Vec3,
    spherical: Option<SphericalRectangle>,
}

impl SeenQuad<'_> {
    /// Uniform over the solid angle of a rectangle, over the area of another parallelogram.
    pub fn sample(&self, u: [f32; 2], radiance: Vec3, source: Source) -> LightSample {
        if let (Some(spherical), Some(rectangle)) = (&self.spherical, &self.quad.rectangle) {
            let local = spherical.sample(u);
            let offset = rectangle.x * local.x + rectangle.y * local.y + self.quad.normal * local.z;
            let weight = radiance * spherical.solid_angle;
            return LightSample {
                target: self.point + offset,
                direction: offset.normalize(),
                weight,
                source,
            };
        }
        let offset = self.to_corner + self.quad.u * u[0] + self.quad.v * u[1];
        self.quad.by_area(self.point, offset, radiance, source)
    }
}

/// A rectangle on the sphere of directions (Ureña, Fajardo, King, *An Area-Preserving Parametrization for Spherical
/// Rectangles*, 2013): its sides along x and y, its plane at z < 0.
#[derive(Clone, Copy, Debug)]
struct SphericalRectangle {
    x: [f32; 2],
    y: [f32; 2],
    z: f32,
    /// z components of the unit normals of the planes through the lower and the upper side.
    lower: f32,
    upper: f32,
    /// Angle that the slices start at.
    start: f32,
    solid_angle: f32,
}

impl Rectangle {
    /// None where the solid angle is too small to be told.
    fn seen_from(&self, to_corner: Vec3, normal: Vec3) -> Option<SphericalRectangle> {
        let (x0, y0, z) = (to_corner.dot(self.x), to_corner.dot(self.y), to_corner.dot(normal));
        let (x1, y1) = (x0 + self.width, y0 + self.height);
        let z2 = z * z;
        let towards = |side: f32| side / (z2 + side * side).sqrt();
        let (lower, right, upper, left) = (-towards(y0), towards(x1), towards(y1), -towards(x0));
        let angle = |a: f32, b: f32| (-a * b).clamp(-1.0, 1.0).acos();
        let (g0, g1) = (angle(lower, right), angle(right, upper));
        let (g2, g3) = (angle(upper, left), angle(left, lower));
        let solid_angle = (g0 + g1 - PI) + (g2 + g3 - PI);
        (solid_angle >= LEAST_SOLID_ANGLE).then_some(SphericalRectangle {
            x: [x0, x1],
            y: [y0, y1],
            z,
            lower,
            upper,
            start: 2.0 * PI - g2 - g3,
            solid_angle,
        })
    }
}

impl SphericalRectangle {
    /// A point of the rectangle, uniform over its solid angle.
    fn sample(&self, u: [f32; 2]) -> Vec3 {
        // A slice of the sphere up to x takes its share of the solid angle.
        let (sin, cos) = (u[0] * self.solid_angle + self.start).sin_cos();
        let slope = (cos * self.lower - self.upper) / sin;
        let slope2 = slope * slope;
        let lower2 = self.lower * self.lower;
        // cos² and sin² of the slice's direction in the plane of x and z.
        let x = (-self.z * slope.signum() / (slope2 + lower2 - 1.0).max(f32::MIN_POSITIVE).sqrt())
            .clamp(self.x[0], self.x[1]);
        // Along the slice, heights on the unit circle are uniform.
        let d2 = x * x + self.z * self.z;
        let [h0, h1] = self.y.map(|y| y / (d2 + y * y).sqrt());
        let h = h0 + u[1] * (h1 - h0);
        let rest = 1.0 - h * h;
        let y = if rest > 0.0 { (h * (d2 / rest).sqrt()).clamp(self.y[0], self.y[1]) } else { self.y[1] };
        Vec3::new(x, y, self.z)
    }
}
