//! Acceleration structure over triangles: a BVH or a kd-tree, with bit-identical hits.

use crate::accel::wide_bvh::BuildQuality;
use crate::accel::{F32x16, KdTree, RayBoxInterval, VisitedNode, WideBvh};
use crate::control::{CancelToken, Canceled};
use crate::geometry::{Aabb, Ray, ShapeHit};
use crate::math::Vec3;
use crate::scene::description::Accel;

/// An acceleration structure over numbered triangles.
#[derive(Debug)]
pub enum TriangleTree {
    /// A bounding volume hierarchy.
    Boxes(WideBvh),
    /// A kd-tree.
    Planes(KdTree),
}

impl TriangleTree {
    /// Builds a tree of this type over `count` triangles.
    pub fn build(
        accel: Accel,
        count: u32,
        corners: impl Fn(u32) -> [Vec3; 3] + Sync,
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        Ok(match accel {
            Accel::Bvh => Self::Boxes(WideBvh::build(count, corners, token)?),
            Accel::BvhHigh => {
                Self::Boxes(WideBvh::build_with_quality(BuildQuality::High, count, corners, token)?)
            }
            Accel::KdTree => Self::Planes(KdTree::from_triangles(count, corners, token)?),
        })
    }

    /// Bounding box of all triangles.
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Boxes(tree) => tree.bounds(),
            Self::Planes(tree) => tree.bounds(),
        }
    }

    /// Memory used by the tree, in bytes, including its copy of the triangles.
    pub fn memory_bytes(&self) -> usize {
        match self {
            Self::Boxes(tree) => tree.memory_bytes(),
            Self::Planes(tree) => tree.memory_bytes(),
        }
    }

    /// Returns the nearest hit. At equal distances, the lowest triangle number wins.
    pub fn closest_hit(&self, ray: &Ray) -> Option<ShapeHit> {
        match self {
            Self::Boxes(tree) => tree.closest_hit(ray),
            Self::Planes(tree) => tree.closest_hit(ray),
        }
    }

    /// Whether the ray hits any triangle except `except`.
    pub fn any_hit(&self, ray: &Ray, except: Option<u32>) -> bool {
        match self {
            Self::Boxes(tree) => tree.any_hit(ray, except),
            Self::Planes(tree) => tree.any_hit(ray, except),
        }
    }

    /// Visits the nodes whose boxes the ray intersects, parents first. `visit` returns whether to descend.
    pub fn visit_nodes_hit_by_ray(
        &self,
        ray: &Ray,
        visit: impl FnMut(&VisitedNode, &RayBoxInterval) -> bool,
    ) {
        match self {
            Self::Boxes(tree) => tree.visit_nodes_hit_by_ray(ray, visit),
            Self::Planes(tree) => tree.visit_nodes_hit_by_ray(ray, visit),
        }
    }

    /// Visits every triangle that intersects a box. Nearby triangles may also be visited, and triangles may
    /// be visited more than once.
    pub fn visit_triangles_in_box(&self, bounds: &Aabb, visit: impl FnMut(u32)) {
        match self {
            Self::Boxes(tree) => tree.visit_overlapping(bounds, visit),
            Self::Planes(tree) => tree.visit_overlapping(bounds, visit),
        }
    }

    /// Like [`TriangleTree::visit_triangles_in_box`], but stops when `visit` returns false. Returns whether
    /// all triangles were visited.
    pub fn all_triangles_in_box_satisfy(&self, bounds: &Aabb, visit: impl FnMut(u32) -> bool) -> bool {
        match self {
            Self::Boxes(tree) => tree.visit_overlapping_while(bounds, visit),
            Self::Planes(tree) => tree.visit_overlapping_while(bounds, visit),
        }
    }

    /// Finds the nearest hits of at most [`PACKET_SIZE`](crate::accel::PACKET_SIZE) rays. Each ray ends at
    /// its entry in `ends`.
    pub fn closest_hit_packet(&self, rays: &[Ray], ends: &F32x16, hits: &mut [Option<ShapeHit>]) {
        match self {
            Self::Boxes(tree) => tree.closest_hit_packet(rays, ends, hits),
            Self::Planes(tree) => {
                hits.fill(None);
                for (lane, hit) in hits.iter_mut().enumerate().filter(|&(lane, _)| ends[lane] >= 0.0) {
                    *hit = tree.closest_hit(&Ray { t_max: ends[lane], ..rays[lane] });
                }
            }
        }
    }

    /// Returns the mask of rays, up to [`PACKET_SIZE`](crate::accel::PACKET_SIZE), that hit a triangle before
    /// they end. Each ray ignores its triangle in `except`, which may be empty.
    pub fn any_hit_packet(&self, rays: &[Ray], ends: &F32x16, except: &[Option<u32>]) -> u32 {
        match self {
            Self::Boxes(tree) => tree.any_hit_packet(rays, ends, except),
            Self::Planes(tree) => {
                let hit = |lane: usize| {
                    let ray = Ray { t_max: ends[lane], ..rays[lane] };
                    u32::from(tree.any_hit(&ray, except.get(lane).copied().flatten())) << lane
                };
                (0..rays.len()).filter(|&lane| ends[lane] >= 0.0).map(hit).sum()
            }
        }
    }
}
