//! Quad lights. Rectangles are sampled by solid angle. Other parallelograms and distant rectangles are
//! sampled by area.

use std::f32::consts::PI;

use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::math::elementary::{acos, sin_cos};
use crate::math::{DVec3, Vec3};

/// Minimum solid angle in sr for solid-angle sampling. For smaller quads, the sum of four angles loses too
/// many digits, and area sampling is equally good.
const MIN_SOLID_ANGLE: f32 = 0.02;

/// A parallelogram that emits toward u × v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadEmitter {
    corner: DVec3,
    u: Vec3,
    v: Vec3,
    /// Unit normal on the emitting side.
    normal: Vec3,
    area: f32,
    /// Lengths and unit directions of the edges, if they are perpendicular.
    rectangle: Option<RectangleEdges>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct RectangleEdges {
    x: Vec3,
    y: Vec3,
    width: f32,
    height: f32,
}

impl ShapeEmitter for QuadEmitter {
    /// Samples rectangles by solid angle and other parallelograms by area.
    #[inline(always)]
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        self.sample_given_corner_offset(point, self.offset_to_corner(point), u)
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        let to_corner = self.offset_to_corner(from);
        if !(to_corner.dot(self.normal) < 0.0) {
            return 0.0;
        }
        self.pdf_by_solid_angle(to_corner)
            .unwrap_or_else(|| hit.uniform_area_solid_angle_pdf(f64::from(self.area)))
    }

    fn area_centroid(&self) -> DVec3 {
        self.corner + ((self.u + self.v) * 0.5).as_dvec3()
    }
}

impl QuadEmitter {
    /// The point at these fractions of the edges.
    pub(super) fn point_at(&self, [s, t]: [f64; 2]) -> DVec3 {
        self.corner + self.u.as_dvec3() * s + self.v.as_dvec3() * t
    }

    /// [`ShapeEmitter::sample`] with a precomputed offset from the point to the corner.
    #[inline(always)]
    pub(super) fn sample_given_corner_offset(
        &self,
        point: Vec3,
        to_corner: Vec3,
        u: [f32; 2],
    ) -> SampledLightPoint {
        let by_area = self.sample_by_area(to_corner, u);
        let (offset, factor) = match &self.rectangle {
            Some(rectangle) => {
                let spherical = rectangle.project_to_sphere(to_corner, self.normal);
                let [x, y] = spherical.sample(u);
                let offset = rectangle.x * x + rectangle.y * y + self.normal * spherical.z;
                let is_accurate = spherical.has_accurate_solid_angle();
                let x = if is_accurate { offset.x } else { by_area.0.x };
                let y = if is_accurate { offset.y } else { by_area.0.y };
                let z = if is_accurate { offset.z } else { by_area.0.z };
                (Vec3::new(x, y, z), if is_accurate { spherical.solid_angle } else { by_area.1 })
            }
            None => by_area,
        };
        let direction = offset * (1.0 / offset.length_squared().sqrt());
        let is_front = to_corner.dot(self.normal) < 0.0;
        SampledLightPoint { direction, target: point + offset, factor: if is_front { factor } else { 0.0 } }
    }

    /// Creates a quad from a corner and two nonparallel edges.
    pub fn new(corner: DVec3, u: DVec3, v: DVec3) -> Self {
        let normal = u.cross(v);
        let perpendicular = u.dot(v).abs() <= 1e-6 * u.length() * v.length();
        let rectangle = perpendicular.then(|| RectangleEdges {
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

    /// Offset from a point to the corner.
    #[inline(always)]
    pub(super) fn offset_to_corner(&self, point: Vec3) -> Vec3 {
        (self.corner - point.as_dvec3()).as_vec3()
    }

    /// Samples uniformly over the area. Returns the offset from the point and the inverse solid-angle pdf.
    #[inline(always)]
    pub(super) fn sample_by_area(&self, to_corner: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        let offset = to_corner + self.u * u[0] + self.v * u[1];
        (offset, self.inverse_pdf_by_area(offset))
    }

    /// Solid angle that the quad would have if its entire area were at this offset from the point. Not
    /// positive if the point is behind the quad.
    #[inline(always)]
    pub(super) fn inverse_pdf_by_area(&self, offset: Vec3) -> f32 {
        let nearness = 1.0 / offset.length_squared().sqrt();
        let height = -offset.dot(self.normal) * self.area;
        height * nearness * nearness * nearness
    }

    /// Pdf of solid-angle sampling in sr⁻¹, for points in front of the quad. Returns `None` if the quad is
    /// sampled by area.
    #[inline(always)]
    pub(super) fn pdf_by_solid_angle(&self, to_corner: Vec3) -> Option<f32> {
        let spherical =
            self.rectangle.as_ref().map(|rectangle| rectangle.project_to_sphere(to_corner, self.normal));
        spherical
            .filter(SphericalRectangle::has_accurate_solid_angle)
            .map(|spherical| 1.0 / spherical.solid_angle)
    }

    /// Vectors whose dot products with an offset from the corner are the coordinates along the edges.
    pub(super) fn dual_basis(&self) -> [Vec3; 2] {
        let (u, v, n) = (self.u.as_dvec3(), self.v.as_dvec3(), self.normal.as_dvec3());
        let (across_v, across_u) = (v.cross(n), n.cross(u));
        [(across_v / across_v.dot(u)).as_vec3(), (across_u / across_u.dot(v)).as_vec3()]
    }
}

/// A spherical rectangle (Ureña, Fajardo, King, *An Area-Preserving Parametrization for Spherical
/// Rectangles*, 2013). The sides are parallel to x and y, and the plane is at z < 0.
#[derive(Clone, Copy, Debug)]
pub struct SphericalRectangle {
    x: [f32; 2],
    y: [f32; 2],
    z: f32,
    /// z components of the unit normals of the planes through the view point and the lower or upper side.
    lower: f32,
    upper: f32,
    /// Angle at which the slices start.
    start: f32,
    solid_angle: f32,
}

impl RectangleEdges {
    #[inline(always)]
    fn project_to_sphere(&self, to_corner: Vec3, normal: Vec3) -> SphericalRectangle {
        let (x0, y0, z) = (to_corner.dot(self.x), to_corner.dot(self.y), to_corner.dot(normal));
        SphericalRectangle::new([x0, x0 + self.width], [y0, y0 + self.height], z)
    }
}

/// Sine of the angle at which a side is seen. `side` is the side's coordinate, and `d2` is the squared
/// distance perpendicular to the coordinate axis.
#[inline(always)]
fn side_elevation_sine(side: f32, d2: f32) -> f32 {
    side / (d2 + side * side).sqrt()
}

/// Angle between the planes through the view point and two adjacent sides.
#[inline(always)]
fn dihedral_angle(a: f32, b: f32) -> f32 {
    acos((-a * b).max(-1.0).min(1.0))
}

impl SphericalRectangle {
    /// Creates a rectangle from its coordinate ranges and the z coordinate of its plane.
    #[inline(always)]
    pub fn new([x0, x1]: [f32; 2], [y0, y1]: [f32; 2], z: f32) -> Self {
        let z2 = z * z;
        let (lower, right) = (-side_elevation_sine(y0, z2), side_elevation_sine(x1, z2));
        let (upper, left) = (side_elevation_sine(y1, z2), -side_elevation_sine(x0, z2));
        let (g0, g1) = (dihedral_angle(lower, right), dihedral_angle(right, upper));
        let (g2, g3) = (dihedral_angle(upper, left), dihedral_angle(left, lower));
        Self {
            x: [x0, x1],
            y: [y0, y1],
            z,
            lower,
            upper,
            start: 2.0 * PI - g2 - g3,
            solid_angle: (g0 + g1 - PI) + (g2 + g3 - PI),
        }
    }

    /// Combines three rectangles field by field. `of` maps the three values to one.
    #[inline(always)]
    pub fn combine_three_by_field(three: [Self; 3], of: impl Fn([f32; 3]) -> f32) -> Self {
        Self {
            x: [of(three.map(|one| one.x[0])), of(three.map(|one| one.x[1]))],
            y: [of(three.map(|one| one.y[0])), of(three.map(|one| one.y[1]))],
            z: of(three.map(|one| one.z)),
            lower: of(three.map(|one| one.lower)),
            upper: of(three.map(|one| one.upper)),
            start: of(three.map(|one| one.start)),
            solid_angle: of(three.map(|one| one.solid_angle)),
        }
    }

    /// Solid angle in sr.
    #[inline(always)]
    pub fn solid_angle(&self) -> f32 {
        self.solid_angle
    }

    /// The z coordinate of the plane.
    #[inline(always)]
    pub fn z(&self) -> f32 {
        self.z
    }

    /// Samples uniformly over the area. Returns the point and the inverse solid-angle pdf.
    #[inline(always)]
    pub fn sample_by_area(&self, u: [f32; 2]) -> (f32, f32, f32) {
        let (width, height) = (self.x[1] - self.x[0], self.y[1] - self.y[0]);
        let (x, y) = (self.x[0] + width * u[0], self.y[0] + height * u[1]);
        let nearness = 1.0 / (x * x + y * y + self.z * self.z).sqrt();
        (x, y, -self.z * width * height * (nearness * nearness * nearness))
    }

    /// Whether the solid angle is precise enough for sampling.
    #[inline(always)]
    pub fn has_accurate_solid_angle(&self) -> bool {
        self.solid_angle >= MIN_SOLID_ANGLE
    }

    /// Samples a point uniformly over the solid angle.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> [f32; 2] {
        // The part of the rectangle up to x covers the fraction u₀ of the solid angle.
        let (sin, cos) = sin_cos(u[0] * self.solid_angle + self.start);
        // sin² of the lower plane's angle.
        let tilt = 1.0 - self.lower * self.lower;
        // On this slice, x/−z = sin/√(slope² − tilt·sin²), with the sign of the slope.
        let slope = cos * self.lower - self.upper;
        let sin = if slope < 0.0 { -sin } else { sin };
        let root = (slope * slope - tilt * (sin * sin)).max(f32::MIN_POSITIVE).sqrt();
        let x = (-self.z * sin / root).max(self.x[0]).min(self.x[1]);
        // At this x, the heights on the unit circle are uniformly distributed.
        let d2 = x * x + self.z * self.z;
        let (h0, h1) = (side_elevation_sine(self.y[0], d2), side_elevation_sine(self.y[1], d2));
        let h = h0 + u[1] * (h1 - h0);
        let rest = (1.0 - h * h).max(f32::MIN_POSITIVE);
        let y = (h * (d2 / rest).sqrt()).max(self.y[0]).min(self.y[1]);
        [x, y]
    }
}
