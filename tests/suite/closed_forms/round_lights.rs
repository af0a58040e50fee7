//! Emissive disks, cylinders, cones and tori.

use std::f64::consts::{PI, TAU};

use glimt::geometry::Ray;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::{ShadowMode, Shape};

use super::direct::{assert_hard, assert_irradiance, at_origin};
use super::scenes::{Build, emitter, matte, scene};
use super::{assert_close, v};

/// Irradiance E at the origin, facing up, from a shape with L = 1: π times the fraction of a cosine-weighted
/// hemisphere that hits a front face.
fn hemisphere_irradiance(shape: &Shape) -> f64 {
    const RINGS: u32 = 1500;
    let geometry = scene().shape(shape.clone(), matte(0.5)).world().geometry;
    let mut fronts = 0_u32;
    for i in 0..RINGS {
        for j in 0..RINGS {
            // Multiples of the golden ratio rotate each ring relative to its neighbors.
            let sin2 = (f64::from(i) + 0.5) / f64::from(RINGS);
            let phi =
                TAU * ((f64::from(j) + 0.5) / f64::from(RINGS) + 0.618_033_988_75 * f64::from(i)).fract();
            let sin = sin2.sqrt();
            let direction = v(sin * phi.cos(), (1.0 - sin2).sqrt(), sin * phi.sin()).as_vec3();
            let ray = Ray::new(Vec3::ZERO, direction);
            if let Some(hit) = geometry.closest_hit(&ray) {
                fronts += u32::from(geometry.surface(&ray, &hit).normal.dot(direction) < 0.0);
            }
        }
    }
    PI * f64::from(fronts) / f64::from(RINGS * RINGS)
}

fn lit(shape: &Shape) -> Build {
    at_origin().shape(shape.clone(), emitter(1.0))
}

fn disk(center: DVec3, normal: DVec3, radius: f64) -> Shape {
    Shape::Disk { center, normal, radius }
}

#[test]
fn disk_light_is_exact_on_its_axis() {
    // E = πL·R²/(R² + h²).
    for (radius, height) in [(1.0, 1.0), (0.5, 3.0), (2.0, 0.7), (1e-3, 10.0)] {
        let exact = PI * radius * radius / (radius * radius + height * height);
        let shape = disk(v(0.0, height, 0.0), v(0.0, -2.0, 0.0), radius);
        assert_irradiance(&format!("disk with radius {radius} at {height}"), &lit(&shape), exact, 8e-6);
        assert_hard("disk", &lit(&shape), exact, 1.5e-5);
        let turned = lit(&disk(v(0.0, height, 0.0), DVec3::Y, radius));
        assert_eq!((turned.value(), turned.shadows(ShadowMode::Hard, 1).value()), (0.0, 0.0));
    }
}

#[test]
fn disk_light_is_exact_off_its_axis() {
    // F = ½·(1 − (Z − 2R²)/√(Z² − 4R²)), where Z = 1 + H² + R² and lengths are in units of the lateral
    // distance (Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, B-13).
    let (radius, height, beside): (f64, f64, f64) = (0.8, 1.2, 0.9);
    let (h, r) = (height / beside, radius / beside);
    let z = 1.0 + h * h + r * r;
    let exact = PI * 0.5 * (1.0 - (z - 2.0 * r * r) / (z * z - 4.0 * r * r).sqrt());
    let shape = disk(v(beside, height, 0.0), DVec3::NEG_Y, radius);
    assert_irradiance("parallel disk", &lit(&shape), exact, 2e-5);
    assert_close("the reference", (hemisphere_irradiance(&shape) / exact - 1.0).abs().max(1e-3), 1e-3);
}

/// Compares the rendered irradiance, from area samples, with [`hemisphere_irradiance`].
#[track_caller]
pub fn assert_same(shape: &Shape) {
    let exact = hemisphere_irradiance(shape);
    if exact == 0.0 {
        assert_eq!(lit(shape).value(), 0.0, "only the back of {shape:?} is visible");
        return;
    }
    assert!(exact > 0.01, "{shape:?} too dim: {exact}");
    for (samples, shadow_samples) in [(1024, 1), (64, 16)] {
        let values = lit(shape).shadows(ShadowMode::Soft, shadow_samples).values(samples, 22);
        let (mean, error) = super::mean_and_error(&values);
        let (mean, error) = (mean * PI / 0.7, error * PI / 0.7);
        assert!(error < 2e-4 * exact, "{shape:?}: too noisy: {error}");
        assert!(
            (mean - exact).abs() < 3.0 * error + 1e-3 * exact,
            "{shape:?}: {mean} ± {error}, expected {exact}"
        );
    }
}

#[test]
fn cylinder_area_and_direction_sampling_agree() {
    for caps in [true, false] {
        for (a, b, radius) in [
            (v(-1.0, 1.0, 0.2), v(1.2, 1.4, -0.1), 0.4),
            (v(0.2, 0.9, 0.1), v(0.5, 3.0, 0.4), 0.6),
            // Partly below the horizon.
            (v(1.0, -0.5, 0.0), v(1.1, 1.0, 0.3), 0.5),
        ] {
            assert_same(&Shape::Cylinder { a, b, radius, caps });
        }
    }
}

#[test]
fn cone_area_and_direction_sampling_agree() {
    for cap in [true, false] {
        for (base, tip, radius) in [
            (v(0.3, 2.0, 0.1), v(-0.1, 0.6, 0.2), 0.7),
            (v(1.0, 0.4, 0.0), v(0.4, 1.8, 0.3), 0.5),
            (v(0.5, 1.0, 0.2), v(0.6, 1.1, 0.4), 0.8),
        ] {
            assert_same(&Shape::Cone { base, tip, radius, cap });
        }
    }
    let shape = Shape::Cone { base: v(0.1, 1.2, 0.0), tip: v(0.3, 2.4, 0.3), radius: 0.8, cap: true };
    assert_same(&shape);
}

#[test]
fn torus_area_and_direction_sampling_agree() {
    // The tori are viewed through the hole, from the side, and edge-on, where a torus occludes itself.
    for (center, axis, radius, tube) in [
        (v(0.0, 1.2, 0.0), DVec3::Y, 0.8, 0.3),
        (v(0.7, 1.0, 0.4), v(1.0, 0.3, 0.2), 0.6, 0.35),
        (v(0.2, 1.0, 0.1), v(0.3, 0.1, 1.0), 0.6, 0.1),
        (v(0.1, 0.9, 0.0), v(0.1, 1.0, 0.0), 0.5, 0.48),
    ] {
        assert_same(&Shape::Torus { center, axis, radius, tube });
    }
}

#[test]
fn distant_light_matches_projected_area() {
    // E = L·A·cos θ/d², where A is the projected area: 2Rh for a cylinder from the side and πR² along its
    // axis, R·h for a cone from the side and πR² along its axis.
    let far = |center: DVec3, shape: Shape, shown: f64| {
        let exact = shown * center.normalize().y / center.length_squared();
        let soft = lit(&shape).shadows(ShadowMode::Soft, 64).values(256, 16);
        let (mean, error) = super::mean_and_error(&soft);
        let (mean, error) = (mean * PI / 0.7, error * PI / 0.7);
        assert!(error < 1e-6 * exact, "{shape:?}: too noisy: {mean} ± {error}");
        assert!((mean - exact).abs() < 4.0 * error + 1e-3 * exact, "{shape:?}: {mean}, expected {exact}");
    };
    let up = v(0.0, 1e4, 0.0);
    let bar = |half: DVec3| Shape::Cylinder { a: up - half, b: up + half, radius: 0.5, caps: true };
    far(up, bar(DVec3::X * 2.0), 2.0 * 0.5 * 4.0);
    far(up, bar(DVec3::Y * 2.0), PI * 0.25);
    let open =
        Shape::Cylinder { a: up - v(0.5, 1.0, 0.0), b: up + v(0.5, 1.0, 0.0), radius: 0.5, caps: false };
    far(up, open, 2.0 * 0.5 * 1.0);
    let cone = |axis: DVec3| {
        // The cone's centroid is on the line of sight.
        let (side, cap) = (0.5 * axis.length().hypot(0.5), 0.25);
        let from_base = axis * (side / 3.0 / (side + cap));
        Shape::Cone { base: up - from_base, tip: up - from_base + axis, radius: 0.5, cap: true }
    };
    far(up, cone(DVec3::X * 3.0), 0.5 * 3.0);
    far(up, cone(DVec3::Y * 3.0), PI * 0.25);
    far(up, cone(DVec3::NEG_Y * 3.0), PI * 0.25);
}
