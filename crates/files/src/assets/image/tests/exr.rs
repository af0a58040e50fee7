//! Tests for EXR files: gray, layers, parts, tiles, sample types.

use std::io::Cursor;

use ::exr::meta::attribute::Chromaticities;
use ::exr::prelude::*;

use super::*;
use crate::assets::image::exr::channels::no_usable_channels_message;
use crate::assets::image::exr::{
    DEGENERATE_CHROMATICITIES, subsampled_channel_message as subsampled_channel,
};

const SIZE: Vec2<usize> = Vec2(2, 2);

fn floats(values: [f32; 4]) -> FlatSamples {
    FlatSamples::F32(values.to_vec())
}

fn halves(values: [f32; 4]) -> FlatSamples {
    FlatSamples::F16(values.map(f16::from_f32).to_vec())
}

fn channels(channels: Vec<(&str, FlatSamples)>) -> AnyChannels<FlatSamples> {
    AnyChannels::sort(channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect())
}

fn layer(
    name: &str,
    encoding: Encoding,
    content: Vec<(&str, FlatSamples)>,
) -> Layer<AnyChannels<FlatSamples>> {
    Layer::new(SIZE, LayerAttributes::named(name), encoding, channels(content))
}

fn encoded(layers: Vec<Layer<AnyChannels<FlatSamples>>>) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions(SIZE));
    let image = Image { attributes, layer_data: layers.into_iter().collect::<Layers<_>>() };
    image.write().to_buffered(&mut file).expect("written");
    file.into_inner()
}

fn single_layer(channels: Vec<(&str, FlatSamples)>) -> Vec<u8> {
    encoded(vec![layer("main", Encoding::FAST_LOSSLESS, channels)])
}

#[track_caller]
fn texels(file: &[u8]) -> Vec<Vec3> {
    match load_bytes("a.exr", file, ColorEncoding::Color).expect("an EXR").data {
        TexelData::Float(texels) => texels,
        other => panic!("{other:?}"),
    }
}

fn gray(values: [f32; 4]) -> Vec<Vec3> {
    values.map(Vec3::splat).to_vec()
}

const RAMP: [f32; 4] = [0.25, 0.5, 4.0, 0.0];
const OTHER: [f32; 4] = [9.0, 8.0, 7.0, 6.0];

#[test]
fn gray_is_read_with_and_without_alpha() {
    assert_eq!(texels(&single_layer(vec![("Y", floats(RAMP))])), gray(RAMP));
    assert_eq!(texels(&single_layer(vec![("Y", halves(RAMP)), ("A", halves(OTHER))])), gray(RAMP));
    assert_eq!(
        texels(&single_layer(vec![("Y", FlatSamples::U32(vec![0, 1, 2, 3]))])),
        gray([0.0, 1.0, 2.0, 3.0])
    );
    // A single channel may have any name.
    assert_eq!(texels(&single_layer(vec![("height", floats(RAMP))])), gray(RAMP));
}

#[test]
fn channels_may_have_different_sample_types() {
    let file = single_layer(vec![
        ("R", halves(RAMP)),
        ("G", floats([1.0; 4])),
        ("B", FlatSamples::U32(vec![3; 4])),
        ("A", floats(OTHER)),
        ("Z", floats(OTHER)),
        ("Y", floats(OTHER)),
    ]);
    let expected: Vec<_> = RAMP.iter().map(|&red| Vec3::new(red, 1.0, 3.0)).collect();
    assert_eq!(texels(&file), expected);
}

#[test]
fn the_first_layer_with_colors_is_used() {
    let file = single_layer(vec![
        ("deep.Z", floats(OTHER)),
        ("light.B", floats([3.0; 4])),
        ("light.G", floats([2.0; 4])),
        ("light.R", floats(RAMP)),
        ("shade.B", floats(OTHER)),
        ("shade.G", floats(OTHER)),
        ("shade.R", floats(OTHER)),
    ]);
    let expected: Vec<_> = RAMP.iter().map(|&red| Vec3::new(red, 2.0, 3.0)).collect();
    assert_eq!(texels(&file), expected);
    // Channels without a layer name take precedence.
    let file = single_layer(vec![
        ("a.R", floats(OTHER)),
        ("a.G", floats(OTHER)),
        ("a.B", floats(OTHER)),
        ("Y", floats(RAMP)),
    ]);
    assert_eq!(texels(&file), gray(RAMP));
}

#[test]
fn the_first_part_with_colors_is_used() {
    let depth = || layer("depth", Encoding::UNCOMPRESSED, vec![("Z", floats(OTHER))]);
    let luminance = layer("gray", Encoding::SMALL_LOSSLESS, vec![("Y", floats(OTHER))]);
    let content = vec![("R", floats(RAMP)), ("G", floats(RAMP)), ("B", floats(RAMP))];
    let color = layer("color", Encoding::FAST_LOSSLESS, content);
    assert_eq!(texels(&encoded(vec![depth(), luminance, color])), gray(RAMP));
    assert_eq!(texels(&encoded(vec![depth()])), gray(OTHER));
}

#[test]
fn texels_do_not_depend_on_tiling_or_compression() {
    for compression in
        [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ]
    {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(1, 2))] {
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            let file = encoded(vec![layer("main", encoding, vec![("Y", floats(RAMP))])]);
            assert_eq!(texels(&file), gray(RAMP), "{compression:?} {blocks:?}");
        }
    }
}

#[test]
fn the_display_window_defines_the_image() {
    let attributes = LayerAttributes { layer_position: Vec2(4, 7), ..LayerAttributes::named("main") };
    let layer = Layer::new(SIZE, attributes, Encoding::UNCOMPRESSED, channels(vec![("Y", floats(RAMP))]));
    let bounds = IntegerBounds::new(Vec2(5, 6), Vec2(2, 3));
    let image = Image { attributes: ImageAttributes::new(bounds), layer_data: layer };
    let mut file = Cursor::new(Vec::new());
    image.write().to_buffered(&mut file).expect("written");
    let texels = load_bytes("a.exr", file.get_ref(), ColorEncoding::Color).expect("an EXR");
    assert_eq!((texels.width, texels.height), (2, 3));
    let expected: Vec<_> = [0.0, 0.0, RAMP[1], 0.0, RAMP[3], 0.0].map(Vec3::splat).to_vec();
    assert_eq!(texels.data, TexelData::Float(expected));
}

#[test]
fn unusable_channels_are_rejected() {
    let rejected = |names: &[&str]| {
        let channels = names.iter().map(|name| (*name, floats(RAMP))).collect();
        error("a.exr", &single_layer(channels))
    };
    for (names, shown) in [
        (&["U", "V"][..], "U, V"),
        (&["Y", "RY"], "RY, Y"),
        (&["X", "Y", "Z"], "X, Y, Z"),
        (&["N.X", "N.Y", "N.Z"], "N.X, N.Y, N.Z"),
        (&["Y", "X", "depth"], "X, Y, depth"),
    ] {
        let reason = rejected(names);
        assert!(reason.ends_with(&no_usable_channels_message(shown)), "{reason}");
    }
    let whole = single_layer(vec![("Y", floats(RAMP))]);
    for length in 0..whole.len() {
        let _ = load_bytes("a.exr", &whole[..length], ColorEncoding::Color);
    }
    assert!(load_bytes("a.exr", &whole[..whole.len() - 3], ColorEncoding::Color).is_err());
    // Patch the header to sample the channel at every other pixel.
    let mut sampled = whole;
    let at = sampled.windows(8).position(|sampling| sampling == [1, 0, 0, 0, 1, 0, 0, 0]).expect("a channel");
    sampled[at] = 2;
    assert!(error("a.exr", &sampled).ends_with(&subsampled_channel("Y")));
}

fn parts(channels: &[(&str, [f32; 4])]) -> Vec<u8> {
    let part = |(name, values): &(&str, [f32; 4])| {
        layer(&format!("part {name}"), Encoding::FAST_LOSSLESS, vec![(*name, floats(*values))])
    };
    encoded(channels.iter().map(part).collect())
}

#[test]
fn colors_may_be_split_across_parts() {
    let expected: Vec<_> = RAMP.iter().map(|&red| Vec3::new(red, 9.0, 1.0)).collect();
    let (nines, ones) = ([9.0; 4], [1.0; 4]);
    assert_eq!(texels(&parts(&[("R", RAMP), ("G", nines), ("B", ones)])), expected);
    assert_eq!(
        texels(&parts(&[("Z", OTHER), ("B", ones), ("A", OTHER), ("G", nines), ("R", RAMP)])),
        expected
    );
    assert_eq!(texels(&parts(&[("l.R", RAMP), ("l.G", nines), ("l.B", ones), ("l.A", ones)])), expected);
    assert_eq!(texels(&parts(&[("Y", RAMP), ("Z", OTHER)])), gray(RAMP));
    for vector in [&["X", "Y", "Z"][..], &["R", "G"], &["u.Y", "u.X"]] {
        let channels: Vec<_> = vector.iter().map(|name| (*name, RAMP)).collect();
        let reason = error("a.exr", &parts(&channels));
        assert!(reason.ends_with(&no_usable_channels_message(&vector.join(", "))), "{reason}");
    }
}

#[test]
fn chromaticities_are_converted() {
    let file = |attribute: Option<Chromaticities>| {
        let mut file = Cursor::new(Vec::new());
        let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions(SIZE));
        attributes.chromaticities = attribute;
        let content = vec![("R", floats([1.0; 4])), ("G", floats([0.5; 4])), ("B", floats([0.25; 4]))];
        let image = Image { attributes, layer_data: layer("main", Encoding::UNCOMPRESSED, content) };
        image.write().to_buffered(&mut file).expect("written");
        file.into_inner()
    };
    let rec_2020 = Chromaticities {
        red: Vec2(0.708, 0.292),
        green: Vec2(0.17, 0.797),
        blue: Vec2(0.131, 0.046),
        white: Vec2(0.3127, 0.329),
    };
    let plain = Vec3::new(1.0, 0.5, 0.25);
    assert_eq!(texels(&file(None))[0], plain);
    let converted = texels(&file(Some(rec_2020)))[0];
    assert!((converted - Vec3::new(1.3484, 0.4397, 0.2114)).length() < 1e-3, "{converted}");
    let linear = load_bytes("a.exr", &file(Some(rec_2020)), ColorEncoding::Linear).expect("an EXR");
    assert_eq!(linear.get(0, 0), plain);
    // Files written by glimt declare Rec. 709.
    let rec_709 = Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.329),
    };
    assert_eq!(texels(&file(Some(rec_709)))[0], plain);
    let broken = file(Some(Chromaticities { green: rec_709.red, ..rec_709 }));
    assert_eq!(texels(&broken)[0], plain);
    assert_eq!(
        warnings_of("a.exr", &broken, ColorEncoding::Color),
        [format!("a.exr: {DEGENERATE_CHROMATICITIES}")]
    );
}

/// An uncompressed scan-line file of 4 × 2 pixels, with chroma sampled at every other column and row.
fn subsampled(window: [i32; 4]) -> Vec<u8> {
    let text = |words: &str| [words.as_bytes(), &[0]].concat();
    let ints = |values: &[i32]| -> Vec<u8> { values.iter().flat_map(|value| value.to_le_bytes()).collect() };
    let attribute = |name: &str, kind: &str, data: Vec<u8>| {
        [text(name), text(kind), ints(&[data.len() as i32]), data].concat()
    };
    let channel = |name: &str, step: i32| [text(name), ints(&[2]), vec![0; 4], ints(&[step, step])].concat();
    let channels = [channel("BY", 2), channel("RY", 2), channel("Y", 1), vec![0]].concat();
    let header = [
        vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0],
        attribute("channels", "chlist", channels),
        attribute("compression", "compression", vec![0]),
        attribute("dataWindow", "box2i", ints(&[0, 0, 3, 1])),
        attribute("displayWindow", "box2i", ints(&window)),
        attribute("lineOrder", "lineOrder", vec![0]),
        attribute("pixelAspectRatio", "float", 1.0_f32.to_le_bytes().to_vec()),
        attribute("screenWindowCenter", "v2f", vec![0; 8]),
        attribute("screenWindowWidth", "float", 1.0_f32.to_le_bytes().to_vec()),
        vec![0],
    ]
    .concat();
    let floats =
        |values: &[f32]| -> Vec<u8> { values.iter().flat_map(|value| value.to_le_bytes()).collect() };
    // The first row has BY, RY and Y. The second has only Y.
    let rows = [floats(&[0.0, 1.0, 0.0, 0.5, 1.0, 1.0, 1.0, 1.0]), floats(&[2.0; 4])];
    let start = header.len() + 16;
    let offsets = [start, start + 8 + rows[0].len()].map(|offset| (offset as u64).to_le_bytes()).concat();
    let [first, second] = &rows;
    let chunks =
        [ints(&[0, first.len() as i32]), first.clone(), ints(&[1, second.len() as i32]), second.clone()];
    [header, offsets, chunks.concat()].concat()
}

#[test]
fn luminance_and_chroma_are_converted_to_rgb() {
    let found = texels(&subsampled([0, 0, 3, 1]));
    let color = |y: f32, ry: f32, by: f32| {
        let (red, blue) = ((ry + 1.0) * y, (by + 1.0) * y);
        Vec3::new(red, (y - red * 0.21264 - blue * 0.07219) / 0.71517, blue)
    };
    // The filter overshoots at the edge, as in `RgbaInputFile`.
    let chroma = [(0.0, 0.0), (0.25, 0.5), (0.5, 1.0), (0.563_562, 1.127_124)];
    let row = |y: f32| chroma.map(|(ry, by)| color(y, ry, by));
    let expected = [row(1.0), row(2.0)].concat();
    for (found, expected) in found.iter().zip(&expected) {
        assert!((*found - *expected).length() < 1e-4, "{found} {expected}");
    }
    assert_eq!(found[0], Vec3::ONE);
    // A display window that starts between two chroma samples and extends past the data window.
    let moved = texels(&subsampled([1, -1, 4, 0]));
    assert_eq!((moved[..4].to_vec(), moved[7]), (vec![Vec3::ZERO; 4], Vec3::ZERO));
    assert!((moved[4] - expected[1]).length() < 1e-4);
    let full =
        single_layer(vec![("Y", floats([1.0; 4])), ("RY", floats([0.5; 4])), ("BY", floats([1.0; 4]))]);
    assert!((texels(&full)[3] - color(1.0, 0.5, 1.0)).length() < 1e-4);
    let whole = subsampled([0, 0, 3, 1]);
    for length in 0..whole.len() {
        let _ = load_bytes("a.exr", &whole[..length], ColorEncoding::Color);
    }
}

#[test]
fn premultiplied_colors_of_cutouts_are_unmultiplied() {
    let channel = |value: f32| floats([value; 4]);
    let file = single_layer(vec![
        ("R", channel(0.5)),
        ("G", channel(0.25)),
        ("B", channel(0.0)),
        ("A", channel(0.5)),
    ]);
    let cut_out =
        load_bytes("a.exr", &file, ColorEncoding::CutOut(ColorTransferFunction::Linear)).expect("an EXR");
    assert!((cut_out.get(1, 1) - Vec3::new(1.0, 0.5, 0.0)).length() < 1e-3, "{}", cut_out.get(1, 1));
}
