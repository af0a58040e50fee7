use std::io::Cursor;

use super::temporary::tests::stale_temporary_name;
use super::write::Durability;
use super::*;
use crate::film::tone::{Tonemap, tone_map_to_8_bits, tone_map_to_16_bits};
use crate::math::Vec3;

fn encode(image: &RadianceImage, options: &EncodeOptions, format: Format) -> Result<Vec<u8>, OutputError> {
    super::encode(image, options, format, &CancelToken::new())
}

/// A colored gradient from dark to bright, with some constant areas.
fn test_image(width: u32, height: u32) -> RadianceImage {
    let pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        let steps = (x / 5) as f32 / (width as f32 / 5.0);
        Vec3::new(steps, y as f32 / height as f32, ((x * 31 + y * 17) % 64) as f32 / 64.0) * 1.5
    };
    RadianceImage { width, height, pixels: (0..width * height).map(pixel).collect() }
}

fn options(bit_depth: BitDepth) -> EncodeOptions {
    let metadata = vec![
        ("Scene".to_owned(), "scenes/cornell.toml".to_owned()),
        ("Source".to_owned(), "Grüße, 日本\nsecond line".to_owned()),
    ];
    let tone = ToneMapping { exposure_stops: -0.5, curve: Tonemap::Reinhard, ..Default::default() };
    EncodeOptions { tone, bit_depth, metadata, mean_luminance_error: None }
}

fn decode(bytes: &[u8], format: image::ImageFormat) -> image::DynamicImage {
    image::load_from_memory_with_format(bytes, format).expect("a valid image")
}

#[test]
fn png_contains_the_tone_mapped_image() {
    let image = test_image(37, 23);
    for (depth, color) in
        [(BitDepth::Eight, image::ColorType::Rgb8), (BitDepth::Sixteen, image::ColorType::Rgb16)]
    {
        let options = options(depth);
        let decoded = decode(&encode(&image, &options, Format::Png).expect("a PNG"), image::ImageFormat::Png);
        assert_eq!((decoded.width(), decoded.height(), decoded.color()), (37, 23, color));
        match depth {
            BitDepth::Eight => {
                assert_eq!(
                    decoded.as_bytes(),
                    tone_map_to_8_bits(&image, &options.tone).pixels.as_flattened()
                );
            }
            BitDepth::Sixteen => {
                let expected = tone_map_to_16_bits(&image, &options.tone);
                let decoded = decoded.into_rgb16().into_raw();
                assert_eq!(decoded, expected.pixels.as_flattened());
            }
        }
    }
}

#[test]
fn png_declares_color_space_and_metadata() {
    let bytes = encode(&test_image(8, 8), &options(BitDepth::Eight), Format::Png).expect("a PNG");
    let reader = ::png::Decoder::new(Cursor::new(bytes)).read_info().expect("a header");
    let info = reader.info();
    assert!(info.srgb.is_some());
    let texts: Vec<_> = info.uncompressed_latin1_text.iter().map(|c| (&*c.keyword, &*c.text)).collect();
    assert_eq!(texts, [("Software", SOFTWARE), ("Scene", "scenes/cornell.toml")]);
    let unicode: Vec<_> = info.utf8_text.iter().map(|c| (&*c.keyword, c.get_text())).collect();
    assert_eq!(unicode.len(), 1);
    assert_eq!(unicode[0].0, "Source");
    assert_eq!(unicode[0].1.as_ref().expect("text"), "Grüße, 日本\nsecond line");
}

#[test]
fn invalid_png_texts_are_sanitized() {
    let name = format!("é{}", "n".repeat(200));
    let metadata = vec![(name, "a\0b".to_owned()), ("\u{1b}".to_owned(), "dropped".to_owned())];
    let bytes = encode(&test_image(1, 1), &EncodeOptions { metadata, ..Default::default() }, Format::Png);
    let reader = ::png::Decoder::new(Cursor::new(bytes.expect("a PNG"))).read_info().expect("a header");
    let texts = &reader.info().uncompressed_latin1_text;
    assert_eq!(texts.len(), 2);
    assert_eq!((texts[1].keyword.as_str(), texts[1].text.as_str()), ("n".repeat(79).as_str(), "ab"));
}

#[test]
fn exr_is_exact_and_ignores_the_exposure() {
    let mut image = test_image(50, 40);
    let special = [-0.0, 1e-45, f32::MIN_POSITIVE, 1.000_000_1, 65505.0, 1e30, f32::MAX];
    for (pixel, value) in image.pixels.iter_mut().zip(special) {
        pixel.y = value;
    }
    // Random bits, except that the values are finite, do not compress.
    let mut next = crate::math::random::unit_generator(5);
    let mut random = || {
        let mut half = || (next() * 65536.0) as u32;
        f32::from_bits((half() << 16 | half()) & !(1 << 30))
    };
    let pixels = (0..50 * 40).map(|_| Vec3::new(random(), random(), random())).collect();
    let noise = RadianceImage { pixels, ..image.clone() };
    for (image, is_smaller) in [(image, true), (noise, false)] {
        let bytes = encode(&image, &options(BitDepth::Eight), Format::Exr).expect("an EXR");
        assert_eq!(bytes.len() < size_of_val(image.pixels.as_slice()), is_smaller, "{} bytes", bytes.len());
        let file = read_exr(&bytes);
        assert_eq!(file.0, (50, 40));
        let bits = |v: &Vec3| v.to_array().map(f32::to_bits);
        for (decoded, expected) in file.1.iter().zip(&image.pixels) {
            assert_eq!(bits(decoded), bits(expected));
        }
        assert_eq!(file.1.len(), image.pixels.len());
    }
}

fn read_exr(bytes: &[u8]) -> ((usize, usize), Vec<Vec3>) {
    use ::exr::prelude::*;
    let file = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size, vec![Vec3::ZERO; size.area()]),
            |(size, pixels), at, (r, g, b, _): (f32, f32, f32, f32)| {
                pixels[at.y() * size.width() + at.x()] = Vec3::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .expect("an EXR");
    let (size, pixels) = file.layer_data.channel_data.pixels;
    ((size.width(), size.height()), pixels)
}

#[test]
fn exr_declares_primaries_and_attributes() {
    let bytes = encode(&test_image(4, 4), &options(BitDepth::Sixteen), Format::Exr).expect("an EXR");
    let meta = ::exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), true).expect("a header");
    let header = &meta.headers[0];
    assert_eq!(header.shared_attributes.chromaticities.expect("primaries").green.x(), 0.30);
    let own = &header.own_attributes;
    assert_eq!(own.software_name.as_ref().expect("software").as_slice(), SOFTWARE.as_bytes());
    let comments = own.comments.as_ref().expect("comments").as_slice();
    assert_eq!(comments, "Scene: scenes/cornell.toml\nSource: Grüße, 日本 second line".as_bytes());
}

#[test]
fn exr_stores_the_mean_luminance_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    let write = |error, format| {
        let options = EncodeOptions { mean_luminance_error: error, ..Default::default() };
        std::fs::write(&path, encode(&test_image(4, 4), &options, format).expect("a file")).expect("written");
        read_mean_luminance_error(&path)
    };
    assert_eq!(write(Some(0.012_345_678_9), Format::Exr), Some(0.012_345_678_9));
    assert_eq!(write(Some(f64::NAN), Format::Exr), None);
    assert_eq!(write(None, Format::Exr), None);
    assert_eq!(write(Some(0.5), Format::Png), None);
    assert_eq!(read_mean_luminance_error(folder.path()), None);
}

#[test]
fn only_exr_keeps_negative_values() {
    let pixels = vec![Vec3::new(f32::NAN, -1.0, f32::NEG_INFINITY), Vec3::new(f32::INFINITY, 1.0, -1e-45)];
    let image = RadianceImage { width: 2, height: 1, pixels };
    let bytes = encode(&image, &EncodeOptions::default(), Format::Exr).expect("an EXR");
    assert_eq!(read_exr(&bytes).1, [Vec3::new(0.0, -1.0, -f32::MAX), Vec3::new(f32::MAX, 1.0, -1e-45)]);
    let bytes = encode(&image, &EncodeOptions::default(), Format::Hdr).expect("an HDR");
    let decoded = decode(&bytes, image::ImageFormat::Hdr).into_rgb32f().into_raw();
    assert_eq!(decoded[..3], [0.0; 3]);
    assert!(decoded[3] > 1e38 && decoded.iter().all(|v| v.is_finite() && *v >= 0.0), "{decoded:?}");
    for depth in [BitDepth::Eight, BitDepth::Sixteen] {
        let bytes = encode(&image, &options(depth), Format::Png).expect("a PNG");
        assert_eq!(decode(&bytes, image::ImageFormat::Png).into_rgb16().into_raw()[..3], [0; 3], "{depth:?}");
    }
}

#[test]
fn hdr_rounds_correctly() {
    for (width, height) in [(1, 5), (7, 3), (8, 3), (300, 40), (32767, 1), (32768, 1), (40000, 1)] {
        let mut image = test_image(width, height);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel *= 10_f32.powi((i / 50) as i32 % 60 - 30);
        }
        let bytes = encode(&image, &options(BitDepth::Eight), Format::Hdr).expect("an HDR");
        let decoded = decode(&bytes, image::ImageFormat::Hdr).into_rgb32f();
        assert_eq!((decoded.width(), decoded.height()), (width, height));
        for (decoded, expected) in decoded.pixels().zip(&image.pixels) {
            let error = (Vec3::from_array(decoded.0) - *expected).abs().max_element();
            assert!(error <= expected.max_element() / 255.0, "{decoded:?} {expected} at {width}");
        }
        let start = String::from_utf8_lossy(&bytes[..200.min(bytes.len())]);
        assert!(start.contains("Scene: scenes/cornell.toml"));
    }
}

#[test]
fn hdr_handles_extreme_values() {
    let values = [1e-45, 1e-39, 1e-37, 0.999, 0.998, 255.5, 1e38, f32::MAX];
    let pixels: Vec<_> = values.iter().map(|&v| Vec3::splat(v)).collect();
    let image = RadianceImage { width: 8, height: 1, pixels };
    let bytes = encode(&image, &EncodeOptions::default(), Format::Hdr).expect("an HDR");
    let decoded = decode(&bytes, image::ImageFormat::Hdr).into_rgb32f();
    for (decoded, expected) in decoded.pixels().zip(values) {
        let bound = if expected > 1.6e38 { 0.51 * expected } else { expected / 255.0 + 1e-38 };
        assert!((decoded.0[0] - expected).abs() <= bound, "expected {expected:e}, got {:e}", decoded.0[0]);
    }
}

#[test]
fn hdr_compresses_constant_scanlines() {
    let image = RadianceImage::black(1000, 10);
    let bytes = encode(&image, &EncodeOptions::default(), Format::Hdr).expect("an HDR");
    assert!(bytes.len() < 1000, "{} bytes", bytes.len());
}

#[test]
fn ppm_contains_the_tone_mapped_image() {
    let image = test_image(37, 23);
    let eight = encode(&image, &options(BitDepth::Eight), Format::Ppm).expect("a PPM");
    let tone = options(BitDepth::Eight).tone;
    let decoded = decode(&eight, image::ImageFormat::Pnm).into_rgb8().into_raw();
    assert_eq!(decoded, tone_map_to_8_bits(&image, &tone).pixels.as_flattened());
    let sixteen = encode(&image, &options(BitDepth::Sixteen), Format::Ppm).expect("a PPM");
    let decoded = decode(&sixteen, image::ImageFormat::Pnm).into_rgb16().into_raw();
    assert_eq!(decoded, tone_map_to_16_bits(&image, &tone).pixels.as_flattened());
}

#[test]
fn jpeg_chroma_is_not_subsampled() {
    // Smooth colors and a sharp edge between saturated colors. Subsampling would blur the edge.
    let pixel = |i: u32| if i % 64 < 31 { Vec3::new(0.8, 0.05, 0.05) } else { Vec3::new(0.05, 0.05, 0.8) };
    let image = RadianceImage { width: 64, height: 64, pixels: (0..64 * 64).map(pixel).collect() };
    let options = EncodeOptions::default();
    let bytes = encode(&image, &options, Format::Jpeg).expect("a JPEG");
    let decoded = decode(&bytes, image::ImageFormat::Jpeg).into_rgb8();
    for (decoded, expected) in decoded.pixels().zip(tone_map_to_8_bits(&image, &options.tone).pixels) {
        for (a, b) in decoded.0.iter().zip(expected) {
            assert!(a.abs_diff(b) <= 16, "{decoded:?} {expected:?}");
        }
    }
}

#[test]
fn webp_has_the_same_pixels_and_settings_as_png() {
    let image = test_image(37, 21);
    let mut options = options(BitDepth::Eight);
    options.metadata.push(("glimt:scene".to_owned(), "a \"b\" <c> & d".to_owned()));
    let bytes = encode(&image, &options, Format::WebP).expect("a WebP");
    let png = encode(&image, &options, Format::Png).expect("a PNG");
    let decoded = decode(&bytes, image::ImageFormat::WebP).into_rgb8();
    assert_eq!(decoded, decode(&png, image::ImageFormat::Png).into_rgb8());
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.webp");
    std::fs::write(&path, &bytes).expect("written");
    let made = super::settings::read_image_info(&path).expect("settings");
    assert_eq!((made.format.as_str(), made.size, made.is_written_by_glimt()), ("WebP", Some((37, 21)), true));
    assert!(
        made.settings.contains(&("scene".to_owned(), "a \"b\" <c> & d".to_owned())),
        "{:?}",
        made.settings
    );
    let wide = encode(&test_image(16384, 1), &options, Format::WebP).expect_err("too wide");
    assert!(matches!(wide, OutputError::Unsuitable { format: Format::WebP, .. }), "{wide}");
}

#[test]
fn encoding_is_deterministic() {
    let image = test_image(200, 150);
    for format in [Format::Png, Format::Exr, Format::Hdr, Format::Jpeg, Format::Ppm, Format::WebP] {
        let once = encode(&image, &options(BitDepth::Eight), format).expect("bytes");
        let again = || encode(&image, &options(BitDepth::Eight), format).expect("bytes");
        assert!(once == again(), "{format}");
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert!(once == pool.install(again), "{format} with {threads} threads");
        }
    }
}

#[test]
fn extensions_select_the_format() {
    let format = |path: &str| Format::from_path(Path::new(path)).map_err(|error| error.to_string());
    assert_eq!(format("a/b.c/out.png"), Ok(Format::Png));
    assert_eq!(format("OUT.JPEG"), Ok(Format::Jpeg));
    assert_eq!(format("x.jpg"), Ok(Format::Jpeg));
    assert_eq!(format("x.exr"), Ok(Format::Exr));
    assert_eq!(format("x.Hdr"), Ok(Format::Hdr));
    assert_eq!(format("x.ppm"), Ok(Format::Ppm));
    assert_eq!(format("x.WebP"), Ok(Format::WebP));
    let error = |path: &str| Format::from_path(Path::new(path)).expect_err(path);
    let unknown = error("x.tiff");
    assert!(
        matches!(&unknown, OutputError::UnknownExtension { extension, .. } if extension == "tiff"),
        "{unknown}"
    );
    for path in ["x", ".png", ""] {
        let missing = error(path);
        assert!(matches!(missing, OutputError::NoExtension { .. }), "{missing}");
    }
    assert!(unknown.to_string().contains(".png, .exr, .hdr, .jpg, .jpeg, .ppm, .webp"), "{unknown}");
}

#[test]
fn unsuitable_images_are_rejected() {
    let deep = encode(&test_image(2, 2), &options(BitDepth::Sixteen), Format::Jpeg).expect_err("8 bits only");
    assert!(matches!(deep, OutputError::Unsuitable { format: Format::Jpeg, .. }), "{deep}");
    let wide = encode(&test_image(65536, 1), &EncodeOptions::default(), Format::Jpeg).expect_err("too wide");
    assert!(wide.to_string().contains("65536×1"), "{wide}");
    assert!(encode(&test_image(65535, 1), &EncodeOptions::default(), Format::Jpeg).is_ok());
    assert!(encode(&RadianceImage::black(0, 3), &EncodeOptions::default(), Format::Png).is_err());
    let torn = RadianceImage { pixels: Vec::new(), ..test_image(3, 3) };
    assert!(encode(&torn, &EncodeOptions::default(), Format::Jpeg).is_err());
    assert!(BitDepth::try_from(12).is_err());
    assert_eq!(BitDepth::try_from(16).expect("known"), BitDepth::Sixteen);
}

const NOTHING_KEPT: write::ExistingFilePolicy<'_> = write::ExistingFilePolicy {
    is_kept: &|_| false,
    may_replace: &|_| Ok(()),
    sweep: None,
    losses: AttributeLossPolicy::Report(&|_| ()),
};

#[test]
fn canceled_images_are_not_encoded_or_written() {
    let token = CancelToken::new();
    token.cancel();
    for format in [Format::Png, Format::Exr, Format::Hdr, Format::Jpeg, Format::Ppm, Format::WebP] {
        let stopped = super::encode(&test_image(30, 20), &options(BitDepth::Eight), format, &token);
        assert!(matches!(stopped, Err(OutputError::Canceled(_))), "{format}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    std::fs::write(&path, "old").expect("written");
    let stopped = write::write_atomically_with_policy(&path, b"new", &NOTHING_KEPT, &token);
    assert!(matches!(stopped, Err(OutputError::Canceled(_))));
    assert_eq!(std::fs::read(&path).expect("read"), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
}

#[test]
fn each_folder_is_searched_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let other = folder.path().join("other");
    std::fs::create_dir(&other).expect("a folder");
    let write_two = |guard: &write::ExistingFilePolicy<'_>| {
        let mut kept = Vec::new();
        for at in [folder.path(), &other].repeat(2) {
            let stale = at.join(stale_temporary_name("stale.png"));
            std::fs::write(&stale, "half").expect("written");
            write::write_atomically_with_policy(&at.join("a.png"), b"new", guard, &CancelToken::new())
                .expect("written");
            kept.push(stale.exists());
        }
        kept
    };
    let sweep = write::SweptFolders::default();
    let guard = write::ExistingFilePolicy { sweep: Some(&sweep), ..NOTHING_KEPT };
    assert_eq!(write_two(&guard), [false, false, true, true]);
    assert_eq!(write_two(&NOTHING_KEPT), [false; 4]);
}

#[test]
fn unsynchronized_files_are_reported_as_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    let (warnings, synced) = (std::cell::RefCell::new(Vec::new()), std::cell::Cell::new(0));
    let report = |warning| warnings.borrow_mut().push(warning);
    let guard = write::ExistingFilePolicy { losses: AttributeLossPolicy::Report(&report), ..NOTHING_KEPT };
    let content = |file: &mut dyn std::io::Write| file.write_all(b"new");
    let failing_sync = |directory: &Path| {
        synced.set(synced.get() + 1);
        assert_eq!(directory, folder.path());
        assert_eq!(std::fs::read(&path).expect("renamed before"), b"new");
        Err(nix::errno::Errno::EIO.into())
    };
    for (durability, expected, count) in [
        (Durability::Process, None, 0),
        (Durability::Power, None, 1),
        (Durability::Power, Some(&b"old"[..]), 2),
    ] {
        std::fs::write(&path, "old").expect("written");
        let token = CancelToken::new();
        write::write_atomically_or_in_place(
            &path,
            &content,
            &guard,
            &token,
            durability,
            expected,
            &failing_sync,
        )
        .expect("written");
        assert_eq!((synced.get(), warnings.borrow().len()), (count, count), "{durability:?} {expected:?}");
        assert_eq!(std::fs::read(&path).expect("read"), b"new");
    }
    for warning in warnings.into_inner() {
        assert!(
            matches!(&warning, WriteWarning::NotSynchronized { path: of, .. } if *of == path),
            "{warning}"
        );
        let words = warning.to_string();
        assert!(words.contains("a.png: written") && words.contains("power failure"), "{words}");
    }
}

#[test]
fn guards_check_the_link_target_after_writing() {
    let folder = tempfile::tempdir().expect("a folder");
    let (link, real) = (folder.path().join("link.png"), folder.path().join("real.png"));
    std::fs::write(&real, "old").expect("written");
    std::os::unix::fs::symlink("real.png", &link).expect("a link");
    let entries = || std::fs::read_dir(folder.path()).expect("a folder").count();
    let asked = std::cell::Cell::new(0);
    let may_replace = |path: &std::path::Path| {
        asked.set(asked.get() + 1);
        assert_eq!((path, entries()), (real.as_path(), 3), "the temporary file should exist");
        Err(OutputError::Refused { reason: "no".to_owned() })
    };
    let guard = write::ExistingFilePolicy { may_replace: &may_replace, ..NOTHING_KEPT };
    let refused =
        write::write_atomically_with_policy(&link, b"new", &guard, &CancelToken::new()).expect_err("refused");
    assert_eq!((refused.to_string().as_str(), asked.get(), entries()), ("no", 1, 2));
    assert_eq!(std::fs::read(&real).expect("read"), b"old");
}

/// A writer that is not root cannot restore a file's owner. Requires root, because a thread changes its
/// file system user to `nobody` (setfsuid(2)).
#[cfg(target_os = "linux")]
#[test]
fn replacing_a_file_grants_no_permissions() {
    use nix::unistd::{Gid, Uid, geteuid, setfsgid, setfsuid};
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    if !geteuid().is_root() {
        return eprintln!("skipped: only root can become another user");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let permit = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).expect("permitted");
    };
    permit(folder.path(), 0o777);
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, "old").expect("written");
    permit(&path, 0o4664);
    let reports = std::sync::Mutex::new(Vec::new());
    let write = |is_refused: bool| {
        let as_nobody = || {
            let report = |what| reports.lock().expect("no panic").push(what);
            let losses =
                if is_refused { AttributeLossPolicy::Refuse } else { AttributeLossPolicy::Report(&report) };
            let guard = write::ExistingFilePolicy { losses, ..NOTHING_KEPT };
            setfsgid(Gid::from_raw(65534));
            setfsuid(Uid::from_raw(65534));
            write::write_atomically_with_policy(&path, b"new", &guard, &CancelToken::new())
        };
        std::thread::scope(|scope| {
            std::thread::Builder::new()
                .spawn_scoped(scope, as_nobody)
                .expect("a thread")
                .join()
                .expect("no panic")
        })
    };
    let refused = write(true).expect_err("its owner is root");
    assert!(matches!(refused, OutputError::Target { .. }), "{refused}");
    assert_eq!(std::fs::read(&path).expect("read"), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
    assert!(reports.lock().expect("no panic").is_empty());
    write(false).expect("written");
    let lost = ["its owner", "its group"].map(str::to_owned);
    let warning = WriteWarning::AttributesLost { path: path.clone(), lost: lost.into() };
    assert_eq!(*reports.lock().expect("no panic"), [warning]);
    let found = std::fs::metadata(&path).expect("a file");
    assert_eq!((found.uid(), found.mode() & 0o7777), (65534, 0o644));
}

#[test]
fn concurrent_saves_are_not_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    let refused = || OutputError::Refused { reason: "it has changed".to_owned() };
    let swap = |may_replace: &dyn Fn(&Path) -> Result<(), OutputError>| {
        std::fs::write(&path, "read").expect("written");
        let guard = write::ExistingFilePolicy { may_replace, ..NOTHING_KEPT };
        write::write_atomically_if_unchanged(&path, b"read", b"new", &guard, &CancelToken::new())
    };
    let has = |text: &str| std::fs::read(&path).expect("read") == text.as_bytes();
    let is_as_read = |path: &Path| match std::fs::read(path) {
        Ok(content) if content == b"read" => Ok(()),
        Ok(_) | Err(_) => Err(refused()),
    };
    swap(&is_as_read).expect("replaced");
    assert!(has("new"));
    // An editor saves after the check, either by writing to the file or by replacing it.
    let edited = folder.path().join("edited");
    for by_rename in [false, true] {
        let saved = std::cell::Cell::new(false);
        let swapped = swap(&|path| {
            let looked = is_as_read(path);
            if !saved.replace(true) {
                let to = if by_rename { &edited } else { path };
                std::fs::write(to, "an edit").expect("written");
                if by_rename {
                    std::fs::rename(to, path).expect("renamed");
                }
            }
            looked
        });
        assert!(matches!(swapped, Err(OutputError::Refused { .. })), "{swapped:?}");
        assert!(has("an edit"), "{by_rename}");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "no other files");
    }
}
