use std::f64::consts::TAU;
use std::sync::LazyLock;

use super::*;
use crate::control::CancelToken;
use crate::geometry::cone::Cone;
use crate::geometry::cuboid::OrientedBox;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::sphere::Sphere;
use crate::geometry::torus::Torus;
use crate::geometry::transformed::tests::{part_area_by_midpoint_rule, sheared};
use crate::geometry::triangle::Triangle;
use crate::lights::area::Side;
use crate::lights::delta::DeltaPositionLight;
use crate::lights::delta::SpotLight;
use crate::lights::infinite::sky::sun::OrientedSunDisk;
use crate::lights::infinite::sky::{Sky, SkyFrame, SkyModelInputs};
use crate::lights::infinite::{DirectionalLight, Environment, EnvironmentMap};
use crate::lights::{
    AreaLight, EmissionModulation, Emitter, EmittingPart, MeshEmitter, TriangleWithUvs, UvMapping,
    new_front_area_light,
};
use crate::materials::texels::{TexelData, Texels};
use crate::materials::texture::{ImageTexture, Texture, TextureFilter, TextureMapping, Wrap};
use crate::math::random;
use crate::math::transform::Transform;
use crate::sampling::{Dimension, PixelSampler};

mod textures;

const OBJECT: u32 = 0;
const SCENE: BoundingSphere = BoundingSphere { center: DVec3::new(0.5, 1.0, -0.5), radius: 5.0 };
const COLOR: Vec3 = Vec3::new(2.0, 1.0, 0.5);

/// Generates random numbers for photons.
fn numbers(mut next: impl FnMut() -> f32) -> impl FnMut() -> PhotonRandomNumbers {
    move || {
        let mut pair = || [next(), next()];
        PhotonRandomNumbers { light: pair(), aim: pair(), position: pair(), direction: pair() }
    }
}

fn shapes() -> Vec<Shape> {
    let (p, q) = (DVec3::new(0.3, -0.2, 0.1), DVec3::new(1.0, 0.5, -0.4));
    let bowl = Shape::Cone(Cone::new(p, q, 0.4, true));
    vec![
        Shape::Sphere(Sphere { center: p, radius: 0.7 }),
        Shape::Quad(Parallelogram::new(p, DVec3::X, q)),
        Shape::Box(OrientedBox::new(p, DVec3::new(1.0, 0.4, 2.0), DVec3::new(10.0, 70.0, -30.0))),
        Shape::Triangle(Triangle { a: p, b: q, c: DVec3::Y }),
        Shape::Disk(Disk::new(p, q, 0.6)),
        Shape::Cylinder(Cylinder::new(p, q, 0.5, true)),
        Shape::Cylinder(Cylinder::new(p, q, 0.5, false)),
        Shape::Cone(Cone::new(p, q, 0.4, true)),
        Shape::Cone(Cone::new(p, q, 0.4, false)),
        Shape::Torus(Torus::new(p, q, 1.0, 0.4)),
        sheared(Shape::Sphere(Sphere { center: p, radius: 0.7 }), 1.0),
        sheared(bowl, -1.0),
    ]
}

fn point(falloff: Falloff) -> PointLight {
    PointLight { position: DVec3::new(0.2, 1.5, 0.3), intensity: COLOR, falloff }
}

fn spot(degrees: f64, blend: f32) -> SpotLight {
    let axis = Vec3::new(0.48, -0.6, 0.64);
    SpotLight { point: point(Falloff::Square), axis, half_angle: (degrees / 2.0).to_radians() as f32, blend }
}

fn sun(degrees: f64) -> DirectionalLight {
    DirectionalLight::new(Vec3::new(-0.6, 0.64, -0.48), COLOR, degrees.to_radians())
}

/// Lights whose photons have different fluxes: a sky and its sun, with their powers in the green channel.
static SKY_LIGHTS: LazyLock<Vec<(Light, Option<Shape>, f64)>> = LazyLock::new(sky_lights);

fn sky_lights() -> Vec<(Light, Option<Shape>, f64)> {
    let (disk, mut all) = (PI * SCENE.radius * SCENE.radius, Vec::new());
    let (sky, sun) = sky_and_sun();
    for (light, one_minus_cos) in [(sky, 2.0), (sun, 1.0 - 5_f64.to_radians().cos())] {
        let radiance = |direction: Vec3| match &light {
            Light::Environment(sky) => sky.radiance_and_pdf(direction).0.y,
            Light::Directional(sun) => sun.radiance(direction).y,
            Light::Point(_) | Light::Spot(_) | Light::Area(_) => 0.0,
        };
        // A grid over the directions within an angle of the sun.
        let (n, to_sun) = (400, DVec3::new(-0.6, 0.8, 0.0));
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        let sum: f64 = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| {
                let (cos, (sin, azimuth)) = (1.0 - one_minus_cos * at(i), (TAU * at(j)).sin_cos());
                let side = DVec3::new(0.8, 0.6, 0.0) * sin + DVec3::Z * azimuth;
                f64::from(radiance((to_sun * cos + side * (1.0 - cos * cos).sqrt()).as_vec3()))
            })
            .sum();
        all.push((light, None, disk * TAU * one_minus_cos * sum / f64::from(n * n)));
    }
    all
}

/// A sky, and its sun with a diameter of 10°.
fn sky_and_sun() -> (Light, Light) {
    let parameters = SkyModelInputs {
        sun_elevation: 0.8_f64.asin(),
        turbidity: 3.0,
        ground: Vec3::splat(0.3),
        sun_angle: 10_f64.to_radians(),
        sun_scale: 1.0,
        sky_scale: 1.0,
        ground_scale: 1.0,
    };
    let (sky, frame) = (Sky::new(&parameters), SkyFrame::new(DVec3::new(-0.6, 0.8, 0.0), DVec3::Y));
    let disk = OrientedSunDisk { disk: sky.sun.expect("a sun"), up: Vec3::Y };
    let dome = Environment::Sky { dome: sky.dome.expect("a sky"), frame };
    (Light::Environment(dome), Light::Directional(DirectionalLight::from_sun(frame.sun(), disk)))
}

/// Lights with their shapes and their powers relative to [`COLOR`].
static LIGHTS: LazyLock<Vec<(Light, Option<Shape>, f64)>> = LazyLock::new(lights);

fn lights() -> Vec<(Light, Option<Shape>, f64)> {
    let disk = PI * SCENE.radius * SCENE.radius;
    let mut all = vec![(Light::Point(point(Falloff::Square)), None, 4.0 * PI)];
    for (degrees, blend) in
        [(40.0_f64, 0.0), (40.0, 0.2), (90.0, 1.0), (1.0, 0.5), (300.0, 0.7), (360.0, 1.0)]
    {
        // Evaluate 2π∫ share·sin θ dθ with the midpoint rule.
        let (half, n) = ((degrees / 2.0).to_radians(), 200_000);
        let blend_of =
            |angle: f64| if blend > 0.0 { ((half - angle) / (half * blend)).min(1.0) } else { 1.0 };
        let step = |i: u32| half * (f64::from(i) + 0.5) / f64::from(n);
        let sum: f64 = (0..n).map(|i| blend_of(step(i)) * step(i).sin()).sum();
        all.push((Light::Spot(spot(degrees, blend as f32)), None, TAU * sum * half / f64::from(n)));
    }
    for degrees in [0.0_f64, 0.53, 40.0] {
        // Radiance E/(π sin²(α/2)) over 2π(1 − cos(α/2)) sr.
        let (sin, quarter) = ((degrees / 2.0).to_radians().sin(), (degrees / 4.0).to_radians().sin());
        let factor = if degrees > 0.0 { 4.0 * quarter * quarter / (sin * sin) } else { 1.0 };
        all.push((Light::Directional(sun(degrees)), None, disk * factor));
    }
    all.push((Light::Environment(Environment::Constant(COLOR)), None, 4.0 * PI * disk));
    for shape in shapes() {
        let light = new_front_area_light(&shape, COLOR, OBJECT).expect("an area");
        let parts = 0..shape.local_part_areas().len() as u32;
        let area: f64 = parts
            .map(|part| {
                if shape.local_part_areas()[part as usize] > 0.0 {
                    part_area_by_midpoint_rule(&shape, part)
                } else {
                    0.0
                }
            })
            .sum();
        all.push((Light::Area(light), Some(shape), PI * area));
    }
    all
}

fn source_of(light: Light, shape: Option<&Shape>) -> PhotonEmitter {
    let lights = Arc::new(Lights::new(vec![light], &CancelToken::new()).expect("never canceled"));
    PhotonEmitter::new(&lights, |_| shape.cloned().map(EmissiveObjectGeometry::Shape), SCENE).expect("power")
}

/// A mean and its standard error.
#[derive(Clone, Copy, Debug)]
struct MeanEstimate {
    mean: f64,
    error: f64,
}

impl MeanEstimate {
    /// Mean and standard error, from the means of independently scrambled groups.
    fn of(groups: &[f64]) -> Self {
        let n = groups.len() as f64;
        let mean = groups.iter().sum::<f64>() / n;
        let variance = groups.iter().map(|one| (one - mean) * (one - mean)).sum::<f64>() / (n - 1.0);
        Self { mean, error: (variance / n).sqrt() }
    }
}

const GROUPS: u32 = 32;

/// Estimates the mean of `one` over groups and over sample numbers. Doubles the number of samples per group
/// until the estimate is accurate, from 1024 to at most `max_count`.
fn estimate_mean(
    max_count: u32,
    one: impl Fn(u32, u32) -> f64,
    is_accurate: impl Fn(&MeanEstimate) -> bool,
) -> MeanEstimate {
    let (mut sums, mut counts) = ([0.0; GROUPS as usize], 0..max_count.min(1024));
    loop {
        for (sum, group) in sums.iter_mut().zip(0..) {
            *sum += counts.clone().map(|i| one(group, i)).sum::<f64>();
        }
        let estimate = MeanEstimate::of(&sums.map(|sum| sum / f64::from(counts.end)));
        if counts.end >= max_count || is_accurate(&estimate) {
            return estimate;
        }
        counts = counts.end..2 * counts.end;
    }
}

/// Computes the mean of a function over photons, with at most `max_count` photons per group. Attempts that do
/// not produce a photon count as 0.
fn mean_until(
    source: &PhotonEmitter,
    max_count: u32,
    of: impl Fn(&EmittedPhoton) -> f64,
    is_accurate: impl Fn(&MeanEstimate) -> bool,
) -> MeanEstimate {
    let one = |group: u32, i: u32| {
        let sampler = PixelSampler::new(3, group, 5, i);
        let pair = |k: u32| sampler.pair(1, Dimension::Light(k)).to_array();
        let u = PhotonRandomNumbers { light: pair(0), aim: pair(1), position: pair(2), direction: pair(3) };
        source.emit(&u).map_or(0.0, |photon| of(&photon))
    };
    estimate_mean(max_count, one, is_accurate)
}

/// Computes the mean of a function over `count` photons per group.
fn mean(source: &PhotonEmitter, count: u32, of: impl Fn(&EmittedPhoton) -> f64) -> MeanEstimate {
    mean_until(source, count, of, |_| false)
}

/// The fraction of a bound on the standard error at which enough samples were taken.
const ACCURATE: f64 = 0.5;

/// Photon targets: a distant sphere, two overlapping spheres, and a sphere that contains most lights.
fn targets() -> [BoundingSphere; 4] {
    let ball = |x: f64, y: f64, z: f64, radius: f64| BoundingSphere { center: DVec3::new(x, y, z), radius };
    [ball(3.0, 2.0, 1.0, 0.3), ball(-2.0, 1.0, 0.5, 0.8), ball(-2.5, 0.5, 0.5, 0.6), ball(0.2, 1.0, 0.2, 0.9)]
}

#[test]
fn mean_flux_equals_power_for_any_aimed_fraction() {
    for (light, shape, power) in LIGHTS.iter().chain(&*SKY_LIGHTS) {
        let (light, power) = (light.clone(), *power);
        let plain = source_of(light.clone(), shape.as_ref());
        for (targets, share) in [(&targets()[..], 0.5), (&targets()[..3], 0.9), (&targets()[..1], 0.3)] {
            let source = plain.clone().with_targets(targets, share);
            assert_eq!(source.aimed_probability(), share);
            let exact = power;
            let greatest_error = if share > 0.5 { 3e-3 } else { 1e-3 };
            let is_accurate = |found: &MeanEstimate| found.error < ACCURATE * greatest_error * exact;
            let found = mean_until(&source, 1 << 14, |photon| f64::from(photon.flux.y), is_accurate);
            assert!(found.error < greatest_error * exact, "{light:?} {share}: ± {}", found.error / exact);
            let off = (found.mean - exact).abs();
            assert!(off < 5.0 * found.error + 1e-4 * exact, "{light:?} {share}: {found:?}, not {exact}");
        }
    }
}

/// A disk that photons pass through.
const DISK: BoundingSphere = BoundingSphere { center: DVec3::new(1.6, 1.2, 1.4), radius: 0.2 };

fn disk_normal() -> DVec3 {
    (DVec3::new(0.1, 0.8, 0.1) - DISK.center).normalize()
}

/// A photon's contribution to the irradiance on the front of the disk.
fn disk_contribution(photon: &EmittedPhoton, shape: Option<&Shape>) -> f64 {
    let (ray, normal) = (photon.ray().to_f64(), disk_normal());
    let t = (DISK.center - ray.origin).dot(normal) / ray.direction.dot(normal);
    let at = ray.at(t);
    let is_met = t > 0.0 && ray.direction.dot(normal) < 0.0 && (at - DISK.center).length() < DISK.radius;
    // A torus may occlude itself.
    let is_free = || shape.and_then(|shape| shape.intersect(&ray)).is_none_or(|hit| f64::from(hit.t) > t);
    let area = PI * DISK.radius * DISK.radius;
    if is_met && is_free() { f64::from(photon.flux.y) / area } else { 0.0 }
}

/// Estimates the irradiance on the disk with light samples, up to a relative standard error.
fn sampled(light: &Light, max_error: f64) -> MeanEstimate {
    let normal = disk_normal().as_vec3();
    let Frame { s, t, .. } = Frame::from_normal(normal);
    let one = |group: u32, i: u32| {
        let sampler = PixelSampler::new(4, group, 5, i);
        let at = warp::disk(sampler.pair(1, Dimension::Lens)) * DISK.radius as f32;
        let from = DISK.center.as_vec3() + s * at.x + t * at.y;
        let sample = light.sample(from, normal, sampler.pair(1, Dimension::Light(0)).to_array());
        sample.map_or(0.0, |sample| f64::from(sample.weight.y * sample.direction.dot(normal).max(0.0)))
    };
    estimate_mean(1 << 12, one, |found| found.error < max_error * found.mean)
}

#[track_caller]
fn assert_same_irradiance(name: &str, light: &Light, source: &PhotonEmitter, shape: Option<&Shape>) {
    let greatest_error = if light.emission_modulation().is_some() { 5e-3 } else { 3e-3 };
    let expected = sampled(light, 0.3 * greatest_error);
    assert!(expected.mean > 0.0, "{name}");
    let around = BoundingSphere { radius: DISK.radius * 1.001, ..DISK };
    let beside = BoundingSphere { center: DISK.center + DVec3::new(0.1, 0.0, 0.05), radius: 0.15 };
    let others = [around, beside, BoundingSphere { center: DVec3::new(-1.0, 2.0, 1.0), radius: 0.05 }];
    let ways = [(0.0, 1 << 13, 0.12), (0.9, 1 << 14, greatest_error)];
    for (share, count, greatest_error) in ways {
        let source = source.clone().with_targets(&others, share);
        let is_accurate = |found: &MeanEstimate| {
            found.error.hypot(expected.error) < ACCURATE * greatest_error * expected.mean
        };
        let found = mean_until(&source, count, |photon| disk_contribution(photon, shape), is_accurate);
        let error = found.error.hypot(expected.error);
        let ratio = found.mean / expected.mean;
        println!("{name:.40} {share}: {ratio:.5} ± {:.5}", error / expected.mean);
        assert!(error < greatest_error * expected.mean, "{name}: ± {}", error / expected.mean);
        let off = found.mean - expected.mean;
        assert!(off.abs() < 5.0 * error + 1e-4 * expected.mean, "{name}: {found:?} instead of {expected:?}");
    }
}

#[test]
fn photon_irradiance_matches_light_sampling() {
    for (light, shape, _) in LIGHTS.iter().chain(&*SKY_LIGHTS) {
        if matches!(light, Light::Spot(_)) {
            continue;
        }
        let source = source_of(light.clone(), shape.as_ref());
        assert_same_irradiance(&format!("{light:?}"), light, &source, shape.as_ref());
    }
    // Aim spotlights to put the disk in the fading part of the cone.
    for (degrees, blend) in [(70.0_f64, 0.0), (40.0, 0.9), (200.0, 1.0)] {
        let point = point(Falloff::Square);
        let axis = (DISK.center + DVec3::new(0.1, 0.2, -0.1) - point.position).normalize().as_vec3();
        let light =
            Light::Spot(SpotLight { point, axis, half_angle: (degrees / 2.0).to_radians() as f32, blend });
        let source = source_of(light.clone(), None);
        assert_same_irradiance(&format!("{light:?}"), &light, &source, None);
    }
}

#[test]
fn photons_from_one_light_carry_its_power() {
    // The flux of photons from transformed shapes varies.
    let is_transformed = |shape: &Option<Shape>| matches!(shape, Some(Shape::Transformed(_)));
    for (light, shape, power) in LIGHTS.iter().filter(|(_, shape, _)| !is_transformed(shape)) {
        let source = source_of(light.clone(), shape.as_ref());
        let power = COLOR.as_dvec3() * *power;
        let told = source.total_light_power().as_dvec3();
        assert!((told / power - 1.0).abs().max_element() < 1e-5, "{light:?}: {told} instead of {power}");
        let mut next = numbers(random::unit_generator(1));
        for _ in 0..1000 {
            let photon = source.emit(&next()).expect("a photon");
            let off = (photon.flux.as_dvec3() / power - 1.0).abs().max_element();
            // All photons have the same flux because parts of a shape are chosen in proportion to their area.
            assert!(off < 1e-5, "{light:?}: {}", photon.flux);
            assert!((photon.direction.length() - 1.0).abs() < 1e-6, "{light:?}");
        }
    }
}

#[test]
fn photons_leave_convex_lights() {
    for shape in shapes() {
        let is_open = shape.local_part_areas().last() == Some(&0.0);
        if is_open || matches!(shape, Shape::Torus(_)) {
            continue;
        }
        let light = Light::Area(new_front_area_light(&shape, COLOR, OBJECT).expect("an area"));
        let source = source_of(light, Some(&shape));
        let mut next = numbers(random::unit_generator(2));
        for _ in 0..20_000 {
            let photon = source.emit(&next()).expect("a photon");
            let PhotonOrigin::Surface { normal, .. } = photon.start else { panic!("{photon:?}") };
            assert!(photon.direction.dot(normal) > 0.0);
            assert_eq!(shape.intersect(&photon.ray().to_f64()), None, "{shape:?}: {photon:?}");
        }
    }
}

/// χ² test of counts in cells with equal expected counts.
#[track_caller]
fn assert_uniform(name: &str, counts: &[u32]) {
    let freedom = (counts.len() - 1) as f64;
    let expected = f64::from(counts.iter().sum::<u32>()) / counts.len() as f64;
    let chi2: f64 = counts.iter().map(|&count| (f64::from(count) - expected).powi(2) / expected).sum();
    // Wilson–Hilferty approximation.
    let z = ((chi2 / freedom).cbrt() - (1.0 - 2.0 / (9.0 * freedom))) / (2.0 / (9.0 * freedom)).sqrt();
    assert!(z.abs() < 4.5, "{name}: χ² {chi2} with {freedom} degrees of freedom, z {z}");
}

/// Index of the cell that contains `share` if [0, 1] is divided into `n` equal cells.
fn cell(share: f64, n: usize) -> usize {
    ((share * n as f64) as usize).min(n - 1)
}

#[test]
fn photon_directions_follow_the_intensity() {
    let count = 400_000;
    for shape in shapes() {
        let light = Light::Area(new_front_area_light(&shape, COLOR, OBJECT).expect("an area"));
        let source = source_of(light, Some(&shape));
        let (mut next, mut counts) = (numbers(random::unit_generator(3)), [0; 256]);
        for _ in 0..count {
            let photon = source.emit(&next()).expect("a photon");
            let PhotonOrigin::Surface { normal, .. } = photon.start else { panic!("{photon:?}") };
            let Frame { s, t, n } = Frame::from_normal(normal);
            let (x, y, z) = [s, t, n].map(|axis| f64::from(photon.direction.dot(axis))).into();
            let turn = y.atan2(x) / TAU + 0.5;
            // sin² is uniformly distributed.
            counts[cell(1.0 - z * z, 16) * 16 + cell(turn, 16)] += 1;
        }
        assert_uniform(&format!("{shape:?}"), &counts);
    }
    for (degrees, blend) in [(40.0, 0.0), (40.0, 0.2), (90.0, 1.0), (1.0, 0.5), (300.0, 0.7), (360.0, 1.0)] {
        let spot = spot(degrees, blend);
        let half = f64::from(spot.half_angle);
        let n = 100_000;
        // Cumulative sums of share·sin θ.
        let mut sums = vec![0.0];
        for i in 0..n {
            let angle = half * (f64::from(i) + 0.5) / f64::from(n);
            let fade = f64::from(blend) * half;
            let share = if half - angle < fade { (half - angle) / fade } else { 1.0 };
            sums.push(sums[i as usize] + share * angle.sin());
        }
        let source = source_of(Light::Spot(spot), None);
        let (mut next, mut counts) = (numbers(random::unit_generator(4)), [0; 256]);
        for _ in 0..count {
            let photon = source.emit(&next()).expect("a photon");
            let Frame { s, t, .. } = Frame::from_normal(spot.axis);
            let (x, y) = (photon.direction.dot(s), photon.direction.dot(t));
            let angle = 2.0 * ((f64::from((photon.direction - spot.axis).length()) * 0.5).min(1.0)).asin();
            let at = (angle / half * f64::from(n)).min(f64::from(n));
            let below = at as usize;
            let above = (below + 1).min(sums.len() - 1);
            let sum = sums[below] + (sums[above] - sums[below]) * at.fract();
            let turn = f64::from(y.atan2(x)) / TAU + 0.5;
            counts[cell(sum / sums[sums.len() - 1], 16) * 16 + cell(turn, 16)] += 1;
        }
        assert_uniform(&format!("spotlight with {degrees}°, blend {blend}"), &counts);
    }
}

#[test]
fn photons_from_infinity_fill_the_disk() {
    for light in [Light::Directional(sun(0.0)), Light::Environment(Environment::Constant(COLOR))] {
        let source = source_of(light, None);
        let (mut next, mut counts) = (numbers(random::unit_generator(5)), [0; 64]);
        for _ in 0..100_000 {
            let photon = source.emit(&next()).expect("a photon");
            let PhotonOrigin::Beyond(start) = photon.start else { panic!("{photon:?}") };
            let from_center = start.as_dvec3() - SCENE.center;
            let direction = photon.direction.as_dvec3();
            assert!((from_center.dot(direction) + SCENE.radius).abs() < 1e-5);
            let flat = from_center - direction * from_center.dot(direction);
            let Frame { s, t, .. } = Frame::from_normal(photon.direction);
            let turn = flat.dot(t.as_dvec3()).atan2(flat.dot(s.as_dvec3())) / TAU + 0.5;
            let share = flat.length_squared() / (SCENE.radius * SCENE.radius);
            counts[cell(share, 8) * 8 + cell(turn, 8)] += 1;
        }
        assert_uniform("disk", &counts);
    }
}

#[test]
fn aimed_pdfs_integrate_to_one() {
    let (spot, from) = (spot(100.0, 0.5), point(Falloff::Square).position);
    let all = targets();
    let lights: [&dyn DeltaPositionLight; 2] = [&point(Falloff::Square), &spot];
    let [everywhere, cone] =
        lights.map(|light| EmissionProfile::Light { light, spread: light.effective_solid_angle() });
    let sends = [everywhere, cone, EmissionProfile::Front(DVec3::new(0.0, 0.6, 0.8))];
    for sends in sends {
        for balls in [&all[..3], &all[..], &all[..1]] {
            let targets = PhotonTargets::new(balls).expect("targets");
            let view = targets.view_from(from, &sends);
            // Integrate the aimed pdf (the ratio times the emission pdf) over all directions. The integral
            // excludes directions without emission, so estimate their fraction among aimed photons by
            // sampling.
            let n = 1_000_000;
            let mut whole = 0.0;
            for i in 0..n {
                let u =
                    [(i as f32 + 0.5) / n as f32, ((f64::from(i) * 0.618_033_988_749_894_8).fract()) as f32];
                let direction = warp::cone(u, 2.0);
                let share = sends.relative_intensity(direction);
                if share > 0.0 {
                    whole += view.aimed_pdf_ratio(direction, None) * share / sends.effective_solid_angle()
                        * 4.0
                        * PI
                        / f64::from(n);
                }
            }
            let mut next = numbers(random::unit_generator(6));
            let (mut useful, tries) = (0.0, 200_000);
            for _ in 0..tries {
                let u = next();
                useful += match view.sample(u.aim[1], u.direction) {
                    Some((direction, _)) => f64::from(u8::from(sends.relative_intensity(direction) > 0.0)),
                    None => 1.0,
                };
            }
            let useful = useful / f64::from(tries);
            assert!((whole - useful).abs() < 5e-3, "{whole} {useful}");
        }
    }
}

#[test]
fn lights_are_chosen_by_power() {
    let light_at = |i: u32| {
        let intensity = Vec3::new(0.5 + (i % 7) as f32, 1.0, 0.0);
        let position = DVec3::new(f64::from(i % 100), f64::from(i / 100), 0.0);
        Light::Point(PointLight { position, intensity, falloff: Falloff::Square })
    };
    let lights = Arc::new(
        Lights::new((0..10_000).map(light_at).collect(), &CancelToken::new()).expect("never canceled"),
    );
    let source = PhotonEmitter::new(&lights, |_| None, SCENE).expect("power");
    let (mut next, mut counts) = (numbers(random::unit_generator(8)), [0.0; 7]);
    let power = source.total_light_power();
    let (mut flux, count) = (DVec3::ZERO, 700_000);
    for _ in 0..count {
        let photon = source.emit(&next()).expect("a photon");
        counts[photon.light as usize % 7] += 1.0;
        flux += photon.flux.as_dvec3() / f64::from(count);
        let share = mean_channel(source.light_power(photon.light)) / mean_channel(power);
        assert!(
            (mean_channel(photon.flux) * share / mean_channel(source.light_power(photon.light)) - 1.0).abs()
                < 1e-5
        );
    }
    assert!((flux / power.as_dvec3() - 1.0).truncate().abs().max_element() < 3e-3, "{flux} {power}");
    for (kind, found) in (0_u32..).zip(counts) {
        let of_kind = f64::from((0..10_000).filter(|i| i % 7 == kind).count() as u32);
        let expected =
            f64::from(count) * of_kind * 4.0 * PI * (1.5 + f64::from(kind)) / 3.0 / mean_channel(power);
        let off: f64 = found - expected;
        assert!(off.abs() < 5.0 * expected.sqrt(), "{kind}: {found} {expected}");
    }
}

#[test]
fn lights_without_falloff_emit_no_photons() {
    let lights = |last: Vec<Light>| Arc::new(Lights::new(last, &CancelToken::new()).expect("never canceled"));
    let none = vec![Light::Point(point(Falloff::None))];
    assert!(PhotonEmitter::new(&lights(none), |_| None, SCENE).is_none());
    let both = vec![Light::Point(point(Falloff::None)), Light::Point(point(Falloff::Square))];
    let source =
        PhotonEmitter::new(&lights(both), |_| None, SCENE).expect("power").with_targets(&targets(), 0.5);
    let mut next = numbers(random::unit_generator(9));
    assert!((0..1000).filter_map(|_| source.emit(&next())).all(|photon| photon.light == 1));
    let nowhere = BoundingSphere { center: DVec3::ZERO, radius: 0.0 };
    assert!(PhotonEmitter::new(&lights(vec![Light::Directional(sun(0.0))]), |_| None, nowhere).is_none());
}

#[test]
fn fully_aimed_photons_carry_the_target_power() {
    // For the point light, `part` is the fraction of all directions that the target covers. For the sun, use
    // the area of the target's disk.
    let ball = targets()[0];
    let of = |light: Light| {
        let source = source_of(light, None).with_targets(&[ball], 1.0);
        mean(&source, 64, |photon| f64::from(photon.flux.y)).mean
    };
    let sin2 = ball.radius * ball.radius / (ball.center - point(Falloff::Square).position).length_squared();
    let part = 0.5 * sin2 / (1.0 + (1.0 - sin2).sqrt());
    let at_point = of(Light::Point(point(Falloff::Square)));
    assert!((at_point / (4.0 * PI * part) - 1.0).abs() < 1e-5, "{at_point}");
    let at_sun = of(Light::Directional(sun(0.0)));
    assert!((at_sun / (PI * ball.radius * ball.radius) - 1.0).abs() < 1e-5, "{at_sun}");
}

#[test]
fn many_targets_are_merged() {
    let mut next = random::signed_number_generator(10);
    let balls: Vec<BoundingSphere> = (0..500)
        .map(|_| BoundingSphere {
            center: DVec3::from_array([next(), next(), next()].map(|x| f64::from(x) * 3.0)),
            radius: f64::from(next().abs()) * 0.1,
        })
        .collect();
    let targets = PhotonTargets::new(&balls).expect("targets");
    assert_eq!(targets.balls().len(), aim::MAX_TARGETS);
    for ball in &balls {
        let holds = |other: &BoundingSphere| {
            (other.center - ball.center).length() + ball.radius <= other.radius + 1e-9
        };
        assert!(targets.balls().iter().any(holds), "{ball:?}");
    }
    let source = source_of(Light::Point(point(Falloff::Square)), None).with_targets(&balls, 0.5);
    let found = mean(&source, 1 << 13, |photon| f64::from(photon.flux.y));
    assert!(
        found.error < 1e-2 * found.mean && (found.mean - 4.0 * PI).abs() < 5.0 * found.error,
        "{found:?}"
    );
}
