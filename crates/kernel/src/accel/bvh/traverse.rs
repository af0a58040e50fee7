//! Single-ray traversal: ordered for the closest hit, unordered for any hit.

use arrayvec::ArrayVec;

use super::{Bvh, ChildRef, DEEP_STACK, SHALLOW_STACK};
use crate::accel::{RayBoxInterval, VisitedNode};
use crate::geometry::aabb::{SLAB_PAD, SlabRay};
use crate::geometry::packet::set_bit_lanes;
use crate::geometry::{Aabb, Ray};

impl Bvh {
    /// Visits the primitives in the leaves that the ray may hit, roughly front to back. `test(id, t_max)`
    /// tests a primitive and returns the ray's new end on a hit. Primitives exactly at the ray's end are
    /// still tested because the caller may break ties by id.
    #[inline]
    pub fn visit_primitives_front_to_back(&self, ray: &Ray, mut test: impl FnMut(u32, f32) -> Option<f32>) {
        if let Some(shells) = &self.shells {
            self.visit_with_spherical_shells(shells, ray, &mut test);
        } else if self.depth < SHALLOW_STACK {
            self.visit_front_to_back_with_stack_size::<SHALLOW_STACK>(ray, test);
        } else {
            self.visit_front_to_back_with_stack_size::<DEEP_STACK>(ray, test);
        }
    }

    #[inline]
    fn visit_front_to_back_with_stack_size<const STACK_SIZE: usize>(
        &self,
        ray: &Ray,
        mut test: impl FnMut(u32, f32) -> Option<f32>,
    ) {
        let slabs = SlabRay::new(ray.origin, ray.direction);
        let mut t_max = ray.t_max;
        let mut stack = [(0.0_f32, ChildRef::NONE); STACK_SIZE];
        let mut size = 0;
        let mut current = ChildRef { first: 0, count: 0 };
        if self.nodes.is_empty() {
            return;
        }
        loop {
            if current.count > 0 {
                for place in current.first..current.first + current.count {
                    if let Some(t) = test(self.order[place as usize], t_max) {
                        t_max = t;
                    }
                }
            } else {
                let node = &self.nodes[current.first as usize];
                let enter =
                    |side: usize| slabs.entry_distance(node.bounds[side].min, node.bounds[side].max, t_max);
                let (left, right) = (enter(0), enter(1));
                match (left, right) {
                    (Some(left), Some(right)) => {
                        let (near, far) = if right < left { (1, 0) } else { (0, 1) };
                        stack[size] = (left.max(right), node.child[far]);
                        size += 1;
                        current = node.child[near];
                        continue;
                    }
                    (Some(_), None) => {
                        current = node.child[0];
                        continue;
                    }
                    (None, Some(_)) => {
                        current = node.child[1];
                        continue;
                    }
                    (None, None) => {}
                }
            }
            loop {
                if size == 0 {
                    return;
                }
                size -= 1;
                let (t, child) = stack[size];
                if t <= t_max * SLAB_PAD {
                    current = child;
                    break;
                }
            }
        }
    }

    /// Whether any primitive in the leaves that the ray may hit satisfies `test`.
    #[inline]
    pub fn any_hit(&self, ray: &Ray, mut test: impl FnMut(u32) -> bool) -> bool {
        if let Some(shells) = &self.shells {
            self.any_hit_culled_by_shells(shells, ray, &mut test)
        } else if self.depth < SHALLOW_STACK {
            self.any_hit_with_stack_size::<SHALLOW_STACK>(ray, test)
        } else {
            self.any_hit_with_stack_size::<DEEP_STACK>(ray, test)
        }
    }

    /// Visits the nodes whose boxes a ray hits, parents first, in an order that depends only on the tree.
    /// `visit` returns whether to descend. `own` receives the id and depth of each leaf entry.
    pub fn visit_nodes_hit_by_ray(
        &self,
        ray: &Ray,
        mut visit: impl FnMut(&VisitedNode, &RayBoxInterval) -> bool,
        mut own: impl FnMut(u32, u32),
    ) {
        let root = (self.bounds, ChildRef { first: 0, count: 0 }, 0);
        let mut pending = if self.nodes.is_empty() { Vec::new() } else { vec![root] };
        while let Some((bounds, child, depth)) = pending.pop() {
            let Some(stretch) = RayBoxInterval::new(&bounds, ray) else { continue };
            if !visit(&VisitedNode { bounds, depth, shapes: child.count }, &stretch) {
                continue;
            }
            if child.count > 0 {
                let places = child.first as usize..(child.first + child.count) as usize;
                self.order[places].iter().for_each(|&id| own(id, depth + 1));
                continue;
            }
            let node = &self.nodes[child.first as usize];
            let children = node.bounds.iter().zip(node.child).filter(|(bounds, _)| !bounds.is_empty());
            pending.extend(children.map(|(bounds, child)| (*bounds, child, depth + 1)));
        }
    }

    /// Visits every primitive in leaves whose boxes overlap `other`.
    pub fn visit_overlapping(&self, other: &Aabb, mut visit: impl FnMut(u32)) {
        let mut stack = ArrayVec::<ChildRef, DEEP_STACK>::new();
        for subtree in set_bit_lanes(self.top.overlap_mask(other)) {
            stack.push(self.top.subtree_bounds_and_child(subtree).1);
            while let Some(current) = stack.pop() {
                if current.count > 0 {
                    let places = current.first as usize..(current.first + current.count) as usize;
                    self.order[places].iter().for_each(|&id| visit(id));
                    continue;
                }
                let node = &self.nodes[current.first as usize];
                let both = node.bounds.iter().zip(node.child);
                stack.extend(both.filter(|(bounds, _)| bounds.overlaps(other)).map(|(_, child)| child));
            }
        }
    }

    #[inline]
    fn any_hit_with_stack_size<const STACK_SIZE: usize>(
        &self,
        ray: &Ray,
        mut test: impl FnMut(u32) -> bool,
    ) -> bool {
        let slabs = SlabRay::new(ray.origin, ray.direction);
        let mut stack = [ChildRef::NONE; STACK_SIZE];
        let mut size = 1;
        if self.nodes.is_empty() {
            return false;
        }
        while size > 0 {
            size -= 1;
            let current = stack[size];
            if current.count > 0 {
                let mut places = current.first..current.first + current.count;
                if places.any(|place| test(self.order[place as usize])) {
                    return true;
                }
                continue;
            }
            let node = &self.nodes[current.first as usize];
            for side in 0..2 {
                let bounds = &node.bounds[side];
                if slabs.entry_distance(bounds.min, bounds.max, ray.t_max).is_some() {
                    stack[size] = node.child[side];
                    size += 1;
                }
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::CancelToken;
    use crate::math::Vec3;
    use crate::math::random::signed_number_generator;

    /// Finds the nearest hit by brute force, treating each box as a solid.
    fn closest_box_by_brute_force(boxes: &[Aabb], ray: &Ray) -> Option<(f32, u32)> {
        let slabs = SlabRay::new(ray.origin, ray.direction);
        let hits = boxes
            .iter()
            .zip(0_u32..)
            .filter_map(|(b, id)| Some((slabs.entry_distance(b.min, b.max, ray.t_max)?, id)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    }

    #[test]
    fn hits_match_brute_force() {
        let mut next = signed_number_generator(1);
        // Integer positions produce coplanar faces and exact ties.
        let boxes: Vec<_> = (0..500)
            .map(|_| {
                let at = Vec3::new(next(), next(), next()).map(|x| (x * 8.0).round());
                Aabb { min: at, max: at + Vec3::ONE }
            })
            .collect();
        let tree = Bvh::build(&boxes, &CancelToken::new()).expect("never canceled");
        for _ in 0..5000 {
            let origin = Vec3::new(next(), next(), next()) * 20.0;
            let ray = Ray::new(origin, Vec3::new(next(), next(), next()) * 8.0 - origin);
            let slabs = SlabRay::new(ray.origin, ray.direction);
            let mut best: Option<(f32, u32)> = None;
            tree.visit_primitives_front_to_back(&ray, |id, t_max| {
                let t = slabs.entry_distance(boxes[id as usize].min, boxes[id as usize].max, t_max)?;
                let better = best.is_none_or(|(least, min_id)| (t, id) < (least, min_id));
                better.then(|| best = Some((t, id)))?;
                Some(t)
            });
            assert_eq!(best, closest_box_by_brute_force(&boxes, &ray));
            let any = tree.any_hit(&ray, |id| {
                slabs.entry_distance(boxes[id as usize].min, boxes[id as usize].max, ray.t_max).is_some()
            });
            assert_eq!(any, best.is_some());
        }
        for center in boxes.iter().map(|own| own.min + Vec3::splat(0.25)) {
            let other = Aabb { min: center, max: center }.expanded(Vec3::new(0.1, 0.8, 0.5));
            let mut found = vec![0; boxes.len()];
            tree.visit_overlapping(&other, |id| found[id as usize] += 1);
            assert!(
                found
                    .iter()
                    .zip(&boxes)
                    .all(|(&times, own)| times <= 1 && (!own.overlaps(&other) || times == 1))
            );
            assert!(found.iter().sum::<i32>() < 100, "{found:?}");
        }
    }

    #[test]
    fn traversal_ends_for_nan_rays() {
        for count in 1..4 {
            let at = |i: usize| Vec3::splat(i as f32 * 3.0);
            let boxes: Vec<_> = (0..count).map(|i| Aabb { min: at(i), max: at(i) + Vec3::ONE }).collect();
            let tree = Bvh::build(&boxes, &CancelToken::new()).expect("never canceled");
            let nan = Ray { t_max: f32::NAN, ..Ray::new(Vec3::NAN, Vec3::NAN) };
            for ray in [nan, Ray { t_max: f32::INFINITY, ..nan }, Ray::new(Vec3::ZERO, Vec3::NAN)] {
                let mut tests = 0;
                tree.visit_primitives_front_to_back(&ray, |_, _| {
                    tests += 1;
                    None
                });
                assert!(
                    tests <= 2 * count && !tree.any_hit(&ray, |_| false),
                    "{tests} tests for {count} boxes"
                );
            }
        }
    }
}
