//! Tests for Radiance HDR files from various programs.

use super::*;
use crate::assets::image::hdr::{
    RUN_TOO_LONG, WRONG_LENGTH, line_ignored_warning, unsupported_pixel_format_message,
};

/// A pixel with exponent 129, so one mantissa step is 1/128.
const PIXEL: [u8; 4] = [128, 64, 32, 129];

fn file(header: &str, size: &str, pixels: &[u8]) -> Vec<u8> {
    [format!("#?RADIANCE\n{header}\n{size}\n").as_bytes(), pixels].concat()
}

#[track_caller]
fn texels(file: &[u8], encoding: ColorEncoding) -> Vec<Vec3> {
    match load_bytes("a.hdr", file, encoding).expect("an HDR").data {
        TexelData::Float(texels) => texels,
        other => panic!("{other:?}"),
    }
}

fn single_pixel(header: &str) -> Vec3 {
    texels(&file(header, "-Y 1 +X 1", &PIXEL), ColorEncoding::Color)[0]
}

#[test]
fn header_variants_are_read() {
    for start in ["#?RADIANCE\n", "#?RGBE\n", "#?rpict\n", "#?AUTOPANO\n", "#?RGBE\r\n", "#?\n"] {
        for rest in [
            "FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n",
            "# a comment\nVIEW= -vtv\nFORMAT = 32-bit_rle_rgbe\nGAMMA=1.0\n\n-Y 1 +X 1\n",
            "\n\n-Y 1 +X 1\n",
            "FORMAT=32-bit_rle_rgbe\r\n\r\n-Y 1 +X 1\n",
            "FORMAT=32-bit_rle_rgbe\n-Y 1 +X 1\n",
        ] {
            let file = [start.as_bytes(), rest.as_bytes(), &PIXEL].concat();
            assert_eq!(texels(&file, ColorEncoding::Color), [Vec3::new(1.0, 0.5, 0.25)], "{start}{rest}");
        }
    }
    assert_eq!(error("a.hdr", b"#RADIANCE\n\n-Y 1 +X 1\nabcd"), unknown_format_message());
    let unknown = error("a.hdr", &file("FORMAT=32-bit_rle_xyzw\n", "-Y 1 +X 1", &PIXEL));
    assert!(unknown.ends_with(&unsupported_pixel_format_message("32-bit_rle_xyzw")), "{unknown}");
    for size in ["-Y 1 +Y 1", "-Y 1", "X 1 Y 1", "-Y -1 +X 1", "-Y 1 +X 1 2"] {
        assert!(load_bytes("a.hdr", &file("", size, &PIXEL), ColorEncoding::Color).is_err(), "{size}");
    }
}

/// The lists contain the pixel indices of a 3 × 2 image in file order, numbered from the top left.
#[test]
fn all_orientations_decode_to_the_same_image() {
    for (size, order) in [
        ("-Y 2 +X 3", [0, 1, 2, 3, 4, 5]),
        ("-Y 2 -X 3", [2, 1, 0, 5, 4, 3]),
        ("+Y 2 +X 3", [3, 4, 5, 0, 1, 2]),
        ("+Y 2 -X 3", [5, 4, 3, 2, 1, 0]),
        ("+X 3 -Y 2", [0, 3, 1, 4, 2, 5]),
        ("+X 3 +Y 2", [3, 0, 4, 1, 5, 2]),
        ("-X 3 -Y 2", [2, 5, 1, 4, 0, 3]),
        ("-X 3 +Y 2", [5, 2, 4, 1, 3, 0]),
    ] {
        let pixels: Vec<u8> = order.iter().flat_map(|&number| [number, 0, 0, 136]).collect();
        let image = load_bytes("a.hdr", &file("", size, &pixels), ColorEncoding::Color).expect(size);
        assert_eq!((image.width, image.height), (3, 2), "{size}");
        let reds: Vec<f32> = (0..6).map(|index| image.linear_color_at_index(index).x).collect();
        assert_eq!(reds, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "{size}");
    }
}

#[test]
fn values_are_divided_by_exposure_and_correction() {
    let plain = Vec3::new(1.0, 0.5, 0.25);
    assert_eq!(single_pixel("EXPOSURE=2\n"), plain / 2.0);
    assert_eq!(single_pixel("EXPOSURE=2\nEXPOSURE= 4\n"), plain / 8.0);
    assert_eq!(single_pixel("COLORCORR=4 2 1\n"), Vec3::splat(0.25));
    assert_eq!(single_pixel("COLORCORR=4 2 1\nEXPOSURE=0.5\nCOLORCORR=1 2 4\n"), Vec3::new(0.5, 0.25, 0.125));
    // Lines quoted from other headers are ignored.
    assert_eq!(single_pixel("\tEXPOSURE=2\n# EXPOSURE=2\n"), plain);
    // The exposure applies to all encodings.
    let number = ColorEncoding::Number { of: ChannelSelector::Luminance, is_srgb: false };
    for encoding in [ColorEncoding::Linear, ColorEncoding::Raw, number] {
        let [plain, divided] =
            ["", "EXPOSURE=2\n"].map(|header| texels(&file(header, "-Y 1 +X 1", &PIXEL), encoding)[0]);
        assert_eq!(divided, plain / 2.0, "{encoding:?}");
    }
    for line in ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=x", "EXPOSURE=1 2", "COLORCORR=1 1", "GAMMA=2.2"] {
        let file = file(&format!("# first\n{line}\n"), "-Y 1 +X 1", &PIXEL);
        assert_eq!(texels(&file, ColorEncoding::Color), [plain], "{line}");
        let warnings = warnings_of("a.hdr", &file, ColorEncoding::Color);
        assert_eq!(warnings, [format!("a.hdr:3: {}", line_ignored_warning(line))]);
    }
}

#[test]
fn primaries_are_converted() {
    let white = [64, 64, 64, 129];
    let rec_2020 = "PRIMARIES=.708 .292 .17 .797 .131 .046 .3127 .329\n";
    let color =
        |header: &str, pixel: &[u8]| texels(&file(header, "-Y 1 +X 1", pixel), ColorEncoding::Color)[0];
    let near = |a: Vec3, b: Vec3| (a - b).length() < 2e-3;
    assert!(near(color(rec_2020, &white), Vec3::splat(0.5)));
    assert!(near(color(rec_2020, &[64, 0, 0, 129]), Vec3::new(0.8302, 0.0, 0.0)));
    assert_eq!(color("PRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329\n", &PIXEL), Vec3::new(1.0, 0.5, 0.25));
    // Noncolor data is not converted.
    for encoding in [ColorEncoding::Linear, ColorEncoding::Srgb] {
        let [with, without] =
            [rec_2020, ""].map(|header| texels(&file(header, "-Y 1 +X 1", &PIXEL), encoding));
        assert_eq!(with, without);
    }
    // Y is in lumens. Equal-energy white is converted to white.
    let xyz = "FORMAT=32-bit_rle_xyze\n";
    assert!(near(color(xyz, &[179, 179, 179, 136]), Vec3::ONE));
    for broken in ["PRIMARIES=.64 .33 .3 .6 .15 .06", "PRIMARIES=0 0 0 0 0 0 0 0"] {
        let file = file(&format!("{broken}\n"), "-Y 1 +X 1", &PIXEL);
        let warnings = warnings_of("a.hdr", &file, ColorEncoding::Color);
        assert_eq!(warnings, [format!("a.hdr:2: {}", line_ignored_warning(broken))]);
    }
}

/// A scanline of `count` pixels, run-length encoded per channel.
fn runs(count: u16, value: impl Fn(u16) -> [u8; 4]) -> Vec<u8> {
    let mut line = vec![2, 2];
    line.extend(count.to_be_bytes());
    for channel in 0..4 {
        let mut at = 0;
        while at < count {
            let first = value(at)[channel];
            let run = (at..count).take(127).take_while(|&at| value(at)[channel] == first).count() as u16;
            line.extend(if run > 2 { vec![128 + run as u8, first] } else { vec![1, first] });
            at += if run > 2 { run } else { 1 };
        }
    }
    line
}

#[test]
fn scanline_encodings_decode_to_the_same_pixels() {
    let value = |at: u16| [(at / 5 % 256) as u8, (at % 3) as u8, 9, 136];
    let expected = |count: u16| -> Vec<Vec3> {
        (0..count).map(|at| Vec3::from_array([0, 1, 2].map(|i| f32::from(value(at)[i])))).collect()
    };
    for count in [1, 7, 8, 200, 32767, 33000] {
        let flat: Vec<u8> = (0..count).flat_map(value).collect();
        let size = format!("-Y 1 +X {count}");
        assert_eq!(texels(&file("", &size, &flat), ColorEncoding::Color), expected(count), "{count}");
        if (8..32768).contains(&count) {
            let runs = runs(count, value);
            assert_eq!(texels(&file("", &size, &runs), ColorEncoding::Color), expected(count), "{count}");
        }
    }
    // (1, 1, 1, n) repeats the previous pixel n times. A second (1, 1, 1, n) repeats it 256 · n times.
    let old = [5, 6, 7, 136, 1, 1, 1, 3, 1, 1, 1, 2, 8, 0, 0, 136, 1, 1, 1, 1];
    let size = "-Y 1 +X 518";
    let found = texels(&file("", size, &old), ColorEncoding::Color);
    assert_eq!(found[..516], vec![Vec3::new(5.0, 6.0, 7.0); 516]);
    assert_eq!(found[516..], [Vec3::new(8.0, 0.0, 0.0); 2]);
    // This line starts like a run-length encoded line, but is too short for this encoding.
    assert_eq!(texels(&file("", "-Y 1 +X 1", &[2, 2, 0, 1]), ColorEncoding::Color).len(), 1);
}

#[test]
fn malformed_runs_are_rejected() {
    let fails =
        |size: &str, pixels: &[u8], reason: &str| error("a.hdr", &file("", size, pixels)).ends_with(reason);
    assert!(fails("-Y 1 +X 8", &[2, 2, 0, 9], WRONG_LENGTH));
    assert!(fails("-Y 1 +X 8", &[2, 2, 0, 8, 137, 1], RUN_TOO_LONG));
    assert!(fails("-Y 1 +X 8", &[2, 2, 0, 8, 0, 1], RUN_TOO_LONG));
    assert!(fails("-Y 1 +X 2", &[1, 1, 1, 1], RUN_TOO_LONG));
    assert!(fails("-Y 1 +X 2", &[9, 1, 1, 1, 1, 1, 1, 255], RUN_TOO_LONG));
    assert!(fails("-Y 1 +X 2", &PIXEL, jpeg::TRUNCATED));
    assert!(fails("-Y 2 +X 0", &PIXEL, &empty_image_message(0, 2)));
}
