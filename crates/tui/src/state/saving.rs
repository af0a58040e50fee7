//! State of files that the user saves (scenes) or glimt writes (images and cameras).

use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::KeyboardOverrides;
use crate::event::WriteFailure;
use crate::messages;
use crate::options::ExternalChange;
use crate::pipeline::protocol::{ResolvedCamera, SavedCameraEdit, SavedSceneRenderStatus};
use crate::scene::sanitize::escape_invisible_chars;

/// A saved change that is not on the screen yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct UndisplayedChange {
    pub generation: u64,
    pub noticed: Instant,
}

/// Progress of the scene's own image, which is rendered from the saved scene with command-line overrides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SceneImageRenderProgress {
    pub state: SavedSceneRenderStatus,
    /// Progress of the render, from 0 to 1.
    pub fraction: f64,
}

/// A written image file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WrittenImageFile {
    pub path: PathBuf,
    pub bytes: u64,
    /// Generation of the request that wrote the file.
    pub generation: u64,
    /// Description of the written image, or empty if not known yet.
    pub made: String,
    /// Changes made with keys that the file includes, or `None` for the scene's own image.
    pub shows: Option<KeyboardOverrides>,
    /// Whether the image was written before its render finished.
    pub is_unfinished: bool,
    /// Whether writing a later image to this file failed, so its content is unknown.
    pub is_stale: bool,
    /// How another program changed the file.
    pub lost: Option<ExternalChange>,
}

impl WrittenImageFile {
    /// The file's path, safe to display.
    pub(crate) fn escaped_path(&self) -> String {
        escape_invisible_chars(&self.path.to_string_lossy()).into_owned()
    }

    /// Describes how another program changed the file and how to write the image anyway.
    pub(crate) fn describe_external_change(&self) -> Option<String> {
        let describe = |lost: ExternalChange| {
            if lost.is_kept() {
                messages::output_not_overwritten
            } else {
                messages::output_modified_externally
            }
        };
        self.lost.map(|lost| describe(lost)(&self.escaped_path(), lost.describe()))
    }

    /// Describes which changes made with keys are included in the written image.
    pub(crate) fn describe_included_keyboard_changes(&self) -> Vec<String> {
        self.shows.unwrap_or_default().describe_changes_since(&KeyboardOverrides::default(), false)
    }
}

/// State of saved scene files and written images.
pub(crate) struct SavedFilesState {
    /// Number of times the scene's files have changed.
    pub edits: u64,
    /// Generation of the request that followed the last edit.
    pub last_edit: Option<u64>,
    /// Generation number of the first request that used the most recently saved scene files.
    pub saved_at: u64,
    pub own: SceneImageRenderProgress,
    /// Whether the scene's files are complete, meaning that no program is writing them.
    pub is_settled: bool,
    /// The last save, or `None` once its first changed cell is on the screen.
    pub change: Option<UndisplayedChange>,
    /// Time when the editor last exited.
    pub editor_closed: Option<Instant>,
    /// Time from the last save to the first changed cell on the screen, excluding time spent in the editor.
    pub first_change: Option<Duration>,
    /// Time when glimt wrote the camera into the scene file.
    pub camera_kept: Option<Instant>,
    /// Whether an older render was displayed when the camera was last saved.
    pub is_camera_of_newest: bool,
    /// Camera edits in the scene file that can be undone, from oldest to newest.
    pub camera_edits: Vec<SavedCameraEdit>,
    /// Whether there is a scene file next to the model. `c` does not overwrite it.
    pub has_scene_of_model: bool,
    /// Camera in the scene file that `c` wrote for the model.
    pub camera_of_model: Option<ResolvedCamera>,
    /// Time when glimt refused to write the camera into the scene file.
    pub camera_refused: Option<Instant>,

    /// Whether the next image to be written was requested with a key.
    pub is_write_requested: bool,
    /// Key changes that were in effect when a write was last requested.
    pub write_shows: KeyboardOverrides,
    /// Why the current image was not written even though it should have been.
    pub unwritten: Option<String>,
    /// The last write failure, until a later image is written.
    pub write_failed: Option<WriteFailure>,
    pub written: Vec<WrittenImageFile>,
    /// Number of handled events about written, failed, and refused images.
    pub write_results: u64,
}

impl SavedFilesState {
    /// The file, if any, to which the user wrote an image that includes changes made with keys. The scene's
    /// own image does not replace it until the scene is saved or the user writes another image.
    pub(crate) fn find_file_with_key_changes(&self) -> Option<&WrittenImageFile> {
        let is_current = |written: &&WrittenImageFile| !written.is_stale && written.lost.is_none();
        let is_newer = |written: &&WrittenImageFile| written.generation >= self.saved_at;
        self.written.iter().filter(is_current).filter(is_newer).find(|written| written.shows.is_some())
    }

    /// Whether all files were written before the scene was last saved.
    pub(crate) fn are_images_older_than_scene(&self) -> bool {
        self.written.iter().all(|written| written.generation < self.saved_at)
    }

    pub(super) fn new() -> Self {
        Self {
            edits: 0,
            last_edit: None,
            saved_at: 0,
            own: SceneImageRenderProgress { state: SavedSceneRenderStatus::NotBegun, fraction: 0.0 },
            is_settled: true,
            change: None,
            editor_closed: None,
            first_change: None,
            camera_kept: None,
            is_camera_of_newest: false,
            camera_edits: Vec::new(),
            has_scene_of_model: false,
            camera_of_model: None,
            camera_refused: None,
            is_write_requested: false,
            write_shows: KeyboardOverrides::default(),
            unwritten: None,
            write_failed: None,
            written: Vec::new(),
            write_results: 0,
        }
    }
}
