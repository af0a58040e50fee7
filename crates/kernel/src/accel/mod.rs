//! Trees over boxes and ids. They know no shape: a closure tests the shape of an id. The exceptions are [`wide_bvh`], a
//! tree over triangles whose leaves hold them ready for vector instructions, and [`kd_tree`], its alternative.

mod along;
pub mod bvh;
pub mod kd_tree;
mod reference;
pub mod wide_bvh;

#[cfg(test)]
mod facets_tests;
#[cfg(test)]
mod pathological;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod watertight_rows_tests;

pub use along::{Cell, Stretch};
pub use bvh::{AnyTest, Bvh, ClosestTest};
pub use kd_tree::KdTree;
pub use wide_bvh::{Instructions, Loops, WideBvh};

pub use crate::geometry::rows::{Ends, PACKET};

/// The ends of at most [`PACKET`] rays.
#[inline(always)]
pub fn ends(rays: &[crate::geometry::Ray]) -> Ends {
    let mut ends = [-1.0; PACKET];
    for (end, ray) in ends.iter_mut().zip(rays) {
        *end = ray.t_max;
    }
    ends
}
