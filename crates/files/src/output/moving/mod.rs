//! Moving pictures: GIF and APNG, from frames of 8 bits a channel.

mod apng;
mod dither;
mod gif;

use super::{MovingFormat, OutputError};
use crate::control::CancelToken;
use crate::film::Picture;

/// Seconds of a whole turn.
const TURN_SECONDS: f64 = 4.0;
/// Shortest time of a frame in seconds: players show shorter ones for a tenth of a second.
const SHORTEST_FRAME: f64 = 0.02;

/// The bytes of a file that plays these frames, all of one size, again and again. The same frames give the same bytes.
///
/// # Errors
/// Frames that the format cannot hold; an encoder that fails; [`OutputError::Cancelled`].
pub fn encode(
    frames: &[Picture],
    metadata: &[(String, String)],
    format: MovingFormat,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let failed = |why: String| OutputError::Moving { format, why };
    let Some(first) = frames.first() else { return Err(failed("has no frames".to_owned())) };
    format.check_size(first.width, first.height)?;
    let is_alike = |frame: &Picture| {
        (frame.width, frame.height) == (first.width, first.height)
            && frame.pixels.len() == first.width as usize * first.height as usize
    };
    if !frames.iter().all(is_alike) {
        return Err(failed("has frames of different sizes".to_owned()));
    }
    let bytes = match format {
        MovingFormat::Gif => gif::encode(frames, metadata, token).map_err(|error| error.to_string()),
        MovingFormat::Apng => apng::encode(frames, metadata, token).map_err(|error| error.to_string()),
    };
    // An encoder that was stopped reports an error of its own.
    token.check()?;
    bytes.map_err(|why| failed(format!("could not be encoded: {why}")))
}

/// Time of a frame in units of which a second has so many.
fn frame_time(frames: usize, per_second: f64) -> f64 {
    (TURN_SECONDS / frames as f64).max(SHORTEST_FRAME) * per_second
}

#[cfg(test)]
mod tests;
