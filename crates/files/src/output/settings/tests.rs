use super::super::{AnimationFormat, EncodeOptions, Format, animation, encode};
use super::*;
use crate::control::CancelToken;
use crate::film::{RadianceImage, Srgb8Image};

fn settings() -> Vec<(String, String)> {
    [("glimt:scene", "hüte.toml"), ("glimt:samples", "1 to 64, 7.50 on average"), ("Error", "none: at all")]
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
        .to_vec()
}

fn expected() -> Vec<(String, String)> {
    let short = |(name, value): (String, String)| (name.replace("glimt:", ""), value);
    settings().into_iter().map(short).collect()
}

#[test]
fn settings_round_trip_in_all_image_formats() {
    let image = RadianceImage::black(12, 7);
    let options = EncodeOptions { metadata: settings(), ..EncodeOptions::default() };
    for extension in Format::all_extensions() {
        let format = Format::from_path(Path::new(&format!("a.{extension}"))).expect("a format");
        let bytes = encode(&image, &options, format, &CancelToken::new()).expect("encoded");
        let mut info = read_info_from_start(&bytes).expect(extension);
        assert_eq!(info.size, Some((12, 7)), "{extension}");
        assert_eq!(info.program.as_deref(), Some(SOFTWARE), "{extension}");
        assert!(info.is_written_by_glimt() && info.frames.is_none());
        // PNG stores non-ASCII text separately, which changes the order.
        let mut expected = expected();
        info.settings.sort();
        expected.sort();
        assert_eq!(info.settings, expected, "{extension}");
        assert_eq!(info.channels, if extension == "exr" { vec!["B", "G", "R"] } else { vec![] });
        image::load_from_memory(&bytes).expect("a valid image");
    }
}

#[test]
fn settings_round_trip_in_animations() {
    let frame = Srgb8Image { width: 5, height: 4, pixels: vec![[9, 8, 7]; 20] };
    for (format, name, frames) in
        [(AnimationFormat::Gif, "GIF", Some(3)), (AnimationFormat::Apng, "APNG", Some(3))]
    {
        let bytes = animation::encode(&vec![frame.clone(); 3], &settings(), format, &CancelToken::new());
        let mut info = read_info_from_start(&bytes.expect("encoded")).expect("read");
        assert_eq!((info.format.as_str(), info.size, info.frames), (name, Some((5, 4)), frames));
        info.settings.sort();
        assert_eq!(info.settings.len(), 3);
        assert!(info.settings.contains(&("scene".to_owned(), "hüte.toml".to_owned())));
    }
}

#[test]
fn foreign_images_have_no_settings() {
    let mut bytes = Vec::new();
    let foreign = image::RgbImage::new(3, 2);
    foreign.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).expect("encoded");
    let info = read_info_from_start(&bytes).expect("an image");
    assert!(!info.is_written_by_glimt() && info.settings.is_empty() && info.size == Some((3, 2)));
    assert_eq!(read_info_from_start(b"[camera]\n"), Err(None));
}

/// A truncated or corrupted header is either an error or read as an image without settings.
#[test]
fn corrupt_headers_do_not_panic() {
    let options = EncodeOptions { metadata: settings(), ..EncodeOptions::default() };
    let image = RadianceImage::black(12, 7);
    let mut files: Vec<Vec<u8>> = Format::all_extensions()
        .map(|extension| Format::from_path(Path::new(&format!("a.{extension}"))).expect("a format"))
        .map(|format| encode(&image, &options, format, &CancelToken::new()).expect("encoded"))
        .collect();
    let frame = Srgb8Image { width: 5, height: 4, pixels: vec![[9, 8, 7]; 20] };
    files.push(
        animation::encode(&[frame], &settings(), AnimationFormat::Gif, &CancelToken::new()).expect("encoded"),
    );
    let mut next = crate::math::random::unit_generator(5);
    for bytes in files {
        for end in 0..bytes.len() {
            let _ = read_info_from_start(&bytes[..end]);
        }
        for _ in 0..300 {
            let mut bytes = bytes.clone();
            for _ in 0..3 {
                let at = (next() * bytes.len() as f32) as usize % bytes.len();
                bytes[at] = (next() * 256.0) as u8;
            }
            let _ = read_info_from_start(&bytes);
        }
    }
}

/// Frames may be far from the header and have their own palettes. If the file is truncated, the number of
/// frames is unknown.
#[test]
fn all_gif_frames_are_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.gif");
    // Pixel data is skipped, so it may be arbitrary.
    let mut bytes = b"GIF89a\x90\x01\x90\x01\x80\0\0\0\0\0\xff\xff\xff".to_vec();
    for _ in 0..30 {
        bytes.extend(b",\0\0\0\0\x90\x01\x90\x01\x81\0\0\0\x11\x11\x11\x22\x22\x22\x33\x33\x33\x02");
        (0..600).for_each(|_| bytes.extend([[255].as_slice(), &[b','; 255]].concat()));
        bytes.push(0);
    }
    bytes.push(b';');
    assert!(bytes.len() as u64 > START_BYTES, "{}", bytes.len());
    std::fs::write(&path, &bytes).expect("written");
    assert_eq!(read_image_info(&path).expect("read").frames, Some(30));
    std::fs::write(&path, &bytes[..bytes.len() - 9]).expect("written");
    let cut = read_image_info(&path).expect("read");
    assert_eq!((cut.frames, cut.size), (None, Some((400, 400))));
    let local = b"GIF89a\x01\0\x01\0\0\0\0,\0\0\0\0\x01\0\x01\0\x80\0\0\0\xff\xff\xff\x02\x02L\x01\0;";
    assert_eq!(read_info_from_start(local).expect("read").frames, Some(1));
}
