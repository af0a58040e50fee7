//! EXR files as they occur: grey, layers, parts, tiles, any numbers.

use std::io::Cursor;

use ::exr::prelude::*;

use super::*;

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

fn one(channels: Vec<(&str, FlatSamples)>) -> Vec<u8> {
    encoded(vec![layer("main", Encoding::FAST_LOSSLESS, channels)])
}

#[track_caller]
fn texels(file: &[u8]) -> Vec<Vec3> {
    match load_bytes("a.exr", file, ImageEncoding::Color).expect("an EXR").data {
        TexelData::Float(texels) => texels,
        other => panic!("{other:?}"),
    }
}

fn grey(values: [f32; 4]) -> Vec<Vec3> {
    values.map(Vec3::splat).to_vec()
}

const RAMP: [f32; 4] = [0.25, 0.5, 4.0, 0.0];
const OTHER: [f32; 4] = [9.0, 8.0, 7.0, 6.0];

#[test]
fn grey_is_read_with_and_without_alpha() {
    assert_eq!(texels(&one(vec![("Y", floats(RAMP))])), grey(RAMP));
    assert_eq!(texels(&one(vec![("Y", halves(RAMP)), ("A", halves(OTHER))])), grey(RAMP));
    assert_eq!(texels(&one(vec![("Y", FlatSamples::U32(vec![0, 1, 2, 3]))])), grey([0.0, 1.0, 2.0, 3.0]));
    // A single channel by whatever name.
    assert_eq!(texels(&one(vec![("height", floats(RAMP))])), grey(RAMP));
}

#[test]
fn channels_of_different_kinds_make_a_colour() {
    let file = one(vec![
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
fn the_first_layer_with_colours_counts() {
    let file = one(vec![
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
    // Channels without a layer's name come before those with one.
    let file = one(vec![
        ("a.R", floats(OTHER)),
        ("a.G", floats(OTHER)),
        ("a.B", floats(OTHER)),
        ("Y", floats(RAMP)),
    ]);
    assert_eq!(texels(&file), grey(RAMP));
}

#[test]
fn the_first_part_with_colours_counts() {
    let depth = || layer("depth", Encoding::UNCOMPRESSED, vec![("Z", floats(OTHER))]);
    let luminance = layer("grey", Encoding::SMALL_LOSSLESS, vec![("Y", floats(OTHER))]);
    let content = vec![("R", floats(RAMP)), ("G", floats(RAMP)), ("B", floats(RAMP))];
    let color = layer("colour", Encoding::FAST_LOSSLESS, content);
    assert_eq!(texels(&encoded(vec![depth(), luminance, color])), grey(RAMP));
    assert_eq!(texels(&encoded(vec![depth()])), grey(OTHER));
}

#[test]
fn tiles_and_compressions_hold_the_same() {
    for compression in
        [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ]
    {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(1, 2))] {
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            let file = encoded(vec![layer("main", encoding, vec![("Y", floats(RAMP))])]);
            assert_eq!(texels(&file), grey(RAMP), "{compression:?} {blocks:?}");
        }
    }
}

#[test]
fn the_display_window_is_the_picture() {
    let attributes = LayerAttributes { layer_position: Vec2(4, 7), ..LayerAttributes::named("main") };
    let layer = Layer::new(SIZE, attributes, Encoding::UNCOMPRESSED, channels(vec![("Y", floats(RAMP))]));
    let bounds = IntegerBounds::new(Vec2(5, 6), Vec2(2, 3));
    let image = Image { attributes: ImageAttributes::new(bounds), layer_data: layer };
    let mut file = Cursor::new(Vec::new());
    image.write().to_buffered(&mut file).expect("written");
    let texels = load_bytes("a.exr", file.get_ref(), ImageEncoding::Color).expect("an EXR");
    assert_eq!((texels.width, texels.height), (2, 3));
    let expected: Vec<_> = [0.0, 0.0, RAMP[1], 0.0, RAMP[3], 0.0].map(Vec3::splat).to_vec();
    assert_eq!(texels.data, TexelData::Float(expected));
}

#[test]
fn what_cannot_be_read_is_said() {
    let said = says("a.exr", &one(vec![("U", floats(RAMP)), ("V", floats(RAMP))]));
    assert!(said.ends_with("its channels are U, V; wanted are R, G and B, or Y for grey"), "{said}");
    let chroma = says("a.exr", &one(vec![("Y", floats(RAMP)), ("RY", floats(RAMP)), ("BY", floats(RAMP))]));
    assert!(chroma.contains("its channels are BY, RY, Y; wanted are R, G and B"), "{chroma}");
    let whole = one(vec![("Y", floats(RAMP))]);
    for length in 0..whole.len() {
        let _ = load_bytes("a.exr", &whole[..length], ImageEncoding::Color);
    }
    assert!(says("a.exr", &whole[..whole.len() - 3]).contains("a.exr: "));
    // The header claims that the channel is sampled at every second pixel only.
    let mut sampled = whole;
    let at = sampled.windows(8).position(|sampling| sampling == [1, 0, 0, 0, 1, 0, 0, 0]).expect("a channel");
    sampled[at] = 2;
    let said = says("a.exr", &sampled);
    assert!(said.contains("subsampling"), "{said}");
}
