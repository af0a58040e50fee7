//! One ray: eight boxes and four triangles at a time, by AVX2.

use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

use super::super::WideBvh;
use super::super::node::{Child, Node, PACK, TrianglePack};
use super::lanes::{F4, F8, Lanes};
use super::portable::nearer;
use super::stack::Stack;
use super::triangle::{self, Hits};
use crate::geometry::aabb::{FAR_PAD, SLAB_PAD, triangle_margin};
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Aabb, Ray, ShapeHit};

/// A ray in all lanes, with the rows of a node that are near and far along each axis.
struct BoxRay {
    /// Origins for near and far planes, a margin apart.
    near_origin: [F8; 3],
    far_origin: [F8; 3],
    to_near: [F8; 3],
    /// The same, padded: a far plane is never met too early.
    to_far: [F8; 3],
    near: [usize; 3],
}

impl BoxRay {
    #[inline(always)]
    fn new(ray: &Ray, whole: &Aabb, like: F8) -> Self {
        let (inverse, padded) = (ray.direction.recip(), ray.direction.recip() * FAR_PAD);
        let margin = triangle_margin(ray.origin, whole);
        let mut own = Self {
            near_origin: [like; 3],
            far_origin: [like; 3],
            to_near: [like.like(inverse.x), like.like(inverse.y), like.like(inverse.z)],
            to_far: [like.like(padded.x), like.like(padded.y), like.like(padded.z)],
            near: [0; 3],
        };
        for axis in 0..3 {
            let is_down = inverse[axis] < 0.0;
            let (before, after) = (ray.origin[axis] - margin, ray.origin[axis] + margin);
            own.near_origin[axis] = like.like(if is_down { before } else { after });
            own.far_origin[axis] = like.like(if is_down { after } else { before });
            own.near[axis] = 2 * axis + usize::from(is_down);
        }
        own
    }

    /// Where the ray enters the eight boxes, and a bit for each that it meets before `end`. A distance that is NaN leaves the
    /// interval as it is, which is what `SlabRay::enter` does.
    #[inline(always)]
    fn enter(&self, node: &Node, end: F8) -> (F8, u32) {
        let (mut near, mut far) = (end.like(0.0), end);
        for axis in 0..3 {
            let row = self.near[axis] % 6;
            let near_plane = end.gather(&node.rows[row]) - self.near_origin[axis];
            let far_plane = end.gather(&node.rows[row ^ 1]) - self.far_origin[axis];
            near = (near_plane * self.to_near[axis]).max(near);
            far = (far_plane * self.to_far[axis]).min(far);
        }
        (near, F8::bits(near.le(far)))
    }
}

/// A sheared ray in all lanes.
struct TriangleRay {
    origin: [F4; 3],
    shear: [F4; 3],
    axes: [usize; 3],
    scalar: ShearedRay,
}

impl TriangleRay {
    #[inline(always)]
    fn new(ray: &Ray, like: F4) -> Self {
        let scalar = ShearedRay::new(ray.origin, ray.direction);
        let ([x, y, z], shear) = (scalar.axes(), scalar.shear());
        Self {
            origin: [like.like(ray.origin[x]), like.like(ray.origin[y]), like.like(ray.origin[z])],
            shear: [like.like(shear.x), like.like(shear.y), like.like(shear.z)],
            axes: [x, y, z],
            scalar,
        }
    }

    #[inline(always)]
    fn hits(&self, pack: &TrianglePack, t_max: f32) -> Hits<F4> {
        let corners = [self.corner(pack, 0), self.corner(pack, 3), self.corner(pack, 6)];
        triangle::hits(&corners, self.shear[2], self.shear[2].like(t_max))
    }

    /// The corners of which `row` is the first.
    #[inline(always)]
    fn corner(&self, pack: &TrianglePack, row: usize) -> [F4; 3] {
        let z = self.row(pack, row, 2);
        [self.row(pack, row, 0) - self.shear[0] * z, self.row(pack, row, 1) - self.shear[1] * z, z]
    }

    #[inline(always)]
    fn row(&self, pack: &TrianglePack, row: usize, axis: usize) -> F4 {
        self.origin[axis].gather(&pack.rows[row + self.axes[axis] % 3]) - self.origin[axis]
    }
}

/// See [`WideBvh::closest`].
#[target_feature(enable = "avx2")]
pub fn closest(tree: &WideBvh, ray: &Ray) -> Option<ShapeHit> {
    // SAFETY: this function has the instructions.
    let (like8, like4) = unsafe { (F8::splat(0.0), F4::splat(0.0)) };
    let (boxes, triangles) = (BoxRay::new(ray, &tree.bounds, like8), TriangleRay::new(ray, like4));
    let mut best: Option<ShapeHit> = None;
    let mut t_max = ray.t_max;
    let mut end = like8.like(t_max * SLAB_PAD);
    let mut stack: Stack<(f32, u32)> = Stack::new();
    let mut code = 0;
    loop {
        match Child::decode(code) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (near, met) = boxes.enter(node, end);
                if let Some(next) = push_ordered(tree, node, near, met, &mut stack) {
                    code = next;
                    continue;
                }
            }
            Child::Leaf { first, count } => {
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    let hits = triangles.hits(pack, t_max);
                    if hits.hit | hits.doubtful != 0 {
                        nearest(pack, &hits, &triangles.scalar, &mut best, t_max);
                        t_max = best.map_or(t_max, |best| best.t);
                    }
                }
                end = end.like(t_max * SLAB_PAD);
            }
        }
        loop {
            let Some((entry, next)) = stack.pop() else { return best };
            if entry <= t_max * SLAB_PAD {
                code = next;
                break;
            }
        }
    }
}

/// Take the nearest of a pack's hits.
#[target_feature(enable = "avx2")]
#[inline]
fn nearest(pack: &TrianglePack, hits: &Hits<F4>, ray: &ShearedRay, best: &mut Option<ShapeHit>, t_max: f32) {
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
        nearer(pack, lane, ray, t_max, best);
    }
}

/// Push the children that are met, farthest first, but for the nearest, which is returned.
#[target_feature(enable = "avx2")]
#[inline]
fn push_ordered(
    tree: &WideBvh,
    node: &Node,
    near: F8,
    met: u32,
    stack: &mut Stack<(f32, u32)>,
) -> Option<u32> {
    if met == 0 {
        return None;
    }
    let first = met.trailing_zeros() as usize % 8;
    let mut rest = met & (met - 1);
    if rest == 0 {
        prefetch(tree, node.children[first]);
        return Some(node.children[first]);
    }
    let mut entries = [0.0_f32; 8];
    near.store(&mut entries);
    prefetch(tree, node.children[first]);
    let mut nearest = (entries[first], node.children[first]);
    let mut pushed = 0;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % 8;
        rest &= rest - 1;
        let mut other = (entries[slot], node.children[slot]);
        prefetch(tree, other.1);
        if other.0 < nearest.0 {
            std::mem::swap(&mut other, &mut nearest);
        }
        stack.insert(other, pushed);
        pushed += 1;
    }
    Some(nearest.1)
}

/// Ask for the beginning of a child's memory before it is needed; asking for all of it is slower.
#[inline(always)]
pub(super) fn prefetch(tree: &WideBvh, code: u32) {
    let start: *const i8 = match Child::decode(code) {
        Child::Inner(index) => tree.nodes.as_ptr().wrapping_add(index as usize).cast(),
        Child::Leaf { first, .. } => tree.packs.as_ptr().wrapping_add(first as usize).cast(),
    };
    for line in 0..2 {
        // SAFETY: a hint; no address is wrong.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line)) };
    }
}

/// See [`WideBvh::any`].
#[target_feature(enable = "avx2")]
pub fn any(tree: &WideBvh, ray: &Ray, except: Option<u32>) -> bool {
    // SAFETY: this function has the instructions.
    let (like8, like4) = unsafe { (F8::splat(0.0), F4::splat(0.0)) };
    let (boxes, triangles) = (BoxRay::new(ray, &tree.bounds, like8), TriangleRay::new(ray, like4));
    let end = like8.like(ray.t_max * SLAB_PAD);
    let mut stack: Stack<u32> = Stack::new();
    stack.push(0);
    while let Some(code) = stack.pop() {
        match Child::decode(code) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (_, mut met) = boxes.enter(node, end);
                while met != 0 {
                    let child = node.children[met.trailing_zeros() as usize % 8];
                    prefetch(tree, child);
                    stack.push(child);
                    met &= met - 1;
                }
            }
            Child::Leaf { first, count } => {
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    let hits = triangles.hits(pack, ray.t_max);
                    let mut lanes = hits.hit | hits.doubtful;
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize % PACK;
                        lanes &= lanes - 1;
                        if Some(pack.ids[lane]) != except
                            && (hits.hit & 1 << lane != 0
                                || triangles.scalar.intersect(&pack.corners(lane), ray.t_max).is_some())
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
