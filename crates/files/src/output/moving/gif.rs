//! GIF: one palette for all frames, so that a colour that stays looks the same in each.

use ::gif::{AnyExtension, Encoder, EncodingError, Extension, Frame, Repeat};
use color_quant::NeuQuant;
use rayon::prelude::*;

use super::super::{SOFTWARE, one_line};
use super::dither::Dither;
use super::frame_time;
use crate::control::CancelToken;
use crate::film::Picture;

/// Colours of the palette.
const COLORS: usize = 256;
/// Pixels that the palette is made of, about.
const SAMPLES: usize = 1 << 20;
/// Effort of the quantiser: 1 uses every sample.
const EVERY_SAMPLE: i32 = 1;

pub(super) fn encode(
    frames: &[Picture],
    metadata: &[(String, String)],
    token: &CancelToken,
) -> Result<Vec<u8>, EncodingError> {
    let cancelled = |cancelled| EncodingError::from(std::io::Error::other(cancelled));
    let (width, height) = frames.first().map_or((0, 0), |first| (first.width as u16, first.height as u16));
    // Choose the palette by pixels of all frames.
    let palette = palette(frames);
    token.check().map_err(cancelled)?;
    // Write the header: the palette, an endless loop, the settings as comments.
    let mut encoder = Encoder::new(Vec::new(), width, height, &palette)?;
    encoder.set_repeat(Repeat::Infinite)?;
    let comment = AnyExtension::from(Extension::Comment);
    encoder.write_raw_extension(comment, &[format!("Software: {SOFTWARE}").as_bytes()])?;
    for (name, value) in metadata {
        let line = format!("{}: {}", one_line(name), one_line(value));
        encoder.write_raw_extension(comment, &[line.as_bytes()])?;
    }
    // Write some frames at once, one for each thread.
    let delay = frame_time(frames.len(), 100.0).round() as u16;
    let dither = Dither::new(&palette);
    let compressed = |picture: &Picture| {
        let buffer = dither.indices(picture, token)?;
        let mut frame = Frame { delay, width, height, buffer: buffer.into(), ..Frame::default() };
        frame.make_lzw_pre_encoded();
        Ok(frame)
    };
    let is_in_pool = rayon::current_thread_index().is_some();
    let at_once = if is_in_pool { rayon::current_num_threads() } else { 1 };
    for some in frames.chunks(at_once) {
        let made: Result<Vec<_>, _> = match is_in_pool {
            true => some.par_iter().map(compressed).collect(),
            false => some.iter().map(compressed).collect(),
        };
        for frame in made.map_err(cancelled)? {
            encoder.write_lzw_pre_encoded_frame(&frame)?;
        }
    }
    encoder.into_inner()
}

/// The colours that stand for those of all frames, three bytes each.
fn palette(frames: &[Picture]) -> Vec<u8> {
    let pixels: usize = frames.iter().map(|frame| frame.pixels.len()).sum();
    // An odd step does not fall on the same columns again and again.
    let step = (pixels / SAMPLES) | 1;
    let all = frames.iter().flat_map(|frame| &frame.pixels);
    let samples: Vec<[u8; 4]> =
        all.step_by(step).map(|&[red, green, blue]| [red, green, blue, 255]).collect();
    // Few colours need no quantiser, which would move them a little.
    let mut colors: Vec<[u8; 4]> = frames.iter().flat_map(|frame| some_colors(&frame.pixels)).collect();
    colors.sort_unstable();
    colors.dedup();
    if colors.len() <= COLORS {
        return colors.iter().flat_map(|[red, green, blue, _]| [*red, *green, *blue]).collect();
    }
    NeuQuant::new(EVERY_SAMPLE, COLORS, samples.as_flattened()).color_map_rgb()
}

/// The different colours of a frame, but not more than need a quantiser.
fn some_colors(pixels: &[[u8; 3]]) -> Vec<[u8; 4]> {
    let mut colors = std::collections::BTreeSet::new();
    for &[red, green, blue] in pixels {
        colors.insert([red, green, blue, 255]);
        if colors.len() > COLORS {
            break;
        }
    }
    colors.into_iter().collect()
}
