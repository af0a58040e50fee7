//! Properties that a file states about its pixels and that its decoder does not apply.

use super::icc;
use super::space::ColorSpace;

/// Meaning of a file's fourth sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Alpha {
    /// Alpha; the colors are not multiplied by it.
    #[default]
    Straight,
    /// Alpha, by which the colors are multiplied.
    Premultiplied,
    /// Alpha, unless it is 0 everywhere.
    Unsure,
    /// None: the sample is unused.
    Unused,
}

/// A part of a file that is ignored.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ignored {
    /// Line, from 1, in files with lines.
    pub(super) line: Option<usize>,
    pub(super) words: String,
}

/// Facts about the pixels of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Facts {
    /// The color space.
    pub(super) space: ColorSpace,
    /// The meaning of alpha.
    pub(super) alpha: Alpha,
    /// Parts of the file that are ignored.
    pub(super) ignored: Vec<Ignored>,
}

impl Facts {
    /// Adds a warning.
    pub(super) fn warn(&mut self, words: impl Into<String>) {
        self.ignored.push(Ignored { line: None, words: words.into() });
    }

    /// Warns of an animation, whose first frame is used.
    pub(super) fn warn_of_frames(&mut self, frames: u32) {
        if frames > 1 {
            self.warn(format!("it has {frames} frames; only the first is used"));
        }
    }

    /// Takes the space of an ICC profile; `None` for one that cannot be unpacked.
    pub(super) fn add_profile(&mut self, profile: Option<&[u8]>, is_gray: bool) {
        match profile.map_or(Err("it is broken".to_owned()), |profile| icc::space(profile, is_gray)) {
            Ok(space) => self.space = space,
            Err(reason) => {
                self.warn(format!("its color profile is ignored: {reason}; its colors count as sRGB"));
            }
        }
    }
}
