//! Encodes images and writes files.
//!
//! [`check_image_target`] is called before rendering. [`encode`] encodes in memory.
//! [`write::write_atomically`] writes to disk and leaves the file either complete or unchanged. Two paths
//! with the same [`FileIdentity`] refer to the same file.

pub mod animation;
mod attributes;
mod cancelable;
mod develop;
mod error;
mod exr;
#[cfg(target_os = "linux")]
mod flags;
mod format;
mod hdr;
pub mod held;
mod identity;
mod jpeg;
pub mod json;
mod move_new;
mod origin;
pub mod part;
mod png;
mod ppm;
mod protection;
mod resolve_path;
pub mod scene_path;
pub mod settings;
pub mod staged;
mod temporary;
mod webp;
pub mod write;

use std::path::Path;

pub use attributes::{AttributeLossPolicy, WriteWarning};
pub use develop::FilmEncodingSettings;
pub use error::OutputError;
pub use exr::read_mean_luminance_error;
pub use format::{AnimationFormat, BitDepth, Format};
pub use identity::{ApproximateFileIdentity, FileIdentity, may_be_same_file};
pub use origin::{
    ReplaceCheckResult, check_image_replacement, check_json_replacement, check_plot_replacement,
    check_table_replacement, scene_name_in_png, sign_plot,
};

use crate::control::CancelToken;
use crate::film::RadianceImage;
use crate::film::tone::ToneMapping;

/// Program name and version, written to files.
const SOFTWARE: &str = concat!("glimt ", env!("CARGO_PKG_VERSION"));
/// Program name.
const PROGRAM: &str = "glimt";

/// An additional layer (AOV) in an image file.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerImage {
    /// Name of the layer.
    pub name: &'static str,
    /// Channel names, at most three. One pixel component is written per name.
    pub channels: &'static [&'static str],
    /// Pixel values. Same size as the image.
    pub image: RadianceImage,
}

/// Settings for encoding an image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EncodeOptions {
    /// Tone mapping for 8-bit and 16-bit formats. Float formats store linear radiance without exposure.
    pub tone: ToneMapping,
    /// Bit depth of PNG and PPM. Float formats always use 32 bits.
    pub bit_depth: BitDepth,
    /// Metadata names and values, such as the scene and the settings. They are written to PNG text chunks,
    /// WebP XMP packets, or comments in EXR, HDR, JPEG and PPM files. The program version is always written.
    pub metadata: Vec<(String, String)>,
    /// Standard error of the mean luminance, written as an attribute in EXR files. `None` if unknown.
    pub mean_luminance_error: Option<f64>,
}

/// Encodes an image. The result is deterministic.
///
/// # Errors
/// The format does not support this size or bit depth, the encoder fails, or the work is canceled
/// ([`OutputError::Canceled`]).
pub fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    format: Format,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    encode_with_layers(image, &[], options, format, token)
}

/// Like [`encode`], but with layers. Only EXR files support layers.
pub(crate) fn encode_with_layers(
    image: &RadianceImage,
    layers: &[LayerImage],
    options: &EncodeOptions,
    format: Format,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    format.check_image(image.width, image.height, options.bit_depth)?;
    let is_complete =
        |image: &RadianceImage| image.pixels.len() == image.width as usize * image.height as usize;
    let fits = |layer: &LayerImage| {
        (layer.image.width, layer.image.height) == (image.width, image.height) && is_complete(&layer.image)
    };
    if !is_complete(image) || !layers.iter().all(fits) {
        return Err(OutputError::encoder(format, &"the image size does not match the number of pixels"));
    }
    let bytes = match format {
        Format::Png => png::encode(image, options, token),
        Format::Exr => exr::encode(image, layers, options, token),
        Format::Hdr => hdr::encode(image, options, token),
        Format::Jpeg => jpeg::encode(image, options, token),
        Format::Ppm => ppm::encode(image, options, token),
        Format::WebP => webp::encode(image, options, token),
    };
    // A canceled encoder reports an error from its writer.
    token.check_pause_and_cancel()?;
    bytes
}

/// Checks before rendering whether an image can be written to this path, and returns the format for its
/// extension. Leaves no files behind.
///
/// # Errors
/// The extension is unknown, the directory does not exist, files cannot be created there, or the target is a
/// directory or not writable.
pub fn check_image_target(path: &Path) -> Result<Format, OutputError> {
    let format = Format::from_path(path)?;
    resolve_path::check_writable(path)?;
    Ok(format)
}

/// Like [`check_image_target`], but does not create a file, so it can be called frequently.
///
/// # Errors
/// Same as [`check_image_target`], but does not detect directories that reject new files despite their
/// permissions.
pub fn check_image_target_without_writing(path: &Path) -> Result<Format, OutputError> {
    let format = Format::from_path(path)?;
    check_file_target_without_writing(path)?;
    Ok(format)
}

/// Like [`check_image_target_without_writing`], but for any type of file.
///
/// # Errors
/// Same as [`check_image_target_without_writing`], but the extension is not checked.
pub fn check_file_target_without_writing(path: &Path) -> Result<(), OutputError> {
    resolve_path::resolve_writable(path).map(drop)
}

/// Checks in advance whether a file of any type can be written to this path.
///
/// # Errors
/// Same as [`check_image_target`], but the extension is not checked.
pub fn check_output_is_writable(path: &Path) -> Result<(), OutputError> {
    resolve_path::check_writable(path)
}

/// Replaces NaN with 0 and infinities with the largest finite value.
fn to_finite(component: f32) -> f32 {
    if component.is_nan() { 0.0 } else { component.clamp(-f32::MAX, f32::MAX) }
}

/// Replaces control characters with spaces, for line-based text headers.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests;
