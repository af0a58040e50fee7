//! Surfaces at the hits of a packet, side by side, for the most common shapes.

use super::rows::{HitRows, PACKET, RayRows, lanes};
use super::surface::error;
use super::{RayF64, Shape, ShapeHit, SurfacePoint};
use crate::math::lanes::{Lanes3, set_lane, take, truths};
use crate::math::{DVec2, DVec3, Vec2};

/// Parts of [`SurfacePoint`]s that lights need, side by side.
#[derive(Clone, Debug)]
pub struct SurfaceRow {
    /// The points.
    pub point: Lanes3,
    /// Bounds on their errors.
    pub error: Lanes3,
    /// Unit geometric normals of the front sides.
    pub normal: Lanes3,
    /// A bit for each lane whose shading normal and shadow point are set.
    pub smooth: u32,
    /// Unit interpolated normals on the same sides.
    pub shading_normal: Lanes3,
    /// [`SurfacePoint::shadow_point`](super::SurfacePoint::shadow_point)s.
    pub shadow_point: Lanes3,
    /// Texture coordinates, if requested.
    pub uv: [[f64; PACKET]; 2],
}

/// A point of a surface before it is rounded.
pub struct ExactPoint {
    /// The point, in world coordinates.
    pub point: DVec3,
    /// Normal of the front side, of any length.
    pub normal: DVec3,
    /// The greatest length that the point is computed from.
    pub reach: f64,
}

impl ExactPoint {
    /// The surface without texture coordinates and tangents.
    pub fn bare(&self) -> SurfacePoint {
        SurfacePoint::exact(self.point, self.normal, Vec2::ZERO, DVec3::ZERO, DVec3::ZERO, self.reach)
    }
}

/// A shape whose surface is computed in double precision.
pub trait Exact {
    /// The surface at a hit.
    fn exact(&self, ray: &RayF64, hit: &ShapeHit) -> ExactPoint;
}

/// A shape whose texture coordinates are computed without branches.
pub trait Mapped {
    /// Texture coordinates of a hit.
    fn uv(&self, ray: &RayF64, hit: &ShapeHit) -> DVec2;
}

impl Default for SurfaceRow {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl SurfaceRow {
    /// Surfaces of which nothing is known.
    pub const EMPTY: Self = Self {
        point: [[0.0; PACKET]; 3],
        error: [[0.0; PACKET]; 3],
        normal: [[0.0; PACKET]; 3],
        smooth: 0,
        shading_normal: [[0.0; PACKET]; 3],
        shadow_point: [[0.0; PACKET]; 3],
        uv: [[0.0; PACKET]; 2],
    };

    /// Computes the surfaces of the hits of a packet whose bits are set, all of one shape. Returns whether the shape
    /// has a loop for it.
    #[inline(always)]
    pub fn fill(&mut self, shape: &Shape, rays: &RayRows, hits: &HitRows, of: u32) -> bool {
        shape.fill_surfaces(self, rays, hits, of)
    }

    /// Computes the texture coordinates of the hits of a packet whose bits are set, all of one shape.
    #[inline(always)]
    pub fn fill_uv(&mut self, shape: &Shape, rays: &RayRows, hits: &HitRows, of: u32) {
        if shape.fill_uvs(self, rays, hits, of) {
            return;
        }
        for lane in lanes(of) {
            let Some(hit) = hits.get(lane) else { continue };
            let uv = shape.surface(&rays.line(lane), &hit).uv;
            (self.uv[0][lane], self.uv[1][lane]) = (uv.x, uv.y);
        }
    }

    /// [`SurfaceRow::fill_uv`] for a shape with a loop.
    #[inline(always)]
    pub(super) fn uv_from(&mut self, shape: &impl Mapped, rays: &RayRows, hits: &HitRows, of: u32) {
        for lane in 0..PACKET {
            let uv = shape.uv(&rays.line(lane), &ShapeHit::at(hits.t[lane]));
            let is_own = of & 1 << lane != 0;
            self.uv[0][lane] = if is_own { uv.x } else { self.uv[0][lane] };
            self.uv[1][lane] = if is_own { uv.y } else { self.uv[1][lane] };
        }
    }

    /// [`SurfaceRow::fill`] for a shape with a loop.
    #[inline(always)]
    pub(super) fn fill_from(&mut self, shape: &impl Exact, rays: &RayRows, hits: &HitRows, of: u32) {
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
        self.take(of, &found);
    }

    /// Takes points, errors and normals of another row.
    #[inline(always)]
    pub fn take(&mut self, of: u32, found: &Self) {
        let of = truths(of);
        for axis in 0..3 {
            take(&of, &found.point[axis], &mut self.point[axis]);
            take(&of, &found.error[axis], &mut self.error[axis]);
            take(&of, &found.normal[axis], &mut self.normal[axis]);
        }
    }

    /// Takes shading normals and shadow points of another row.
    #[inline(always)]
    pub fn take_smooth(&mut self, of: u32, found: &Self) {
        self.smooth |= of;
        let of = truths(of);
        for axis in 0..3 {
            take(&of, &found.shading_normal[axis], &mut self.shading_normal[axis]);
            take(&of, &found.shadow_point[axis], &mut self.shadow_point[axis]);
        }
    }
}
