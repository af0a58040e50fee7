//! Encodes 8-bit frames as GIF or APNG animations.

mod apng;
mod dither;
mod gif;

use super::{AnimationFormat, OutputError};
use crate::control::CancelToken;
use crate::film::Srgb8Image;

/// Duration of an animation (a full turn of the camera) in seconds.
const TURN_SECONDS: f64 = 4.0;
/// Minimum duration of a frame in seconds. Players show shorter frames for a tenth of a second.
const MIN_FRAME_SECONDS: f64 = 0.02;

/// Encodes frames of the same size as an animation that loops forever. Encoding is deterministic.
///
/// # Errors
/// The format does not support the frames, the encoder fails, or the work is canceled
/// ([`OutputError::Canceled`]).
pub fn encode(
    frames: &[Srgb8Image],
    metadata: &[(String, String)],
    format: AnimationFormat,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let failed = |why: String| OutputError::Animation { format, why };
    let Some(first) = frames.first() else { return Err(failed("has no frames".to_owned())) };
    format.check_size(first.width, first.height)?;
    let fits = |frame: &Srgb8Image| {
        (frame.width, frame.height) == (first.width, first.height)
            && frame.pixels.len() == first.width as usize * first.height as usize
    };
    if !frames.iter().all(fits) {
        return Err(failed("has frames of different sizes".to_owned()));
    }
    let bytes = match format {
        AnimationFormat::Gif => gif::encode(frames, metadata, token).map_err(|error| error.to_string()),
        AnimationFormat::Apng => apng::encode(frames, metadata, token).map_err(|error| error.to_string()),
    };
    // A canceled encoder reports its own error.
    token.check_pause_and_cancel()?;
    bytes.map_err(|why| failed(format!("could not be encoded: {why}")))
}

/// Returns the duration of a frame in units of 1/`per_second` seconds.
fn turn_frame_duration_in_ticks(frames: usize, per_second: f64) -> f64 {
    (TURN_SECONDS / frames as f64).max(MIN_FRAME_SECONDS) * per_second
}

#[cfg(test)]
mod tests;
