//! Portable traversal, which is the reference for all instruction sets.

use super::super::WideBvh;
use super::super::node::{Child, PACK, TrianglePack, WIDTH, WideNode};
use crate::geometry::aabb::{SLAB_PAD, SlabRay};
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Ray, ShapeHit};
use crate::math::Vec3;

/// Whether a ray can hit anything. Non-finite rays and rays with a zero direction cannot, although they would
/// pass every box test.
fn is_traceable(ray: &Ray) -> bool {
    ray.origin.is_finite() && ray.direction.is_finite() && ray.direction != Vec3::ZERO
}

/// Finds the nearest hit. Visits children front to back.
pub fn closest_hit(tree: &WideBvh, ray: &Ray) -> Option<ShapeHit> {
    if !is_traceable(ray) {
        return None;
    }
    let (slabs, sheared) = (
        SlabRay::for_triangles(ray.origin, ray.direction, &tree.bounds),
        ShearedRay::new(ray.origin, ray.direction),
    );
    let mut best: Option<ShapeHit> = None;
    let mut t_max = ray.t_max;
    let mut stack = vec![(0.0_f32, Child::Inner(0))];
    while let Some((entry, child)) = stack.pop() {
        if entry > t_max * SLAB_PAD {
            continue;
        }
        match child {
            Child::Inner(index) => {
                let start = stack.len();
                stack.extend(hit_children(&tree.nodes[index as usize], &slabs, t_max));
                stack[start..].sort_by(|a, b| b.0.total_cmp(&a.0));
            }
            Child::Leaf { first, count } => {
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    for lane in (0..PACK).filter(|&lane| pack.ids[lane] != ray.start) {
                        update_nearest_with_triangle(pack, lane, &sheared, t_max, &mut best);
                        t_max = best.map_or(t_max, |best| best.t);
                    }
                }
            }
        }
    }
    best
}

/// Whether any triangle is hit. Visits children in any order and stops at the first hit.
pub fn any_hit(tree: &WideBvh, ray: &Ray, except: Option<u32>) -> bool {
    if !is_traceable(ray) {
        return false;
    }
    let (slabs, sheared) = (
        SlabRay::for_triangles(ray.origin, ray.direction, &tree.bounds),
        ShearedRay::new(ray.origin, ray.direction),
    );
    let mut stack = vec![Child::Inner(0)];
    while let Some(child) = stack.pop() {
        match child {
            Child::Inner(index) => {
                stack.extend(
                    hit_children(&tree.nodes[index as usize], &slabs, ray.t_max).map(|(_, child)| child),
                );
            }
            Child::Leaf { first, count } => {
                let packs = &tree.packs[first as usize..(first + count) as usize];
                let hits = |pack: &TrianglePack, lane: usize| {
                    Some(pack.ids[lane]) != except
                        && pack.ids[lane] != ray.start
                        && sheared.intersect(&pack.corners_at_lane(lane), ray.t_max).is_some()
                };
                if packs.iter().any(|pack| (0..PACK).any(|lane| hits(pack, lane))) {
                    return true;
                }
            }
        }
    }
    false
}

/// Returns the children that the ray hits, with their entry distances.
fn hit_children(node: &WideNode, slabs: &SlabRay, t_max: f32) -> impl Iterator<Item = (f32, Child)> {
    (0..WIDTH).filter_map(move |slot| {
        let corner = |side: usize| {
            Vec3::new(node.rows[side][slot], node.rows[2 + side][slot], node.rows[4 + side][slot])
        };
        slabs.entry_distance(corner(0), corner(1), t_max).map(|entry| (entry, node.child(slot)))
    })
}

/// Replaces the best hit with the hit on a lane's triangle if that hit is nearer, or equally near with a
/// lower index.
#[inline]
pub fn update_nearest_with_triangle(
    pack: &TrianglePack,
    lane: usize,
    ray: &ShearedRay,
    t_max: f32,
    best: &mut Option<ShapeHit>,
) {
    if let Some(hit) = ray.intersect(&pack.corners_at_lane(lane), t_max) {
        let id = pack.ids[lane];
        if best.is_none_or(|best| (hit.t, id) < (best.t, best.primitive)) {
            *best = Some(ShapeHit { primitive: id, ..hit });
        }
    }
}
