//! Eight boxes and four triangles at a time, by AVX2.
//!
//! Every operation on a triangle stands in the order of `ShearedRay::intersect`, without fused products, so that
//! the bits are the same; the few lanes that pass go through that function again, which has the last word.

use std::arch::x86_64::*;
use std::mem::MaybeUninit;

use super::super::WideBvh;
use super::super::node::{Child, Node, PACK, TrianglePack};
use super::portable::nearer;
use crate::geometry::aabb::SLAB_PAD;
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Ray, ShapeHit};

/// Levels of the binary tree are fewer than 96, each at most seven children to come back to.
const STACK_SIZE: usize = 96 * 7;

/// A ray in all lanes, with the rows of a node that are near and far along each axis.
struct BoxRay {
    origin: [__m256; 3],
    inverse: [__m256; 3],
    near: [usize; 3],
}

impl BoxRay {
    #[target_feature(enable = "avx2")]
    #[inline]
    fn new(ray: &Ray) -> Self {
        let inverse = ray.direction.recip();
        let all = |x: [f32; 3]| [_mm256_set1_ps(x[0]), _mm256_set1_ps(x[1]), _mm256_set1_ps(x[2])];
        let near = [0, 1, 2].map(|axis| 2 * axis + usize::from(inverse[axis] < 0.0));
        Self { origin: all(ray.origin.to_array()), inverse: all(inverse.to_array()), near }
    }

    /// Where the ray enters the eight boxes, and a bit for each that it meets before `far`. `max` and `min` return their
    /// second operand where the first is NaN, which is what `SlabRay::enter` needs.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn enter(&self, node: &Node, end: __m256) -> (__m256, u32) {
        let pad = _mm256_set1_ps(SLAB_PAD);
        let mut near = _mm256_setzero_ps();
        let mut far = end;
        for axis in 0..3 {
            let (near_row, far_row) = (self.near[axis], self.near[axis] ^ 1);
            // SAFETY: the rows are arrays of eight floats, aligned to 32 bytes because the node is.
            let (near_plane, far_plane) = unsafe {
                (_mm256_load_ps(node.rows[near_row].as_ptr()), _mm256_load_ps(node.rows[far_row].as_ptr()))
            };
            let distance = |plane| _mm256_mul_ps(_mm256_sub_ps(plane, self.origin[axis]), self.inverse[axis]);
            near = _mm256_max_ps(distance(near_plane), near);
            far = _mm256_min_ps(_mm256_mul_ps(distance(far_plane), pad), far);
        }
        (near, _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as u32)
    }
}

/// A sheared ray in all lanes.
struct TriangleRay {
    origin: [__m128; 3],
    shear: [__m128; 3],
    axes: [usize; 3],
    scalar: ShearedRay,
}

impl TriangleRay {
    #[target_feature(enable = "avx2")]
    #[inline]
    fn new(ray: &Ray) -> Self {
        let scalar = ShearedRay::new(ray.origin, ray.direction);
        let axes = scalar.axes();
        let (origin, shear) = (axes.map(|axis| ray.origin[axis]), scalar.shear().to_array());
        let all = |x: [f32; 3]| [_mm_set1_ps(x[0]), _mm_set1_ps(x[1]), _mm_set1_ps(x[2])];
        Self { origin: all(origin), shear: all(shear), axes, scalar }
    }

    /// A bit for each triangle that may be hit at a t in (0, `t_max`].
    #[target_feature(enable = "avx2")]
    #[inline]
    fn candidates(&self, pack: &TrianglePack, t_max: __m128) -> u32 {
        let corner = |corner: usize| {
            let row = |i: usize| {
                // SAFETY: the rows are arrays of four floats, aligned to 16 bytes because the pack is.
                let row = unsafe { _mm_load_ps(pack.rows[3 * corner + self.axes[i]].as_ptr()) };
                _mm_sub_ps(row, self.origin[i])
            };
            let z = row(2);
            let sheared = |i: usize| _mm_sub_ps(row(i), _mm_mul_ps(self.shear[i], z));
            (sheared(0), sheared(1), z)
        };
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (corner(0), corner(1), corner(2));
        let edge = |px, qy, py, qx| _mm_sub_ps(_mm_mul_ps(px, qy), _mm_mul_ps(py, qx));
        let (wa, wb, wc) = (edge(cx, by, cy, bx), edge(ax, cy, ay, cx), edge(bx, ay, by, ax));
        let zero = _mm_setzero_ps();
        let least = _mm_min_ps(wa, _mm_min_ps(wb, wc));
        let greatest = _mm_max_ps(wa, _mm_max_ps(wb, wc));
        // Both signs: outside. An edge function of exactly 0 counts as neither, and the scalar test decides.
        let outside = _mm_and_ps(_mm_cmplt_ps(least, zero), _mm_cmpgt_ps(greatest, zero));
        let sum = _mm_add_ps(_mm_add_ps(wa, wb), wc);
        let weighted = _mm_add_ps(_mm_add_ps(_mm_mul_ps(wa, az), _mm_mul_ps(wb, bz)), _mm_mul_ps(wc, cz));
        let t = _mm_mul_ps(_mm_mul_ps(weighted, self.shear[2]), _mm_div_ps(_mm_set1_ps(1.0), sum));
        let inside_ray = _mm_and_ps(_mm_cmpgt_ps(t, zero), _mm_cmple_ps(t, t_max));
        // Exactly 0 in an edge function: the scalar test computes it again with more digits.
        let on_edge =
            _mm_or_ps(_mm_cmpeq_ps(wa, zero), _mm_or_ps(_mm_cmpeq_ps(wb, zero), _mm_cmpeq_ps(wc, zero)));
        let hit = _mm_or_ps(_mm_andnot_ps(outside, inside_ray), on_edge);
        _mm_movemask_ps(hit) as u32
    }
}

/// Entries to come back to.
struct Stack<T> {
    entries: [MaybeUninit<T>; STACK_SIZE],
    size: usize,
}

impl<T: Copy> Stack<T> {
    #[inline(always)]
    fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK_SIZE], size: 0 }
    }

    #[inline(always)]
    fn push(&mut self, entry: T) {
        self.entries[self.size].write(entry);
        self.size += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<T> {
        self.size = self.size.checked_sub(1)?;
        // SAFETY: entries below `size` before the decrement were written by `push`.
        Some(unsafe { self.entries[self.size].assume_init() })
    }

    /// The entry `back` places below the top; it was pushed before.
    #[inline(always)]
    fn below(&mut self, back: usize) -> &mut T {
        debug_assert!(back < self.size);
        // SAFETY: as in `pop`.
        unsafe { self.entries[self.size - 1 - back].assume_init_mut() }
    }
}

/// See [`WideBvh::closest`].
#[target_feature(enable = "avx2")]
pub fn closest(tree: &WideBvh, ray: &Ray) -> Option<ShapeHit> {
    let (boxes, triangles) = (BoxRay::new(ray), TriangleRay::new(ray));
    let mut best: Option<ShapeHit> = None;
    let mut t_max = ray.t_max;
    let mut end = _mm256_set1_ps(t_max * SLAB_PAD);
    let mut stack: Stack<(f32, u32)> = Stack::new();
    let mut code = 0;
    loop {
        match Child::decode(code) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (near, met) = boxes.enter(node, end);
                if let Some(next) = push_ordered(node, near, met, &mut stack) {
                    code = next;
                    continue;
                }
            }
            Child::Leaf { first, count } => {
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    let mut lanes = triangles.candidates(pack, _mm_set1_ps(t_max));
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize % PACK;
                        lanes &= lanes - 1;
                        nearer(pack, lane, &triangles.scalar, t_max, &mut best);
                        t_max = best.map_or(t_max, |best| best.t);
                    }
                }
                end = _mm256_set1_ps(t_max * SLAB_PAD);
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

/// Push the children that are met, farthest first, but for the nearest, which is returned.
#[target_feature(enable = "avx2")]
#[inline]
fn push_ordered(node: &Node, near: __m256, met: u32, stack: &mut Stack<(f32, u32)>) -> Option<u32> {
    if met == 0 {
        return None;
    }
    let first = met.trailing_zeros() as usize % 8;
    let mut rest = met & (met - 1);
    if rest == 0 {
        return Some(node.children[first]);
    }
    let mut entries = [0.0_f32; 8];
    // SAFETY: the array has room for eight floats; the store asks for no alignment.
    unsafe { _mm256_storeu_ps(entries.as_mut_ptr(), near) };
    let mut nearest = (entries[first], node.children[first]);
    let mut pushed = 0;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % 8;
        rest &= rest - 1;
        let mut other = (entries[slot], node.children[slot]);
        if other.0 < nearest.0 {
            std::mem::swap(&mut other, &mut nearest);
        }
        // Insertion into what this node pushed, which gets nearer towards the top.
        stack.push(other);
        let mut back = 0;
        while back < pushed && stack.below(back + 1).0 < stack.below(back).0 {
            let lower = *stack.below(back + 1);
            *stack.below(back + 1) = std::mem::replace(stack.below(back), lower);
            back += 1;
        }
        pushed += 1;
    }
    Some(nearest.1)
}

/// See [`WideBvh::any`].
#[target_feature(enable = "avx2")]
pub fn any(tree: &WideBvh, ray: &Ray, except: Option<u32>) -> bool {
    let (boxes, triangles) = (BoxRay::new(ray), TriangleRay::new(ray));
    let end = _mm256_set1_ps(ray.t_max * SLAB_PAD);
    let t_max = _mm_set1_ps(ray.t_max);
    let mut stack: Stack<u32> = Stack::new();
    stack.push(0);
    while let Some(code) = stack.pop() {
        match Child::decode(code) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (_, mut met) = boxes.enter(node, end);
                while met != 0 {
                    stack.push(node.children[met.trailing_zeros() as usize % 8]);
                    met &= met - 1;
                }
            }
            Child::Leaf { first, count } => {
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    let mut lanes = triangles.candidates(pack, t_max);
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize % PACK;
                        lanes &= lanes - 1;
                        if Some(pack.ids[lane]) != except
                            && triangles.scalar.intersect(&pack.corners(lane), ray.t_max).is_some()
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
