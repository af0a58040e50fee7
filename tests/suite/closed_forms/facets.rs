//! Light on smooth meshes: no light leaks into closed meshes, and convex meshes are fully lit.

use std::f64::consts::PI;

use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use glimt::math::random::TestRandom;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{Bump, NormalMap, ShadowMode, TextureFilter, Wrap};

use super::scenes::{Build, IDENTITY_PLACEMENT, emitter, lat_long_sphere, matte, scene};
use super::v;

/// Number of lit pixels in an image, and the largest pixel value.
fn lit_pixels_and_maximum(build: &Build) -> (usize, f64) {
    let picture = build.picture(1, 0);
    let most = picture.iter().map(|color| color.max_element()).fold(0.0, f64::max);
    (picture.iter().filter(|color| color.max_element() > 0.0).count(), most)
}

/// A box between two corners, with eight vertices and twelve outward-facing triangles.
fn cube(least: DVec3, greatest: DVec3) -> TriangleMesh {
    let corner = |i: usize| {
        let pick = |axis: usize| if i & (1 << axis) == 0 { least[axis] } else { greatest[axis] };
        v(pick(0), pick(1), pick(2)).as_vec3()
    };
    let squares = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = squares.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleMesh { positions: (0..8).map(corner).collect(), triangles, ..TriangleMesh::default() }
}

#[test]
fn smooth_cube_lit_from_outside_is_dark_inside() {
    for light in [v(3.0, 4.0, 2.0), v(-2.0, 0.1, 0.3), v(0.3, 1.2, -5.0)] {
        let build = scene()
            .mesh(cube(DVec3::splat(-1.0), DVec3::ONE), IDENTITY_PLACEMENT, matte(0.8))
            .smooth()
            .point_light(light, 100.0, Falloff::Square)
            .pictured(v(0.3, 0.2, 0.9), v(-0.4, -0.3, -1.0), 90.0, 64, 64);
        assert_eq!(
            lit_pixels_and_maximum(&build).0,
            0,
            "light at {light}, brightest pixel {}",
            lit_pixels_and_maximum(&build).1
        );
    }
}

#[test]
fn smooth_ball_in_a_tight_shell_is_dark() {
    // The camera is in the gap between a facet of the ball and the shell. The light is outside.
    for gap in [0.02, 0.002] {
        let ball = lat_long_sphere(7, 12, 1.0, DVec3::ZERO);
        let out = v((PI / 12.0).cos(), 0.0, (PI / 12.0).sin());
        let build = scene()
            .mesh(ball, IDENTITY_PLACEMENT, matte(0.8))
            .smooth()
            .sphere(DVec3::ZERO, 1.0 + gap, matte(0.8))
            .point_light(v(2.0, 3.0, 1.5), 100.0, Falloff::Square)
            .pictured(out * (1.0 + 0.9 * gap), out * 0.5 + v(0.0, 0.2, 0.0), 120.0, 64, 64);
        assert_eq!(
            lit_pixels_and_maximum(&build).0,
            0,
            "gap {gap}, brightest pixel {}",
            lit_pixels_and_maximum(&build).1
        );
    }
}

/// A smooth ball of 200 triangles with vertex normals.
#[test]
fn coarse_smooth_ball_is_shaded_like_a_sphere() {
    let mut ball = lat_long_sphere(6, 20, 1.0, DVec3::ZERO);
    assert_eq!(ball.triangles.len(), 200);
    ball.normals = ball.positions.iter().map(|p| p.normalize()).collect();
    for to_light in [DVec3::X, v(0.2, 0.9, -0.5)] {
        let to_light = to_light.normalize();
        let normals: Vec<DVec3> = (0..3000)
            .map(|place| {
                let (azimuth, height) = (f64::from(place) * 2.399_963, f64::from(place) / 1500.0 - 0.999_5);
                let ring = (1.0 - height * height).sqrt();
                v(ring * azimuth.cos(), height, ring * azimuth.sin())
            })
            .filter(|normal| normal.dot(to_light) >= 0.2)
            .collect();
        assert!(normals.len() > 1000);
        let from: Vec<DVec3> = normals.iter().map(|normal| normal * 3.0).collect();
        let build = scene().mesh(ball.clone(), IDENTITY_PLACEMENT, matte(1.0)).smooth();
        let lit = build.point_light(to_light * 1e4, 1.0, Falloff::None);
        for (normal, value) in normals.iter().zip(lit.values_from(&from)) {
            let cosine = normal.dot(to_light);
            let ratio = value * PI / cosine;
            assert!((0.9..1.1).contains(&ratio), "{to_light} {normal}, cosine {cosine}: {ratio}");
        }
    }
}

/// A closed surface around the center, with random radii from `1 − rough` to `1 + rough`.
fn blob(random: &mut TestRandom, rough: f64) -> TriangleMesh {
    let (rings, steps) = (3 + (random.unit() * 6.0) as u32, 3 + (random.unit() * 8.0) as u32);
    let mut mesh = match (random.unit() * 5.0) as u32 {
        0 => cube(DVec3::splat(-0.7), DVec3::splat(0.7)),
        1 => lat_long_sphere(2, 4, 1.0, DVec3::ZERO),
        _ => lat_long_sphere(rings, steps, 1.0, DVec3::ZERO),
    };
    for position in &mut mesh.positions {
        *position *= (1.0 + rough * random.signed()) as f32;
    }
    mesh
}

/// The mesh scaled by `size`, with its facets optionally reversed.
fn layer(mesh: &TriangleMesh, size: f64, turned: bool) -> TriangleMesh {
    let mut layer = mesh.clone();
    layer.positions.iter_mut().for_each(|p| *p *= size as f32);
    if turned {
        layer.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    layer
}

fn merged(mut mesh: TriangleMesh, other: &TriangleMesh) -> TriangleMesh {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(&other.positions);
    mesh.triangles.extend(other.triangles.iter().map(|triangle| triangle.map(|corner| corner + first)));
    mesh
}

/// Distance from the center to the nearest surface in the given direction.
fn radius_of(mesh: &TriangleMesh, direction: DVec3) -> f64 {
    let world = scene().mesh(mesh.clone(), IDENTITY_PLACEMENT, matte(0.5)).world();
    let hit = world.geometry.closest_hit(&Ray::new(Vec3::ZERO, direction.as_vec3()));
    f64::from(hit.expect("the mesh must surround the center").shape.t)
}

/// Case `number`: a closed opaque mesh with a camera inside and lights outside.
fn closed(number: u32, random: &mut TestRandom) -> Build {
    let rough = [0.0, 0.2, 0.6][number as usize % 3];
    let mesh = blob(random, rough);
    let towards = random.direction();
    let gap = 10.0_f64.powf(-1.0 - 3.0 * random.unit());
    // A single wall, a double-walled shell, or a camera between two walls.
    let (walls, eye) = match number % 5 {
        0 => (vec![mesh], towards * 0.1 * random.unit()),
        1 => (
            vec![merged(layer(&mesh, 1.0 + gap, false), &layer(&mesh, 1.0, true))],
            towards * 0.1 * random.unit(),
        ),
        2 => (vec![layer(&mesh, 1.0, random.unit() < 0.5)], towards * 0.3 * radius_of(&mesh, towards)),
        _ => {
            let at = radius_of(&mesh, towards) * (1.0 + gap * (0.1 + 0.8 * random.unit()));
            (vec![layer(&mesh, 1.0 + gap, random.unit() < 0.5), mesh], towards * at)
        }
    };
    let mut build = scene();
    let is_smooth = number % 8 != 7;
    let bumps = (number % 4 == 3).then(|| {
        let normals: Vec<Vec3> = (0..16)
            .map(|_| (v(random.signed(), random.signed(), random.unit()) * 0.5 + 0.5).as_vec3())
            .collect();
        let rows: Vec<&[Vec3]> = normals.chunks(4).collect();
        build.texture(&rows, TextureFilter::Bilinear, Wrap::Repeat, Vec2::splat(2.0))
    });
    let placed = match number % 7 {
        0 => [v(1.0, 1.3, 0.8), v(10.0, 70.0, -20.0), v(3.0, -2.0, 5.0)],
        1 => [v(-1.0, 1.0, 1.0), DVec3::ZERO, v(0.0, 0.3, 0.0)],
        _ => IDENTITY_PLACEMENT,
    };
    let transform =
        glimt::math::transform::Transform::scale_rotate_translate(placed[0], placed[1], placed[2]);
    for mut wall in walls {
        if number % 6 == 5 {
            let any = |p: &Vec3| (p.normalize() + random.direction().as_vec3() * 0.7).normalize();
            wall.normals = wall.positions.iter().map(any).collect();
        }
        let mut material = matte(0.8);
        // Any texture value is a valid normal or height.
        let as_heights = bumps.filter(|_| number % 8 == 3);
        material.bump = as_heights.map(|texture| Bump { texture, channel: None, scale: 0.3 });
        material.normal_map = bumps.map(|texture| NormalMap { texture, strength: 2.0 });
        build = build.mesh(wall, placed, material);
        if is_smooth {
            build = build.smooth();
        }
    }
    let outside = |direction: DVec3| transform.point(direction * 4.0);
    for _ in 0..3 {
        build = build.point_light(outside(random.direction()), 50.0, Falloff::Square);
    }
    let lamp = outside(random.direction());
    build = match number % 2 {
        0 => build.sphere(lamp, 0.5, emitter(20.0)),
        _ => build.cuboid(lamp, v(0.4, 0.6, 0.5), v(10.0, 20.0, 30.0), emitter(20.0)),
    };
    let at = transform.point(eye);
    build.shadows(ShadowMode::Soft, 2).depth(1).pictured(at, at + random.direction(), 110.0, 12, 12)
}

/// Checks that no pixel is lit inside any of a thousand closed opaque meshes with point and area lights
/// outside. The meshes are smooth or flat, round or rough, and single- or double-walled. Some have perturbed
/// normals.
#[test]
fn no_light_enters_a_closed_opaque_mesh() {
    let mut random = TestRandom::new(77);
    let mut leaky = Vec::new();
    for number in 0..1000 {
        let build = closed(number, &mut random);
        let (count, most) = lit_pixels_and_maximum(&build);
        if count > 0 {
            leaky.push((number, count, most));
        }
    }
    let pixels: usize = leaky.iter().map(|(_, count, _)| count).sum();
    assert!(
        leaky.is_empty(),
        "{pixels} pixels in {} meshes, first {:?}",
        leaky.len(),
        &leaky[..leaky.len().min(8)]
    );
}
