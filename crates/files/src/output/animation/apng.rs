//! APNG: animated PNG.

use ::png::{BlendOp, ColorType, DisposeOp, Encoder, EncodingError, SrgbRenderingIntent};

use super::super::SOFTWARE;
use super::super::png::add_text;
use super::turn_frame_duration_in_ticks;
use crate::control::CancelToken;
use crate::film::Srgb8Image;

pub(super) fn encode(
    frames: &[Srgb8Image],
    metadata: &[(String, String)],
    token: &CancelToken,
) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let (width, height) = frames.first().map_or((0, 0), |first| (first.width, first.height));
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(::png::BitDepth::Eight);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    // 0 means that the animation repeats forever.
    encoder.set_animated(frames.len() as u32, 0)?;
    encoder.set_frame_delay(turn_frame_duration_in_ticks(frames.len(), 1000.0).round() as u16, 1000)?;
    encoder.set_blend_op(BlendOp::Source)?;
    encoder.set_dispose_op(DisposeOp::None)?;
    add_text(&mut encoder, "Software", SOFTWARE)?;
    for (name, value) in metadata {
        add_text(&mut encoder, name, value)?;
    }
    let mut writer = encoder.write_header()?;
    for frame in frames {
        token.check_pause_and_cancel().map_err(std::io::Error::other)?;
        writer.write_image_data(frame.pixels.as_flattened())?;
    }
    writer.finish()?;
    Ok(bytes)
}
