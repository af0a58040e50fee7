//! Tests of packet triangle intersection on every instruction set.

use super::{InstructionSet, SimdKernel};
use crate::geometry::Ray;
use crate::geometry::packet::{PACKET_SIZE, RayPacket};
use crate::geometry::watertight::ShearedRay;
use crate::geometry::watertight_packet::{ShearedPacket, TriangleTestResults};
use crate::math::Vec3;
use crate::math::lanes::Simd;
use crate::math::random::signed_number_generator;

struct TriangleTestKernel<'a> {
    rays: &'a [Ray],
    /// Index of the triangle.
    number: u32,
    corners: &'a [Vec3; 3],
}

impl SimdKernel for TriangleTestKernel<'_> {
    type Output = TriangleTestResults;

    #[inline(always)]
    fn run(self, _: impl Simd) -> TriangleTestResults {
        let (rows, ends) = RayPacket::new(self.rays);
        let corners = self.corners.map(|corner| corner.to_array().map(|value| [value; PACKET_SIZE]));
        let [a, b, c] = &corners;
        ShearedPacket::new(&rows).intersect_triangles_per_ray(&[self.number; PACKET_SIZE], [a, b, c], &ends)
    }
}

#[test]
fn packets_match_single_rays_bit_for_bit() {
    let mut next = signed_number_generator(7);
    let (mut hits, mut doubtful) = (0, 0);
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
        for (number, corners) in (0..).zip(&triangles) {
            for instructions in InstructionSet::ALL {
                let found = instructions.run(TriangleTestKernel { rays: &rays, number, corners });
                for (i, ray) in rays.iter().enumerate() {
                    let alone = ShearedRay::new(ray.origin, ray.direction)
                        .intersect(corners, ray.t_max)
                        .filter(|_| ray.start != number);
                    // Doubtful results are computed again, ray by ray.
                    if found.doubtful[i] == 0 {
                        let hit = (found.hit[i] != 0).then(|| (found.t[i], found.u[i], found.v[i]));
                        let alone = alone.map(|hit| (hit.t, hit.u, hit.v));
                        assert_eq!(hit, alone, "{instructions:?}: {ray:?} {corners:?}");
                        hits += usize::from(hit.is_some());
                    } else {
                        doubtful += 1;
                    }
                }
            }
        }
    }
    assert!(hits > 100_000 && doubtful > 10_000, "{hits} hits, {doubtful} doubtful");
}
