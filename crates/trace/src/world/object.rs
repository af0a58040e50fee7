//! Objects of a scene: shapes and mesh instances.

use super::mesh_instance::MeshInstance;
use crate::accel::{F32x16, PACKET_SIZE};
use crate::geometry::packet::{HitPacket, RayPacket};
use crate::geometry::sphere::Sphere;
use crate::geometry::{Aabb, Ray, RayF64, Shape, ShapeHit, SurfacePoint, SurfaceRequest};
use crate::lights::{BoundingSphere, EmissiveObjectGeometry};
use crate::math::lanes::Simd;

/// A traceable object.
#[derive(Clone, Debug)]
pub enum Object {
    /// An analytic shape.
    Shape(Shape),
    /// An instance of a mesh.
    Mesh(Box<MeshInstance>),
}

impl Object {
    /// Returns the nearest hit.
    pub fn closest_hit(&self, ray: &Ray, ray_f64: &RayF64) -> Option<ShapeHit> {
        match self {
            Self::Shape(shape) => shape.intersect(ray_f64),
            Self::Mesh(mesh) => mesh.tree.triangle_tree().closest_hit(&mesh.local_ray(ray)),
        }
    }

    /// Whether the ray hits any primitive of the object except `except`.
    pub fn any_hit(&self, ray: &Ray, ray_f64: &RayF64, except: Option<u32>) -> bool {
        match self {
            Self::Shape(shape) => shape.intersect(ray_f64).is_some_and(|hit| Some(hit.primitive) != except),
            Self::Mesh(mesh) => mesh.tree.triangle_tree().any_hit(&mesh.local_ray(ray), except),
        }
    }

    /// Finds the nearest hits of the rays in `active` and writes them to `found`, which must be empty. Lanes
    /// outside `active` have negative `ends`.
    #[inline(always)]
    pub fn closest_hit_packet(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        found: &mut HitPacket,
        simd: impl Simd,
    ) {
        match self {
            Self::Shape(shape) => shape.intersect_packet(rows, active, ends, found, simd),
            Self::Mesh(mesh) => mesh.closest_hit_packet(rows, active, ends, found),
        }
    }

    /// Returns the mask of rays in `active` that hit the object. Lanes outside `active` have negative `ends`.
    /// `except` contains a lane mask and the primitive to ignore in each selected lane.
    #[inline(always)]
    pub fn any_hit_packet(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        except: Option<(u32, &[u32; PACKET_SIZE])>,
        simd: impl Simd,
    ) -> u32 {
        let shape = match self {
            Self::Shape(shape) => shape,
            Self::Mesh(mesh) => return mesh.any_hit_packet(rows, active, ends, except),
        };
        let mut found = HitPacket::without_hits();
        shape.intersect_packet(rows, active, ends, &mut found, simd);
        let mut hit = found.hit_mask(simd);
        if let Some((own, parts)) = except {
            for (lane, &part) in parts.iter().enumerate() {
                let bit = own & 1 << lane;
                hit &= if found.primitive[lane] == part { !bit } else { !0 };
            }
        }
        hit
    }

    /// Computes the requested surface attributes at a hit.
    pub fn surface_point_with_fields(
        &self,
        ray: &Ray,
        hit: &ShapeHit,
        request: SurfaceRequest,
    ) -> SurfacePoint {
        let ray = ray.to_f64();
        match self {
            Self::Shape(shape) => shape.surface_point_with_fields(&ray, hit, request),
            Self::Mesh(mesh) => mesh.surface_point_with_fields(&ray, hit, request),
        }
    }

    /// Bounding box, or `None` if the object is infinite.
    pub fn bounds(&self) -> Option<Aabb> {
        match self {
            Self::Shape(shape) => shape.bounds(),
            Self::Mesh(mesh) => Some(mesh.bounds()),
        }
    }

    /// A bounding sphere, or `None` if the object is infinite or empty.
    pub fn bounding_sphere(&self) -> Option<BoundingSphere> {
        if let Self::Shape(Shape::Sphere(Sphere { center, radius })) = self {
            return Some(BoundingSphere { center: *center, radius: *radius });
        }
        let bounds = self.bounds().filter(|bounds| !bounds.is_empty())?;
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        Some(BoundingSphere { center: (min + max) * 0.5, radius: (max - min).length() * 0.5 })
    }

    /// Geometry of the object as a light source.
    pub(super) fn emitter_geometry(&self) -> EmissiveObjectGeometry {
        match self {
            Self::Shape(shape) => EmissiveObjectGeometry::Shape(shape.clone()),
            Self::Mesh(mesh) => EmissiveObjectGeometry::Mesh { rounding: mesh.max_rounding_error() },
        }
    }

    /// The mesh instance, or `None` for shapes.
    pub fn mesh(&self) -> Option<&MeshInstance> {
        match self {
            Self::Shape(_) => None,
            Self::Mesh(mesh) => Some(mesh),
        }
    }

    /// Mutable version of [`Object::mesh`].
    pub(super) fn mesh_mut(&mut self) -> Option<&mut MeshInstance> {
        match self {
            Self::Shape(_) => None,
            Self::Mesh(mesh) => Some(mesh),
        }
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> u64 {
        match self {
            Self::Shape(shape) => shape.triangle_count(),
            Self::Mesh(mesh) => mesh.tree.loaded_mesh().mesh.triangles.len() as u64,
        }
    }
}

#[cfg(test)]
#[path = "packet_tests.rs"]
mod tests;
