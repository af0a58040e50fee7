//! General properties of disks, cylinders, cones and tori: scale invariance, signed zeros, bounds, tangents.

use glimt::geometry::Ray;
use glimt::math::random::TestRandom;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::Shape;

use super::round::{cone, cylinder, geometry, random_in, torus};
use super::v;

/// One shape of each kind.
fn each(random: &mut TestRandom, center: DVec3) -> Vec<Shape> {
    vec![
        Shape::Disk { center, normal: random.direction(), radius: 0.8 },
        cylinder(random, center, 1.0, true),
        cylinder(random, center, 1.0, false),
        cone(random, center, 1.0, true),
        cone(random, center, 1.0, false),
        torus(random, center, 0.8, 0.4),
    ]
}

fn scaled(shape: &Shape, s: f64) -> Shape {
    match *shape {
        Shape::Disk { center, normal, radius } => {
            Shape::Disk { center: center * s, normal, radius: radius * s }
        }
        Shape::Cylinder { a, b, radius, caps } => {
            Shape::Cylinder { a: a * s, b: b * s, radius: radius * s, caps }
        }
        Shape::Cone { base, tip, radius, cap } => {
            Shape::Cone { base: base * s, tip: tip * s, radius: radius * s, cap }
        }
        Shape::Torus { center, axis, radius, tube } => {
            Shape::Torus { center: center * s, axis, radius: radius * s, tube: tube * s }
        }
        _ => unreachable!(),
    }
}

#[test]
fn hits_are_bit_identical_at_any_scale() {
    let mut random = TestRandom::new(53);
    for shape in each(&mut random, v(0.3, -0.2, 0.5)) {
        let rays: Vec<Ray> = (0..400)
            .map(|_| {
                let from = random_in(&mut random, DVec3::ZERO, 4.0);
                Ray::new(from.as_vec3(), (random_in(&mut random, v(0.3, -0.2, 0.5), 0.8) - from).as_vec3())
            })
            .collect();
        let of_scale = |k: i32| {
            let geometry = geometry(&scaled(&shape, 2.0_f64.powi(k)));
            let s = 2.0_f32.powi(k);
            let hits = rays.iter().map(|ray| {
                let ray = Ray { origin: ray.origin * s, ..*ray };
                let hit = geometry.closest_hit(&ray)?;
                let surface = geometry.surface(&ray, &hit);
                Some((hit.shape.t / s, hit.shape.primitive, surface.point / s, surface.normal, surface.uv))
            });
            hits.collect::<Vec<_>>()
        };
        let expected = of_scale(0);
        assert!(expected.iter().flatten().count() > 20, "{shape:?}");
        for k in -30..=30 {
            assert_eq!(of_scale(k), expected, "{shape:?} at 2^{k}");
        }
    }
}

#[test]
fn signed_zero_direction_does_not_change_hit() {
    for shape in [
        Shape::Disk { center: DVec3::ZERO, normal: DVec3::Z, radius: 1.0 },
        Shape::Cylinder { a: DVec3::ZERO, b: DVec3::Y, radius: 1.0, caps: true },
        Shape::Cylinder { a: DVec3::ZERO, b: DVec3::Z, radius: 1.0, caps: false },
        Shape::Cone { base: DVec3::ZERO, tip: DVec3::X, radius: 1.0, cap: true },
        Shape::Cone { base: DVec3::Z, tip: DVec3::ZERO, radius: 1.0, cap: false },
        Shape::Torus { center: DVec3::ZERO, axis: DVec3::Y, radius: 1.0, tube: 0.25 },
    ] {
        let geometry = geometry(&shape);
        let mut met = 0;
        for i in 0..9 * 9 * 3 {
            let place = |n: i32| (n % 9 - 4) as f32 * 0.25;
            for axis in 0..3 {
                let mut origin = Vec3::ZERO;
                (origin[(axis + 1) % 3], origin[(axis + 2) % 3]) = (place(i), place(i / 9));
                origin[axis] = [-4.0, 4.0, 0.125][(i / 81) as usize];
                let towards = -origin[axis].signum();
                let along = |zero: f32| {
                    let mut direction = Vec3::splat(zero);
                    direction[axis] = towards;
                    geometry.closest_hit(&Ray::new(origin, direction))
                };
                assert_eq!(along(0.0), along(-0.0), "{shape:?} {origin:?} {axis}");
                met += u32::from(along(0.0).is_some());
            }
        }
        assert!(met > 20, "{met} {shape:?}");
    }
}

#[test]
fn bounds_contain_every_hit() {
    let (mut random, mut met) = (TestRandom::new(61), 0);
    for i in 0..40 {
        let center = random_in(&mut random, DVec3::ZERO, 10.0_f64.powi(i % 5));
        for shape in each(&mut random, center) {
            let geometry = geometry(&shape);
            let bounds = geometry.objects()[0].bounds().expect("bounded shapes only");
            let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            for _ in 0..2000 {
                let from = (center + random.direction() * 9.0).as_vec3();
                let to = random_in(&mut random, center, 0.9);
                let ray = Ray::new(from, (to - from.as_dvec3()).as_vec3());
                let Some(hit) = geometry.closest_hit(&ray) else { continue };
                let point = geometry.surface(&ray, &hit).point;
                (low, high) = (low.min(point), high.max(point));
            }
            assert!(low.cmpge(bounds.min).all() && high.cmple(bounds.max).all(), "{shape:?}");
            met += u32::from(low.x <= high.x);
        }
    }
    assert!(met > 200, "{met} of 240 shapes were hit");
}

#[test]
fn tangents_are_texture_coordinate_derivatives() {
    // Hits of neighboring rays differ by dpdu·Δu + dpdv·Δv. u × v points outward, so textures are not
    // mirrored.
    let mut random = TestRandom::new(67);
    let mut checked = 0;
    for _ in 0..30 {
        for shape in each(&mut random, DVec3::ZERO) {
            let geometry = geometry(&shape);
            for _ in 0..100 {
                let from = random.direction() * 4.0;
                let to = random_in(&mut random, DVec3::ZERO, 0.8);
                let seen = |to: DVec3| {
                    let ray = Ray::new(from.as_vec3(), (to - from).as_vec3());
                    geometry.closest_hit(&ray).map(|hit| (hit.shape.primitive, geometry.surface(&ray, &hit)))
                };
                let Some((part, here)) = seen(to) else { continue };
                assert!(here.uv.min_element() >= 0.0 && here.uv.max_element() <= 1.0);
                assert!(here.dpdu.cross(here.dpdv).dot(here.normal) > 0.0, "{shape:?} {here:?}");
                for _ in 0..2 {
                    let Some((other, there)) = seen(to + random.direction() * 2e-3) else { continue };
                    let (moved, turned) = (there.point - here.point, (there.uv - here.uv).as_vec2());
                    if other != part || turned.abs().max_element() > 0.3 || moved.length() > 0.02 {
                        continue;
                    }
                    let predicted = here.dpdu * turned.x + here.dpdv * turned.y;
                    // A rotation by Δu deviates quadratically from the tangent.
                    let bend = here.dpdu.length() * turned.x * turned.x * 7.0
                        + here.dpdv.length() * turned.y * turned.y * 7.0
                        + (turned.x * turned.y).abs() * 50.0;
                    assert!((predicted - moved).length() < bend + 2e-6, "{shape:?} {here:?} {there:?}");
                    checked += 1;
                }
            }
        }
    }
    assert!(checked > 5000, "{checked}");
}

#[test]
fn distant_hits_keep_accurate_normals() {
    // A hit's t is rounded to 2⁻²⁴ of the distance, here 60 times the radius, but the surface point is not.
    let thin = Shape::Cylinder { a: v(0.0, -9.0, 0.0), b: v(0.0, 9.0, 0.0), radius: 1e-3, caps: true };
    let ring = Shape::Torus { center: DVec3::ZERO, axis: DVec3::Y, radius: 1.0, tube: 1e-3 };
    for (shape, across) in [(thin, 0.0), (ring, 1.0 - 1e-3)] {
        let geometry = geometry(&shape);
        let ray = Ray::new(Vec3::new(across as f32 + 5e-4, 0.0, 1e6), Vec3::new(0.0, 0.0, -1.0));
        let hit = geometry.closest_hit(&ray).expect("aimed at it");
        let normal = geometry.surface(&ray, &hit).normal;
        assert!(normal.dot(ray.direction) < 0.0 && normal.y.abs() < 1e-3, "{shape:?} {normal}");
        assert!((normal.length() - 1.0).abs() < 1e-6);
    }
}
