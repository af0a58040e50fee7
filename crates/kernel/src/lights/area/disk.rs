//! Disk lights, sampled with a pdf within 20 % of uniform over the solid angle.

use std::f64::consts::TAU;

use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::geometry::disk::Disk;
use crate::math::elementary::sin_cos;
use crate::math::{DVec3, Vec3};

/// A disk that emits from its front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiskEmitter {
    center: DVec3,
    normal: DVec3,
    radius: f64,
}

/// A disk seen from a point, as an elliptical cone of directions.
#[derive(Clone, Copy, Debug)]
pub struct DiskView {
    /// Axis of the cone, followed by the directions of the ellipse's axes.
    axes: [DVec3; 3],
    /// Tangents of the cone's half angles along the ellipse's axes.
    a: f64,
    b: f64,
    /// Coefficients of the unnormalized density 1/(p·cos² + q·sin²) of the angle around the axis.
    p: f64,
    q: f64,
    /// Height of the point above the front. Positive if the front is visible.
    height: f64,
    /// Distance from the point to the farthest point on the disk.
    farthest: f64,
}

impl ShapeEmitter for DiskEmitter {
    /// Samples the disk with a pdf within 20 % of uniform over the solid angle.
    #[inline(always)]
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let view = self.view_from(point);
        let (direction, distance, factor) = view.sample(self.normal, u);
        let direction = direction.as_vec3();
        SampledLightPoint {
            direction,
            target: point + direction * distance as f32,
            factor: if view.height > 0.0 { factor as f32 } else { 0.0 },
        }
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        let view = self.view_from(from);
        if view.is_front_visible() { view.pdf(hit.direction) as f32 } else { 0.0 }
    }

    fn area_centroid(&self) -> DVec3 {
        self.center
    }
}

impl DiskEmitter {
    /// Creates an emitter for an entire disk.
    pub fn new(disk: &Disk) -> Self {
        Self { center: disk.centroid(), normal: disk.normal(), radius: disk.radius() }
    }

    /// The disk seen from a point in front of it. If the point is behind the disk, the height is not positive
    /// and the other fields are meaningless.
    ///
    /// In the plane through the disk's normal, its center, and the point, the rays to the nearest and
    /// farthest points of the disk enclose an angle of 2α. The cone's half angles are α in this plane and β
    /// perpendicular to it (Guillén et al., *Area-Preserving Parameterizations for Spherical Ellipses*,
    /// 2017).
    #[inline(always)]
    pub fn view_from(&self, point: Vec3) -> DiskView {
        let to_center = self.center - point.as_dvec3();
        let height = -to_center.dot(self.normal);
        let flat = to_center + self.normal * height;
        let beside = flat.length();
        let is_beside = beside > 0.0;
        let across = perpendicular(self.normal);
        let out = DVec3::new(
            if is_beside { flat.x / beside } else { across.x },
            if is_beside { flat.y / beside } else { across.y },
            if is_beside { flat.z / beside } else { across.z },
        );
        let (near, far) = (beside - self.radius, beside + self.radius);
        let h2 = height * height;
        let (l0, l1) = ((near * near + h2).sqrt(), (far * far + h2).sqrt());
        let both = l0 + l1;
        // Intersect the bisector with the disk's plane.
        let middle = (near * l1 + far * l0) / both;
        let l = (middle * middle + h2).sqrt();
        // Compute tan α from sin 2α and cos 2α, both times l0·l1, without cancellation.
        let (sin, cos) = (2.0 * self.radius * height, near * far + h2);
        let a = if cos > 0.0 { sin / (l0 * l1 + cos) } else { (l0 * l1 - cos) / sin };
        let b = 2.0 * self.radius * (l0 * l1).sqrt() / (both * l);
        let down = -self.normal;
        let (a2, b2) = (1.0 + a * a, 1.0 + b * b);
        DiskView {
            axes: [
                (out * middle + down * height) / l,
                (out * height - down * middle) / l,
                self.normal.cross(out),
            ],
            a,
            b,
            p: a2 + a2.sqrt(),
            q: b2 + b2.sqrt(),
            height,
            farthest: l1,
        }
    }

    /// Unit normal on the front side.
    #[inline(always)]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }
}

impl DiskView {
    /// Whether the front is visible.
    #[inline(always)]
    pub fn is_front_visible(&self) -> bool {
        self.height > 0.0
    }

    /// Upper bound on the solid angle. It is at most 20 % too large.
    #[inline(always)]
    pub fn solid_angle_bound(&self) -> f64 {
        TAU * self.a * self.b / (self.p * self.q).sqrt()
    }

    /// Samples a direction. Returns the direction, the distance to the disk's plane, and the inverse pdf.
    ///
    /// On the plane perpendicular to the axis at distance 1, the ellipse is (a·r·cos φ, b·r·sin φ) with r in
    /// [0, 1]. A slice dφ has the solid angle a·b/(Q + √Q) dφ with Q = 1 + a²cos²φ + b²sin²φ, and the cosine
    /// of the angle to the axis is uniform within the slice. The density of φ is proportional to 1/(p·cos²φ +
    /// q·sin²φ). This denominator equals Q + √Q at both axes, and is at least (Q + √Q)/1.2 in between.
    #[inline(always)]
    pub fn sample(&self, normal: DVec3, u: [f32; 2]) -> (DVec3, f64, f64) {
        let (sin, cos) = sin_cos(std::f32::consts::TAU * u[1]);
        let (x, y) = (f64::from(cos) * self.q.sqrt(), f64::from(sin) * self.p.sqrt());
        let scale = 1.0 / (x * x + y * y).sqrt();
        let (cos, sin) = (x * scale, y * scale);
        let (x, y) = (self.a * cos, self.b * sin);
        let slope2 = x * x + y * y;
        let (q, root) = (1.0 + slope2, (1.0 + slope2).sqrt());
        let versine = f64::from(u[0]) * slope2 / (q + root);
        let across = (versine * (2.0 - versine)).sqrt() / slope2.sqrt();
        let [axis, along, beside] = self.axes;
        let direction = axis * (1.0 - versine) + (along * x + beside * y) * across;
        let distance = self.height / -direction.dot(normal);
        let distance = if (distance > 0.0) & (distance < self.farthest) { distance } else { self.farthest };
        (direction, distance, self.inverse_pdf(cos * cos, q + root))
    }

    /// Computes the inverse pdf from cos²φ and Q + √Q.
    #[inline(always)]
    fn inverse_pdf(&self, cos2: f64, slice: f64) -> f64 {
        self.solid_angle_bound() * (self.p * cos2 + self.q * (1.0 - cos2)) / slice
    }

    /// Pdf in sr⁻¹ of a direction inside the cone.
    pub fn pdf(&self, direction: Vec3) -> f64 {
        let direction = direction.as_dvec3();
        let [_, along, beside] = self.axes;
        let (x, y) = (direction.dot(along) / self.a, direction.dot(beside) / self.b);
        let cos2 = if x == 0.0 && y == 0.0 { 1.0 } else { x * x / (x * x + y * y) };
        let q = 1.0 + self.a * self.a * cos2 + self.b * self.b * (1.0 - cos2);
        1.0 / self.inverse_pdf(cos2, q + q.sqrt())
    }
}

/// A unit vector perpendicular to `n`.
#[inline(always)]
pub fn perpendicular(n: DVec3) -> DVec3 {
    let is_x = n.x.abs() < 0.6;
    let other = if is_x { DVec3::X } else { DVec3::Y };
    let across = n.cross(other);
    across / across.length()
}
