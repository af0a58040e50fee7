//! GIF encoder. All frames share one palette, so static colors do not change between frames.

use ::gif::{AnyExtension, Encoder, EncodingError, Extension, Frame, Repeat};
use color_quant::NeuQuant;
use rayon::prelude::*;

use super::super::{SOFTWARE, one_line};
use super::dither::Dither;
use super::turn_frame_duration_in_ticks;
use crate::control::CancelToken;
use crate::film::Srgb8Image;

/// Size of the palette.
const COLORS: usize = 256;
/// Approximate number of pixels used to compute the palette.
const PALETTE_SAMPLES: usize = 1 << 20;
/// Quantizer setting: 1 uses every sample.
const EVERY_SAMPLE: i32 = 1;

pub(super) fn encode(
    frames: &[Srgb8Image],
    metadata: &[(String, String)],
    token: &CancelToken,
) -> Result<Vec<u8>, EncodingError> {
    let canceled = |canceled| EncodingError::from(std::io::Error::other(canceled));
    let (width, height) = frames.first().map_or((0, 0), |first| (first.width as u16, first.height as u16));
    // Choose the palette from pixels in all frames.
    let palette = choose_global_palette(frames);
    token.check_pause_and_cancel().map_err(canceled)?;
    // Write the header: the palette, an infinite loop, and the metadata as comments.
    let mut encoder = Encoder::new(Vec::new(), width, height, &palette)?;
    encoder.set_repeat(Repeat::Infinite)?;
    let comment = AnyExtension::from(Extension::Comment);
    encoder.write_raw_extension(comment, &[format!("Software: {SOFTWARE}").as_bytes()])?;
    for (name, value) in metadata {
        let line = format!("{}: {}", one_line(name), one_line(value));
        encoder.write_raw_extension(comment, &[line.as_bytes()])?;
    }
    // Compress several frames in parallel.
    let delay = turn_frame_duration_in_ticks(frames.len(), 100.0).round() as u16;
    let dither = Dither::new(&palette);
    let compress = |picture: &Srgb8Image| {
        let buffer = dither.palette_indices(picture, token)?;
        let mut frame = Frame { delay, width, height, buffer: buffer.into(), ..Frame::default() };
        frame.make_lzw_pre_encoded();
        Ok(frame)
    };
    let is_in_pool = rayon::current_thread_index().is_some();
    let batch_size = if is_in_pool { rayon::current_num_threads() } else { 1 };
    for batch in frames.chunks(batch_size) {
        let compressed: Result<Vec<_>, _> = match is_in_pool {
            true => batch.par_iter().map(compress).collect(),
            false => batch.iter().map(compress).collect(),
        };
        for frame in compressed.map_err(canceled)? {
            encoder.write_lzw_pre_encoded_frame(&frame)?;
        }
    }
    encoder.into_inner()
}

/// Chooses a palette for all frames, with three bytes per color.
fn choose_global_palette(frames: &[Srgb8Image]) -> Vec<u8> {
    let pixels: usize = frames.iter().map(|frame| frame.pixels.len()).sum();
    // An odd step avoids sampling the same columns in every row.
    let step = (pixels / PALETTE_SAMPLES) | 1;
    let all = frames.iter().flat_map(|frame| &frame.pixels);
    let samples: Vec<[u8; 4]> =
        all.step_by(step).map(|&[red, green, blue]| [red, green, blue, 255]).collect();
    // If there are few colors, use them all instead of quantizing.
    let mut colors: Vec<[u8; 4]> = frames.iter().flat_map(|frame| distinct_colors(&frame.pixels)).collect();
    colors.sort_unstable();
    colors.dedup();
    if colors.len() <= COLORS {
        return colors.iter().flat_map(|[red, green, blue, _]| [*red, *green, *blue]).collect();
    }
    NeuQuant::new(EVERY_SAMPLE, COLORS, samples.as_flattened()).color_map_rgb()
}

/// Returns a frame's distinct colors. Stops when there is one more than the palette can hold.
fn distinct_colors(pixels: &[[u8; 3]]) -> Vec<[u8; 4]> {
    let mut colors = std::collections::BTreeSet::new();
    for &[red, green, blue] in pixels {
        colors.insert([red, green, blue, 255]);
        if colors.len() > COLORS {
            break;
        }
    }
    colors.into_iter().collect()
}
