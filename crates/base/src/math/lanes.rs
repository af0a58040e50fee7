//! Packets of 16 numbers, processed in branch-free loops over arrays that compilers vectorize. Each lane gets
//! the same bits as the scalar computation would.

use super::Vec3;

/// Number of lanes in a packet.
pub const LANES: usize = 16;

/// One `f32` per lane.
pub type Lanes = [f32; LANES];

/// One vector per lane, as one array per coordinate.
pub type Lanes3 = [Lanes; 3];

/// Returns the vector in lane `i`.
#[inline(always)]
pub fn lane(vectors: &Lanes3, i: usize) -> Vec3 {
    Vec3::new(vectors[0][i], vectors[1][i], vectors[2][i])
}

/// Sets the vector in lane `i`.
#[inline(always)]
pub fn set_lane(vectors: &mut Lanes3, i: usize, v: Vec3) {
    (vectors[0][i], vectors[1][i], vectors[2][i]) = (v.x, v.y, v.z);
}

/// Lane mask: [`TRUE`] or 0 for each lane.
pub type Truths = [u32; LANES];

/// Mask value of a selected lane.
pub const TRUE: u32 = u32::MAX;

/// A computation in branch-free loops over packets, compiled once per instruction set. Everything called in
/// its loops must be inlined and must not be a closure, or it is compiled without the instruction set's
/// features.
pub trait Loops {
    /// Result of the computation.
    type Done;

    /// Runs the computation with this instruction set.
    fn run(self, folds: impl Folds) -> Self::Done;
}

/// Token for an instruction set, with its cross-lane operations. A token for instructions that a processor
/// may lack can only be created if the processor has them.
pub trait Folds: Copy {
    /// Packs a mask into bits, one per lane.
    fn bits(self, holds: &Truths) -> u32;

    /// Minimum and maximum over the lanes set in `of`, which must not be 0. For NaN the result depends on
    /// lane order, identically on every instruction set.
    fn span(self, row: &Lanes, of: u32) -> [f32; 2];

    /// Reciprocal of every lane. A plain loop may be compiled to divisions of lane pairs.
    fn reciprocals(self, row: &Lanes) -> Lanes;

    /// `a · b + c`, rounded once if the processor has a fused multiply-add and twice otherwise. Only for
    /// bounds and initial guesses, where the last bits do not matter.
    fn about(self, a: f32, b: f32, c: f32) -> f32;

    /// Runs a kernel in a function of its own that all callers share. Use it if the call overhead is small
    /// compared with the kernel and inlined copies would bloat the binary.
    fn call<L: Loops>(self, work: L) -> L::Done;
}

/// Reduces 16 numbers pairwise by halves, which compiles to vector instructions.
#[macro_export]
macro_rules! folded {
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

/// Portable implementation, for every processor.
#[derive(Clone, Copy)]
pub struct PlainFolds;

impl Folds for PlainFolds {
    /// Reduces by halves. Compilers turn sums of single bits into a test of each lane in sequence;
    /// `black_box` makes them finish the vector first.
    #[inline(always)]
    fn bits(self, holds: &Truths) -> u32 {
        let mut row = std::hint::black_box(*holds);
        for i in 0..LANES {
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
    fn span(self, row: &Lanes, of: u32) -> [f32; 2] {
        let (holds, other) = (truths(of), row[of.trailing_zeros() as usize % LANES]);
        let mut all = [other; LANES];
        take(&holds, row, &mut all);
        [folded!(all, <), folded!(all, >)]
    }

    #[inline(always)]
    fn reciprocals(self, row: &Lanes) -> Lanes {
        let mut inverse = [0.0; LANES];
        for i in 0..LANES {
            inverse[i] = 1.0 / row[i];
        }
        inverse
    }

    #[inline(always)]
    fn about(self, a: f32, b: f32, c: f32) -> f32 {
        a * b + c
    }

    #[inline(never)]
    fn call<L: Loops>(self, work: L) -> L::Done {
        work.run(self)
    }
}

/// Expands bits into a mask.
#[inline(always)]
pub fn truths(bits: u32) -> Truths {
    let mut holds = [0; LANES];
    for i in 0..LANES {
        holds[i] = if bits & 1 << i != 0 { TRUE } else { 0 };
    }
    holds
}

/// Replaces the lanes of `own` selected by the mask with those of `new`. Uses bit operations, as compilers
/// may turn `if` and `else` into a per-lane choice between memory addresses.
#[inline(always)]
pub fn take(holds: &Truths, new: &Lanes, own: &mut Lanes) {
    for i in 0..LANES {
        own[i] = f32::from_bits(new[i].to_bits() & holds[i] | own[i].to_bits() & !holds[i]);
    }
}

/// [`take`] for integers.
#[inline(always)]
pub fn take_u32(holds: &Truths, new: &[u32; LANES], own: &mut [u32; LANES]) {
    for i in 0..LANES {
        own[i] = new[i] & holds[i] | own[i] & !holds[i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_select_their_lanes() {
        for expected in 0..1_u32 << LANES {
            let holds = std::array::from_fn(|i| if expected >> i & 1 == 1 { TRUE } else { 0 });
            assert_eq!(PlainFolds.bits(&holds), expected);
            assert_eq!(truths(expected), holds);
            let (mut own, mut whole) = ([1.0; LANES], [1; LANES]);
            take(&holds, &[f32::NAN; LANES], &mut own);
            take_u32(&holds, &[7; LANES], &mut whole);
            for (i, hold) in holds.iter().enumerate() {
                assert_eq!((own[i].is_nan(), whole[i] == 7), (*hold == TRUE, *hold == TRUE));
            }
        }
    }
}
