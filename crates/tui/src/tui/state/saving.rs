//! Saves: of the scene's files by a person, of images and of the camera by glimt.

use std::time::{Duration, Instant};

use crate::pipeline::protocol::{CameraEdit, Viewpoint};
use crate::tui::event::{Unwritten, Written};

/// A save on its way to the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::tui) struct PendingChange {
    pub generation: u64,
    pub noticed: Instant,
}

/// Saves of the scene's files, and files that were written.
pub(in crate::tui) struct SavingState {
    /// Changes of the scene's files so far.
    pub edits: u64,
    /// Request of the last edit.
    pub last_edit: Option<u64>,
    /// Request of the last edit that changed the picture.
    pub last_visible_edit: Option<u64>,
    /// Whether nobody is writing the scene's files.
    pub is_settled: bool,
    /// The last save, until the first cell that it changes is shown.
    pub change: Option<PendingChange>,
    /// Time at which the editor last gave the terminal back.
    pub editor_closed: Option<Instant>,
    /// Time from the last save to its first changed cell, without the time in the editor.
    pub first_change: Option<Duration>,
    /// Time at which glimt wrote the camera into the scene file.
    pub camera_kept: Option<Instant>,
    /// Whether an older picture was shown when a key last asked for that.
    pub is_camera_of_newest: bool,
    /// Cameras that glimt wrote into the scene file and can take back, the last one at the end.
    pub camera_edits: Vec<CameraEdit>,
    /// Whether there is a scene beside the model that is shown: `c` does not write over it.
    pub has_scene_of_model: bool,
    /// Camera of the scene that `c` wrote beside the model.
    pub camera_of_model: Option<Viewpoint>,
    /// Time at which glimt refused to write the camera into the scene file.
    pub camera_refused: Option<Instant>,

    /// Whether a key asked for the next image that is written.
    pub is_write_requested: bool,
    /// Why the current picture is not on disk, if it should be.
    pub unwritten: Option<String>,
    /// The last failure to write, until a later picture is on disk.
    pub write_failed: Option<Unwritten>,
    pub written: Vec<Written>,
}

impl SavingState {
    pub(super) const fn new() -> Self {
        Self {
            edits: 0,
            last_edit: None,
            last_visible_edit: None,
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
            unwritten: None,
            write_failed: None,
            written: Vec::new(),
        }
    }
}
