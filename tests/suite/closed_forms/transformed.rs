//! Shapes with a `matrix`: compared with the shapes and meshes they equal, with closed forms, and in
//! furnaces.

use glimt::assets::LoadedMesh;
use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use glimt::math::random::TestRandom;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::{AffineMap, EmissionSides, Integrator, Material, ObjectTransform, Shape};

use super::direct::{assert_irradiance, at_origin};
use super::round_lights::assert_same;
use super::scenes::{
    Build, IDENTITY_PLACEMENT, emitter, glass, lat_long_sphere, matte, phong, scene, tinted,
};
use super::touching::{assert_white, block};
use super::{assert_close, lambert, mean_and_error, v};

const UNIT: Shape = Shape::Sphere { center: DVec3::ZERO, radius: 1.0 };

/// The affine map that sends the unit vectors of the axes to `x`, `y` and `z`, and then translates.
fn map(x: DVec3, y: DVec3, z: DVec3, translate: DVec3) -> AffineMap {
    AffineMap { linear: [x, y, z], translate }
}

/// Scales, shears and rotates. `mirror` is 1, or −1 to mirror as well.
fn shear(mirror: f64, translate: DVec3) -> AffineMap {
    map(v(0.9, 0.2, -0.3), v(0.4, 0.7, 0.1), v(-0.2, 0.1, 0.6) * mirror, translate)
}

/// One shape of each kind with a finite area, at the origin.
fn shapes() -> Vec<Shape> {
    let (zero, axis) = (DVec3::ZERO, v(0.3, 1.0, -0.2));
    vec![
        UNIT,
        Shape::Quad { corner: v(-0.7, 0.1, -0.6), u: v(1.4, 0.2, 0.0), v: v(0.1, 0.3, 1.2) },
        Shape::Box { center: zero, size: v(1.0, 1.5, 0.7), rotate: v(20.0, 50.0, 10.0) },
        Shape::Triangle { a: v(-0.8, 0.0, -0.6), b: v(0.9, 0.1, -0.4), c: v(0.0, 0.4, 0.9) },
        Shape::Disk { center: zero, normal: axis, radius: 0.8 },
        Shape::Cylinder { a: -axis, b: axis * 0.6, radius: 0.5, caps: true },
        Shape::Cylinder { a: -axis, b: axis * 0.6, radius: 0.5, caps: false },
        Shape::Cone { base: -axis * 0.5, tip: axis * 0.8, radius: 0.7, cap: true },
        Shape::Cone { base: axis * 0.8, tip: -axis * 0.5, radius: 0.7, cap: false },
        Shape::Torus { center: zero, axis, radius: 0.7, tube: 0.25 },
    ]
}

fn is_closed(shape: &Shape) -> bool {
    let is_flat = matches!(shape, Shape::Quad { .. } | Shape::Triangle { .. });
    !is_flat && shape.untransformed_open_surface().is_none()
}

/// The scene with a mesh under a map.
fn mesh_under(build: Build, mesh: TriangleMesh, matrix: AffineMap, material: Material) -> Build {
    let loaded = LoadedMesh { mesh, ..LoadedMesh::default() };
    build.loaded(loaded, IDENTITY_PLACEMENT, material).with(|scene| {
        if let Some(Shape::Mesh(mesh)) = scene.objects.last_mut().map(|object| &mut object.shape) {
            mesh.placed = ObjectTransform::Matrix(matrix);
        }
    })
}

/// A cone along y with its base at −0.5 and its tip at 1, as a mesh.
fn cone_mesh() -> TriangleMesh {
    const STEPS: u32 = 2048;
    let rim = |i: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(STEPS)).sin_cos();
        v(0.8 * cos, -0.5, 0.8 * sin).as_vec3()
    };
    let mut mesh = TriangleMesh { positions: vec![Vec3::Y, Vec3::NEG_Y * 0.5], ..TriangleMesh::default() };
    mesh.positions.extend((0..STEPS).map(rim));
    for i in 0..STEPS {
        let (from, to) = (2 + i, 2 + (i + 1) % STEPS);
        mesh.triangles.extend([[0, to, from], [1, from, to]]);
    }
    mesh
}

/// Shapes, their matrices, and equal meshes.
fn shapes_and_meshes() -> [(&'static str, Shape, TriangleMesh, AffineMap); 3] {
    let cube = Shape::Box { center: DVec3::ZERO, size: DVec3::ONE * 1.2, rotate: DVec3::ZERO };
    let cone = Shape::Cone { base: DVec3::Y * -0.5, tip: DVec3::Y, radius: 0.8, cap: true };
    let (low, high) = (DVec3::ONE * -0.6, DVec3::ONE * 0.6);
    [
        ("ellipsoid", UNIT, lat_long_sphere(256, 512, 1.0, DVec3::ZERO), shear(1.0, v(0.1, 0.2, 0.0))),
        ("sheared box", cube, block(low, high), shear(1.0, v(0.0, 0.2, 0.1))),
        ("mirrored cone", cone, cone_mesh(), shear(-1.0, v(0.1, 0.1, 0.2))),
    ]
}

/// Checks that two scenes have the same mean over the image, within five standard errors of at most `noise`,
/// and a share of the difference due to the facets.
#[track_caller]
fn assert_same_image_mean(what: &str, scenes: [Build; 2], noise: f64) {
    let [(a, error_a), (b, error_b)] = scenes.map(|build| {
        mean_and_error(&build.pictured(v(1.5, 2.0, 4.0), DVec3::ZERO, 30.0, 24, 18).mean_reds(1))
    });
    let error = error_a.hypot(error_b);
    assert!(error < noise * a, "{what}: too noisy: {a} ± {error}");
    assert!((a - b).abs() < 5.0 * error + 2e-4 * a, "{what}: {a} and {b} ± {error}");
}

#[test]
fn transformed_shapes_equal_their_meshes() {
    for (what, shape, mesh, matrix) in shapes_and_meshes() {
        let floor = || {
            let room = scene().quad(v(-4.0, -1.2, 4.0), v(8.0, 0.0, 0.0), v(0.0, 0.0, -8.0), matte(0.6));
            room.depth(12).with(|scene| scene.render.integrator = Integrator::Path)
        };
        let both = |build: Build, own: Material| {
            let shape = build.clone().shape(shape.clone().transformed(matrix), own.clone());
            [shape, mesh_under(build, mesh.clone(), matrix, own)]
        };
        let lit = || floor().quad(v(-1.0, 4.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), emitter(8.0));
        assert_same_image_mean(&format!("{what} as a surface"), both(lit(), matte(0.5)), 0.02);
        assert_same_image_mean(&format!("{what} as a light"), both(floor(), emitter(1.0)), 0.02);
        let photons = |build: Build| {
            let whitted = build.with(|scene| scene.render.integrator = Integrator::Whitted);
            whitted.photons(5_000, 0.05)
        };
        assert_same_image_mean(&format!("{what} with photons"), both(lit(), matte(0.5)).map(photons), 0.02);
        let light = both(floor(), emitter(1.0)).map(photons);
        assert_same_image_mean(&format!("{what} emitting photons"), light, 0.02);
        let own = tinted(1.5, v(0.3, 0.3, 0.3));
        assert_same_image_mean(&format!("{what} as glass"), both(floor().environment(1.0), own), 0.02);
    }
}

#[test]
fn lights_have_the_same_irradiance_as_by_rays() {
    for shape in shapes() {
        for mirror in [1.0, -1.0] {
            assert_same(&shape.clone().transformed(shear(mirror, v(0.4, 1.8, -0.3))));
        }
    }
}

#[test]
fn elliptic_disk_light_matches_a_polygon() {
    // A unit disk, facing down, becomes an ellipse with semi-axes 1.5 and 0.5. The polygon has 4096 corners.
    let disk = Shape::Disk { center: DVec3::ZERO, normal: DVec3::NEG_Y, radius: 1.0 };
    for mirror in [1.0, -1.0] {
        let (x, z) = (v(1.2, 0.0, 0.9), v(-0.3, 0.0, 0.4));
        let matrix = map(x * mirror, v(0.3, 1.0, 0.2), z, v(0.4, 1.3, -0.2));
        let polygon: Vec<DVec3> = (0..4096)
            .map(|i| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 4096.0).sin_cos();
                matrix.translate + x * cos + z * sin
            })
            .collect();
        let lit = at_origin().shape(disk.clone().transformed(matrix), emitter(1.0));
        assert_irradiance("ellipse", &lit, lambert(DVec3::ZERO, DVec3::Y, &polygon), 1e-4);
    }
}

#[test]
fn transformed_shapes_are_white_in_a_furnace() {
    for shape in shapes() {
        for mirror in [1.0, -1.0] {
            let own = shape.clone().transformed(shear(mirror, v(0.1, 0.0, -0.1)));
            if is_closed(&shape) {
                assert_white(&format!("{own:?}"), scene().shape(own.clone(), glass(1.5)));
                let nested = Shape::Sphere { center: DVec3::ZERO, radius: 1.0 };
                let nested = nested.transformed(shear(-mirror, v(0.5, 0.3, 0.0)));
                let build = scene().shape(own.clone(), glass(1.5)).shape(nested, glass(2.0));
                assert_white(&format!("{own:?}, nested"), build);
            }
            // Emission and reflection sum to 1.
            let mut gray = phong(0.6, 0.0, 1.0, 0.4);
            gray.emission.sides = EmissionSides::Both;
            let furnace = scene()
                .shape(own.clone(), gray)
                .environment(1.0)
                .depth(64)
                .with(|scene| scene.render.integrator = Integrator::Path)
                .pictured(v(1.2, 2.0, 3.0), DVec3::ZERO, 25.0, 6, 6);
            let (mean, error) = mean_and_error(&furnace.mean_reds(32));
            assert!(error < 6e-4, "{own:?}: {mean} ± {error}");
            assert!((mean - 1.0).abs() < 4.0 * error + 1e-5, "{own:?}: {mean} ± {error}");
        }
    }
}

#[test]
fn rays_from_inside_are_tinted_up_to_the_surface() {
    let convex = |shape: &Shape| is_closed(shape) && !matches!(shape, Shape::Torus { .. });
    for shape in shapes().into_iter().filter(convex) {
        for mirror in [1.0, -1.0] {
            let matrix = shear(mirror, v(0.1, 0.0, -0.1));
            let build = scene().shape(shape.clone().transformed(matrix), tinted(1.0, DVec3::splat(0.3)));
            let mut random = TestRandom::new(3);
            for _ in 0..20 {
                let (from, direction) = (matrix.translate, random.direction());
                let seen = build.clone().background(1.0).seen(from, from + direction);
                let ray = Ray::new(Vec3::ZERO, direction.as_vec3());
                let world = seen.world();
                let local = Ray { origin: (from - world.geometry.coordinate_origin()).as_vec3(), ..ray };
                let hit = world.geometry.closest_hit(&local).expect("the camera is inside");
                assert_close(&format!("{shape:?}"), seen.value(), 0.3_f64.powf(f64::from(hit.shape.t)));
            }
        }
    }
}

#[test]
fn translation_and_uniform_scale_need_no_matrix() {
    let (scale, translate) = (2.0, v(1.0, -2.0, 0.5));
    let axes = DVec3::AXES.map(|axis| axis * scale);
    let matrix = AffineMap { linear: axes, translate };
    for shape in shapes() {
        let kind = shape.kind();
        let scaled = shape.clone().transformed(matrix);
        assert!(!matches!(scaled, Shape::Transformed { .. }), "{kind}");
        let same = shape.clone().transformed(AffineMap { linear: DVec3::AXES, translate: DVec3::ZERO });
        assert_eq!(same, shape);
        // The matrix that is kept gives the same image.
        let kept = Shape::Transformed { shape: Box::new(shape.clone()), matrix };
        let picture = |shape: Shape| {
            let build = scene().shape(shape, phong(0.5, 0.2, 20.0, 0.1)).environment(1.0);
            let seen = build.pictured(translate + v(3.0, 4.0, 6.0), translate, 35.0, 16, 16);
            seen.picture(64, 0)
        };
        let (a, b) = (picture(scaled), picture(kept));
        let off = a.iter().zip(&b).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f64::max);
        assert!(off < 0.03, "{kind}: {off}");
        let mean = |picture: &[DVec3]| picture.iter().map(|pixel| pixel.x).sum::<f64>() / 256.0;
        assert!((mean(&a) / mean(&b) - 1.0).abs() < 1e-3, "{kind}: {} {}", mean(&a), mean(&b));
    }
}

#[test]
fn transformed_planes_keep_their_uvs() {
    let plane = Shape::Plane { point: v(0.0, 1.0, 0.0), normal: DVec3::Y };
    for mirror in [1.0, -1.0] {
        let matrix = map(v(2.0, 0.3, 0.0), v(0.2, 0.5, 0.0), v(0.0, 0.4, 3.0) * mirror, v(0.0, 1.0, 0.0));
        let transformed = matrix.to_transform();
        let geometry = scene().shape(plane.clone().transformed(matrix), matte(0.5)).world().geometry;
        for (x, z) in [(0.25, 0.5), (-3.5, 1.25), (100.75, -60.5)] {
            let at = transformed.point(v(x, 1.0, -z));
            let out = transformed.normal(DVec3::Y).normalize();
            let ray = Ray::new((at + out * 2.0).as_vec3(), -out.as_vec3());
            let hit = geometry.closest_hit(&ray).expect("the plane");
            let surface = geometry.surface(&ray, &hit);
            assert!((surface.normal.as_dvec3() - out).length() < 1e-6, "the front stays the front");
            assert!((surface.uv - glimt::math::DVec2::new(x, z)).length() < 1e-4, "{surface:?}");
        }
    }
}
