//! Bounding volume hierarchies and kd-trees. [`bvh`] stores only boxes and ids, and calls a closure with an
//! id to test a shape. [`wide_bvh`] and its alternative [`kd_tree`] store triangles in their leaves.

pub mod bvh;
pub mod kd_tree;
mod ray_interval;
mod reference;
pub mod wide_bvh;

#[cfg(test)]
mod pathological;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod triangle_list_tests;
#[cfg(test)]
mod watertight_packet_tests;

pub use bvh::{AnyHitCallback, Bvh, ClosestHitCallback, PrimitiveOrSubtreeAroundBox, SphericalShell};
pub use kd_tree::KdTree;
pub use ray_interval::{RayBoxInterval, VisitedNode};
pub use wide_bvh::{InstructionSet, SimdKernel, WideBvh};

pub use crate::geometry::packet::{F32x16, PACKET_SIZE};

/// Ends (`t_max`) of up to [`PACKET_SIZE`] rays, or −1 in lanes without a ray.
#[inline(always)]
pub fn packet_ray_ends(rays: &[crate::geometry::Ray]) -> F32x16 {
    let mut ends = [-1.0; PACKET_SIZE];
    for (end, ray) in ends.iter_mut().zip(rays) {
        *end = ray.t_max;
    }
    ends
}
