//! Mesh lights with coincident faces.

use glimt::geometry::mesh::TriangleMesh;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::{Material, Shape};

use super::scenes::{IDENTITY_PLACEMENT, emitter, metal, scene};
use super::two_sided::{assert_lit, at_origin, two_sided_emitter};
use super::{assert_same_mean, lambert, mean_and_error, v};

/// A square light. Its first two triangles face down, and vertices 4 to 7 have the same positions as 0 to 3.
fn light(more: &[[u32; 3]]) -> TriangleMesh {
    let corner = |i: usize| [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)][i % 4];
    TriangleMesh {
        positions: (0..8).map(corner).map(|(x, z)| Vec3::new(x, 1.5, z)).collect(),
        triangles: [&[[0, 1, 2], [0, 2, 3]], more].concat(),
        ..TriangleMesh::default()
    }
}

/// Additional faces for the light. They must not change its appearance from below.
const ADDITIONAL_FACES: [(&str, [[u32; 3]; 2]); 5] = [
    ("same", [[0, 1, 2], [0, 2, 3]]),
    ("rotated", [[1, 2, 0], [2, 3, 0]]),
    ("copied", [[5, 6, 4], [6, 7, 4]]),
    ("reversed", [[2, 1, 0], [3, 2, 0]]),
    ("reversed, other diagonal", [[3, 2, 1], [3, 1, 0]]),
];

#[test]
fn coincident_faces_emit_once() {
    let irradiance = |lowered: f64| {
        let corners = light(&[]).positions[..4].to_vec();
        let corners: Vec<_> = corners.iter().map(|at| at.as_dvec3() - DVec3::Y * lowered).collect();
        lambert(DVec3::ZERO, DVec3::Y, &corners)
    };
    let lit =
        |more: &[[u32; 3]], material: Material| at_origin().mesh(light(more), IDENTITY_PLACEMENT, material);
    for (name, more) in ADDITIONAL_FACES {
        // Sheets that face in opposite directions are moved apart.
        let exact = irradiance(if name.starts_with("reversed") { 1.0 / 4096.0 } else { 0.0 });
        assert_lit(name, &lit(&more, emitter(1.0)), exact, 3e-4);
        assert_lit(&format!("{name}, both sides"), &lit(&more, two_sided_emitter()), exact, 3e-4);
    }
}

#[test]
fn coincident_faces_keep_reflections_in_metal() {
    let floor = Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y };
    let mirrored = |more: &[[u32; 3]]| {
        let floor = scene().shape(floor.clone(), metal(0.9, 0.4, 0.0)).seen(v(0.3, 1.0, 0.2), DVec3::ZERO);
        mean_and_error(&floor.mesh(light(more), IDENTITY_PLACEMENT, emitter(1.0)).values(256, 256))
    };
    let exact = mirrored(&[]);
    for (name, more) in ADDITIONAL_FACES {
        assert_same_mean(name, mirrored(&more), exact, 1.5e-3);
    }
}

#[test]
fn two_sheet_lights_have_no_speckle() {
    // A tilted light, seen from both sides, from near and far.
    let [a, x, y] = [v(0.56, 1.58, 1.3), v(0.8, -0.6, 0.0), v(-0.48, -0.64, 0.6)];
    let positions = [a, a + x, a + x + y, a + y].map(DVec3::as_vec3).to_vec();
    let (center, normal) = (a + (x + y) * 0.5, x.cross(y).normalize());
    for (name, more) in ADDITIONAL_FACES.into_iter().filter(|(name, _)| name.starts_with("reversed")) {
        let mesh = TriangleMesh { positions: positions.clone(), ..light(&more) };
        for distance in [-300.0_f64, -1.0, 1.0, 300.0] {
            let eye = center + (normal + x * 0.3) * distance;
            let seen = scene().mesh(mesh.clone(), IDENTITY_PLACEMENT, emitter(1.0));
            let seen = seen.pictured(eye, center, 20.0 / distance.abs(), 16, 16);
            let image = seen.picture(4, 1);
            assert!(image.iter().all(|pixel| *pixel == DVec3::ONE), "{name} from {distance}: {image:?}");
        }
    }
}
