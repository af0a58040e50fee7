//! Photon emission from textured lights, mesh lights, and environment maps.

use super::*;
use crate::lights::infinite::MapOrientation;

/// An irregular texture with black areas and bright spots.
fn patchy(width: u32, height: u32) -> Arc<Texels> {
    let color = |(x, y): (u32, u32)| {
        let random = (x.wrapping_mul(7919).wrapping_add(y.wrapping_mul(104_729)) >> 3) % 97;
        match random {
            0..40 => Vec3::ZERO,
            90.. => Vec3::new(10.0, 20.0, 15.0),
            _ => Vec3::new(random as f32, 60.0, 97.0 - random as f32) / 97.0,
        }
    };
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    Arc::new(Texels { width, height, data: TexelData::Float(places.map(color).collect()), unusable: 0 })
}

fn texture(width: u32, height: u32, filter: TextureFilter) -> Arc<Texture> {
    let texels = patchy(width, height);
    let (wrap, repeat) = (Wrap::Repeat, Vec2::new(1.0, 2.0));
    let mapping = TextureMapping { repeat, moved: None };
    Arc::new(Texture::Image(ImageTexture { texels, mipmaps: None, filter, wrap, mapping, factor: None }))
}

/// A light with a texture.
fn textured(light: AreaLight, texture: &Arc<Texture>, chart: UvMapping) -> Light {
    Light::Area(AreaLight {
        modulation: EmissionModulation::new(Some(texture), None, chart).map(Box::new),
        ..light
    })
}

#[test]
fn textured_emission_matches_light_sampling() {
    for shape in shapes() {
        let light = new_front_area_light(&shape, COLOR, OBJECT).expect("an area");
        let light =
            textured(light, &texture(16, 8, TextureFilter::Bilinear), UvMapping::Shape(shape.clone()));
        let source = source_of(light.clone(), Some(&shape));
        assert_same_irradiance(&format!("{shape:?}"), &light, &source, Some(&shape));
        let told = f64::from(source.total_light_power().y);
        let is_accurate = |found: &MeanEstimate| found.error < ACCURATE * 5e-3 * told;
        let found = mean_until(&source, 1 << 14, |photon| f64::from(photon.flux.y), is_accurate);
        assert!(
            found.error < 5e-3 * told && (found.mean / told - 1.0).abs() < 0.02,
            "{found:?} instead of {told}"
        );
    }
}

#[test]
fn quad_power_is_the_mean_of_its_texture() {
    let (shape, texels) = (shapes()[1].clone(), patchy(32, 16));
    let light = new_front_area_light(&shape, COLOR, OBJECT).expect("an area");
    let light = textured(light, &texture(32, 16, TextureFilter::Nearest), UvMapping::Shape(shape.clone()));
    let exact = texels.mean().as_dvec3() * COLOR.as_dvec3() * PI * shape.local_part_areas()[0];
    let source = source_of(light, Some(&shape));
    assert!(
        (source.total_light_power().as_dvec3() / exact - 1.0).abs().max_element() < 1e-4,
        "{}",
        source.total_light_power()
    );
    let found = mean(&source, 1 << 14, |photon| f64::from(photon.flux.x));
    assert!(found.error < 1e-3 * exact.x && (found.mean - exact.x).abs() < 5.0 * found.error, "{found:?}");
}

/// The triangles of a curved sheet after a transform, with their UV coordinates.
fn sheet(side: u32) -> Vec<TriangleWithUvs> {
    let transform = Transform::scale_rotate_translate(
        DVec3::new(0.5, -1.5, 0.8),
        DVec3::new(30.0, -50.0, 80.0),
        DVec3::new(-0.1, 0.2, 0.3),
    );
    let at = |i: u32, j: u32| {
        let (x, y) = (f64::from(i) / f64::from(side), f64::from(j) / f64::from(side));
        (transform.point(DVec3::new(x, y * y, 0.3 * x * x - 0.2 * y)), Vec2::new(x as f32, y as f32))
    };
    let cells = (0..side).flat_map(|j| (0..side).map(move |i| (i, j)));
    let corners = cells.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    // Every other triangle belongs to a different light.
    let patch = |(number, corners): (u32, [(DVec3, Vec2); 3])| TriangleWithUvs {
        primitive: number * 2 + 1,
        corners: corners.map(|(point, _)| point),
        uvs: corners.map(|(_, uv)| uv),
        second_uvs: None,
    };
    (0..).zip(corners).map(patch).collect()
}

#[test]
fn mesh_emission_matches_light_sampling() {
    for (side, is_textured) in [(2, false), (12, false), (2, true), (12, true)] {
        let patches = sheet(side);
        let mesh = MeshEmitter::new(
            patches.iter().map(|patch| (patch.corners, patch.primitive)).collect(),
            &CancelToken::new(),
        )
        .expect("never canceled");
        let mesh = mesh.expect("an area");
        let bounds = mesh.light_bounds();
        let light = AreaLight {
            side: Side::Front,
            shape: Emitter::Mesh(mesh),
            radiance: COLOR,
            modulation: None,
            object: OBJECT,
            part: EmittingPart::Listed,
            bounds,
        };
        let area_of = |TriangleWithUvs { corners: [a, b, c], .. }: &TriangleWithUvs| {
            0.5 * (*b - *a).cross(*c - *a).length()
        };
        let area: f64 = patches.iter().map(area_of).sum();
        let light = if is_textured {
            textured(light, &texture(16, 8, TextureFilter::Bilinear), UvMapping::Triangles(patches))
        } else {
            Light::Area(light)
        };
        let lights = Arc::new(Lights::new(vec![light.clone()], &CancelToken::new()).expect("never canceled"));
        let source =
            PhotonEmitter::new(&lights, |_| Some(EmissiveObjectGeometry::Mesh { rounding: 1e-6 }), SCENE);
        let source = source.expect("power");
        assert_same_irradiance(&format!("mesh {side} {is_textured}"), &light, &source, None);
        if !is_textured {
            let exact = COLOR.as_dvec3() * area * PI;
            assert!((source.total_light_power().as_dvec3() / exact - 1.0).abs().max_element() < 1e-5);
        }
    }
}

#[test]
fn environment_emission_matches_light_sampling() {
    let sky = Arc::new(EnvironmentMap::new(patchy(24, 12)).expect("light"));
    let light =
        Light::Environment(Environment::from_map(sky, COLOR, MapOrientation::from_azimuth_degrees(77.0)));
    let source = source_of(light.clone(), None);
    let found = mean(&source, 1 << 14, |photon| f64::from(photon.flux.y));
    let told = f64::from(source.total_light_power().y);
    assert!(found.error < 1e-3 * told && (found.mean - told).abs() < 5.0 * found.error, "{found:?} {told}");
    assert_same_irradiance("map", &light, &source, None);
}
