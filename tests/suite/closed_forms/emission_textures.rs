//! Area lights with an emission texture.

use std::f64::consts::{PI, TAU};

use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use glimt::lights::LightSamplingPurpose;
use glimt::materials::TexturePoint;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::{EmissionSource, Integrator, Material, Shape, TextureFilter, Wrap};

use super::direct::{assert_hard, assert_irradiance, at_origin};
use super::scenes::{Build, IDENTITY_PLACEMENT, emitter, phong};
use super::{assert_close, lambert, mean_and_error, v};

/// Adds a gray texture from its values, top row first.
fn grays(build: &mut Build, rows: &[&[f32]], filter: TextureFilter, repeat: Vec2) -> usize {
    let rows: Vec<Vec<Vec3>> = rows.iter().map(|row| row.iter().map(|x| Vec3::splat(*x)).collect()).collect();
    let rows: Vec<&[Vec3]> = rows.iter().map(Vec::as_slice).collect();
    build.texture(&rows, filter, Wrap::Repeat, repeat)
}

fn textured_emitter(texture: usize, scale: f32) -> Material {
    let emission =
        EmissionSource { texture: Some(texture), ..EmissionSource::from_constant(Vec3::splat(scale)) };
    Material { emission, ..phong(0.0, 0.0, 1.0, 0.0) }
}

fn path_traced(build: &Build) -> Build {
    build.clone().with(|scene| scene.render.integrator = Integrator::Path)
}

const CHECKER: [&[f32]; 2] = [&[5.0, 0.0], &[1.0, 3.0]];

/// Corner of the light above the origin; u × v points down.
const CORNER: DVec3 = v(-0.7, 1.0, -0.4);
const U: DVec3 = v(1.5, 0.2, 0.0);
const V: DVec3 = v(0.0, 0.1, 1.2);

/// Irradiance E from the checkered light, using Lambert's formula for each square.
fn lambert_irradiance(scale: f64) -> f64 {
    let mut irradiance = 0.0;
    for (row, values) in CHECKER.iter().enumerate() {
        for (column, value) in values.iter().enumerate() {
            // Rows start at the top, v at the bottom.
            let at = CORNER + U * (0.5 * column as f64) + V * (0.5 - 0.5 * row as f64);
            let (s, t) = (U * 0.5, V * 0.5);
            let form = lambert(DVec3::ZERO, DVec3::Y, &[at, at + s, at + s + t, at + t]);
            irradiance += scale * f64::from(*value) * form;
        }
    }
    irradiance
}

#[test]
fn checkered_quad_light_matches_its_squares() {
    let mut lit = at_origin();
    let texture = grays(&mut lit, &CHECKER, TextureFilter::Nearest, Vec2::ONE);
    let mut lit = lit.quad(CORNER, U, V, textured_emitter(texture, 2.0));
    assert_irradiance("whitted", &lit, lambert_irradiance(2.0), 5e-4);
    assert_irradiance("path", &path_traced(&lit), lambert_irradiance(2.0), 5e-4);
    assert_hard("hard shadows", &lit, lambert_irradiance(2.0), 1e-3);
    // A mirrored texture must change the result.
    lit.image_mut(0).repeat = Vec2::new(-1.0, 1.0);
    let turned = lit.values(256, 64);
    let (mean, error) = mean_and_error(&turned);
    assert!((mean - 0.7 * lambert_irradiance(2.0) / PI).abs() > 20.0 * error, "{mean} ± {error}");
}

#[test]
fn checkered_mesh_light_matches_its_squares() {
    for (mirror, order) in [(1.0, [0, 1, 2, 3]), (-1.0, [0, 3, 2, 1])] {
        let corners = [CORNER, CORNER + U, CORNER + U + V, CORNER + V];
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let mesh = TriangleMesh {
            positions: order.map(|i| (corners[i] * v(mirror, 1.0, 1.0)).as_vec3()).to_vec(),
            uvs: order.map(|i| uvs[i]).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..TriangleMesh::default()
        };
        let mut lit = at_origin();
        let texture = grays(&mut lit, &CHECKER, TextureFilter::Nearest, Vec2::ONE);
        let placed = [v(mirror, 1.0, 1.0), IDENTITY_PLACEMENT[1], IDENTITY_PLACEMENT[2]];
        let lit = lit.mesh(mesh, placed, textured_emitter(texture, 1.0));
        assert_irradiance("whitted", &lit, lambert_irradiance(1.0), 5e-5);
        assert_irradiance("path", &path_traced(&lit), lambert_irradiance(1.0), 4e-4);
    }
}

/// Irradiance E at the origin, facing up, integrated over a cosine-weighted hemisphere.
fn hemisphere_irradiance(build: &Build) -> f64 {
    const RINGS: u32 = 1500;
    let world = build.world();
    let mut sum = 0.0;
    for i in 0..RINGS {
        for j in 0..RINGS {
            let sin2 = (f64::from(i) + 0.5) / f64::from(RINGS);
            let turn = (f64::from(j) + 0.5) / f64::from(RINGS) + 0.618_033_988_75 * f64::from(i);
            let (sin, phi) = (sin2.sqrt(), TAU * turn.fract());
            let ray =
                Ray::new(Vec3::Y * 1e-4, v(sin * phi.cos(), (1.0 - sin2).sqrt(), sin * phi.sin()).as_vec3());
            let Some(hit) = world.geometry.closest_hit(&ray) else { continue };
            let surface = world.geometry.surface(&ray, &hit);
            if surface.normal.dot(ray.direction) < 0.0 {
                let emission = &world.materials[world.material_index(&hit)].emission;
                sum +=
                    f64::from(emission.radiance_at_cosine(&TexturePoint::from_uv(surface.uv), 1.0, &mut 0).x);
            }
        }
    }
    PI * sum / f64::from(RINGS * RINGS)
}

#[test]
fn every_shape_maps_its_emission_texture() {
    let (p, q) = (v(0.4, 1.1, 0.3), v(-0.3, 0.7, -0.2));
    let shapes = [
        ("sphere", Shape::Sphere { center: p, radius: 0.5 }),
        ("quad", Shape::Quad { corner: CORNER, u: v(1.5, 0.0, 0.0), v: v(0.0, 0.0, 1.2) }),
        ("box", Shape::Box { center: p, size: v(0.5, 0.4, 0.8), rotate: v(20.0, 30.0, 40.0) }),
        ("triangle", Shape::Triangle { a: v(-1.0, 1.0, -0.5), b: v(1.0, 1.2, 0.0), c: v(-0.2, 0.8, 1.0) }),
        ("disk", Shape::Disk { center: p, normal: v(0.1, -1.0, -0.2), radius: 0.6 }),
        ("cylinder", Shape::Cylinder { a: p, b: q, radius: 0.3, caps: true }),
        ("cone", Shape::Cone { base: p, tip: q, radius: 0.4, cap: true }),
        ("torus", Shape::Torus { center: p, axis: v(0.5, 1.0, 0.2), radius: 0.5, tube: 0.2 }),
    ];
    for (name, shape) in shapes {
        let mut lit = at_origin();
        let rows: [&[f32]; 3] = [&[4.0, 0.0, 1.0], &[0.0, 2.0, 0.5], &[3.0, 0.2, 0.0]];
        let texture = grays(&mut lit, &rows, TextureFilter::Bilinear, Vec2::new(2.0, 3.0));
        let lit = lit.shape(shape, textured_emitter(texture, 1.0));
        let exact = 0.7 * hemisphere_irradiance(&lit) / PI;
        assert!(exact > 0.01, "{name} too dim");
        for (how, lit) in [("whitted", lit.clone()), ("path", path_traced(&lit))] {
            let (mean, error) = mean_and_error(&lit.values(256, 32));
            assert!(error < 3e-3 * exact, "{name}, {how}: too noisy: ± {error} of {exact}");
            let allowed = 4.9 * error + 1e-3 * exact;
            assert!((mean - exact).abs() < allowed, "{name}, {how}: {mean} ± {error}, expected {exact}");
        }
    }
}

#[test]
fn constant_emission_texture_matches_color() {
    let plain = at_origin().quad(CORNER, U, V, emitter(3.0));
    for filter in [TextureFilter::Nearest, TextureFilter::Bilinear, TextureFilter::Mipmap] {
        let mut lit = at_origin();
        let texture = grays(&mut lit, &[&[0.75, 0.75, 0.75][..]; 3], filter, Vec2::new(7.0, 0.3));
        let lit = lit.quad(CORNER, U, V, textured_emitter(texture, 4.0));
        for (lit, plain) in [(lit.clone(), plain.clone()), (path_traced(&lit), path_traced(&plain))] {
            for (value, exact) in lit.values(16, 8).into_iter().zip(plain.values(16, 8)) {
                assert_close("same as the color", value, exact);
            }
            // The camera sees the same radiance.
            let seen = |build: Build| build.seen(v(0.1, 0.0, 0.1), CORNER + U * 0.5 + V * 0.5).value();
            assert_eq!((seen(lit), seen(plain)), (3.0, 3.0));
        }
    }
}

#[test]
fn black_emission_texture_emits_nothing() {
    let mut lit = at_origin();
    let texture = grays(&mut lit, &[&[0.0]], TextureFilter::Nearest, Vec2::ONE);
    assert!(lit.quad(CORNER, U, V, textured_emitter(texture, 4.0)).world().lights.is_empty());
}

#[test]
fn light_power_follows_mean_of_texture() {
    let strength = |build: &Build| {
        let world = build.world();
        let bounds = world.lights.iter().filter_map(|(_, light)| light.bounds_if_emissive());
        bounds.map(|bounds| bounds.power).sum::<f64>()
    };
    let mut patterned = at_origin();
    let texture = grays(&mut patterned, &CHECKER, TextureFilter::Nearest, Vec2::ONE);
    let patterned = patterned.quad(CORNER, U, V, textured_emitter(texture, 2.0));
    let plain = at_origin().quad(CORNER, U, V, emitter(2.0 * 2.25));
    assert_close("power", strength(&patterned), strength(&plain));
}

/// Uses so many lights that each vertex samples only some of them.
#[test]
fn sampled_lights_keep_their_textures() {
    let mut build = at_origin();
    let texture = grays(&mut build, &CHECKER, TextureFilter::Nearest, Vec2::ONE);
    let cells = 7_u32;
    let mut expected = 0.0;
    for cell in 0..cells * cells {
        let (x, z) = (f64::from(cell % cells) - 3.0, f64::from(cell / cells) - 3.0);
        let (corner, u, w) = (v(x - 0.2, 2.0, z - 0.2), v(0.4, 0.0, 0.0), v(0.0, 0.0, 0.4));
        build = build.quad(corner, u, w, textured_emitter(texture, 1.0));
        for (row, values) in CHECKER.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                let at = corner + u * (0.5 * column as f64) + w * (0.5 - 0.5 * row as f64);
                let (s, t) = (u * 0.5, w * 0.5);
                let form = lambert(DVec3::ZERO, DVec3::Y, &[at, at + s, at + s + t, at + t]);
                expected += f64::from(*value) * form;
            }
        }
    }
    assert!(build.world().lights.sampler_for_purpose(LightSamplingPurpose::Eye).is_some());
    for (name, build) in [("whitted", build.clone()), ("path", path_traced(&build))] {
        assert_irradiance(name, &build, expected, 1e-3);
    }
}
