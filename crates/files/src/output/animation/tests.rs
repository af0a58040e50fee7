use std::path::Path;

use super::*;

/// A gradient with a moving square.
fn frame(number: u32) -> Srgb8Image {
    let (width, height) = (96, 40);
    let pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        let is_square = (10..20).contains(&y) && (number * 7..number * 7 + 10).contains(&x);
        if is_square { [250, 20, 30] } else { [(x + 60) as u8, (2 * x + 9) as u8, (250 - 4 * y) as u8] }
    };
    Srgb8Image { width, height, pixels: (0..width * height).map(pixel).collect() }
}

fn frames() -> Vec<Srgb8Image> {
    (0..8).map(frame).collect()
}

fn metadata() -> Vec<(String, String)> {
    vec![("glimt:scene".to_owned(), "hüte.toml".to_owned())]
}

fn bytes(format: AnimationFormat) -> Vec<u8> {
    encode(&frames(), &metadata(), format, &CancelToken::new()).expect("encoded")
}

#[test]
fn apng_frames_are_lossless() {
    let bytes = bytes(AnimationFormat::Apng);
    let mut reader = ::png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().expect("PNG");
    let control = *reader.info().animation_control().expect("an animation");
    assert_eq!((control.num_frames, control.num_plays), (8, 0));
    for expected in frames() {
        let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut pixels).expect("a frame");
        assert_eq!(pixels, expected.pixels.as_flattened());
        let delay = reader.info().frame_control().expect("frame control");
        assert_eq!((delay.delay_num, delay.delay_den), (500, 1000), "8 frames in 4 s");
    }
    assert_eq!(reader.info().uncompressed_latin1_text[0].text, crate::output::SOFTWARE);
    assert!(bytes == self::bytes(AnimationFormat::Apng));
}

/// Decodes GIF frames to three bytes per pixel.
fn decoded(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut options = ::gif::DecodeOptions::new();
    options.set_color_output(::gif::ColorOutput::Indexed);
    let mut decoder = options.read_info(bytes).expect("GIF");
    assert_eq!(decoder.repeat(), ::gif::Repeat::Infinite);
    let palette = decoder.global_palette().expect("a global palette").to_vec();
    let mut frames = Vec::new();
    while let Some(frame) = decoder.read_next_frame().expect("a frame") {
        assert!(frame.palette.is_none() && frame.delay == 50);
        let color = |index: &u8| &palette[3 * usize::from(*index)..][..3];
        frames.push(frame.buffer.iter().flat_map(color).copied().collect());
    }
    frames
}

/// Averages over 4 × 4 pixels must be close to the frame. They must be much closer than without dithering,
/// where gradients show banding.
#[test]
fn gif_dithering_preserves_gradients_on_average() {
    // Use shallow gradients in many colors, so that the palette colors are far apart.
    let smooth = |number: u32| {
        let pixel = |i: u32| {
            let (x, y, k) = (i % 96, i / 96, number % 8);
            [(25 * k + x / 4) as u8, (220 - 22 * k + y / 2) as u8, (90 + 60 * (k % 3) + (x + y) / 6) as u8]
        };
        Srgb8Image { width: 96, height: 40, pixels: (0..96 * 40).map(pixel).collect() }
    };
    let frames: Vec<Srgb8Image> = (0..8).map(smooth).collect();
    let bytes = encode(&frames, &[], AnimationFormat::Gif, &CancelToken::new()).expect("encoded");
    let shown = decoded(&bytes);
    assert_eq!(shown.len(), frames.len());
    let palette = ::gif::DecodeOptions::new().read_info(bytes.as_slice()).expect("GIF");
    let palette = palette.global_palette().expect("a palette").as_chunks::<3>().0.to_vec();
    let nearest = |pixel: &[u8; 3]| {
        let distance = |color: &&[u8; 3]| {
            (0..3).map(|i| (i32::from(color[i]) - i32::from(pixel[i])).pow(2)).sum::<i32>()
        };
        *palette.iter().min_by_key(distance).expect("colors")
    };
    let block = |pixels: &[u8], x: usize, y: usize| {
        let at = |i: usize| 3 * ((4 * y + i / 4) * 96 + 4 * x + i % 4);
        [0, 1, 2].map(|channel| (0..16).map(|i| f64::from(pixels[at(i) + channel])).sum::<f64>() / 16.0)
    };
    // Mean distance between block means, in 8-bit levels.
    let off = |frame: &Srgb8Image, shown: &[u8]| {
        let blocks = (0..10).flat_map(|y| (0..24).map(move |x| (x, y)));
        let each = blocks.map(|(x, y)| {
            let (wanted, found) = (block(frame.pixels.as_flattened(), x, y), block(shown, x, y));
            (0..3).map(|channel| (wanted[channel] - found[channel]).abs()).fold(0.0, f64::max)
        });
        each.sum::<f64>() / 240.0
    };
    let banded = |frame: &Srgb8Image| frame.pixels.iter().flat_map(nearest).collect::<Vec<u8>>();
    let dithered: f64 = frames.iter().zip(&shown).map(|(frame, shown)| off(frame, shown)).sum();
    let plain: f64 = frames.iter().map(|frame| off(frame, &banded(frame))).sum();
    assert!(
        dithered < 0.7 * plain && dithered / 8.0 < 2.0,
        "dithered error {}, plain error {}",
        dithered / 8.0,
        plain / 8.0
    );
}

#[test]
fn static_gif_pixels_are_equal_in_all_frames() {
    let frames = frames();
    let shown = decoded(&bytes(AnimationFormat::Gif));
    for (frame, image) in frames.iter().zip(&shown).skip(1) {
        for (i, pixel) in frame.pixels.iter().enumerate() {
            if *pixel == frames[0].pixels[i] {
                assert_eq!(image[3 * i..3 * i + 3], shown[0][3 * i..3 * i + 3]);
            }
        }
    }
}

#[test]
fn images_with_few_colors_are_lossless() {
    let pixels = (0..64).map(|i| [[1, 2, 3], [250, 128, 7], [77, 77, 78]][i % 3]).collect();
    let frame = Srgb8Image { width: 8, height: 8, pixels };
    let frames = vec![frame; 8];
    let bytes = encode(&frames, &[], AnimationFormat::Gif, &CancelToken::new()).expect("encoded");
    assert!(decoded(&bytes).iter().all(|shown| shown == frames[0].pixels.as_flattened()));
}

#[test]
fn invalid_frames_and_cancellation_are_errors() {
    let token = CancelToken::new();
    let wide = Srgb8Image { width: 70_000, height: 1, pixels: vec![[0; 3]; 70_000] };
    let error = encode(&[wide], &[], AnimationFormat::Gif, &token).expect_err("too wide");
    assert!(matches!(error, OutputError::Animation { format: AnimationFormat::Gif, .. }), "{error}");
    assert!(encode(&[], &[], AnimationFormat::Gif, &token).is_err());
    let odd = Srgb8Image { width: 2, height: 1, pixels: vec![[0; 3]; 2] };
    assert!(encode(&[frame(0), odd], &[], AnimationFormat::Apng, &token).is_err());
    token.cancel();
    for format in [AnimationFormat::Gif, AnimationFormat::Apng] {
        assert!(matches!(encode(&frames(), &[], format, &token), Err(OutputError::Canceled(_))));
    }
}

#[test]
fn extensions_select_the_animation_format() {
    assert_eq!(AnimationFormat::from_path(Path::new("a.GIF")), Some(AnimationFormat::Gif));
    assert_eq!(AnimationFormat::from_path(Path::new("a.apng")), Some(AnimationFormat::Apng));
    assert_eq!(
        (AnimationFormat::from_path(Path::new("a.png")), AnimationFormat::from_path(Path::new("gif"))),
        (None, None)
    );
}
