//! Packet traversal for 16 rays in similar directions. A frustum around the rays is used to skip subtrees
//! that all rays miss (Reshetov, Soupikov, Hurley, *Multi-Level Ray Tracing Algorithm*, 2005). The remaining
//! boxes are tested against 16 rays at a time.

mod any;
mod closest;
mod frustum;
mod nearest;
mod rays;
mod rows;

use super::vector::{SimdF32x8, SimdF32x16, SimdVector, VectorPair};
use crate::accel::F32x16;
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::{Ray, ShapeHit};

use any::any_hit_if_coherent;
use closest::closest_hit_if_coherent;

/// [`closest_hit_if_coherent()`] with AVX2.
#[target_feature(enable = "avx2")]
pub fn closest_hit_if_coherent_avx2(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &F32x16,
    hits: &mut [Option<ShapeHit>],
) -> bool {
    // SAFETY: this function is compiled with the required instructions.
    let (like, like8) = unsafe { (VectorPair::<SimdF32x8>::splat(0.0), SimdF32x8::splat(0.0)) };
    closest_hit_if_coherent(tree, rays, ends, hits, like, like8)
}

/// [`any_hit_if_coherent()`] with AVX2.
#[target_feature(enable = "avx2")]
pub fn any_hit_if_coherent_avx2(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &F32x16,
    except: &[Option<u32>],
) -> Option<u32> {
    // SAFETY: this function is compiled with the required instructions.
    let (like, like8) = unsafe { (VectorPair::<SimdF32x8>::splat(0.0), SimdF32x8::splat(0.0)) };
    any_hit_if_coherent(tree, rays, ends, except, like, like8)
}

/// [`closest_hit_if_coherent()`] with AVX-512.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
pub fn closest_hit_if_coherent_avx512(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &F32x16,
    hits: &mut [Option<ShapeHit>],
) -> bool {
    // SAFETY: this function is compiled with the required instructions.
    let (like, like8) = unsafe { (SimdF32x16::splat(0.0), SimdF32x8::splat(0.0)) };
    closest_hit_if_coherent(tree, rays, ends, hits, like, like8)
}

/// [`any_hit_if_coherent()`] with AVX-512.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
pub fn any_hit_if_coherent_avx512(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &F32x16,
    except: &[Option<u32>],
) -> Option<u32> {
    // SAFETY: this function is compiled with the required instructions.
    let (like, like8) = unsafe { (SimdF32x16::splat(0.0), SimdF32x8::splat(0.0)) };
    any_hit_if_coherent(tree, rays, ends, except, like, like8)
}
