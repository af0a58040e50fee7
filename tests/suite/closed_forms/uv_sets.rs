//! Textures that use a mesh's second set of texture coordinates.

use glimt::geometry::mesh::TriangleMesh;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::{
    Bump, ColorSource, EmissionSource, Integrator, Material, MaterialKind, NormalMap, NumberSource,
    OpacitySource, PhongParameters, TextureFilter, UvSet, Wrap,
};

use super::scenes::{Build, matte, phong, principled, scene};
use super::{assert_mean, v};

/// Corners of the wall.
const CORNERS: [DVec3; 4] = [v(-1.0, -1.0, 0.0), v(1.0, -1.0, 0.0), v(1.0, 1.0, 0.0), v(-1.0, 1.0, 0.0)];
/// Texture coordinates of the corners.
const RIGHT: [Vec2; 4] = [Vec2::new(0.1, 0.2), Vec2::new(1.7, 0.1), Vec2::new(1.9, 1.4), Vec2::new(0.3, 1.2)];

/// A wall facing +z with the given sets of texture coordinates.
fn wall(uvs: &[Vec2], second_uvs: &[Vec2]) -> TriangleMesh {
    TriangleMesh {
        positions: CORNERS.map(|corner| corner.as_vec3()).to_vec(),
        uvs: uvs.to_vec(),
        second_uvs: second_uvs.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }
}

/// Adds a texture with six texels.
fn texture(build: &mut Build, filter: TextureFilter) -> usize {
    let row = |values: [f32; 3]| values.map(|x| Vec3::new(x, 0.6 * x, 0.4));
    let rows = [row([0.1, 0.9, 0.4]), row([0.7, 0.3, 0.5])];
    build.texture(&[&rows[0], &rows[1]], filter, Wrap::Repeat, Vec2::ONE)
}

/// One material for each kind of texture lookup.
fn materials(texture: usize) -> Vec<(&'static str, Material)> {
    let number = || NumberSource::Texture { texture, channel: None };
    let lit = phong(0.5, 0.3, 20.0, 0.0);
    let colored = MaterialKind::Phong(PhongParameters {
        diffuse: ColorSource::Texture(texture),
        specular: ColorSource::Constant(Vec3::ZERO),
        shininess: 1.0,
        ambient: None,
        diffuse_transmission: ColorSource::BLACK,
    });
    let mut rough = principled(0.5, 1.0, 0.5);
    if let MaterialKind::Principled { roughness, .. } = &mut rough.kind {
        *roughness = number();
    }
    let emission = EmissionSource { texture: Some(texture), ..EmissionSource::from_constant(Vec3::ONE) };
    let bump = Some(Bump { texture, channel: None, scale: 0.2 });
    vec![
        ("a color", Material { kind: colored, ..matte(0.5) }),
        ("a number", rough),
        ("emission", Material { emission, ..matte(0.5) }),
        ("opacity", Material { opacity: OpacitySource { value: number(), cutoff: 0.0 }, ..matte(0.5) }),
        ("normals", Material { normal_map: Some(NormalMap { texture, strength: 0.7 }), ..lit.clone() }),
        ("heights", Material { bump, ..lit }),
    ]
}

/// Renders the wall next to a floor, under a point light and a constant sky.
fn picture(build: &Build, mesh: TriangleMesh, material: Material, mirrored: f64) -> Vec<DVec3> {
    let lamp = v(0.5, 1.5, 2.0);
    build
        .clone()
        .mesh(mesh, [v(mirrored, 1.0, 1.0), v(10.0, 0.0, 0.0), DVec3::ZERO], material)
        .quad(v(-2.0, -1.5, -1.0), v(4.0, 0.0, 0.0), v(0.0, 0.0, 3.0), matte(0.6))
        .point_light(lamp, 2.0, glimt::scene::description::light::Falloff::Square)
        .environment(0.4)
        .pictured(v(0.2, 0.1, 3.0), DVec3::ZERO, 50.0, 12, 10)
        .depth(3)
        .picture(4, 0)
}

/// Checks that a lookup with the second set is bit-identical to a lookup with the same coordinates in the
/// first set.
#[test]
fn second_uv_set_is_bit_identical_to_first() {
    const OTHER: [Vec2; 4] =
        [Vec2::splat(0.5), Vec2::new(0.6, 0.5), Vec2::new(0.6, 0.7), Vec2::new(0.5, 0.9)];
    for filter in [TextureFilter::Nearest, TextureFilter::Bilinear, TextureFilter::Mipmap] {
        for integrator in [Integrator::Whitted, Integrator::Path] {
            let mut build = scene().with(|scene| scene.render.integrator = integrator);
            let image = texture(&mut build, filter);
            let mut second = build.clone();
            second.image_mut(image).uv = UvSet::Second;
            for (name, material) in materials(image) {
                for mirrored in [1.0, -1.0] {
                    let seen = |build: &Build, mesh| picture(build, mesh, material.clone(), mirrored);
                    let what = format!("{name}, {filter:?}, {integrator:?}, {mirrored}");
                    let expected = seen(&build, wall(&RIGHT, &[]));
                    assert_eq!(seen(&second, wall(&OTHER, &RIGHT)), expected, "{what}");
                    assert_eq!(seen(&build, wall(&RIGHT, &OTHER)), expected, "first set: {what}");
                    assert_ne!(
                        seen(&build, wall(&OTHER, &RIGHT)),
                        expected,
                        "the coordinates must have an effect: {what}"
                    );
                    // Without a second set, the first set is used.
                    assert_eq!(seen(&second, wall(&RIGHT, &[])), expected, "none: {what}");
                }
            }
        }
    }
}

/// A wall in a furnace with radiance 1. As in glTF files, reflectance uses one set and emission the other.
#[test]
fn one_material_can_use_both_uv_sets() {
    // The color changes from left to right in the first set, the emission from bottom to top in the second.
    let first = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let second = [Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X];
    let (colors, lights) = ([0.25, 0.75], [0.5, 2.0]);
    for (integrator, has_relief) in
        [(Integrator::Whitted, false), (Integrator::Path, false), (Integrator::Path, true)]
    {
        let mut build = scene().environment(1.0).with(|scene| scene.render.integrator = integrator);
        let mut of = |values: [f32; 2], uv| {
            let row = values.map(Vec3::splat);
            let number = build.texture(&[&row], TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE);
            build.image_mut(number).uv = uv;
            number
        };
        let [color, light] = [of(colors, UvSet::First), of(lights, UvSet::Second)];
        let flat =
            build.texture(&[&[Vec3::new(0.5, 0.5, 1.0)]], TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE);
        let material = Material {
            kind: MaterialKind::Phong(PhongParameters {
                diffuse: ColorSource::Texture(color),
                specular: ColorSource::Constant(Vec3::ZERO),
                shininess: 1.0,
                ambient: None,
                diffuse_transmission: ColorSource::BLACK,
            }),
            emission: EmissionSource { texture: Some(light), ..EmissionSource::from_constant(Vec3::ONE) },
            normal_map: has_relief.then_some(NormalMap { texture: flat, strength: 1.0 }),
            ..matte(0.5)
        };
        let build = build.mesh(wall(&first, &second), super::scenes::IDENTITY_PLACEMENT, material);
        for (column, row) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let at = v(f64::from(column) - 0.5, f64::from(row) - 0.5, 0.0);
            let seen = build.clone().seen(at + v(0.1, 0.2, 2.0), at);
            let exact = f64::from(colors[column as usize]) + f64::from(lights[row as usize]);
            assert_mean(
                &format!("{integrator:?} {has_relief} {column} {row}"),
                &seen.values(64, 32),
                exact,
                2.5e-4,
            );
        }
    }
}
