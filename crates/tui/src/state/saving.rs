//! Saves: of the scene's files by a person, of images and of the camera by glimt.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::request::Toggles;
use crate::event::WriteFailure;
use crate::options::Lost;
use crate::pipeline::protocol::{CameraEdit, OwnState, Viewpoint};

/// A save on its way to the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PendingChange {
    pub generation: u64,
    pub noticed: Instant,
}

/// The scene's own image: that of the scene file as saved, with the options of the command line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OwnImage {
    pub state: OwnState,
    /// Progress of its render, from 0 to 1.
    pub fraction: f64,
}

/// A picture that was written.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WrittenFile {
    pub path: PathBuf,
    pub bytes: u64,
    /// Number of the request.
    pub generation: u64,
    /// Description of the file, in words, as far as it is known.
    pub made: String,
    /// Changes by keys that it shows. `None` for the scene's own image.
    pub shows: Option<Toggles>,
    /// Whether a later picture could not be written there: nobody knows what the file holds.
    pub is_stale: bool,
    /// Change of the file by another program.
    pub lost: Option<Lost>,
}

/// Saves of the scene's files, and files that were written.
pub(crate) struct SavingState {
    /// Changes of the scene's files so far.
    pub edits: u64,
    /// Request of the last edit.
    pub last_edit: Option<u64>,
    /// The first request with the files as they were saved last.
    pub saved_at: u64,
    pub own: OwnImage,
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
    /// Changes by keys that were shown when a key last asked for that.
    pub write_shows: Toggles,
    /// Why the current picture is not on disk, if it should be.
    pub unwritten: Option<String>,
    /// The last failure to write, until a later picture is on disk.
    pub write_failed: Option<WriteFailure>,
    pub written: Vec<WrittenFile>,
}

impl SavingState {
    pub(super) fn new() -> Self {
        Self {
            edits: 0,
            last_edit: None,
            saved_at: 0,
            own: OwnImage { state: OwnState::NotBegun, fraction: 0.0 },
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
            write_shows: Toggles::default(),
            unwritten: None,
            write_failed: None,
            written: Vec::new(),
        }
    }
}
