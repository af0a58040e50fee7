//! Checks that a surface in a packet does not depend on the other surfaces, and a lobe not on the other
//! lobes.

use crate::materials::bsdf::{LobesToSample, ShownLobes};
use crate::materials::bxdf::{Bxdf, ShadingGeometry};
use crate::math::lanes::{PACKET_SIZE, lane, set_lane};
use crate::math::random::unit_generator as random;
use crate::math::{DVec3, Vec3};

use super::lobe_tests::{NarrowLightPath, TANGENT, spherical_direction};
use super::test_packet::OutOfLineTestPacket;
use std::f64::consts::TAU;

/// Checks that values, pdfs, and samples of a surface do not depend on the other lanes.
pub fn check_lane_independence<B: Bxdf>(points: &[B::Point]) {
    check_lane_independence_with::<B>(points, NarrowLightPath::Mirrored);
}

/// [`check_lane_independence`] for the given kind of lighting.
pub fn check_lane_independence_with<B: Bxdf>(points: &[B::Point], lit: NarrowLightPath) {
    check_shown_lobes::<B>(points, lit);
    let normals = [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [lit.light_side_sign() as f32; PACKET_SIZE]];
    let mut next = random(31);
    for first in 0..points.len() {
        let to_eye: [Vec3; PACKET_SIZE] = std::array::from_fn(|_| {
            spherical_direction(f64::from(0.05 + 0.95 * next()), f64::from(next()) * TAU).as_vec3()
        });
        let mut light = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let way = spherical_direction(f64::from(next()), f64::from(next()) * TAU);
            set_lane(&mut light, i, DVec3::new(way.x, way.y, way.z * lit.light_side_sign()).as_vec3());
        }
        let (choices, u) =
            (std::array::from_fn(|_| next()), [(); 2].map(|()| std::array::from_fn(|_| next())));
        let row = |of: &dyn Fn(usize) -> bool| {
            let mut row = OutOfLineTestPacket::<B>::empty();
            for i in (0..PACKET_SIZE).filter(|i| of(*i)) {
                let place = ShadingGeometry {
                    normal: Vec3::Z * lit.light_side_sign() as f32,
                    wo: to_eye[i],
                    tangent: TANGENT,
                };
                row.set_bsdf(i, &points[(first + i) % points.len()], ShownLobes::ALL, &place);
            }
            row
        };
        let numbers = |row: &OutOfLineTestPacket<B>, i: usize| {
            let values = row.f(&light);
            let mut bits: Vec<u32> = lane(&values.f(), i).to_array().map(f32::to_bits).to_vec();
            for lobes in [LobesToSample::All, LobesToSample::Narrow] {
                // If there is no narrow lobe, its pdf and sample are never used.
                if lobes == LobesToSample::All || row.narrow_lobe_mask() & 1 << i != 0 {
                    bits.push(row.pdf(lobes, &normals, &light, &values)[i].to_bits());
                    let sample = lane(&row.sample(lobes, &normals, &choices, &u), i);
                    bits.extend(sample.to_array().map(f32::to_bits));
                }
            }
            bits.push(values.max[i].to_bits());
            bits
        };
        let all = row(&|_| true);
        for i in 0..PACKET_SIZE {
            assert_eq!(
                numbers(&all, i),
                numbers(&row(&|other| other == i), i),
                "surface {}",
                (first + i) % points.len()
            );
        }
    }
}

/// Checks that each lobe is bit-identical whether or not the other lobes are shown, and that the lobes add up
/// to f. Otherwise, the sum of the AOVs would differ from the beauty image, because rays in narrow lobes
/// divide by small pdfs.
pub fn check_shown_lobes<B: Bxdf>(points: &[B::Point], lit: NarrowLightPath) {
    let mut next = random(7);
    for point in points {
        for round in 0..400 {
            let mut turn = |least: f64| {
                spherical_direction(least + (1.0 - least) * f64::from(next()), f64::from(next()) * TAU)
            };
            let (to_eye, any) = (turn(0.05), turn(0.0));
            let near_mirror = DVec3::new(-to_eye.x, -to_eye.y, to_eye.z) + any * 0.1_f64.powi(round % 5);
            let way = if round % 2 == 0 { any } else { near_mirror.normalize() };
            let way = DVec3::new(way.x, way.y, way.z * lit.light_side_sign()).as_vec3();
            let place = ShadingGeometry {
                normal: Vec3::Z * lit.light_side_sign() as f32,
                wo: to_eye.as_vec3(),
                tangent: TANGENT,
            };
            let shown = |diffuse: bool, specular: bool| {
                let mut row = OutOfLineTestPacket::<B>::empty();
                row.set_bsdf(0, point, ShownLobes::Of { diffuse, specular }, &place);
                let mut light = [[0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [1.0; PACKET_SIZE]];
                set_lane(&mut light, 0, way);
                let values = row.f(&light);
                [lane(&values.f(), 0), lane(&values.wide, 0), lane(&values.narrow, 0)]
            };
            let ([f, wide, narrow], of_wide, of_narrow) =
                (shown(true, true), shown(true, false), shown(false, true));
            assert_eq!([of_wide[1], of_narrow[2]], [wide, narrow], "{to_eye} {way}");
            assert_eq!([of_wide[2], of_narrow[1]], [Vec3::ZERO; 2], "{to_eye} {way}");
            let rest = (of_wide[0] + of_narrow[0] - f).abs().max_element();
            assert!(rest <= 2.0 * f32::EPSILON * f.max_element(), "{to_eye} {way}: {f} is off by {rest}");
        }
    }
}
