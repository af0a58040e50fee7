//! Quad lights: rectangles by solid angle, other parallelograms and distant ones by area.

use std::f32::consts::PI;

use super::{Ends, LightSamples, Met, Source};
use crate::math::lanes::{LANES, Lanes, Lanes3, dot, lane, map, sin_cos, zip};
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

    /// Centre of area.
    pub fn middle(&self) -> DVec3 {
        self.corner + ((self.u + self.v) * 0.5).as_dvec3()
    }

    /// [`Light::pdf`](super::Light::pdf).
    pub fn pdf(&self, from: Vec3, met: &Met) -> f32 {
        let Some(seen) = self.seen_from(from) else { return 0.0 };
        match &seen.spherical {
            Some(spherical) => 1.0 / spherical.solid_angle,
            None => met.pdf_by_area(f64::from(self.area)),
        }
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
    /// Uniform over the solid angle of a rectangle, over the area of another parallelogram; one for each lane.
    #[inline(always)]
    pub fn samples(&self, u: [Lanes; 2], radiance: Vec3, source: Source) -> LightSamples {
        let spherical = self.spherical.as_ref().zip(self.quad.rectangle.as_ref());
        let (offsets, nearness, factors) = match spherical {
            Some((spherical, rectangle)) => {
                let (offsets, nearness) = spherical.directions(u, rectangle, self.quad.normal);
                (offsets, nearness, [spherical.solid_angle; LANES])
            }
            None => self.by_area(u),
        };
        let axis = |axis: usize| {
            (map(offsets[axis], |x| self.point[axis] + x), zip(offsets[axis], nearness, |x, near| x * near))
        };
        let [x, y, z] = [axis(0), axis(1), axis(2)];
        let (targets, directions) = ([x.0, y.0, z.0], [x.1, y.1, z.1]);
        let ends = Ends::At(targets);
        LightSamples { ends, directions, radiance, factors, source, count: LANES }
    }

    /// Points uniform over the area, from the point that sees them; one over their distances, and the area as solid angle.
    #[inline(always)]
    fn by_area(&self, u: [Lanes; 2]) -> (Lanes3, Lanes, Lanes) {
        let offsets = self.offsets(u);
        let nearness: Lanes = std::array::from_fn(|i| 1.0 / lane(&offsets, i).length());
        let height = map(dot(&offsets, self.quad.normal), |height| -height * self.quad.area);
        (offsets, nearness, zip(height, nearness, |height, near| height * near * near * near))
    }

    /// Coordinates of points uniform over the area, from the point that sees them.
    #[inline(always)]
    fn offsets(&self, u: [Lanes; 2]) -> [Lanes; 3] {
        let (quad, corner) = (self.quad, self.to_corner);
        [0, 1, 2].map(|axis| zip(u[0], u[1], |s, t| corner[axis] + quad.u[axis] * s + quad.v[axis] * t))
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
    /// Coordinates of points uniform over the solid angle, and one over their distances.
    #[inline(always)]
    fn directions(&self, u: [Lanes; 2], rectangle: &Rectangle, normal: Vec3) -> ([Lanes; 3], Lanes) {
        let (x, y) = self.samples(u);
        let away = normal * self.z;
        let axis = |axis: usize| zip(x, y, |x, y| rectangle.x[axis] * x + rectangle.y[axis] * y + away[axis]);
        let offset = [axis(0), axis(1), axis(2)];
        let squares = offset.map(|axis| map(axis, |x| x * x));
        let flat = zip(squares[0], squares[1], |x, y| x + y);
        (offset, zip(flat, squares[2], |flat, z| 1.0 / (flat + z).sqrt()))
    }

    /// Coordinates of points of the rectangle along its sides, uniform over its solid angle.
    #[inline(always)]
    fn samples(&self, u: [Lanes; 2]) -> (Lanes, Lanes) {
        // A slice of the sphere up to x takes its share of the solid angle.
        let (sin, cos) = sin_cos(map(u[0], |u| u * self.solid_angle + self.start));
        // sin² of the angle that the lower plane stands at.
        let tilt = 1.0 - self.lower * self.lower;
        let x = zip(sin, cos, |sin, cos| {
            // Along the slice x/−z = sin/√(slope² − tilt·sin²), with the sign of the slope.
            let slope = cos * self.lower - self.upper;
            let sin = if slope < 0.0 { -sin } else { sin };
            let root = (slope * slope - tilt * (sin * sin)).max(f32::MIN_POSITIVE).sqrt();
            (-self.z * sin / root).max(self.x[0]).min(self.x[1])
        });
        // There, heights on the unit circle are uniform.
        let y = zip(x, u[1], |x, u| {
            let d2 = x * x + self.z * self.z;
            let height = |y: f32| y / (d2 + y * y).sqrt();
            let (h0, h1) = (height(self.y[0]), height(self.y[1]));
            let h = h0 + u * (h1 - h0);
            let rest = (1.0 - h * h).max(f32::MIN_POSITIVE);
            (h * (d2 / rest).sqrt()).max(self.y[0]).min(self.y[1])
        });
        (x, y)
    }
}
