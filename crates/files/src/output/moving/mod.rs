//! Moving pictures: GIF and APNG, from frames of 8 bits a channel.

mod apng;
mod dither;
mod gif;

use std::fmt;
use std::path::Path;

use super::OutputError;
use crate::control::CancelToken;
use crate::film::Picture;

/// Seconds of a whole turn.
const TURN_SECONDS: f64 = 4.0;
/// Shortest time of a frame in seconds: players show shorter ones for a tenth of a second.
const SHORTEST_FRAME: f64 = 0.02;

/// A file format of moving pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MovingFormat {
    /// 256 colours, the same for all frames.
    Gif,
    /// 8 bit sRGB, without loss.
    Apng,
}

impl MovingFormat {
    const ENDINGS: [(&'static str, Self); 2] = [("gif", Self::Gif), ("apng", Self::Apng)];

    /// The format of a path's ending, in small letters or capitals. `None` if it is not one of moving pictures.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?;
        let known = Self::ENDINGS.iter().find(|(known, _)| ending.eq_ignore_ascii_case(known));
        known.map(|&(_, format)| format)
    }

    /// Checks that a file of this format can hold frames of this size.
    ///
    /// # Errors
    /// [`OutputError::Moving`] with the reason.
    pub fn check_size(self, width: u32, height: u32) -> Result<(), OutputError> {
        const MOST: u32 = u16::MAX as u32;
        match self {
            Self::Gif if width > MOST || height > MOST => Err(OutputError::Moving {
                format: self,
                why: format!("cannot hold {width}×{height} pixels, at most {MOST}×{MOST}; use .apng"),
            }),
            Self::Gif | Self::Apng => Ok(()),
        }
    }
}

impl fmt::Display for MovingFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gif => "GIF",
            Self::Apng => "APNG",
        })
    }
}

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
