//! Tests of plastic. Compares values with formulas and samples with pdfs, and runs the white furnace test.

use super::*;
use crate::materials::bsdf::LobesToSample;
use crate::materials::bxdfs::lane_tests::check_lane_independence;
use crate::materials::bxdfs::lobe_tests::{
    ALPHAS, COSINES, TestSurface, check_beckmann_values, check_values, estimate_close_to_exact,
    spherical_direction,
};
use crate::materials::bxdfs::reference_tests::{reference_beckmann_brdf, reference_microfacet_brdf};
use crate::materials::lookup::WhiteTextureLookup;
use crate::math::DVec3;

fn plastic(diffuse: Vec3, specular: f32, ior: f32, alpha: f32) -> Plastic {
    with_distribution(MicrofacetDistribution::Ggx, diffuse, specular, ior, alpha)
}

fn beckmann(diffuse: Vec3, specular: f32, ior: f32, alpha: f32) -> Plastic {
    with_distribution(MicrofacetDistribution::Beckmann, diffuse, specular, ior, alpha)
}

fn with_distribution(
    distribution: MicrofacetDistribution,
    diffuse: Vec3,
    specular: f32,
    ior: f32,
    alpha: f32,
) -> Plastic {
    let [diffuse, specular] = [diffuse, Vec3::splat(specular)].map(ColorOrTexture::Constant);
    Plastic::new(diffuse, specular, ScalarParameter::Constant(alpha.sqrt()), ior, distribution)
}

fn point(plastic: &Plastic) -> PlasticPoint {
    plastic.look_up_parameters(&mut WhiteTextureLookup)
}

const RED: Vec3 = Vec3::new(0.7, 0.1, 0.05);

#[test]
fn values_match_the_formulas_and_are_reciprocal() {
    for (alpha, ior) in ALPHAS.into_iter().flat_map(|alpha| [(alpha, 1.5), (alpha, 1.2)]) {
        let (eta, wide, alphas) = (f64::from(ior), [f64::from(alpha); 2], [alpha; 2]);
        // f of a red base under a coat, from D·G/(4 cosθᵢ cosθₒ) of the coat.
        let of = |point: PlasticPoint, o: DVec3, i: DVec3, coat: f64| {
            let returned = 1.0 - (1.0 - f64::from(point.albedo.mean)) / (eta * eta);
            let left = |cosine: f64| 1.0 - f64::from(point.albedo.at_cosine(cosine as f32));
            let kd = RED.as_dvec3();
            let base = kd / (DVec3::ONE - kd * returned) / (std::f64::consts::PI * eta * eta);
            let fresnel = fresnel_dielectric_f64((o + i).length() * 0.5, eta);
            base * (left(o.z) * left(i.z)) + DVec3::splat(0.9 * fresnel * coat)
        };
        let what = format!("α {alpha}, η {ior}");
        let ggx = point(&plastic(RED, 0.9, ior, alpha));
        check_values::<PlasticBxdf<false>>(&what, &ggx, alphas, |o, i| {
            of(ggx, o, i, reference_microfacet_brdf(o, i, wide))
        });
        let beckmann = point(&beckmann(RED, 0.9, ior, alpha));
        check_beckmann_values::<PlasticBxdf<true>>(&what, &beckmann, alphas, |o, i| {
            of(beckmann, o, i, reference_beckmann_brdf(o, i, wide))
        });
    }
}

#[test]
fn linear_bases_scale_the_white_base() {
    for alpha in [0.0, 0.3] {
        let white = point(&plastic(Vec3::ONE, 1.0, 1.5, alpha));
        let linear = point(&plastic(RED, 1.0, 1.5, alpha).with_linear_base());
        assert!((linear.base - RED * white.base).abs().max_element() < 1e-6, "{alpha}");
        let tinted = point(&plastic(Vec3::ONE, 1.0, 1.5, alpha).with_linear_base()).tinted(RED);
        assert!((tinted.base - linear.base).abs().max_element() < 1e-6, "{alpha}");
    }
}

#[test]
fn lanes_are_independent() {
    let points: Vec<PlasticPoint> = [0.0, 0.001, 0.05, 0.6]
        .into_iter()
        .flat_map(|alpha| [plastic(RED, 1.0, 1.5, alpha), plastic(Vec3::ZERO, 0.8, 1.3, alpha)])
        .map(|one| point(&one))
        .collect();
    check_lane_independence::<PlasticBxdf<false>>(&points);
    check_lane_independence::<PlasticBxdf<true>>(&points);
}

#[test]
fn samples_follow_the_pdf() {
    for (alpha, cosine) in ALPHAS.into_iter().flat_map(|alpha| COSINES.map(|cosine| (alpha, cosine))) {
        let subject = TestSurface::<PlasticBxdf<false>>::new(
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

/// Whether the albedo of a white surface is within half of the bounds below.
fn is_close_to_one(furnace: &f64) -> bool {
    (-1e-3..2.5e-4).contains(&(furnace - 1.0))
}

#[test]
fn white_furnace_and_albedos_match_quadrature() {
    for (alpha, ior) in ALPHAS.into_iter().flat_map(|alpha| [1.0, 1.33, 1.5, 2.5].map(|ior| (alpha, ior))) {
        for cosine in COSINES {
            let what = format!("α {alpha}, η {ior} at a cosine of {cosine}");
            let white = point(&plastic(Vec3::ONE, 1.0, ior, alpha));
            let subject =
                TestSurface::<PlasticBxdf<false>>::new(&white, [alpha; 2], spherical_direction(cosine, 0.3));
            let furnace =
                estimate_close_to_exact(192, |side| subject.sampled_albedo(side).x, is_close_to_one);
            assert!((-2e-3..5e-4).contains(&(furnace - 1.0)), "{what}: white plastic reflects {furnace}");
            let red = point(&plastic(RED, 1.0, ior, alpha));
            let subject =
                TestSurface::<PlasticBxdf<false>>::new(&red, [alpha; 2], spherical_direction(cosine, 0.3));
            let exact = subject.albedo();
            let is_close = |sampled: &DVec3| (*sampled - exact).abs().max_element() < 5e-4;
            let sampled = estimate_close_to_exact(192, |side| subject.sampled_albedo(side), is_close);
            assert!((sampled - exact).abs().max_element() < 1e-3, "{what}: {sampled} instead of {exact}");
        }
    }
}

#[test]
fn beckmann_samples_follow_the_pdf() {
    for (alpha, cosine) in
        [0.02, 0.2, 1.0].into_iter().flat_map(|alpha| COSINES.map(|cosine| (alpha, cosine)))
    {
        let red = point(&beckmann(RED, 1.0, 1.5, alpha));
        let at = spherical_direction(cosine, 0.7);
        let subject = TestSurface::<PlasticBxdf<true>>::new(&red, [alpha; 2], at);
        let what = format!("α {alpha} at a cosine of {cosine}");
        subject.check_samples(&what, LobesToSample::Narrow);
        if alpha >= 0.2 {
            subject.check_samples(&what, LobesToSample::All);
        }
    }
}

#[test]
fn white_beckmann_plastic_reflects_all_light() {
    for (alpha, ior) in ALPHAS.into_iter().flat_map(|alpha| [1.33, 1.5, 2.5].map(|ior| (alpha, ior))) {
        for cosine in COSINES {
            let what = format!("α {alpha}, η {ior} at a cosine of {cosine}");
            let white = point(&beckmann(Vec3::ONE, 1.0, ior, alpha));
            let at = spherical_direction(cosine, 0.3);
            let subject = TestSurface::<PlasticBxdf<true>>::new(&white, [alpha; 2], at);
            let furnace =
                estimate_close_to_exact(128, |side| subject.sampled_albedo(side).x, is_close_to_one);
            assert!((-2e-3..5e-4).contains(&(furnace - 1.0)), "{what}: white plastic reflects {furnace}");
            // The coat's albedo, compared with a quadrature of its formula.
            let exact = subject.reference_albedo(|o, i| {
                fresnel_dielectric_f64((o + i).length() * 0.5, ior.into())
                    * reference_beckmann_brdf(o, i, [f64::from(alpha); 2])
            });
            let found = f64::from(white.albedo.at_cosine(cosine as f32));
            assert!((-1e-4..1e-3).contains(&(found - exact)), "{what}: an albedo of {found}, not {exact}");
        }
    }
}

#[test]
fn base_under_smooth_coat_gets_transmitted_light() {
    for ior in [1.0, 1.3, 1.5, 3.0] {
        for cosine in COSINES {
            let base = point(&plastic(Vec3::ONE, 1.0, ior, 0.0));
            let subject =
                TestSurface::<PlasticBxdf<false>>::new(&base, [1.0; 2], spherical_direction(cosine, 0.3));
            let (albedo, fresnel) =
                (subject.sampled_albedo(192).x, fresnel_dielectric_f64(cosine, ior.into()));
            assert!((albedo + fresnel - 1.0).abs() < 1e-3, "η {ior}: {albedo} and {fresnel}");
        }
    }
}
