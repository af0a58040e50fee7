//! Keys common to all materials, tested on smooth and rough metals, plastics and principled materials:
//! opacity, vertex colors, and two-sided emission.

use std::f64::consts::PI;

use glimt::geometry::mesh::TriangleMesh;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    CoatSource, EmissionSides, EmissionSource, Integrator, Material, NumberSource, OpacitySource, Shape,
};

use super::scenes::{Build, IDENTITY_PLACEMENT, beckmann, metal, plastic, principled, receiver, scene};
use super::{assert_mean, v};

/// Materials, each with a name for messages.
fn materials() -> [(&'static str, Material); 7] {
    [
        ("metal", metal(0.8, 0.5, 0.0)),
        ("brushed metal", metal(0.8, 0.5, 0.6)),
        ("plastic", plastic(0.6, 0.4)),
        ("Beckmann plastic", beckmann(plastic(0.6, 0.4))),
        ("smooth plastic", plastic(0.6, 0.0)),
        ("principled", principled(0.7, 0.0, 0.5)),
        ("principled metal", principled(0.7, 1.0, 0.5)),
    ]
}

/// The material without its clear coat, which would attenuate emission.
fn uncoated(material: Material) -> Material {
    Material { coat: CoatSource::NONE, ..material }
}

/// The scene once per integrator, with the integrator's name.
fn with_each_integrator(build: &Build) -> [(&'static str, Build); 3] {
    let path = build.clone().with(|scene| scene.render.integrator = Integrator::Path);
    [("whitted", build.clone()), ("path", path), ("photons", build.clone().photons(256, 0.1))]
}

/// A 2 × 2 mesh square at the origin, facing up, lit and viewed from above.
fn square(material: Material, color: Option<[u8; 3]>) -> Build {
    let mesh = TriangleMesh {
        positions: [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]
            .map(|[x, z]| Vec3::new(x, 0.0, z))
            .to_vec(),
        uvs: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(glimt::math::Vec2::from).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        colors: color.map_or(Vec::new(), |color| vec![color; 4]),
        ..TriangleMesh::default()
    };
    let build = scene().mesh(mesh, IDENTITY_PLACEMENT, material).with(|scene| {
        for object in &mut scene.objects {
            if let Shape::Mesh(mesh) = &mut object.shape {
                mesh.vertex_colors = color.is_some();
            }
        }
    });
    build.point_light(v(-1.0, 3.0, 0.5), 3.0, Falloff::None).depth(1).seen(v(0.3, 2.0, 0.2), DVec3::ZERO)
}

#[test]
fn half_opacity_halves_the_light() {
    for (name, material) in materials() {
        let veiled = |opacity: f32| {
            let opacity = OpacitySource { value: NumberSource::Constant(opacity), cutoff: 0.0 };
            square(Material { opacity, ..material.clone() }, None)
        };
        let whole = square(material.clone(), None).value();
        assert!(whole > 0.01, "{name}: {whole}");
        for (integrator, build) in with_each_integrator(&veiled(0.5)) {
            assert_mean(&format!("{name} with {integrator}"), &build.values(64, 64), whole * 0.5, 6e-3);
        }
        for (integrator, build) in with_each_integrator(&veiled(0.0)) {
            assert!(build.values(4, 4).iter().all(|value| *value == 0.0), "{name} with {integrator}");
        }
    }
}

#[test]
fn half_opacity_halves_two_sided_emission() {
    for (name, material) in materials() {
        for (sides, of_back) in [(EmissionSides::Both, 1.0), (EmissionSides::Front, 0.0)] {
            let emission = EmissionSource { sides, ..EmissionSource::from_constant(Vec3::splat(2.0)) };
            let opacity = OpacitySource { value: NumberSource::Constant(0.5), cutoff: 0.0 };
            let shining = Material { emission, opacity, ..uncoated(material.clone()) };
            // On the axis of a disk, E = π·r²/(r² + h²)·L, here π/5·2. Half opacity halves it, on either
            // side.
            let disk = |normal| Shape::Disk { center: v(0.0, 2.0, 0.0), normal, radius: 1.0 };
            for (normal, part) in [(DVec3::NEG_Y, 1.0), (DVec3::Y, of_back)] {
                let lit = receiver(DVec3::ZERO, 0.7).shape(disk(normal), shining.clone()).depth(1);
                let exact = 0.7 / PI * (PI / 5.0) * part;
                for (integrator, build) in with_each_integrator(&lit) {
                    let what = format!("{name} with {integrator}, {sides:?}");
                    let values = build.values(64, 64);
                    if part == 0.0 {
                        assert!(values.iter().all(|value| *value == 0.0), "{what}");
                    } else {
                        assert_mean(&what, &values, exact, 2.5e-3);
                    }
                }
                // The camera sees half of the disk's radiance.
                let seen =
                    scene().shape(disk(normal), shining.clone()).depth(0).seen(DVec3::ZERO, v(0.0, 2.0, 0.1));
                for (integrator, build) in with_each_integrator(&seen) {
                    let values = build.values(64, 64);
                    match part == 0.0 {
                        true => assert!(values.iter().all(|value| *value == 0.0), "{name} with {integrator}"),
                        false => assert_mean(&format!("{name} seen with {integrator}"), &values, 1.0, 1e-6),
                    }
                }
            }
        }
    }
}

#[test]
fn vertex_colors_multiply_metal_and_base_color() {
    // The sRGB value 188 is 0.5029 in linear light.
    let linear = f64::from(((188.0_f32 / 255.0 + 0.055) / 1.055).powf(2.4));
    let gray = |material: Material| square(material, Some([188; 3]));
    for (name, colored, equal) in [
        ("metal", metal(0.8, 0.5, 0.0), metal(0.8 * linear as f32, 0.5, 0.0)),
        ("plastic", plastic(0.6, 0.4), plastic(0.6 * linear as f32, 0.4)),
        ("smooth plastic", plastic(0.6, 0.0), plastic(0.6 * linear as f32, 0.0)),
        ("principled", principled(0.7, 0.0, 0.5), principled(0.7 * linear as f32, 0.0, 0.5)),
        ("principled metal", principled(0.7, 1.0, 0.5), principled(0.7 * linear as f32, 1.0, 0.5)),
    ] {
        let exact = square(equal, None).value();
        assert!(
            (square(colored.clone(), None).value() / exact - 1.0).abs() > 0.05,
            "{name}: the vertex color must have an effect"
        );
        for (integrator, build) in with_each_integrator(&gray(colored)) {
            assert_mean(&format!("{name} with {integrator}"), &build.values(16, 64), exact, 8e-3);
        }
    }
}
