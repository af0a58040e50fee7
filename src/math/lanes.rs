//! Several numbers at a time: loops without branches over arrays, which compilers turn into vector instructions. Every lane
//! gets the bits that it would get alone.

use super::Vec3;
pub use crate::accel::bits;

/// Numbers at a time.
pub const LANES: usize = 16;

/// One number for each of several samples.
pub type Lanes = [f32; LANES];

/// Vectors, by coordinate.
pub type Lanes3 = [Lanes; 3];

/// The vector of a lane.
#[inline(always)]
pub fn lane(vectors: &Lanes3, i: usize) -> Vec3 {
    Vec3::new(vectors[0][i], vectors[1][i], vectors[2][i])
}

/// Set the vector of a lane.
#[inline(always)]
pub fn set_lane(vectors: &mut Lanes3, i: usize, v: Vec3) {
    (vectors[0][i], vectors[1][i], vectors[2][i]) = (v.x, v.y, v.z);
}

/// Whether something holds, for each lane: [`TRUE`] or 0.
pub type Truths = [u32; LANES];

/// What holds, in [`Truths`].
pub const TRUE: u32 = u32::MAX;
