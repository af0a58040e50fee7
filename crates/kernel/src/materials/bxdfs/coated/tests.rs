//! Tests of clear coats over several bases. Compares values with formulas, albedos with quadrature, and
//! samples with pdfs.

use super::*;
use crate::materials::bsdf::LobesToSample;
use crate::materials::bxdf::Bxdf;
use crate::materials::bxdfs::lane_tests::{check_lane_independence, check_lane_independence_with};
use crate::materials::bxdfs::lobe_tests::{
    ALPHAS, COSINES, NarrowLightPath, TestSurface, check_values, estimate_close_to_exact, spherical_direction,
};
use crate::materials::bxdfs::reference_tests::reference_microfacet_brdf;
use crate::materials::coat::CoatTexturedParameters;
use crate::materials::conductor::{ConductorBxdf, ConductorPoint, FresnelPoint};
use crate::materials::lookup::WhiteTextureLookup;
use crate::materials::microfacet::MicrofacetDistribution;
use crate::materials::phong::{PhongBxdf, PhongPoint};
use crate::materials::plastic::{PlasticBxdf, PlasticPoint};
use crate::materials::principled::{PrincipledBxdf, PrincipledPoint};
use crate::materials::scalar::ScalarParameter;
use crate::materials::texture::ColorOrTexture;
use crate::materials::translucent::{TranslucentBxdf, TranslucentPoint};
use crate::materials::{Plastic, Principled, PrincipledInputs};
use crate::math::DVec3;

use std::f64::consts::TAU;

const RED: Vec3 = Vec3::new(0.7, 0.1, 0.05);
const TINT: Vec3 = Vec3::new(0.9, 0.6, 0.2);

/// A material under a coat.
fn coated<P>(base: P, weight: f32, alpha: f32, ior: f32, tint: Vec3) -> CoatedPoint<P> {
    let [weight, roughness] = [weight, alpha.sqrt()].map(ScalarParameter::Constant);
    let inputs = CoatTexturedParameters { weight, roughness, ior, tint: ColorOrTexture::Constant(tint) };
    let coat = Coat::new(inputs).expect("a coat").look_up_parameters(&mut WhiteTextureLookup);
    CoatedPoint { coat, base }
}

fn phong(diffuse: Vec3, specular: f32, shininess: f32) -> PhongPoint {
    PhongPoint { diffuse, specular: Vec3::splat(specular), shininess, ambient: Vec3::ZERO }
}

fn conductor(alphas: [f32; 2]) -> ConductorPoint {
    let gold = FresnelPoint::from_complex_ior(Vec3::new(0.14, 0.37, 1.44), Vec3::new(3.98, 2.39, 1.6));
    ConductorPoint { fresnel: gold, alphas }
}

fn plastic(alpha: f32) -> PlasticPoint {
    let [diffuse, specular] = [RED, Vec3::ONE].map(ColorOrTexture::Constant);
    Plastic::new(diffuse, specular, ScalarParameter::Constant(alpha.sqrt()), 1.4, MicrofacetDistribution::Ggx)
        .look_up_parameters(&mut WhiteTextureLookup)
}

fn principled(color: Vec3, metallic: f32, transmission: f32, alpha: f32) -> PrincipledPoint {
    let number = ScalarParameter::Constant;
    let inputs = PrincipledInputs {
        color: ColorOrTexture::Constant(color),
        metallic: number(metallic),
        roughness: number(alpha.sqrt()),
        ior: 1.6,
        specular: number(0.8),
        specular_color: ColorOrTexture::Constant(Vec3::ONE),
        transmission: number(transmission),
        diffuse_transmission: ColorOrTexture::Constant(Vec3::ZERO),
    };
    Principled::new(inputs).look_up_parameters(&mut WhiteTextureLookup)
}

fn translucent(diffuse: Vec3, specular: f32, transmission: Vec3) -> TranslucentPoint {
    TranslucentPoint { reflection: phong(diffuse, specular, 3.0), transmission }
}

/// Reflectance of the facets of a coat with index of refraction 1.5.
fn schlick(cosine: f64) -> f64 {
    0.04 + 0.96 * (1.0 - cosine).powi(5)
}

/// Directional albedo of a coat with index of refraction 1.5 and weight 1, by quadrature over half vectors.
fn reference_albedo(alpha: f32, cosine: f64) -> f64 {
    const SIDE: u32 = 96;
    let to_eye = spherical_direction(cosine, 0.0);
    let map = TestSurface::<PhongBxdf>::new(&phong(Vec3::ONE, 0.0, 1.0), [alpha; 2], to_eye);
    let part = |i: u32| (f64::from(i) + 0.5) / f64::from(SIDE);
    let cells = (0..SIDE * SIDE).filter_map(|i| map.map_to_direction(part(i / SIDE), part(i % SIDE) * TAU));
    let light = cells.map(|(light, solid_angle)| {
        let fresnel = schlick((light + to_eye).length() * 0.5);
        fresnel * reference_microfacet_brdf(to_eye, light, [f64::from(alpha); 2]) * light.z * solid_angle
    });
    light.sum::<f64>() / f64::from(SIDE * SIDE)
}

/// Compares values with the coat's formula applied to the values of the bare base. `returned` contains the
/// reflectances of the wide and narrow lobes for light that the coat reflects back down.
fn check_coat_formula<B: Bxdf>(what: &str, base: &B::Point, returned: [Vec3; 2])
where
    B::Point: Copy,
{
    for (alpha, weight, ior) in [(0.05, 1.0, 1.5), (0.3, 0.6, 1.3), (1.0, 1.0, 2.0)] {
        let point = coated(*base, weight, alpha, ior, TINT);
        let (c, eta) = (f64::from(weight), f64::from(ior));
        let f0 = ((eta - 1.0) / (eta + 1.0)).powi(2);
        let tint = DVec3::ONE + (TINT.as_dvec3() - DVec3::ONE) * c;
        // The transmittance along the refracted path is T^(1/(2·cosθₜ)).
        let passed = |cosine: f64| {
            let refracted = (1.0 - (1.0 - cosine * cosine) / (eta * eta)).sqrt();
            let absorbed = |tint: f64| tint.powf(0.5 / refracted);
            let left = 1.0 - c * f64::from(point.coat.albedo.at_cosine(cosine as f32));
            DVec3::new(absorbed(tint.x), absorbed(tint.y), absorbed(tint.z)) * left
        };
        check_values::<CoatedBxdf<B>>(&format!("{what} under α {alpha}"), &point, [alpha; 2], |o, i| {
            let below = TestSurface::<B>::new(base, [alpha; 2], o);
            let (below, wide, _) = below.evaluate_bsdf(LobesToSample::All, &[i])[0];
            let albedo = |cosine: f64| c * f64::from(point.coat.albedo.at_cosine(cosine as f32));
            let gain = |base: Vec3, coat: f64| DVec3::ONE / (DVec3::ONE - base.as_dvec3() * coat);
            let [rho_wide, rho_narrow] = returned;
            let below = wide * gain(rho_wide, c * f64::from(point.coat.albedo.mean))
                + (below - wide) * gain(rho_narrow, albedo(o.z).min(albedo(i.z)));
            let fresnel = f0 + (1.0 - f0) * (1.0 - (o + i).length() * 0.5).powi(5);
            let lobe = c * fresnel * reference_microfacet_brdf(o, i, [f64::from(alpha); 2]);
            DVec3::splat(lobe) + below * passed(o.z) * passed(i.z)
        });
    }
}

#[test]
fn values_match_the_formulas_and_are_reciprocal() {
    let none = [Vec3::ZERO; 2];
    let gloss = Vec3::splat(0.2);
    check_coat_formula::<PhongBxdf>("phong", &phong(RED, 0.2, 3.0), [RED, gloss]);
    // Reflectance ((η − 1)² + k²)/((η + 1)² + k²).
    let gold = Vec3::new(0.967_328, 0.804_981, 0.323_435);
    check_coat_formula::<ConductorBxdf<true, false>>("metal", &conductor([0.3, 0.3]), [Vec3::ZERO, gold]);
    check_coat_formula::<ConductorBxdf<true, false>>(
        "brushed metal",
        &conductor([0.2, 0.5]),
        [Vec3::ZERO, gold],
    );
    check_coat_formula::<ConductorBxdf<true, true>>(
        "Beckmann metal",
        &conductor([0.2, 0.5]),
        [Vec3::ZERO, gold],
    );
    let leaf = translucent(RED * 0.5, 0.2, TINT * 0.3);
    check_coat_formula::<TranslucentBxdf<false>>("translucent", &leaf, [RED * 0.5, gloss]);
    check_coat_formula::<PlasticBxdf<false>>("plastic", &plastic(0.2), none);
    check_coat_formula::<PlasticBxdf<true>>("Beckmann plastic", &plastic(0.2), none);
    check_coat_formula::<PlasticBxdf<false>>("smooth plastic", &plastic(0.0), none);
    check_coat_formula::<PrincipledBxdf<false>>("principled", &principled(RED, 0.4, 0.0, 0.3), none);
}

#[test]
fn tint_is_round_trip_transmittance() {
    let [bare, tinted] = [Vec3::ONE, TINT].map(|tint| {
        let point = coated(phong(Vec3::ONE, 0.0, 1.0), 1.0, 0.3, 1.5, tint);
        let surface = TestSurface::<CoatedBxdf<PhongBxdf>>::new(&point, [0.3; 2], DVec3::Z);
        surface.evaluate_bsdf(LobesToSample::All, &[DVec3::Z])[0].1
    });
    let ratio = tinted / bare;
    assert!((ratio - TINT.as_dvec3()).abs().max_element() < 1e-5, "{ratio} instead of {TINT}");
}

#[test]
fn albedos_over_black_match_quadrature() {
    for (alpha, cosine) in ALPHAS.into_iter().flat_map(|alpha| COSINES.map(|cosine| (alpha, cosine))) {
        let exact = reference_albedo(alpha, cosine);
        for weight in [1.0, 0.4] {
            let black = coated(phong(Vec3::ZERO, 0.0, 1.0), weight, alpha, 1.5, Vec3::ONE);
            let at = spherical_direction(cosine, 0.3);
            let found = TestSurface::<CoatedBxdf<PhongBxdf>>::new(&black, [alpha; 2], at).sampled_albedo(128);
            let off = found.x - f64::from(weight) * exact;
            assert!(off.abs() < 1e-3, "α {alpha}, weight {weight} at a cosine of {cosine}: {found}, {exact}");
        }
    }
}

#[test]
fn albedos_over_white_match_quadrature() {
    for alpha in [0.001, 0.05, 0.2, 0.5, 1.0] {
        // The mean albedo is 2 ∫ E μ dμ, with equal steps in μ².
        let means = (0..32).map(|i| reference_albedo(alpha, ((f64::from(i) + 0.5) / 32.0).sqrt()) / 32.0);
        let mean: f64 = means.sum();
        for cosine in COSINES {
            let at = spherical_direction(cosine, 0.3);
            let coat = reference_albedo(alpha, cosine);
            for diffuse in [1.0, 0.4] {
                let point = coated(phong(Vec3::splat(diffuse), 0.0, 1.0), 1.0, alpha, 1.5, Vec3::ONE);
                let surface = TestSurface::<CoatedBxdf<PhongBxdf>>::new(&point, [alpha; 2], at);
                let found = surface.lobe_stratified_albedo(48).x;
                let kd = f64::from(diffuse);
                let exact = coat + (1.0 - coat) * (1.0 - mean) * kd / (1.0 - kd * mean);
                let what = format!("α {alpha}, kd {diffuse} at {cosine}: {found} instead of {exact}");
                assert!((found - exact).abs() < 1e-3 && found < 1.0 + 5e-4, "{what}");
            }
        }
    }
}

#[test]
fn albedos_over_a_leaf_match_quadrature() {
    type Front = CoatedBxdf<TranslucentBxdf<false>>;
    type Behind = CoatedBxdf<TranslucentBxdf<true>>;
    let (kd, kt) = (0.45_f32, 0.55_f32);
    let leaf = translucent(Vec3::splat(kd), 0.0, Vec3::splat(kt));
    let [kd, kt] = [kd, kt].map(f64::from);
    for alpha in [0.001, 0.05, 0.3, 1.0] {
        let means = (0..128).map(|i| reference_albedo(alpha, ((f64::from(i) + 0.5) / 128.0).sqrt()) / 128.0);
        let mean: f64 = means.sum();
        let point = coated(leaf, 1.0, alpha, 1.5, Vec3::ONE);
        for cosine in COSINES {
            let at = spherical_direction(cosine, 0.3);
            let coat = reference_albedo(alpha, cosine);
            let front = TestSurface::<Front>::new(&point, [alpha; 2], at);
            let behind =
                TestSurface::<Behind>::with_light_path(&point, [alpha; 2], at, NarrowLightPath::Through);
            let [reflected, transmitted] =
                [front.lobe_stratified_albedo(160).x, behind.lobe_stratified_albedo(96).x];
            // Both sides are coated, and light passes one coat on each. The coat reflects a part of the light
            // from the leaf back to it.
            let passed = (1.0 - coat) * (1.0 - mean) / (1.0 - kd * mean);
            let exact = [coat + passed * kd, passed * kt];
            let what = format!("α {alpha} at {cosine}: {reflected}, {transmitted} instead of {exact:?}");
            assert!((reflected - exact[0]).abs() < 1e-3 && (transmitted - exact[1]).abs() < 1e-3, "{what}");
            assert!(reflected + transmitted < 1.0 + 5e-4, "{what}");
        }
    }
}

/// Checks samples against pdfs, and albedos of white bases against quadrature.
fn check_sampling<B: Bxdf>(what: &str, base: impl Fn(f32) -> B::Point) {
    for (alpha, cosine) in [0.02, 0.3].into_iter().flat_map(|alpha| [0.15, 0.8].map(|cosine| (alpha, cosine)))
    {
        // Give the base a different roughness, so that mixing up samples of the two lobes fails the test.
        let point = coated(base(0.7 * alpha), 0.8, alpha, 1.6, TINT);
        let at = spherical_direction(cosine, 0.7);
        let subject = TestSurface::<CoatedBxdf<B>>::new(&point, [alpha; 2], at);
        let what = format!("{what} under α {alpha} at a cosine of {cosine}");
        subject.check_samples(&what, LobesToSample::Narrow);
        if alpha >= 0.2 {
            subject.check_samples(&what, LobesToSample::All);
        }
        let exact = subject.albedo();
        let is_close = |sampled: &DVec3| {
            (*sampled - exact).abs().max_element() < 1e-3 && sampled.max_element() < 1.0 + 2.5e-4
        };
        let sampled = estimate_close_to_exact(192, |side| subject.sampled_albedo(side), is_close);
        assert!((sampled - exact).abs().max_element() < 2e-3, "{what}: {sampled} instead of {exact}");
        assert!(sampled.max_element() < 1.0 + 5e-4, "{what}: {sampled}");
    }
}

#[test]
fn samples_follow_the_pdf() {
    check_sampling::<PhongBxdf>("diffuse", |_| phong(RED, 0.0, 1.0));
    check_sampling::<PhongBxdf>("black", |_| phong(Vec3::ZERO, 0.0, 1.0));
    check_sampling::<ConductorBxdf<true, false>>("metal", |alpha| conductor([alpha.max(0.001); 2]));
    check_sampling::<ConductorBxdf<true, true>>("Beckmann metal", |alpha| conductor([alpha.max(0.001); 2]));
    check_sampling::<PlasticBxdf<false>>("plastic", plastic);
    check_sampling::<PrincipledBxdf<false>>("principled", |alpha| {
        principled(RED, 0.4, 0.0, alpha.max(0.001))
    });
}

#[test]
fn glossy_phong_samples_follow_the_pdf() {
    for cosine in [0.3, 1.0] {
        let point = coated(phong(RED * 0.5, 0.4, 12.0), 0.8, 0.4, 1.5, Vec3::ONE);
        let at = spherical_direction(cosine, 0.7);
        let subject = TestSurface::<CoatedBxdf<PhongBxdf>>::new(&point, [0.4; 2], at);
        for lobes in [LobesToSample::Narrow, LobesToSample::All] {
            subject.check_samples(&format!("glossy at a cosine of {cosine}, {lobes:?}"), lobes);
        }
    }
}

#[test]
fn transmission_passes_the_coat_on_both_sides() {
    for cosine in COSINES {
        let base = principled(RED, 0.2, 0.6, 0.3);
        let point = coated(base, 0.8, 0.2, 1.5, TINT);
        let at = spherical_direction(cosine, 0.7);
        let through = NarrowLightPath::Through;
        type Behind = PrincipledBxdf<true>;
        let behind = TestSurface::<CoatedBxdf<Behind>>::with_light_path(&point, [0.3; 2], at, through);
        let bare = TestSurface::<Behind>::with_light_path(&base, [0.3; 2], at, through);
        let light = spherical_direction(0.6, 3.0) * DVec3::new(1.0, 1.0, -1.0);
        let [found, below] = [
            behind.evaluate_bsdf(LobesToSample::All, &[light])[0].0,
            bare.evaluate_bsdf(LobesToSample::All, &[light])[0].0,
        ];
        let tint = DVec3::ONE + (TINT.as_dvec3() - DVec3::ONE) * f64::from(0.8_f32);
        let passed = |cosine: f64| {
            let refracted = (1.0 - (1.0 - cosine * cosine) / 2.25).sqrt();
            let left = 1.0 - f64::from(0.8_f32 * point.coat.albedo.at_cosine(cosine as f32));
            DVec3::new(
                tint.x.powf(0.5 / refracted),
                tint.y.powf(0.5 / refracted),
                tint.z.powf(0.5 / refracted),
            ) * left
        };
        let exact = below * passed(cosine) * passed(0.6);
        assert!((found - exact).abs().max_element() <= 3e-5 * exact.max_element(), "{found}, {exact}");
        behind.check_samples(&format!("other side at {cosine}"), LobesToSample::All);
        let front = TestSurface::<CoatedBxdf<PrincipledBxdf<false>>>::new(&point, [0.3; 2], at);
        front.check_samples(&format!("viewer's side at {cosine}"), LobesToSample::All);
        let all = front.sampled_albedo(128) + behind.sampled_albedo(128);
        assert!(all.max_element() < 1.0 + 5e-4, "{all} at {cosine}");
    }
}

#[test]
fn lanes_are_independent() {
    let coats = [(0.0, 0.3, Vec3::ONE), (1.0, 0.001, Vec3::ONE), (0.5, 0.4, TINT)];
    // A weight of 0 occurs only in textures.
    let coat = |(weight, alpha, tint): (f32, f32, Vec3)| {
        let coat = coated((), f32::max(weight, 0.1), alpha, 1.5, tint).coat;
        CoatPoint { weight, ..coat }
    };
    let over = |base: PhongPoint| coats.map(|one| CoatedPoint { coat: coat(one), base });
    let phongs = [phong(RED, 0.0, 1.0), phong(RED, 0.4, 30.0), phong(Vec3::ZERO, 0.5, 5.0)].map(over);
    check_lane_independence::<CoatedBxdf<PhongBxdf>>(phongs.as_flattened());
    let metals = coats.map(|one| CoatedPoint { coat: coat(one), base: conductor([0.2, 0.4]) });
    check_lane_independence::<CoatedBxdf<ConductorBxdf<true, false>>>(&metals);
    check_lane_independence::<CoatedBxdf<ConductorBxdf<true, true>>>(&metals);
    let leaves =
        coats.map(|one| CoatedPoint { coat: coat(one), base: translucent(RED * 0.5, 0.3, TINT * 0.3) });
    check_lane_independence::<CoatedBxdf<TranslucentBxdf<false>>>(&leaves);
    check_lane_independence_with::<CoatedBxdf<TranslucentBxdf<true>>>(&leaves, NarrowLightPath::Through);
    let sheets = coats.map(|one| CoatedPoint { coat: coat(one), base: principled(RED, 0.1, 0.5, 0.3) });
    check_lane_independence::<CoatedBxdf<PrincipledBxdf<false>>>(&sheets);
    check_lane_independence_with::<CoatedBxdf<PrincipledBxdf<true>>>(&sheets, NarrowLightPath::Through);
}
