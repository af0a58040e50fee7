//! Closest-hit packet traversal. Visits near children first.

use super::frustum::Frustum;
use super::nearest::NearestHits;
use super::rays::SimdRayPacket;
use super::rows::RaySoa;
use crate::accel::F32x16;
use crate::accel::wide_bvh::WideBvh;
use crate::accel::wide_bvh::node::{Child, PACK, WideNode};
use crate::accel::wide_bvh::simd::single::prefetch_child_start;
use crate::accel::wide_bvh::simd::stack::{Stack, entry_distance_from_key, sort_key};
use crate::accel::wide_bvh::simd::vector::{SimdF32x8, SimdVector};
use crate::geometry::aabb::SLAB_PAD;
use crate::geometry::{Ray, ShapeHit};

/// Implements [`WideBvh::closest_hit_packet`]. Returns false if the rays are not coherent.
#[inline(always)]
pub fn closest_hit_if_coherent<V: SimdVector>(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &F32x16,
    hits: &mut [Option<ShapeHit>],
    like: V,
    like8: SimdF32x8,
) -> bool {
    let Some(rows) = RaySoa::new(rays, ends) else { return true };
    let Some(packet) = SimdRayPacket::new(&rows, &tree.bounds, like) else { return false };
    let frustum = Frustum::new(&packet, like8);
    let t_max = like.load_slice(&rows.ends);
    let pad = like.splat_like(SLAB_PAD);
    let mut best = NearestHits::new(t_max);
    let mut end = t_max.max_element() * SLAB_PAD;
    let mut stack: Stack<u64> = Stack::new();
    stack.push(sort_key(0.0, 0));
    while let Some(key) = stack.pop() {
        if entry_distance_from_key(key) > end {
            continue;
        }
        match Child::decode(key as u32) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (near, hit_boxes) = frustum.box_entries(node, like8.splat_like(end));
                push_children_farthest_first(tree, node, near, hit_boxes, &mut stack, &packet, best.t * pad);
            }
            Child::Leaf { first, count } => {
                let mut any = 0;
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    for lane in 0..PACK {
                        if pack.ids[lane] == u32::MAX {
                            break;
                        }
                        any |= best.update_with_triangle(&packet, pack, lane, rays);
                    }
                }
                if any != 0 {
                    end = best.t.max_element() * SLAB_PAD;
                }
            }
        }
    }
    best.write_shape_hits(hits);
    true
}

/// Pushes the children that any ray hits, farthest first, so that the nearest is on top.
#[inline(always)]
fn push_children_farthest_first<V: SimdVector>(
    tree: &WideBvh,
    node: &WideNode,
    near: SimdF32x8,
    hit_boxes: u32,
    stack: &mut Stack<u64>,
    packet: &SimdRayPacket<V>,
    end: V,
) {
    let mut entries = [0.0_f32; 8];
    near.store(&mut entries);
    let (mut rest, mut pushed) = (hit_boxes, 0);
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % 8;
        rest &= rest - 1;
        if !packet.any_ray_hits_box(node, slot, end) {
            continue;
        }
        prefetch_child_start(tree, node.children[slot]);
        stack.insert_key_into_sorted_top(sort_key(entries[slot], node.children[slot]), pushed);
        pushed += 1;
    }
}
