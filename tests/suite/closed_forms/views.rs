//! Views that show the acceleration structures and their cost.

use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{Accel, Integrator, ShadowMode};

use super::scenes::{Build, IDENTITY_PLACEMENT, matte, scene};
use super::v;

/// A 64 × 64 image along −z. Pixels are 1/64 wide at a distance of 1.
fn framed(build: Build, view: ViewMode) -> Vec<DVec3> {
    let fov = 2.0 * 0.5_f64.atan().to_degrees();
    build.pictured(DVec3::ZERO, DVec3::NEG_Z, fov, 64, 64).viewed(view).picture(64, 2)
}

fn at(picture: &[DVec3], x: usize, y: usize) -> DVec3 {
    picture[y * 64 + x]
}

/// A ball in a box from (−1, −1, −6) to (1, 1, −4).
fn ball() -> Build {
    scene().sphere(v(0.0, 0.0, -5.0), 1.0, matte(0.5)).with(|scene| scene.render.ambient = Vec3::ONE)
}

#[test]
fn box_edges_are_drawn_at_exact_positions() {
    let (plain, drawn) = (framed(ball(), ViewMode::Beauty), framed(ball(), ViewMode::Bounds));
    // The near side appears at ¼, 16 pixels from the center, and the far side at ⅙, 10⅔ pixels from the
    // center.
    let root = DVec3::new(1.0, 0.85, 0.1);
    let share = |x, y| (at(&drawn, x, y) - at(&plain, x, y)).dot(root) / (root - at(&plain, x, y)).dot(root);
    // Lines are 1¼ pixels wide, and half of this width is inside the box, so a line covers 0.625 of the last
    // pixel.
    for (x, y) in [(47, 20), (16, 40), (30, 16), (33, 47)] {
        assert!((share(x, y) - 0.625).abs() < 0.12, "{x}, {y}: {}", share(x, y));
    }
    // No lines are drawn in front of the ball. Far edges are faint behind the ball and bright next to it.
    assert_eq!(at(&drawn, 32, 32), at(&plain, 32, 32));
    assert_eq!(at(&drawn, 50, 32), DVec3::ZERO, "outside the box");
    let faint = share(42, 32);
    assert!(faint > 0.1 && faint < 0.35, "behind the ball: {faint}");
    let whole = share(42, 22).max(share(21, 22));
    assert!(whole > 0.5, "next to the ball: {whole}");
}

#[test]
fn exposure_does_not_affect_lines() {
    let lines =
        |exposure: f32| framed(ball().with(|scene| scene.render.exposure = exposure), ViewMode::Bounds);
    let (plain, dark) = (lines(0.0), lines(-3.0));
    assert!((at(&dark, 16, 40) - at(&plain, 16, 40) * 8.0).length() < 1e-5);
}

#[test]
fn bvh_and_kd_tree_show_their_boxes() {
    // Two groups of triangles side by side. The BVH shows their boxes, the k-d tree the cells on both sides
    // of a splitting plane.
    let corner = |x: f32, y: f32| Vec3::new(x, y, -4.0);
    let mesh = || TriangleMesh {
        positions: (0..40)
            .flat_map(|i| {
                let x = if i < 20 { -1.5 + 0.05 * i as f32 } else { 0.5 + 0.05 * (i - 20) as f32 };
                [corner(x, -1.9), corner(x + 0.05, -1.9), corner(x, 1.9)]
            })
            .collect(),
        triangles: (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..TriangleMesh::default()
    };
    let picture = |accel: Accel| {
        framed(scene().accel(accel).mesh(mesh(), IDENTITY_PLACEMENT, matte(0.5)), ViewMode::Bounds)
    };
    let (boxes, planes) = (picture(Accel::Bvh), picture(Accel::KdTree));
    for picture in [&boxes, &planes] {
        // The root extends 24 pixels to each side, and 30.4 up and down.
        for (x, y) in [(8, 32), (55, 32), (12, 62), (46, 62)] {
            assert!(at(picture, x, y).max_element() > 0.3, "{x}, {y}");
        }
        assert_eq!((at(picture, 4, 32), at(picture, 61, 32)), (DVec3::ZERO, DVec3::ZERO));
    }
    let lit = |picture: &[DVec3]| (10..54).filter(|&x| at(picture, x, 32).max_element() > 0.3).count();
    assert!(lit(&boxes) > 0 && lit(&planes) > 0, "nodes inside the root must be visible");
    assert_ne!(boxes, planes);
}

#[test]
fn cost_counts_boxes_and_shapes() {
    // The cost counts the root, its leaf and the ball. Outside the box, it is zero.
    let cost = framed(ball(), ViewMode::Cost);
    assert_eq!((at(&cost, 32, 32).x, at(&cost, 2, 2).x), (3.0, 0.0));
    assert_eq!(at(&cost, 46, 17).x, 3.0, "a ray through the box that misses the ball");
    // Every ray tests an infinite plane.
    let floor = glimt::scene::description::Shape::Plane { point: v(0.0, -2.0, 0.0), normal: DVec3::Y };
    let cost = framed(ball().shape(floor, matte(0.5)), ViewMode::Cost);
    assert_eq!((at(&cost, 32, 32).x, at(&cost, 2, 2).x), (4.0, 1.0));
    // A lit point traces one shadow ray. This ray starts inside the box, so its cost does not depend on the
    // light's position.
    let lit = |shadows| {
        framed(ball().point_light(DVec3::ZERO, 1.0, Falloff::None).shadows(shadows, 1), ViewMode::Cost)
    };
    assert_eq!(at(&lit(ShadowMode::Hard), 32, 32).x, 6.0);
    assert_eq!(at(&lit(ShadowMode::Off), 32, 32).x, 3.0);
}

#[test]
fn cost_includes_indirect_rays() {
    let bounce = |depth: u32| {
        let build =
            ball().depth(depth).environment(1.0).with(|scene| scene.render.integrator = Integrator::Path);
        at(&framed(build, ViewMode::Cost), 32, 32).x
    };
    // A constant sky is sampled only by the scattered ray. It leaves the ball and visits the root and leaf
    // again.
    assert_eq!(bounce(0), 3.0);
    assert!(bounce(1) > 3.0 && bounce(1) <= 6.0, "{}", bounce(1));
}
