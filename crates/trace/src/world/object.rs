//! Objects of a scene: shapes and meshes.

use super::mesh_instance::MeshInstance;
use crate::accel::{F32x16, PACKET_SIZE};
use crate::geometry::packet::{HitPacket, RayPacket};
use crate::geometry::sphere::Sphere;
use crate::geometry::{Aabb, Ray, RayF64, Shape, ShapeHit, SurfacePoint, SurfaceRequest};
use crate::lights::{Ball, Outline};
use crate::math::lanes::Simd;

/// An object that rays can hit.
#[derive(Clone, Debug)]
pub enum Object {
    /// A shape.
    Shape(Shape),
    /// An instance of a mesh.
    Mesh(Box<MeshInstance>),
}

impl Object {
    /// The nearest hit.
    pub fn closest(&self, ray: &Ray, ray_f64: &RayF64) -> Option<ShapeHit> {
        match self {
            Self::Shape(shape) => shape.intersect(ray_f64),
            Self::Mesh(mesh) => mesh.tree.triangles().closest(&mesh.local_ray(ray)),
        }
    }

    /// Whether the ray hits any primitive of it but `except`.
    pub fn any(&self, ray: &Ray, ray_f64: &RayF64, except: Option<u32>) -> bool {
        match self {
            Self::Shape(shape) => shape.intersect(ray_f64).is_some_and(|hit| Some(hit.primitive) != except),
            Self::Mesh(mesh) => mesh.tree.triangles().any(&mesh.local_ray(ray), except),
        }
    }

    /// The nearest hits of the rays of a packet that are in `met`; the others end below 0. `found` holds no hits
    /// before.
    #[inline(always)]
    pub fn closest_rows(
        &self,
        rows: &RayPacket,
        met: u32,
        ends: &F32x16,
        found: &mut HitPacket,
        simd: impl Simd,
    ) {
        match self {
            Self::Shape(shape) => shape.intersect_packet(rows, met, ends, found, simd),
            Self::Mesh(mesh) if mesh.has_few() => mesh.closest_of_few(rows, met, ends, found, simd),
            Self::Mesh(mesh) => mesh.closest_rows(rows, met, ends, found),
        }
    }

    /// A bit for each ray in `met` that hits it; the others end below 0. `except` holds the bits of the rays that ignore one
    /// primitive each, and these primitives.
    #[inline(always)]
    pub fn any_rows(
        &self,
        rows: &RayPacket,
        met: u32,
        ends: &F32x16,
        except: Option<(u32, &[u32; PACKET_SIZE])>,
        simd: impl Simd,
    ) -> u32 {
        let shape = match self {
            Self::Shape(shape) => shape,
            Self::Mesh(mesh) if mesh.has_few() => return mesh.any_of_few(rows, met, ends, except, simd),
            Self::Mesh(mesh) => return mesh.any_rows(rows, met, ends, except),
        };
        let mut found = HitPacket::none();
        shape.intersect_packet(rows, met, ends, &mut found, simd);
        let mut hit = found.any(simd);
        if let Some((own, parts)) = except {
            for (lane, &part) in parts.iter().enumerate() {
                let bit = own & 1 << lane;
                hit &= if found.primitive[lane] == part { !bit } else { !0 };
            }
        }
        hit
    }

    /// The requested parts of the surface at a hit.
    pub fn surface(&self, ray: &Ray, hit: &ShapeHit, asked: SurfaceRequest) -> SurfacePoint {
        let ray = ray.to_f64();
        match self {
            Self::Shape(shape) => shape.requested_surface(&ray, hit, asked),
            Self::Mesh(mesh) => mesh.surface(&ray, hit, asked),
        }
    }

    /// The box around it. `None` if it is infinite.
    pub fn bounds(&self) -> Option<Aabb> {
        match self {
            Self::Shape(shape) => shape.bounds(),
            Self::Mesh(mesh) => Some(mesh.bounds()),
        }
    }

    /// A ball around it. `None` if it is infinite or empty.
    pub fn ball(&self) -> Option<Ball> {
        if let Self::Shape(Shape::Sphere(Sphere { center, radius })) = self {
            return Some(Ball { center: *center, radius: *radius });
        }
        let bounds = self.bounds().filter(|bounds| !bounds.is_empty())?;
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        Some(Ball { center: (min + max) * 0.5, radius: (max - min).length() * 0.5 })
    }

    /// Its outline for lights that are objects.
    pub(super) fn outline(&self) -> Outline {
        match self {
            Self::Shape(shape) => Outline::Shape(*shape),
            Self::Mesh(mesh) => Outline::Mesh { rounding: mesh.rounding() },
        }
    }

    /// The instance that it is, if it is a mesh.
    pub fn mesh(&self) -> Option<&MeshInstance> {
        match self {
            Self::Shape(_) => None,
            Self::Mesh(mesh) => Some(mesh),
        }
    }

    /// [`Object::mesh`], to be changed.
    pub(super) fn mesh_mut(&mut self) -> Option<&mut MeshInstance> {
        match self {
            Self::Shape(_) => None,
            Self::Mesh(mesh) => Some(mesh),
        }
    }

    /// Number of triangles in it.
    pub fn triangle_count(&self) -> u64 {
        match self {
            Self::Shape(shape) => shape.triangle_count(),
            Self::Mesh(mesh) => mesh.tree.loaded().mesh.triangles.len() as u64,
        }
    }
}

#[cfg(test)]
#[path = "side_by_side_tests.rs"]
mod tests;
