//! Image metadata that decoders do not apply to the pixels.

use super::icc;
use super::space::ColorSpace;

/// Meaning of the alpha sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum AlphaInterpretation {
    /// Straight alpha: colors are not multiplied by alpha.
    #[default]
    Straight,
    /// Premultiplied alpha: colors are multiplied by alpha.
    Premultiplied,
    /// Straight alpha, ignored if it is 0 everywhere.
    UnusedIfZero,
    /// Unused sample.
    Unused,
    /// One bit, which the decoder drops.
    Dropped,
}

/// A warning about an ignored part of a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImageWarning {
    /// Line number, starting at 1, or `None` for files without lines.
    pub(super) line: Option<usize>,
    pub(super) words: String,
}

/// Metadata of an image.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ImageColorMetadata {
    /// Color space.
    pub(super) space: ColorSpace,
    /// Meaning of the alpha sample.
    pub(super) alpha: AlphaInterpretation,
    /// Warnings about ignored parts of the file.
    pub(super) warnings: Vec<ImageWarning>,
}

impl ImageColorMetadata {
    /// Adds a warning.
    pub(super) fn add_warning(&mut self, words: impl Into<String>) {
        self.warnings.push(ImageWarning { line: None, words: words.into() });
    }

    /// Adds a warning that only the first frame of an animation is used.
    pub(super) fn warn_about_extra_frames(&mut self, frames: u32) {
        if frames > 1 {
            self.add_warning(format!("it has {frames} frames; only the first is used"));
        }
    }

    /// Applies an ICC profile. `None` means that the profile could not be decompressed.
    pub(super) fn apply_icc_profile(&mut self, profile: Option<&[u8]>, is_gray: bool) {
        match profile
            .map_or(Err(icc::MALFORMED.to_owned()), |profile| icc::color_space_from_profile(profile, is_gray))
        {
            Ok(space) => self.space = space,
            Err(reason) => self.add_warning(profile_ignored_warning(&reason)),
        }
    }
}

/// Warning about an ignored ICC profile.
pub(super) fn profile_ignored_warning(reason: &str) -> String {
    format!("the color profile is ignored ({reason}); colors are read as sRGB")
}
