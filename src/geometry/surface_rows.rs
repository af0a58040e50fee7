//! Surfaces at the hits of a packet, side by side, for the shapes that are most seen.

use super::rows::{HitRows, PACKET, RayRows};
use super::surface::error;
use super::{RayF64, Shape, ShapeHit};
use crate::math::DVec3;
use crate::math::lanes::{Lanes3, set_lane, take, truths};

/// What of [`SurfacePoint`](super::SurfacePoint)s lights need, side by side; without shading normals.
#[derive(Clone, Debug)]
pub struct SurfaceRow {
    /// The points.
    pub point: Lanes3,
    /// Bounds on their errors.
    pub error: Lanes3,
    /// Unit geometric normals of the front sides.
    pub normal: Lanes3,
}

/// A point of a surface before it is rounded.
pub struct ExactPoint {
    /// The point.
    pub point: DVec3,
    /// Normal of the front side, of any length.
    pub normal: DVec3,
    /// The greatest length that the point is computed from.
    pub reach: f64,
}

/// A shape whose surface is found without branches.
pub trait Exact {
    /// The surface at a hit.
    fn exact(&self, ray: &RayF64, hit: &ShapeHit) -> ExactPoint;
}

impl SurfaceRow {
    /// Nothing known.
    pub const EMPTY: Self =
        Self { point: [[0.0; PACKET]; 3], error: [[0.0; PACKET]; 3], normal: [[0.0; PACKET]; 3] };

    /// The surfaces of those hits of a packet whose bits are set, all of one shape; whether there is a loop for it.
    #[inline(always)]
    pub fn fill(&mut self, shape: &Shape, rays: &RayRows, hits: &HitRows, of: u32) -> bool {
        match shape {
            Shape::Sphere(sphere) => self.fill_from(sphere, rays, hits, of),
            Shape::Quad(quad) => self.fill_from(quad, rays, hits, of),
            Shape::Plane(plane) => self.fill_from(plane, rays, hits, of),
            Shape::Box(cuboid) => self.fill_from(cuboid, rays, hits, of),
            Shape::Triangle(triangle) => self.fill_from(triangle, rays, hits, of),
            Shape::Disk(_) | Shape::Cylinder(_) | Shape::Cone(_) | Shape::Torus(_) => return false,
        }
        true
    }

    #[inline(always)]
    fn fill_from(&mut self, shape: &impl Exact, rays: &RayRows, hits: &HitRows, of: u32) {
        let mut found = Self::EMPTY;
        for lane in 0..PACKET {
            let hit = ShapeHit {
                t: hits.t[lane],
                primitive: hits.primitive[lane],
                u: hits.u[lane],
                v: hits.v[lane],
            };
            let ExactPoint { point, normal, reach } = shape.exact(&rays.line(lane), &hit);
            let point = point.as_vec3();
            set_lane(&mut found.point, lane, point);
            set_lane(&mut found.error, lane, error(point, reach));
            set_lane(&mut found.normal, lane, normal.normalize().as_vec3());
        }
        let of = truths(of);
        for axis in 0..3 {
            take(&of, &found.point[axis], &mut self.point[axis]);
            take(&of, &found.error[axis], &mut self.error[axis]);
            take(&of, &found.normal[axis], &mut self.normal[axis]);
        }
    }
}
