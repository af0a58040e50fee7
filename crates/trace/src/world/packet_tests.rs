//! Tests every shape with packets on every instruction set. Hits must be bit-identical to the hits of single
//! rays.

use super::*;
use crate::accel::{InstructionSet, SimdKernel};
use crate::geometry::cuboid::OrientedBox;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::plane::Plane;
use crate::geometry::sphere::Sphere;
use crate::geometry::triangle::Triangle;
use crate::math::random::TestRandom;
use crate::math::{DVec3, Vec3};

/// Random rays, including adversarial ones.
struct HostileRays(TestRandom);

impl HostileRays {
    fn below(&mut self, count: usize) -> usize {
        self.0.below(count)
    }

    fn vector(&mut self) -> Vec3 {
        self.0.in_cube_f32()
    }

    /// An adversarial coordinate: on a corner or face, zero, or so large or small that products overflow or
    /// underflow.
    fn hostile_coordinate(&mut self) -> f32 {
        const HOSTILE: [f32; 16] = [
            0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 2.0, -3.0, 1e-45, -1e-40, 1e-20, 1e-7, 1e10, -1e19, 3e38, -3e38,
        ];
        let count = if self.below(4) == 0 { 16 } else { 8 };
        HOSTILE[self.below(count)]
    }

    fn hostile_vector(&mut self) -> Vec3 {
        Vec3::new(self.hostile_coordinate(), self.hostile_coordinate(), self.hostile_coordinate())
    }

    fn ray(&mut self, kind: usize, scale: f32) -> Ray {
        match kind {
            0 => Ray::new(self.hostile_vector(), self.hostile_vector()),
            1 => Ray::new(self.hostile_vector() * scale, self.vector()),
            2 => Ray::new(self.vector() * 0.5 * scale, self.vector()),
            3 => Ray::segment_ending_before_point(self.vector() * 4.0 * scale, self.vector() * scale),
            _ => {
                let from = self.vector() * 4.0 * scale;
                Ray::new(from, self.vector() * scale - from)
            }
        }
    }
}

/// One axis-aligned and one tilted shape of each kind, all of this size.
fn test_shapes(scale: f64) -> Vec<Object> {
    let (center, askew) = (DVec3::new(0.3, -0.2, 0.1) * scale, DVec3::new(0.3, -0.7, 0.5));
    let quad = |corner: DVec3, u: DVec3, v: DVec3| {
        Shape::Quad(Parallelogram::new(corner * scale, u * scale, v * scale))
    };
    let triangle =
        |a: DVec3, b: DVec3, c: DVec3| Shape::Triangle(Triangle { a: a * scale, b: b * scale, c: c * scale });
    let shapes = [
        Shape::Plane(Plane::new(DVec3::ZERO, DVec3::Y)),
        Shape::Plane(Plane::new(center, askew)),
        quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::X * 2.0, DVec3::Z * 2.0),
        quad(askew * -1.5, DVec3::new(2.0, 0.5, 0.1), DVec3::new(0.3, 1.0, 2.0)),
        Shape::Sphere(Sphere { center: DVec3::ZERO, radius: scale }),
        Shape::Sphere(Sphere { center, radius: 0.7 * scale }),
        Shape::Box(OrientedBox::new(DVec3::ZERO, DVec3::splat(2.0 * scale), DVec3::ZERO)),
        Shape::Box(OrientedBox::new(center, DVec3::new(0.5, 1.0, 1.5) * scale, DVec3::new(10.0, 20.0, 30.0))),
        triangle(DVec3::ZERO, DVec3::X, DVec3::Y),
        triangle(DVec3::new(-1.0, 0.1, -0.6), DVec3::new(1.0, 0.3, -0.9), DVec3::new(0.0, -0.2, 1.1)),
        Shape::Disk(Disk::new(DVec3::ZERO, DVec3::Z, scale)),
        Shape::Disk(Disk::new(center, askew, 0.8 * scale)),
        Shape::Cylinder(Cylinder::new(DVec3::ZERO, DVec3::Y * scale, 0.5 * scale, true)),
    ];
    shapes.map(Object::Shape).to_vec()
}

/// A packet's closest hits, and its any-hit masks with and without ignored primitives.
struct PacketTestKernel<'a> {
    object: &'a Object,
    rays: &'a [Ray],
    active: u32,
    except: (u32, &'a [u32; PACKET_SIZE]),
}

impl SimdKernel for PacketTestKernel<'_> {
    type Output = (HitPacket, u32, u32);

    #[inline(always)]
    fn run(self, simd: impl Simd) -> Self::Output {
        let Self { object, rays, active, except } = self;
        let (rows, mut ends) = RayPacket::new(rays);
        for (lane, end) in ends.iter_mut().enumerate() {
            *end = if active & 1 << lane != 0 { *end } else { -1.0 };
        }
        let mut found = HitPacket::without_hits();
        object.closest_hit_packet(&rows, active, &ends, &mut found, simd);
        let any_part = object.any_hit_packet(&rows, active, &ends, None, simd);
        (found, any_part, object.any_hit_packet(&rows, active, &ends, Some(except), simd))
    }
}

/// Bit patterns of a hit's fields.
fn hit_bits(hit: ShapeHit) -> [u32; 4] {
    [hit.t.to_bits(), hit.primitive, hit.u.to_bits(), hit.v.to_bits()]
}

/// Compares a packet with single rays and returns the number of hits.
fn assert_packet_matches_rays(
    object: &Object,
    rays: &[Ray],
    active: u32,
    except: (u32, &[u32; PACKET_SIZE]),
) -> usize {
    let active = active & ((1 << rays.len()) - 1);
    let alone = |lane: usize| {
        let is_traced = rays.get(lane).is_some() && active & 1 << lane != 0;
        is_traced.then(|| object.closest_hit(&rays[lane], &rays[lane].to_f64())).flatten()
    };
    let mut hits = 0;
    for instructions in InstructionSet::ALL {
        let (found, any_part, other_part) =
            instructions.run(PacketTestKernel { object, rays, active, except });
        hits = 0;
        for lane in 0..PACKET_SIZE {
            let alone = alone(lane);
            let what = || format!("{instructions:?}: lane {lane} of {rays:?} at {object:?}");
            assert_eq!(found.get(lane).map(hit_bits), alone.map(hit_bits), "{}", what());
            assert_eq!(any_part & 1 << lane != 0, alone.is_some(), "{}", what());
            let own = if except.0 & 1 << lane == 0 { None } else { Some(except.1[lane]) };
            let other = alone.is_some_and(|hit| Some(hit.primitive) != own);
            assert_eq!(other_part & 1 << lane != 0, other, "{}", what());
            hits += usize::from(alone.is_some());
        }
    }
    hits
}

#[test]
fn packet_and_single_hits_are_bit_identical() {
    let mut random = HostileRays(TestRandom::new(11));
    for scale in [1.0_f32, 1e-18, 1e15] {
        for object in test_shapes(f64::from(scale)) {
            let (mut hits, mut rays_in_all) = (0, 0);
            for i in 0..2000 {
                let kind = random.below(6);
                let mut rays: Vec<_> =
                    (0..=i % PACKET_SIZE).map(|lane| random.ray(kind.min(lane + kind / 2), scale)).collect();
                let active = [0xffff, random.below(1 << 16) as u32][random.below(2)];
                let parts = std::array::from_fn(|_| random.below(6) as u32);
                let except = (random.below(1 << 16) as u32, &parts);
                hits += assert_packet_matches_rays(&object, &rays, active, except);
                // End rays exactly at the hit, next to it, and well before it.
                let [before, at] = [f32::next_down as fn(f32) -> f32, |end| end];
                let nudge = [before, at, f32::next_up, |end| end * 0.999_999, |end| end * 0.5][i % 5];
                for ray in &mut rays {
                    if let Some(hit) = object.closest_hit(ray, &ray.to_f64()) {
                        ray.t_max = nudge(hit.t);
                    }
                }
                assert_packet_matches_rays(&object, &rays, active, except);
                rays_in_all += rays.len();
            }
            assert!(
                hits > rays_in_all / 100 && hits < rays_in_all,
                "{hits} hits for {rays_in_all} rays: {object:?}"
            );
        }
    }
}
