//! Tests of plastic. Compares values with formulas and samples with pdfs, and runs the white furnace test.

use super::*;
use crate::materials::bsdf::LobesToSample;
use crate::materials::bxdfs::lobe_tests::{
    ALPHAS, COSINES, TestSurface, check_lane_independence, check_values, reference_microfacet_brdf,
    spherical_direction,
};
use crate::materials::lookup::WhiteLookup;
use crate::math::DVec3;

fn plastic(diffuse: Vec3, specular: f32, ior: f32, alpha: f32) -> Plastic {
    let [diffuse, specular] = [diffuse, Vec3::splat(specular)].map(ColorOrTexture::Constant);
    Plastic::new(diffuse, specular, ScalarParameter::Constant(alpha.sqrt()), ior)
}

fn point(plastic: &Plastic) -> PlasticPoint {
    plastic.look_up_parameters(&mut WhiteLookup)
}

const RED: Vec3 = Vec3::new(0.7, 0.1, 0.05);

#[test]
fn values_match_the_formulas_and_are_reciprocal() {
    for (alpha, ior) in ALPHAS.into_iter().flat_map(|alpha| [(alpha, 1.5), (alpha, 1.2)]) {
        let point = point(&plastic(RED, 0.9, ior, alpha));
        let (eta, wide) = (f64::from(ior), [f64::from(alpha); 2]);
        let mean = f64::from(point.albedo.mean);
        let returned = 1.0 - (1.0 - mean) / (eta * eta);
        let left = |cosine: f64| 1.0 - f64::from(point.albedo.at_cosine(cosine as f32));
        check_values::<PlasticBxdf>(&format!("α {alpha}, η {ior}"), &point, [alpha; 2], |o, i| {
            let fresnel = fresnel_dielectric_f64((o + i).length() * 0.5, eta);
            let kd = RED.as_dvec3();
            let base = kd / (DVec3::ONE - kd * returned) / (std::f64::consts::PI * eta * eta);
            base * (left(o.z) * left(i.z))
                + DVec3::splat(0.9 * fresnel * reference_microfacet_brdf(o, i, wide))
        });
    }
}

#[test]
fn lanes_are_independent() {
    let points: Vec<PlasticPoint> = [0.0, 0.001, 0.05, 0.6]
        .into_iter()
        .flat_map(|alpha| [plastic(RED, 1.0, 1.5, alpha), plastic(Vec3::ZERO, 0.8, 1.3, alpha)])
        .map(|one| point(&one))
        .collect();
    check_lane_independence::<PlasticBxdf>(&points);
}

#[test]
fn samples_follow_the_pdf() {
    for (alpha, cosine) in ALPHAS.into_iter().flat_map(|alpha| COSINES.map(|cosine| (alpha, cosine))) {
        let subject = TestSurface::<PlasticBxdf>::new(
            &point(&plastic(RED, 1.0, 1.5, alpha)),
            [alpha; 2],
            spherical_direction(cosine, 0.7),
        );
        subject.check_samples(&format!("coat with α {alpha} at a cosine of {cosine}"), LobesToSample::Narrow);
        // For narrow lobes, the map's cells are too large for the diffuse lobe.
        if alpha >= 0.2 {
            subject.check_samples(&format!("α {alpha} at a cosine of {cosine}"), LobesToSample::All);
        }
    }
}

#[test]
fn white_furnace_and_albedos_match_quadrature() {
    for (alpha, ior) in ALPHAS.into_iter().flat_map(|alpha| [1.0, 1.33, 1.5, 2.5].map(|ior| (alpha, ior))) {
        for cosine in COSINES {
            let what = format!("α {alpha}, η {ior} at a cosine of {cosine}");
            let white = point(&plastic(Vec3::ONE, 1.0, ior, alpha));
            let subject =
                TestSurface::<PlasticBxdf>::new(&white, [alpha; 2], spherical_direction(cosine, 0.3));
            let furnace = subject.sampled_albedo(192).x;
            assert!((-2e-3..5e-4).contains(&(furnace - 1.0)), "{what}: white plastic reflects {furnace}");
            let red = point(&plastic(RED, 1.0, ior, alpha));
            let subject = TestSurface::<PlasticBxdf>::new(&red, [alpha; 2], spherical_direction(cosine, 0.3));
            let (sampled, exact) = (subject.sampled_albedo(192), subject.albedo());
            assert!((sampled - exact).abs().max_element() < 1e-3, "{what}: {sampled} instead of {exact}");
        }
    }
}

#[test]
fn base_under_smooth_coat_gets_transmitted_light() {
    for ior in [1.0, 1.3, 1.5, 3.0] {
        for cosine in COSINES {
            let base = point(&plastic(Vec3::ONE, 1.0, ior, 0.0));
            let subject = TestSurface::<PlasticBxdf>::new(&base, [1.0; 2], spherical_direction(cosine, 0.3));
            let (albedo, fresnel) =
                (subject.sampled_albedo(192).x, fresnel_dielectric_f64(cosine, ior.into()));
            assert!((albedo + fresnel - 1.0).abs() < 1e-3, "η {ior}: {albedo} and {fresnel}");
        }
    }
}
