//! Tests of principled lobes. Compares values with formulas and samples with pdfs, and checks that albedos
//! are at most 1.

use super::*;
use crate::materials::bsdf::LobesToSample;
use crate::materials::bxdfs::lane_tests::{check_lane_independence, check_lane_independence_with};
use crate::materials::bxdfs::lobe_tests::{
    ALPHAS, COSINES, NarrowLightPath, TestSurface, check_values, estimate_close_to_exact, spherical_direction,
};
use crate::materials::bxdfs::reference_tests::reference_microfacet_brdf;
use crate::materials::lookup::WhiteTextureLookup;
use crate::math::DVec3;

fn principled(color: Vec3, metallic: f32, alpha: f32) -> Principled {
    transmitting(color, metallic, 0.0, alpha)
}

fn transmitting(color: Vec3, metallic: f32, transmission: f32, alpha: f32) -> Principled {
    let number = ScalarParameter::Constant;
    Principled::new(PrincipledInputs {
        color: ColorOrTexture::Constant(color),
        metallic: number(metallic),
        roughness: number(alpha.sqrt()),
        ior: 1.6,
        specular: number(0.8),
        specular_color: ColorOrTexture::Constant(Vec3::new(1.0, 0.6, 1.2)),
        transmission: number(transmission),
        diffuse_transmission: ColorOrTexture::Constant(Vec3::ZERO),
    })
}

/// A material with diffuse transmission.
fn leaf(color: Vec3, metallic: f32, transmission: f32, alpha: f32) -> Principled {
    let Principled { inputs, .. } = transmitting(color, metallic, transmission, alpha);
    let diffuse_transmission = ColorOrTexture::Constant(Vec3::new(0.25, 1.0, 0.6));
    Principled::new(PrincipledInputs { diffuse_transmission, ..inputs })
}

fn point(principled: &Principled) -> PrincipledPoint {
    principled.look_up_parameters(&mut WhiteTextureLookup)
}

const RED: Vec3 = Vec3::new(0.7, 0.1, 0.05);

fn subjects() -> impl Iterator<Item = (f32, f32)> {
    ALPHAS.into_iter().flat_map(|alpha| [0.0, 0.4, 1.0].map(|metallic| (alpha, metallic)))
}

#[test]
fn values_match_the_formulas_and_are_reciprocal() {
    for (alpha, metallic) in subjects() {
        let point = point(&principled(RED, metallic, alpha));
        // F0 = min(((ior − 1)/(ior + 1))²·specular_color, 1)·specular.
        let f0 = DVec3::new(1.0, 0.6, 1.2) * (0.6_f64 / 2.6).powi(2) * 0.8;
        let (color, m) = (RED.as_dvec3(), f64::from(metallic));
        let albedo = |cosine: f64| {
            let [normal, grazing] = [point.albedo.normal, point.albedo.grazing]
                .map(|one| f64::from(one.at_cosine(cosine as f32)));
            f0 * normal + DVec3::splat(0.8 * grazing)
        };
        let mean = f0 * f64::from(point.albedo.normal.mean)
            + DVec3::splat(0.8 * f64::from(point.albedo.grazing.mean));
        check_values::<PrincipledBxdf<false>>(
            &format!("α {alpha}, metallic {metallic}"),
            &point,
            [alpha; 2],
            |o, i| {
                let weight = (1.0 - (o + i).length() * 0.5).powi(5);
                let schlick =
                    |normal: DVec3, grazing: f64| normal + (DVec3::splat(grazing) - normal) * weight;
                let fresnel = schlick(f0, 0.8) * (1.0 - m) + schlick(color, 1.0) * m;
                let specular = fresnel * reference_microfacet_brdf(o, i, [f64::from(alpha); 2]);
                let diffuse = color * (1.0 - m) / std::f64::consts::PI
                    * (DVec3::ONE - albedo(o.z))
                    * (DVec3::ONE - albedo(i.z))
                    / (DVec3::ONE - mean);
                specular + diffuse
            },
        );
    }
}

#[test]
fn lanes_are_independent() {
    let points: Vec<PrincipledPoint> = subjects()
        .flat_map(|(alpha, metallic)| [RED, Vec3::ZERO].map(|color| principled(color, metallic, alpha)))
        .map(|one| point(&one))
        .collect();
    check_lane_independence::<PrincipledBxdf<false>>(&points);
}

#[test]
fn samples_follow_the_pdf() {
    for (alpha, metallic) in subjects() {
        for cosine in COSINES {
            let point = point(&principled(RED, metallic, alpha));
            let subject = TestSurface::<PrincipledBxdf<false>>::new(
                &point,
                [alpha; 2],
                spherical_direction(cosine, 0.7),
            );
            let what = format!("α {alpha}, metallic {metallic} at a cosine of {cosine}");
            subject.check_samples(&what, LobesToSample::Narrow);
            if alpha >= 0.2 {
                subject.check_samples(&what, LobesToSample::All);
            }
        }
    }
}

/// Whether an albedo is within half of the bounds below.
fn is_close(sampled: DVec3, exact: DVec3) -> bool {
    (sampled - exact).abs().max_element() < 5e-4 && sampled.max_element() < 1.0 + 2.5e-4
}

#[test]
fn albedos_match_quadrature_and_stay_below_1() {
    for (alpha, metallic) in subjects() {
        for cosine in COSINES {
            for color in [RED, Vec3::ONE] {
                let point = point(&principled(color, metallic, alpha));
                let subject = TestSurface::<PrincipledBxdf<false>>::new(
                    &point,
                    [alpha; 2],
                    spherical_direction(cosine, 0.3),
                );
                let exact = subject.albedo();
                let sampled = estimate_close_to_exact(
                    192,
                    |side| subject.sampled_albedo(side),
                    |sampled| is_close(*sampled, exact),
                );
                let what = format!(
                    "α {alpha}, metallic {metallic} at a cosine of {cosine}: {sampled} instead of {exact}"
                );
                assert!((sampled - exact).abs().max_element() < 1e-3, "{what}");
                assert!(sampled.max_element() < 1.0 + 5e-4, "{what}");
            }
        }
    }
}

#[test]
fn fully_reflective_facets_have_bounded_weights() {
    for alpha in [0.001_f32, 0.002, 0.01, 0.05] {
        let number = ScalarParameter::Constant;
        let white = Principled::new(PrincipledInputs {
            color: ColorOrTexture::Constant(Vec3::ONE),
            metallic: number(0.0),
            roughness: number(alpha.sqrt()),
            ior: 1.5,
            specular: number(1.0),
            specular_color: ColorOrTexture::Constant(Vec3::splat(25.0)),
            transmission: number(0.0),
            diffuse_transmission: ColorOrTexture::Constant(Vec3::ZERO),
        });
        for cosine in [0.01, 0.05, 0.3, 1.0] {
            let subject = TestSurface::<PrincipledBxdf<false>>::new(
                &point(&white),
                [alpha; 2],
                spherical_direction(cosine, 0.7),
            );
            let (largest, mean) = (subject.largest_weight(128), subject.sampled_albedo(128).x);
            assert!(largest < 60.0, "α {alpha} at a cosine of {cosine}: a sample has weight {largest}");
            assert!(mean < 1.0 + 3e-3, "α {alpha} at a cosine of {cosine}: {mean}");
        }
    }
}

/// The tested fractions of transmitted light.
const TRANSMISSIONS: [f32; 2] = [0.6, 1.0];

#[test]
fn transmission_is_the_mirrored_specular_lobe() {
    for ((alpha, metallic), transmission) in
        subjects().filter(|one| one.1 < 1.0).flat_map(|one| TRANSMISSIONS.map(|part| (one, part)))
    {
        let point = point(&transmitting(RED, metallic, transmission, alpha));
        let f0 = DVec3::new(1.0, 0.6, 1.2) * (0.6_f64 / 2.6).powi(2) * 0.8;
        let (part, m) = (f64::from(transmission), f64::from(metallic));
        for (number, cosine) in COSINES.into_iter().enumerate() {
            let to_eye = spherical_direction(cosine, 0.7).as_vec3().as_dvec3();
            let subject = TestSurface::<PrincipledBxdf<true>>::with_light_path(
                &point,
                [alpha; 2],
                to_eye,
                NarrowLightPath::Through,
            );
            for trial in 0..40_u32 {
                let (y, turn) = (f64::from(trial) / 41.0, f64::from(trial) * 2.4 + number as f64);
                let Some((light, _)) = subject.map_to_direction(y, turn) else { continue };
                let light = light.as_vec3().as_dvec3();
                if light.z > -0.02 {
                    continue;
                }
                let (o, i) = (to_eye.normalize(), DVec3::new(light.x, light.y, -light.z).normalize());
                let weight = (1.0 - (o + i).length() * 0.5).powi(5);
                let fresnel = f0 + (DVec3::splat(0.8) - f0) * weight;
                let lobe = reference_microfacet_brdf(o, i, [f64::from(alpha); 2]);
                let exact = RED.as_dvec3() * (DVec3::ONE - fresnel) * (part * (1.0 - m) * lobe);
                let found = subject.evaluate_bsdf(LobesToSample::All, &[light])[0].0;
                let error = if alpha >= 0.05 { 3e-5 } else { 5e-3 };
                let what = format!("α {alpha}, {transmission}, {cosine}: {found} instead of {exact}");
                assert!((found - exact).abs().max_element() <= error * exact.max_element(), "{what}");
            }
        }
    }
}

#[test]
fn diffuse_lobes_are_attenuated_alike() {
    for (alpha, metallic) in subjects().filter(|one| one.1 < 1.0) {
        let point = point(&leaf(RED, metallic, 0.3, alpha));
        let at = spherical_direction(0.6, 0.7);
        let behind = TestSurface::<PrincipledBxdf<true>>::with_light_path(
            &point,
            [1.0; 2],
            at,
            NarrowLightPath::Through,
        );
        let front = TestSurface::<PrincipledBxdf<false>>::new(&point, [1.0; 2], at);
        // The transmittance is limited to 1 − color.
        let ratio = Vec3::new(0.25, 0.9, 0.6).as_dvec3() / RED.as_dvec3();
        for light in COSINES.map(|cosine| spherical_direction(cosine, 1.9)) {
            let below = DVec3::new(light.x, light.y, -light.z);
            let [of_front, of_back] = [
                front.evaluate_bsdf(LobesToSample::All, &[light])[0].1,
                behind.evaluate_bsdf(LobesToSample::All, &[below])[0].1,
            ];
            let off = (of_back - of_front * ratio).abs().max_element();
            assert!(off <= 1e-5 * of_back.max_element(), "α {alpha}: {of_back} and {of_front}");
        }
    }
}

#[test]
fn diffuse_transmission_samples_follow_the_pdf() {
    for (alpha, metallic) in subjects().filter(|one| one.0 >= 0.2 && one.1 < 1.0) {
        for cosine in COSINES {
            let point = point(&leaf(RED, metallic, 0.3, alpha));
            let at = spherical_direction(cosine, 0.7);
            let behind = TestSurface::<PrincipledBxdf<true>>::with_light_path(
                &point,
                [alpha; 2],
                at,
                NarrowLightPath::Through,
            );
            let front = TestSurface::<PrincipledBxdf<false>>::new(&point, [alpha; 2], at);
            for lobes in [LobesToSample::Narrow, LobesToSample::All] {
                let what = format!("{lobes:?}, α {alpha}, metallic {metallic} at a cosine of {cosine}");
                behind.check_samples(&format!("other side, {what}"), lobes);
                front.check_samples(&format!("viewer's side, {what}"), lobes);
            }
        }
    }
}

#[test]
fn samples_on_both_sides_follow_the_pdf() {
    for (alpha, metallic) in subjects().filter(|one| one.1 < 1.0) {
        for cosine in COSINES {
            let point = point(&transmitting(RED, metallic, 0.6, alpha));
            let at = spherical_direction(cosine, 0.7);
            let behind = TestSurface::<PrincipledBxdf<true>>::with_light_path(
                &point,
                [alpha; 2],
                at,
                NarrowLightPath::Through,
            );
            let front = TestSurface::<PrincipledBxdf<false>>::new(&point, [alpha; 2], at);
            let what = format!("α {alpha}, metallic {metallic} at a cosine of {cosine}");
            for lobes in [LobesToSample::Narrow, LobesToSample::All] {
                behind.check_samples(&format!("other side, {lobes:?}, {what}"), lobes);
                if lobes == LobesToSample::Narrow || alpha >= 0.2 {
                    front.check_samples(&format!("viewer's side, {lobes:?}, {what}"), lobes);
                }
            }
        }
    }
}

#[test]
fn two_sided_albedos_match_quadrature() {
    let materials = subjects().flat_map(|one| {
        let (alpha, metallic) = one;
        let clear = |part| transmitting(Vec3::ONE, metallic, part, alpha);
        let leaf = leaf(RED, metallic, 0.3, alpha);
        [(one, "clear", clear(0.6)), (one, "clear", clear(1.0)), (one, "leaf", leaf)]
    });
    // Leaves have four lobes, so they need many samples.
    let is_tested = |alpha: f32, name: &str| name != "leaf" || [0.02, 0.2, 1.0].contains(&alpha);
    for ((alpha, metallic), transmission, material) in
        materials.filter(|((alpha, ..), name, _)| is_tested(*alpha, name))
    {
        for cosine in COSINES {
            let point = point(&material);
            let at = spherical_direction(cosine, 0.3);
            let behind = TestSurface::<PrincipledBxdf<true>>::with_light_path(
                &point,
                [alpha; 2],
                at,
                NarrowLightPath::Through,
            );
            let front = TestSurface::<PrincipledBxdf<false>>::new(&point, [alpha; 2], at);
            let exact = front.albedo() + behind.albedo();
            let sampled = match transmission {
                "leaf" => estimate_close_to_exact(
                    128,
                    |side| front.lobe_stratified_albedo(side) + behind.lobe_stratified_albedo(side),
                    |sampled| is_close(*sampled, exact),
                ),
                _ => estimate_close_to_exact(
                    192,
                    |side| front.sampled_albedo(side) + behind.sampled_albedo(side),
                    |sampled| is_close(*sampled, exact),
                ),
            };
            let what =
                format!("α {alpha}, metallic {metallic}, {transmission} at {cosine}: {sampled}, {exact}");
            assert!((sampled - exact).abs().max_element() < 1e-3, "{what}");
            assert!(sampled.max_element() < 1.0 + 5e-4, "{what}");
        }
    }
}

#[test]
fn transmissive_lanes_are_independent() {
    let points: Vec<PrincipledPoint> = subjects()
        .flat_map(|(alpha, metallic)| {
            let leaf = leaf(RED, metallic, 0.3, alpha);
            [0.0, 0.6, 1.0].map(|part| transmitting(RED, metallic, part, alpha)).into_iter().chain([leaf])
        })
        .map(|one| point(&one))
        .collect();
    check_lane_independence::<PrincipledBxdf<false>>(&points);
    check_lane_independence_with::<PrincipledBxdf<true>>(&points, NarrowLightPath::Through);
}
