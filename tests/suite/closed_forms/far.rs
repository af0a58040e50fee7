//! Scenes look the same far from the origin and near it.

use std::path::Path;

use glimt::assets::mesh::load;
use glimt::control::{CancelToken, ignore_progress};
use glimt::geometry::mesh::TriangleMesh;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    Accel, ColorSource, MaterialKind, PhongParameters, ShadowMode, Shape, TextureFilter, Wrap,
};

use super::scenes::{
    Build, IDENTITY_PLACEMENT, emitter, glass, lat_long_sphere, matte, mirror, phong, scene,
};
use super::v;

/// √(Σ(a − b)²/Σb²) over all pixels and channels.
fn difference(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    let off: f64 = a.iter().zip(b).map(|(a, b)| (*a - *b).length_squared()).sum();
    (off / b.iter().map(|b| b.length_squared()).sum::<f64>()).sqrt()
}

/// A scene of size 8, moved to `at`. It contains a mesh, a point light, and every shape, some of them
/// emissive. All coordinates are multiples of 1/1024, so that sums are exact.
fn all_objects_at(at: DVec3, accel: Accel) -> Build {
    let p = |x: f64, y: f64, z: f64| at + (v(x, y, z) * 1024.0).round() / 1024.0;
    let d = |x: f64, y: f64, z: f64| (v(x, y, z) * 1024.0).round() / 1024.0;
    let shiny = phong(0.5, 0.3, 20.0, 0.0);
    let mut build = scene().accel(accel);
    let bricks = build.texture(
        &[&[Vec3::splat(0.9), Vec3::splat(0.2)], &[Vec3::splat(0.4), Vec3::splat(0.7)]],
        TextureFilter::Bilinear,
        Wrap::Repeat,
        Vec2::ONE,
    );
    let mut tiles = matte(0.5);
    if let MaterialKind::Phong(PhongParameters { diffuse, .. }) = &mut tiles.kind {
        *diffuse = ColorSource::Texture(bricks);
    }
    build
        .shape(Shape::Plane { point: p(0.25, -1.0, -3.0), normal: v(0.0, 1.0, 0.0) }, tiles)
        .quad(p(-4.0, -1.0, -8.0), d(8.0, 0.0, 0.0), d(0.0, 5.0, 0.5), shiny.clone())
        .sphere(p(-1.2, -0.3, -5.0), 0.7, mirror(0.9))
        .sphere(p(0.3, -0.4, -4.0), 0.6, glass(1.5))
        .cuboid(p(1.5, -0.5, -5.5), v(0.8, 1.0, 0.7), v(0.0, 30.0, 5.0), matte(0.4))
        .triangle([p(-2.0, -1.0, -7.0), p(2.0, -1.0, -7.0), p(0.1, 2.0, -7.5)], matte(0.8))
        .mesh(
            lat_long_sphere(9, 14, 0.5, DVec3::ZERO),
            [DVec3::ONE, v(10.0, 0.0, 0.0), p(1.0, 0.6, -5.0)],
            matte(0.7),
        )
        .smooth()
        .shape(Shape::Disk { center: p(-2.2, 0.2, -6.5), normal: v(1.0, 0.3, 2.0), radius: 0.5 }, matte(0.6))
        .shape(
            Shape::Cylinder { a: p(-0.4, -1.0, -6.0), b: p(-0.2, 0.4, -6.1), radius: 0.3, caps: true },
            shiny.clone(),
        )
        .shape(
            Shape::Cone { base: p(0.9, -1.0, -3.6), tip: p(1.0, 0.1, -3.7), radius: 0.3, cap: true },
            shiny.clone(),
        )
        .shape(
            Shape::Torus { center: p(-0.9, 1.1, -5.0), axis: v(0.2, 0.5, 1.0), radius: 0.5, tube: 0.2 },
            shiny,
        )
        .quad(p(-0.5, 3.0, -5.0), DVec3::X, DVec3::Z, emitter(4.0))
        .cuboid(p(3.0, 2.0, -5.0), DVec3::splat(0.25), DVec3::ZERO, emitter(6.0))
        .sphere(p(2.0, 2.0, -4.0), 0.3, emitter(6.0))
        .shape(
            Shape::Disk { center: p(-2.5, 2.5, -4.0), normal: v(1.0, -1.0, 0.0), radius: 0.25 },
            emitter(6.0),
        )
        .mesh(
            lat_long_sphere(3, 5, 0.25, DVec3::ZERO),
            [DVec3::ONE, DVec3::ZERO, p(0.0, 2.5, -3.0)],
            emitter(5.0),
        )
        .point_light(p(-2.0, 2.0, -2.0), 8.0, Falloff::Square)
        .background(0.25)
        .shadows(ShadowMode::Soft, 1)
        .pictured(p(0.125, 0.25, 0.5), p(0.0, 0.0, -5.0), 50.0, 48, 40)
}

#[test]
fn scene_far_from_the_origin_looks_the_same() {
    for accel in [Accel::Bvh, Accel::KdTree] {
        let near = all_objects_at(DVec3::ZERO, accel).picture(4, 3);
        for far in [1e4, 1e6, 1e8] {
            let moved = all_objects_at(v(far, -0.5 * far, 0.25 * far), accel).picture(4, 3);
            let off = difference(&moved, &near);
            assert!(off <= 1e-3, "moved by {far}, {accel:?}: {off}");
        }
    }
}

#[test]
fn distant_object_does_not_reduce_precision() {
    for accel in [Accel::Bvh, Accel::KdTree] {
        let near = all_objects_at(DVec3::ZERO, accel).picture(4, 3);
        let far = v(1e8, 2e7, 3e7);
        let with_ball = all_objects_at(DVec3::ZERO, accel).sphere(far, 0.5, matte(0.5));
        let with_mesh = all_objects_at(DVec3::ZERO, accel).mesh(
            lat_long_sphere(3, 4, 0.5, DVec3::ZERO),
            [DVec3::ONE, DVec3::ZERO, far],
            matte(0.5),
        );
        for build in [with_ball, with_mesh] {
            assert!(difference(&build.picture(4, 3), &near) <= 1e-3, "{accel:?}");
        }
    }
}

#[test]
fn plane_texture_is_stable_far_from_origin() {
    // The texture's period is one tile, so moving by whole tiles does not change the image.
    for (wrap, repeat) in
        [(Wrap::Repeat, Vec2::ONE), (Wrap::Mirror, Vec2::splat(2.0)), (Wrap::Repeat, Vec2::splat(0.25))]
    {
        let seen = |at: DVec3| {
            let mut build = scene().with(|scene| scene.render.ambient = Vec3::ONE);
            let picture = build.texture(
                &[&[Vec3::X, Vec3::Y, Vec3::Z], &[Vec3::splat(0.5), Vec3::ONE, Vec3::ZERO]],
                TextureFilter::Bilinear,
                wrap,
                repeat,
            );
            let mut tiles = matte(0.5);
            if let MaterialKind::Phong(PhongParameters { diffuse, .. }) = &mut tiles.kind {
                *diffuse = ColorSource::Texture(picture);
            }
            build
                .shape(Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y }, tiles)
                .pictured(at + v(0.25, 3.0, 2.0), at + v(0.0, 0.0, -2.0), 50.0, 32, 32)
                .picture(1, 0)
        };
        let near = seen(DVec3::ZERO);
        for far in [1e4, 1e8] {
            let off = difference(&seen(v(far, 0.0, -2.0 * far)), &near);
            assert!(off <= 1e-3, "{wrap:?} {repeat} {far}: {off}");
        }
    }
}

/// A text-format mesh file, moved by adding `at` to its coordinates in double precision.
fn mesh_file_text(mesh: &TriangleMesh, at: DVec3, ending: &str) -> String {
    let points = mesh.positions.iter().map(|p| p.as_dvec3() + at);
    let (vertices, faces) = (mesh.positions.len(), mesh.triangles.len());
    let prefix = if ending == "obj" { "v " } else { "" };
    let points: String = points.map(|p| format!("{prefix}{} {} {}\n", p.x, p.y, p.z)).collect();
    let face = |t: &[u32; 3]| match ending {
        "obj" => format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1),
        _ => format!("3 {} {} {}\n", t[0], t[1], t[2]),
    };
    let triangles: String = mesh.triangles.iter().map(face).collect();
    let head = match ending {
        "obj" => String::new(),
        "off" => format!("OFF\n{vertices} {faces} 0\n"),
        _ => format!(
            "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
        ),
    };
    format!("{head}{points}{triangles}")
}

#[test]
fn mesh_files_keep_distant_vertices() {
    let mut ball = lat_long_sphere(12, 16, 1.0, DVec3::ZERO);
    ball.positions.iter_mut().for_each(|p| *p = (*p * 1024.0).round() / 1024.0);
    let seen = |build: Build, at: DVec3| {
        build
            .smooth()
            .point_light(at + v(2.0, 3.0, 1.0), 30.0, Falloff::Square)
            .pictured(at + v(0.5, 1.0, 3.0), at, 50.0, 32, 32)
            // With seed 1, a sample lies exactly on a facet's edge, where the result depends on rounding.
            .picture(2, 2)
    };
    let near = seen(scene().mesh(ball.clone(), IDENTITY_PLACEMENT, matte(0.8)), DVec3::ZERO);
    let folder = tempfile::tempdir().expect("a folder");
    for far in [v(1e6, 0.0, 0.0), v(1e8, -5e7, 3e7)] {
        for ending in ["obj", "off", "ply"] {
            let path = folder.path().join(format!("ball.{ending}"));
            std::fs::write(&path, mesh_file_text(&ball, far, ending)).expect("written");
            let loaded = load(Path::new(&path), &ignore_progress, &CancelToken::new()).expect("a mesh");
            assert_eq!(loaded.mesh.triangles.len(), ball.triangles.len(), "{ending}");
            // Render the mesh at its position in the file, and moved back by the scene.
            let off =
                difference(&seen(scene().loaded(loaded.clone(), IDENTITY_PLACEMENT, matte(0.8)), far), &near);
            assert!(off <= 1e-3, "{ending} at {far}: {off}");
            let back = [DVec3::ONE, DVec3::ZERO, -far];
            let off = difference(&seen(scene().loaded(loaded, back, matte(0.8)), DVec3::ZERO), &near);
            assert!(off <= 1e-3, "{ending} from {far}: {off}");
        }
    }
}
