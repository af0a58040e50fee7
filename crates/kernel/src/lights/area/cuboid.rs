//! Box lights. The visible faces are sampled by solid angle.

use super::quad::SphericalRectangle;
use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::geometry::cuboid::OrientedBox;
use crate::math::{DVec3, Vec3};

/// A box that emits outward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxEmitter {
    center: DVec3,
    /// Half of each edge length.
    half: [f32; 3],
    /// Unit vectors along the axes.
    axes: [Vec3; 3],
}

/// A box seen from a point, mirrored to put the point on the positive side of each axis.
struct BoxView {
    /// Signs of the point's coordinates.
    signs: [f32; 3],
    /// The faces on the positive sides of the axes. Each face's coordinates are along the next two axes in
    /// cyclic order.
    faces: [BoxFaceView; 3],
}

/// A face seen from a point.
#[derive(Clone, Copy)]
struct BoxFaceView {
    rectangle: SphericalRectangle,
    /// Solid angle in sr. Approximate for small faces, and 0 if the face is seen from behind.
    solid_angle: f32,
}

impl ShapeEmitter for BoxEmitter {
    /// Chooses a face with a probability proportional to its solid angle, then samples the face uniformly
    /// over this solid angle.
    #[inline(always)]
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let BoxView { signs, faces } = self.view_from(point);
        let [a, b, c] = faces.map(|face| face.solid_angle);
        let total = a + b + c;
        let target = u[0] * total;
        let is_first = (target < a) | ((b == 0.0) & (c == 0.0));
        let is_second = !is_first & ((target < a + b) | (c == 0.0));
        let of = |values: [f32; 3]| {
            let rest = if is_second { values[1] } else { values[2] };
            if is_first { values[0] } else { rest }
        };
        let face = BoxFaceView {
            rectangle: SphericalRectangle::combine_three_by_field(faces.map(|face| face.rectangle), of),
            solid_angle: of([a, b, c]),
        };
        let rest = (target - of([0.0, a, a + b])) / face.solid_angle;
        let rest = rest.max(0.0).min(1.0_f32.next_down());
        let (x, y, own) = face.sample([rest, u[1]]);
        let z = face.rectangle.z();
        let local = [of([z, y, x]) * signs[0], of([x, z, y]) * signs[1], of([y, x, z]) * signs[2]];
        let offset = self.axes[0] * local[0] + self.axes[1] * local[1] + self.axes[2] * local[2];
        let factor = own * (total / face.solid_angle);
        SampledLightPoint {
            direction: offset * (1.0 / offset.length_squared().sqrt()),
            target: point + offset,
            factor: if total > 0.0 { factor } else { 0.0 },
        }
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        let BoxView { faces, .. } = self.view_from(from);
        let total: f32 = faces.iter().map(|face| face.solid_angle).sum();
        let own = faces.iter().zip(self.axes).enumerate();
        let own = own.into_iter().find(|(_, (_, axis))| axis.dot(hit.normal).abs() > 0.9);
        match own {
            Some((_, (face, _))) if !(face.solid_angle > 0.0) => 0.0,
            Some((_, (face, _))) if face.rectangle.has_accurate_solid_angle() => 1.0 / total,
            Some((k, (face, _))) => {
                let area = 4.0 * self.half[(k + 1) % 3] * self.half[(k + 2) % 3];
                hit.uniform_area_solid_angle_pdf(f64::from(area)) * (face.solid_angle / total)
            }
            None => 0.0,
        }
    }

    fn area_centroid(&self) -> DVec3 {
        self.center
    }
}

impl BoxEmitter {
    /// Creates an emitter for an entire box.
    pub fn new(cuboid: &OrientedBox) -> Self {
        let axes = cuboid.axes();
        Self {
            center: cuboid.centroid(),
            half: cuboid.half_extent().as_vec3().to_array(),
            axes: [axes.x_axis, axes.y_axis, axes.z_axis].map(DVec3::as_vec3),
        }
    }

    #[inline(always)]
    fn view_from(&self, point: Vec3) -> BoxView {
        let from_center = (point.as_dvec3() - self.center).as_vec3();
        let local = self.axes.map(|axis| from_center.dot(axis));
        let face = |k: usize| {
            let side = |i: usize| [-self.half[i] - local[i].abs(), self.half[i] - local[i].abs()];
            BoxFaceView::new(side((k + 1) % 3), side((k + 2) % 3), self.half[k] - local[k].abs())
        };
        BoxView { signs: local.map(|x| 1.0_f32.copysign(x)), faces: [face(0), face(1), face(2)] }
    }
}

impl BoxFaceView {
    /// Creates a face from its coordinate ranges relative to the point. z is negative if the point is in
    /// front of the face.
    #[inline(always)]
    fn new(x: [f32; 2], y: [f32; 2], z: f32) -> Self {
        let rectangle = SphericalRectangle::new(x, y, z);
        let (_, _, by_area) = rectangle.sample_by_area([0.5; 2]);
        let solid_angle =
            if rectangle.has_accurate_solid_angle() { rectangle.solid_angle() } else { by_area };
        Self { rectangle, solid_angle: if z < 0.0 { solid_angle } else { 0.0 } }
    }

    /// Samples a point on the face. Returns the point and the inverse pdf of its direction.
    #[inline(always)]
    fn sample(&self, u: [f32; 2]) -> (f32, f32, f32) {
        let rectangle = &self.rectangle;
        let (by_area, [x, y]) = (rectangle.sample_by_area(u), rectangle.sample(u));
        let is_accurate = rectangle.has_accurate_solid_angle();
        (
            if is_accurate { x } else { by_area.0 },
            if is_accurate { y } else { by_area.1 },
            if is_accurate { rectangle.solid_angle() } else { by_area.2 },
        )
    }
}
