//! File formats and what they can hold.

use std::fmt;
use std::path::Path;

use super::OutputError;

/// A file format of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// 8 or 16 bit sRGB.
    Png,
    /// 32 bit float, linear.
    Exr,
    /// Radiance RGBE, linear.
    Hdr,
    /// 8 bit sRGB, lossy.
    Jpeg,
    /// 8 or 16 bit sRGB, binary.
    Ppm,
    /// 8 bit sRGB, without loss.
    WebP,
}

/// Bits per channel of integer formats.
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
    /// Endings, without the dot, and their formats.
    const ENDINGS: [(&'static str, Self); 7] = [
        ("png", Self::Png),
        ("exr", Self::Exr),
        ("hdr", Self::Hdr),
        ("jpg", Self::Jpeg),
        ("jpeg", Self::Jpeg),
        ("ppm", Self::Ppm),
        ("webp", Self::WebP),
    ];

    /// All known endings, without the dot.
    pub fn endings() -> impl Iterator<Item = &'static str> {
        Self::ENDINGS.iter().map(|(ending, _)| *ending)
    }

    /// The known endings, as a message lists them.
    pub(super) fn known_endings() -> String {
        Self::ENDINGS.map(|(ending, _)| format!(".{ending}")).join(", ")
    }

    /// The format of a path's ending, in small letters or capitals.
    ///
    /// # Errors
    /// There is no ending, or no format has it.
    pub fn of(path: &Path) -> Result<Self, OutputError> {
        let Some(ending) = path.extension() else {
            return Err(OutputError::NoEnding { path: path.to_owned() });
        };
        let ending = ending.to_string_lossy().to_lowercase();
        let known = Self::ENDINGS.iter().find(|(known, _)| *known == ending).map(|&(_, format)| format);
        known.ok_or_else(|| OutputError::UnknownEnding { path: path.to_owned(), ending })
    }

    /// Checks that a file of this format can hold such a picture.
    ///
    /// # Errors
    /// [`OutputError::Unsuitable`] with the reason.
    pub fn check_picture(self, width: u32, height: u32, bit_depth: BitDepth) -> Result<(), OutputError> {
        let unsuitable = |why: String| Err(OutputError::Unsuitable { format: self, why });
        if width == 0 || height == 0 {
            return unsuitable(format!("hold a picture without pixels ({width}×{height})"));
        }
        let most = match self {
            Self::Png | Self::Exr | Self::Hdr | Self::Ppm => return Ok(()),
            Self::Jpeg => 65535,
            Self::WebP => 16383,
        };
        if width > most || height > most {
            return unsuitable(format!("hold {width}×{height} pixels, at most {most}×{most}"));
        }
        match bit_depth {
            BitDepth::Eight => Ok(()),
            BitDepth::Sixteen => unsuitable("hold 16 bits a channel".to_owned()),
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

    /// All known endings, without the dot.
    pub fn endings() -> impl Iterator<Item = &'static str> {
        Self::ENDINGS.iter().map(|(ending, _)| *ending)
    }

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
