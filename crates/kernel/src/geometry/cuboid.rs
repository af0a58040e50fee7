//! Oriented boxes in double precision.

use super::packet::{F32x16, HitPacket, RayPacket, round_t_to_f32_or_nan};
use super::surface::tangents_from_normal;
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64};
use super::{Aabb, RayF64, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::transform::rotation_xyz;
use crate::math::{DMat3, DVec2, DVec3, Vec2};

/// An oriented box. The front is outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    center: DVec3,
    half: DVec3,
    /// Axes as columns of the local-to-world matrix.
    axes: DMat3,
}

impl OrientedBox {
    /// Creates a box from its center, its positive edge lengths, and its rotation in degrees about x, then y,
    /// then z.
    pub fn new(center: DVec3, size: DVec3, rotate_degrees: DVec3) -> Self {
        Self { center, half: size * 0.5, axes: rotation_xyz(rotate_degrees) }
    }

    /// Finds the nearest hit of a ray that starts outside or inside. The face order is −x, +x, −y, +y, −z,
    /// +z.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        let origin = self.axes.transpose() * (ray.origin - self.center);
        let direction = self.axes.transpose() * ray.direction;
        let (mut near, mut far) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
        for axis in 0..3 {
            let (o, d, h) = (origin[axis], direction[axis], self.half[axis]);
            if d == 0.0 {
                if o.abs() > h {
                    return None;
                }
                continue;
            }
            let (enter, leave) = ((-h.copysign(d) - o) / d, (h.copysign(d) - o) / d);
            let positive = u32::from(d > 0.0);
            let face = 2 * axis as u32;
            if enter > near.0 {
                near = (enter, face + 1 - positive);
            }
            if leave < far.0 {
                far = (leave, face + positive);
            }
        }
        if !(near.0 <= far.0) {
            return None;
        }
        [near, far].into_iter().find_map(|(t, face)| {
            ray.round_t_if_in_range(t).map(|t| ShapeHit { t, primitive: face, u: 0.0, v: 0.0 })
        })
    }

    /// [`OrientedBox::intersect`] for a packet.
    #[inline(always)]
    pub fn intersect_packet(&self, rays: &RayPacket, ends: &F32x16, hits: &mut HitPacket) {
        let axes = [self.axes.x_axis, self.axes.y_axis, self.axes.z_axis];
        let half = self.half.to_array();
        for (lane, &end) in ends.iter().enumerate() {
            let ray = rays.ray_f64(lane);
            let from_center = ray.origin - self.center;
            let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
            let (mut near_face, mut far_face) = (0, 0);
            let mut misses_slab = false;
            for axis in 0..3 {
                let (o, d, h) = (axes[axis].dot(from_center), axes[axis].dot(ray.direction), half[axis]);
                let is_parallel = d == 0.0;
                misses_slab |= is_parallel & (o.abs() > h);
                let (enter, leave) = ((-h.copysign(d) - o) / d, (h.copysign(d) - o) / d);
                let positive = u32::from(d > 0.0);
                let face = 2 * axis as u32;
                let is_nearer = !is_parallel & (enter > near);
                near = if is_nearer { enter } else { near };
                near_face = if is_nearer { face + 1 - positive } else { near_face };
                let is_sooner = !is_parallel & (leave < far);
                far = if is_sooner { leave } else { far };
                far_face = if is_sooner { face + positive } else { far_face };
            }
            let is_hit = !misses_slab & (near <= far);
            let (enter, leave) = (round_t_to_f32_or_nan(near, end), round_t_to_f32_or_nan(far, end));
            let is_inside = enter.is_nan();
            let t = if is_inside { leave } else { enter };
            hits.t[lane] = if is_hit { t } else { f32::NAN };
            hits.primitive[lane] = if is_inside { far_face } else { near_face };
        }
    }

    /// Surface point at a hit, projected onto the face.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let SurfacePointF64 { point, normal: outwards, reach } = self.surface_point_f64(ray, hit);
        let chart = self.face_mapping(hit.primitive);
        let uv = chart.uv(self.hit_to_local_point(ray, hit));
        let FaceMapping { u, v, width, height } = chart;
        let uv = uv.as_vec2();
        SurfacePoint::from_f64(point, outwards, uv, self.axes * (u * width), self.axes * (v * height), reach)
    }

    /// Texture coordinates of a point on the surface.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        let local = self.axes.transpose() * (point - self.center);
        // The point is on the face with the largest relative coordinate.
        let axis = (local / self.half).abs().max_position();
        let face = 2 * axis as u32 + u32::from(local[axis] > 0.0);
        self.face_mapping(face).uv(local)
    }

    fn face_mapping(&self, face: u32) -> FaceMapping {
        let (u, v) = tangents_from_normal(face_axis_and_normal(face).1);
        FaceMapping { u, v, width: 2.0 * self.half.dot(u.abs()), height: 2.0 * self.half.dot(v.abs()) }
    }

    /// Whether a surface point is farther away than `margin` from all faces but one.
    pub fn is_near_only_one_face(&self, point: DVec3, margin: f64) -> bool {
        let from_center = point - self.center;
        let along = DVec3::new(
            self.axes.x_axis.dot(from_center),
            self.axes.y_axis.dot(from_center),
            self.axes.z_axis.dot(from_center),
        );
        let left = self.half - along.abs();
        let are_far = [left.x, left.y, left.z].map(|left| left > margin);
        are_far.into_iter().filter(|&is_far| is_far).count() == 2 && 2.0 * self.half.min_element() > margin
    }

    /// Local coordinates of a hit, projected onto the face.
    #[inline(always)]
    fn hit_to_local_point(&self, ray: &RayF64, hit: &ShapeHit) -> DVec3 {
        let from_center = ray.at(f64::from(hit.t)) - self.center;
        let along = |axis: DVec3, half: f64| axis.dot(from_center).max(-half).min(half);
        let DVec3 { x, y, z } = self.half;
        let n = branchless_face_normal(hit.primitive);
        let (px, py, pz) =
            (along(self.axes.x_axis, x), along(self.axes.y_axis, y), along(self.axes.z_axis, z));
        DVec3::new(
            if n.x == 0.0 { px } else { x * n.x },
            if n.y == 0.0 { py } else { y * n.y },
            if n.z == 0.0 { pz } else { z * n.z },
        )
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        let reach = DVec3::new(
            self.axes.row(0).abs().dot(self.half),
            self.axes.row(1).abs().dot(self.half),
            self.axes.row(2).abs().dot(self.half),
        );
        Aabb::from_points_f64([self.center - reach, self.center + reach])
    }

    /// A face as a parallelogram (corner, u, v) whose front faces outward.
    pub fn face(&self, face: u32) -> (DVec3, DVec3, DVec3) {
        let (_, normal) = face_axis_and_normal(face);
        let (u, v) = tangents_from_normal(normal);
        let corner = (normal - u - v) * self.half;
        (
            self.center + self.axes * corner,
            self.axes * (u * self.half * 2.0),
            self.axes * (v * self.half * 2.0),
        )
    }

    /// Half the edge lengths.
    pub fn half_extent(&self) -> DVec3 {
        self.half
    }

    /// The axes in world coordinates.
    pub fn axes(&self) -> DMat3 {
        self.axes
    }

    /// Areas of the faces.
    pub fn local_part_areas(&self) -> [f64; 6] {
        let [x, y, z] = (self.half * 2.0).to_array();
        [y * z, y * z, x * z, x * z, x * y, x * y]
    }

    /// Samples a point uniformly over the area of a face.
    pub fn sample_point_on_part(&self, face: u32, u: Vec2) -> SurfaceSample {
        let (corner, a, b) = self.face(face);
        let point = corner + a * f64::from(u.x) + b * f64::from(u.y);
        SurfaceSample { point, normal: self.axes * face_axis_and_normal(face).1 }
    }

    /// Centroid.
    pub fn centroid(&self) -> DVec3 {
        self.center
    }

    /// Whether a point is inside.
    pub fn volume_contains(&self, point: DVec3) -> bool {
        (self.axes.transpose() * (point - self.center)).abs().cmplt(self.half).all()
    }

    /// Projected area: the surface area facing a unit direction, weighted by the cosine.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        let along = (self.axes.transpose() * direction).abs();
        let [x, _, y, _, z, _] = self.local_part_areas();
        DVec3::new(x, y, z).dot(along)
    }
}

/// Texture mapping of a face: local unit vectors along u and v, and the face's edge lengths.
struct FaceMapping {
    u: DVec3,
    v: DVec3,
    width: f64,
    height: f64,
}

impl FaceMapping {
    fn uv(&self, local: DVec3) -> DVec2 {
        DVec2::new(0.5 + local.dot(self.u) / self.width, 0.5 + local.dot(self.v) / self.height)
    }
}

/// Axis and outward normal of a face.
fn face_axis_and_normal(face: u32) -> (usize, DVec3) {
    let axis = (face / 2) as usize;
    let mut normal = DVec3::ZERO;
    normal[axis] = if face % 2 == 1 { 1.0 } else { -1.0 };
    (axis, normal)
}

impl SurfacePointsInF64 for OrientedBox {
    #[inline(always)]
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let (local, n) = (self.hit_to_local_point(ray, hit), branchless_face_normal(hit.primitive));
        let out_of = |v: DVec3| self.axes.x_axis * v.x + self.axes.y_axis * v.y + self.axes.z_axis * v.z;
        let reach = self.center.abs().max_element() + self.half.length();
        SurfacePointF64 { point: self.center + out_of(local), normal: out_of(n), reach }
    }
}

/// Branchless version of [`face_axis_and_normal`] that returns only the normal.
#[inline(always)]
fn branchless_face_normal(face: u32) -> DVec3 {
    let size = if face & 1 == 1 { 1.0 } else { -1.0 };
    let on = |axis: u32| if face >> 1 == axis { size } else { 0.0 };
    DVec3::new(on(0), on(1), on(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::Vec3;

    #[test]
    fn hits_have_the_normal_of_their_face() {
        let cube = OrientedBox::new(DVec3::ZERO, DVec3::new(2.0, 4.0, 6.0), DVec3::ZERO);
        for (direction, t) in [(Vec3::X, 1.0), (Vec3::Y, 2.0), (Vec3::NEG_Z, 3.0)] {
            let inside = Ray::new(Vec3::ZERO, direction).to_f64();
            let hit = cube.intersect(&inside).expect("a ray from inside should hit");
            assert_eq!(hit.t, t);
            assert_eq!(cube.surface_point_at_hit(&inside, &hit).normal, direction);
            let outside = Ray::new(-direction * 10.0, direction).to_f64();
            let hit = cube.intersect(&outside).expect("a ray toward the center should hit");
            assert_eq!(hit.t, 10.0 - t);
            assert_eq!(cube.surface_point_at_hit(&outside, &hit).normal, -direction);
        }
    }

    #[test]
    fn rotated_boxes_are_hit_at_their_edges() {
        let cube = OrientedBox::new(DVec3::ZERO, DVec3::splat(2.0), DVec3::new(0.0, 45.0, 0.0));
        let ray = Ray::new(Vec3::new(-5.0, 0.0, 0.0), Vec3::X).to_f64();
        let hit = cube.intersect(&ray).expect("the ray should hit the edge");
        assert!((f64::from(hit.t) - (5.0 - 2.0_f64.sqrt())).abs() < 1e-6);
        assert_eq!(cube.intersect(&Ray::new(Vec3::new(-5.0, 0.0, 1.42), Vec3::X).to_f64()), None);
    }

    #[test]
    fn faces_are_outward_parallelograms() {
        let cube = OrientedBox::new(
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(10.0, 20.0, 30.0),
        );
        for face in 0..6 {
            let (corner, u, v) = cube.face(face);
            let middle = corner + (u + v) * 0.5;
            let ray = RayF64 { origin: cube.center, direction: middle - cube.center, t_max: f64::INFINITY };
            let hit = cube.intersect(&ray).expect("a ray from inside should hit");
            assert_eq!((hit.primitive, hit.t), (face, 1.0));
            let surface = cube.surface_point_at_hit(&ray, &hit);
            assert!((surface.normal - u.cross(v).normalize().as_vec3()).length() < 1e-6);
            assert!((surface.uv.as_vec2() - Vec2::splat(0.5)).length() < 1e-6);
            assert!(
                (surface.dpdu - u.as_vec3()).length() < 1e-5 && (surface.dpdv - v.as_vec3()).length() < 1e-5
            );
        }
    }
}
