//! Image and animation file formats and their limits.

use std::fmt;
use std::path::Path;

use super::OutputError;

/// Format of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// 8-bit or 16-bit sRGB.
    Png,
    /// 32-bit float, linear.
    Exr,
    /// Radiance RGBE, linear.
    Hdr,
    /// 8-bit sRGB, lossy.
    Jpeg,
    /// 8-bit or 16-bit sRGB, binary.
    Ppm,
    /// 8-bit sRGB, lossless.
    WebP,
}

/// Bits per channel in integer formats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BitDepth {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits.
    Sixteen,
}

impl TryFrom<u8> for BitDepth {
    type Error = OutputError;

    fn try_from(bits: u8) -> Result<Self, OutputError> {
        match bits {
            8 => Ok(Self::Eight),
            16 => Ok(Self::Sixteen),
            _ => Err(OutputError::BitDepth { bits }),
        }
    }
}

impl Format {
    /// Extensions (without the dot) and their formats.
    const EXTENSIONS: [(&'static str, Self); 7] = [
        ("png", Self::Png),
        ("exr", Self::Exr),
        ("hdr", Self::Hdr),
        ("jpg", Self::Jpeg),
        ("jpeg", Self::Jpeg),
        ("ppm", Self::Ppm),
        ("webp", Self::WebP),
    ];

    /// All known extensions, without the dot.
    pub fn all_extensions() -> impl Iterator<Item = &'static str> {
        Self::EXTENSIONS.iter().map(|(extension, _)| *extension)
    }

    /// Lists the known extensions for messages.
    pub(super) fn list_known_extensions() -> String {
        Self::EXTENSIONS.map(|(extension, _)| format!(".{extension}")).join(", ")
    }

    /// Returns the format for a path's extension, ignoring case.
    ///
    /// # Errors
    /// The path has no extension, or an unknown one.
    pub fn from_path(path: &Path) -> Result<Self, OutputError> {
        let Some(extension) = path.extension() else {
            return Err(OutputError::NoExtension { path: path.to_owned() });
        };
        let extension = extension.to_string_lossy().to_lowercase();
        let known = Self::EXTENSIONS.iter().find(|(known, _)| *known == extension).map(|&(_, format)| format);
        known.ok_or_else(|| OutputError::UnknownExtension { path: path.to_owned(), extension })
    }

    /// Checks that this format can represent an image with this size and bit depth.
    ///
    /// # Errors
    /// [`OutputError::Unsuitable`] with the reason.
    pub fn check_image(self, width: u32, height: u32, bit_depth: BitDepth) -> Result<(), OutputError> {
        let unsuitable = |why: String| Err(OutputError::Unsuitable { format: self, why });
        if width == 0 || height == 0 {
            return unsuitable(format!("hold an image without pixels ({width}×{height})"));
        }
        let limit = match self {
            Self::Png | Self::Exr | Self::Hdr | Self::Ppm => return Ok(()),
            Self::Jpeg => 65535,
            Self::WebP => 16383,
        };
        if width > limit || height > limit {
            return unsuitable(format!("hold {width}×{height} pixels (maximum {limit}×{limit})"));
        }
        match bit_depth {
            BitDepth::Eight => Ok(()),
            BitDepth::Sixteen => unsuitable("hold 16 bits per channel".to_owned()),
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Png => "PNG",
            Self::Exr => "EXR",
            Self::Hdr => "HDR",
            Self::Jpeg => "JPEG",
            Self::Ppm => "PPM",
            Self::WebP => "WebP",
        })
    }
}

/// Format of an animation file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnimationFormat {
    /// 256 colors, shared by all frames.
    Gif,
    /// 8-bit sRGB, lossless.
    Apng,
}

impl AnimationFormat {
    const EXTENSIONS: [(&'static str, Self); 2] = [("gif", Self::Gif), ("apng", Self::Apng)];

    /// All known extensions, without the dot.
    pub fn known_extensions() -> impl Iterator<Item = &'static str> {
        Self::EXTENSIONS.iter().map(|(extension, _)| *extension)
    }

    /// Returns the format for a path's extension, ignoring case. `None` for unknown extensions.
    pub fn from_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        let known = Self::EXTENSIONS.iter().find(|(known, _)| extension.eq_ignore_ascii_case(known));
        known.map(|&(_, format)| format)
    }

    /// Checks that this format can represent frames with this size.
    ///
    /// # Errors
    /// [`OutputError::Animation`] with the reason.
    pub fn check_size(self, width: u32, height: u32) -> Result<(), OutputError> {
        const LIMIT: u32 = u16::MAX as u32;
        match self {
            Self::Gif if width > LIMIT || height > LIMIT => Err(OutputError::Animation {
                format: self,
                why: format!("cannot hold {width}×{height} pixels (maximum {LIMIT}×{LIMIT}); use .apng"),
            }),
            Self::Gif | Self::Apng => Ok(()),
        }
    }
}

impl fmt::Display for AnimationFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gif => "GIF",
            Self::Apng => "APNG",
        })
    }
}
