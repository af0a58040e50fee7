//! Lobes of principled materials: values against the formulas, samples against the pdf, and albedos of at most 1.

use super::*;
use crate::materials::bsdf::LobeSet;
use crate::materials::lobe_tests::{
    ALPHAS, COSINES, Subject, check_neighbours, check_values, direction, reference,
};
use crate::math::DVec3;

fn principled(color: Vec3, metallic: f32, alpha: f32, coat: [f32; 2]) -> Principled {
    let number = Number::Constant;
    Principled::new(PrincipledInputs {
        color: Color::Constant(color),
        metallic: number(metallic),
        roughness: number(alpha.sqrt()),
        ior: 1.6,
        specular: number(0.8),
        specular_color: Color::Constant(Vec3::new(1.0, 0.6, 1.2)),
        clearcoat: number(coat[0]),
        clearcoat_roughness: number(coat[1].sqrt()),
    })
}

fn point(principled: &Principled) -> PrincipledPoint {
    principled.constant().expect("it has no textures")
}

const RED: Vec3 = Vec3::new(0.7, 0.1, 0.05);

fn subjects() -> impl Iterator<Item = (f32, f32, [f32; 2])> {
    ALPHAS.into_iter().flat_map(|alpha| {
        [(0.0, [0.0, 0.0]), (0.4, [0.6, alpha]), (1.0, [0.0, 0.0])]
            .map(|(metallic, coat)| (alpha, metallic, coat))
    })
}

#[test]
fn values_are_those_of_the_formulas_and_reciprocal() {
    for (alpha, metallic, coat) in subjects() {
        let point = point(&principled(RED, metallic, alpha, coat));
        // F0 = min(((ior − 1)/(ior + 1))²·specular_color, 1)·specular.
        let f0 = DVec3::new(1.0, 0.6, 1.2) * (0.6_f64 / 2.6).powi(2) * 0.8;
        let (color, m) = (RED.as_dvec3(), f64::from(metallic));
        let albedo = |cosine: f64| {
            let [normal, grazing] =
                [point.albedo.normal, point.albedo.grazing].map(|one| f64::from(one.at(cosine as f32)));
            f0 * normal + DVec3::splat(0.8 * grazing)
        };
        let mean = f0 * f64::from(point.albedo.normal.mean)
            + DVec3::splat(0.8 * f64::from(point.albedo.grazing.mean));
        let c = f64::from(coat[0]);
        let through = |cosine: f64| 1.0 - c * f64::from(point.coat_albedo.at(cosine as f32));
        check_values::<PrincipledRow>(
            &format!("α {alpha}, metallic {metallic}"),
            &point,
            [alpha; 2],
            |o, i| {
                let weight = (1.0 - (o + i).length() * 0.5).powi(5);
                let schlick =
                    |normal: DVec3, grazing: f64| normal + (DVec3::splat(grazing) - normal) * weight;
                let fresnel = schlick(f0, 0.8) * (1.0 - m) + schlick(color, 1.0) * m;
                let specular = fresnel * reference(o, i, [f64::from(alpha); 2]);
                let diffuse = color * (1.0 - m) / std::f64::consts::PI
                    * (DVec3::ONE - albedo(o.z))
                    * (DVec3::ONE - albedo(i.z))
                    / (DVec3::ONE - mean);
                let clear = c * (0.04 + 0.96 * weight) * reference(o, i, [f64::from(point.coat_alpha); 2]);
                (specular + diffuse) * (through(o.z) * through(i.z)) + DVec3::splat(clear)
            },
        );
    }
}

#[test]
fn a_surface_gets_the_bits_that_it_gets_alone() {
    let points: Vec<PrincipledPoint> = subjects()
        .flat_map(|(alpha, metallic, coat)| {
            [RED, Vec3::ZERO].map(|color| principled(color, metallic, alpha, coat))
        })
        .map(|one| point(&one))
        .collect();
    check_neighbours::<PrincipledRow>(&points);
}

#[test]
fn samples_are_drawn_by_their_density() {
    for (alpha, metallic, coat) in subjects() {
        for cosine in COSINES {
            let point = point(&principled(RED, metallic, alpha, coat));
            let subject = Subject::<PrincipledRow>::new(&point, [alpha; 2], direction(cosine, 0.7));
            let what = format!("α {alpha}, metallic {metallic} at a cosine of {cosine}");
            subject.check_samples(&what, LobeSet::Narrow);
            if alpha >= 0.2 {
                subject.check_samples(&what, LobeSet::All);
            }
        }
    }
}

#[test]
fn albedos_are_those_of_quadrature_and_never_above_one() {
    for (alpha, metallic, coat) in subjects() {
        for cosine in COSINES {
            for color in [RED, Vec3::ONE] {
                let point = point(&principled(color, metallic, alpha, coat));
                let subject = Subject::<PrincipledRow>::new(&point, [alpha; 2], direction(cosine, 0.3));
                let (sampled, exact) = (subject.sampled_albedo(192), subject.albedo());
                let what = format!(
                    "α {alpha}, metallic {metallic} at a cosine of {cosine}: {sampled} is not {exact}"
                );
                assert!((sampled - exact).abs().max_element() < 1e-3, "{what}");
                assert!(sampled.max_element() < 1.0 + 2e-3, "{what}");
            }
        }
    }
}
