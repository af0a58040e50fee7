//! Rays, boxes, shapes and hits with error bounds.
//!
//! Mesh triangles are intersected in `f32` with a watertight test. All other shapes (flat shapes, quadrics,
//! and tori) are intersected in `f64`, so their rounding errors are invisible to `f32` rays.

pub mod aabb;
pub mod cone;
pub mod cuboid;
pub mod cylinder;
pub mod disk;
pub mod local_geometry;
pub mod mesh;
pub mod packet;
pub mod parallelogram;
pub mod plane;
pub mod ray;
pub mod sphere;
pub mod surface;
mod surface_of_revolution;
pub mod surface_packet;
pub mod torus;
pub mod transformed;
pub mod triangle;
pub mod triangle_list;
pub mod watertight;
pub mod watertight_packet;

pub use aabb::Aabb;
pub use local_geometry::LocalGeometry;
pub use ray::{Ray, RayF64};
pub use surface::{ShapeHit, SurfacePoint, SurfaceRequest, SurfaceSample};

use crate::math::lanes::Simd;
use crate::math::{DVec2, DVec3, Vec2};
use cone::Cone;
use cuboid::OrientedBox;
use cylinder::Cylinder;
use disk::Disk;
use local_geometry::{FlatPolygon, parallelogram_polygon};
use packet::{F32x16, HitPacket, RayPacket};
use parallelogram::Parallelogram;
use plane::Plane;
use sphere::Sphere;
use surface_packet::{SurfaceF64 as _, SurfacePacket, SurfacePointF64};
use torus::Torus;
use transformed::TransformedShape;
use triangle::Triangle;

/// An analytic shape in world coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A sphere.
    Sphere(Sphere),
    /// A parallelogram.
    Quad(Parallelogram),
    /// An infinite plane.
    Plane(Plane),
    /// An oriented box.
    Box(OrientedBox),
    /// A single triangle.
    Triangle(Triangle),
    /// A disk.
    Disk(Disk),
    /// A cylinder.
    Cylinder(Cylinder),
    /// A cone.
    Cone(Cone),
    /// A torus.
    Torus(Torus),
    /// Any of these shapes under an affine transform.
    Transformed(Box<TransformedShape>),
}

/// Evaluates an expression with `$it` bound to the concrete shape.
macro_rules! for_shape {
    ($shape:expr, $it:ident => $body:expr) => {
        match $shape {
            Shape::Sphere($it) => $body,
            Shape::Quad($it) => $body,
            Shape::Plane($it) => $body,
            Shape::Box($it) => $body,
            Shape::Triangle($it) => $body,
            Shape::Disk($it) => $body,
            Shape::Cylinder($it) => $body,
            Shape::Cone($it) => $body,
            Shape::Torus($it) => $body,
            Shape::Transformed($it) => $body,
        }
    };
}

impl Shape {
    /// Finds the nearest hit.
    #[inline]
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        for_shape!(self, it => it.intersect(ray))
    }

    /// Finds the nearest hits of the rays in `active`, with SIMD if the shape supports it. All other rays
    /// must have negative ends, and `found` must not contain hits.
    #[inline(always)]
    pub fn intersect_packet(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        found: &mut HitPacket,
        simd: impl Simd,
    ) {
        match self {
            Self::Plane(plane) => plane.intersect_packet(rows, ends, found, simd),
            Self::Quad(quad) => quad.intersect_packet(rows, ends, found, simd),
            Self::Sphere(sphere) => sphere.intersect_packet(rows, ends, found, simd),
            Self::Box(cuboid) => cuboid.intersect_packet(rows, ends, found),
            Self::Triangle(triangle) => triangle.intersect_packet(rows, ends, found),
            Self::Disk(disk) => disk.intersect_packet(rows, ends, found),
            Self::Cylinder(_) | Self::Cone(_) | Self::Torus(_) | Self::Transformed(_) => {
                self.intersect_each_lane(rows, active, ends, found);
            }
        }
    }

    #[inline(never)]
    fn intersect_each_lane(&self, rays: &RayPacket, active: u32, ends: &F32x16, found: &mut HitPacket) {
        for lane in packet::set_bit_lanes(active) {
            if let Some(hit) = self.intersect(&Ray { t_max: ends[lane], ..rays.ray(lane) }.to_f64()) {
                found.set(lane, &hit);
            }
        }
    }

    /// Implements [`SurfacePacket::try_fill_points_of_shape_lanes`]. Returns whether the shape supports SIMD.
    #[inline(always)]
    fn try_fill_surfaces(
        &self,
        row: &mut SurfacePacket,
        rays: &RayPacket,
        hits: &HitPacket,
        of: u32,
    ) -> bool {
        match self {
            Self::Sphere(sphere) => row.fill_point_lanes_with_simd(sphere, rays, hits, of),
            Self::Quad(quad) => row.fill_point_lanes_with_simd(quad, rays, hits, of),
            Self::Plane(plane) => row.fill_point_lanes_with_simd(plane, rays, hits, of),
            Self::Box(cuboid) => row.fill_point_lanes_with_simd(cuboid, rays, hits, of),
            Self::Triangle(triangle) => row.fill_point_lanes_with_simd(triangle, rays, hits, of),
            Self::Disk(_) | Self::Cylinder(_) | Self::Cone(_) | Self::Torus(_) | Self::Transformed(_) => {
                return false;
            }
        }
        true
    }

    /// Implements [`SurfacePacket::fill_uv_of_shape_lanes`]. Returns whether the shape supports SIMD.
    #[inline(always)]
    fn try_fill_uvs(&self, row: &mut SurfacePacket, rays: &RayPacket, hits: &HitPacket, of: u32) -> bool {
        match self {
            Self::Quad(quad) => row.fill_uv_lanes_with_simd(quad, rays, hits, of),
            Self::Plane(plane) => row.fill_uv_lanes_with_simd(plane, rays, hits, of),
            Self::Sphere(_)
            | Self::Box(_)
            | Self::Triangle(_)
            | Self::Disk(_)
            | Self::Cylinder(_)
            | Self::Cone(_)
            | Self::Torus(_)
            | Self::Transformed(_) => return false,
        }
        true
    }

    /// Surface point at a hit.
    #[inline]
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        for_shape!(self, it => it.surface_point_at_hit(ray, hit))
    }

    /// Surface point at a hit, with at least the requested fields.
    #[inline]
    pub fn surface_point_with_fields(
        &self,
        ray: &RayF64,
        hit: &ShapeHit,
        request: SurfaceRequest,
    ) -> SurfacePoint {
        if request.uv {
            self.surface_point_at_hit(ray, hit)
        } else {
            self.surface_point_f64(ray, hit).to_surface_point_without_uv()
        }
    }

    /// Surface point at a hit, before rounding.
    #[inline]
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        for_shape!(self, it => it.surface_point_f64(ray, hit))
    }

    /// Bounding box, or `None` if the shape is infinite.
    #[inline]
    pub fn bounds(&self) -> Option<Aabb> {
        match self {
            Self::Sphere(sphere) => Some(sphere.bounds()),
            Self::Quad(quad) => Some(quad.bounds()),
            Self::Plane(_) => None,
            Self::Box(cuboid) => Some(cuboid.bounds()),
            Self::Triangle(triangle) => Some(triangle.bounds()),
            Self::Disk(disk) => Some(disk.bounds()),
            Self::Cylinder(cylinder) => Some(cylinder.bounds()),
            Self::Cone(cone) => Some(cone.bounds()),
            Self::Torus(torus) => Some(torus.bounds()),
            Self::Transformed(transformed) => transformed.bounds(),
        }
    }

    /// Number of triangles in the shape.
    pub fn triangle_count(&self) -> u64 {
        match self {
            Self::Triangle(_) => 1,
            Self::Sphere(_)
            | Self::Quad(_)
            | Self::Plane(_)
            | Self::Box(_)
            | Self::Disk(_)
            | Self::Cylinder(_)
            | Self::Cone(_)
            | Self::Torus(_) => 0,
            Self::Transformed(transformed) => transformed.shape.triangle_count(),
        }
    }

    /// Areas of the parts, indexed like `ShapeHit::primitive`. Empty if the shape is infinite. If the shape
    /// is transformed, these are the areas before the transform; see [`Shape::area_scale_for_world_normal`].
    pub fn local_part_areas(&self) -> Vec<f64> {
        for_shape!(self, it => it.local_part_areas().to_vec())
    }

    /// Samples a point on a part, uniformly over its area in [`Shape::local_part_areas`]. `u` is uniform in
    /// [0, 1)².
    pub fn sample_point_on_part(&self, part: u32, u: Vec2) -> SurfaceSample {
        for_shape!(self, it => it.sample_point_on_part(part, u))
    }

    /// Factor that converts [`Shape::local_part_areas`] to world-space area at a point with this unit normal.
    /// 1 unless the shape is transformed.
    #[inline]
    pub fn area_scale_for_world_normal(&self, normal: DVec3) -> f64 {
        if let Self::Transformed(transformed) = self {
            transformed.area_scale_for_world_normal(normal)
        } else {
            1.0
        }
    }

    /// Centroid of the surface. For a transformed shape, the image of the centroid.
    pub fn centroid(&self) -> DVec3 {
        for_shape!(self, it => it.centroid())
    }

    /// Whether a point is inside.
    pub fn encloses_point(&self, point: DVec3) -> bool {
        for_shape!(self, it => it.encloses(point))
    }

    /// Whether the shape encloses a volume. A plane encloses the half-space behind it.
    #[inline]
    pub fn is_closed(&self) -> bool {
        match self {
            Self::Sphere(_) | Self::Box(_) | Self::Torus(_) | Self::Plane(_) => true,
            Self::Cylinder(cylinder) => cylinder.is_capped(),
            Self::Cone(cone) => cone.is_capped(),
            Self::Quad(_) | Self::Triangle(_) | Self::Disk(_) => false,
            Self::Transformed(transformed) => transformed.shape.is_closed(),
        }
    }

    /// Whether a point is inside, or behind the shape if it is a plane. Returns `None` if the shape encloses
    /// no volume.
    #[inline]
    pub fn encloses_point_if_closed(&self, point: DVec3) -> Option<bool> {
        self.encloses_points_if_closed([point]).map(|[is_inside]| is_inside)
    }

    /// [`Shape::encloses_point_if_closed`] for several points.
    #[inline]
    pub fn encloses_points_if_closed<const COUNT: usize>(
        &self,
        points: [DVec3; COUNT],
    ) -> Option<[bool; COUNT]> {
        match self {
            Self::Plane(plane) => Some(points.map(|point| plane.is_behind(point))),
            Self::Transformed(transformed) => transformed.encloses_points_if_closed(points),
            Self::Sphere(_)
            | Self::Box(_)
            | Self::Torus(_)
            | Self::Cylinder(_)
            | Self::Cone(_)
            | Self::Quad(_)
            | Self::Triangle(_)
            | Self::Disk(_) => {
                self.is_closed().then(|| for_shape!(self, it => points.map(|point| it.encloses(point))))
            }
        }
    }

    /// Texture coordinates of a point on the surface.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        for_shape!(self, it => it.uv_at_point(point))
    }

    /// Mean curvature at a point on a part. Positive if the front is convex.
    #[inline]
    pub fn mean_curvature(&self, part: u32, point: DVec3) -> f64 {
        match self {
            Self::Quad(_) | Self::Plane(_) | Self::Box(_) | Self::Triangle(_) | Self::Disk(_) => 0.0,
            Self::Sphere(sphere) => 1.0 / sphere.radius,
            Self::Cylinder(cylinder) => cylinder.mean_curvature(part),
            Self::Cone(cone) => cone.mean_curvature(part, point),
            Self::Torus(torus) => torus.mean_curvature(point),
            Self::Transformed(transformed) => transformed.mean_curvature(part, point),
        }
    }

    /// Curvature of the meridian through a point on a curved part, and unit tangents along the meridian and
    /// around the axis, which are the principal directions. Returns `None` for all shapes except spheres,
    /// cylinders, cones and tori.
    fn meridian_curvature_and_tangents(&self, point: DVec3) -> Option<(f64, [DVec3; 2])> {
        match self {
            Self::Sphere(sphere) => {
                let (a, b) = (point - sphere.center).normalize_or(DVec3::Y).any_orthonormal_pair();
                Some((1.0 / sphere.radius, [a, b]))
            }
            Self::Cylinder(cylinder) => Some((0.0, cylinder.meridian_and_azimuth_tangents(point))),
            Self::Cone(cone) => Some((0.0, cone.meridian_and_azimuth_tangents(point))),
            Self::Torus(torus) => {
                Some((1.0 / torus.tube_radius(), torus.meridian_and_azimuth_tangents(point)))
            }
            Self::Quad(_)
            | Self::Plane(_)
            | Self::Box(_)
            | Self::Triangle(_)
            | Self::Disk(_)
            | Self::Transformed(_) => None,
        }
    }

    /// Local geometry of the shape near a point, for density estimation.
    #[inline]
    pub fn local_geometry_near(&self, point: DVec3) -> LocalGeometry {
        match self {
            Self::Quad(_) | Self::Triangle(_) => LocalGeometry::Polygons(1),
            Self::Box(_) => LocalGeometry::Polygons(6),
            Self::Sphere(sphere) => sphere.local_geometry_near(point),
            Self::Plane(plane) => plane.local_geometry_near(point),
            Self::Disk(disk) => disk.local_geometry_near(point),
            Self::Cylinder(cylinder) => {
                LocalGeometry::from_distance_to_curved_surface(cylinder.distance_from_point(point))
            }
            Self::Cone(cone) => {
                LocalGeometry::from_distance_to_curved_surface(cone.distance_from_point(point))
            }
            Self::Torus(torus) => {
                LocalGeometry::from_distance_to_curved_surface(torus.distance_from_point(point))
            }
            Self::Transformed(transformed) => transformed.local_geometry_near(point),
        }
    }

    /// Returns the flat polygon with the given index, or `None` if the index is out of range or the shape is
    /// not made of flat polygons.
    #[inline]
    pub fn polygon_face(&self, number: u32) -> Option<FlatPolygon> {
        match self {
            Self::Quad(quad) => (number < 1).then(|| parallelogram_polygon((quad.corner, quad.u, quad.v))),
            Self::Triangle(triangle) => {
                (number < 1).then(|| [triangle.a, triangle.b, triangle.c].into_iter().collect())
            }
            Self::Box(cuboid) => (number < 6).then(|| parallelogram_polygon(cuboid.face(number))),
            Self::Sphere(_)
            | Self::Plane(_)
            | Self::Disk(_)
            | Self::Cylinder(_)
            | Self::Cone(_)
            | Self::Torus(_) => None,
            Self::Transformed(transformed) => transformed.polygon_face(number),
        }
    }

    /// Whether a ray that crosses the surface at a point must travel farther than `distance` before it can
    /// hit the shape again. False if unknown.
    #[inline]
    pub fn is_locally_thicker_than(&self, point: DVec3, distance: f64) -> bool {
        match self {
            Self::Sphere(sphere) => sphere.radius > distance,
            Self::Box(cuboid) => cuboid.is_near_only_one_face(point, distance),
            Self::Transformed(transformed) => transformed.is_locally_thicker_than(point, distance),
            Self::Quad(_)
            | Self::Plane(_)
            | Self::Triangle(_)
            | Self::Disk(_)
            | Self::Cylinder(_)
            | Self::Cone(_)
            | Self::Torus(_) => false,
        }
    }

    /// Projected area: the surface area facing a unit direction, weighted by the cosine. For a torus, this is
    /// the mean over all directions.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        for_shape!(self, it => it.projected_area(direction))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec4;

    /// Shapes of each kind, before and after a transform that mirrors them.
    fn shapes() -> Vec<Shape> {
        let plain = untransformed_shapes();
        let mirrored = plain.clone().map(|shape| transformed::tests::sheared(shape, -1.0));
        plain.into_iter().chain(mirrored).collect()
    }

    /// The shape before its transform, and whether it has a transform.
    fn untransformed(shape: &Shape) -> (&Shape, bool) {
        if let Shape::Transformed(own) = shape { (&own.shape, true) } else { (shape, false) }
    }

    fn untransformed_shapes() -> [Shape; 11] {
        let (p, q) = (DVec3::new(0.3, -0.2, 0.1), DVec3::new(1.0, 0.5, -0.4));
        [
            Shape::Sphere(Sphere { center: p, radius: 0.7 }),
            Shape::Quad(Parallelogram::new(p, DVec3::X, q)),
            Shape::Box(OrientedBox::new(p, DVec3::new(1.0, 0.4, 2.0), DVec3::new(10.0, 70.0, -30.0))),
            Shape::Triangle(Triangle { a: p, b: q, c: DVec3::Y }),
            Shape::Disk(Disk::new(p, q, 0.6)),
            Shape::Cylinder(Cylinder::new(p, q, 0.5, true)),
            Shape::Cylinder(Cylinder::new(p, q, 0.5, false)),
            Shape::Cone(Cone::new(p, q, 0.4, true)),
            Shape::Cone(Cone::new(p, q, 0.4, false)),
            Shape::Torus(Torus::new(p, q, 1.0, 0.4)),
            Shape::Plane(Plane::new(p, q)),
        ]
    }

    const SIDE: u32 = 400;

    /// A regular grid over the unit square.
    fn grid(side: u32) -> impl Iterator<Item = Vec2> {
        (0..side * side)
            .map(move |i| Vec2::new((i % side) as f32 + 0.5, (i / side) as f32 + 0.5) / side as f32)
    }

    /// Integrates several functions over the surface.
    fn integrals(shape: &Shape, functions: impl Fn(&SurfaceSample) -> DVec4) -> DVec4 {
        let side = 100;
        let over_part = |(part, area): (u32, f64)| {
            let values =
                |place: SurfaceSample| functions(&place) * shape.area_scale_for_world_normal(place.normal);
            let sum: DVec4 = grid(side).map(|u| values(shape.sample_point_on_part(part, u))).sum();
            sum * area / f64::from(side * side)
        };
        (0..).zip(shape.local_part_areas()).map(over_part).sum()
    }

    /// Hits of rays aimed at the shape from a surrounding sphere.
    fn hits(shape: &Shape) -> impl Iterator<Item = (RayF64, ShapeHit)> + '_ {
        (0..4000).filter_map(move |i| {
            let around = Shape::Sphere(Sphere { center: shape.centroid(), radius: 5.0 });
            let u = |i: u32| Vec2::new(i as f32 * 0.618_034 % 1.0, i as f32 * 0.754_877_7 % 1.0);
            let from = around.sample_point_on_part(0, u(i)).point;
            let near = Shape::Sphere(Sphere { center: shape.centroid(), radius: 0.8 });
            let to = near.sample_point_on_part(0, u(3 * i + 7)).point;
            let ray = Ray::new(from.as_vec3(), (to - from).as_vec3()).to_f64();
            shape.intersect(&ray).map(|hit| (ray, hit))
        })
    }

    #[test]
    fn sampled_points_are_on_the_shape() {
        for shape in shapes() {
            for (part, _) in (0_u32..).zip(shape.local_part_areas()).filter(|(_, area)| *area > 0.0) {
                for i in 0..200_u32 {
                    let u = Vec2::new((i as f32 + 0.5) * 0.618_034 % 1.0, (i as f32 + 0.5) / 200.0);
                    let place = shape.sample_point_on_part(part, u);
                    assert!((place.normal.length() - 1.0).abs() < 1e-9, "{shape:?}");
                    let from = place.point + place.normal * 0.01;
                    let ray = Ray::new(from.as_vec3(), -place.normal.as_vec3()).to_f64();
                    let hit = shape.intersect(&ray).unwrap_or_else(|| panic!("{shape:?} {part} {u}"));
                    assert!((hit.t - 0.01).abs() < 1e-5, "{shape:?} {part} {u}: {hit:?}");
                    assert_eq!(hit.primitive, part, "{shape:?} {u}");
                    let normal = shape.surface_point_at_hit(&ray, &hit).normal.as_dvec3();
                    assert!((normal - place.normal).length() < 1e-4, "{shape:?} {u}: {normal}");
                }
            }
        }
    }

    #[test]
    fn surfaces_match_with_and_without_uvs() {
        for shape in shapes() {
            for (ray, hit) in hits(&shape).take(1000) {
                let [bare, full] = [false, true].map(|uv| {
                    shape.surface_point_with_fields(&ray, &hit, SurfaceRequest { uv, shadow_point: true })
                });
                let parts =
                    |of: &SurfacePoint| [of.point, of.error, of.normal, of.shadow_point, of.shading_normal];
                assert_eq!(parts(&bare), parts(&full), "{shape:?} {ray:?}");
                let at = ray.at(f64::from(hit.t));
                let off = (bare.point.as_dvec3() - at).abs().max_element();
                assert!(off < 1e-5 * (1.0 + at.length()), "{shape:?}: {off}");
            }
        }
    }

    #[test]
    fn projected_area_integrates_the_cosines() {
        for shape in shapes().into_iter().filter(|shape| !shape.local_part_areas().is_empty()) {
            let directions = [DVec3::X, DVec3::NEG_Y, DVec3::new(-0.3, 0.5, 0.8).normalize()];
            if matches!(untransformed(&shape), (Shape::Torus(_), true)) {
                continue;
            }
            let integrals = integrals(&shape, |place| {
                DVec3::from_array(directions.map(|direction| place.normal.dot(direction).max(0.0)))
                    .extend(1.0)
            });
            for (direction, shown) in directions.into_iter().zip(integrals.to_array()) {
                if matches!(shape, Shape::Torus(_)) {
                    // For a torus, only the mean over all directions is computed (Cauchy's formula).
                    assert_eq!(shape.projected_area(direction), shape.local_part_areas()[0] / 4.0);
                } else {
                    let off = shape.projected_area(direction) - shown;
                    assert!(off.abs() < 2e-3 * integrals.w, "{shape:?}: {off}");
                }
            }
        }
    }

    #[test]
    fn centroid_is_the_mean_of_the_points() {
        // The centroid of a transformed cone is not the image of the cone's centroid.
        let is_cone = |shape: &Shape| matches!(untransformed(shape), (Shape::Cone(_), true));
        let bounded = |shape: &Shape| !shape.local_part_areas().is_empty();
        for shape in shapes().into_iter().filter(|shape| bounded(shape) && !is_cone(shape)) {
            let integrals = integrals(&shape, |place| place.point.extend(1.0));
            let mean = integrals.truncate() / integrals.w;
            assert!((mean - shape.centroid()).abs().max_element() < 2e-3, "{shape:?}: {mean}");
        }
    }

    #[test]
    fn distance_is_to_the_nearest_point() {
        let distance = |shape: &Shape, point: DVec3| match shape.local_geometry_near(point) {
            LocalGeometry::Surface { distance, .. } => Some(distance),
            LocalGeometry::Polygons(_) => None,
        };
        for shape in shapes() {
            let parts = (0_u32..).zip(shape.local_part_areas()).filter(|(_, area)| *area > 0.0);
            let places: Vec<DVec3> = parts
                .flat_map(|(part, _)| grid(SIDE).map(move |u| (part, u)))
                .map(|(part, u)| shape.sample_point_on_part(part, u).point)
                .collect();
            for i in 0..12_u32 {
                let u = |factor: f64| (f64::from(i) + 0.5) * factor % 1.0 * 3.0 - 1.5;
                let point = shape.centroid() + DVec3::new(u(0.618_034), u(0.754_878), u(0.569_84));
                let Some(found) = distance(&shape, point).filter(|_| !places.is_empty()) else { continue };
                let nearest = places.iter().map(|place| (*place - point).length()).fold(f64::MAX, f64::min);
                // For a transformed shape, the distance is a lower bound, within the transform's condition
                // number.
                let range = if untransformed(&shape).1 { 0.3 } else { 1.0 };
                let is_near = nearest >= found - 1e-9 && found + 0.03 > range * nearest;
                assert!(is_near, "{shape:?}: {found}, {nearest}");
            }
        }
    }

    #[test]
    fn rays_hit_fronts_on_entry_and_backs_on_exit() {
        for shape in shapes() {
            let mut seen = 0;
            // A tube or an open cone also contains points, although its surface is open.
            let is_closed = match untransformed(&shape).0 {
                Shape::Sphere(_) | Shape::Box(_) | Shape::Torus(_) => true,
                Shape::Cylinder(_) | Shape::Cone(_) => {
                    shape.local_part_areas().iter().all(|&area| area > 0.0)
                }
                Shape::Quad(_)
                | Shape::Plane(_)
                | Shape::Triangle(_)
                | Shape::Disk(_)
                | Shape::Transformed(_) => false,
            };
            for (ray, hit) in hits(&shape) {
                let surface = shape.surface_point_at_hit(&ray, &hit);
                let behind = surface.point.as_dvec3() - surface.normal.as_dvec3() * 1e-3;
                let before = surface.point.as_dvec3() + surface.normal.as_dvec3() * 1e-3;
                assert!(!shape.encloses_point(before) || !is_closed, "{shape:?}");
                seen += u32::from(shape.encloses_point(behind));
            }
            assert_eq!(
                seen > 100,
                is_closed || matches!(untransformed(&shape).0, Shape::Cylinder(_) | Shape::Cone(_)),
                "{shape:?}"
            );
        }
    }

    #[test]
    fn tangents_are_derivatives_of_points() {
        for shape in shapes() {
            let mut seen = 0;
            for (ray, hit) in hits(&shape) {
                let surface = shape.surface_point_at_hit(&ray, &hit);
                let point = surface.point.as_dvec3();
                let uv = shape.uv_at_point(point);
                let (u, v) = (surface.dpdu.as_dvec3(), surface.dpdv.as_dvec3());
                // Skip steps that cross a seam, a border, or a pole.
                let step = 1e-4;
                let is_inside = |uv: DVec2| uv.min_element() > 0.02 && uv.max_element() < 0.98;
                let (kind, is_transformed) = untransformed(&shape);
                let is_round =
                    matches!(kind, Shape::Disk(_)) || hit.primitive > 0 && !matches!(kind, Shape::Box(_));
                if is_round && (surface.uv - DVec2::splat(0.5)).length() > 0.48 {
                    continue;
                }
                if !matches!(kind, Shape::Plane(_)) && !is_inside(surface.uv) {
                    continue;
                }
                seen += 1;
                assert!(
                    (uv - surface.uv).length() < 1e-5 + 1e-7 * uv.length(),
                    "{shape:?}: {uv} {}",
                    surface.uv
                );
                let moved =
                    [shape.uv_at_point(point + u * step) - uv, shape.uv_at_point(point + v * step) - uv];
                let off = (moved[0] - DVec2::X * step).length().max((moved[1] - DVec2::Y * step).length());
                assert!(off < 0.02 * step, "{shape:?} at {uv}: {moved:?}");
                // On spheres, u increases from x to z as documented, so images are mirrored. They are not
                // mirrored on other shapes.
                let is_mirrored = u.cross(v).dot(surface.normal.as_dvec3()) < 0.0;
                assert_eq!(is_mirrored, matches!(kind, Shape::Sphere(_)) != is_transformed, "{shape:?}");
                assert!((u.dot(surface.normal.as_dvec3())).abs() < 1e-5 * u.length(), "{shape:?}");
            }
            assert!(seen > 100, "{shape:?}");
        }
    }

    #[test]
    fn curvature_is_half_the_normal_divergence() {
        for shape in shapes() {
            let mut compared = 0;
            for (ray, hit) in hits(&shape).step_by(7) {
                let surface = shape.surface_point_at_hit(&ray, &hit);
                let (point, normal) = (surface.point.as_dvec3(), surface.normal.as_dvec3());
                let step = 1e-2;
                let normal_at = |aside: DVec3| {
                    let from = point + aside * step + normal * (4.0 * step);
                    let ray = RayF64 { origin: from, direction: -normal, t_max: f64::INFINITY };
                    let hit = shape
                        .intersect(&ray)
                        .filter(|near| near.primitive == hit.primitive && near.t < 0.1)?;
                    Some(shape.surface_point_at_hit(&ray, &hit).normal.as_dvec3())
                };
                let (a, b) = normal.any_orthonormal_pair();
                let along = |e: DVec3| Some((normal_at(e)? - normal_at(-e)?).dot(e) / (2.0 * step));
                let Some(divergence) = along(a).zip(along(b)).map(|(a, b)| a + b) else { continue };
                let curvature = shape.mean_curvature(hit.primitive, point);
                let allowed = 0.02 * curvature.abs() + 2e-3;
                // The finite-difference steps are too long near the tip of a cone.
                let is_tip = matches!(untransformed(&shape).0, Shape::Cone(_)) && curvature > 6.0;
                assert!(
                    is_tip || (0.5 * divergence - curvature).abs() < allowed,
                    "{shape:?}: {divergence} {curvature}"
                );
                compared += u32::from(!is_tip);
            }
            assert!(compared > 30, "{shape:?}: {compared}");
        }
    }
}
