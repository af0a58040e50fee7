//! Single-ray traversal with AVX2: eight boxes and four triangles at a time.

use std::arch::x86_64::*;

use super::portable::update_nearest_with_triangle;
use super::ray::{SimdRay, is_traceable};
use super::stack::{Stack, entry_distance_from_key, sort_key};
use super::triangle::TriangleHits;
use super::vector::{SimdF32x4, SimdF32x8, SimdVector};
use crate::accel::wide_bvh::WideBvh;
use crate::accel::wide_bvh::node::{Child, LEAF_BITS, PACK, TrianglePack, WideNode};
use crate::geometry::aabb::SLAB_PAD;
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Ray, ShapeHit};

/// [`WideBvh::closest_hit`] with AVX2.
#[target_feature(enable = "avx2,fma")]
pub fn closest_hit(tree: &WideBvh, ray: &Ray) -> Option<ShapeHit> {
    if !is_traceable(ray) {
        return None;
    }
    // SAFETY: this function is compiled with the required instructions.
    let like8 = unsafe { SimdF32x8::splat(0.0) };
    let lines = SimdRay::new(ray, &tree.bounds);
    let mut best: Option<ShapeHit> = None;
    let mut t_max = ray.t_max;
    let mut end = like8.splat_like(t_max * SLAB_PAD);
    let mut stack: Stack<u64> = Stack::new();
    let mut code = 0;
    loop {
        match Child::decode(code) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (near, hit_boxes) = lines.box_entries(node, end);
                if let Some(next) = push_farther_and_return_nearest(tree, node, near, hit_boxes, &mut stack) {
                    code = next;
                    continue;
                }
            }
            Child::Leaf { first, count } => {
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    let hits = lines.intersect_triangles(pack, t_max);
                    if hits.hit | hits.doubtful != 0 {
                        update_nearest_with_pack_hits(pack, &hits, ray, &mut best, t_max);
                        t_max = best.map_or(t_max, |best| best.t);
                    }
                }
                end = end.splat_like(t_max * SLAB_PAD);
            }
        }
        loop {
            let Some(next) = stack.pop() else { return best };
            if entry_distance_from_key(next) <= t_max * SLAB_PAD {
                code = next as u32;
                break;
            }
        }
    }
}

/// Updates the best hit with the nearest hit in a pack.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn update_nearest_with_pack_hits(
    pack: &TrianglePack,
    hits: &TriangleHits<SimdF32x4>,
    ray: &Ray,
    best: &mut Option<ShapeHit>,
    t_max: f32,
) {
    let mut t = [0.0; PACK];
    hits.t.store(&mut t);
    let (mut u, mut v) = ([0.0; PACK], [0.0; PACK]);
    hits.u.store(&mut u);
    hits.v.store(&mut v);
    let mut lanes = hits.hit;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize % PACK;
        lanes &= lanes - 1;
        let id = pack.ids[lane];
        if best.is_none_or(|best| (t[lane], id) < (best.t, best.primitive)) {
            *best = Some(ShapeHit { t: t[lane], primitive: id, u: u[lane], v: v[lane] });
        }
    }
    let mut lanes = hits.doubtful;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize % PACK;
        lanes &= lanes - 1;
        recheck_lane_and_update_nearest(pack, lane, ray, t_max, best);
    }
}

/// Non-inlined version of [`update_nearest_with_triangle`] for rare cases.
#[cold]
#[inline(never)]
fn recheck_lane_and_update_nearest(
    pack: &TrianglePack,
    lane: usize,
    ray: &Ray,
    t_max: f32,
    best: &mut Option<ShapeHit>,
) {
    update_nearest_with_triangle(pack, lane, &ShearedRay::new(ray.origin, ray.direction), t_max, best);
}

/// Returns the nearest child that the ray hits, and pushes the other children that it hits, farthest first.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn push_farther_and_return_nearest(
    tree: &WideBvh,
    node: &WideNode,
    near: SimdF32x8,
    hit_boxes: u32,
    stack: &mut Stack<u64>,
) -> Option<u32> {
    if hit_boxes == 0 {
        return None;
    }
    let first = hit_boxes.trailing_zeros() as usize % 8;
    let mut rest = hit_boxes & (hit_boxes - 1);
    if rest == 0 {
        return Some(node.children[first]);
    }
    let mut entries = [0.0_f32; 8];
    near.store(&mut entries);
    let mut nearest = sort_key(entries[first], node.children[first]);
    prefetch_child_start(tree, nearest as u32);
    let mut pushed = 0;
    loop {
        let slot = rest.trailing_zeros() as usize % 8;
        rest &= rest - 1;
        let other = sort_key(entries[slot], node.children[slot]);
        prefetch_child_start(tree, other as u32);
        stack.insert_key_into_sorted_top(nearest.max(other), pushed);
        nearest = nearest.min(other);
        if rest == 0 {
            return Some(nearest as u32);
        }
        pushed += 1;
    }
}

/// Prefetches the beginning of a child. Prefetching the entire child would be slower.
#[inline(always)]
pub fn prefetch_child_start(tree: &WideBvh, code: u32) {
    let index = (code & !LEAF_BITS) as usize;
    let node: *const i8 = tree.nodes.as_ptr().wrapping_add(index).cast();
    let pack: *const i8 = tree.packs.as_ptr().wrapping_add(index).cast();
    let start = std::hint::select_unpredictable(code >> 31 != 0, pack, node);
    for line in 0..2 {
        // SAFETY: prefetching is a hint and valid for any address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line)) };
    }
}

/// Whether the ray hits the triangle in a lane.
#[cold]
#[inline(never)]
fn is_lane_triangle_hit(pack: &TrianglePack, lane: usize, ray: &Ray) -> bool {
    ShearedRay::new(ray.origin, ray.direction).intersect(&pack.corners_at_lane(lane), ray.t_max).is_some()
}

/// [`WideBvh::any_hit`] with AVX2.
#[target_feature(enable = "avx2,fma")]
pub fn any_hit(tree: &WideBvh, ray: &Ray, except: Option<u32>) -> bool {
    if !is_traceable(ray) {
        return false;
    }
    // SAFETY: this function is compiled with the required instructions.
    let like8 = unsafe { SimdF32x8::splat(0.0) };
    let lines = SimdRay::new(ray, &tree.bounds);
    let end = like8.splat_like(ray.t_max * SLAB_PAD);
    let mut stack: Stack<u32> = Stack::new();
    stack.push(0);
    while let Some(code) = stack.pop() {
        match Child::decode(code) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (_, mut hit_boxes) = lines.box_entries(node, end);
                while hit_boxes != 0 {
                    let child = node.children[hit_boxes.trailing_zeros() as usize % 8];
                    prefetch_child_start(tree, child);
                    stack.push(child);
                    hit_boxes &= hit_boxes - 1;
                }
            }
            Child::Leaf { first, count } => {
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    let hits = lines.intersect_triangles(pack, ray.t_max);
                    let mut lanes = hits.hit | hits.doubtful;
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize % PACK;
                        lanes &= lanes - 1;
                        if Some(pack.ids[lane]) != except
                            && (hits.hit & 1 << lane != 0 || is_lane_triangle_hit(pack, lane, ray))
                        {
                            return true;
                        }
                    }
                }
            }
        }
    }
    false
}
