//! Tests of triangle lists. Every decided packet result must match the single-ray result on every instruction
//! set.

use super::{InstructionSet, SimdKernel};
use crate::geometry::packet::{HitPacket, PACKET_SIZE, RayPacket};
use crate::geometry::triangle_list::BruteForceTriangles;
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Ray, ShapeHit};
use crate::math::Vec3;
use crate::math::lanes::Simd;
use crate::math::random::signed_number_generator;

/// Runs closest-hit and any-hit queries. Returns the nearest hits and three masks: undecided closest-hit
/// rays, rays that hit any triangle other than `except`, and undecided any-hit rays.
struct BruteForceQueryKernel<'a> {
    facets: &'a BruteForceTriangles,
    rays: &'a [Ray],
    except: &'a [u32; PACKET_SIZE],
}

impl SimdKernel for BruteForceQueryKernel<'_> {
    type Output = (HitPacket, [u32; 3]);

    #[inline(always)]
    fn run(self, simd: impl Simd) -> Self::Output {
        let (rows, ends) = RayPacket::new(self.rays);
        let (active, mut found) = (((1_u64 << self.rays.len()) - 1) as u32, HitPacket::without_hits());
        let open = self.facets.update_decided_closest_hits(&rows, (active, &ends), &mut found, simd);
        let [any, open_any] =
            self.facets.any_hit_and_undecided_masks(&rows, (active, &ends), self.except, simd);
        (found, [open, any, open_any])
    }
}

/// The six walls of a box, two triangles each.
fn walls(low: Vec3, high: Vec3) -> Vec<[Vec3; 3]> {
    let corner =
        |i: usize| Vec3::from([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] }));
    let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let each = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]].map(|three| three.map(corner));
    quads.into_iter().flat_map(each).collect()
}

/// A room with objects inside. It may be rotated, skewed, small, or far from the origin.
fn room(round: usize, next: &mut dyn FnMut() -> f32) -> Vec<[Vec3; 3]> {
    let mut triangles = walls(Vec3::splat(-1.0), Vec3::ONE);
    for _ in 0..round % 3 {
        let at = Vec3::new(next(), next(), next()) * 0.6;
        triangles.extend(walls(at, at + Vec3::new(next(), next(), next()).abs() * 0.4 + 0.02));
    }
    for _ in 0..round % 4 {
        let at = Vec3::new(next(), next(), next()) * 0.8;
        triangles.push([at, at + Vec3::new(next(), next(), next()), at + Vec3::new(next(), next(), next())]);
    }
    let angle = [0.0, 0.7, 1e-4][round / 2 % 3];
    let (sine, cosine) = f32::sin_cos(angle);
    let (scale, shift) = ([1.0, 300.0, 1e-3][round % 3], [0.0, 5.0, 100.0][round / 3 % 3]);
    let uneven = if round.is_multiple_of(5) { 0.01 } else { 0.0 };
    triangles
        .iter()
        .map(|corners| {
            corners.map(|p| {
                let bent = Vec3::new(p.x + uneven * p.y * p.z, p.y, p.z + uneven * p.x);
                let turned =
                    Vec3::new(cosine * bent.x - sine * bent.y, sine * bent.x + cosine * bent.y, bent.z);
                (turned + Vec3::splat(shift)) * scale
            })
        })
        .collect()
}

fn single_ray_hit(triangles: &[[Vec3; 3]], ray: &Ray, except: u32) -> Option<ShapeHit> {
    let (sheared, mut best) = (ShearedRay::new(ray.origin, ray.direction), None);
    for (number, corners) in
        (0..).zip(triangles).filter(|&(number, _)| number != ray.start && number != except)
    {
        let end = best.map_or(ray.t_max, |best: ShapeHit| best.t);
        let Some(hit) = sheared.intersect(corners, end) else { continue };
        if best.is_none_or(|best| hit.t < best.t) {
            best = Some(ShapeHit { primitive: number, ..hit });
        }
    }
    best
}

#[test]
fn decided_packets_match_single_rays() {
    let mut next = signed_number_generator(11);
    // For each kind of ray, count all rays, hits, and undecided rays. Also count rays from surfaces near the
    // origin, and the undecided ones among them.
    let (mut bounces, mut left) = (0, 0);
    let mut counts = [[0_u32; 3]; 6];
    for round in 0..6000 {
        let triangles = room(round / 6, &mut next);
        let Some(facets) = BruteForceTriangles::new(triangles.clone()) else { continue };
        let kind = round % 6;
        let any = |next: &mut dyn FnMut() -> f32| (next().abs() * (triangles.len() as f32 - 0.01)) as usize;
        let on = |of: &[Vec3; 3], next: &mut dyn FnMut() -> f32| {
            let (u, v) = (next().abs(), next().abs());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            of[0] + (of[1] - of[0]) * u + (of[2] - of[0]) * v
        };
        let ray = |next: &mut dyn FnMut() -> f32| {
            let (from, to) = (any(next), any(next));
            let (start, target) = (on(&triangles[from], next), on(&triangles[to], next));
            let own = Ray::new(start, target - start).with_start_triangle(from as u32);
            match kind {
                // Scattered rays in random directions, and shadow rays to other surfaces.
                0 => Ray { direction: Vec3::new(next(), next(), next()), ..own },
                1 => Ray { t_max: 1.0 - 1e-5, ..own },
                // Rays toward corners, along edges, and along axes.
                2 => Ray { direction: triangles[to][0] - start, ..own },
                3 => Ray::new(triangles[from][0], triangles[from][1] - triangles[from][0]),
                4 => {
                    Ray::new(start, [Vec3::X, Vec3::NEG_Y, Vec3::Z][to % 3]).with_start_triangle(from as u32)
                }
                // Rays from far away, and rays in the plane of a triangle.
                _ if to % 2 == 0 => Ray::new(start * 50.0 - target * 49.0, target - start),
                _ => Ray::new(start, on(&triangles[from], next) - start),
            }
        };
        let rays: Vec<Ray> = (0..=round / 7 % PACKET_SIZE).map(|_| ray(&mut next)).collect();
        let except: [u32; PACKET_SIZE] =
            std::array::from_fn(|i| if i % 3 == 0 { any(&mut next) as u32 } else { u32::MAX });
        for instructions in InstructionSet::ALL {
            let (found, [open, hits_any, open_any]) =
                instructions.run(BruteForceQueryKernel { facets: &facets, rays: &rays, except: &except });
            for (i, ray) in rays.iter().enumerate() {
                let (own, other) =
                    (single_ray_hit(&triangles, ray, u32::MAX), single_ray_hit(&triangles, ray, except[i]));
                let is = |bits: u32| bits & 1 << i != 0;
                let what = || format!("round {round}, {instructions:?}, {ray:?}, except {}", except[i]);
                if is(open) {
                    assert_eq!(found.get(i), None, "{}", what());
                } else {
                    assert_eq!(found.get(i), own, "{}", what());
                }
                assert!(is(open_any) || is(hits_any) == other.is_some(), "{}", what());
                let count = &mut counts[kind];
                count[0] += 1;
                count[1] += u32::from(own.is_some());
                count[2] += u32::from(is(open));
                let is_near = kind == 0 && round / 18 % 3 == 0;
                (bounces, left) = (bounces + u32::from(is_near), left + u32::from(is_near && is(open)));
            }
        }
    }
    assert!(counts.iter().all(|[all, hits, _]| *all > 5000 && hits * 4 > *all), "{counts:?}");
    assert!(left * 20 < bounces, "{left} of {bounces} scattered rays are undecided");
}

#[test]
fn nan_rays_are_undecided() {
    let facets = BruteForceTriangles::new(walls(Vec3::splat(-1.0), Vec3::ONE)).expect("a room");
    let bad = [f32::NAN, f32::INFINITY, 0.0, -0.0, 1e38, 1e-40];
    for (a, b) in bad.into_iter().flat_map(|a| bad.map(|b| (a, b))) {
        for ray in [
            Ray::new(Vec3::new(a, 0.1, 0.0), Vec3::new(0.3, b, 0.2)),
            Ray::new(Vec3::splat(0.1), Vec3::new(a, b, a)),
        ] {
            for instructions in InstructionSet::ALL {
                let (found, [open, any, open_any]) = instructions.run(BruteForceQueryKernel {
                    facets: &facets,
                    rays: &[ray],
                    except: &[u32::MAX; PACKET_SIZE],
                });
                let own = single_ray_hit(&walls(Vec3::splat(-1.0), Vec3::ONE), &ray, u32::MAX);
                assert!(open & 1 == 1 || found.get(0) == own, "{ray:?}");
                assert!(open_any & 1 == 1 || (any & 1 == 1) == own.is_some(), "{ray:?}");
            }
        }
    }
}

#[test]
fn needles_and_large_meshes_are_rejected() {
    let needle = [Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1e-5, 0.0)];
    assert!(BruteForceTriangles::new(vec![needle]).is_none());
    let wall = [Vec3::ZERO, Vec3::X, Vec3::Y];
    assert!(BruteForceTriangles::new(vec![wall; 64]).is_some());
    assert!(BruteForceTriangles::new(vec![wall; 65]).is_none());
    assert!(BruteForceTriangles::new(vec![]).is_none());
    assert!(BruteForceTriangles::new(vec![[Vec3::NAN; 3], wall]).is_none());
}
