//! Nearest hits for a packet of rays.

use super::rays::SimdRayPacket;
use crate::accel::PACKET_SIZE as SIZE;
use crate::accel::wide_bvh::node::TrianglePack;
use crate::accel::wide_bvh::simd::triangle;
use crate::accel::wide_bvh::simd::vector::SimdVector;
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Ray, ShapeHit};

/// Nearest hit of each ray so far.
pub struct NearestHits<V: SimdVector> {
    pub t: V,
    u: V,
    v: V,
    /// Triangle indices, stored as bit patterns.
    id: V,
    found: u32,
}

impl<V: SimdVector> NearestHits<V> {
    /// Starts without any hits. `ends` contains the ends of the rays.
    #[inline(always)]
    pub fn new(ends: V) -> Self {
        Self { t: ends, u: ends, v: ends, id: ends.splat_like(f32::from_bits(u32::MAX)), found: 0 }
    }

    /// Updates the rays whose hit on a triangle is nearer than their best hit, or equally near with a lower
    /// index. Returns the mask of the updated rays.
    #[inline(always)]
    pub fn update_with_triangle(
        &mut self,
        packet: &SimdRayPacket<V>,
        pack: &TrianglePack,
        lane: usize,
        rays: &[Ray],
    ) -> u32 {
        let hits = packet.intersect_triangle(pack, lane, self.t);
        if hits.hit | hits.doubtful == 0 {
            return 0;
        }
        let others = !packet.lanes_starting_on(pack.ids[lane]);
        let hits =
            triangle::TriangleHits { hit: hits.hit & others, doubtful: hits.doubtful & others, ..hits };
        self.record_nearer_hits(&hits, pack, lane, rays)
    }

    #[inline(always)]
    fn record_nearer_hits(
        &mut self,
        hits: &triangle::TriangleHits<V>,
        pack: &TrianglePack,
        lane: usize,
        rays: &[Ray],
    ) -> u32 {
        let own = pack.ids[lane];
        let as_near = hits.hit & V::movemask(hits.t.eq(self.t));
        let mut taken = hits.hit & !as_near;
        if taken != 0 {
            let mask = V::mask_from_bits(taken, self.t);
            self.t = hits.t.select(mask, self.t);
            self.u = hits.u.select(mask, self.u);
            self.v = hits.v.select(mask, self.v);
            self.id = self.t.splat_like(f32::from_bits(own)).select(mask, self.id);
            self.found |= taken;
        }
        let mut singly = as_near | hits.doubtful;
        while singly != 0 {
            let ray = singly.trailing_zeros() as usize;
            singly &= singly - 1;
            taken |= self.update_ray_with_scalar_test(ray, pack, lane, rays);
        }
        taken
    }

    /// [`NearestHits::update_with_triangle`] for one ray, using the scalar test.
    #[cold]
    #[inline(never)]
    fn update_ray_with_scalar_test(
        &mut self,
        ray: usize,
        pack: &TrianglePack,
        lane: usize,
        rays: &[Ray],
    ) -> u32 {
        let Some(own) = rays.get(ray) else { return 0 };
        let [mut t, mut u, mut v, mut id] = [[0.0; SIZE]; 4];
        self.t.store(&mut t);
        self.u.store(&mut u);
        self.v.store(&mut v);
        self.id.store(&mut id);
        let sheared = ShearedRay::new(own.origin, own.direction);
        let Some(hit) = sheared.intersect(&pack.corners_at_lane(lane), t[ray]) else { return 0 };
        let number = pack.ids[lane];
        if (hit.t, number) >= (t[ray], id[ray].to_bits()) {
            return 0;
        }
        (t[ray], u[ray], v[ray], id[ray]) = (hit.t, hit.u, hit.v, f32::from_bits(number));
        (self.t, self.u) = (self.t.load_slice(&t), self.t.load_slice(&u));
        (self.v, self.id) = (self.t.load_slice(&v), self.t.load_slice(&id));
        self.found |= 1 << ray;
        1 << ray
    }

    #[inline(always)]
    pub fn write_shape_hits(&self, hits: &mut [Option<ShapeHit>]) {
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
