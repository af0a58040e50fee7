//! Trees over boxes and ids. They know no shape: a closure tests what an id stands for.

pub mod bvh;

pub use bvh::Bvh;
