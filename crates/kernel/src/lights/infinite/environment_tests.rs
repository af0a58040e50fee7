use std::f64::consts::{PI, TAU};

use super::*;
use crate::lights::infinite::MapRowPlacement;
use crate::materials::texels::{TexelData, Texels};
use crate::math::{DMat3, DVec3};
use crate::sampling::{Dimension, PixelSampler};

/// A map with texels that are computed from their column and row.
fn texels_from_fn(width: u32, height: u32, color: impl Fn(u32, u32) -> Vec3) -> Arc<Texels> {
    let places = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    let data = TexelData::Float(places.map(|(column, row)| color(column, row)).collect());
    Arc::new(Texels { width, height, data, unusable: 0 })
}

fn environment_from_texels(texels: &Arc<Texels>, degrees: f64) -> Environment {
    oriented(texels, MapOrientation::from_azimuth_degrees(degrees))
}

fn oriented(texels: &Arc<Texels>, orientation: MapOrientation) -> Environment {
    let sky = EnvironmentMap::new(Arc::clone(texels)).expect("light");
    Environment::from_map(Arc::new(sky), Vec3::ONE, orientation)
}

/// A rotation about a direction that is not an axis.
fn tilted() -> DMat3 {
    DMat3::from_axis_angle(DVec3::new(2.0, -1.0, 3.0).normalize(), 1.2)
}

/// An irregular map with black areas and a few bright spots.
fn irregular_texels(width: u32, height: u32) -> Arc<Texels> {
    texels_from_fn(width, height, |x, y| {
        let random = (x.wrapping_mul(7919).wrapping_add(y.wrapping_mul(104_729)) >> 3) % 97;
        match random {
            0..40 => Vec3::ZERO,
            96 => Vec3::new(300.0, 200.0, 100.0),
            _ => Vec3::new(random as f32, 1.0, 97.0 - random as f32) / 97.0,
        }
    })
}

fn random_pair(i: u32) -> [f32; 2] {
    PixelSampler::new(5, i >> 16, 3, i & 0xffff).pair(1, Dimension::Light(0)).to_array()
}

/// Computes the color in a direction in double precision, for reference.
fn reference_color(texels: &Texels, direction: DVec3, degrees: f64) -> DVec3 {
    // Undo the rotation about +y.
    let (sin, cos) = (-degrees).to_radians().sin_cos();
    let d =
        DVec3::new(direction.x * cos + direction.z * sin, direction.y, direction.z * cos - direction.x * sin);
    let (u, v) = (0.5 + d.x.atan2(-d.z) / TAU, d.y.clamp(-1.0, 1.0).acos() / PI);
    let (x, y) = (u * f64::from(texels.width) - 0.5, v * f64::from(texels.height) - 0.5);
    let at = |i: f64, j: f64| {
        let column = (i as i64).rem_euclid(i64::from(texels.width)) as u32;
        let row = (j as i64).clamp(0, i64::from(texels.height) - 1) as u32;
        texels.get(column, row).as_dvec3()
    };
    let (i, j) = (x.floor(), y.floor());
    let upper = at(i, j).lerp(at(i + 1.0, j), x - i);
    upper.lerp(at(i, j + 1.0).lerp(at(i + 1.0, j + 1.0), x - i), y - j)
}

fn random_directions(count: u32) -> impl Iterator<Item = Vec3> {
    let of = |u: [f32; 2]| warp::cone([u[0] * 2.0, u[1]], 1.0);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    (0..count).map(move |i| of(random_pair(i))).chain(axes)
}

#[test]
fn lookups_match_the_reference() {
    for (width, height) in [(1, 1), (2, 1), (1, 3), (7, 5), (64, 32)] {
        let texels = texels_from_fn(width, height, |x, y| {
            Vec3::new((x % 5) as f32, (y % 3) as f32, ((x + y) % 2) as f32)
        });
        for degrees in [0.0, 90.0, -30.0, 400.0] {
            let environment = Environment::Map {
                sky: Arc::new(
                    EnvironmentMap::new(texels_from_fn(width, height, |x, y| texels.get(x, y) + Vec3::ONE))
                        .expect("light"),
                ),
                factor: Vec3::new(1.0, 2.0, 3.0),
                orientation: MapOrientation::from_azimuth_degrees(degrees),
            };
            // At the poles, any azimuth is correct.
            for direction in random_directions(4000).filter(|direction| direction.y.abs() < 1.0) {
                let expected = (reference_color(&texels, direction.as_dvec3(), degrees) + 1.0)
                    * DVec3::new(1.0, 2.0, 3.0);
                let found = environment.radiance_and_pdf(direction).0.as_dvec3();
                assert!(
                    (found - expected).length() < 2e-4 * f64::from(width.max(8)),
                    "{direction}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn rotated_maps_move_with_their_axes() {
    let texels = irregular_texels(16, 8);
    let rotated = oriented(&texels, MapOrientation::Rotation(tilted().as_mat3()));
    let packet = |direction: Vec3| direction.to_array().map(|part| [part; PACKET_SIZE]);
    // Near the poles of the map, rounding errors change the azimuth.
    let directions = || random_directions(1000).filter(|direction| direction.y.abs() < 0.99);
    for direction in directions() {
        let in_world = tilted() * direction.as_dvec3();
        let expected = reference_color(&texels, direction.as_dvec3(), 0.0);
        let (found, pdf) = rotated.radiance_and_pdf(in_world.as_vec3());
        assert!((found.as_dvec3() - expected).length() < 1e-2, "{direction}: {found} {expected}");
        let (colors, pdfs) = rotated.radiance_and_pdf_packet(&packet(in_world.as_vec3()));
        assert_eq!((lane(&colors, 5), pdfs[5]), (found, pdf));
    }
    // A rotation about +y equals a turn.
    let turned = environment_from_texels(&texels, 50.0);
    let about_y = DMat3::from_rotation_y(50.0_f64.to_radians()).as_mat3();
    let rotated = oriented(&texels, MapOrientation::Rotation(about_y));
    for direction in directions() {
        let [turned, rotated] =
            [&turned, &rotated].map(|environment| environment.radiance_and_pdf(direction).0);
        assert!((turned - rotated).length() < 1e-2, "{direction}: {turned} {rotated}");
    }
}

/// With rows at the poles, a map that is linear in the row is linear in the polar angle.
#[test]
fn rows_at_the_poles_are_interpolated_exactly() {
    for height in [2, 3, 17] {
        let texels = texels_from_fn(8, height, |_, y| Vec3::splat(y as f32 / (height - 1) as f32));
        let map = EnvironmentMap::with_row_placement(texels, MapRowPlacement::Poles).expect("light");
        for direction in random_directions(500) {
            let (color, _) = map.lookup_color_and_pdf(direction, 0.0);
            let expected = (f64::from(direction.y).clamp(-1.0, 1.0).acos() / PI) as f32;
            assert!((color.x - expected).abs() < 2e-5, "{direction}: {} {expected}", color.x);
        }
        assert!((map.mean().x - 0.5).abs() < 1e-5, "{}", map.mean());
        let (mut sum, count) = (0.0, 20_000);
        for i in 0..count {
            let (direction, color, pdf) = map.sample(random_pair(i), 0.25);
            let (looked_up, same_pdf) = map.lookup_color_and_pdf(direction, 0.25);
            assert!(
                (color - looked_up).length() < 1e-3 && (pdf / same_pdf - 1.0).abs() < 1e-2,
                "{direction}"
            );
            sum += f64::from(color.x / pdf);
        }
        // ∫ θ/π dω = 2π.
        assert!((sum / f64::from(count) / TAU - 1.0).abs() < 0.02, "{}", sum / f64::from(count));
    }
}

#[test]
fn sample_pdfs_equal_direction_pdfs() {
    for texels in [
        irregular_texels(64, 32),
        irregular_texels(1, 1),
        irregular_texels(5, 3),
        irregular_texels(1000, 500),
    ] {
        let Some(sky) = EnvironmentMap::new(texels) else { continue };
        let sky = Arc::new(sky);
        let orientations =
            [MapOrientation::from_azimuth_degrees(77.0), MapOrientation::Rotation(tilted().as_mat3())];
        let (mut found, mut off) = (0, 0);
        for i in 0..20_000 {
            let orientation = orientations[i as usize % 2];
            let environment = Environment::from_map(Arc::clone(&sky), Vec3::new(1.0, 0.5, 2.0), orientation);
            let Some(sample) = environment.sample(Vec3::Y, random_pair(i)) else { continue };
            let (radiance, density) = environment.radiance_and_pdf(sample.direction);
            // Rounding the direction changes the result near a black corner of a cell and at cell borders.
            let expected = radiance * (1.0 / density);
            off += u32::from(!((sample.weight - expected).length() <= 2e-3 * expected.length()));
            assert!((sample.direction.length() - 1.0).abs() < 1e-6);
            let row = environment
                .sample_packet(&[[0.0; PACKET_SIZE]; 3], &random_pair(i).map(|u| [u; PACKET_SIZE]));
            assert_eq!(lane(&row.directions, 3), sample.direction);
            assert_eq!(lane(&row.weights, 3), sample.weight);
            found += 1;
        }
        assert!(found > 19_000 && off < 100, "{off} of {found} samples differ");
    }
}

/// For a gray map, every sample should have a weight of 4π times the mean. Rows near the poles deviate
/// because they are interpolated by angle but sampled by height.
#[test]
fn sampling_density_follows_interpolated_light() {
    let (width, height) = (64, 32);
    let texels = texels_from_fn(width, height, |x, y| Vec3::splat(1.0 + ((x * 7 + y * 13) % 10) as f32));
    let environment = environment_from_texels(&texels, 10.0);
    let Environment::Map { sky, .. } = &environment else { panic!("a map") };
    let expected = 4.0 * PI * sky.mean_luminance();
    let mut sum = 0.0;
    for i in 0..20_000 {
        let sample = environment.sample(Vec3::Y, random_pair(i)).expect("light");
        let weight = f64::from(sample.weight.x);
        let is_near_pole = sample.direction.y.abs() > 0.7;
        let off = (weight / expected - 1.0).abs();
        assert!(is_near_pole || off < 0.05, "{}: {weight} {expected}", sample.direction);
        sum += weight / 20_000.0;
    }
    assert!((sum / expected - 1.0).abs() < 1e-3, "{sum} {expected}");
}

#[test]
fn pdfs_integrate_to_one_and_cover_all_light() {
    for texels in [
        irregular_texels(64, 32),
        texels_from_fn(32, 16, |x, y| Vec3::splat(f32::from(u8::from(x == 9 && y == 0)))),
    ] {
        let environment = environment_from_texels(&texels, 30.0);
        // The grid avoids column borders, where rounding affects the result.
        let (columns, rows) = (256, 4096);
        let mut whole = 0.0;
        for (i, j) in (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))) {
            let phi = (f64::from(i) + 0.5) / f64::from(columns) * TAU;
            let (sin, cos) = ((f64::from(j) + 0.5) / f64::from(rows) * PI).sin_cos();
            let direction = DVec3::new(sin * phi.sin(), cos, -sin * phi.cos()).as_vec3();
            let (radiance, density) = environment.radiance_and_pdf(direction);
            assert!(density > 0.0 || radiance == Vec3::ZERO, "{direction}: {radiance}");
            whole += f64::from(density) * sin * PI / f64::from(rows) * TAU / f64::from(columns);
        }
        assert!((whole - 1.0).abs() < 5e-3, "{whole}");
    }
}

/// χ² test that compares sample counts with the pdfs, over cells of (rotation, height). Cells with fewer than
/// 5 expected samples are merged.
#[test]
fn sample_frequencies_match_the_pdf() {
    let (width, height) = (24_usize, 12_usize);
    for orientation in
        [MapOrientation::from_azimuth_degrees(135.0), MapOrientation::Rotation(tilted().as_mat3())]
    {
        let environment = oriented(&irregular_texels(width as u32, height as u32), orientation);
        let (columns, rows) = (3 * width, 64);
        let count = 1_000_000;
        let mut counts = vec![0.0; columns * rows];
        for i in 0..count {
            // Use independent random numbers, because samples of a single pixel are stratified.
            let number = |salt: u32| {
                let bits = (i * 2 + salt).wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
                let bits = (bits ^ bits >> 15).wrapping_mul(0x2c1b_3c6d);
                let bits = (bits ^ bits >> 12).wrapping_mul(0x297a_2d39);
                ((bits ^ bits >> 15) >> 8) as f32 / (1 << 24) as f32
            };
            let direction = environment.sample_direction_and_weight([number(0), number(1)]).0.as_dvec3();
            let across = (0.5 + direction.x.atan2(-direction.z) / TAU).clamp(0.0, 1.0 - 1e-12);
            let up = (0.5 - direction.y * 0.5).clamp(0.0, 1.0 - 1e-12);
            counts[(up * rows as f64) as usize * columns + (across * columns as f64) as usize] += 1.0;
        }
        let expected = |cell: usize| {
            let steps = 24;
            let mut sum = 0.0;
            for (i, j) in (0..steps).flat_map(|j| (0..steps).map(move |i| (i, j))) {
                let at = |k: usize, of: usize| k as f64 + (of as f64 + 0.5) / steps as f64;
                let phi = (at(cell % columns, i) / columns as f64 - 0.5) * TAU;
                let y = 1.0 - 2.0 * at(cell / columns, j) / rows as f64;
                let sin = (1.0 - y * y).sqrt();
                let direction = DVec3::new(sin * phi.sin(), y, -sin * phi.cos()).as_vec3();
                sum += f64::from(environment.radiance_and_pdf(direction).1);
            }
            sum / (steps * steps) as f64 * 2.0 * TAU / (columns * rows) as f64 * f64::from(count)
        };
        let (mut statistic, mut freedom, mut pooled) = (0.0, 0.0, (0.0, 0.0));
        for (cell, count) in counts.iter().enumerate() {
            pooled = (pooled.0 + count, pooled.1 + expected(cell));
            if pooled.1 >= 5.0 {
                statistic += (pooled.0 - pooled.1) * (pooled.0 - pooled.1) / pooled.1;
                freedom += 1.0;
                pooled = (0.0, 0.0);
            }
        }
        // Wilson–Hilferty approximation of χ². The midpoint sums above are slightly inaccurate at cell
        // borders.
        let normal =
            ((statistic / freedom).cbrt() - (1.0 - 2.0 / (9.0 * freedom))) / (2.0 / (9.0 * freedom)).sqrt();
        assert!(freedom > 500.0 && normal.abs() < 5.0, "{orientation:?}: {normal}, {freedom} cells");
    }
}

#[test]
fn black_maps_are_rejected() {
    assert_eq!(EnvironmentMap::new(texels_from_fn(8, 4, |_, _| Vec3::ZERO)), None);
}

#[test]
fn constant_light_is_sampled_above_the_surface() {
    let environment = Environment::Constant(Vec3::new(1.0, 2.0, 3.0));
    let normal = Vec3::new(0.6, -0.8, 0.0);
    let mut irradiance = Vec3::ZERO;
    for i in 0..4096 {
        let sample = environment.sample(normal, random_pair(i)).expect("light");
        let cosine = sample.direction.dot(normal);
        assert!(cosine > -1e-6);
        let (radiance, density) = environment.radiance_and_pdf(sample.direction);
        assert_eq!(sample.weight, radiance * (1.0 / density));
        irradiance += sample.weight * cosine / 4096.0;
    }
    assert!((irradiance.x - PI as f32).abs() < 2e-3, "{irradiance}");
}

#[test]
fn maps_of_any_size_can_be_sampled() {
    for (width, height) in [(1, 1), (65_536, 1), (1, 4096), (4096, 2048)] {
        let texels =
            texels_from_fn(width, height, |x, y| Vec3::splat(if (x + y) % 1000 == 0 { 1e6 } else { 1e-3 }));
        let environment = environment_from_texels(&texels, 0.0);
        for i in 0..1000 {
            let sample = environment.sample(Vec3::Y, random_pair(i)).expect("light");
            assert!(
                sample.weight.is_finite() && sample.weight.x > 0.0,
                "{width} {height}: {}",
                sample.weight
            );
        }
    }
}
