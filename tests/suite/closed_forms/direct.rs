//! Direct light on a diffuse surface from every kind of light: L = ρ·E/π.

use std::f64::consts::PI;

use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::ViewMode;
use glimt::math::DVec3;
use glimt::scene::description::ShadowMode;
use glimt::scene::description::light::Falloff;

use super::scenes::{Build, IDENTITY_PLACEMENT, emitter, lat_long_sphere, matte, receiver};
use super::{assert_close, assert_mean, lambert, v};

/// Checks the irradiance E for radiance 1, with one and with several shadow rays at equal total cost. The
/// standard errors must be at most `max_relative_error`·E.
#[track_caller]
pub fn assert_irradiance(what: &str, lit: &Build, irradiance: f64, max_relative_error: f64) {
    for (samples, shadow_samples) in [(256, 1), (16, 16)] {
        let values = lit.clone().shadows(ShadowMode::Soft, shadow_samples).values(samples, 256);
        assert_mean(
            &format!("{what}, {shadow_samples} shadow rays"),
            &values,
            0.7 * irradiance / PI,
            max_relative_error,
        );
    }
}

/// Checks the value with hard shadows, where a single ray to the light's center decides whether it is fully
/// visible or fully hidden.
#[track_caller]
pub fn assert_hard(what: &str, lit: &Build, irradiance: f64, max_relative_error: f64) {
    let values = lit.clone().shadows(ShadowMode::Hard, 4).values(64, 64);
    assert_mean(&format!("{what}, hard"), &values, 0.7 * irradiance / PI, max_relative_error);
}

pub fn at_origin() -> Build {
    receiver(DVec3::ZERO, 0.7)
}

/// A unit square light at `height`, facing down toward the origin.
fn square_above(height: f64) -> Build {
    at_origin().quad(v(-0.5, height, -0.5), DVec3::X, DVec3::Z, emitter(1.0))
}

#[test]
fn point_light_falloff_is_exact() {
    // E = I·cos θ/d² = 10·(2/√5)/5 = 1.788854382; L = 0.7·E/π. Without falloff E = I·cos θ.
    let lit = |falloff| at_origin().point_light(v(1.0, 2.0, 0.0), 10.0, falloff);
    for shadows in [ShadowMode::Soft, ShadowMode::Hard, ShadowMode::Off] {
        let value = |falloff| lit(falloff).shadows(shadows, 3).value();
        assert_close("square", value(Falloff::Square), 0.398_587_024_3);
        assert_close("none", value(Falloff::None), 0.7 / PI * 10.0 * 2.0 / 5.0_f64.sqrt());
    }
}

#[test]
fn point_light_shadow_edge_is_exact() {
    // The light is at height 4 above x = 0. The shadow of a blocker at height 1 that ends at x = b ends at x
    // = b·4/3.
    let lit = |x: f64, b: f64| {
        receiver(v(x, 0.0, 0.0), 0.7).point_light(v(0.0, 4.0, 0.0), 1.0, Falloff::None).quad(
            v(b - 100.0, 1.0, -100.0),
            v(100.0, 0.0, 0.0),
            v(0.0, 0.0, 200.0),
            matte(0.5),
        )
    };
    for b in [0.0, 0.3, -0.7] {
        let edge: f64 = b * 4.0 / 3.0;
        let x = edge + 1e-5_f64;
        let cosine = 4.0 / (16.0 + x * x).sqrt();
        assert_close("lit", lit(x, b).value(), 0.7 / PI * cosine);
        assert_eq!(lit(edge - 1e-5, b).value(), 0.0);
        let off = lit(edge - 1e-5, b).shadows(ShadowMode::Off, 1).value();
        assert_close("no shadows", off, 0.7 / PI * cosine);
    }
}

#[test]
fn parallel_square_light_is_exact() {
    // Four times the corner formula for a quarter of the square, with A = B = ½/h. E = π·F·L.
    for (height, exact) in [(1.0, 0.752_274_688_5), (4.0, 0.061_225_761_1), (0.1, 3.042_128)] {
        let a: f64 = 0.5 / height;
        let w = (1.0 + a * a).sqrt();
        let formula = 4.0 * PI * 2.0 * a / w * (a / w).atan() / (2.0 * PI);
        assert_close("the formula", formula, exact);
        assert_irradiance(&format!("{height} above"), &square_above(height), formula, 1e-4);
        assert_hard("square", &square_above(height), formula, 2e-4);
    }
}

#[test]
fn perpendicular_square_light_is_exact() {
    // F = (atan 1 − atan(1/√2)/√2)/2π if all lengths are 1.
    let exact = 0.5 * (PI / 4.0 - 0.5_f64.sqrt().atan() / 2.0_f64.sqrt());
    assert_close("the formula", exact, 0.175_094_143_9);
    let lit = at_origin().quad(v(0.0, 0.0, 1.0), DVec3::Y, DVec3::X, emitter(1.0));
    assert_irradiance("perpendicular", &lit, exact, 1.5e-5);
    assert_hard("perpendicular", &lit, exact, 3e-5);
    let behind = at_origin().quad(v(0.0, 0.0, 1.0), DVec3::X, DVec3::Y, emitter(1.0));
    assert_eq!(behind.value(), 0.0);
}

#[test]
fn rectangle_lights_match_lambert() {
    // Lambert's formula for arbitrary rectangles that face the origin from above the plane.
    for (corner, u, w) in [
        (v(0.3, 0.01, -0.5), v(0.0, 0.0, 1.0), v(0.0, 2.0, 0.0)),
        (v(0.02, 0.5, -5.0), v(0.0, 0.0, 10.0), v(0.1, 0.1, 0.0)),
        (v(-3.0, 2.0, 1.0), v(0.3, 0.0, 0.4), v(0.4, 0.5, -0.3)),
        (v(-20.0, 7.0, -30.0), v(40.0, 0.0, 0.0), v(0.0, 0.0, 60.0)),
        (v(-200.0, 0.5, -300.0), v(400.0, 0.0, 0.0), v(0.0, 0.0, 600.0)),
        (v(2.0, 1.4, 0.0), v(0.25, 0.0, 0.0), v(0.0, 0.0, 0.5)),
        (v(-0.5, 0.001, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0)),
        (v(0.01, 0.02, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0)),
    ] {
        let (u, w) = if u.cross(w).dot(corner) < 0.0 { (u, w) } else { (w, u) };
        let polygon = [corner, corner + u, corner + u + w, corner + w];
        let exact = lambert(DVec3::ZERO, DVec3::Y, &polygon);
        let lit = at_origin().quad(corner, u, w, emitter(1.0));
        assert_irradiance(&format!("rectangle at {corner} {u} {w}"), &lit, exact, 1.5e-4);
    }
}

#[test]
fn parallelogram_and_triangle_lights_are_exact() {
    let (corner, u, w) = (v(-0.4, 1.2, -0.3), v(1.0, 0.2, 0.3), v(0.4, -0.1, 1.1));
    let parallelogram = [corner, corner + u, corner + u + w, corner + w];
    let exact = lambert(DVec3::ZERO, DVec3::Y, &parallelogram);
    assert_irradiance("parallelogram", &at_origin().quad(corner, u, w, emitter(1.0)), exact, 2.5e-5);

    let triangle = [corner, corner + u, corner + w];
    let exact = lambert(DVec3::ZERO, DVec3::Y, &triangle);
    let lit = at_origin().triangle(triangle, emitter(1.0));
    assert_irradiance("triangle", &lit, exact, 5e-6);
    assert_hard("triangle", &lit, exact, 8e-6);
    let turned = at_origin().triangle([corner, corner + w, corner + u], emitter(1.0));
    assert_eq!(turned.value(), 0.0);
}

/// Irradiance E at the origin from the visible faces of a convex polyhedron.
fn convex(faces: impl IntoIterator<Item = Vec<DVec3>>) -> f64 {
    let visible = faces.into_iter().filter(|face| {
        let normal = (face[1] - face[0]).cross(face[2] - face[0]);
        normal.dot(face[0]) < 0.0
    });
    visible.map(|face| lambert(DVec3::ZERO, DVec3::Y, &face)).sum()
}

#[test]
fn box_light_shines_from_visible_faces() {
    let (center, half) = (v(0.9, 1.5, -0.4), v(0.4, 0.5, 0.3));
    let face = |axis: usize, sign: f64| {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |a: f64, b: f64| {
            let mut p = DVec3::ZERO;
            (p[axis], p[i], p[j]) = (sign * half[axis], a * half[i], b * half[j]);
            center + p
        };
        let ring = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        if sign > 0.0 { ring.to_vec() } else { ring.into_iter().rev().collect() }
    };
    let exact = convex((0..3).flat_map(|axis| [face(axis, 1.0), face(axis, -1.0)]));
    let lit = at_origin().cuboid(center, half * 2.0, DVec3::ZERO, emitter(1.0));
    assert_irradiance("box", &lit, exact, 2e-4);
    // A quarter turn around y exchanges the x and z edges of the box.
    let turned = v(half.z, half.y, half.x) * 2.0;
    let lit = at_origin().cuboid(center, turned, v(0.0, 90.0, 0.0), emitter(1.0));
    assert_irradiance("turned box", &lit, exact, 3e-4);
}

#[test]
fn transformed_mesh_light_is_exact() {
    // A closed ball of triangles. Every triangle that faces the origin is fully visible, because the ball is
    // convex.
    let ball = lat_long_sphere(6, 8, 0.5, DVec3::ZERO);
    let place = v(0.6, 1.6, 0.2);
    for scale in [v(1.0, 1.0, 1.0), v(1.0, 0.6, -1.3)] {
        let corner = |p: glimt::math::Vec3| p.as_dvec3() * scale + place;
        let faces = ball.triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| corner(ball.positions[i as usize]));
            if scale.z < 0.0 { vec![a, c, b] } else { vec![a, b, c] }
        });
        let exact = convex(faces);
        let lit = at_origin().mesh(ball.clone(), [scale, DVec3::ZERO, place], emitter(1.0));
        assert_irradiance(&format!("ball with scale {scale}"), &lit, exact, 8e-4);
    }
}

#[test]
fn mesh_light_occludes_itself() {
    // Two equal, downward-facing squares in one mesh. The lower one is at half the height and completely
    // hides the upper one from the origin.
    let mut mesh = TriangleMesh::default();
    for (half, y) in [(0.5_f32, 1.0_f32), (0.5, 2.0)] {
        let first = mesh.positions.len() as u32;
        for (x, z) in [(-half, -half), (half, -half), (half, half), (-half, half)] {
            mesh.positions.push(glimt::math::Vec3::new(x, y, z));
        }
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    let lit = at_origin().mesh(mesh, IDENTITY_PLACEMENT, emitter(1.0));
    assert_irradiance("two squares", &lit, 0.752_274_688_5, 1.5e-4);
}

#[test]
fn sphere_light_is_exact_at_every_elevation() {
    // With H = 2, E/πL is cos θ/H² if the whole sphere is above the horizon, and otherwise a tabulated
    // integral.
    for (cosine, exact) in
        [(1.0, 0.25), (0.2, 0.059_345_832_4), (0.0, 0.028_834_442_8), (-0.3, 0.003_715_430_7)]
    {
        let center = v((1.0_f64 - cosine * cosine).sqrt(), cosine, 0.0) * 2.0;
        let lit = at_origin().sphere(center, 1.0, emitter(1.0));
        assert_irradiance(&format!("cos θ = {cosine}"), &lit, PI * exact, 1.5e-3);
        if cosine > 0.0 {
            assert_hard("sphere", &lit, PI * exact, 3e-4);
        }
    }
}

#[test]
fn sphere_light_is_exact_near_and_far() {
    for (h, cosine) in [(1000.0, 0.6), (1e5, 0.6), (1.01, 1.0), (1.0001, 1.0), (1.25, 0.9)] {
        let direction = v((1.0_f64 - cosine * cosine).sqrt(), cosine, 0.0);
        let lit = at_origin().sphere(direction * h, 1.0, emitter(1.0));
        assert_irradiance(&format!("H = {h}"), &lit, PI * cosine / (h * h), 4e-5);
    }
}

/// A unit square light at height 4, optionally with a blocker at height 1 that covers x < 0.
fn penumbra(x: f64, blocker: bool) -> Build {
    let lit = receiver(v(x, 0.0, 0.0), 0.7).quad(v(-0.5, 4.0, -0.5), DVec3::X, DVec3::Z, emitter(1.0));
    let hide =
        |lit: Build| lit.quad(v(-1000.0, 1.0, -1000.0), v(1000.0, 0.0, 0.0), v(0.0, 0.0, 2000.0), matte(0.5));
    if blocker { hide(lit) } else { lit }
}

#[test]
fn half_plane_penumbra_is_exact() {
    // The line of sight past the blocker's edge meets the light at x' = −3x. The part of the light to the
    // right of x' is visible.
    for (x, exact) in [
        (-1.0_f64 / 6.0, 0.0),
        (-1.0 / 12.0, 0.015_059_393_9),
        (0.0, 0.030_612_880_6),
        (1.0 / 12.0, 0.046_115_392_9),
        (1.0 / 6.0, 0.061_022_237_3),
    ] {
        let left = (-3.0 * x).clamp(-0.5, 0.5);
        let part = [v(left, 4.0, -0.5), v(0.5, 4.0, -0.5), v(0.5, 4.0, 0.5), v(left, 4.0, 0.5)];
        let formula = lambert(v(x, 0.0, 0.0), DVec3::Y, &part);
        assert!((formula - exact).abs() < 1e-9);
        assert_irradiance(&format!("penumbra at {x}"), &penumbra(x, true), formula, 8e-4);
        let off = |blocker| penumbra(x, blocker).shadows(ShadowMode::Off, 4).values(8, 16);
        assert_eq!(off(true), off(false));
        // The light's center is hidden for x < 0. For x > 0, the whole light counts.
        let square = [v(-0.5, 4.0, -0.5), v(0.5, 4.0, -0.5), v(0.5, 4.0, 0.5), v(-0.5, 4.0, 0.5)];
        let hard = if x > 0.0 { lambert(v(x, 0.0, 0.0), DVec3::Y, &square) } else { 0.0 };
        if x != 0.0 {
            assert_hard("penumbra", &penumbra(x, true), hard, 1e-6);
        }
    }
}

#[test]
fn shadow_view_shows_visible_fraction() {
    // By symmetry, half of the light is visible from the middle of the penumbra.
    for shadow_samples in [1, 16] {
        let view = penumbra(0.0, true).viewed(ViewMode::Shadow).shadows(ShadowMode::Soft, shadow_samples);
        assert_mean("half", &view.values(64, 64), 0.5, 1e-6);
    }
    assert_eq!(penumbra(0.3, true).viewed(ViewMode::Shadow).value(), 1.0);
    // Two point lights. The hidden one has E = 3/2², the visible one E = 5/1, so the visible fraction is 5/(5
    // + ¾).
    let lit = at_origin()
        .point_light(v(0.0, 2.0, 0.0), 3.0, Falloff::Square)
        .point_light(v(0.0, 1.0, 0.0), 5.0, Falloff::Square)
        .quad(v(-1.0, 1.5, -1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), matte(0.5));
    assert_close("two lights", lit.viewed(ViewMode::Shadow).value(), 5.0 / 5.75);
}

#[test]
fn uniform_light_on_diffuse_gives_its_albedo() {
    // With radiance 1 over the whole hemisphere, E = π and L = ρ, regardless of the surface's position and
    // orientation.
    for (point, size) in [(v(0.0, 0.0, 0.0), 2.0), (v(0.6, -0.7, 0.3), 1.0), (v(0.3, 0.9, -0.2), 1.0)] {
        let mut lit = receiver(point, 0.7);
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let (mut u, mut w, mut corner) = (DVec3::ZERO, DVec3::ZERO, DVec3::splat(-size));
                (u[(axis + 1) % 3], w[(axis + 2) % 3]) = (2.0 * size, 2.0 * size);
                corner[axis] = sign * size;
                let (u, w) = if sign > 0.0 { (w, u) } else { (u, w) };
                lit = lit.quad(corner, u, w, emitter(1.0));
            }
        }
        assert_irradiance(&format!("at {point}"), &lit, PI, 1.5e-4);
    }
}

#[test]
fn many_lights_add_up() {
    let one = |build: Build, i: u32| {
        let x = f64::from(i) * 0.9 - 1.5;
        build.quad(v(x, 1.0, -0.3), v(0.5, 0.0, 0.0), v(0.0, 0.0, 0.5), emitter(1.0))
    };
    let polygon = |i: u32| {
        let x = f64::from(i) * 0.9 - 1.5;
        [v(x, 1.0, -0.3), v(x + 0.5, 1.0, -0.3), v(x + 0.5, 1.0, 0.2), v(x, 1.0, 0.2)]
    };
    let exact = (0..4).map(|i| lambert(DVec3::ZERO, DVec3::Y, &polygon(i))).sum();
    assert_irradiance("four squares", &(0..4).fold(at_origin(), one), exact, 1e-6);
}
