//! Cubes viewed from many directions: every ray within the silhouette hits a front face.

use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use glimt::math::DVec3;
use glimt::math::random::TestRandom;
use glimt::scene::description::Accel;

use super::scenes::{Build, IDENTITY_PLACEMENT, matte, scene};
use super::v;

/// Distance at which a ray enters the cube [−h, h]³. `None` if it misses the cube.
fn entry(ray: &Ray, h: f64) -> Option<f64> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (a, b) = ((DVec3::splat(-h) - o) / d, (DVec3::splat(h) - o) / d);
    let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
    (near <= far).then_some(near)
}

fn boxes() -> Build {
    scene().cuboid(DVec3::ZERO, DVec3::splat(2.0), DVec3::ZERO, matte(0.5))
}

/// 27 touching boxes that form a cube.
fn grid() -> Build {
    let third = 2.0 / 3.0;
    (0..27).fold(scene(), |build, i| {
        let place = v(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9)) - DVec3::ONE;
        build.cuboid(place * third, DVec3::splat(third), DVec3::ZERO, matte(0.5))
    })
}

fn faces() -> Vec<[DVec3; 3]> {
    let mut faces = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let (mut corner, mut u, mut w) = (DVec3::splat(-1.0), DVec3::ZERO, DVec3::ZERO);
            corner[axis] = sign;
            (u[(axis + 1) % 3], w[(axis + 2) % 3]) = (2.0, 2.0);
            faces.push(if sign > 0.0 { [corner, u, w] } else { [corner, w, u] });
        }
    }
    faces
}

fn quads() -> Build {
    faces().into_iter().fold(scene(), |build, [corner, u, w]| build.quad(corner, u, w, matte(0.5)))
}

fn triangles() -> Build {
    faces().into_iter().fold(scene(), |build, [c, u, w]| {
        build.triangle([c, c + u, c + u + w], matte(0.5)).triangle([c, c + u + w, c + w], matte(0.5))
    })
}

/// A cube with 8 × 8 squares per face, so that splitting planes pass through edges.
fn mesh(accel: Accel) -> Build {
    let mut mesh = TriangleMesh::default();
    for [c, u, w] in faces() {
        let (u, w) = (u / 8.0, w / 8.0);
        for c in (0..64).map(|i| c + u * f64::from(i % 8) + w * f64::from(i / 8)) {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([c, c + u, c + u + w, c + w].map(|p| p.as_vec3()));
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    scene().accel(accel).mesh(mesh, IDENTITY_PLACEMENT, matte(0.5))
}

#[test]
fn cubes_do_not_speckle() {
    for (what, build) in [
        ("box", boxes()),
        ("grid", grid()),
        ("quads", quads()),
        ("triangles", triangles()),
        ("mesh, BVH", mesh(Accel::Bvh)),
        ("mesh, k-d tree", mesh(Accel::KdTree)),
    ] {
        let mut random = TestRandom::new(7);
        let geometry = build.world().geometry;
        let mut inside = 0;
        for _ in 0..1000 {
            let eye = random.direction() * 6.0;
            for _ in 0..50 {
                // Aim a third of the rays at an edge between pieces.
                let mut target = v(random.signed(), random.signed(), random.signed());
                if random.unit() < 0.3 {
                    target.x = if target.x < 0.0 { -1.0 / 3.0 } else { 1.0 };
                    target.y = if target.y < 0.0 { 1.0 / 3.0 } else { 1.0 };
                }
                let origin = eye.as_vec3();
                let ray = Ray::new(origin, (target - origin.as_dvec3()).as_vec3().normalize());
                if entry(&ray, 1.0 - 1e-6).is_none() {
                    continue;
                }
                inside += 1;
                let Some(hit) = geometry.closest_hit(&ray) else { panic!("{what}: missed by {ray:?}") };
                let exact = entry(&ray, 1.0).expect("the ray hits the smaller cube");
                assert!((f64::from(hit.shape.t) / exact - 1.0).abs() < 1e-5, "{what}: {ray:?}");
                let surface = geometry.surface(&ray, &hit);
                assert!(surface.normal.dot(ray.direction) < 0.0, "{what}: back face hit by {ray:?}");
            }
        }
        assert!(inside > 10_000);
    }
}
