//! Existing files that an image must not replace unless the user passes `--force`.

use std::path::{Path, PathBuf};

use crate::output::{may_replace_image, part, scene_of_image, scene_path};

/// Which existing files an image must not replace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Protection {
    /// All except images of this scene, because the output has the default name.
    OtherImages(PathBuf),
    /// Parts and checkpoints, because the user chose the output's name.
    Parts,
    /// None, because of `--force`.
    Nothing,
}

/// A file that an image must not replace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ProtectedFile {
    /// The image of another scene.
    OtherScene,
    /// A file that is not an image written by glimt.
    Foreign,
}

impl Protection {
    /// Returns why an image must not replace the file at a path, or `None` if it may.
    pub(crate) fn applies_to(&self, at: &Path) -> Option<ProtectedFile> {
        match self {
            Self::OtherImages(_) if may_replace_image(at).reason_to_keep().is_some() => {
                Some(ProtectedFile::Foreign)
            }
            Self::OtherImages(scene) => other_scene(scene, at).map(|_| ProtectedFile::OtherScene),
            Self::Parts => part::is_part(at).then_some(ProtectedFile::Foreign),
            Self::Nothing => None,
        }
    }
}

/// Returns the scene recorded in an image written by glimt, unless it is this scene.
pub(crate) fn other_scene(scene: &Path, at: &Path) -> Option<String> {
    scene_of_image(at).filter(|named| !scene_path::is_same(named, scene, at))
}
