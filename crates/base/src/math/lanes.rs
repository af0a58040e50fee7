//! Several numbers at a time: loops without branches over arrays, which compilers turn into vector instructions. Every lane
//! gets the bits that it would get alone.

use super::Vec3;

/// Number of lanes.
pub const LANES: usize = 16;

/// One number for each of several samples.
pub type Lanes = [f32; LANES];

/// Vectors, one array for each coordinate.
pub type Lanes3 = [Lanes; 3];

/// The vector of a lane.
#[inline(always)]
pub fn lane(vectors: &Lanes3, i: usize) -> Vec3 {
    Vec3::new(vectors[0][i], vectors[1][i], vectors[2][i])
}

/// Sets the vector of a lane.
#[inline(always)]
pub fn set_lane(vectors: &mut Lanes3, i: usize, v: Vec3) {
    (vectors[0][i], vectors[1][i], vectors[2][i]) = (v.x, v.y, v.z);
}

/// A mask: [`TRUE`] or 0 for each lane.
pub type Truths = [u32; LANES];

/// Value of a lane of [`Truths`] in which the condition holds.
pub const TRUE: u32 = u32::MAX;

/// Work in loops without branches over rows. What it calls in its loops must be inlined, and no closure, or it is compiled
/// without the instructions.
pub trait Loops {
    /// Result of the work.
    type Done;

    /// Does the work, folding rows by these instructions.
    fn run(self, folds: impl Folds) -> Self::Done;
}

/// Instructions that fold rows. A value is the right to use them: for instructions that a processor may lack, values exist only
/// if the processor has them.
pub trait Folds: Copy {
    /// One bit for each lane in which the condition holds.
    fn bits(self, holds: &Truths) -> u32;

    /// Least and greatest number among the lanes whose bits are set, of which there is at least one; of a number that is none, the
    /// order decides, which is the same for all instructions.
    fn span(self, row: &Lanes, of: u32) -> [f32; 2];

    /// Reciprocals. Compilers may take a loop of them apart into pairs.
    fn reciprocals(self, row: &Lanes) -> Lanes;

    /// `a · b + c`, rounded once where the processor has an instruction for it, and else twice: for bounds and guesses, whose last
    /// bits decide nothing.
    fn about(self, a: f32, b: f32, c: f32) -> f32;

    /// Does work by the same instructions in a function of its own, which all callers share: for work of which a call costs little
    /// and each copy much of the program's size.
    fn call<L: Loops>(self, work: L) -> L::Done;
}

/// Folds sixteen numbers by halves, which become vector instructions.
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

/// Folds by instructions that every processor has.
#[derive(Clone, Copy)]
pub struct PlainFolds;

impl Folds for PlainFolds {
    /// Folds by halves. Compilers take sums of single bits apart into a test of one lane after the other; the hint has them finish
    /// the vector first.
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

/// Mask of the lanes whose bits are set.
#[inline(always)]
pub fn truths(bits: u32) -> Truths {
    let mut holds = [0; LANES];
    for i in 0..LANES {
        holds[i] = if bits & 1 << i != 0 { TRUE } else { 0 };
    }
    holds
}

/// Takes the new numbers in the lanes of the mask. Works by bits: for `if` and `else`, compilers may choose between places
/// in memory, one lane after the other.
#[inline(always)]
pub fn take(holds: &Truths, new: &Lanes, own: &mut Lanes) {
    for i in 0..LANES {
        own[i] = f32::from_bits(new[i].to_bits() & holds[i] | own[i].to_bits() & !holds[i]);
    }
}

/// [`take`] for whole numbers.
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
    fn lanes_of_bits_are_taken() {
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
