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
