//! Tests of packet triangle intersection on every instruction set.

use super::{InstructionSet, SimdKernel};
use crate::geometry::packet::{HitPacket, PACKET_SIZE, RayPacket};
use crate::geometry::watertight::ShearedRay;
use crate::geometry::watertight_packet::ShearedPacket;
use crate::geometry::{Ray, ShapeHit};
use crate::math::Vec3;
use crate::math::lanes::Simd;
use crate::math::random::signed_generator;

struct ClosestAndAnyHitKernel<'a> {
    rays: &'a [Ray],
    triangles: &'a [[Vec3; 3]],
}

impl SimdKernel for ClosestAndAnyHitKernel<'_> {
    type Output = (HitPacket, u32);

    #[inline(always)]
    fn run(self, simd: impl Simd) -> (HitPacket, u32) {
        let (rows, ends) = RayPacket::new(self.rays);
        let (rays, mut found, mut any) = (ShearedPacket::new(&rows), HitPacket::without_hits(), 0);
        let (met, mut nearest) = ((1 << self.rays.len()) - 1, ends);
        for (number, corners) in (0..).zip(self.triangles) {
            any |= rays.hit_mask((number, corners), met, &ends, simd);
            rays.update_closest_hits((number, corners), (met, &mut nearest), &mut found, simd);
        }
        (found, any)
    }
}

#[test]
fn packets_match_single_rays_bit_for_bit() {
    let mut next = signed_generator(7);
    let (mut hits, mut shared) = (0, 0);
    for round in 0..20_000 {
        // Triangles share corners and may be degenerate. Rays are parallel to an axis, toward corners, or
        // from surfaces.
        let step = [1.0, 0.25, 1e-6][round % 3];
        let corners: Vec<Vec3> = (0..6)
            .map(|_| (Vec3::new(next(), next(), next()) / step).round() * step + Vec3::splat(0.5))
            .collect();
        let triangles: Vec<[Vec3; 3]> =
            (0..8).map(|i| [i, i * i + 1, i + 3].map(|corner| corners[corner % 6])).collect();
        let ray = |next: &mut dyn FnMut() -> f32| {
            let target = corners[(next().abs() * 5.99) as usize];
            let origin = match round % 4 {
                0 => target + Vec3::new(next(), 0.0, 0.0),
                1 => (corners[0] + corners[1]) * 0.5,
                _ => Vec3::new(next(), next(), next()) * 4.0,
            };
            let aside = Vec3::new(next(), next(), next()) * [0.0, 0.3][round / 2 % 2];
            let t_max = [f32::INFINITY, 0.9, 1.0][round % 3];
            let start = [Ray::NO_TRIANGLE, round as u32 / 2 % 8][round % 2];
            Ray { t_max, start, ..Ray::new(origin, target + aside - origin) }
        };
        let rays: Vec<Ray> = (0..=round % PACKET_SIZE).map(|_| ray(&mut next)).collect();
        let alone: Vec<_> = rays
            .iter()
            .map(|ray| {
                let (sheared, mut best) = (ShearedRay::new(ray.origin, ray.direction), None);
                for (number, corners) in (0..).zip(&triangles).filter(|&(number, _)| number != ray.start) {
                    let end = best.map_or(ray.t_max, |best: ShapeHit| best.t);
                    let Some(hit) = sheared.intersect(corners, end) else { continue };
                    if best.is_none_or(|best| hit.t < best.t) {
                        best = Some(ShapeHit { primitive: number, ..hit });
                    }
                }
                best
            })
            .collect();
        for instructions in InstructionSet::ALL {
            let (found, any) =
                instructions.run(ClosestAndAnyHitKernel { rays: &rays, triangles: &triangles });
            for (i, alone) in alone.iter().enumerate() {
                assert_eq!(found.get(i), *alone, "{instructions:?}: {:?} {triangles:?}", rays[i]);
                assert_eq!(any & 1 << i != 0, alone.is_some(), "{instructions:?}: {:?}", rays[i]);
            }
        }
        hits += alone.iter().flatten().count();
        shared += usize::from(alone.iter().flatten().any(|hit| hit.u == 0.0 || hit.v == 0.0));
    }
    assert!(hits > 20_000 && shared > 1000, "{hits} hits, {shared} on edges");
}
