//! Sixteen rays at a time that go much the same way: what all of them miss is left out by one test of a frustum around them
//! (Reshetov, Soupikov, Hurley, *Multi-Level Ray Tracing Algorithm*, 2005), what is left is tested for sixteen rays
//! side by side.

use super::lanes::{F8, F16, Lanes, Pair};
use super::single::prefetch;
use super::stack::{Stack, entry, key};
use super::triangle;
use crate::accel::wide_bvh::WideBvh;
use crate::accel::wide_bvh::node::{Child, Node, PACK, TrianglePack};
use crate::accel::{Ends, PACKET as SIZE};
use crate::geometry::aabb::{SLAB_PAD, triangle_margin};
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Aabb, Ray, ShapeHit};
use crate::math::Vec3;

/// Rows of a packet, one value for each ray.
type Row = [f32; SIZE];

/// Rays side by side.
struct Rows {
    origin: [Row; 3],
    direction: [Row; 3],
    ends: Ends,
    /// A bit for each ray that is traced.
    traced: u32,
    /// The first of them.
    first: Ray,
}

/// A bit for each lane.
const ALL: u32 = (1 << SIZE) - 1;

impl Rows {
    #[inline(always)]
    fn set(&mut self, lane: usize, ray: &Ray) {
        for axis in 0..3 {
            self.origin[axis][lane] = ray.origin[axis];
            self.direction[axis][lane] = ray.direction[axis];
        }
    }

    /// Lanes without a ray, or with one that ends below 0, repeat the first; none where there is no ray.
    #[inline(always)]
    fn new(rays: &[Ray], ends: &Ends) -> Option<Self> {
        let count = rays.len().min(SIZE);
        let mut traced = 0;
        for (lane, &end) in ends.iter().enumerate().take(count) {
            traced |= u32::from(end >= 0.0) << lane;
        }
        let first_lane = traced.trailing_zeros() as usize;
        let first = *rays.get(first_lane)?;
        let mut rows =
            Self { origin: [[0.0; SIZE]; 3], direction: [[0.0; SIZE]; 3], ends: [-1.0; SIZE], traced, first };
        match <&[Ray; SIZE]>::try_from(rays) {
            Ok(rays) if traced == ALL => {
                for (lane, ray) in rays.iter().enumerate() {
                    rows.set(lane, ray);
                }
                rows.ends = *ends;
            }
            _ => {
                for lane in 0..SIZE {
                    let is_traced = traced & 1 << lane != 0;
                    rows.set(lane, &rays[if is_traced { lane } else { first_lane }]);
                    rows.ends[lane] = if is_traced { ends[lane] } else { -1.0 };
                }
            }
        }
        Some(rows)
    }
}

/// What holds for every ray of a packet, against eight boxes at a time. Subtraction and multiplication round monotonously, so
/// that no ray enters a box before the frustum does, or leaves it later.
struct Frustum {
    /// Greatest origin where the rays go up, least where they go down: the one that is nearest to the near plane.
    near_origin: [F8; 3],
    far_origin: [F8; 3],
    inverse: [[F8; 2]; 3],
    near: [usize; 3],
}

impl Frustum {
    #[inline(always)]
    fn new<V: Lanes>(packet: &Packet<V>, like: F8) -> Self {
        let (mut near_origin, mut far_origin) = ([like; 3], [like; 3]);
        let mut inverse = [[like; 2]; 3];
        for axis in 0..3 {
            let ends = packet.origins[axis];
            let negative = packet.near[axis] & 1;
            let margin = if negative == 1 { -packet.margin } else { packet.margin };
            near_origin[axis] = like.like(ends[1 - negative] + margin);
            far_origin[axis] = like.like(ends[negative] - margin);
            let row = packet.inverse[axis];
            inverse[axis] = [like.like(row.least()), like.like(row.greatest())];
        }
        Self { near_origin, far_origin, inverse, near: packet.near }
    }

    /// A bound on where the first ray enters each box, and a bit for each box that a ray may meet before `end`.
    #[inline(always)]
    fn enter(&self, node: &Node, end: F8) -> (F8, u32) {
        let pad = end.like(SLAB_PAD);
        let (mut near, mut far) = (end.like(0.0), end);
        for axis in 0..3 {
            let [least, greatest] = self.inverse[axis];
            let to_near = end.gather(&node.rows[self.near[axis]]) - self.near_origin[axis];
            let to_far = end.gather(&node.rows[self.near[axis] ^ 1]) - self.far_origin[axis];
            near = (to_near * least).min(to_near * greatest).max(near);
            far = ((to_far * least).max(to_far * greatest) * pad).min(far);
        }
        (near, F8::bits(near.le(far)))
    }
}

/// The rows in registers, ready for boxes and triangles.
struct Packet<V: Lanes> {
    /// Origins for near and far planes, a margin apart.
    near_origin: [V; 3],
    far_origin: [V; 3],
    inverse: [V; 3],
    /// Origins along the axes of the sheared rays.
    sheared_origin: [V; 3],
    shear: [V; 3],
    /// The axes of the world that are x, y and z of every sheared ray.
    axes: [usize; 3],
    /// Rows of a node that are near.
    near: [usize; 3],
    /// The least and the greatest origins along each axis.
    origins: [[f32; 2]; 3],
    /// The greatest margin that boxes need for any of the rays.
    margin: f32,
}

impl<V: Lanes> Packet<V> {
    /// None where the rays do not go the same way: along each axis to the same side, the longest the same for all.
    #[inline(always)]
    fn new(rows: &Rows, whole: &Aabb, like: V) -> Option<Self> {
        let axes = ShearedRay::new(rows.first.origin, rows.first.direction).axes();
        let mut own = Self {
            near_origin: [like; 3],
            far_origin: [like; 3],
            inverse: [like; 3],
            sheared_origin: [like; 3],
            shear: [like; 3],
            axes,
            near: [0; 3],
            origins: [[0.0; 2]; 3],
            margin: 0.0,
        };
        let (mut origin, mut direction, mut size) = ([like; 3], [like; 3], [like; 3]);
        for (axis, origin) in origin.iter_mut().enumerate() {
            *origin = like.gather(&rows.origin[axis]);
            own.origins[axis] = [origin.least(), origin.greatest()];
        }
        let corner = |side: usize| Vec3::from_array(own.origins.map(|ends| ends[side]));
        own.margin = triangle_margin(corner(0), whole).max(triangle_margin(corner(1), whole));
        let margin = like.like(own.margin);
        let (zero, one) = (like.like(0.0), like.like(1.0));
        let all = V::bits(zero.eq(zero));
        for axis in 0..3 {
            direction[axis] = like.gather(&rows.direction[axis]);
            size[axis] = direction[axis].abs();
            own.inverse[axis] = one.over(direction[axis]);
            let up = V::bits(zero.lt(own.inverse[axis]) & own.inverse[axis].lt(like.like(f32::INFINITY)));
            let down =
                V::bits(own.inverse[axis].lt(zero) & like.like(f32::NEG_INFINITY).lt(own.inverse[axis]));
            let finite = V::bits(origin[axis].abs().lt(like.like(f32::INFINITY)));
            if (up != all && down != all) || finite != all {
                return None;
            }
            let (before, after) = (origin[axis] - margin, origin[axis] + margin);
            own.near_origin[axis] = if down == all { before } else { after };
            own.far_origin[axis] = if down == all { after } else { before };
            own.near[axis] = 2 * axis + usize::from(down == all);
        }
        // `ShearedRay::new`, side by side: which axis is the longest, and the shears.
        let x_over_y = V::bits(size[1].lt(size[0]));
        let longest = match axes[2] {
            0 => x_over_y & V::bits(size[2].lt(size[0])),
            1 => !x_over_y & V::bits(size[2].lt(size[1])),
            _ => !(x_over_y & V::bits(size[2].lt(size[0])) | !x_over_y & V::bits(size[2].lt(size[1]))),
        };
        if longest & all != all {
            return None;
        }
        let scale = own.inverse[axes[2] % 3];
        own.shear = [direction[axes[0] % 3] * scale, direction[axes[1] % 3] * scale, scale];
        own.sheared_origin = [origin[axes[0] % 3], origin[axes[1] % 3], origin[axes[2] % 3]];
        Some(own)
    }

    /// Whether any ray meets the box in a slot before its end, `SlabRay::enter` side by side.
    #[inline(always)]
    fn meets(&self, node: &Node, slot: usize, end: V) -> bool {
        let pad = end.like(SLAB_PAD);
        let (mut near, mut far) = (end.like(0.0), end);
        for axis in 0..3 {
            let row = self.near[axis] % 6;
            let (to_near, to_far) = (end.like(node.rows[row][slot]), end.like(node.rows[row ^ 1][slot]));
            near = ((to_near - self.near_origin[axis]) * self.inverse[axis]).max(near);
            far = ((to_far - self.far_origin[axis]) * self.inverse[axis] * pad).min(far);
        }
        V::bits(near.le(far)) != 0
    }

    /// Test the triangle in a lane of a pack against all rays.
    #[inline(always)]
    fn hits(&self, pack: &TrianglePack, lane: usize, t_max: V) -> triangle::Hits<V> {
        let (a, b, c) = (self.corner(pack, 0, lane), self.corner(pack, 3, lane), self.corner(pack, 6, lane));
        triangle::hits(&[a, b, c], self.shear[2], t_max, None)
    }

    /// A corner as each ray sees it; `row` is its first.
    #[inline(always)]
    fn corner(&self, pack: &TrianglePack, row: usize, lane: usize) -> [V; 3] {
        let z = self.coordinate(pack, row, 2, lane);
        let x = self.coordinate(pack, row, 0, lane) - self.shear[0] * z;
        let y = self.coordinate(pack, row, 1, lane) - self.shear[1] * z;
        [x, y, z]
    }

    #[inline(always)]
    fn coordinate(&self, pack: &TrianglePack, row: usize, i: usize, lane: usize) -> V {
        let axis = self.axes[i] % 3;
        self.shear[0].like(pack.rows[row + axis][lane]) - self.sheared_origin[i]
    }
}

/// The nearest hits so far.
struct Nearest<V: Lanes> {
    t: V,
    u: V,
    v: V,
    /// Bits of the triangles' numbers.
    id: V,
    found: u32,
}

/// See [`WideBvh::closest_packet`]; false where the rays do not go the same way.
#[inline(always)]
fn closest<V: Lanes>(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &Ends,
    hits: &mut [Option<ShapeHit>],
    like: V,
    like8: F8,
) -> bool {
    let Some(rows) = Rows::new(rays, ends) else { return true };
    let Some(packet) = Packet::new(&rows, &tree.bounds, like) else { return false };
    let frustum = Frustum::new(&packet, like8);
    let t_max = like.gather(&rows.ends);
    let pad = like.like(SLAB_PAD);
    let none = like.like(f32::from_bits(u32::MAX));
    let mut best = Nearest { t: t_max, u: t_max, v: t_max, id: none, found: 0 };
    let mut end = t_max.greatest() * SLAB_PAD;
    let mut stack: Stack<u64> = Stack::new();
    stack.push(key(0.0, 0));
    while let Some(key) = stack.pop() {
        if entry(key) > end {
            continue;
        }
        match Child::decode(key as u32) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (near, met) = frustum.enter(node, like8.like(end));
                push_ordered(tree, node, near, met, &mut stack, &packet, best.t * pad);
            }
            Child::Leaf { first, count } => {
                let mut any = 0;
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    for lane in 0..PACK {
                        if pack.ids[lane] == u32::MAX {
                            break;
                        }
                        any |= best.take(&packet, pack, lane, rays);
                    }
                }
                if any != 0 {
                    end = best.t.greatest() * SLAB_PAD;
                }
            }
        }
    }
    best.write(hits);
    true
}

impl<V: Lanes> Nearest<V> {
    /// Take what is nearer, or as near with a lower number; a bit for each ray that took it.
    #[inline(always)]
    fn take(&mut self, packet: &Packet<V>, pack: &TrianglePack, lane: usize, rays: &[Ray]) -> u32 {
        let hits = packet.hits(pack, lane, self.t);
        if hits.hit | hits.doubtful == 0 {
            return 0;
        }
        self.keep(&hits, pack, lane, rays)
    }

    #[inline(always)]
    fn keep(&mut self, hits: &triangle::Hits<V>, pack: &TrianglePack, lane: usize, rays: &[Ray]) -> u32 {
        let own = pack.ids[lane];
        let as_near = hits.hit & V::bits(hits.t.eq(self.t));
        let mut taken = hits.hit & !as_near;
        if taken != 0 {
            let mask = V::mask(taken, self.t);
            self.t = hits.t.or_else(mask, self.t);
            self.u = hits.u.or_else(mask, self.u);
            self.v = hits.v.or_else(mask, self.v);
            self.id = self.t.like(f32::from_bits(own)).or_else(mask, self.id);
            self.found |= taken;
        }
        let mut singly = as_near | hits.doubtful;
        while singly != 0 {
            let ray = singly.trailing_zeros() as usize;
            singly &= singly - 1;
            taken |= self.keep_one(ray, pack, lane, rays);
        }
        taken
    }

    /// The same for one ray, by the scalar test.
    #[cold]
    #[inline(never)]
    fn keep_one(&mut self, ray: usize, pack: &TrianglePack, lane: usize, rays: &[Ray]) -> u32 {
        let Some(own) = rays.get(ray) else { return 0 };
        let [mut t, mut u, mut v, mut id] = [[0.0; SIZE]; 4];
        self.t.store(&mut t);
        self.u.store(&mut u);
        self.v.store(&mut v);
        self.id.store(&mut id);
        let sheared = ShearedRay::new(own.origin, own.direction);
        let Some(hit) = sheared.intersect(&pack.corners(lane), t[ray]) else { return 0 };
        let number = pack.ids[lane];
        if (hit.t, number) >= (t[ray], id[ray].to_bits()) {
            return 0;
        }
        (t[ray], u[ray], v[ray], id[ray]) = (hit.t, hit.u, hit.v, f32::from_bits(number));
        (self.t, self.u) = (self.t.gather(&t), self.t.gather(&u));
        (self.v, self.id) = (self.t.gather(&v), self.t.gather(&id));
        self.found |= 1 << ray;
        1 << ray
    }

    #[inline(always)]
    fn write(&self, hits: &mut [Option<ShapeHit>]) {
        let [mut t, mut u, mut v, mut id] = [[0.0; SIZE]; 4];
        self.t.store(&mut t);
        self.u.store(&mut u);
        self.v.store(&mut v);
        self.id.store(&mut id);
        for (ray, hit) in hits.iter_mut().enumerate().take(SIZE) {
            *hit = (self.found & 1 << ray != 0).then(|| ShapeHit {
                t: t[ray],
                primitive: id[ray].to_bits(),
                u: u[ray],
                v: v[ray],
            });
        }
    }
}

/// See [`WideBvh::any_packet`]; none where the rays do not go the same way.
#[inline(always)]
fn any<V: Lanes>(
    tree: &WideBvh,
    rays: &[Ray],
    ends: &Ends,
    except: &[Option<u32>],
    like: V,
    like8: F8,
) -> Option<u32> {
    let Some(rows) = Rows::new(rays, ends) else { return Some(0) };
    let packet = Packet::new(&rows, &tree.bounds, like)?;
    let frustum = Frustum::new(&packet, like8);
    let mut t_max = like.gather(&rows.ends);
    let pad = like.like(SLAB_PAD);
    let mut end = t_max.greatest() * SLAB_PAD;
    let all = rows.traced;
    let mut found = 0_u32;
    let mut stack: Stack<u32> = Stack::new();
    stack.push(0);
    while let Some(code) = stack.pop() {
        match Child::decode(code) {
            Child::Inner(index) => {
                let node = &tree.nodes[index as usize];
                let (_, mut met) = frustum.enter(node, like8.like(end));
                while met != 0 {
                    let slot = met.trailing_zeros() as usize % 8;
                    met &= met - 1;
                    prefetch(tree, node.children[slot]);
                    stack.push_if(node.children[slot], packet.meets(node, slot, t_max * pad));
                }
            }
            Child::Leaf { first, count } => {
                let before = found;
                for pack in &tree.packs[first as usize..(first + count) as usize] {
                    for lane in 0..PACK {
                        if pack.ids[lane] == u32::MAX {
                            break;
                        }
                        let hits = packet.hits(pack, lane, t_max);
                        let mut rest = (hits.hit | hits.doubtful) & all & !found;
                        while rest != 0 {
                            let ray = rest.trailing_zeros() as usize % SIZE;
                            rest &= rest - 1;
                            if except.get(ray).copied().flatten() == Some(pack.ids[lane]) {
                                continue;
                            }
                            let sure = hits.hit & 1 << ray != 0;
                            if sure || doubtful_hit(&Ray { t_max: ends[ray], ..rays[ray] }, pack, lane) {
                                found |= 1 << ray;
                            }
                        }
                    }
                }
                if found == all {
                    return Some(found);
                }
                if before != found {
                    t_max = like.like(-1.0).or_else(V::mask(found, t_max), t_max);
                    end = t_max.greatest() * SLAB_PAD;
                }
            }
        }
    }
    Some(found)
}

#[cold]
#[inline(never)]
fn doubtful_hit(ray: &Ray, pack: &TrianglePack, lane: usize) -> bool {
    ShearedRay::new(ray.origin, ray.direction).intersect(&pack.corners(lane), ray.t_max).is_some()
}

/// Push the children that are met, farthest first, so that the nearest is on top.
#[inline(always)]
fn push_ordered<V: Lanes>(
    tree: &WideBvh,
    node: &Node,
    near: F8,
    met: u32,
    stack: &mut Stack<u64>,
    packet: &Packet<V>,
    end: V,
) {
    let mut entries = [0.0_f32; 8];
    near.store(&mut entries);
    let (mut rest, mut pushed) = (met, 0);
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % 8;
        rest &= rest - 1;
        if !packet.meets(node, slot, end) {
            continue;
        }
        prefetch(tree, node.children[slot]);
        stack.insert(key(entries[slot], node.children[slot]), pushed);
        pushed += 1;
    }
}

/// [`closest`] by AVX2.
#[target_feature(enable = "avx2")]
pub fn closest_avx2(tree: &WideBvh, rays: &[Ray], ends: &Ends, hits: &mut [Option<ShapeHit>]) -> bool {
    // SAFETY: this function has the instructions.
    let (like, like8) = unsafe { (Pair::<F8>::splat(0.0), F8::splat(0.0)) };
    closest(tree, rays, ends, hits, like, like8)
}

/// [`any`] by AVX2.
#[target_feature(enable = "avx2")]
pub fn any_avx2(tree: &WideBvh, rays: &[Ray], ends: &Ends, except: &[Option<u32>]) -> Option<u32> {
    // SAFETY: this function has the instructions.
    let (like, like8) = unsafe { (Pair::<F8>::splat(0.0), F8::splat(0.0)) };
    any(tree, rays, ends, except, like, like8)
}

/// [`closest`] by AVX-512.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
pub fn closest_avx512(tree: &WideBvh, rays: &[Ray], ends: &Ends, hits: &mut [Option<ShapeHit>]) -> bool {
    // SAFETY: this function has the instructions.
    let (like, like8) = unsafe { (F16::splat(0.0), F8::splat(0.0)) };
    closest(tree, rays, ends, hits, like, like8)
}

/// [`any`] by AVX-512.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
pub fn any_avx512(tree: &WideBvh, rays: &[Ray], ends: &Ends, except: &[Option<u32>]) -> Option<u32> {
    // SAFETY: this function has the instructions.
    let (like, like8) = unsafe { (F16::splat(0.0), F8::splat(0.0)) };
    any(tree, rays, ends, except, like, like8)
}
