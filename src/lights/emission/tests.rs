use std::f64::consts::TAU;

use super::*;
use crate::geometry::cone::Cone;
use crate::geometry::cuboid::Cuboid;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::sphere::Sphere;
use crate::geometry::torus::Torus;
use crate::geometry::triangle::Triangle;
use crate::lights::{DirectionalLight, Environment, PointLight, SpotLight, area_light};
use crate::math::random;

const OBJECT: u32 = 0;
const SCENE: Ball = Ball { center: DVec3::new(0.5, 1.0, -0.5), radius: 5.0 };
const COLOR: Vec3 = Vec3::new(2.0, 1.0, 0.5);

/// Numbers without order.
fn numbers(mut next: impl FnMut() -> f32) -> impl FnMut() -> Numbers {
    move || {
        let mut pair = || [next(), next()];
        Numbers { light: pair(), aim: pair(), position: pair(), direction: pair() }
    }
}

fn shapes() -> Vec<Shape> {
    let (p, q) = (DVec3::new(0.3, -0.2, 0.1), DVec3::new(1.0, 0.5, -0.4));
    vec![
        Shape::Sphere(Sphere { center: p, radius: 0.7 }),
        Shape::Quad(Parallelogram::new(p, DVec3::X, q)),
        Shape::Box(Cuboid::new(p, DVec3::new(1.0, 0.4, 2.0), DVec3::new(10.0, 70.0, -30.0))),
        Shape::Triangle(Triangle { a: p, b: q, c: DVec3::Y }),
        Shape::Disk(Disk::new(p, q, 0.6)),
        Shape::Cylinder(Cylinder::new(p, q, 0.5, true)),
        Shape::Cylinder(Cylinder::new(p, q, 0.5, false)),
        Shape::Cone(Cone::new(p, q, 0.4, true)),
        Shape::Cone(Cone::new(p, q, 0.4, false)),
        Shape::Torus(Torus::new(p, q, 1.0, 0.4)),
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
    DirectionalLight::new(Vec3::new(0.6, 0.64, 0.48), COLOR, degrees.to_radians())
}

/// A light, the object that it is, and its power over its colour.
fn lights() -> Vec<(Light, Option<Shape>, f64)> {
    let disc = PI * SCENE.radius * SCENE.radius;
    let mut all = vec![(Light::Point(point(Falloff::Square)), None, 4.0 * PI)];
    for (degrees, blend) in
        [(40.0_f64, 0.0), (40.0, 0.2), (90.0, 1.0), (1.0, 0.5), (300.0, 0.7), (360.0, 1.0)]
    {
        // 2π∫ share·sin θ dθ by the midpoints of many steps.
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
        all.push((Light::Directional(sun(degrees)), None, disc * factor));
    }
    all.push((Light::Environment(Environment::Constant(COLOR)), None, 4.0 * PI * disc));
    for shape in shapes() {
        let light = area_light(&shape, COLOR, OBJECT).expect("an area");
        all.push((Light::Area(light), Some(shape), PI * shape.areas().iter().sum::<f64>()));
    }
    all
}

fn emission(light: Light, shape: Option<Shape>) -> Emission {
    let lights = Arc::new(Lights::new(vec![light]));
    Emission::new(&lights, |_| shape.map(Outline::Shape), SCENE).expect("power")
}

/// Mean over photons, and its standard error.
struct Mean {
    mean: f64,
    error: f64,
}

fn mean(emission: &Emission, count: u32, mut of: impl FnMut(&Emitted) -> f64) -> Mean {
    let mut next = numbers(random::unit(7));
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..count {
        let one = emission.emit(&next()).map_or(0.0, |photon| of(&photon));
        (sum, squares) = (sum + one, squares + one * one);
    }
    let n = f64::from(count);
    let mean = sum / n;
    Mean { mean, error: ((squares / n - mean * mean).max(0.0) / n).sqrt() }
}

#[test]
fn every_photon_of_a_single_light_has_all_of_its_power() {
    for (light, shape, power) in lights() {
        let emission = emission(light.clone(), shape);
        let power = COLOR.as_dvec3() * power;
        let told = emission.power().as_dvec3();
        assert!((told / power - 1.0).abs().max_element() < 1e-5, "{light:?}: {told} is not {power}");
        let mut next = numbers(random::unit(1));
        for _ in 0..1000 {
            let photon = emission.emit(&next()).expect("a photon");
            let off = (photon.flux.as_dvec3() / power - 1.0).abs().max_element();
            // Parts of a shape are chosen by their areas.
            assert!(off < 1e-5, "{light:?}: {}", photon.flux);
            assert!((photon.direction.length() - 1.0).abs() < 1e-6, "{light:?}");
        }
    }
}
