//! Materials that are black from behind.

use std::f64::consts::PI;

use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{EmissionSides, EmissionSource, Integrator, Material, ReflectingSides};

use super::photons::{assert_same_light, path_and_photon_means};
use super::scenes::{
    Build, emitter, glass, matte, metal, mirror, phong, plastic, principled, receiver, scene,
};
use super::{assert_close, v};

fn front_only(material: Material) -> Material {
    Material { sides: ReflectingSides::Front, ..material }
}

fn materials() -> Vec<(&'static str, Material)> {
    vec![
        ("matte", matte(0.7)),
        ("glossy", phong(0.3, 0.5, 20.0, 0.0)),
        ("mirror", mirror(0.9)),
        ("metal", metal(0.8, 0.5, 0.0)),
        ("brushed metal", metal(0.8, 0.5, 0.5)),
        ("smooth metal", metal(0.8, 0.0, 0.0)),
        ("plastic", plastic(0.6, 0.4)),
        ("smooth plastic", plastic(0.6, 0.0)),
        ("principled", principled(0.7, 0.0, 0.5)),
    ]
}

/// An upward-facing square with lights on both sides, viewed from above or below.
fn square(material: Material, side: f64) -> Build {
    scene()
        .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), material)
        .point_light(v(0.3, 3.0, 0.2), 3.0, Falloff::Square)
        .point_light(v(0.3, -3.0, 0.2), 3.0, Falloff::Square)
        .environment(0.5)
        .seen(v(0.3, 2.0 * side, 0.2), DVec3::ZERO)
        .depth(2)
}

/// The scene once per integrator, with the integrator's name.
fn with_each_integrator(build: &Build) -> [(&'static str, Build); 3] {
    let path = build.clone().with(|scene| scene.render.integrator = Integrator::Path);
    [("whitted", build.clone()), ("path", path), ("photons", build.clone().photons(256, 0.1))]
}

#[test]
fn only_the_front_reflects() {
    for (name, material) in materials() {
        let whole = with_each_integrator(&square(material.clone(), 1.0));
        let front = with_each_integrator(&square(front_only(material.clone()), 1.0));
        let back = with_each_integrator(&square(front_only(material), -1.0));
        for (((integrator, whole), (_, front)), (_, back)) in whole.into_iter().zip(front).zip(back) {
            assert_eq!(front.values(16, 4), whole.values(16, 4), "{name} with {integrator}");
            assert!(back.values(16, 4).iter().all(|value| *value == 0.0), "{name} with {integrator}");
        }
        let lit = square(front_only(matte(0.7)), 1.0).value();
        assert!(lit > 0.1, "{lit}");
    }
}

#[test]
fn winding_order_determines_the_front() {
    for (triangles, mirrored, is_lit) in
        [([[0, 1, 2]], 1.0, true), ([[0, 2, 1]], 1.0, false), ([[0, 1, 2]], -1.0, true)]
    {
        let mesh = TriangleMesh {
            positions: [[-1.0, 1.0], [1.0, 1.0], [0.0, -1.0]].map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec(),
            triangles: triangles.to_vec(),
            ..TriangleMesh::default()
        };
        let placed = [v(mirrored, 1.0, 1.0), DVec3::ZERO, DVec3::ZERO];
        let build = scene().mesh(mesh, placed, front_only(matte(0.7)));
        // L = kd/π · I/d².
        let intensity = (9.0 * PI) as f32;
        let build = build.point_light(v(0.0, 3.0, 0.0), intensity, Falloff::Square);
        for (integrator, build) in with_each_integrator(&build.seen(v(0.0, 2.0, 0.1), DVec3::ZERO)) {
            assert_close(integrator, build.value(), if is_lit { 0.7 } else { 0.0 });
        }
    }
}

#[test]
fn black_backs_cast_shadows_and_emit() {
    for (u, w) in [(DVec3::X, DVec3::Z), (DVec3::Z, DVec3::X)] {
        let lid = receiver(DVec3::ZERO, 0.7).quad(v(-0.5, 1.0, -0.5), u, w, front_only(matte(0.7)));
        let lit = lid.point_light(v(0.0, 2.0, 0.0), 5.0, Falloff::Square).depth(1);
        for (integrator, build) in with_each_integrator(&lit) {
            assert_eq!(build.value(), 0.0, "{integrator}");
        }
        for (sides, of_back) in [(EmissionSides::Both, 2.0), (EmissionSides::Front, 0.0)] {
            let emission = EmissionSource { sides, ..EmissionSource::from_constant(Vec3::splat(2.0)) };
            let lamp = Material { emission, ..front_only(matte(0.0)) };
            let seen = scene().quad(v(-0.5, 1.0, -0.5), u, w, lamp).seen(DVec3::ZERO, v(0.1, 1.0, 0.1));
            // The normal u × v faces up if u is z.
            let exact = if u == DVec3::X { 2.0 } else { of_back };
            for (integrator, build) in with_each_integrator(&seen) {
                assert_eq!(build.value(), exact, "{integrator}, {sides:?}");
            }
        }
    }
}

#[test]
fn black_backs_have_no_albedo_or_ambient_light() {
    for (name, material) in materials() {
        for (side, is_black) in [(1.0, false), (-1.0, true)] {
            let dark = scene().quad(
                v(-1.0, 0.0, 1.0),
                v(2.0, 0.0, 0.0),
                v(0.0, 0.0, -2.0),
                front_only(material.clone()),
            );
            let build = dark.seen(v(0.3, 2.0 * side, 0.2), DVec3::ZERO);
            let albedo = build.clone().viewed(ViewMode::Albedo).value();
            assert_eq!(albedo == 0.0, is_black, "{name}: {albedo}");
            let ambient = build.with(|scene| scene.render.ambient = Vec3::ONE).value();
            assert!(!is_black || ambient == 0.0, "{name}: {ambient}");
        }
    }
    let lit = square(front_only(matte(0.5)), 1.0).with(|scene| {
        scene.lights.clear();
        (scene.render.ambient, scene.environment) = (Vec3::ONE, None);
    });
    assert_close("ambient light on the front", lit.value(), 0.5);
}

#[test]
fn photons_match_path_with_black_backs() {
    // Some squares face the light and some do not. A mirror and a glass ball cast caustics on both kinds.
    let tile = |build: Build, x: f64, is_front: bool| {
        let (u, w) = (v(0.5, 0.0, 0.0), v(0.0, 0.0, -1.5));
        let corner = v(x, 0.0, 0.75);
        let (u, w) = if is_front { (u, w) } else { (w, u) };
        build.quad(corner, u, w, front_only(matte(0.7)))
    };
    let floor = tile(tile(tile(tile(scene(), -1.0, true), -0.5, false), 0.0, true), 0.5, true);
    let room = floor
        .quad(v(-1.0, 0.0, -0.75), v(2.0, 0.0, 0.0), v(0.0, 1.5, 0.0), front_only(plastic(0.6, 0.3)))
        .quad(v(1.0, 0.0, -0.75), v(0.0, 0.0, 1.5), v(0.0, 1.5, 0.0), front_only(mirror(0.9)))
        .quad(v(-1.0, 0.0, -0.75), v(0.0, 0.0, 1.5), v(0.0, 1.5, 0.0), front_only(mirror(0.9)))
        .sphere(v(0.3, 0.4, 0.1), 0.3, glass(1.5))
        .quad(v(-0.5, 1.4, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(4.0))
        .pictured(v(0.0, 0.9, 3.0), v(0.0, 0.4, 0.0), 36.0, 12, 12);
    for depth in [2, 4] {
        let means = path_and_photon_means(&room.clone().depth(depth), depth, [48, 6], (10_000, 0.04));
        assert_same_light(&format!("depth {depth}"), means, 1.2e-2, 4e-3);
    }
}
