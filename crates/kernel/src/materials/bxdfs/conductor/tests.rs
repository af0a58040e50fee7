//! Tests of conductor lobes. Compares values with `f64` formulas, samples with pdfs, and albedos with
//! quadrature.

use super::elements::NamedConductor;
use super::*;
use crate::choice::Choice;
use crate::materials::bsdf::LobesToSample;
use crate::materials::bxdfs::lane_tests::check_lane_independence;
use crate::materials::bxdfs::lobe_tests::{
    ALPHAS, COSINES, TestSurface, check_beckmann_values, check_values, estimate_close_to_exact,
    spherical_direction,
};
use crate::materials::bxdfs::reference_tests::{reference_beckmann_brdf, reference_microfacet_brdf};
use crate::math::DVec3;

/// Values of α for tests of the Beckmann distribution. There are few, because sampling it is slow.
const BECKMANN_ALPHAS: [f32; 4] = [0.004, 0.05, 0.2, 1.0];

/// α along u and v for each α: isotropic, stretched along v, and stretched along u.
fn shapes(alpha: f32) -> [[f32; 2]; 3] {
    [[alpha; 2], [alpha, (3.0 * alpha).min(1.0)], [(2.0 * alpha).min(1.0), alpha]]
}

fn schlick(alphas: [f32; 2]) -> ConductorPoint {
    ConductorPoint { fresnel: FresnelPoint::from_schlick(Vec3::new(1.0, 0.78, 0.34)), alphas }
}

fn of_element(element: NamedConductor, alphas: [f32; 2]) -> ConductorPoint {
    let [first, second] = element.complex_ior();
    ConductorPoint { fresnel: FresnelPoint { first, second }, alphas }
}

#[test]
fn values_match_the_formulas_and_are_reciprocal() {
    for alphas in ALPHAS.into_iter().flat_map(shapes) {
        let wide = alphas.map(f64::from);
        let cosine = |o: DVec3, i: DVec3| (o + i).length() * 0.5;
        let first = DVec3::new(1.0, 0.78, 0.34);
        check_values::<ConductorBxdf<true, false>>(
            &format!("Schlick {alphas:?}"),
            &schlick(alphas),
            alphas,
            |o, i| {
                let fresnel = first + (DVec3::ONE - first) * (1.0 - cosine(o, i)).powi(5);
                fresnel * reference_microfacet_brdf(o, i, wide)
            },
        );
        let copper = of_element(NamedConductor::Copper, alphas);
        check_values::<ConductorBxdf<true, false>>(&format!("copper {alphas:?}"), &copper, alphas, |o, i| {
            let fresnel = copper.fresnel.reflectance(cosine(o, i) as f32).as_dvec3();
            fresnel * reference_microfacet_brdf(o, i, wide)
        });
    }
}

#[test]
fn lanes_are_independent() {
    let points = ALPHAS
        .into_iter()
        .flat_map(|alpha| [schlick([alpha; 2]), of_element(NamedConductor::Iron, [alpha; 2])]);
    check_lane_independence::<ConductorBxdf<false, false>>(&points.collect::<Vec<_>>());
    let points = ALPHAS.into_iter().flat_map(shapes).map(|alphas| of_element(NamedConductor::Iron, alphas));
    let points = points.collect::<Vec<_>>();
    check_lane_independence::<ConductorBxdf<true, false>>(&points);
    check_lane_independence::<ConductorBxdf<true, true>>(&points);
}

#[test]
fn beckmann_values_match_the_formulas() {
    for alphas in ALPHAS.into_iter().flat_map(shapes) {
        let wide = alphas.map(f64::from);
        let first = DVec3::new(1.0, 0.78, 0.34);
        let what = format!("Beckmann {alphas:?}");
        check_beckmann_values::<ConductorBxdf<true, true>>(&what, &schlick(alphas), alphas, |o, i| {
            let fresnel = first + (DVec3::ONE - first) * (1.0 - (o + i).length() * 0.5).powi(5);
            fresnel * reference_beckmann_brdf(o, i, wide)
        });
    }
}

#[test]
fn beckmann_samples_follow_the_pdf() {
    for alphas in BECKMANN_ALPHAS.into_iter().flat_map(shapes) {
        for cosine in COSINES {
            let at = spherical_direction(cosine, 0.7);
            let subject = TestSurface::<ConductorBxdf<true, true>>::new(&schlick(alphas), alphas, at);
            subject.check_samples(&format!("α {alphas:?} at a cosine of {cosine}"), LobesToSample::All);
        }
    }
}

#[test]
fn beckmann_albedos_match_quadrature() {
    for alphas in BECKMANN_ALPHAS.into_iter().flat_map(shapes) {
        for cosine in COSINES {
            let at = spherical_direction(cosine, 0.3);
            let white = ConductorPoint { fresnel: FresnelPoint::from_schlick(Vec3::ONE), alphas };
            let subject = TestSurface::<ConductorBxdf<true, true>>::new(&white, alphas, at);
            let exact = subject.reference_albedo(|o, i| reference_beckmann_brdf(o, i, alphas.map(f64::from)));
            let is_close = |sampled: &f64| (sampled - exact).abs() < 5e-4 && *sampled < 1.0 + 5e-6;
            let sampled = estimate_close_to_exact(192, |side| subject.sampled_albedo(side).x, is_close);
            let what = format!("α {alphas:?} at a cosine of {cosine}: {sampled} instead of {exact}");
            assert!((sampled - exact).abs() < 1e-3, "{what}");
            assert!(sampled < 1.0 + 1e-5, "{what}");
        }
    }
}

#[test]
fn isotropic_packets_match_brushed_packets() {
    for alpha in ALPHAS {
        let (point, at) = (schlick([alpha; 2]), spherical_direction(0.6, 0.3));
        let round = TestSurface::<ConductorBxdf<false, false>>::new(&point, [alpha; 2], at);
        let brushed = TestSurface::<ConductorBxdf<true, false>>::new(&point, [alpha; 2], at);
        let (one, other) = (round.sampled_albedo(64), brushed.sampled_albedo(64));
        assert!((one - other).abs().max_element() < 1e-3, "α {alpha}: {one} and {other}");
        round.check_samples(&format!("α {alpha}"), LobesToSample::All);
        let wide = [f64::from(alpha); 2];
        check_values::<ConductorBxdf<false, false>>(&format!("α {alpha}"), &point, [alpha; 2], |o, i| {
            let first = DVec3::new(1.0, 0.78, 0.34);
            (first + (DVec3::ONE - first) * (1.0 - (o + i).length() * 0.5).powi(5))
                * reference_microfacet_brdf(o, i, wide)
        });
    }
}

#[test]
fn samples_follow_the_pdf() {
    // Test 21 lobes in five directions.
    for alphas in ALPHAS.into_iter().flat_map(shapes) {
        for cosine in COSINES {
            let subject = TestSurface::<ConductorBxdf<true, false>>::new(
                &schlick(alphas),
                alphas,
                spherical_direction(cosine, 0.7),
            );
            subject.check_samples(&format!("α {alphas:?} at a cosine of {cosine}"), LobesToSample::All);
        }
    }
}

#[test]
fn sampled_albedos_match_quadrature() {
    for alphas in ALPHAS.into_iter().flat_map(shapes) {
        for cosine in COSINES {
            for point in [schlick(alphas), of_element(NamedConductor::Gold, alphas)] {
                let subject = TestSurface::<ConductorBxdf<true, false>>::new(
                    &point,
                    alphas,
                    spherical_direction(cosine, 0.3),
                );
                let exact = subject.albedo();
                let is_close = |sampled: &DVec3| {
                    (*sampled - exact).abs().max_element() < 5e-4 && sampled.max_element() < 1.0 + 5e-4
                };
                let sampled = estimate_close_to_exact(192, |side| subject.sampled_albedo(side), is_close);
                let what = format!("α {alphas:?} at a cosine of {cosine}: {sampled} instead of {exact}");
                assert!((sampled - exact).abs().max_element() < 1e-3, "{what}");
                assert!(sampled.max_element() < 1.0 + 1e-3, "{what}");
            }
        }
    }
}

#[test]
fn narrow_lobes_approach_a_mirror() {
    for element in NamedConductor::ALL {
        for cosine in [0.3, 0.7, 1.0] {
            let point = of_element(*element, [0.001; 2]);
            let albedo = TestSurface::<ConductorBxdf<true, false>>::new(
                &point,
                [0.001; 2],
                spherical_direction(cosine, 0.0),
            )
            .sampled_albedo(64);
            let mirror = point.fresnel.reflectance(cosine as f32).as_dvec3();
            assert!((albedo - mirror).abs().max_element() < 1e-3, "{element:?}: {albedo}, not {mirror}");
        }
    }
}

#[test]
fn element_reflectances_match_reference_values() {
    // Reflectance at normal incidence: ((η − 1)² + k²)/((η + 1)² + k²).
    for (element, known) in [
        (NamedConductor::Gold, [0.968, 0.746, 0.372]),
        (NamedConductor::Silver, [0.989, 0.984, 0.977]),
        (NamedConductor::Copper, [0.921, 0.620, 0.520]),
        (NamedConductor::Aluminium, [0.909, 0.916, 0.924]),
        (NamedConductor::Iron, [0.528, 0.513, 0.493]),
        (NamedConductor::Chromium, [0.550, 0.556, 0.555]),
        (NamedConductor::Titanium, [0.614, 0.580, 0.541]),
    ] {
        let found = of_element(element, [1.0; 2]).fresnel.reflectance(1.0);
        assert!((found - Vec3::from_array(known)).abs().max_element() < 1e-3, "{element:?}: {found}");
    }
}

#[test]
fn conductors_match_other_quadratures() {
    // The spectra of `assets/metals.csv` in steps of 1 nm from 360 to 830 nm, weighted by the tabulated matching
    // functions of CIE 1931 instead of fits. First the reflectance of the mean η and k, then the mean of the
    // spectral reflectance, which differs where the reflectance has an edge.
    for (name, of_means, mean) in [
        ("Ag", [0.970, 0.959, 0.912], [0.970, 0.960, 0.913]),
        ("Al", [0.914, 0.922, 0.925], [0.914, 0.921, 0.925]),
        ("Au", [0.961, 0.809, 0.352], [0.995, 0.788, 0.337]),
        ("Cu", [0.944, 0.632, 0.536], [0.935, 0.638, 0.534]),
        ("CuZn", [0.885, 0.783, 0.402], [0.896, 0.781, 0.414]),
        ("Cr", [0.638, 0.663, 0.709], [0.637, 0.662, 0.705]),
        ("MgO", [0.072, 0.073, 0.075], [0.072, 0.073, 0.075]),
        ("TiN", [0.592, 0.467, 0.222], [0.601, 0.463, 0.226]),
        ("TiO2", [0.233, 0.244, 0.274], [0.233, 0.244, 0.274]),
        ("W", [0.514, 0.496, 0.466], [0.514, 0.496, 0.467]),
    ] {
        let conductor = NamedConductor::named(name).expect("a conductor");
        let found = of_element(conductor, [1.0; 2]).fresnel.reflectance(1.0);
        let off = |known: [f32; 3]| (found - Vec3::from_array(known)).abs().max_element();
        assert!(off(of_means) < 3e-3 && off(mean) < 0.04, "{name}: {found}");
    }
}

#[test]
fn conductors_conserve_energy_and_have_their_tint() {
    let reflectance = |conductor: NamedConductor| of_element(conductor, [1.0; 2]).fresnel.reflectance(1.0);
    for &conductor in NamedConductor::ALL {
        let [eta, k] = conductor.complex_ior();
        assert!(eta.min_element() > 0.0 && k.min_element() >= 0.0, "{conductor:?}");
        let found = reflectance(conductor);
        assert!(found.min_element() > 0.0 && found.max_element() <= 1.0, "{conductor:?}: {found}");
    }
    for yellow in ["gold", "Au", "copper", "Cu", "CuZn", "TiN"] {
        let Vec3 { x, y, z } = reflectance(NamedConductor::named(yellow).expect("a conductor"));
        assert!(x > y + 0.05 && y > z + 0.05, "{yellow}: {x} {y} {z}");
    }
    // Both measurements of a metal are similar.
    for (name, symbol) in [("gold", "Au"), ("silver", "Ag"), ("copper", "Cu"), ("aluminium", "Al")] {
        let [a, b] =
            [name, symbol].map(|name| reflectance(NamedConductor::named(name).expect("a conductor")));
        assert!((a - b).abs().max_element() < 0.07, "{name}: {a} {b}");
    }
}

#[test]
fn anisotropy_stretches_alpha() {
    // α/a along u and α·a along v, with a = √(1 − 0.9·|anisotropy|).
    let [u, v] = microfacet::alphas_from_roughness(0.5, 0.8);
    let a = (1.0_f32 - 0.72).sqrt();
    assert!((u - 0.25 / a).abs() < 1e-6 && (v - 0.25 * a).abs() < 1e-6);
    assert_eq!(microfacet::alphas_from_roughness(0.5, -0.8), [v, u]);
    assert_eq!(microfacet::alphas_from_roughness(0.5, 0.0), [0.25; 2]);
}
