//! Packets of 16 numbers, processed in branch-free array loops that compilers vectorize. The result in each
//! lane is bit-identical to the scalar result. Structs that hold packets are aligned to cache lines, because
//! a load that crosses a cache-line boundary takes twice as long.

use super::Vec3;

/// Number of lanes in a packet.
pub const PACKET_SIZE: usize = 16;

/// One `f32` per lane.
pub type F32x16 = [f32; PACKET_SIZE];

/// One vector per lane, stored as one array per coordinate.
pub type Vec3x16 = [F32x16; 3];

/// Returns the vector in lane `i`.
#[inline(always)]
pub fn lane(vectors: &Vec3x16, i: usize) -> Vec3 {
    Vec3::new(vectors[0][i], vectors[1][i], vectors[2][i])
}

/// Sets the vector in lane `i`.
#[inline(always)]
pub fn set_lane(vectors: &mut Vec3x16, i: usize, v: Vec3) {
    (vectors[0][i], vectors[1][i], vectors[2][i]) = (v.x, v.y, v.z);
}

/// Lane mask: [`TRUE`] or 0 for each lane.
pub type Mask = [u32; PACKET_SIZE];

/// Mask value of a selected lane.
pub const TRUE: u32 = u32::MAX;

/// A computation written as branch-free loops over packets, compiled once per instruction set. Functions
/// called in the loops must be inlined and must not be closures. Otherwise they are compiled without the
/// instruction set's features.
pub trait SimdKernel {
    /// Result of the computation.
    type Output;

    /// Runs the computation with this instruction set.
    fn run(self, simd: impl Simd) -> Self::Output;
}

/// Token that provides the cross-lane operations of an instruction set. Tokens for optional instruction sets
/// can only be created on processors that support them.
pub trait Simd: Copy {
    /// Packs a mask into bits, one per lane.
    fn movemask(self, mask: &Mask) -> u32;

    /// Minimum and maximum over the lanes set in `lanes`, which must not be 0. With NaNs, the result depends
    /// on the lane order but is the same on every instruction set.
    fn min_max(self, row: &F32x16, lanes: u32) -> [f32; 2];

    /// Reciprocals of all lanes. In a plain loop, compilers may divide only two lanes at a time.
    fn reciprocals(self, row: &F32x16) -> F32x16;

    /// `a · b + c`, rounded once if the processor has a fused multiply-add and twice otherwise. Use only for
    /// bounds and initial guesses, where the last bits do not matter.
    fn mul_add_relaxed(self, a: f32, b: f32, c: f32) -> f32;

    /// Runs a kernel in a separate function shared by all callers. Use this if the call overhead is small
    /// compared with the kernel and inlined copies would bloat the binary.
    fn call_out_of_line<L: SimdKernel>(self, work: L) -> L::Output;
}

/// Reduces 16 numbers by repeatedly combining the two halves, which compiles to vector instructions.
#[macro_export]
macro_rules! reduce {
    ($row:expr, $better:tt) => {{
        let mut row = $row;
        for i in 0..8 {
            row[i] = if row[i + 8] $better row[i] { row[i + 8] } else { row[i] };
        }
        for i in 0..4 {
            row[i] = if row[i + 4] $better row[i] { row[i + 4] } else { row[i] };
        }
        for i in 0..2 {
            row[i] = if row[i + 2] $better row[i] { row[i + 2] } else { row[i] };
        }
        if row[1] $better row[0] { row[1] } else { row[0] }
    }};
}

/// Portable implementation for all processors.
#[derive(Clone, Copy)]
pub struct PortableSimd;

impl Simd for PortableSimd {
    /// Reduces by halves. `black_box` forces compilers to compute the whole vector first. Otherwise they
    /// would turn a combination of single bits into one test per lane.
    #[inline(always)]
    fn movemask(self, mask: &Mask) -> u32 {
        let mut row = std::hint::black_box(*mask);
        for i in 0..PACKET_SIZE {
            row[i] &= 1 << i;
        }
        for i in 0..8 {
            row[i] |= row[i + 8];
        }
        for i in 0..4 {
            row[i] |= row[i + 4];
        }
        for i in 0..2 {
            row[i] |= row[i + 2];
        }
        row[0] | row[1]
    }

    #[inline(always)]
    fn min_max(self, row: &F32x16, lanes: u32) -> [f32; 2] {
        let (mask, other) = (mask_from_bits(lanes), row[lanes.trailing_zeros() as usize % PACKET_SIZE]);
        let mut all = [other; PACKET_SIZE];
        select(&mask, row, &mut all);
        [reduce!(all, <), reduce!(all, >)]
    }

    #[inline(always)]
    fn reciprocals(self, row: &F32x16) -> F32x16 {
        let mut inverse = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            inverse[i] = 1.0 / row[i];
        }
        inverse
    }

    #[inline(always)]
    fn mul_add_relaxed(self, a: f32, b: f32, c: f32) -> f32 {
        a * b + c
    }

    #[inline(never)]
    fn call_out_of_line<L: SimdKernel>(self, work: L) -> L::Output {
        work.run(self)
    }
}

/// Expands bits into a mask.
#[inline(always)]
pub fn mask_from_bits(bits: u32) -> Mask {
    let mut mask = [0; PACKET_SIZE];
    for i in 0..PACKET_SIZE {
        mask[i] = if bits & 1 << i != 0 { TRUE } else { 0 };
    }
    mask
}

/// Replaces the lanes of `target` selected by the mask with the lanes of `new`. Uses bit operations because
/// compilers may turn `if` and `else` into a per-lane choice between memory addresses.
#[inline(always)]
pub fn select(mask: &Mask, new: &F32x16, target: &mut F32x16) {
    for i in 0..PACKET_SIZE {
        target[i] = f32::from_bits(new[i].to_bits() & mask[i] | target[i].to_bits() & !mask[i]);
    }
}

/// [`select`] for integers.
#[inline(always)]
pub fn select_u32(mask: &Mask, new: &[u32; PACKET_SIZE], target: &mut [u32; PACKET_SIZE]) {
    for i in 0..PACKET_SIZE {
        target[i] = new[i] & mask[i] | target[i] & !mask[i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_select_their_lanes() {
        for expected in 0..1_u32 << PACKET_SIZE {
            let mask = std::array::from_fn(|i| if expected >> i & 1 == 1 { TRUE } else { 0 });
            assert_eq!(PortableSimd.movemask(&mask), expected);
            assert_eq!(mask_from_bits(expected), mask);
            let (mut target, mut whole) = ([1.0; PACKET_SIZE], [1; PACKET_SIZE]);
            select(&mask, &[f32::NAN; PACKET_SIZE], &mut target);
            select_u32(&mask, &[7; PACKET_SIZE], &mut whole);
            for (i, hold) in mask.iter().enumerate() {
                assert_eq!((target[i].is_nan(), whole[i] == 7), (*hold == TRUE, *hold == TRUE));
            }
        }
    }
}
