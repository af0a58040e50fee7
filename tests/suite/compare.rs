//! `glimt compare` as a process: metrics, exit codes, messages and files.

use std::fs;
use std::os::unix::fs::symlink;

use image::{DynamicImage, ImageBuffer, Rgb, Rgb32FImage, RgbImage};
use nix::errno::Errno;
use serde_json::Value;

use super::test_dir::{TestDir, assert_mentions, mentions, system_error};

const SIZE: (u32, u32) = (24, 16);

fn reference(x: u32, y: u32, c: u32) -> u8 {
    ((x * 5 + y * 9 + c * 31 + (x * y + c) % 7) % 256) as u8
}

fn distorted(x: u32, y: u32, c: u32) -> u8 {
    ((x * 5 + y * 9 + c * 31) % 256) as u8
}

fn bytes(value: impl Fn(u32, u32, u32) -> u8) -> RgbImage {
    ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, y| Rgb([0, 1, 2].map(|c| value(x, y, c))))
}

fn floats(value: impl Fn(u32, u32, u32) -> f32) -> Rgb32FImage {
    ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, y| Rgb([0, 1, 2].map(|c| value(x, y, c))))
}

/// A directory with an image and its reference in every lossless 8-bit format and as float EXR files.
fn dir() -> TestDir {
    let dir = TestDir::new();
    for ending in ["png", "ppm", "tga", "bmp", "webp"] {
        bytes(distorted).save(dir.path(&format!("a.{ending}"))).expect("written");
        bytes(reference).save(dir.path(&format!("b.{ending}"))).expect("written");
    }
    floats(|x, y, c| f32::from(distorted(x, y, c)) / 64.0).save(dir.path("a.exr")).expect("written");
    floats(|x, y, c| f32::from(reference(x, y, c)) / 64.0).save(dir.path("b.exr")).expect("written");
    dir
}

/// Runs `glimt compare --json` and returns the JSON object printed to stdout, along with the text of stderr.
#[track_caller]
fn json(dir: &TestDir, line: &str, code: i32) -> (Value, String) {
    let output = dir.run(&format!("compare --json {line}"));
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
    let stdout = String::from_utf8(output.stdout).expect("UTF-8");
    assert_eq!(stdout.lines().count(), 1, "expected one object: {stdout}");
    (serde_json::from_str(&stdout).expect("JSON"), stderr)
}

#[track_caller]
fn assert_near(object: &Value, key: &str, expected: f64) {
    let value = object[key].as_f64().expect(key);
    assert!(
        (value - expected).abs() <= 1e-6 * expected.abs().max(1.0),
        "{key}: {value}, expected {expected}"
    );
}

/// Checks the metrics against values computed with numpy in double precision from the decoded sRGB bytes.
/// SSIM is from scikit-image 0.26. For FLIP, flip-evaluator 1.7 computes 0.107067652 in single precision.
#[track_caller]
fn assert_byte_metrics(object: &Value) {
    for (key, expected) in [
        ("rmse", 0.066_788_365_202),
        ("relmse", 0.421_549_825_497),
        ("relmse_trimmed", 0.421_549_825_497),
        ("max", 0.999_392_946_033),
        ("psnr_db", 23.585_385_227_2),
        ("ssim", 0.992_395_838_003),
        ("flip", 0.107_067_619_882),
    ] {
        assert_near(object, key, expected);
    }
    assert_eq!(object["max_at"], serde_json::json!([17, 12]));
    assert_eq!(object["dropped_pixels"], 0);
    assert_eq!((&object["width"], &object["height"]), (&24.into(), &16.into()));
}

#[test]
fn every_format_matches_numpy_metrics() {
    let dir = dir();
    for (a, b) in [("png", "png"), ("ppm", "tga"), ("bmp", "webp"), ("webp", "png")] {
        let (object, stderr) = json(&dir, &format!("a.{a} b.{b}"), 0);
        assert_byte_metrics(&object);
        assert_eq!((&object["a"], &object["b"]), (&format!("a.{a}").into(), &format!("b.{b}").into()));
        assert_eq!(stderr, "");
    }
}

#[test]
fn sixteen_bit_and_float_metrics_are_equal() {
    let dir = dir();
    let wide = ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, y| {
        Rgb([0, 1, 2].map(|c| u16::from(distorted(x, y, c)) * 257))
    });
    DynamicImage::ImageRgb16(wide).save(dir.path("wide.png")).expect("written");
    let (object, _) = json(&dir, "wide.png b.png", 0);
    assert_byte_metrics(&object);
    let linear = |byte: u8| {
        let encoded = f64::from(byte) / 255.0;
        let linear = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
        linear as f32
    };
    floats(|x, y, c| linear(distorted(x, y, c))).save(dir.path("linear.exr")).expect("written");
    let (object, _) = json(&dir, "linear.exr b.png", 0);
    assert_byte_metrics(&object);
    floats(|x, y, c| linear(distorted(x, y, c))).save(dir.path("linear.hdr")).expect("written");
    let (object, _) = json(&dir, "linear.hdr linear.exr", 0);
    assert!(object["relmse"].as_f64().expect("a number") < 1e-4, "the mantissa has 8 bits: {object}");
    bytes(distorted).save(dir.path("a.jpg")).expect("written");
    let (object, _) = json(&dir, "a.jpg a.png", 0);
    assert!(object["psnr_db"].as_f64().expect("a number") > 10.0, "{object}");
}

#[test]
fn float_values_are_compared_unchanged() {
    let dir = dir();
    floats(|_, _, _| -0.5).save(dir.path("dark.exr")).expect("written");
    floats(|_, _, _| 100.0).save(dir.path("bright.exr")).expect("written");
    let (object, _) = json(&dir, "dark.exr bright.exr", 0);
    assert_near(&object, "rmse", 100.5);
    assert_near(&object, "relmse", 100.5 * 100.5 / 10_000.01);
    assert_near(&object, "max", 100.5);
}

#[test]
fn table_lists_every_metric() {
    let dir = dir();
    let output = dir.run("compare a.png b.png");
    assert_eq!(output.status.code(), Some(0));
    let stdout = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(output.stderr.is_empty());
    let lines: Vec<_> = stdout.lines().collect();
    assert_mentions(lines[0], &["a.png", "b.png", "24×16"]);
    for (line, start) in lines[2..].iter().zip([
        "RMSE               0.0667884",
        "relMSE              0.421550",
        "relMSE, trimmed     0.421550",
        "max |a - b|         0.999393",
        "PSNR                 23.5854 dB",
        "SSIM                0.992396",
        "FLIP                0.107068",
    ]) {
        assert!(line.starts_with(start), "{stdout}");
    }
    assert!(lines[5].ends_with("(17, 12)"), "{stdout}");
    assert_mentions(lines.last().expect("a line"), &["PSNR", "SSIM"]);
}

#[test]
fn threshold_determines_the_exit_code() {
    let dir = dir();
    let (object, stderr) = json(&dir, "a.png b.png --max-relmse 0.5", 0);
    assert_eq!(
        (&object["is_within"], &object["max_relmse"], stderr.as_str()),
        (&true.into(), &0.5.into(), "")
    );
    let (object, stderr) = json(&dir, "a.png b.png --max-relmse .4", 1);
    assert_eq!(object["is_within"], false);
    assert_eq!(stderr, "error: relMSE 0.421550 is above --max-relmse 0.4\n");
    let copy = dir.bytes("b.png");
    dir.write("copy.png", copy);
    let (object, stderr) = json(&dir, "copy.png b.png --max-relmse 0", 0);
    assert_eq!(
        (object["relmse"].as_f64(), &object["psnr_db"], stderr.as_str()),
        (Some(0.0), &Value::Null, "")
    );
    assert_eq!((object["ssim"].as_f64(), object["flip"].as_f64()), (Some(1.0), Some(0.0)));
    for wrong in ["-1", "nan", "inf", "much"] {
        let stderr = dir.expect(&format!("compare a.png b.png --max-relmse {wrong}"), 2);
        assert_mentions(&stderr, &["--max-relmse", wrong]);
    }
}

#[test]
fn compare_reports_invalid_usage_and_files() {
    let dir = dir();
    dir.expect("compare a.png", 2);
    dir.expect("compare a.png b.png a.ppm", 2);
    let both = dir.expect("compare none.png ball.toml", 2);
    assert_mentions(&both, &["none.png", &system_error(Errno::ENOENT), "ball.toml"]);
    assert_eq!(both.matches("error: ").count(), 2, "{both}");
    let whole = dir.bytes("a.png");
    dir.write("cut.png", &whole[..whole.len() / 2]);
    assert_mentions(&dir.expect("compare cut.png b.png", 2), &["cut.png"]);
    dir.write("empty.exr", "");
    assert_mentions(&dir.expect("compare a.png empty.exr", 2), &["empty.exr", "empty"]);
    assert_mentions(&dir.expect("compare . /dev/zero", 2), &["folder", "/dev/zero", "device"]);
    RgbImage::new(3, 5).save(dir.path("small.png")).expect("written");
    let sizes = dir.expect("compare small.png b.png", 2);
    assert_mentions(&sizes, &["small.png", "3×5", "b.png", "24×16", "--width"]);
}

#[test]
fn non_finite_values_are_counted_and_located() {
    let dir = dir();
    let spoilt = |x, y, c| match (x, y, c) {
        (5, 3, 2) => f32::NAN,
        (6, 3, 0) => f32::INFINITY,
        (0, 9, _) => f32::NAN,
        _ => 0.5,
    };
    floats(spoilt).save(dir.path("nan.exr")).expect("written");
    let said = dir.expect("compare nan.exr b.exr --diff d.png", 2);
    assert_mentions(&said, &["nan.exr", "4", "1 infinite", "(5, 3)", "blue"]);
    assert!(!dir.path("d.png").exists());
}

#[test]
fn comparing_a_file_with_itself_warns() {
    let dir = dir();
    symlink("a.png", dir.path("link.png")).expect("a link");
    let (object, stderr) = json(&dir, "a.png a.png", 0);
    assert_eq!(object["rmse"].as_f64(), Some(0.0));
    assert!(stderr.starts_with("warning: a.png ") && !mentions(&stderr, "link.png"), "{stderr}");
    let (_, stderr) = json(&dir, "link.png a.png", 0);
    assert!(mentions(&stderr, "warning: link.png") && mentions(&stderr, "a.png"), "{stderr}");
}

#[test]
fn diff_writes_the_error_image() {
    let dir = dir();
    let (_, stderr) = json(&dir, "a.exr b.exr --diff d.exr", 0);
    assert!(mentions(&stderr, "d.exr") && stderr.lines().count() == 1, "{stderr}");
    let diff = image::open(dir.path("d.exr")).expect("an EXR").into_rgb32f();
    let expected =
        floats(|x, y, c| (f32::from(distorted(x, y, c)) / 64.0 - f32::from(reference(x, y, c)) / 64.0).abs());
    assert_eq!(diff, expected);
    for ending in ["png", "jpg", "ppm"] {
        let (_, stderr) = json(&dir, &format!("a.png b.png --diff d.{ending}"), 0);
        assert_mentions(&stderr, &[&format!("d.{ending}"), "FLIP"]);
        let diff = image::open(dir.path(&format!("d.{ending}"))).expect("a picture");
        assert_eq!((diff.width(), diff.height()), SIZE);
    }
    let diff = image::open(dir.path("d.png")).expect("a PNG").into_rgb8();
    assert!(diff.pixels().any(|pixel| pixel.0.iter().any(|byte| *byte > 40)), "errors must be visible");
    dir.write("copy.png", dir.bytes("b.png"));
    json(&dir, "copy.png b.png --diff d.png", 0);
    let black = image::open(dir.path("d.png")).expect("a PNG").into_rgb8();
    assert!(black.pixels().all(|pixel| pixel.0 == [0; 3]), "zero error must be black");
}

#[test]
fn diff_never_replaces_a_compared_image() {
    let dir = dir();
    symlink("a.png", dir.path("soft.png")).expect("a link");
    fs::hard_link(dir.path("b.png"), dir.path("hard.png")).expect("a link");
    let before = [dir.bytes("a.png"), dir.bytes("b.png")];
    for (target, compared) in
        [("a.png", "a.png"), ("./b.png", "b.png"), ("soft.png", "a.png"), ("hard.png", "b.png")]
    {
        let stderr = dir.expect(&format!("compare a.png b.png --diff {target}"), 2);
        assert_mentions(&stderr, &[target, compared, "--diff FILE"]);
    }
    assert_eq!([dir.bytes("a.png"), dir.bytes("b.png")], before);
}

#[test]
fn diff_target_is_checked_first() {
    let dir = dir();
    let stderr = dir.expect("compare a.png b.png --diff d.gif", 2);
    assert_mentions(&stderr, &[".gif", ".png"]);
    let stderr = dir.expect("compare none.png b.png --diff none/d.png", 1);
    assert!(mentions(&stderr, "none") && !mentions(&stderr, "none.png"), "{stderr}");
}

#[test]
fn renders_differ_only_by_format_and_noise() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once --progress none -o a.exr -o a.png -o a.hdr --seed 1", 0);
    dir.expect("ball.toml --once --progress none -o b.exr --seed 2", 0);
    let relmse = |line: &str| json(&dir, line, 0).0["relmse"].as_f64().expect("a number");
    assert!(relmse("a.png a.exr") < 1e-3 && relmse("a.hdr a.exr") < 1e-3);
    assert!(relmse("b.exr a.exr") > relmse("a.hdr a.exr"), "different seeds must have different noise");
}
