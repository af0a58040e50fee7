//! Pictures to bytes, bytes to files.
//!
//! [`check_target`] before hours of work, [`encode`] into memory, [`write::atomic`] to disk: a file is whole, or it is
//! the old one. [`FileIdentity`] decides whether two paths lead to one file.

mod attributes;
mod error;
mod exr;
mod finish;
#[cfg(target_os = "linux")]
mod flags;
mod format;
mod hdr;
pub mod held;
mod identity;
mod jpeg;
pub mod json;
mod move_new;
pub mod moving;
mod origin;
pub mod part;
mod place;
mod png;
mod ppm;
mod protection;
pub mod scene_path;
pub mod settings;
pub mod staged;
mod stoppable;
mod temporary;
mod webp;
pub mod write;

use std::path::Path;

pub use attributes::Losses;
pub use error::OutputError;
pub use exr::mean_luminance_error;
pub use finish::Finish;
pub use format::{BitDepth, Format, MovingFormat};
pub use identity::{FileIdentity, Likeness, is_one_file};
pub use origin::{
    Replaced, replaced_json, replaced_picture, replaced_plot, replaced_table, scene_of_picture, signed,
};

use crate::control::CancelToken;
use crate::film::RadianceImage;
use crate::film::tone::ToneMapping;

/// Name and version of the program, as written into files.
const SOFTWARE: &str = concat!("glimt ", env!("CARGO_PKG_VERSION"));
/// Name of the program, the first word of that.
const PROGRAM: &str = "glimt";

/// Numbers about the pixels of a picture, in channels of their own.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerImage {
    /// Name of the layer.
    pub name: &'static str,
    /// Names of its channels, at most three: as many components of the pixels are written.
    pub channels: &'static [&'static str],
    /// The numbers, as many as the picture has pixels.
    pub image: RadianceImage,
}

/// Settings for encoding a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EncodeOptions {
    /// Tone mapping for files of 8 and 16 bits; float files get linear radiance, unexposed.
    pub tone: ToneMapping,
    /// Bit depth of PNG and PPM; float files always have 32 bits.
    pub bit_depth: BitDepth,
    /// Names and values (the scene, the settings), written into PNG text chunks and the comments of EXR, HDR and
    /// PPM files. The program and its version are always written.
    pub metadata: Vec<(String, String)>,
    /// Standard error of the picture's mean luminance, an attribute of EXR files. `None` if it is not known.
    pub mean_luminance_error: Option<f64>,
}

/// The bytes of a file of this format. The same picture and options give the same bytes.
///
/// # Errors
/// A format that cannot hold a picture of this size or depth; an encoder that fails; [`OutputError::Cancelled`].
pub fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    format: Format,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    encode_with((image, &[]), options, format, token)
}

/// [`encode`] with layers, which only EXR files hold.
pub(crate) fn encode_with(
    (image, layers): (&RadianceImage, &[LayerImage]),
    options: &EncodeOptions,
    format: Format,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    format.check_picture(image.width, image.height, options.bit_depth)?;
    let is_whole = |image: &RadianceImage| image.pixels.len() == image.width as usize * image.height as usize;
    let fits = |layer: &LayerImage| {
        (layer.image.width, layer.image.height) == (image.width, image.height) && is_whole(&layer.image)
    };
    if !is_whole(image) || !layers.iter().all(fits) {
        return Err(OutputError::encoder(format, &"the picture's size and its pixels do not agree"));
    }
    let bytes = match format {
        Format::Png => png::encode(image, options, token),
        Format::Exr => exr::encode((image, layers), options, token),
        Format::Hdr => hdr::encode(image, options, token),
        Format::Jpeg => jpeg::encode(image, options, token),
        Format::Ppm => ppm::encode(image, options, token),
        Format::WebP => webp::encode(image, options, token),
    };
    // An encoder that was stopped reports an error of its writer.
    token.check()?;
    bytes
}

/// Checks that a picture can be written to this path, as far as this is possible before the work. Leaves nothing behind.
/// Returns the format of the ending.
///
/// # Errors
/// No format has the ending; the directory is missing or takes no files; the target is a directory or may not be written.
pub fn check_target(path: &Path) -> Result<Format, OutputError> {
    let format = Format::of(path)?;
    place::check(path)?;
    Ok(format)
}

/// [`check_target`] without a trial in the directory, for frequent checks.
///
/// # Errors
/// As [`check_target`], but not for a directory that takes no files although it may be written.
pub fn look_at_target(path: &Path) -> Result<Format, OutputError> {
    let format = Format::of(path)?;
    look_at_place(path)?;
    Ok(format)
}

/// [`look_at_target`] for any file.
///
/// # Errors
/// As [`look_at_target`], but not for the ending.
pub fn look_at_place(path: &Path) -> Result<(), OutputError> {
    place::find(path).map(drop)
}

/// Checks that any file can be written to this path, as far as this is possible before the work.
///
/// # Errors
/// As [`check_target`], but not for the ending.
pub fn check_place(path: &Path) -> Result<(), OutputError> {
    place::check(path)
}

/// A component as a finite number, for files without infinity.
fn as_finite(component: f32) -> f32 {
    if component.is_nan() { 0.0 } else { component.clamp(-f32::MAX, f32::MAX) }
}

/// A name or value as a line of a text header can hold it.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests;
