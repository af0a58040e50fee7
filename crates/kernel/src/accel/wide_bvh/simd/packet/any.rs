//! Any-hit packet traversal. Visits children in any order.

use super::frustum::Frustum;
use super::rays::SimdRayPacket;
use super::rows::RaySoa;
use crate::accel::wide_bvh::WideBvh;
use crate::accel::wide_bvh::node::{Child, PACK, TrianglePack};
use crate::accel::wide_bvh::simd::single::prefetch_child_start;
use crate::accel::wide_bvh::simd::stack::Stack;
use crate::accel::wide_bvh::simd::vector::{SimdF32x8, SimdVector};
use crate::accel::{F32x16, PACKET_SIZE as SIZE};
use crate::geometry::Ray;
use crate::geometry::aabb::SLAB_PAD;
use crate::geometry::watertight::ShearedRay;

/// Implements [`WideBvh::any_hit_packet`]. Returns `None` if the rays are not coherent.
#[inline(always)]
pub fn any_hit_if_coherent<V: SimdVector>(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &F32x16,
    except: &[Option<u32>],
    like: V,
    like8: SimdF32x8,
) -> Option<u32> {
    let Some(rows) = RaySoa::new(rays, ends) else { return Some(0) };
    let packet = SimdRayPacket::new(&rows, &tree.bounds, like)?;
    let frustum = Frustum::new(&packet, like8);
    let mut t_max = like.load_slice(&rows.ends);
    let pad = like.splat_like(SLAB_PAD);
    let mut end = t_max.max_element() * SLAB_PAD;
    let all = rows.traced;
    let mut found = 0_u32;
    let mut stack: Stack<u32> = Stack::new();
    stack.push(0);
    while let Some(code) = stack.pop() {
        match Child::decode(code) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (_, mut hit_boxes) = frustum.box_entries(node, like8.splat_like(end));
                while hit_boxes != 0 {
                    let slot = hit_boxes.trailing_zeros() as usize % 8;
                    hit_boxes &= hit_boxes - 1;
                    prefetch_child_start(tree, node.children[slot]);
                    stack.push_if(node.children[slot], packet.any_ray_hits_box(node, slot, t_max * pad));
                }
            }
            Child::Leaf { first, count } => {
                let before = found;
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    for lane in 0..PACK {
                        if pack.ids[lane] == u32::MAX {
                            break;
                        }
                        let hits = packet.intersect_triangle(pack, lane, t_max);
                        let mut rest = (hits.hit | hits.doubtful) & all & !found;
                        if rest != 0 {
                            rest &= !packet.lanes_starting_on(pack.ids[lane]);
                        }
                        while rest != 0 {
                            let ray = rest.trailing_zeros() as usize % SIZE;
                            rest &= rest - 1;
                            if except.get(ray).copied().flatten() == Some(pack.ids[lane]) {
                                continue;
                            }
                            let sure = hits.hit & 1 << ray != 0;
                            if sure
                                || recheck_doubtful_hit(&Ray { t_max: ends[ray], ..rays[ray] }, pack, lane)
                            {
                                found |= 1 << ray;
                            }
                        }
                    }
                }
                if found == all {
                    return Some(found);
                }
                if before != found {
                    t_max = like.splat_like(-1.0).select(V::mask_from_bits(found, t_max), t_max);
                    end = t_max.max_element() * SLAB_PAD;
                }
            }
        }
    }
    Some(found)
}

#[cold]
#[inline(never)]
fn recheck_doubtful_hit(ray: &Ray, pack: &TrianglePack, lane: usize) -> bool {
    ShearedRay::new(ray.origin, ray.direction).intersect(&pack.corners_at_lane(lane), ray.t_max).is_some()
}
