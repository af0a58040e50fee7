//! Trees over boxes and ids. They know no shape: a closure tests what an id stands for. The one exception is
//! [`wide_bvh`], a tree over triangles whose leaves hold them ready for vector instructions.

pub mod bvh;
pub mod wide_bvh;

pub use bvh::Bvh;
pub use wide_bvh::WideBvh;

/// Rays that are traced together.
pub const PACKET: usize = 16;
