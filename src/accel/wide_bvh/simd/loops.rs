//! Plain loops, compiled once more for the vector instructions that the processor has. Nothing is fused or reordered: the bits
//! are the same.

use super::Instructions;

/// Work in loops without branches over rows. What it calls in its loops must be inlined, and no closure, or it is compiled
/// without the instructions.
pub trait Loops {
    /// What it gives.
    type Done;

    /// Do it.
    fn run(self) -> Self::Done;
}

impl Instructions {
    /// Do it by these instructions, or the best that the processor has where it has not got them.
    #[inline]
    pub fn run<L: Loops>(self, work: L) -> L::Done {
        match self.available() {
            Self::Portable => work.run(),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the processor has what is available.
            Self::Avx2 => unsafe { avx2(work) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx512 => unsafe { avx512(work) },
            #[cfg(not(target_arch = "x86_64"))]
            _ => work.run(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<L: Loops>(work: L) -> L::Done {
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512<L: Loops>(work: L) -> L::Done {
    work.run()
}
