//! Traversal with SIMD instructions selected at run time. All of the tree's `unsafe` code is in this module.
//!
//! Results on all instruction sets are bit-identical to [`portable`], which is plain Rust.

#[allow(unsafe_code)]
pub mod binning;
#[allow(unsafe_code)]
mod dispatch;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod packet;
#[allow(unsafe_code)]
pub mod pages;
mod portable;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod ray;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod single;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod stack;
#[cfg(target_arch = "x86_64")]
mod triangle;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod vector;

use std::sync::LazyLock;

pub use dispatch::SimdKernel;

use super::WideBvh;
use crate::accel::F32x16;
use crate::geometry::{Ray, ShapeHit};

/// Instruction set for traversal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// Plain Rust, for any processor.
    Portable,
    /// 256-bit vectors on x86-64.
    Avx2,
    /// 512-bit vectors on x86-64.
    Avx512,
}

impl InstructionSet {
    /// All instruction sets, slowest first.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// The fastest supported instruction set. To compare instruction sets, select a slower one with the
    /// environment variable `GLIMT_SIMD` (`portable` or `avx2`).
    pub fn from_environment_or_best() -> Self {
        static BEST: LazyLock<InstructionSet> =
            LazyLock::new(|| match std::env::var("GLIMT_SIMD").as_deref() {
                Ok("portable") => InstructionSet::Portable,
                Ok("avx2") => InstructionSet::Avx2.or_best_if_unsupported(),
                _ => InstructionSet::Avx512.or_best_if_unsupported(),
            });
        *BEST
    }

    /// This instruction set, or the fastest supported one if the processor lacks it.
    pub fn or_best_if_unsupported(self) -> Self {
        static AVAILABLE: LazyLock<InstructionSet> = LazyLock::new(best_supported);
        self.min(*AVAILABLE)
    }
}

#[cfg(target_arch = "x86_64")]
fn best_supported() -> InstructionSet {
    use std::arch::is_x86_feature_detected as has;
    if !(has!("avx2") && has!("fma")) {
        InstructionSet::Portable
    } else if has!("avx512f") && has!("avx512vl") && has!("avx512dq") && has!("avx512bw") {
        InstructionSet::Avx512
    } else {
        InstructionSet::Avx2
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn best_supported() -> InstructionSet {
    InstructionSet::Portable
}

/// [`WideBvh::closest_hit`] for a nonempty tree.
#[allow(unsafe_code)]
pub fn closest_hit(tree: &WideBvh, ray: &Ray) -> Option<ShapeHit> {
    match tree.instructions {
        InstructionSet::Portable => portable::closest_hit(tree, ray),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a tree only has an instruction set that the processor supports
        // (`InstructionSet::or_best_if_unsupported`).
        InstructionSet::Avx2 | InstructionSet::Avx512 => unsafe { single::closest_hit(tree, ray) },
        #[cfg(not(target_arch = "x86_64"))]
        InstructionSet::Avx2 | InstructionSet::Avx512 => portable::closest_hit(tree, ray),
    }
}

/// [`WideBvh::any_hit`] for a nonempty tree.
#[allow(unsafe_code)]
pub fn any_hit(tree: &WideBvh, ray: &Ray, except: Option<u32>) -> bool {
    match tree.instructions {
        InstructionSet::Portable => portable::any_hit(tree, ray, except),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        InstructionSet::Avx2 | InstructionSet::Avx512 => unsafe { single::any_hit(tree, ray, except) },
        #[cfg(not(target_arch = "x86_64"))]
        InstructionSet::Avx2 | InstructionSet::Avx512 => portable::any_hit(tree, ray, except),
    }
}

/// [`WideBvh::closest_hit_packet`] for a nonempty tree. Returns whether the packet was traced.
#[allow(unsafe_code)]
pub fn try_closest_hit_packet(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &F32x16,
    hits: &mut [Option<ShapeHit>],
) -> bool {
    match tree.instructions {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        InstructionSet::Avx2 => unsafe { packet::closest_hit_if_coherent_avx2(tree, rays, ends, hits) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        InstructionSet::Avx512 => unsafe { packet::closest_hit_if_coherent_avx512(tree, rays, ends, hits) },
        InstructionSet::Portable => false,
        #[cfg(not(target_arch = "x86_64"))]
        InstructionSet::Avx2 | InstructionSet::Avx512 => false,
    }
}

/// [`WideBvh::any_hit_packet`] for a nonempty tree. Returns the mask of the rays that hit, or `None` if the
/// packet was not traced.
#[allow(unsafe_code)]
pub fn try_any_hit_packet(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &F32x16,
    except: &[Option<u32>],
) -> Option<u32> {
    match tree.instructions {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        InstructionSet::Avx2 => unsafe { packet::any_hit_if_coherent_avx2(tree, rays, ends, except) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        InstructionSet::Avx512 => unsafe { packet::any_hit_if_coherent_avx512(tree, rays, ends, except) },
        InstructionSet::Portable => None,
        #[cfg(not(target_arch = "x86_64"))]
        InstructionSet::Avx2 | InstructionSet::Avx512 => None,
    }
}
