use super::*;
use crate::math::lanes::PortableSimd;
use crate::math::random::signed_number_generator as random;

fn photon(point: Vec3, normal: Vec3) -> Photon {
    Photon { point, direction: normal, flux: Vec3::ONE, normal, depth: 1 }
}

#[test]
fn lookups_match_brute_force() {
    let mut next = random(5);
    for count in [0, 1, 2, 3, 17, 3000] {
        for radius in [1e-3_f32, 0.05, 0.4, 30.0] {
            let place = |next: &mut dyn FnMut() -> f32| {
                let point = Vec3::new(next(), next(), 0.1 * next()) * 3.0;
                let normal = if next() > 0.0 { Vec3::Z } else { Vec3::new(0.6, 0.0, 0.8) };
                (point, normal)
            };
            let photons: Vec<Photon> =
                (0..count).map(|_| place(&mut next)).map(|(p, n)| photon(p, n)).collect();
            let map = PhotonMap::new(&photons, radius, &CancelToken::new()).expect("never canceled");
            assert_eq!(map.len(), count);
            let mut seen = 0;
            for look in 0..60 {
                let (point, normal) = match photons.get(7 * look) {
                    // Query near one of the photons.
                    Some(photon) => {
                        (photon.point + 0.1 * radius * Vec3::new(next(), next(), 0.1 * next()), photon.normal)
                    }
                    None => place(&mut next),
                };
                let mut found = Vec::new();
                map.visit_weighted_photons(
                    &GatherPoint { point, normal, max_depth: 1 },
                    PortableSimd,
                    |photon, density| {
                        found.push((photon.point.to_array(), density));
                    },
                );
                let near = |photon: &&Photon| {
                    let way = photon.point - point;
                    let above = way.dot(normal);
                    let is_near = way.length_squared() - above * above < radius * radius;
                    let is_flat = above.abs() < MAX_PLANE_DISTANCE * radius;
                    is_near && is_flat && photon.normal.dot(normal) > MIN_COSINE
                };
                let mut expected: Vec<_> =
                    photons.iter().filter(near).map(|photon| photon.point.to_array()).collect();
                let mut points: Vec<_> = found.iter().map(|(point, _)| *point).collect();
                points.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
                expected.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
                assert!(points.len().abs_diff(expected.len()) <= 1, "counts may differ by 1 at the edge");
                seen += expected.len();
                let peak = 2.0 / (std::f32::consts::PI * radius * radius);
                assert!(found.iter().all(|(_, density)| *density >= 0.0 && *density <= peak));
                points.dedup();
                assert_eq!(points.len(), found.len(), "each photon should be visited once");
                assert!(points.iter().filter(|point| !expected.contains(point)).count() <= 1);
            }
            assert!(seen >= count.min(60) / 8, "found {seen} of {count} photons within {radius}");
        }
    }
}

#[test]
fn kernel_sums_to_one_and_excludes_deep_photons() {
    // Each photon on a fine grid represents one cell's area.
    let step = 0.01_f32;
    let at = |i: i32| (i as f32 + 0.3) * step;
    let place = |i: i32| photon(Vec3::new(at(i % 200 - 100), 0.5, at(i / 200 - 100)), Vec3::Y);
    let photons: Vec<Photon> = (0..40_000).map(place).collect();
    let map = PhotonMap::new(&photons, 0.4, &CancelToken::new()).expect("never canceled");
    let sum = |max_depth: u32, normal: Vec3| {
        let mut sum = 0.0;
        let look = GatherPoint { point: Vec3::new(0.1, 0.5, -0.2), normal, max_depth };
        map.visit_weighted_photons(&look, PortableSimd, |_, density| sum += density * step * step);
        let flux =
            f64::from(map.irradiance_and_chosen_photon(&look, [0.5; 2], PortableSimd).0.x * step * step);
        assert!((flux - f64::from(sum)).abs() < 1e-4, "got {flux}, expected {sum}");
        sum
    };
    assert!((sum(1, Vec3::Y) - 1.0).abs() < 2e-3, "{}", sum(1, Vec3::Y));
    assert_eq!((sum(0, Vec3::Y), sum(1, Vec3::NEG_Y)), (0.0, 0.0));
}
