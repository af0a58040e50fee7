//! Traversal by vector instructions, chosen at run time: the one place with `unsafe` code.
//!
//! Every way gives the bits of [`portable`], which is plain Rust.

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod avx2;
mod portable;

use std::sync::LazyLock;

use super::WideBvh;
use crate::geometry::{Ray, ShapeHit};

/// Instructions to traverse with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// Plain Rust; any processor.
    Portable,
    /// 256-bit vectors of x86-64.
    Avx2,
}

impl Instructions {
    /// All, slowest first.
    pub const ALL: [Self; 2] = [Self::Portable, Self::Avx2];

    /// The fastest that this processor has. `GLIMT_SIMD=portable` in the environment asks for less, to compare.
    pub fn best() -> Self {
        static BEST: LazyLock<Instructions> = LazyLock::new(|| {
            let asked = std::env::var("GLIMT_SIMD");
            if asked.is_ok_and(|name| name == "portable") {
                Instructions::Portable
            } else {
                Instructions::Avx2.available()
            }
        });
        *BEST
    }

    /// These, or the best that the processor has where it has not got them.
    pub fn available(self) -> Self {
        if self == Self::Avx2 && has_avx2() { Self::Avx2 } else { Self::Portable }
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    std::arch::is_x86_feature_detected!("avx2")
}

#[cfg(not(target_arch = "x86_64"))]
fn has_avx2() -> bool {
    false
}

/// See [`WideBvh::closest`]; the tree is not empty.
#[allow(unsafe_code)]
pub fn closest(tree: &WideBvh, ray: &Ray) -> Option<ShapeHit> {
    match tree.instructions {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a tree has these instructions only where the processor has them (`Instructions::available`).
        Instructions::Avx2 => unsafe { avx2::closest(tree, ray) },
        _ => portable::closest(tree, ray),
    }
}

/// See [`WideBvh::any`]; the tree is not empty.
#[allow(unsafe_code)]
pub fn any(tree: &WideBvh, ray: &Ray, except: Option<u32>) -> bool {
    match tree.instructions {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Instructions::Avx2 => unsafe { avx2::any(tree, ray, except) },
        _ => portable::any(tree, ray, except),
    }
}
