//! Two-sided area lights.

use std::f64::consts::PI;

use glimt::geometry::mesh::TriangleMesh;
use glimt::math::DVec3;
use glimt::scene::description::{EmissionSides, Integrator, Material, Shape};

use super::direct::{assert_hard, assert_irradiance};
use super::scenes::{Build, IDENTITY_PLACEMENT, emitter, lat_long_sphere, mirror, receiver, scene};
use super::{assert_close, assert_mean, assert_same_mean, lambert, mean_and_error, v};

/// A light with radiance 1 on both sides.
pub fn two_sided_emitter() -> Material {
    let mut material = emitter(1.0);
    material.emission.sides = EmissionSides::Both;
    material
}

pub fn at_origin() -> Build {
    receiver(DVec3::ZERO, 0.7)
}

/// [`assert_irradiance`] with light samples and with path tracing.
#[track_caller]
pub fn assert_lit(what: &str, lit: &Build, irradiance: f64, max_relative_error: f64) {
    assert_irradiance(what, lit, irradiance, max_relative_error);
    let paths = lit.clone().with(|scene| scene.render.integrator = Integrator::Path);
    assert_mean(&format!("{what}, path"), &paths.values(256, 256), 0.7 * irradiance / PI, max_relative_error);
}

#[test]
fn flat_two_sided_lights_are_symmetric() {
    let corner = v(-0.3, 0.8, -0.5);
    let (x, z) = (v(0.9, 0.2, 0.0), v(0.1, 0.3, 1.0));
    let polygon = [corner, corner + x, corner + x + z, corner + z];
    let whole = lambert(DVec3::ZERO, DVec3::Y, &polygon);
    let half = lambert(DVec3::ZERO, DVec3::Y, &polygon[..3]);
    // Test both orientations.
    for (u, w) in [(x, z), (z, x)] {
        let quad = at_origin().quad(corner, u, w, two_sided_emitter());
        assert_lit("quad", &quad, whole, 2e-4);
        assert_hard("quad", &quad, whole, 4e-5);
        let ends =
            if u == x { [polygon[0], polygon[1], polygon[2]] } else { [polygon[0], polygon[2], polygon[1]] };
        assert_lit("triangle", &at_origin().triangle(ends, two_sided_emitter()), half, 6e-5);
    }
    for normal in [DVec3::Y, DVec3::NEG_Y] {
        // E = π·r²/(r² + h²) on the axis.
        let disk = Shape::Disk { center: v(0.0, 2.0, 0.0), normal, radius: 1.0 };
        assert_lit("disk", &at_origin().shape(disk, two_sided_emitter()), PI / 5.0, 3e-5);
    }
}

#[test]
fn two_sided_mesh_lights_are_symmetric() {
    let corners = [v(-1.0, 1.0, -1.0), v(1.0, 1.0, -1.0), v(1.0, 1.0, 1.0), v(-1.0, 1.0, 1.0)];
    let exact = lambert(DVec3::ZERO, DVec3::Y, &corners);
    let of = |triangles: &[[u32; 3]]| TriangleMesh {
        positions: corners.iter().map(|corner| corner.as_vec3()).collect(),
        triangles: triangles.to_vec(),
        ..TriangleMesh::default()
    };
    // The winding order determines the front side, and a mirroring transform preserves it.
    for (name, mesh) in [
        ("down", of(&[[0, 1, 2], [0, 2, 3]])),
        ("up", of(&[[0, 2, 1], [0, 3, 2]])),
        ("askew", of(&[[0, 1, 2], [0, 3, 2]])),
    ] {
        assert_lit(
            name,
            &at_origin().mesh(mesh.clone(), IDENTITY_PLACEMENT, two_sided_emitter()),
            exact,
            2.5e-4,
        );
        let mirrored = [v(-1.0, 1.0, 1.0), DVec3::ZERO, DVec3::ZERO];
        assert_lit(name, &at_origin().mesh(mesh, mirrored, two_sided_emitter()), exact, 2.5e-4);
    }
}

#[test]
fn enclosing_light_fills_hemisphere() {
    // The radiance is 1 over the whole hemisphere, so E = π.
    let at = v(2.0, 0.0, 0.0);
    let around = |shape: Shape| receiver(at, 0.7).shape(shape, two_sided_emitter());
    for shape in [
        Shape::Sphere { center: at + v(0.2, 0.1, 0.0), radius: 0.7 },
        Shape::Box { center: at, size: v(1.0, 0.6, 2.0), rotate: v(10.0, 20.0, 30.0) },
        Shape::Cylinder { a: at - DVec3::Y, b: at + DVec3::Y, radius: 0.5, caps: true },
        Shape::Cone { base: at - DVec3::Y, tip: at + v(0.0, 3.0, 0.0), radius: 1.0, cap: true },
        Shape::Torus { center: DVec3::ZERO, axis: DVec3::Y, radius: 2.0, tube: 0.5 },
    ] {
        assert_lit(shape.kind(), &around(shape.clone()), PI, 4e-4);
    }
    let ball = lat_long_sphere(12, 24, 0.8, at);
    assert_lit("mesh", &receiver(at, 0.7).mesh(ball, IDENTITY_PLACEMENT, two_sided_emitter()), PI, 1.5e-3);
}

#[test]
fn open_tube_light_emits_inward() {
    // On the axis, the irradiance from a disk with radius 1 at height h is π/(1 + h²).
    let disk = |h: f64| PI / (1.0 + h * h);
    let tube = |from: f64, to: f64| {
        at_origin().shape(
            Shape::Cylinder { a: v(0.0, from, 0.0), b: v(0.0, to, 0.0), radius: 1.0, caps: false },
            two_sided_emitter(),
        )
    };
    assert_lit("from inside", &tube(-0.5, 1.5), PI - disk(1.5), 8e-5);
    assert_lit("from below", &tube(1.0, 2.0), disk(1.0) - disk(2.0), 2e-5);
    // From the side, the outer surface hides the inner surface.
    let outside = receiver(v(3.0, 0.0, 0.0), 0.7);
    let of = |material: Material| {
        let shape = Shape::Cylinder { a: v(0.0, 0.0, 0.0), b: v(0.0, 1.0, 0.0), radius: 1.0, caps: true };
        outside.clone().shape(shape, material)
    };
    let [one, two] =
        [emitter(1.0), two_sided_emitter()].map(|material| mean_and_error(&of(material).values(64, 256)));
    assert_same_mean("from the side", two, one, 2.5e-4);
}

#[test]
fn both_sides_are_visible() {
    let lamp = |u: DVec3, w: DVec3, material| scene().quad(v(-1.0, -1.0, -2.0), u, w, material);
    for (u, w) in [(v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0)), (v(0.0, 2.0, 0.0), v(2.0, 0.0, 0.0))] {
        assert_close("seen", lamp(u, w, two_sided_emitter()).value(), 1.0);
    }
    assert_eq!(lamp(v(0.0, 2.0, 0.0), v(2.0, 0.0, 0.0), emitter(1.0)).value(), 0.0);
}

#[test]
fn two_sided_lights_emit_photons_both_ways() {
    // A mirror reflects light from the back of the light to the receiver.
    let lit = receiver(DVec3::ZERO, 0.7)
        .quad(v(-0.5, 1.0, -0.5), v(0.0, 0.0, 1.0), DVec3::X, two_sided_emitter())
        .quad(v(-3.0, 2.0, -3.0), v(6.0, 0.0, 0.0), v(0.0, 0.0, 6.0), mirror(0.8));
    let paths = lit.clone().with(|scene| scene.render.integrator = Integrator::Path).values(256, 64);
    let photons = lit.photons(4_000, 0.05).values(16, 32);
    assert_same_mean("photons", mean_and_error(&photons), mean_and_error(&paths), 2.5e-3);
}
