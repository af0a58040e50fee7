//! Many lights: sampling a subset matches the sum of all lights.

use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::ViewMode;
use glimt::lights::LightSamplingPurpose;
use glimt::math::random::TestRandom;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::{DirectionalLight, Falloff, PointLight, SpotLight};
use glimt::scene::description::{Light, ShadowMode, Shape};

use super::global::path_traced;
use super::scenes::{
    Build, IDENTITY_PLACEMENT, emitter, glass, lat_long_sphere, matte, mirror, phong, scene,
};
use super::{assert_mean, assert_same_mean, mean_and_error, v};

/// Adds so many nearly black lights that each vertex samples only a subset of the lights. Black lights would
/// be removed.
fn with_dark_lights(build: Build) -> Build {
    (0..33).fold(build, |build, i| build.point_light(v(f64::from(i), 3.0, 0.0), 1e-20, Falloff::Square))
}

/// [`assert_same_mean`] for the means of two images over seeds.
#[track_caller]
fn assert_same(what: &str, a: &Build, b: &Build, (samples, seeds): (u32, u32), max_relative_error: f64) {
    let means = |build: &Build| -> Vec<f64> {
        let mean = |picture: &Vec<DVec3>| {
            picture.iter().map(|c| c.element_sum() / 3.0).sum::<f64>() / picture.len() as f64
        };
        build.pictures(samples, 0..seeds).iter().map(mean).collect()
    };
    assert_same_mean(what, mean_and_error(&means(a)), mean_and_error(&means(b)), max_relative_error);
}

/// A small image of a floor with objects. The camera is below the lights, because edges of visible lights
/// would dominate the noise.
fn room(floor: glimt::scene::description::Material) -> Build {
    scene()
        .quad(v(-4.0, 0.0, 4.0), v(8.0, 0.0, 0.0), v(0.0, 0.0, -8.0), floor)
        .cuboid(v(-0.8, 0.5, 0.0), v(0.8, 1.0, 0.8), v(0.0, 20.0, 0.0), matte(0.6))
        .sphere(v(0.7, 0.4, 0.3), 0.4, phong(0.3, 0.5, 40.0, 0.0))
        .pictured(v(0.0, 1.3, 3.2), DVec3::ZERO, 30.0, 12, 12)
}

/// At least one light of each kind, at most 32 in total.
fn every_kind(build: Build) -> Build {
    let at = v(1.5, 1.5, 1.0);
    let shaped = build
        .quad(v(-1.5, 2.0, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.2, 1.0), emitter(2.0))
        .sphere(v(1.5, 1.2, -0.6), 0.2, emitter(6.0))
        .cuboid(v(-2.0, 1.0, 0.8), v(0.3, 0.5, 0.3), v(0.0, 30.0, 10.0), emitter(3.0))
        .triangle([v(0.0, 2.6, 0.0), v(0.2, 2.6, 0.6), v(0.7, 2.5, 0.0)], emitter(8.0))
        .shape(Shape::Disk { center: at, normal: v(-1.0, -1.0, -0.6), radius: 0.3 }, emitter(4.0))
        .mesh(lat_long_sphere(6, 8, 0.3, v(0.3, 1.6, -1.2)), IDENTITY_PLACEMENT, emitter(3.0))
        .mesh(lat_long_sphere(3, 4, 0.2, v(-0.4, 1.8, 1.2)), IDENTITY_PLACEMENT, emitter(3.0))
        .environment(0.1)
        .point_light(v(0.5, 2.2, 1.5), 1.0, Falloff::Square)
        .point_light(v(-1.5, 2.2, 1.5), 0.2, Falloff::None);
    shaped.with(|scene| {
        let point = |position, intensity: f32| PointLight {
            position,
            intensity: Vec3::splat(intensity),
            falloff: Falloff::Square,
        };
        let spot =
            SpotLight { point: point(v(2.0, 3.0, 0.0), 9.0), look_at: DVec3::ZERO, angle: 40.0, blend: 0.3 };
        let sun = |angle, irradiance: f32| DirectionalLight {
            direction: v(-0.5, -1.0, -0.3),
            irradiance: Vec3::splat(irradiance),
            angle,
        };
        scene.lights.extend([
            Light::Spot(spot),
            Light::Directional(sun(0.0, 0.3)),
            Light::Directional(sun(20.0, 0.3)),
        ]);
    })
}

#[test]
fn every_light_kind_matches_the_full_sum() {
    let build = every_kind(room(phong(0.4, 0.3, 200.0, 0.0)));
    let picked = with_dark_lights(build.clone());
    assert!(
        build.world().lights.sampler_for_purpose(LightSamplingPurpose::Eye).is_none()
            && picked.world().lights.sampler_for_purpose(LightSamplingPurpose::Eye).is_some()
    );
    for (shadows, samples) in
        [(ShadowMode::Soft, 1), (ShadowMode::Soft, 2), (ShadowMode::Hard, 1), (ShadowMode::Off, 1)]
    {
        let [all, some] = [&build, &picked].map(|build| build.clone().shadows(shadows, samples));
        assert_same(&format!("whitted, {shadows:?}"), &some, &all, (16, 16), 4e-3);
    }
    for depth in [1, 3] {
        let [all, some] = [&build, &picked].map(|build| path_traced(build.clone(), depth));
        assert_same(&format!("path, depth {depth}"), &some, &all, (64, 24), 6e-3);
    }
    for view in [ViewMode::Specular, ViewMode::Diffuse] {
        let [all, some] = [&build, &picked].map(|build| build.clone().viewed(view));
        assert_same(&format!("{view:?}"), &some, &all, (16, 16), 1e-2);
    }
}

#[test]
fn lights_in_glass_match_the_full_sum() {
    let build = every_kind(room(matte(0.5)).sphere(v(0.0, 0.5, 1.6), 0.5, glass(1.5))).quad(
        v(-2.0, 0.0, -2.5),
        v(4.0, 0.0, 0.0),
        v(0.0, 2.0, 0.0),
        mirror(0.8),
    );
    let picked = with_dark_lights(build.clone());
    assert_same("whitted", &picked, &build, (32, 16), 2e-3);
    assert_same("path", &path_traced(picked, 4), &path_traced(build, 4), (32, 24), 6e-3);
}

/// A 2 × 2 area light above the floor, divided into `parts` × `parts` quads.
fn divided_light(build: Build, parts: u32) -> Build {
    let side = 2.0 / f64::from(parts);
    (0..parts * parts).fold(build, |build, i| {
        let corner = v(-1.0 + side * f64::from(i % parts), 2.0, -1.0 + side * f64::from(i / parts));
        build.quad(corner, v(side, 0.0, 0.0), v(0.0, 0.0, side), emitter(2.0))
    })
}

#[test]
fn divided_light_matches_whole_light() {
    for (what, floor, noise) in [("matte", matte(0.7), 1.0), ("sharp", phong(0.2, 0.6, 300.0, 0.0), 2.5)] {
        let [whole, cut] = [1, 32].map(|parts| divided_light(room(floor.clone()), parts));
        assert_same(&format!("whitted, {what}"), &cut, &whole, (64, 16), 3e-3 * noise);
        assert_same(
            &format!("path, {what}"),
            &path_traced(cut, 3),
            &path_traced(whole, 3),
            (64, 24),
            6e-3 * noise,
        );
    }
}

/// Lobe samples find most of the light. At each vertex, each of the thousand lights is sampled with a
/// probability of about 1/30.
#[test]
fn divided_light_keeps_sharp_highlight() {
    let floor = phong(0.0, 0.8, 300.0, 0.0);
    let seen = scene()
        .quad(v(-4.0, 0.0, 4.0), v(8.0, 0.0, 0.0), v(0.0, 0.0, -8.0), floor)
        .seen(v(0.0, 1.5, 1.0), v(0.0, 0.0, 0.4));
    let [whole, cut] = [1, 32].map(|parts| divided_light(seen.clone(), parts));
    assert_same("whitted", &cut, &whole, (64, 16), 4e-3);
    assert_same("path", &path_traced(cut, 1), &path_traced(whole, 1), (64, 16), 4e-3);
}

/// Triangles above the floor whose sizes vary by a factor of 100. Most of them face down.
fn uneven_triangles(count: u32) -> Vec<[DVec3; 3]> {
    let mut random = TestRandom::new(4);
    let triangle = |i: u32| {
        let size = 0.004 * 10_f64.powf(2.0 * random.unit().powi(3));
        let place = v(random.signed() * 1.5, 2.0 + 0.3 * random.unit(), random.signed() * 1.5);
        let (a, b) = (random.direction() * size, random.direction() * size);
        let (a, b) = if (a.cross(b).y < 0.0) != i.is_multiple_of(5) { (a, b) } else { (b, a) };
        [place, place + a, place + b]
    };
    (0..count).map(triangle).collect()
}

#[test]
fn mesh_light_matches_separate_triangles() {
    let triangles = uneven_triangles(3000);
    let rounded = |corner: DVec3| corner.as_vec3().as_dvec3();
    let alone = triangles
        .iter()
        .fold(room(matte(0.7)), |build, corners| build.triangle(corners.map(rounded), emitter(20.0)));
    let mesh = TriangleMesh {
        positions: triangles.iter().flatten().map(|corner| corner.as_vec3()).collect(),
        triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..TriangleMesh::default()
    };
    let mesh = room(matte(0.7)).mesh(mesh, IDENTITY_PLACEMENT, emitter(20.0));
    assert!(
        mesh.world().lights.sampler_for_purpose(LightSamplingPurpose::Eye).is_none(),
        "a mesh must be a single light"
    );
    assert_same("whitted", &mesh.clone().shadows(ShadowMode::Soft, 8), &alone, (32, 16), 3e-3);
    assert_same("path", &path_traced(mesh, 2), &path_traced(alone, 2), (32, 24), 6e-3);
}

#[test]
fn hundred_point_lights_match_their_sum() {
    // E = Σ I·cos/d² and L = ρ·E/π. Only the choice of lights is random.
    let mut random = TestRandom::new(9);
    let places: Vec<DVec3> =
        (0..100).map(|_| v(random.signed() * 2.0, 1.0 + random.unit(), random.signed() * 2.0)).collect();
    let floor = scene().quad(v(-4.0, 0.0, 4.0), v(8.0, 0.0, 0.0), v(0.0, 0.0, -8.0), matte(0.7));
    let floor = floor.seen(v(0.1, 0.5, 0.2), DVec3::ZERO);
    let lit = places.iter().fold(floor, |build, &place| build.point_light(place, 0.5, Falloff::Square));
    let exact: f64 =
        places.iter().map(|d| 0.5 * d.y / d.length().powi(3)).sum::<f64>() * 0.7 / std::f64::consts::PI;
    for (what, build) in [("whitted", lit.clone()), ("path", path_traced(lit, 1))] {
        // Where the tree examines every light, the selection probability is proportional to irradiance, which
        // leaves hardly any noise.
        assert_mean(what, &build.values(4, 64), exact, 1e-3 / 8.0);
    }
}
