use std::path::Path;

use super::*;
use crate::film::RadianceImage;
use crate::math::Vec3;

/// An image defined by a function of column, row and channel.
fn image(width: u32, height: u32, value: impl Fn(u32, u32, u32) -> f32) -> RadianceImage {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let pixels = pixels.map(|(x, y)| Vec3::new(value(x, y, 0), value(x, y, 1), value(x, y, 2))).collect();
    RadianceImage { width, height, pixels }
}

fn pair(a: RadianceImage, b: RadianceImage) -> ImagePair {
    ImagePair::new([Path::new("a"), Path::new("b")], a, b).expect("a pair")
}

fn errors(a: &RadianceImage, b: &RadianceImage) -> ErrorMetrics {
    measure(&pair(a.clone(), b.clone())).errors
}

#[test]
fn warnings_about_the_files_are_returned() {
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
    let warnings = |a: &Path, b: &Path| ImagePair::load(a, b).expect("a pair").file_warnings().to_vec();
    assert!(warnings(&plain, &plain).is_empty());
    for (a, b) in [(&plain, &animated), (&animated, &plain), (&animated, &animated)] {
        let found = warnings(a, b);
        assert_eq!(found.len(), 1);
        assert!(found[0].contains("b.png"), "{found:?}");
    }
}

/// Two images of the same hashed values in [0, 1]. The first has added noise of up to ±1/8, which moves some
/// values out of the display range.
fn noisy(width: u32, height: u32) -> [RadianceImage; 2] {
    let clean = |x, y, c| ((x * 7 + y * 13 + c * 29) * (x + 2 * y + 3) % 257) as f32 / 256.0;
    let noise = |x, y, c| (((x * 5 + y * 11 + c * 17) % 33) as f32 - 16.0) / 128.0;
    [image(width, height, |x, y, c| clean(x, y, c) + noise(x, y, c)), image(width, height, clean)]
}

/// Ramps and a checkerboard. Every third diagonal is a quarter brighter, and a few pixels are brighter by 40.
fn edges(width: u32, height: u32) -> [RadianceImage; 2] {
    let clean = |x, y, c| {
        ((x + 2 * y + 40 * c) % 512) as f32 / 1024.0 + if (x / 16 + y / 16) % 2 == 0 { 0.25 } else { 0.0 }
    };
    let distorted = |x, y, c| {
        let factor = if (x + y) % 3 == 0 { 1.25 } else { 1.0 };
        clean(x, y, c) * factor + if (x * 31 + y * 17) % 997 == 0 { 40.0 } else { 0.0 }
    };
    [image(width, height, distorted), image(width, height, clean)]
}

#[track_caller]
fn assert_near(name: &str, value: f64, expected: f64) {
    assert!(
        (value - expected).abs() <= 1e-6 * expected.abs().max(1.0),
        "{name}: got {value}, expected {expected}"
    );
}

struct Expected {
    linear: [f64; 4],
    max_at: [u32; 2],
    dropped: u64,
    psnr: f64,
    ssim: f64,
    flip: f64,
    /// FLIP computed by the published program, in single precision.
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
    assert_near("published FLIP", errors.flip, expected.published_flip);
    assert_eq!((errors.max_at, errors.dropped_pixels), (expected.max_at, expected.dropped));
}

// Expected values were computed with numpy in double precision. SSIM was computed window by window and
// matches scikit-image 0.26's `structural_similarity` (gaussian_weights, sigma 1.5, no sample covariance) for
// images that are large enough. FLIP was computed with the 2D kernels from the paper. `published_flip` was
// computed with flip-evaluator 1.7 by the paper's authors (LDR, linear input, 67 pixels per degree).

#[test]
fn noisy_image_errors_match_numpy() {
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
fn multi_tile_errors_match_numpy() {
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
fn tiny_image_errors_match_numpy() {
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
    let pixel = errors(&a, &b);
    assert_near("relMSE", pixel.relmse, 0.530_694_347_929);
    assert_near("SSIM", pixel.ssim, 0.999_999_774_029);
    assert_near("FLIP", pixel.flip, 0.233_769_835_862);
}

#[test]
fn single_pixel_flip_matches_numpy() {
    let [a, b] = edges(150, 140);
    let flip = measure(&pair(a, b)).flip;
    assert_near("first", f64::from(flip[0]), 0.792_423_285_289);
    assert_near("last", f64::from(flip[flip.len() - 1]), 0.186_031_104_359);
}

#[test]
fn equal_images_have_no_error() {
    for (width, height) in [(1, 1), (1, 30), (30, 1), (11, 11), (10, 12), (129, 2), (40, 131)] {
        let [_, b] = noisy(width, height);
        let ErrorMetrics { rmse, relmse, relmse_trimmed, max, psnr_db, ssim, flip, .. } = errors(&b, &b);
        assert_eq!([rmse, relmse, relmse_trimmed, max, flip], [0.0; 5], "{width}×{height}");
        assert_eq!(psnr_db, f64::INFINITY);
        assert!((ssim - 1.0).abs() < 1e-12, "{ssim}");
    }
}

#[test]
fn only_relmse_depends_on_argument_order() {
    let [a, b] = edges(60, 40);
    let (there, back) = (errors(&a, &b), errors(&b, &a));
    assert_eq!((there.psnr_db, there.rmse, there.max), (back.psnr_db, back.rmse, back.max));
    assert!((there.ssim - back.ssim).abs() < 1e-12 && (there.flip - back.flip).abs() < 1e-12);
    assert!(there.relmse > 2.0 * back.relmse, "{} {}", there.relmse, back.relmse);
}

#[test]
fn relmse_of_bright_images_is_scale_invariant() {
    let [a, b] = edges(60, 40);
    let scaled =
        |image: &RadianceImage, factor: f32| image.pixels.iter().map(|p| (*p + 0.5) * factor).collect();
    let scaled_errors = |factor| {
        let [a, b] = [&a, &b].map(|image| RadianceImage { pixels: scaled(image, factor), ..*image });
        errors(&a, &b)
    };
    let (large, larger) = (scaled_errors(1e4), scaled_errors(1e6));
    assert!((large.relmse / larger.relmse - 1.0).abs() < 1e-7);
    assert!((larger.rmse / large.rmse - 100.0).abs() < 1e-4);
    // For values far below 0.1, the denominator is about 0.01, and the error is proportional to the squared
    // scale.
    let (small, smaller) = (scaled_errors(1e-5), scaled_errors(1e-6));
    assert!((small.relmse / smaller.relmse - 100.0).abs() < 1e-3, "{} {}", small.relmse, smaller.relmse);
}

#[test]
fn constant_images_have_known_errors() {
    let gray = |value| image(20, 15, move |_, _, _| value);
    let found = errors(&gray(0.5), &gray(0.25));
    assert!((found.rmse - 0.25).abs() < 1e-12 && (found.max - 0.25).abs() < 1e-12);
    assert!((found.relmse - 0.0625 / 0.0725).abs() < 1e-12);
    assert_eq!(found.max_at, [0, 0]);
    let black_and_white = errors(&gray(1.0), &gray(0.0));
    assert!(black_and_white.psnr_db.abs() < 1e-9, "{}", black_and_white.psnr_db);
    assert!((black_and_white.relmse - 100.0).abs() < 1e-9);
    // For constant images of 0 and 1, SSIM is C₁/(1 + C₁).
    assert!((black_and_white.ssim - 1e-4 / 1.0001).abs() < 1e-9);
    let beyond = errors(&gray(7.0), &gray(1.0));
    assert_eq!((beyond.psnr_db, beyond.flip), (f64::INFINITY, 0.0), "displayed identically");
    let negative = errors(&gray(-0.5), &gray(0.0));
    assert_eq!((negative.psnr_db, negative.max), (f64::INFINITY, 0.5));
}

#[test]
fn green_and_blue_have_the_largest_flip_error() {
    let only = |channel| image(30, 30, move |_, _, c| if c == channel { 1.0 } else { 0.0 });
    let found = errors(&only(1), &only(2));
    assert!((found.flip - 1.0).abs() < 1e-6, "{}", found.flip);
}

#[test]
fn trimming_drops_one_pixel_in_a_thousand() {
    let black = image(50, 40, |_, _, _| 0.0);
    let with = |count: u32| image(50, 40, move |x, y, _| if y == 39 && x < count { 3.0 } else { 0.0 });
    let two = errors(&with(2), &black);
    assert_eq!((two.dropped_pixels, two.relmse_trimmed), (2, 0.0));
    assert_eq!(two.max_at, [0, 39]);
    let five = errors(&with(5), &black).relmse_trimmed;
    assert!((five - 3.0 * 900.0 / 1998.0).abs() < 1e-9, "{five}");
    let huge = image(50, 40, |x, y, _| if y == 0 && x < 2 { f32::MAX } else { 0.1 });
    let trimmed = errors(&huge, &black).relmse_trimmed;
    assert!((trimmed - 1.0).abs() < 1e-6, "the dropped pixels should have no effect: {trimmed}");
}

#[test]
fn results_do_not_depend_on_thread_count() {
    let [a, b] = edges(200, 150);
    let pair = pair(a, b);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let PairMeasurements { errors, flip } = pool.install(|| measure(&pair));
        (errors, flip)
    };
    let expected = with(1);
    for threads in [2, 7] {
        assert_eq!(with(threads), expected, "{threads} threads");
    }
}

#[test]
fn incomparable_images_are_rejected() {
    let rejected = |a: RadianceImage, b: RadianceImage| {
        ImagePair::new([Path::new("a.exr"), Path::new("b.exr")], a, b).expect_err("no pair")
    };
    let gray = |width, height| image(width, height, |_, _, _| 0.5);
    let errors = rejected(gray(4, 3), gray(3, 4));
    assert!(matches!(errors[..], [CompareError::Sizes { sizes: [[4, 3], [3, 4]], .. }]), "{errors:?}");
    let mut bad = gray(4, 3);
    bad.pixels[6].y = f32::NAN;
    bad.pixels[7] = Vec3::new(f32::INFINITY, f32::NEG_INFINITY, f32::NAN);
    let errors = rejected(bad.clone(), bad);
    assert_eq!(errors.len(), 2);
    let CompareError::NotFinite { path, nan: 2, infinite: 2, at: [2, 1], channel: "green" } = &errors[1]
    else {
        panic!("{errors:?}")
    };
    assert_eq!(path, Path::new("b.exr"));
}

#[test]
fn error_images_show_the_largest_error() {
    let [a, b] = edges(20, 13);
    let pair = pair(a, b);
    let measured = measure(&pair);
    let absolute = absolute_difference(&pair);
    let largest = absolute.pixels.iter().map(|pixel| pixel.max_element()).fold(0.0, f32::max);
    assert_eq!(f64::from(largest), measured.errors.max);
    let heat = flip_heat_map(&pair, &measured.flip);
    assert_eq!((heat.width, heat.height, heat.pixels.len()), (20, 13, 260));
    let order = |values: Vec<f32>| {
        let mut order: Vec<_> = (0..values.len()).collect();
        order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
        order[260 - 1]
    };
    let lightness = heat.pixels.iter().map(|pixel| crate::math::color::luminance(*pixel)).collect();
    assert_eq!(order(lightness), order(measured.flip));
}
