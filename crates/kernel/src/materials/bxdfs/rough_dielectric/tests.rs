//! Tests of rough glass. Compares values with `f64` formulas, samples with pdfs, and albedos with quadrature.

use super::*;
use crate::materials::bsdf::LobesToSample;
use crate::materials::bxdf::Bxdf;
use crate::materials::bxdf_packet::BxdfPacket;
use crate::materials::bxdfs::lane_tests::{check_lane_independence, check_lane_independence_with};
use crate::materials::bxdfs::lobe_tests::{
    ALPHAS, COSINES, NarrowLightPath, TestSurface, TwoSidedSample, estimate_close_to_exact,
    spherical_direction,
};
use crate::materials::bxdfs::reference_tests::{
    beckmann_d, beckmann_lambda, reference_beckmann_brdf, reference_microfacet_brdf, squared_slope,
};
use crate::materials::fresnel::fresnel_dielectric;
use crate::math::DVec3;
use crate::math::random::unit_generator as random;

use std::f64::consts::{PI, TAU};

/// Indices of refraction on the viewer's side and on the other side.
const INDICES: [[f32; 2]; 5] = [[1.0, 1.5], [1.5, 1.0], [1.0, 1.33], [2.4, 1.0], [1.5, 1.33]];

fn glass([near, far]: [f32; 2], alpha: f32) -> RoughDielectricPoint {
    RoughDielectricPoint { near, far, alpha, distribution: MicrofacetDistribution::Ggx }
}

/// The reflection and the transmission of a surface that is seen from a direction.
fn parts<const BECKMANN: bool>(
    point: &RoughDielectricPoint,
    to_eye: DVec3,
) -> (TestSurface<DielectricBxdf<false, BECKMANN>>, TestSurface<DielectricBxdf<true, BECKMANN>>) {
    let (alphas, eta) = ([point.alpha; 2], f64::from(point.far) / f64::from(point.near));
    let reflection = TestSurface::new(point, alphas, to_eye);
    (reflection, TestSurface::with_light_path(point, alphas, to_eye, NarrowLightPath::Refracted(eta)))
}

/// Computes f for transmission of basic radiance, as in Walter et al. (equations 16, 20, 21, 25, and 33, with
/// our G). Also returns the factor by which rounding errors may exceed those of GGX.
fn transmission<const BECKMANN: bool>(point: &RoughDielectricPoint, o: DVec3, i: DVec3) -> [f64; 2] {
    let [near, far, alpha] = [point.near, point.far, point.alpha].map(f64::from);
    let half = -(i * far + o * near).normalize();
    let half = half * half.z.signum();
    let (cos_o, cos_i) = (o.dot(half), i.dot(half));
    if cos_o * o.z <= 0.0 || cos_i * i.z <= 0.0 {
        return [0.0, 1.0];
    }
    let tangent2 = (half.x * half.x + half.y * half.y) / (half.z * half.z);
    let distribution = match BECKMANN {
        true => beckmann_d(half, [alpha; 2]),
        false => alpha.powi(2) / (PI * half.z.powi(4) * (alpha.powi(2) + tangent2).powi(2)),
    };
    let lambda = |d: DVec3| {
        if BECKMANN {
            return beckmann_lambda(d, [alpha; 2]);
        }
        let tangent2 = (1.0 - d.z * d.z) / (d.z * d.z);
        0.5 * ((1.0 + alpha * alpha * tangent2).sqrt() - 1.0)
    };
    let shadowing = 1.0 / (1.0 + lambda(o) + lambda(i));
    let fresnel = exact_reflectance(cos_o.abs(), far / near);
    let jacobian = far * far / (far * cos_i + near * cos_o).powi(2);
    let f = (cos_o * cos_i / (o.z * i.z)).abs() * (1.0 - fresnel) * shadowing * distribution * jacobian;
    [f, if BECKMANN { 1.0 + squared_slope(half, [alpha; 2]) } else { 1.0 }]
}

/// Double-precision Fresnel reflectance.
fn exact_reflectance(cosine: f64, eta: f64) -> f64 {
    let squared = eta * eta - 1.0 + cosine * cosine;
    if squared <= 0.0 {
        return 1.0;
    }
    let root = squared.sqrt();
    let parallel = (eta * eta * cosine - root) / (eta * eta * cosine + root);
    let perpendicular = (cosine - root) / (cosine + root);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Returns a pair of directions. The second one is either near the lobe's peak or arbitrary.
fn random_directions(
    next: &mut impl FnMut() -> f32,
    point: &RoughDielectricPoint,
    is_near: bool,
) -> (DVec3, Option<DVec3>) {
    let to_eye =
        spherical_direction(f64::from(0.05 + 0.95 * next()), f64::from(next()) * TAU).as_vec3().as_dvec3();
    let (y, turn) = (f64::from(0.98 * next()), f64::from(next()) * TAU);
    if is_near {
        let eta = f64::from(point.far) / f64::from(point.near);
        let there = TestSurface::<DielectricBxdf<true, false>>::with_light_path(
            point,
            [point.alpha; 2],
            to_eye,
            NarrowLightPath::Refracted(eta),
        );
        (to_eye, there.map_to_direction(y, turn).map(|(way, _)| way.as_vec3().as_dvec3()))
    } else {
        let way = spherical_direction(f64::from(0.05 + 0.95 * next()), turn);
        (to_eye, Some(DVec3::new(way.x, way.y, -way.z).as_vec3().as_dvec3()))
    }
}

#[test]
fn transmission_matches_the_formulas() {
    check_transmission::<false>();
    check_transmission::<true>();
}

fn check_transmission<const BECKMANN: bool>() {
    let mut next = random(9);
    for (indices, alpha) in INDICES.into_iter().flat_map(|one| ALPHAS.map(|alpha| (one, alpha))) {
        let point = glass(indices, alpha);
        let back = glass([indices[1], indices[0]], alpha);
        // Half vectors are inaccurate if the indices are close.
        let least = f64::from((1.5 - 1.0_f32).min((indices[0] - indices[1]).abs()));
        let (reciprocity, error) = if alpha >= 0.05 { (1e-5, 3e-5) } else { (1e-3, 4e-3) };
        for trial in 0..400 {
            let (to_eye, Some(light)) = random_directions(&mut next, &point, trial % 2 == 0) else {
                continue;
            };
            if light.z > -0.02 {
                continue;
            }
            let eta = f64::from(indices[1]) / f64::from(indices[0]);
            let subject = |point: &RoughDielectricPoint, eye: DVec3, eta: f64| {
                TestSurface::<DielectricBxdf<true, BECKMANN>>::with_light_path(
                    point,
                    [alpha; 2],
                    eye,
                    NarrowLightPath::Refracted(eta),
                )
            };
            let value = |point: &RoughDielectricPoint, eye: DVec3, light: DVec3, eta: f64| {
                subject(point, eye, eta).evaluate_bsdf(LobesToSample::All, &[light])[0].0.x
            };
            let there = value(&point, to_eye, light, eta);
            // Flip both directions to the other side.
            let [eye, light_back] = [light, to_eye].map(|one| DVec3::new(one.x, one.y, -one.z));
            let again = value(&back, eye, light_back, 1.0 / eta);
            let [near, far] = indices.map(f64::from);
            let (one, other) = (there / (far * far), again / (near * near));
            let what = format!("α {alpha}, {indices:?}, from {light} to {to_eye}");
            assert!((one - other).abs() <= reciprocity * one.max(other), "{what}: {one}, reversed {other}");
            let [exact, room] = transmission::<BECKMANN>(&point, to_eye.normalize(), light.normalize());
            assert!(
                (there - exact).abs() <= room * error * (0.5 / least) * exact + 1e-9,
                "{what}: {there} instead of {exact}"
            );
        }
    }
}

#[test]
fn reflection_matches_the_formulas() {
    check_reflection::<false>();
    check_reflection::<true>();
}

fn check_reflection<const BECKMANN: bool>() {
    let mut next = random(10);
    for (indices, alpha) in INDICES.into_iter().flat_map(|one| ALPHAS.map(|alpha| (one, alpha))) {
        let point = glass(indices, alpha);
        let (reciprocity, error) = if alpha >= 0.05 { (1e-5, 3e-5) } else { (1e-3, 5e-3) };
        for _ in 0..200 {
            let place = |next: &mut dyn FnMut() -> f32| {
                spherical_direction(f64::from(0.05 + 0.95 * next()), f64::from(next()) * TAU)
                    .as_vec3()
                    .as_dvec3()
            };
            let to_eye = place(&mut next);
            let subject = TestSurface::<DielectricBxdf<false, BECKMANN>>::new(&point, [alpha; 2], to_eye);
            let (y, turn) = (f64::from(0.98 * next()), f64::from(next()) * TAU);
            let near = subject.map_to_direction(y, turn).map(|(way, _)| way.as_vec3().as_dvec3());
            for light in [Some(place(&mut next)), near].into_iter().flatten().filter(|one| one.z > 0.02) {
                let there = subject.evaluate_bsdf(LobesToSample::All, &[light])[0].0.x;
                let back = TestSurface::<DielectricBxdf<false, BECKMANN>>::new(&point, [alpha; 2], light);
                let back = back.evaluate_bsdf(LobesToSample::All, &[to_eye])[0].0.x;
                let what = format!("α {alpha}, {indices:?}, from {light} to {to_eye}");
                assert!((there - back).abs() <= reciprocity * there, "{what}: {there}, reversed {back}");
                let (o, i) = (to_eye.normalize(), light.normalize());
                let eta = f64::from(point.far) / f64::from(point.near);
                let fresnel = exact_reflectance((o + i).length() * 0.5, eta);
                let alphas = [f64::from(alpha); 2];
                let (lobe, room) = match BECKMANN {
                    true => (reference_beckmann_brdf(o, i, alphas), 1.0 + squared_slope(o + i, alphas)),
                    false => (reference_microfacet_brdf(o, i, alphas), 1.0),
                };
                let exact = fresnel * lobe;
                // Near total reflection, the slope of the reflectance is unbounded.
                let room = if fresnel > 0.5 && fresnel < 1.0 { 20.0 * room } else { room };
                assert!(
                    (there - exact).abs() <= room * error * exact + 1e-12,
                    "{what}: {there} instead of {exact}"
                );
            }
        }
    }
}

#[test]
fn samples_on_both_sides_follow_the_pdf() {
    // 210 cases: three boundaries, seven lobes, five directions, and both sides.
    check_samples::<false>(&INDICES[..3], &ALPHAS);
}

#[test]
fn beckmann_samples_on_both_sides_follow_the_pdf() {
    check_samples::<true>(&INDICES[..2], &[0.02, 0.2, 1.0]);
}

fn check_samples<const BECKMANN: bool>(indices: &[[f32; 2]], alphas: &[f32]) {
    for (indices, &alpha) in indices.iter().flat_map(|one| alphas.iter().map(|alpha| (*one, alpha))) {
        for cosine in COSINES {
            let (reflection, transmission) =
                parts::<BECKMANN>(&glass(indices, alpha), spherical_direction(cosine, 0.7));
            let what = format!("α {alpha}, {indices:?} at a cosine of {cosine}");
            reflection.check_samples(&format!("reflection, {what}"), LobesToSample::All);
            transmission.check_samples(&format!("transmission, {what}"), LobesToSample::All);
        }
    }
}

#[test]
fn two_sided_albedos_match_quadrature() {
    check_albedos::<false>(&INDICES, &ALPHAS);
}

#[test]
fn two_sided_beckmann_albedos_match_quadrature() {
    check_albedos::<true>(&INDICES[..3], &[0.004, 0.05, 0.2, 1.0]);
}

fn check_albedos<const BECKMANN: bool>(indices: &[[f32; 2]], alphas: &[f32]) {
    for (indices, &alpha) in indices.iter().flat_map(|one| alphas.iter().map(|alpha| (*one, alpha))) {
        for cosine in COSINES {
            let (reflection, transmission) =
                parts::<BECKMANN>(&glass(indices, alpha), spherical_direction(cosine, 0.3));
            // Use fine steps because the integrand changes abruptly where total reflection begins.
            let exact =
                [reflection.albedo_with_ring_count(500).x, transmission.albedo_with_ring_count(500).x];
            let sample = |side: u32| {
                [reflection.lobe_stratified_albedo(side).x, transmission.lobe_stratified_albedo(side).x]
            };
            let sampled = estimate_close_to_exact(128, sample, |[one, other]| {
                let off = [one - exact[0], other - exact[1]];
                off[0].abs().max(off[1].abs()).max((off[0] + off[1]).abs()) < 5e-4 && one + other < 1.0 + 5e-6
            });
            let what = format!("α {alpha}, {indices:?} at a cosine of {cosine}: {sampled:?}, {exact:?}");
            let (sum, sum_exact) = (sampled[0] + sampled[1], exact[0] + exact[1]);
            assert!((sum - sum_exact).abs() < 1e-3, "{what}: sum of {sum} instead of {sum_exact}");
            assert!(sum < 1.0 + 1e-5, "{what}: {sum}");
            for (sampled, exact) in sampled.into_iter().zip(exact) {
                assert!((sampled - exact).abs() < 1e-3, "{what}");
            }
        }
    }
}

#[test]
fn narrow_lobes_approach_smooth_glass() {
    for indices in INDICES {
        for cosine in [0.3, 0.7, 1.0] {
            let (reflection, transmission) =
                parts::<false>(&glass(indices, 0.001), spherical_direction(cosine, 0.2));
            let smooth = f64::from(fresnel_dielectric(cosine as f32, indices[1] / indices[0]).0);
            let (reflected, through) = (reflection.sampled_albedo(128).x, transmission.sampled_albedo(128).x);
            assert!((reflected - smooth).abs() < 1e-3, "{indices:?}, {cosine}: {reflected}, not {smooth}");
            assert!(
                (through + smooth - 1.0).abs() < 1e-3,
                "{indices:?}, {cosine}: {through} + {smooth} should be 1"
            );
        }
    }
}

#[test]
fn paths_continue_on_exactly_one_side() {
    for indices in INDICES {
        let (reflection, transmission) = parts::<false>(&glass(indices, 0.4), spherical_direction(0.5, 0.3));
        let (up, down) = (
            reflection.sample_directions(LobesToSample::All, 32),
            transmission.sample_directions(LobesToSample::All, 32),
        );
        let mut reflected = 0;
        for (up, down) in up.into_iter().zip(down) {
            // Both sides use the same random numbers. The unused side returns a direction into the surface.
            let continues = [up != DVec3::NEG_Z, down != DVec3::Z];
            assert!(continues[0] != continues[1], "{up} {down}");
            reflected += u32::from(continues[0]);
        }
        assert!(reflected > 0 && reflected < 1024, "{indices:?}: {reflected}");
    }
}

#[test]
fn two_sided_samples_match_one_sided_samples() {
    check_two_sided_samples::<false>();
    check_two_sided_samples::<true>();
}

fn check_two_sided_samples<const BECKMANN: bool>() {
    for (indices, alpha) in INDICES.iter().flat_map(|one| ALPHAS.map(|alpha| (*one, alpha))) {
        for cosine in COSINES {
            let point = glass(indices, alpha);
            let (reflection, transmission) = parts::<BECKMANN>(&point, spherical_direction(cosine, 0.3));
            let alone = [
                reflection.sample_directions(LobesToSample::All, 16),
                transmission.sample_directions(LobesToSample::All, 16),
            ];
            let rows: [Vec<TwoSidedSample>; 2] = [
                reflection
                    .sample_reflection_or_transmission(16, BxdfPacket::sample_reflection_or_transmission),
                transmission
                    .sample_reflection_or_transmission(16, BxdfPacket::sample_reflection_or_transmission),
            ];
            let directions: Vec<DVec3> = rows[0].iter().map(|sample| sample.direction).collect();
            let by_directions = [
                reflection.evaluate_bsdf(LobesToSample::All, &directions),
                transmission.evaluate_bsdf(LobesToSample::All, &directions),
            ];
            for (i, (up, down)) in rows[0].iter().zip(&rows[1]).enumerate() {
                let what = format!("α {alpha}, {indices:?} at a cosine of {cosine}, sample {i}");
                // The vertices on both sides generate the same continuation, which is only on one side.
                assert_eq!((up.direction, up.density, up.share), (down.direction, down.density, down.share));
                assert_ne!(up.is_beyond, down.is_beyond, "{what}");
                let side = usize::from(up.is_beyond);
                assert_eq!(up.direction, alone[side][i], "{what}");
                let (f, _, pdf) = by_directions[side][i];
                let (f, height) = (f.x, up.direction.z * [1.0, -1.0][side]);
                // Values recomputed from directions are less accurate for narrow lobes, for close indices,
                // and for facets near total reflection.
                let least = f64::from((indices[0] - indices[1]).abs()).min(0.5);
                let there = if side == 0 { indices[0] } else { indices[1] };
                let half = (spherical_direction(cosine, 0.3) * f64::from(indices[0])
                    + up.direction * f64::from(there))
                .normalize();
                let (eta, at_facet) = (
                    f64::from(indices[1]) / f64::from(indices[0]),
                    spherical_direction(cosine, 0.3).dot(half),
                );
                let refracted = (eta * eta - 1.0 + at_facet * at_facet).abs();
                let rounding = 2.0 * f64::from(f32::EPSILON) / refracted.max(1e-9);
                let room = if BECKMANN { 1.0 + squared_slope(half, [f64::from(alpha); 2]) } else { 1.0 };
                let error = room * 0.5 / least * (1e-4 + 3e-6 / f64::from(alpha) + rounding);
                if height < 0.02 || pdf == 0.0 || up.density == 0.0 {
                    assert!(
                        height < 0.02 || pdf == 0.0 && up.density == 0.0,
                        "{what}: {pdf}, {}",
                        up.density
                    );
                    continue;
                }
                assert!((up.density - pdf).abs() < error * pdf, "{what}: {} instead of {pdf}", up.density);
                let share = f * height / pdf;
                assert!((up.share - share).abs() < 1e-4 * share, "{what}: {} instead of {share}", up.share);
            }
        }
    }
}

#[test]
fn lanes_are_independent() {
    let points: Vec<RoughDielectricPoint> =
        INDICES.into_iter().flat_map(|one| [0.001, 0.2, 1.0].map(|alpha| glass(one, alpha))).collect();
    check_lane_independence::<DielectricBxdf<false, false>>(&points);
    check_lane_independence::<DielectricBxdf<false, true>>(&points);
    check_lane_independence_with::<DielectricBxdf<true, false>>(&points, NarrowLightPath::Through);
    check_lane_independence_with::<DielectricBxdf<true, true>>(&points, NarrowLightPath::Through);
    const { assert!(<DielectricBxdf<true, false> as Bxdf>::SENDS_RAYS) };
}
