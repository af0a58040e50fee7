use std::path::Path;

use super::*;
use crate::film::RadianceImage;
use crate::math::Vec3;

/// A picture by a formula of column, row and channel.
fn image(width: u32, height: u32, value: impl Fn(u32, u32, u32) -> f32) -> RadianceImage {
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let pixels = places.map(|(x, y)| Vec3::new(value(x, y, 0), value(x, y, 1), value(x, y, 2))).collect();
    RadianceImage { width, height, pixels }
}

fn pair(a: RadianceImage, b: RadianceImage) -> Pair {
    Pair::new([Path::new("a"), Path::new("b")], a, b).expect("a pair")
}

fn errors(a: &RadianceImage, b: &RadianceImage) -> Errors {
    measure(&pair(a.clone(), b.clone())).errors
}

#[test]
fn warnings_about_the_files_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let [plain, animated] = ["a.png", "b.png"].map(|name| folder.path().join(name));
    for (path, frames) in [(&plain, 1), (&animated, 3)] {
        let file = std::fs::File::create(path).expect("created");
        let mut encoder = png::Encoder::new(file, 1, 1);
        if frames > 1 {
            encoder.set_animated(frames, 0).expect("frames");
        }
        let mut writer = encoder.write_header().expect("a header");
        (0..frames).for_each(|_| writer.write_image_data(&[9]).expect("written"));
    }
    let warnings = |a: &Path, b: &Path| Pair::load(a, b).expect("a pair").warnings().to_vec();
    assert!(warnings(&plain, &plain).is_empty());
    for (a, b) in [(&plain, &animated), (&animated, &plain), (&animated, &animated)] {
        let found = warnings(a, b);
        assert_eq!(found.len(), 1);
        assert!(found[0].contains("b.png"), "{found:?}");
    }
}

/// Hashed values in [0, 1] with noise of ±1/8, some of it outside of the range of a display.
fn noisy(width: u32, height: u32) -> [RadianceImage; 2] {
    let clean = |x, y, c| ((x * 7 + y * 13 + c * 29) * (x + 2 * y + 3) % 257) as f32 / 256.0;
    let noise = |x, y, c| (((x * 5 + y * 11 + c * 17) % 33) as f32 - 16.0) / 128.0;
    [image(width, height, |x, y, c| clean(x, y, c) + noise(x, y, c)), image(width, height, clean)]
}

/// Ramps and a checkerboard; every third diagonal is brighter by a quarter, and few pixels by 40.
fn edges(width: u32, height: u32) -> [RadianceImage; 2] {
    let clean = |x, y, c| {
        ((x + 2 * y + 40 * c) % 512) as f32 / 1024.0 + if (x / 16 + y / 16) % 2 == 0 { 0.25 } else { 0.0 }
    };
    let spoilt = |x, y, c| {
        let factor = if (x + y) % 3 == 0 { 1.25 } else { 1.0 };
        clean(x, y, c) * factor + if (x * 31 + y * 17) % 997 == 0 { 40.0 } else { 0.0 }
    };
    [image(width, height, spoilt), image(width, height, clean)]
}

#[track_caller]
fn assert_near(name: &str, value: f64, expected: f64) {
    assert!((value - expected).abs() <= 1e-6 * expected.abs().max(1.0), "{name}: {value}, not {expected}");
}

struct Expected {
    linear: [f64; 4],
    max_at: [u32; 2],
    dropped: u64,
    psnr: f64,
    ssim: f64,
    flip: f64,
    /// FLIP by the published program, in single precision.
    published_flip: f64,
}

#[track_caller]
fn assert_measures([a, b]: &[RadianceImage; 2], expected: &Expected) {
    let errors = errors(a, b);
    let [rmse, relmse, trimmed, max] = expected.linear;
    assert_near("RMSE", errors.rmse, rmse);
    assert_near("relMSE", errors.relmse, relmse);
    assert_near("trimmed relMSE", errors.relmse_trimmed, trimmed);
    assert_near("max", errors.max, max);
    assert_near("PSNR", errors.psnr_db, expected.psnr);
    assert_near("SSIM", errors.ssim, expected.ssim);
    assert_near("FLIP", errors.flip, expected.flip);
    assert_near("FLIP as published", errors.flip, expected.published_flip);
    assert_eq!((errors.max_at, errors.dropped_pixels), (expected.max_at, expected.dropped));
}

// The figures were computed by numpy in double precision on the same formulas: SSIM window by window, and the same as
// `structural_similarity` of scikit-image 0.26 (gaussian_weights, sigma 1.5, no sample covariance) where the picture
// has room for a window; FLIP with the two-dimensional kernels of the paper; `published_flip` is by flip-evaluator 1.7
// of the paper's authors (LDR, linear input, 67 pixels a degree).

#[test]
fn noise_as_numpy_and_published_programs_have_it() {
    let expected = Expected {
        linear: [0.074_452_040_028_3, 0.087_685_495_302, 0.087_685_495_302, 0.125],
        max_at: [0, 0],
        dropped: 0,
        psnr: 21.546_687_333_4,
        ssim: 0.953_595_494_341,
        flip: 0.085_398_868_954,
        published_flip: 0.085_398_912_429_8,
    };
    assert_measures(&noisy(37, 23), &expected);
}

#[test]
fn a_picture_of_several_tiles_with_bright_pixels_as_numpy_and_published_programs_have_it() {
    let expected = Expected {
        linear: [1.326_208_766_31, 19.568_535_989_9, 0.427_631_782_818, 40.158_447_265_6],
        max_at: [59, 127],
        dropped: 21,
        psnr: 27.710_444_982_1,
        ssim: 0.758_545_225_873,
        flip: 0.132_422_372_849,
        published_flip: 0.132_422_357_798,
    };
    assert_measures(&edges(150, 140), &expected);
}

#[test]
fn pictures_smaller_than_a_window_as_numpy_and_published_programs_have_it() {
    let small = Expected {
        linear: [0.075_368_020_683, 0.125_544_632_27, 0.125_544_632_27, 0.125],
        max_at: [0, 0],
        dropped: 0,
        psnr: 20.824_868_587_9,
        ssim: 0.898_209_184_398,
        flip: 0.155_839_208_341,
        published_flip: 0.155_839_279_294,
    };
    assert_measures(&noisy(5, 3), &small);
    let row = Expected {
        linear: [0.074_778_590_285_6, 0.093_765_179_893_5, 0.093_765_179_893_5, 0.125],
        max_at: [0, 0],
        dropped: 0,
        psnr: 22.918_690_605_6,
        ssim: 0.953_051_994_071,
        flip: 0.234_310_591_628,
        published_flip: 0.234_310_537_577,
    };
    assert_measures(&noisy(40, 1), &row);
    let [a, b] = noisy(1, 1);
    let one = errors(&a, &b);
    assert_near("relMSE", one.relmse, 0.530_694_347_929);
    assert_near("SSIM", one.ssim, 0.999_999_774_029);
    assert_near("FLIP", one.flip, 0.233_769_835_862);
}

#[test]
fn flip_of_single_pixels() {
    let [a, b] = edges(150, 140);
    let flip = measure(&pair(a, b)).flip;
    assert_near("first", f64::from(flip[0]), 0.792_423_285_289);
    assert_near("last", f64::from(flip[flip.len() - 1]), 0.186_031_104_359);
}

#[test]
fn equal_pictures_have_no_error() {
    for (width, height) in [(1, 1), (1, 30), (30, 1), (11, 11), (10, 12), (129, 2), (40, 131)] {
        let [_, b] = noisy(width, height);
        let Errors { rmse, relmse, relmse_trimmed, max, psnr_db, ssim, flip, .. } = errors(&b, &b);
        assert_eq!([rmse, relmse, relmse_trimmed, max, flip], [0.0; 5], "{width}×{height}");
        assert_eq!(psnr_db, f64::INFINITY);
        assert!((ssim - 1.0).abs() < 1e-12, "{ssim}");
    }
}

#[test]
fn what_is_symmetric_and_what_is_not() {
    let [a, b] = edges(60, 40);
    let (there, back) = (errors(&a, &b), errors(&b, &a));
    assert_eq!((there.psnr_db, there.rmse, there.max), (back.psnr_db, back.rmse, back.max));
    assert!((there.ssim - back.ssim).abs() < 1e-12 && (there.flip - back.flip).abs() < 1e-12);
    assert!(there.relmse > 2.0 * back.relmse, "{} {}", there.relmse, back.relmse);
}

#[test]
fn relmse_of_bright_pictures_does_not_change_with_their_scale() {
    let [a, b] = edges(60, 40);
    let scaled =
        |image: &RadianceImage, factor: f32| image.pixels.iter().map(|p| (*p + 0.5) * factor).collect();
    let of = |factor| {
        let [a, b] = [&a, &b].map(|image| RadianceImage { pixels: scaled(image, factor), ..*image });
        errors(&a, &b)
    };
    let (large, larger) = (of(1e4), of(1e6));
    assert!((large.relmse / larger.relmse - 1.0).abs() < 1e-7);
    assert!((larger.rmse / large.rmse - 100.0).abs() < 1e-4);
    // Far below 0.1 the denominator is 0.01: the error falls with the square of the scale.
    let (small, smaller) = (of(1e-5), of(1e-6));
    assert!((small.relmse / smaller.relmse - 100.0).abs() < 1e-3, "{} {}", small.relmse, smaller.relmse);
}

#[test]
fn known_values_by_hand() {
    let grey = |value| image(20, 15, move |_, _, _| value);
    let found = errors(&grey(0.5), &grey(0.25));
    assert!((found.rmse - 0.25).abs() < 1e-12 && (found.max - 0.25).abs() < 1e-12);
    assert!((found.relmse - 0.0625 / 0.0725).abs() < 1e-12);
    assert_eq!(found.max_at, [0, 0]);
    let black_and_white = errors(&grey(1.0), &grey(0.0));
    assert!(black_and_white.psnr_db.abs() < 1e-9, "{}", black_and_white.psnr_db);
    assert!((black_and_white.relmse - 100.0).abs() < 1e-9);
    // C₁/(1 + C₁): two constants, one of them 0.
    assert!((black_and_white.ssim - 1e-4 / 1.0001).abs() < 1e-9);
    let beyond = errors(&grey(7.0), &grey(1.0));
    assert_eq!((beyond.psnr_db, beyond.flip), (f64::INFINITY, 0.0), "a display shows the same");
    let negative = errors(&grey(-0.5), &grey(0.0));
    assert_eq!((negative.psnr_db, negative.max), (f64::INFINITY, 0.5));
}

#[test]
fn green_against_blue_is_the_largest_colour_error() {
    let only = |channel| image(30, 30, move |_, _, c| if c == channel { 1.0 } else { 0.0 });
    let found = errors(&only(1), &only(2));
    assert!((found.flip - 1.0).abs() < 1e-6, "{}", found.flip);
}

#[test]
fn one_worst_pixel_of_a_thousand_is_dropped_and_ties_stay() {
    let black = image(50, 40, |_, _, _| 0.0);
    let with = |count: u32| image(50, 40, move |x, y, _| if y == 39 && x < count { 3.0 } else { 0.0 });
    let two = errors(&with(2), &black);
    assert_eq!((two.dropped_pixels, two.relmse_trimmed), (2, 0.0));
    assert_eq!(two.max_at, [0, 39]);
    let five = errors(&with(5), &black).relmse_trimmed;
    assert!((five - 3.0 * 900.0 / 1998.0).abs() < 1e-9, "{five}");
    let huge = image(50, 40, |x, y, _| if y == 0 && x < 2 { f32::MAX } else { 0.1 });
    let trimmed = errors(&huge, &black).relmse_trimmed;
    assert!((trimmed - 1.0).abs() < 1e-6, "nothing of the dropped pixels is left: {trimmed}");
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let [a, b] = edges(300, 270);
    let pair = pair(a, b);
    let by = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let Measured { errors, flip } = pool.install(|| measure(&pair));
        (errors, flip)
    };
    let one = by(1);
    for threads in [2, 7] {
        assert_eq!(by(threads), one, "{threads} threads");
    }
}

#[test]
fn pictures_that_cannot_be_compared_are_told_with_places() {
    let says = |a: RadianceImage, b: RadianceImage| {
        let errors = Pair::new([Path::new("a.exr"), Path::new("b.exr")], a, b).expect_err("no pair");
        errors.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let grey = |width, height| image(width, height, |_, _, _| 0.5);
    let sizes = says(grey(4, 3), grey(3, 4));
    assert_eq!(sizes.len(), 1);
    assert!(sizes[0].starts_with("a.exr has 4×3 pixels and b.exr 3×4: "), "{sizes:?}");
    let mut bad = grey(4, 3);
    bad.pixels[6].y = f32::NAN;
    bad.pixels[7] = Vec3::new(f32::INFINITY, f32::NEG_INFINITY, f32::NAN);
    let both = says(bad.clone(), bad);
    assert_eq!(both.len(), 2);
    let start = "b.exr: 2 of its values are NaN and 2 infinite, the first at pixel (2, 1), ";
    assert!(both[1].starts_with(start) && both[1].contains("in green"), "{both:?}");
}

#[test]
fn the_error_as_a_picture() {
    let [a, b] = edges(20, 13);
    let pair = pair(a, b);
    let measured = measure(&pair);
    let absolute = absolute(&pair);
    let largest = absolute.pixels.iter().map(|pixel| pixel.max_element()).fold(0.0, f32::max);
    assert_eq!(f64::from(largest), measured.errors.max);
    let heat = heat(&pair, &measured.flip);
    assert_eq!((heat.width, heat.height, heat.pixels.len()), (20, 13, 260));
    let order = |values: Vec<f32>| {
        let mut order: Vec<_> = (0..values.len()).collect();
        order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
        order[260 - 1]
    };
    let lightness = heat.pixels.iter().map(|pixel| crate::math::color::luminance(*pixel)).collect();
    assert_eq!(order(lightness), order(measured.flip));
}
