//! Trees over boxes and ids. They know no shape: a closure tests what an id stands for. The exceptions are
//! [`wide_bvh`], a tree over triangles whose leaves hold them ready for vector instructions, and [`kd_tree`], its
//! alternative.

pub mod bvh;
pub mod kd_tree;
mod reference;
pub mod wide_bvh;

#[cfg(test)]
mod pathological;
#[cfg(test)]
mod tests;

pub use bvh::Bvh;
pub use kd_tree::KdTree;
pub use wide_bvh::WideBvh;

/// Rays that are traced together.
pub const PACKET: usize = 16;

/// Where each ray of a packet ends, in place of its own `t_max`; below 0 where there is none, or where it is not traced.
pub type Ends = [f32; PACKET];

/// The ends of at most [`PACKET`] rays.
pub fn ends(rays: &[crate::geometry::Ray]) -> Ends {
    std::array::from_fn(|lane| rays.get(lane).map_or(-1.0, |ray| ray.t_max))
}
