use super::super::{EncodeOptions, Format, MovingFormat, encode, moving};
use super::*;
use crate::control::CancelToken;
use crate::film::{Picture, RadianceImage};

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
fn every_format_gives_back_what_was_written_into_it() {
    let image = RadianceImage::black(12, 7);
    let options = EncodeOptions { metadata: settings(), ..EncodeOptions::default() };
    for ending in Format::endings() {
        let format = Format::of(Path::new(&format!("a.{ending}"))).expect("a format");
        let bytes = encode(&image, &options, format, &CancelToken::new()).expect("encoded");
        let mut made = of_bytes(&bytes).expect(ending);
        assert_eq!(made.size, Some((12, 7)), "{ending}");
        assert_eq!(made.program.as_deref(), Some(SOFTWARE), "{ending}");
        assert!(made.is_own() && made.frames.is_none());
        // PNG has texts beyond ASCII apart from the others.
        let mut expected = expected();
        made.settings.sort();
        expected.sort();
        assert_eq!(made.settings, expected, "{ending}");
        assert_eq!(made.channels, if ending == "exr" { vec!["B", "G", "R"] } else { vec![] });
        image::load_from_memory(&bytes).expect("whole with its comments");
    }
}

#[test]
fn moving_pictures_too() {
    let frame = Picture { width: 5, height: 4, pixels: vec![[9, 8, 7]; 20] };
    for (format, name, frames) in [(MovingFormat::Gif, "GIF", Some(3)), (MovingFormat::Apng, "APNG", Some(3))]
    {
        let bytes = moving::encode(&vec![frame.clone(); 3], &settings(), format, &CancelToken::new());
        let mut made = of_bytes(&bytes.expect("encoded")).expect("read");
        assert_eq!((made.format.as_str(), made.size, made.frames), (name, Some((5, 4)), frames));
        made.settings.sort();
        assert_eq!(made.settings.len(), 3);
        assert!(made.settings.contains(&("scene".to_owned(), "hüte.toml".to_owned())));
    }
}

#[test]
fn pictures_of_others_say_nothing_and_other_files_are_none() {
    let mut bytes = Vec::new();
    let picture = image::RgbImage::new(3, 2);
    picture.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).expect("encoded");
    let made = of_bytes(&bytes).expect("a picture");
    assert!(!made.is_own() && made.settings.is_empty() && made.size == Some((3, 2)));
    assert!(of_bytes(b"[camera]\n").is_err_and(|why| why.is_none()));
}

/// Headers that end early or are full of zeros, ones or noise are errors, or pictures without settings.
#[test]
fn broken_headers_do_no_harm() {
    let options = EncodeOptions { metadata: settings(), ..EncodeOptions::default() };
    let image = RadianceImage::black(12, 7);
    let mut whole: Vec<Vec<u8>> = Format::endings()
        .map(|ending| Format::of(Path::new(&format!("a.{ending}"))).expect("a format"))
        .map(|format| encode(&image, &options, format, &CancelToken::new()).expect("encoded"))
        .collect();
    let frame = Picture { width: 5, height: 4, pixels: vec![[9, 8, 7]; 20] };
    whole.push(
        moving::encode(&[frame], &settings(), MovingFormat::Gif, &CancelToken::new()).expect("encoded"),
    );
    let mut next = crate::math::random::unit(5);
    for bytes in whole {
        for end in 0..bytes.len() {
            let _ = of_bytes(&bytes[..end]);
        }
        for _ in 0..300 {
            let mut bytes = bytes.clone();
            for _ in 0..3 {
                let at = (next() * bytes.len() as f32) as usize % bytes.len();
                bytes[at] = (next() * 256.0) as u8;
            }
            let _ = of_bytes(&bytes);
        }
    }
}

/// Frames may be far behind the header, each with a palette of its own; a file that is cut short has no known number of them.
#[test]
fn frames_of_a_gif_are_counted_to_its_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.gif");
    // The codes of pixels are passed over, so they may be anything.
    let mut bytes = b"GIF89a\x90\x01\x90\x01\x80\0\0\0\0\0\xff\xff\xff".to_vec();
    for _ in 0..30 {
        bytes.extend(b",\0\0\0\0\x90\x01\x90\x01\x81\0\0\0\x11\x11\x11\x22\x22\x22\x33\x33\x33\x02");
        (0..600).for_each(|_| bytes.extend([[255].as_slice(), &[b','; 255]].concat()));
        bytes.push(0);
    }
    bytes.push(b';');
    assert!(bytes.len() as u64 > START_BYTES, "{}", bytes.len());
    std::fs::write(&path, &bytes).expect("written");
    assert_eq!(made(&path).expect("read").frames, Some(30));
    std::fs::write(&path, &bytes[..bytes.len() - 9]).expect("written");
    let cut = made(&path).expect("read");
    assert_eq!((cut.frames, cut.size), (None, Some((400, 400))));
    let local = b"GIF89a\x01\0\x01\0\0\0\0,\0\0\0\0\x01\0\x01\0\x80\0\0\0\xff\xff\xff\x02\x02L\x01\0;";
    assert_eq!(of_bytes(local).expect("read").frames, Some(1));
}
