//! Existing files that an image must not replace unless the user passes `--force`.

use std::path::{Path, PathBuf};

use crate::output::{check_image_replacement, part, scene_name_in_png, scene_path};

/// Which existing files an image must not replace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum OverwriteProtection {
    /// All except images of this scene, because the output has the default name.
    OtherImages(PathBuf),
    /// Parts and checkpoints, because the user chose the output's name.
    Parts,
    /// None, because of `--force`.
    Nothing,
}

/// Why an image must not replace an existing file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OverwriteRefusalReason {
    /// The file is the image of another scene.
    OtherScene,
    /// The file is not an image written by glimt.
    Foreign,
}

impl OverwriteProtection {
    /// Returns why an image must not replace the file at a path, or `None` if it may.
    pub(crate) fn reason_to_keep(&self, at: &Path) -> Option<OverwriteRefusalReason> {
        match self {
            Self::OtherImages(_) if check_image_replacement(at).reason_to_keep().is_some() => {
                Some(OverwriteRefusalReason::Foreign)
            }
            Self::OtherImages(scene) => {
                recorded_scene_if_different(scene, at).map(|_| OverwriteRefusalReason::OtherScene)
            }
            Self::Parts => part::is_part_or_checkpoint(at).then_some(OverwriteRefusalReason::Foreign),
            Self::Nothing => None,
        }
    }
}

/// Returns the scene recorded in an image written by glimt, or `None` if no scene is recorded or it is the
/// given scene.
pub(crate) fn recorded_scene_if_different(scene: &Path, at: &Path) -> Option<String> {
    scene_name_in_png(at).filter(|named| !scene_path::metadata_path_refers_to_scene(named, scene, at))
}
