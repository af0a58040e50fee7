//! PNG encoding for the kitty and iTerm2 protocols.

use crate::film::Srgb8Image;

/// Encodes an image as PNG with fast compression. Returns an empty vector on failure.
pub(super) fn encode_png(picture: &Srgb8Image) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, picture.width, picture.height);
    encoder.set_color(::png::ColorType::Rgb);
    encoder.set_depth(::png::BitDepth::Eight);
    encoder.set_compression(::png::Compression::Fast);
    let outcome = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(picture.pixels.as_flattened()).and_then(|()| writer.finish())
    });
    if outcome.is_err() {
        bytes.clear();
    }
    bytes
}
