//! Tests of translucent Phong surfaces. Compares values with formulas, samples with pdfs, and albedos with
//! quadrature on both sides.

use super::*;
use crate::materials::bsdf::LobesToSample;
use crate::materials::bxdfs::lane_tests::{check_lane_independence, check_lane_independence_with};
use crate::materials::bxdfs::lobe_tests::{COSINES, NarrowLightPath, TestSurface, spherical_direction};
use crate::math::DVec3;

use std::f64::consts::PI;

fn point(specular: f32, shininess: f32, transmission: f32) -> TranslucentPoint {
    let reflection = PhongPoint {
        diffuse: Vec3::new(0.3, 0.2, 0.1),
        specular: Vec3::splat(specular),
        shininess,
        ambient: Vec3::ZERO,
    };
    TranslucentPoint { reflection, transmission: Vec3::new(1.0, 0.5, 0.2) * transmission }
}

/// Surfaces with and without a glossy lobe, and surfaces that do not transmit light.
fn points() -> Vec<TranslucentPoint> {
    let glossy = |shininess: f32| point(0.3, shininess, 0.4);
    vec![point(0.0, 1.0, 0.4), glossy(1.0), glossy(40.0), glossy(1e4), point(0.3, 40.0, 0.0)]
}

/// Reflection and transmission of a surface seen from a direction.
fn sides(
    point: &TranslucentPoint,
    to_eye: DVec3,
) -> (TestSurface<TranslucentBxdf<false>>, TestSurface<TranslucentBxdf<true>>) {
    // The width of the lobe affects only the placement of directions.
    let alphas = [(2.0 / (point.reflection.shininess + 2.0)).sqrt(); 2];
    let reflection = TestSurface::new(point, alphas, to_eye);
    (reflection, TestSurface::with_light_path(point, [1.0; 2], to_eye, NarrowLightPath::Through))
}

#[test]
fn values_match_the_formulas() {
    for point in points() {
        let to_eye = spherical_direction(0.6, 0.7);
        let (reflection, transmission) = sides(&point, to_eye);
        for light in COSINES.map(|cosine| spherical_direction(cosine, 2.9)) {
            let mirrored = DVec3::new(-to_eye.x, -to_eye.y, to_eye.z);
            let [kd, ks, kt] =
                [point.reflection.diffuse, point.reflection.specular, point.transmission].map(Vec3::as_dvec3);
            let shininess = f64::from(point.reflection.shininess);
            let gloss = (shininess + 2.0) / (2.0 * PI) * mirrored.dot(light).max(0.0).powf(shininess);
            let found = reflection.evaluate_bsdf(LobesToSample::All, &[light])[0].0;
            let exact = kd / PI + ks * gloss;
            let error = 1e-6 * (1.0 + shininess) * exact.max_element();
            assert!((found - exact).abs().max_element() <= error, "{point:?}: {found} instead of {exact}");
            let below = DVec3::new(light.x, light.y, -light.z);
            let found = transmission.evaluate_bsdf(LobesToSample::All, &[below])[0].0;
            assert!((found - kt / PI).abs().max_element() <= 1e-6, "{point:?}: {found}");
        }
    }
}

#[test]
fn samples_on_both_sides_follow_the_pdf() {
    for point in points().into_iter().filter(|point| point.transmits() && point.reflection.shininess < 1e3) {
        for cosine in COSINES {
            let (reflection, transmission) = sides(&point, spherical_direction(cosine, 0.7));
            let what = format!("{point:?} at a cosine of {cosine}");
            reflection.check_samples(&format!("reflection, {what}"), LobesToSample::All);
            transmission.check_samples(&format!("transmission, {what}"), LobesToSample::All);
        }
    }
}

#[test]
fn two_sided_albedos_match_quadrature() {
    for point in points() {
        for cosine in COSINES {
            let (reflection, transmission) = sides(&point, spherical_direction(cosine, 0.3));
            let through = transmission.sampled_albedo(128);
            let off = (through - point.transmission.as_dvec3()).abs().max_element();
            assert!(off < 1e-3, "{point:?} at a cosine of {cosine}: transmits {through}");
            let (sampled, exact) = (reflection.lobe_stratified_albedo(128), reflection.albedo());
            let off = (sampled - exact).abs().max_element();
            assert!(off < 1e-3, "{point:?} at a cosine of {cosine}: {sampled} instead of {exact}");
            assert!((sampled + through).max_element() < 1.0 + 1e-3, "{sampled} {through}");
        }
    }
}

#[test]
fn paths_continue_on_exactly_one_side() {
    for point in points() {
        let (reflection, transmission) = sides(&point, spherical_direction(0.5, 0.3));
        let up = reflection.sample_directions(LobesToSample::All, 32);
        let down = transmission.sample_directions(LobesToSample::All, 32);
        // On the unused side, the direction points into the surface.
        for (up, down) in up.into_iter().zip(down) {
            assert!((up == DVec3::NEG_Z) != (down == DVec3::Z), "{point:?}: {up} {down}");
        }
    }
}

#[test]
fn lanes_are_independent() {
    check_lane_independence::<TranslucentBxdf<false>>(&points());
    check_lane_independence_with::<TranslucentBxdf<true>>(&points(), NarrowLightPath::Through);
}
