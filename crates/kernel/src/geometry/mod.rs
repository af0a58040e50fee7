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
pub use local_geometry::NearbyGeometry;
pub use ray::{Ray, RayF64};
pub use surface::{ShapeHit, SurfacePoint, SurfaceRequest, SurfaceSample};

use crate::math::lanes::Simd;
use crate::math::{DVec2, DVec3, Vec2};
use cone::Cone;
use cuboid::OrientedBox;
use cylinder::Cylinder;
use disk::Disk;
use local_geometry::{FlatPolygon, polygon_from_parallelogram};
use packet::{F32x16, HitPacket, RayPacket};
use parallelogram::Parallelogram;
use plane::Plane;
use sphere::Sphere;
use surface_packet::{SurfacePacket, SurfacePointF64, SurfacePointsInF64 as _};
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
        for_shape!(self, it => it.volume_contains(point))
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
            | Self::Disk(_) => self
                .is_closed()
                .then(|| for_shape!(self, it => points.map(|point| it.volume_contains(point)))),
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

    /// The polygons or the surface of the shape near a point, for density estimation.
    #[inline]
    pub fn polygons_or_surface_near(&self, point: DVec3) -> NearbyGeometry {
        match self {
            Self::Quad(_) | Self::Triangle(_) => NearbyGeometry::Polygons(1),
            Self::Box(_) => NearbyGeometry::Polygons(6),
            Self::Sphere(sphere) => sphere.polygons_or_surface_near(point),
            Self::Plane(plane) => plane.polygons_or_surface_near(point),
            Self::Disk(disk) => disk.polygons_or_surface_near(point),
            Self::Cylinder(cylinder) => {
                NearbyGeometry::from_distance_to_curved_surface(cylinder.distance_from_point(point))
            }
            Self::Cone(cone) => {
                NearbyGeometry::from_distance_to_curved_surface(cone.distance_from_point(point))
            }
            Self::Torus(torus) => {
                NearbyGeometry::from_distance_to_curved_surface(torus.distance_from_point(point))
            }
            Self::Transformed(transformed) => transformed.polygons_or_surface_near(point),
        }
    }

    /// Returns the flat polygon with the given index, or `None` if the index is out of range or the shape is
    /// not made of flat polygons.
    #[inline]
    pub fn nth_polygon_face(&self, number: u32) -> Option<FlatPolygon> {
        match self {
            Self::Quad(quad) => {
                (number < 1).then(|| polygon_from_parallelogram((quad.corner, quad.u, quad.v)))
            }
            Self::Triangle(triangle) => {
                (number < 1).then(|| [triangle.a, triangle.b, triangle.c].into_iter().collect())
            }
            Self::Box(cuboid) => (number < 6).then(|| polygon_from_parallelogram(cuboid.face(number))),
            Self::Sphere(_)
            | Self::Plane(_)
            | Self::Disk(_)
            | Self::Cylinder(_)
            | Self::Cone(_)
            | Self::Torus(_) => None,
            Self::Transformed(transformed) => transformed.nth_polygon_face(number),
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
mod tests;
