use crate::film::RadianceImage;
use std::collections::HashSet;
use std::sync::atomic::AtomicBool;

use super::*;

/// Samples `first..first + count` for every pixel. Their magnitudes vary widely so that summation order
/// matters.
fn varied_samples(rect: Rect, first: u32, count: u32) -> TileSamples {
    let value = |x: u32, y: u32, sample: u32| {
        let mixed = (x.wrapping_mul(73) ^ y.wrapping_mul(19) ^ sample.wrapping_mul(2_654_435_761)) % 1000;
        Vec3::new(mixed as f32 * 0.1, 1.0 / (mixed + 1) as f32, 10_f32.powi(mixed as i32 % 30 - 10))
    };
    let pixel = |i: u32| {
        let (x, y) = (rect.x + i % rect.width, rect.y + i / rect.width);
        (first..first + count).map(move |sample| value(x, y, sample))
    };
    TileSamples {
        pixels: rect.into(),
        samples: count,
        radiance: (0..rect.area() as u32).flat_map(pixel).collect(),
        negative: None,
        layers: Default::default(),
    }
}

fn image_bits(image: &RadianceImage) -> Vec<[u32; 3]> {
    image.pixels.iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

/// Sample count of a pixel in a film with a single row of tiles.
fn pixel_sample_count(film: &Film, x: u32, y: u32) -> u32 {
    let tile = (x / TILE_SIZE) as usize;
    let rect = film.tile_rect(tile).expect("a tile");
    pixel_index_in_rect(rect, x, y).map_or(0, |index| film.lock_tile(tile).sample_count(index))
}

fn film_after_passes(passes: &[u32]) -> Film {
    let film = Film::new(50, 41, None).expect("a film");
    for &tile in film.tiles_center_outward() {
        let mut first = 0;
        for &count in passes {
            film.add_samples(tile, varied_samples(film.tile_rect(tile).expect("a tile"), first, count));
            first += count;
        }
    }
    film
}

fn sum_bits(film: &Film) -> Vec<[u64; 3]> {
    let tile_sums = |tile| film.lock_tile(tile).sums.clone();
    (0..film.tile_count()).flat_map(tile_sums).map(|sum| sum.to_array().map(f64::to_bits)).collect()
}

#[test]
fn sample_grouping_does_not_change_bits() {
    let at_once = film_after_passes(&[24]);
    for passes in [&[1; 24][..], &[1, 2, 4, 8, 9], &[23, 1]] {
        let film = film_after_passes(passes);
        assert_eq!(sum_bits(&film), sum_bits(&at_once), "{passes:?}");
        assert_eq!(image_bits(&film.radiance_image()), image_bits(&at_once.radiance_image()), "{passes:?}");
        assert_eq!(film.sample_count_stats(), SampleCountStats { min: 24, mean: 24.0, max: 24 });
    }
}

#[test]
fn tiles_partition_the_crop() {
    let crop = Rect { x: 5, y: 7, width: 70, height: 1000 };
    let film = Film::new(100, 60, Some(crop)).expect("a film");
    assert_eq!(film.crop_rect(), Rect { height: 53, ..crop });
    let order = film.tiles_center_outward();
    assert_eq!(order.iter().copied().collect::<HashSet<_>>(), (0..film.tile_count()).collect());
    assert_eq!(order.len(), film.tile_count());
    let mut seen = HashSet::new();
    for rect in order.iter().map(|&tile| film.tile_rect(tile).expect("a tile")) {
        assert!(rect.width <= TILE_SIZE && rect.height <= TILE_SIZE);
        for i in 0..rect.area() as u32 {
            assert!(seen.insert((rect.x + i % rect.width, rect.y + i / rect.width)), "covered twice");
        }
    }
    assert_eq!(seen.len(), film.crop_rect().area());
    assert!(seen.iter().all(|&(x, y)| (5..75).contains(&x) && (7..60).contains(&y)));
    assert_eq!(film.tile_rect(film.tile_count()), None);
}

#[test]
fn tiles_are_ordered_from_the_center_outward() {
    let film = Film::new(32 * 9, 32 * 6, None).expect("a film");
    let rings: Vec<_> = film.tiles_center_outward().iter().map(|tile| (tile % 9).abs_diff(4)).collect();
    assert!(rings[..2].iter().all(|&ring| ring == 0), "{rings:?}");
    assert!(rings[rings.len() - 12..].iter().all(|&ring| ring == 4), "{rings:?}");
}

#[test]
fn tile_order_is_computed_once() {
    let film = Film::new(32 * 9, 32 * 6, None).expect("a film");
    assert!(std::ptr::eq(film.tiles_center_outward(), film.tiles_center_outward()));
}

#[test]
fn pixel_means_and_counts_are_correct() {
    let film = Film::new(40, 2, None).expect("a film");
    let add = |x: u32, values: &[f32]| {
        let radiance = values.iter().map(|&v| Vec3::splat(v)).collect();
        let rect = Rect { x, y: 1, width: 1, height: 1 };
        film.add_samples(
            (x / 32) as usize,
            TileSamples {
                pixels: rect.into(),
                samples: values.len() as u32,
                radiance,
                negative: None,
                layers: Default::default(),
            },
        );
    };
    add(3, &[1.0, 2.0, 6.0]);
    add(39, &[0.5]);
    let image = film.radiance_image();
    assert_eq!(image.pixels[40 + 3], Vec3::splat(3.0));
    assert_eq!(image.pixels[40 + 39], Vec3::splat(0.5));
    assert_eq!(image.pixels.iter().filter(|p| **p != Vec3::ZERO).count(), 2);
    assert_eq!((pixel_sample_count(&film, 3, 1), pixel_sample_count(&film, 39, 1)), (3, 1));
    assert_eq!((pixel_sample_count(&film, 3, 0), pixel_sample_count(&film, 39, 0)), (0, 0));
    assert_eq!(film.sample_count_stats(), SampleCountStats { min: 0, mean: 4.0 / 80.0, max: 3 });
}

#[test]
fn non_finite_samples_are_black_and_counted() {
    let film = Film::new(1, 1, None).expect("a film");
    let radiance = vec![
        Vec3::splat(4.0),
        Vec3::new(1.0, f32::NAN, 1.0),
        Vec3::new(-f32::NAN, 1.0, 1.0),
        Vec3::new(1.0, 1.0, f32::INFINITY),
    ];
    film.add_samples(
        0,
        TileSamples {
            pixels: film.crop_rect().into(),
            samples: 4,
            radiance,
            negative: None,
            layers: Default::default(),
        },
    );
    assert_eq!(film.non_finite_samples(), 3);
    assert_eq!(film.radiance_image().pixels, [Vec3::ONE]);
    assert_eq!(pixel_sample_count(&film, 0, 0), 4);
}

#[test]
fn samples_outside_the_tile_are_ignored() {
    let film = Film::new(33, 1, None).expect("a film");
    let wide = Rect { x: 30, y: 0, width: 9, height: 3 };
    film.add_samples(
        1,
        TileSamples {
            pixels: wide.into(),
            samples: 1,
            radiance: vec![Vec3::ONE; 20],
            negative: None,
            layers: Default::default(),
        },
    );
    film.add_samples(
        0,
        TileSamples {
            pixels: wide.into(),
            samples: 2,
            radiance: vec![Vec3::ONE; 3],
            negative: None,
            layers: Default::default(),
        },
    );
    film.add_samples(
        7,
        TileSamples {
            pixels: wide.into(),
            samples: 1,
            radiance: vec![Vec3::ONE; 27],
            negative: None,
            layers: Default::default(),
        },
    );
    film.add_samples(
        0,
        TileSamples {
            pixels: wide.into(),
            samples: 0,
            radiance: Vec::new(),
            negative: None,
            layers: Default::default(),
        },
    );
    assert_eq!([29, 30, 31, 32].map(|x| pixel_sample_count(&film, x, 0)), [0, 2, 0, 1]);
}

#[test]
fn panics_while_holding_a_tile_are_harmless() {
    let film = film_after_passes(&[3]);
    let before = image_bits(&film.radiance_image());
    std::thread::scope(|scope| {
        let holder = scope.spawn(|| {
            let _guard = film.lock_tile(0);
            panic!("while holding a tile");
        });
        assert!(holder.join().is_err());
    });
    assert!(film.tiles[0].is_poisoned());
    assert_eq!(image_bits(&film.radiance_image()), before);
    film.add_samples(0, varied_samples(film.tile_rect(0).expect("a tile"), 3, 1));
    assert_eq!(pixel_sample_count(&film, 0, 0), 4);
}

#[test]
fn snapshots_are_consistent_during_rendering() {
    let film = Film::new(200, 100, None).expect("a film");
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let writers: Vec<_> = (0..3)
            .map(|worker| {
                let film = &film;
                scope.spawn(move || {
                    for pass in 0..8 {
                        for tile in (worker..film.tile_count()).step_by(3) {
                            let rect = film.tile_rect(tile).expect("a tile");
                            let radiance = vec![Vec3::splat(2.0); rect.area()];
                            film.add_samples(
                                tile,
                                TileSamples {
                                    pixels: rect.into(),
                                    samples: 1,
                                    radiance,
                                    negative: None,
                                    layers: Default::default(),
                                },
                            );
                            assert!(film.sample_count_stats().max <= pass + 9);
                        }
                    }
                })
            })
            .collect();
        scope.spawn(|| {
            let mut previewer = crate::film::Previewer::new(20, 10);
            while !done.load(Ordering::Acquire) {
                let whole = film.radiance_image();
                assert!(whole.pixels.iter().all(|p| *p == Vec3::ZERO || *p == Vec3::splat(2.0)));
                previewer.refresh_changed_tiles(&film, None);
                let small = previewer.build_radiance_image(None);
                assert!(small.pixels.iter().all(|p| *p == Vec3::ZERO || (p.x - 2.0).abs() < 1e-5));
            }
        });
        for writer in writers {
            writer.join().expect("writers should not panic");
        }
        done.store(true, Ordering::Release);
    });
    assert_eq!(film.sample_count_stats(), SampleCountStats { min: 8, mean: 8.0, max: 8 });
}

#[test]
fn oversized_film_errors_suggest_a_remedy() {
    let error = Film::new(u32::MAX, u32::MAX, None).expect_err("no machine has enough memory");
    assert!(error.to_string().contains("4294967295×4294967295"), "{error}");
    assert!(error.to_string().contains("smaller"), "{error}");
    assert!(
        error.to_string().ends_with("; a crop would not help because the finished image is as large"),
        "{error}"
    );
    let cropped =
        |max_bytes, crop| Film::with_memory_limit(max_bytes, 100, 100, crop).expect_err("too little");
    let part = Rect { x: 0, y: 0, width: 50, height: 100 };
    let remedy = ", or render only part of it with a crop";
    assert!(cropped(200_000, None).to_string().ends_with(remedy));
    assert!(!cropped(200_000, Some(part)).to_string().ends_with(remedy));
    assert!(!cropped(100_000, None).to_string().ends_with(remedy));
    assert_eq!(
        Film::new(0, 5, None).expect_err("no pixels"),
        FilmCreationError::Empty { width: 0, height: 5 }
    );
    let outside = Rect { x: 10, y: 0, width: 1, height: 1 };
    assert!(Film::new(10, 5, Some(outside)).is_err());
}
